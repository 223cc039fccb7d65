"""A browser that looks at pages: Chromium without a window, drawing in software, driven by Selenium."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from collide.pages.page_file import DataBlock, page_pieces

#: Nothing of the browser's own may ask a server for anything: the network log would hold it.
ARGUMENTS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-extensions", "--hide-scrollbars",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--force-prefers-reduced-motion",
)
SECONDS = 20.0


@contextmanager
def browser(folder: Path) -> Iterator[PageBrowser]:
    """A browser whose profile is in a folder; the test is skipped where there is none."""
    pytest.importorskip("selenium", reason="selenium drives the browser: pip install 'collide-robotics[dev]'")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if not (chromium and driver):
        pytest.skip("no Chromium with its chromedriver here: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in (*ARGUMENTS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    made = webdriver.Chrome(service=Service(driver), options=options)
    try:
        yield PageBrowser(made, folder)
    finally:
        made.quit()


class PageBrowser:
    """Opens pages of data and asks them; scripts are functions' bodies, as Selenium has them."""

    def __init__(self, driver, folder: Path):
        self.driver, self._folder = driver, folder

    def write(self, name: str, **blocks) -> Path:
        """A page of blocks of data: report, drawing, contacts, ours."""
        place = self._folder / f"{name}.html"
        data = [DataBlock(key, value) for key, value in blocks.items()]
        place.write_text("".join(page_pieces(name, data)), encoding="utf-8")
        return place

    def open(self, page: Path, link: str = "", *, width: int = 1000, height: int = 500) -> None:
        """Opens a page in a window of this size, and waits until it stands."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.driver.get("about:blank")
        self.logs()
        self.driver.get(page.as_uri() + link)
        self.wait("return document.documentElement.dataset.ready === 'true'")

    def logs(self) -> list[str]:
        """What the console and the network log hold since the last call: errors, and requests that leave the page."""
        console = [f"{entry['level']}: {entry['message']}" for entry in self.driver.get_log("browser")]
        events = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        requests = [
            event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"
        ]
        return console + [url for url in requests if not url.startswith(("file:", "data:", "about:", "blob:"))]

    def run(self, script: str, *values):
        return self.driver.execute_script(script, *values)

    def wait(self, script: str, *values):
        """The first true answer of a script."""
        end = time.monotonic() + SECONDS
        while not (answer := self.run(script, *values)):
            assert time.monotonic() < end, f"never true: {script}"
            time.sleep(0.02)
        return answer

    def measures(self) -> dict:
        """Draw calls, triangles, camera of a picture made now."""
        return self.run("collideViewer.renderNow(); return collideViewer.measures()")

    def press(self, keys: Iterable[str]) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        for key in keys:
            ActionChains(self.driver, duration=0).send_keys(key).perform()

    def texts(self, selector: str) -> list[str]:
        return self.run("return [...document.querySelectorAll(arguments[0])].map((node) => node.textContent)", selector)

    def click(self, selector: str, row: int = 0) -> None:
        self.run("document.querySelectorAll(arguments[0])[arguments[1]].click()", selector, row)

    def enter(self, selector: str, value: str | float) -> None:
        """Gives a field a value as a reader would."""
        self.run(
            "const field = document.querySelector(arguments[0]); field.value = arguments[1];"
            "field.dispatchEvent(new Event('input', {bubbles: true}))", selector, value,
        )
