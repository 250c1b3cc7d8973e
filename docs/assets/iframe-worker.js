/* Web workers do not run from file: addresses. Search needs one, so a hidden frame stands in for it
   when the site is opened from a disk. */
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      this.onmessage = null
      this.frame = document.createElement("iframe")
      this.frame.hidden = true
      document.body.appendChild(this.frame)
      const inner = this.frame.contentWindow
      inner.document.open()
      inner.document.write(
        `<html><body><script>
          onmessage = null
          function postMessage(data) { parent.dispatchEvent(new MessageEvent("message", { data, source: window })) }
          function importScripts(...urls) {
            return urls.reduce((before, url) => before.then(() => new Promise((done, fail) => {
              const script = document.createElement("script")
              script.src = url
              script.onload = done
              script.onerror = fail
              document.body.appendChild(script)
            })), Promise.resolve())
          }
        <\/script><script src="${url}"><\/script></body></html>`
      )
      inner.document.close()
      this.ready = new Promise(done => (this.frame.onload = done))
      window.addEventListener("message", event => {
        if (event.source !== inner) return
        event.stopImmediatePropagation()
        const copy = new MessageEvent("message", { data: event.data })
        this.dispatchEvent(copy)
        if (this.onmessage) this.onmessage(copy)
      })
    }
    postMessage(data) {
      this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })))
    }
    terminate() { this.frame.remove() }
  }
}
