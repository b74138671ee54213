"""What a guard at the page has at hand: Stop by a key, what is open in the head, one screen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer
from tests.operator.missions import whole

pytestmark = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason=MISSING)
ALERT = {
    'number': 3, 'kind': 'door', 'subject': 'D6', 'seen': 'open', 'place': 'R3', 'state': 'open',
    'severity': 3, 'began': 1e9, 'last': 1e9, 'sightings': 1, 'looks': 1, 'confidence': 1.0,
}  # fmt: skip


class Desk:
    """The page with control, and what was pressed on it."""

    def __init__(self) -> None:
        self.done: list[Any] = []
        self.events: list[Any] = []
        self.broadcaster = Broadcaster()
        self.page = Page(
            self.broadcaster,
            questions={'sightings': self._sightings},
            actions={
                'stop': lambda on, **_: self._press(f'stop {on}'),
                'machine': lambda word, **_: self._press(word),
                'remove_room': lambda name: self._press(f'remove {name}'),
            },
            port=0,
        )
        self.page.start()
        self.viewer = Viewer(self.page.address)

    def _press(self, what: str) -> str:
        self.done.append(what)
        return what

    def _sightings(self, robot: str = '') -> dict[str, Any]:
        return {
            'ok': True, 'watching': True, 'events': self.events, 'alerts': len(self.events),
            'answered': 0, 'false': 0,
        }  # fmt: skip

    def show(self, **changes: Any) -> None:
        self.broadcaster.show(whole().having(active=('m/MOVE',), **changes))


@pytest.fixture(scope='module')
def desk() -> Iterator[Desk]:
    desk = Desk()
    desk.show()
    desk.viewer.until(lambda: desk.viewer.text('#title').startswith('surveillance'))
    yield desk
    desk.viewer.close()
    desk.page.stop()


def press(desk: Desk, key: str, selector: str = 'body') -> None:
    desk.viewer.js(
        'document.querySelector(arguments[0]).dispatchEvent('
        'new KeyboardEvent("keydown", {key: arguments[1], bubbles: true}))',
        selector,
        key,
    )


def test_a_key_stops_the_robot_unless_one_types(desk: Desk) -> None:
    desk.done.clear()
    press(desk, 's', '#control-body input')
    press(desk, 's')
    desk.viewer.until(lambda: desk.done)
    desk.viewer.until(lambda: desk.viewer.text('#stop-answer') == 'stop True')
    assert desk.done == ['stop True']


def test_an_open_alert_stands_in_the_head_and_the_title(desk: Desk) -> None:
    viewer = desk.viewer
    assert viewer.js('return document.getElementById("alerts").hidden')
    desk.events = [ALERT]
    viewer.until(lambda: 'door D6 open in R3' in viewer.text('#alerts'))
    assert viewer.text('#alerts').startswith('1 open alert: ')
    assert viewer.js('return document.title').startswith('(1) A')
    desk.events = [{**ALERT, 'state': 'acknowledged'}]
    viewer.until(lambda: viewer.js('return document.getElementById("alerts").hidden'))
    assert viewer.js('return document.title').startswith('A ')


def test_stop_pause_map_and_the_open_alert_are_on_one_screen_of_a_phone(desk: Desk) -> None:
    viewer = desk.viewer
    desk.events = [ALERT]
    viewer.size(*PHONE)
    viewer.until(lambda: 'door D6' in viewer.text('#alerts'))
    viewer.js('scrollTo(0, 0)')
    for selector in ('#stop', '#pause', '#alerts', '#map'):
        box = viewer.js(
            'const box = document.querySelector(arguments[0]).getBoundingClientRect();'
            'return [box.top, box.bottom, box.height]',
            selector,
        )
        assert box[0] >= 0
        assert box[1] <= PHONE[1], selector
        assert box[2] > 0
    assert viewer.axe() == []
    viewer.click('#pause')
    viewer.until(lambda: desk.done[-1] == 'pause')
    desk.show(paused=True)
    viewer.until(lambda: not viewer.js('return document.getElementById("go").hidden'))
    assert viewer.js('return document.getElementById("pause").hidden')
    desk.show()
    viewer.size(*DESK)


def test_a_room_is_removed_by_two_presses(desk: Desk) -> None:
    viewer = desk.viewer
    desk.done.clear()
    viewer.until(lambda: viewer.count('[name=name] option') == 2)
    viewer.click('[data-act=remove_room]')
    assert viewer.text('[data-act=remove_room]') == 'Remove A?'
    assert desk.done == []
    viewer.click('[data-act=remove_room]')
    viewer.until(lambda: desk.done == ['remove A'])
    assert viewer.text('[data-act=remove_room]') == 'Remove'


def test_approve_is_offered_where_something_waits(desk: Desk) -> None:
    viewer = desk.viewer
    desk.show(waiting=('m/MOVE: failed -> HELP',))
    viewer.until(lambda: not viewer.js('return document.getElementById("approve").hidden'))
    desk.show()
    viewer.until(lambda: viewer.js('return document.getElementById("approve").hidden'))
