"use strict"
// What scripts add to a page that says all without them: figures with values and zoom, curves on and off, images and
// CSV files, tables sorted by a column, a slider over the pressures of maps. plotly.js draws the figures.

const NAME = document.body.dataset.name.replace(/[^\p{L}\p{N}.-]+/gu, "_")
const DARK = matchMedia("(prefers-color-scheme: dark)")
const CONFIG = { displayModeBar: false, responsive: true, doubleClick: false, showTips: false }
const SCALE = 4 // pixels of a PNG for each of the figure

function create(tag, properties, ...children) {
  const element = Object.assign(document.createElement(tag), properties)
  element.append(...children)
  return element
}

function button(text, action, label) {
  const made = create("button", { type: "button", onclick: action }, text)
  if (label) made.setAttribute("aria-label", label)
  return made
}

// Files

function save(name, content, type) {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }))
  create("a", { href: url, download: `${NAME}-${name}` }).click()
  setTimeout(() => URL.revokeObjectURL(url), 10000)
}

function csv(rows) {
  const cell = value => {
    let text = value === null || value === undefined ? "" : String(value)
    if (/^[=+\-@\t\r]/.test(text) && isNaN(Number(text))) text = `'${text}` // no formula of a spreadsheet
    return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text
  }
  return rows.map(row => `${row.map(cell).join(",")}\n`).join("")
}

// The static figure on white paper: its colours are variables that are named after those of the light scheme.
function staticImage(drawing) {
  const copy = drawing.cloneNode(true)
  const { width, height } = drawing.viewBox.baseVal
  for (const [key, value] of Object.entries({ width, height, fill: "#000000", "stroke-linejoin": "round" }))
    copy.setAttribute(key, value)
  return new XMLSerializer()
    .serializeToString(copy)
    .replaceAll("var(--ink)", "#000000")
    .replaceAll("var(--paper)", "#ffffff")
    .replace(/var\(--c-([0-9a-f]{6})\)/g, "#$1")
}

async function png(svg) {
  const image = new Image()
  image.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }))
  await image.decode()
  const canvas = create("canvas", { width: SCALE * image.width, height: SCALE * image.height })
  const context = canvas.getContext("2d")
  context.fillStyle = "#ffffff"
  context.fillRect(0, 0, canvas.width, canvas.height)
  context.drawImage(image, 0, 0, canvas.width, canvas.height)
  URL.revokeObjectURL(image.src)
  return new Promise(done => canvas.toBlob(done, "image/png"))
}

// Figures

const variable = colour =>
  ({ "#000000": "--ink", "#ffffff": "--paper", "#d5d9df": "--rule" })[colour] ?? `--c-${colour.slice(1)}`

const onScreen = colour =>
  getComputedStyle(document.documentElement).getPropertyValue(variable(colour)).trim() || colour

class Figure {
  constructor(element, data) {
    Object.assign(this, { element, data, name: element.dataset.name, off: new Set() })
    const drawing = element.querySelector(".drawing")
    this.plot = create("div", { className: "plot", tabIndex: 0, onkeydown: event => this.key(event) })
    this.plot.setAttribute("role", "img")
    this.plot.setAttribute("aria-label", drawing.firstElementChild.getAttribute("aria-label"))
    this.plot.setAttribute("aria-keyshortcuts", "+ - 0 ArrowLeft ArrowRight ArrowUp ArrowDown")
    drawing.before(this.legend(), this.plot)
    element.classList.add("live")
    this.draw().then(() => {
      this.plot.on("plotly_doubleclick", () => this.reset())
      this.plot.on("plotly_relayout", () => this.follow())
    })
  }

  legend() {
    const entries = this.data.legend.map(({ name, symbol, colour }) => {
      const sign = create("span", { className: "sign" }, symbol)
      sign.style.color = `var(${variable(colour)}, ${colour})`
      sign.setAttribute("aria-hidden", "true")
      const entry = create("button", { type: "button" }, sign, name)
      entry.setAttribute("aria-pressed", "true")
      entry.onclick = () => {
        if (!this.off.delete(name)) this.off.add(name)
        entry.setAttribute("aria-pressed", String(!this.off.has(name)))
        this.draw()
      }
      return entry
    })
    const list = create("div", { className: "legend" }, this.data.heading, ...entries)
    list.setAttribute("role", "group")
    list.setAttribute("aria-label", "Curves")
    return list
  }

  shown() {
    return this.data.data.filter(trace => !trace.meta.some(name => this.off.has(name)))
  }

  // What plotly.js draws, with every colour of the figure replaced.
  content(colour) {
    const { layout } = this.data
    const axis = { showline: true, mirror: true, ticks: "inside", linecolor: "#000000", tickcolor: "#000000",
                   gridcolor: "#d5d9df", griddash: "dot", zeroline: false, exponentformat: "power", automargin: true }
    const text = {
      data: this.shown(),
      layout: {
        xaxis: { ...axis, ...layout.xaxis, ...(layout.xaxis2 && { mirror: false }) },
        yaxis: { ...axis, ...layout.yaxis },
        font: { color: "#000000", size: 13, family: 'system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif' },
        paper_bgcolor: "#ffffff", plot_bgcolor: "#ffffff",
        hoverlabel: { bgcolor: "#ffffff", bordercolor: "#000000", align: "left", font: { color: "#000000" } },
        margin: { l: 60, r: 14, t: 10, b: 50 },
        hovermode: "closest", hoverdistance: 30, showlegend: false, uirevision: "kept",
        dragmode: matchMedia("(pointer: coarse)").matches ? false : "zoom",
      },
    }
    if (layout.xaxis2) {
      text.layout.xaxis2 = { ...axis, ...layout.xaxis2, mirror: false, showgrid: false, tickmode: "auto",
                              range: this.above(layout.xaxis.range) }
      text.data.push({ x: [null], y: [null], xaxis: "x2", hoverinfo: "skip", showlegend: false }) // else it is not drawn
    }
    return JSON.parse(JSON.stringify(text), (key, value) =>
      key !== "meta" && typeof value === "string" && /^#[0-9a-f]{6}$/.test(value) ? colour(value) : value)
  }

  async draw() {
    const { data, layout } = this.content(onScreen)
    await Plotly.react(this.plot, data, layout, CONFIG)
    return this.follow()
  }

  // The range of the axis at the top for a range of the x axis.
  above(range) {
    const { data: { factor, layout } } = this
    return range.map(end => (layout.xaxis.type === "log" ? end + Math.log10(factor) : end * factor))
  }

  // The axis at the top follows the x axis.
  follow() {
    const { xaxis, xaxis2 } = this.plot.layout
    if (!xaxis2) return
    const range = this.above(xaxis.range)
    if (range.some((end, i) => Math.abs(end - xaxis2.range[i]) > 1e-9 * Math.abs(range[1] - range[0])))
      return Plotly.relayout(this.plot, { "xaxis2.range": range })
  }

  // Shift by shares of the axes and zoom; of a logarithmic axis plotly.js has the decadic logarithm.
  move(right, up, zoom = 1) {
    const ranges = {}
    for (const [axis, shift] of [["xaxis", right], ["yaxis", up]]) {
      const [low, high] = this.plot.layout[axis].range
      const middle = (low + high) / 2 + shift * (high - low), half = ((high - low) / 2) * zoom
      ranges[`${axis}.range`] = [middle - half, middle + half]
    }
    return Plotly.relayout(this.plot, ranges)
  }

  reset() {
    const { xaxis, yaxis } = this.data.layout
    return Plotly.relayout(this.plot, { "xaxis.range": [...xaxis.range], "yaxis.range": [...yaxis.range] })
  }

  key(event) {
    const moves = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1],
                    "+": [0, 0, 0.8], "-": [0, 0, 1.25] }
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in moves || event.key === "0")) return
    event.preventDefault()
    if (event.key === "0") this.reset()
    else this.move(...moves[event.key])
  }

  tools() {
    return [button("+", () => this.move(0, 0, 0.8), "Zoom in"), button("−", () => this.move(0, 0, 1.25), "Zoom out"),
            button("Reset", () => this.reset(), "Reset zoom"), button("CSV", () => this.csv(), "Save data as CSV")]
  }

  async image() {
    const { data, layout } = this.content(colour => colour)
    const { xaxis, yaxis } = this.plot.layout
    Object.assign(layout.xaxis, { range: xaxis.range })
    Object.assign(layout.yaxis, { range: yaxis.range })
    if (layout.xaxis2) layout.xaxis2.range = this.above(xaxis.range)
    const title = { text: this.data.heading }
    Object.assign(layout, { showlegend: true, legend: { orientation: "h", y: 1.02, yanchor: "bottom", title } })
    const named = new Set()
    for (const trace of data.filter(trace => trace.meta)) {
      trace.name = trace.meta.at(-1)
      trace.showlegend = !named.has(trace.name)
      named.add(trace.name)
    }
    const address = await Plotly.toImage({ data, layout }, { format: "svg", width: 640, height: 470 })
    return decodeURIComponent(address.slice(address.indexOf(",") + 1))
  }

  csv() {
    const [x, y] = this.data.names
    const plain = html => html.replaceAll("&lt;", "<").replaceAll("&gt;", ">").replaceAll("&amp;", "&")
    const rows = [["curve", "kind", x, y, "error down", "error up", "details"]]
    for (const { meta, mode, x: xs, y: ys, error_y: bars, text } of this.shown())
      xs.forEach((value, i) => {
        const kind = { markers: "simulation", lines: "line", none: "confidence" }[mode]
        const down = (bars?.arrayminus ?? bars?.array)?.[i]
        rows.push([meta.join(", "), kind, value, ys[i], down, bars?.array[i],
                   text && plain(text[i].split("<br>").slice(3).join("; "))]) // after curve, x and y, as _hover has them
      })
    save(`${this.name}.csv`, csv(rows), "text/csv")
  }
}

const figures = []
for (const element of document.querySelectorAll("figure[data-name]")) {
  const data = element.querySelector("script"), drawing = element.querySelector("svg"), { name } = element.dataset
  const live = data && new Figure(element, JSON.parse(data.textContent))
  const image = async () => (live ? live.image() : staticImage(drawing))
  if (live) figures.push(live)
  const tools = create("div", { className: "tools" }, ...(live ? live.tools() : []),
    button("SVG", async () => save(`${name}.svg`, await image(), "image/svg+xml"), "Save figure as SVG"),
    button("PNG", async () => save(`${name}.png`, await png(await image())), "Save figure as PNG"))
  tools.setAttribute("role", "group")
  tools.setAttribute("aria-label", "Figure")
  element.querySelector("figcaption").before(tools)
}
DARK.addEventListener("change", () => figures.forEach(figure => figure.draw()))

// Tables

const text = cell => cell.textContent.trim()

function inOrder(column, sign) {
  return (one, other) => {
    const [a, b] = [one, other].map(row => text(row.cells[column]))
    const blank = (a === "–") - (b === "–") // last in both orders
    const [x, y] = [a, b].map(parseFloat)
    return blank || sign * (isNaN(x) || isNaN(y) ? a.localeCompare(b, "en", { numeric: true }) : x - y)
  }
}

function sort(table, head) {
  const falling = head.getAttribute("aria-sort") === "ascending"
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort")
  head.setAttribute("aria-sort", falling ? "descending" : "ascending")
  for (const body of table.tBodies) {
    const rows = [...body.rows].filter(row => !row.classList.contains("group"))
    body.append(...rows.sort(inOrder(head.cellIndex, falling ? -1 : 1)))
  }
}

document.querySelectorAll("main table").forEach((table, place) => {
  for (const head of table.tHead.rows[0].cells) {
    const sorter = create("button", { type: "button", onclick: () => sort(table, head) }, ...head.childNodes)
    head.append(sorter)
  }
  const rows = () => [
    ["group", ...[...table.tHead.rows[0].cells].map(text)],
    ...[...table.tBodies].flatMap(body => {
      const title = body.querySelector(".group")
      return [...body.rows].filter(row => row !== title)
        .map(row => [title ? text(title) : "", ...[...row.cells].map(text)])
    }),
  ]
  const section = table.closest("section")?.id ?? "results"
  const saver = button("CSV", () => save(`${section}-table-${place + 1}.csv`, csv(rows()), "text/csv"), "Save table as CSV")
  table.closest(".scroll").after(create("div", { className: "tools" }, saver))
})

// Maps

document.querySelectorAll(".pressures").forEach((series, place) => {
  const contacts = [...series.querySelectorAll(".contact")]
  if (contacts.length < 2) return
  const slider = create("input", { type: "range", min: 0, max: contacts.length - 1, value: 0, id: `pressure-${place}` })
  const show = () => {
    contacts.forEach((contact, i) => contact.classList.toggle("off", i !== Number(slider.value)))
    slider.setAttribute("aria-valuetext", text(contacts[slider.value].querySelector("h4")))
  }
  slider.oninput = show
  const label = create("label", { htmlFor: slider.id }, "Pressure")
  series.querySelector("h3").after(create("div", { className: "slider" }, label, slider))
  show()
})
