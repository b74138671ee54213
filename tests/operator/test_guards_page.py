"""What a guard at the page has at hand: Stop by a key, what is open in the head, one screen."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import pytest

from surveillance_operator.page.access import Links
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer
from tests.operator.missions import whole

pytestmark = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason=MISSING)
ALERT = {
    'key': 'run//3', 'run': 'run', 'robot': '', 'id': 'abc', 'number': 3, 'kind': 'door',
    'subject': 'D6', 'seen': 'open', 'text': 'door D6 is open', 'rule': 'front door at night',
    'place': 'R3', 'position': [1.0, 1.0], 'severity': 3, 'level': 'alert',
    'state': 'unacknowledged', 'began': 1.77e9, 'last': 1.77e9, 'ended': None, 'calls': 1,
    'evidence': [], 'confidence': 0.97, 'looks': 1, 'action': '', 'by': '', 'acknowledged_at': 0,
    'assigned': '', 'until': 0, 'answer': '', 'said': [],
}  # fmt: skip


SHOWN = cv2.imencode('.jpg', np.full((60, 120, 3), 90, np.uint8))[1].tobytes()


class Desk:
    """The page with control, and what was pressed on it."""

    def __init__(self) -> None:
        self.done: list[Any] = []
        self.links = Links()
        self.driven: list[tuple[float, float]] = []
        self.asked: list[dict[str, Any]] = []
        self.baseline: list[dict[str, Any]] = []
        self.broadcaster = Broadcaster()
        self.page = Page(
            self.broadcaster,
            questions={
                'search': self._search,
                'event': lambda key: {'ok': True, 'event': ALERT},
                'place': lambda: {'ok': True},
                'baseline': lambda: {'ok': True, 'events': self.baseline},
                'choices': lambda: {
                    'ok': True,
                    'places': ['R3'],
                    'kinds': ['door'],
                    'states': ['over'],
                    'severities': ['alert'],
                    'robots': [],
                },
            },
            actions={
                'alarm': self._alarm,
                'mute': lambda kind, hours, by: self._press(f'mute {kind} {hours}'),
                'sinks': lambda: 'none',
                'pose': lambda x, y, yaw, **_: self._press(f'pose {x:.1f} {y:.1f} {yaw:.1f}'),
                'drive': self._drive,
                'stop': lambda on, **_: self._press(f'stop {on}'),
                'machine': lambda word, **_: self._press(word),
                'event': self._event,
                'remove_room': lambda name: self._press(f'remove {name}'),
            },
            evidence=lambda name, *_: SHOWN if name in ('a.jpg', 'b.jpg') else None,
            port=0,
            links=self.links,
        )
        self.page.start()
        self.viewer = Viewer(self.page.address)

    def _press(self, what: str) -> str:
        self.done.append(what)
        return what

    def _search(self, **asked: Any) -> dict[str, Any]:
        self.asked.append(asked)
        return {'ok': True, 'count': 1, 'events': [ALERT]}

    def _alarm(self, verb: str, key: str, note: str = '', more: str = '', by: str = '') -> str:
        words = (verb, key, more, by, note)
        return self._press(' '.join(each for each in words if each))

    def _event(self, line: str) -> str:
        for each in list(self.baseline):
            of_all = line == 'normal baseline' and each['state'] == 'open'
            if of_all or line == f'normal {each["number"]}':
                self.baseline.remove(each)
            elif line == f'acknowledge {each["number"]}':
                each['state'] = 'acknowledged'
        return self._press(line)

    def _drive(self, speed: float, turn: float) -> str:
        self.driven.append((float(speed), float(turn)))
        return 'driving'

    def alarms(self, *events: Any) -> None:
        self.broadcaster.show_desk(
            {'at': time.time(), 'count': len(events), 'open': list(events), 'mutes': []}
        )

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


def test_what_the_first_look_found_is_shown_and_a_person_accepts_or_refuses_it(desk: Desk) -> None:
    viewer = desk.viewer
    desk.done.clear()
    viewer.js('location.hash = "#/engineer"')
    viewer.js('location.hash = "#/desk"')
    assert not viewer.js('return document.getElementById("baseline-section").checkVisibility()')
    thing = {'place': 'C1', 'position': [3.0, 1.5], 'state': 'open'}
    desk.baseline = [
        {**thing, 'number': number, 'evidence': [shown]}
        for number, shown in ((3, 'a.jpg'), (4, 'b.jpg'), (5, 'gone.jpg'), (6, 'a.jpg'))
    ]
    viewer.js('location.hash = "#/engineer"')
    viewer.js('location.hash = "#/desk"')
    viewer.until(lambda: viewer.count('#baseline > li') == 4)
    assert '3: a thing in C1 at 3.0, 1.5' in viewer.text('#baseline')
    # A picture each; of the third it is no longer there.
    viewer.until(lambda: viewer.count('#baseline img') == 3)
    viewer.click('#baseline [data-baseline=normal]')
    viewer.until(lambda: viewer.count('#baseline > li') == 3)
    assert viewer.text('#baseline-said') == '✓ normal 3'
    viewer.click('#baseline [data-baseline=acknowledge]')
    viewer.until(lambda: 'refused' in viewer.text('#baseline > li'))
    viewer.click('#baseline-all')
    viewer.until(lambda: viewer.count('#baseline > li') == 1)
    assert desk.done == ['normal 3', 'acknowledge 4', 'normal baseline']
    assert viewer.js('return document.getElementById("baseline-all").hidden')


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


def test_an_alarm_stands_in_the_head_the_title_and_the_icon_of_every_view(desk: Desk) -> None:
    viewer = desk.viewer
    desk.alarms()
    viewer.until(lambda: viewer.js('return document.getElementById("bar").hidden'))
    icon = viewer.attribute('#icon', 'href')
    for view in ('desk', 'events', 'engineer'):
        viewer.js('location.hash = "#/" + arguments[0]', view)
        desk.alarms(ALERT)
        viewer.until(lambda: 'door D6 is open in R3' in viewer.text('#bar'))
        assert viewer.js('return document.getElementById("bar").checkVisibility()')
        assert viewer.js('return document.title').startswith('(1) A')
        assert viewer.attribute('#icon', 'href') not in ('', icon)
    viewer.js('location.hash = "#/desk"')
    desk.alarms({**ALERT, 'state': 'acknowledged', 'by': 'Anna'})
    viewer.until(lambda: viewer.js('return document.getElementById("bar").hidden'))
    # Acknowledged is not over.
    assert 'acknowledged by Anna' in viewer.text('#alarm-list')
    assert viewer.js('return document.title').startswith('A ')


def test_the_editor_has_the_open_alarms_and_stop(desk: Desk) -> None:
    viewer = desk.viewer
    desk.done.clear()
    desk.alarms(ALERT)
    viewer.js('location.href = "/edit"')
    try:
        viewer.until(lambda: 'door D6 is open in R3' in viewer.text('#bar'))
        assert viewer.js('return document.title').startswith('(1) ')
        viewer.click('#bar [data-verb=acknowledge]')
        viewer.until(lambda: len(desk.done) == 1)
        press(desk, 's')
        viewer.until(lambda: len(desk.done) == 2)
        assert desk.done == ['acknowledge run//3 operator', 'stop True']
        desk.alarms()
        viewer.until(lambda: viewer.js('return document.getElementById("bar").hidden'))
        desk.show(stopped=True)
        viewer.until(lambda: not viewer.js('return document.getElementById("release").hidden'))
        viewer.click('#release')
        viewer.until(lambda: desk.done[-1] == 'stop False')
        desk.show(stopped=False)
    finally:
        viewer.js('location.href = "/"')
        viewer.until(lambda: viewer.text('#title').startswith('surveillance'))


def test_an_alarm_is_acknowledged_with_a_remark_and_shelved(desk: Desk) -> None:
    viewer = desk.viewer
    desk.done.clear()
    desk.alarms(ALERT)
    viewer.until(lambda: viewer.count('.answers [data-verb=acknowledge]'))
    for words in ('rule: front door at night', '97 % sure', 'since '):
        assert words in viewer.text('#alarm-list')
    viewer.js('document.querySelector("[data-note]").value = "I go there"')
    viewer.click('.answers [data-verb=acknowledge]')
    viewer.until(lambda: desk.done)
    # The answer empties it.
    viewer.until(lambda: not viewer.js('return document.querySelector("[data-note]").value'))
    viewer.click('.answers [data-verb=shelve]')
    viewer.until(lambda: len(desk.done) == 2)
    viewer.click('#bar [data-verb=acknowledge]')
    press(desk, 'j')
    press(desk, 'a')
    viewer.until(lambda: len(desk.done) == 4)
    assert desk.done[:2] == [
        'acknowledge run//3 operator I go there',
        'shelve run//3 2 h operator',
    ]
    assert desk.done[2:] == 2 * ['acknowledge run//3 operator']


def test_what_somebody_types_stays_while_the_alarm_changes(desk: Desk) -> None:
    viewer = desk.viewer
    desk.alarms(ALERT)
    viewer.until(lambda: viewer.count('[data-note]'))
    viewer.js('const n = document.querySelector("[data-note]"); n.focus(); n.value = "half a se"')
    desk.alarms({**ALERT, 'calls': 2})
    viewer.until(lambda: 'called 2 times' in viewer.text('#alarm-list'))
    assert viewer.js('return document.querySelector("[data-note]").value') == 'half a se'
    viewer.js('document.activeElement.blur()')


def test_a_new_alarm_makes_the_sound_that_was_allowed(desk: Desk) -> None:
    viewer = desk.viewer
    desk.alarms()
    viewer.until(lambda: viewer.text('#alarm-list') == 'none is open')
    viewer.js(
        'window.beeps = 0; window.AudioContext = class { currentTime = 0; destination = {};'
        'createOscillator() { return {frequency: {}, connect: (to) => to,'
        'start: () => { window.beeps += 1; }, stop() {}}; }'
        'createGain() { return {gain: {}, connect: (to) => to}; } };'
    )
    desk.alarms({**ALERT, 'id': 'silent'})
    viewer.until(lambda: viewer.count('.alarm'))
    assert viewer.js('return window.beeps') == 0
    viewer.click('#sound')
    before = viewer.js('return window.beeps')
    assert before > 0  # so that it is known how it sounds
    desk.alarms({**ALERT, 'id': 'silent'}, {**ALERT, 'key': 'run//4', 'id': 'loud'})
    viewer.until(lambda: viewer.js('return window.beeps') > before)
    viewer.click('#sound')


def test_events_are_searched_and_one_is_shown(desk: Desk) -> None:
    viewer = desk.viewer
    desk.asked.clear()
    press(desk, '/')
    viewer.until(lambda: viewer.count('#found [data-event]'))
    viewer.js('document.querySelector("#search [name=severity]").value = "alert"')
    viewer.click('#last-night')
    viewer.until(lambda: any(each['severity'] == 'alert' for each in desk.asked))
    asked = desk.asked[-1]
    assert 0 < float(asked['end']) - float(asked['begin']) <= 10 * 3600
    viewer.click('#found [data-event]')
    viewer.until(lambda: 'front door at night' in viewer.text('#chosen'))
    assert '1970' not in viewer.text('main')
    viewer.js('document.activeElement.blur()')
    press(desk, '1')
    viewer.until(lambda: viewer.js('return document.body.dataset.view') == 'desk')


def test_the_map_zooms_follows_and_hides_layers(desk: Desk) -> None:
    viewer = desk.viewer
    whole = viewer.attribute('#map', 'viewBox')
    viewer.click('[data-zoom=in]')
    assert float(viewer.attribute('#map', 'viewBox').split()[2]) < float(whole.split()[2])
    viewer.click('#follow')
    left = float(viewer.attribute('#map', 'viewBox').split()[0])
    desk.show(pose=(1.0, 0.5, 0.0))
    viewer.until(lambda: viewer.attribute('#map', 'viewBox').split()[0] != f'{left:g}')
    viewer.click('[data-zoom=whole]')
    assert viewer.attribute('#map', 'viewBox') == whole
    viewer.click('[data-layer=doors]')
    hidden = 'return document.querySelector("#map .door").getBoundingClientRect().height'
    assert not viewer.js(hidden)
    viewer.click('[data-layer=doors]')


def test_the_map_shows_how_much_of_each_place_was_in_view(desk: Desk) -> None:
    """On its own: no other part of the map changes with it."""
    viewer = desk.viewer
    viewer.click('[data-layer=coverage]')
    place = next(iter(whole().place.positions))
    for share, words in ((0.456, '46 % seen'), (1.0, '100 % seen')):
        desk.show(coverage={place: share})
        viewer.until(lambda words=words: viewer.text('#map .share') == words)
    viewer.click('[data-layer=coverage]')


def test_the_robot_is_told_where_it_is_by_a_drag(desk: Desk) -> None:
    viewer = desk.viewer
    desk.done.clear()
    viewer.click('#set-pose')
    viewer.js(
        'const map = document.getElementById("map"), m = map.getScreenCTM();'
        'map.setPointerCapture = () => {};'
        'const send = (type, x, y) => { const p = new DOMPoint(x, -y).matrixTransform(m);'
        ' map.dispatchEvent(new PointerEvent(type,'
        ' {clientX: p.x, clientY: p.y, pointerId: 1, bubbles: true})); };'
        'send("pointerdown", 1, 1); send("pointermove", 1, 3); send("pointerup", 1, 3);'
    )
    viewer.until(lambda: desk.done)
    assert desk.done == ['pose 1.0 1.0 1.6']


def test_driving_lasts_as_long_as_the_hand_is_on_it(desk: Desk) -> None:
    viewer = desk.viewer
    desk.driven.clear()
    send = (
        'const pad = document.querySelector("[data-drive=forward]");'
        'pad.setPointerCapture = () => {};'
        'pad.dispatchEvent(new PointerEvent(arguments[0], {pointerId: 1, bubbles: true}))'
    )
    viewer.js(send, 'pointerdown')
    viewer.until(lambda: len(desk.driven) > 3)
    assert set(desk.driven) == {(0.25, 0.0)}
    viewer.js(send, 'pointerup')
    viewer.until(lambda: desk.driven[-1] == (0.0, 0.0))


def test_stop_pause_map_and_the_open_alert_are_on_one_screen_of_a_phone(desk: Desk) -> None:
    viewer = desk.viewer
    desk.alarms(ALERT)
    viewer.size(*PHONE)
    viewer.until(lambda: 'door D6' in viewer.text('#bar'))
    viewer.js('scrollTo(0, 0)')
    for selector in ('#stop', '#pause', '#bar', '#map'):
        box = viewer.js(
            'const box = document.querySelector(arguments[0]).getBoundingClientRect();'
            'return [box.top, box.bottom, box.height]',
            selector,
        )
        assert box[0] >= 0
        assert box[1] <= PHONE[1], selector
        assert box[2] > 0
    viewer.click('#pause')
    viewer.until(lambda: desk.done[-1] == 'pause')
    desk.show(paused=True)
    viewer.until(lambda: not viewer.js('return document.getElementById("go").hidden'))
    assert viewer.js('return document.getElementById("pause").hidden')
    desk.show()
    viewer.size(*DESK)


@pytest.mark.parametrize('view', ['desk', 'events', 'engineer', 'people'])
def test_everybody_can_use_each_view(desk: Desk, view: str) -> None:
    viewer = desk.viewer
    desk.alarms(ALERT)
    viewer.js('location.hash = "#/" + arguments[0]', view)
    viewer.until(lambda: viewer.js('return document.body.dataset.view') == view)
    for size in (PHONE, DESK):
        for dark in (False, True):
            viewer.size(*size, dark=dark)
            assert viewer.axe() == [], (size, dark)
            wide = viewer.js('return document.documentElement.scrollWidth')
            assert wide <= size[0], 'nothing lies beside the screen'
    viewer.size(*DESK)
    viewer.js('location.hash = "#/desk"')


def test_a_guard_answers_and_stops_and_changes_nothing(desk: Desk) -> None:
    token = desk.links.make('Anna', 'guard')
    viewer = desk.viewer
    viewer.driver.get(f'{desk.page.open_address}?token={token}')
    viewer.until(lambda: viewer.text('#title').startswith('surveillance'))
    hidden = 'return document.querySelector(arguments[0]).hidden'
    found = [viewer.js(hidden, f'#{each}') for each in ('stop', 'pause', 'control', 'people-link')]
    assert found == [False, True, True, True]
    desk.done.clear()
    press(desk, 's')
    viewer.until(lambda: desk.done == ['stop True'])
    desk.alarms(ALERT)
    viewer.until(lambda: viewer.count('.answers [data-verb=acknowledge]'))
    viewer.click('.answers [data-verb=acknowledge]')
    viewer.until(lambda: desk.done[1:] == ['acknowledge run//3 Anna'])
    viewer.driver.get(desk.page.address)
    viewer.until(lambda: viewer.text('#title').startswith('surveillance'))


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
