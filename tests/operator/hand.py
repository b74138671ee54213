""""""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from surveillance_operator.page.server import Page
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, Viewer

SEVEN = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'


in_browser = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason=MISSING)


class Hand:
    """A person at the editor."""

    def __init__(self, viewer: Viewer, page: Page, size: tuple[int, int] = DESK) -> None:
        self.viewer = viewer
        viewer.size(*size)
        viewer.driver.get(page.address)
        viewer.until(lambda: viewer.js('return Boolean(window.editor?.place)'))

    def at(self, x: float, y: float) -> tuple[float, float]:
        across, down = self.viewer.js('return editor.at(arguments[0], arguments[1])', x, y)
        return float(across), float(down)

    def mouse(self, kind: str, x: float, y: float) -> None:
        across, down = self.at(x, y)
        self.viewer.driver.execute_cdp_cmd(
            'Input.dispatchMouseEvent',
            {'type': kind, 'x': across, 'y': down, 'button': 'left', 'buttons': 1, 'clickCount': 1},
        )

    def drag(self, *points: tuple[float, float]) -> None:
        self.mouse('mousePressed', *points[0])
        for point in points[1:]:
            self.mouse('mouseMoved', *point)
        self.mouse('mouseReleased', *points[-1])

    def click(self, x: float, y: float) -> None:
        self.drag((x, y))

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        touches = [dict(zip(('x', 'y'), self.at(*point), strict=True)) for point in points]
        self.viewer.driver.execute_cdp_cmd(
            'Input.dispatchTouchEvent', {'type': kind, 'touchPoints': touches}
        )

    def keys(self, *keys: str) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.viewer.driver).send_keys(*keys).perform()

    def chord(self, *keys: str) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        chain = ActionChains(self.viewer.driver)
        for key in keys[:-1]:
            chain = chain.key_down(key)
        chain = chain.send_keys(keys[-1])
        for key in keys[:-1]:
            chain = chain.key_up(key)
        chain.perform()

    def tool(self, name: str) -> None:
        self.viewer.click(f'[data-tool={name}]')

    def place(self, path: str) -> Any:
        return self.viewer.js(f'return editor.place.{path}')

    def said(self, words: str) -> None:
        self.viewer.until(lambda: words in self.viewer.text('#said'))

    def fill(self, field: str, text: str) -> None:
        from selenium.webdriver.common.by import By
        from selenium.webdriver.common.keys import Keys

        selector = f'[data-field={field}]'
        found = self.viewer.driver.find_element(By.CSS_SELECTOR, selector)
        found.send_keys(Keys.CONTROL, 'a')
        found.send_keys(Keys.CONTROL)
        found.send_keys(text)

    @property
    def problem(self) -> str:
        return self.viewer.text('#problem')
