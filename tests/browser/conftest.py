"""A headless Chromium that a page is opened in, of any width and colour scheme."""

import json
from pathlib import Path

import pytest

BINARY, DRIVER = "/usr/bin/chromium", "/usr/bin/chromedriver"


class Browser:
    """Chromium, with what it had to say and what it asked for."""

    def __init__(self, driver):
        self.driver = driver

    def visit(self, path: Path, width: int = 1280, scheme: str = "light"):
        """Open a page afresh."""
        scheme = {"name": "prefers-color-scheme", "value": scheme}
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.requests()
        self.driver.get(path.as_uri())

    def wait(self, script, *values):
        """What JavaScript returns, as soon as that is true."""
        from selenium.webdriver.support.wait import WebDriverWait

        return WebDriverWait(self.driver, 60).until(lambda _: self.run(script, *values))

    def downloads(self, folder: Path):
        """Have files that the page saves written to a folder."""
        behaviour = {"behavior": "allow", "downloadPath": str(folder)}
        self.driver.execute_cdp_cmd("Browser.setDownloadBehavior", behaviour)

    def run(self, script, *values):
        """Run JavaScript in the page."""
        return self.driver.execute_script(script, *values)

    def requests(self):
        """Addresses that were asked for since the last call."""
        events = (json.loads(entry["message"])["message"] for entry in self._log("performance"))
        sent = (e for e in events if e["method"] == "Network.requestWillBeSent")
        return [event["params"]["request"]["url"] for event in sent]

    def complaints(self):
        """What the console says."""
        return self._log("browser")

    def _log(self, name):
        return self.driver.get_log(name)


@pytest.fixture(scope="session")
def browser():
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BINARY
    for word in ("headless=new", "no-sandbox", "disable-dev-shm-usage", "disable-gpu"):
        options.add_argument(f"--{word}")
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(120)
    yield Browser(driver)
    driver.quit()
