"""A real Chromium that looks at the page: for tests, benchmarks and the pictures of the docs."""

from __future__ import annotations

import base64
import shutil
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which('chromium') or shutil.which('chromium-browser')
DRIVER = shutil.which('chromedriver')
MISSING = 'no Chromium: apt-get install chromium chromium-driver'
PATIENCE = 240.0
"""Seconds for which a page is waited for: Chromium lets all else on a busy machine go first."""
PHONE, DESK = (390, 844), (1400, 1000)


class Viewer:
    """A browser on the page."""

    def __init__(self, address: str) -> None:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        options.binary_location = str(CHROMIUM)
        for argument in ('headless=new', 'no-sandbox', 'disable-gpu', 'disable-dev-shm-usage'):
            options.add_argument(f'--{argument}')
        options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
        self.driver: Any = webdriver.Chrome(options=options, service=Service(DRIVER))
        self.driver.set_script_timeout(PATIENCE)
        self.size(*DESK)
        self.address = address
        self.driver.get(address)

    def size(self, width: int, height: int, *, dark: bool = False) -> None:
        self.driver.execute_cdp_cmd(
            'Emulation.setDeviceMetricsOverride',
            {'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': width < 500},
        )
        scheme = {'name': 'prefers-color-scheme', 'value': 'dark' if dark else 'light'}
        self.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': [scheme]})

    def js(self, script: str, *values: Any) -> Any:
        return self.driver.execute_script(script, *values)

    def text(self, selector: str) -> str:
        return str(self.js('return document.querySelector(arguments[0])?.textContent', selector))

    def count(self, selector: str) -> int:
        return int(self.js('return document.querySelectorAll(arguments[0]).length', selector))

    def attribute(self, selector: str, name: str) -> str:
        query = 'return document.querySelector(arguments[0])?.getAttribute(arguments[1])'
        return str(self.js(query, selector, name) or '')

    def until(self, what: Callable[[], Any], seconds: float = PATIENCE) -> Any:
        from selenium.webdriver.support.wait import WebDriverWait

        return WebDriverWait(self.driver, seconds, 0.1).until(lambda _: what())

    def click(self, selector: str) -> None:
        self.js('document.querySelector(arguments[0]).click()', selector)

    def changes(self, look: Callable[[], Any], seconds: float = PATIENCE) -> None:
        before = look()
        self.until(lambda: look() != before, seconds)

    def close(self) -> None:
        self.driver.quit()

    def picture(self, file: Path, width: int, height: int, *, dark: bool = False) -> None:
        """Save what is to be seen on a screen of this width; from a height of 0 on, all of it."""
        self.size(width, height or 1000, dark=dark)
        self.js('scrollTo(0, 0)')
        height = height or int(self.js('return document.documentElement.scrollHeight'))
        self.size(width, height, dark=dark)
        image = self.driver.execute_cdp_cmd('Page.captureScreenshot', {'format': 'png'})
        file.write_bytes(base64.b64decode(image['data']))

    def axe(self) -> list[str]:
        """Return what the accessibility checker finds, which a Python package brings along."""
        if not self.js('return "axe" in window'):
            self.js((files('axe_core_python') / 'axe.min.js').read_text(encoding='utf-8'))
        found: list[str] = self.driver.execute_async_script(
            'const done = arguments[0]; axe.run().then((r) => done(r.violations.map((v) => '
            'v.id + ": " + v.nodes.slice(0, 3).map((n) => n.target + " " + n.failureSummary))))'
        )
        return found
