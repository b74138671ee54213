"""The page in a real Chromium, shown what a mission may be: none, ended, large, hostile."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from floor_plans import Grid, Zone
from patrol_policy.situation import Decision
from surveillance_operator.mission_state import (
    MachineContainer,
    MachineTransition,
    MissionHistory,
    MissionState,
    NodeReport,
    Notice,
    Status,
)
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer

pytestmark = [
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason=MISSING),
]
HOSTILE = (
    '<img src=x onerror="window.broken=1">',
    'مرحبا\u202e',
    'a_name_of_a_hundred_letters_' * 4,
    '"];x',
)


def mission(names: tuple[str, ...]) -> MissionState:
    """Return a mission whose places, nodes, states and reasons have these names."""
    side = int(np.ceil(np.sqrt(len(names))))
    cells = np.zeros((side * 20, side * 20), np.int8)
    cells[::20] = cells[:, ::20] = 100
    positions = {
        name: (2.0 * (n % side) + 1.0, 2.0 * (n // side) + 1.0) for n, name in enumerate(names)
    }
    first, last = names[0], names[-1]
    return MissionState().having(
        where=first,
        now=5000.0,
        mode='SIMULATED',
        threshold=240.0,
        policy='tour',
        nodes=dict.fromkeys(names, frozenset('1')),
        status=Status(5000.0, first, last, first, last, False, first, ()),
        decision=Decision(
            4990.0, first, last, last, 'URGENT', 'tour', first, dict.fromkeys(names, 1.0)
        ),
        decision_number=3,
        battery=50.0,
        grid=Grid(cells, 0.1),
        positions=positions,
        doors={first: True, last: False},
        door_lines={first: (1.0, 2.0, 1.5, 2.0), last: (2.0, 0.5, 2.0, 1.0)},
        visited_at=dict.fromkeys(names[1:], 4900.0),
        urgent=frozenset({first}),
        pose=(1.0, 1.0, 0.5),
        trail=np.array([(1.0, 0.5), (1.0, 1.0)]),
        obstacles=np.array([(1.0, 1.2)]),
        containers=(MachineContainer('m', 'StateMachine', names, names[:1], names, ()),),
        active=(f'm/{first}',),
        transitions=(MachineTransition(1, 4999.0, 'm', first, last, last, 1.0),),
        markers={11: (0.5, 0.5)},
        reports={name: NodeReport(2, first, (('memory_mb', '5'),)) for name in names},
        silent={first: last},
        notices=(Notice(first, at=1e9),),
        history=MissionHistory(((4900.0, last),), ((4000.0, 60.0),), ((4950.0, 'failure', first),)),
    )  # fmt: skip


ROOMS = tuple(f'R{n}' for n in range(1, 501))
STATES = {
    'nothing': MissionState(where='ROS domain 5'),
    'begins': MissionState().having(nodes={'armor_server': frozenset('1')}),
    'hostile': mission(HOSTILE),
    'large': mission(ROOMS),
    'help': mission(('A', 'B')).having(
        status=Status(5000.0, 'm', 'WAIT_FOR_HELP', 'A', 'B', True, 'shut in', ()),
    ),
    'ended': mission(('A', 'B')).having(nodes={}, ended=frozenset({'A', 'B'})),
}


@pytest.fixture(scope='module')
def broadcaster() -> Broadcaster:
    return Broadcaster()


@pytest.fixture(scope='module')
def viewer(broadcaster: Broadcaster) -> Iterator[Viewer]:
    page = Page(
        broadcaster, questions={}, actions={'threshold': lambda seconds: f'set {seconds}'}, port=0
    )
    page.start()
    viewer = Viewer(page.address)
    yield viewer
    viewer.close()
    page.stop()


def show(broadcaster: Broadcaster, viewer: Viewer, name: str) -> None:
    """Show a state of a mission, and wait until the page has it."""
    broadcaster.show(STATES[name].having(policy=name))
    viewer.until(lambda: viewer.js('return mission.state.mission?.policy') == name)


def test_what_a_waiting_robot_waits_for_stands_in_the_place_of_its_decision(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    for name, line, reason, rows in (
        ('ended', 'decision 3: A → B [URGENT]', 'A', 4),
        ('help', 'the robot waits for help', 'shut in', 0),
    ):
        show(broadcaster, viewer, name)
        assert viewer.js('return document.getElementById("decision-line").textContent') == line
        assert viewer.js('return document.getElementById("reason").textContent') == reason
        count = 'return document.querySelectorAll("#scores tr").length'
        assert viewer.js(count) == rows - bool(rows)


def test_a_connection_that_falls_silent_is_said_to_and_made_anew(
    broadcaster: Broadcaster, viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('surveillance_operator.page.broadcaster.HEARTBEAT', 1000.0)
    show(broadcaster, viewer, 'begins')
    viewer.js('mission.real = performance.now.bind(performance)')
    try:
        viewer.js('performance.now = () => mission.real() + 10000')
        viewer.until(lambda: viewer.text('#connection') == 'no data from the mission')
        viewer.js('performance.now = () => mission.real() + 50000')
        viewer.until(lambda: viewer.text('#connection') == 'live')
    finally:
        viewer.driver.refresh()  # its clock cannot go back


def visible(viewer: Viewer, selector: str) -> bool:
    script = 'return document.querySelector(arguments[0]).getClientRects().length > 0'
    return bool(viewer.js(script, selector))


@pytest.mark.parametrize('name', STATES)
def test_every_state_is_readable_everywhere(
    name: str, broadcaster: Broadcaster, viewer: Viewer
) -> None:
    show(broadcaster, viewer, name)
    for size, dark in ((PHONE, True), (DESK, False)):
        viewer.size(*size, dark=dark)
        assert viewer.js('return document.documentElement.scrollWidth') <= size[0]
        if name != 'large':  # whose hundreds of equal rooms the checker takes a minute for
            assert viewer.axe() == []
    assert viewer.driver.get_log('browser') == []


def test_zones_and_stations_are_drawn_and_drawn_anew(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    zones = {
        'K1': Zone('K1', ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))),
        'S1': Zone('S1', ((2.0, 0.0), (3.0, 0.0), (3.0, 1.0)), 0.3),
    }
    shown = STATES['large'].having(zones=zones, stations={'R1': (1.0, 1.5, 0.0)})
    broadcaster.show(shown)
    viewer.until(lambda: viewer.count('#map [data-zone]') == 2)
    assert viewer.text('#map [data-zone=S1] title') == 'S1: at most 0.3 m/s'
    assert viewer.js(
        'return document.querySelector("#map [data-zone=K1]").getAttribute("d")'
    ).startswith('M0 0L1 0L1 -1')
    broadcaster.show(shown.having(zones={}, stations={'R2': (3.0, 1.5, 0.0)}))
    viewer.until(lambda: not viewer.count('#map [data-zone]'))
    viewer.until(lambda: viewer.count('#map [data-station=R2]') == 1)


def test_what_is_empty_says_so(broadcaster: Broadcaster, viewer: Viewer) -> None:
    show(broadcaster, viewer, 'nothing')
    assert viewer.text('#title') == 'no mission yet'
    for view, sections in (
        ('engineer', ('#machine-section', '#health-section', '#time-section')),
        ('desk', ('#map-section', '#control')),
    ):
        look(viewer, view)
        for each in sections:
            assert visible(viewer, f'{each} [data-without]'), each
    assert not visible(viewer, '[data-machine=pause]')
    show(broadcaster, viewer, 'hostile')
    assert visible(viewer, '#map')
    assert not visible(viewer, '#map-section [data-without]')


def look(viewer: Viewer, view: str) -> None:
    viewer.click(f'nav [href="#/{view}"]')
    viewer.until(lambda: viewer.js('return document.body.dataset.view') == view)


def test_each_link_of_the_head_leads_to_what_is_shown(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    show(broadcaster, viewer, 'begins')
    viewer.size(*PHONE, dark=False)
    links = viewer.js(
        """return [...document.querySelectorAll("header nav a[href^='#/']")]
        .filter((each) => each.checkVisibility()).map((each) => each.getAttribute('href'))"""
    )
    assert links[:3] == ['#/desk', '#/events', '#/engineer']
    for each in reversed(links):
        look(viewer, each[2:])
        assert visible(viewer, f'.view[data-view={each[2:]}]')
        assert viewer.count('.view:not([hidden])') == 1
        assert viewer.attribute('nav [aria-current]', 'href') == each
    viewer.size(*DESK, dark=False)


def test_an_event_has_its_time_of_the_day_in_old_recordings_too(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    show(broadcaster, viewer, 'begins')
    noon = time.mktime((2026, 1, 1, 12, 0, 0, 0, 0, -1))
    broadcaster.show_parts(
        {'events': [['11:59:58', 'arrived in A'], [noon, 'left A']]}, 0.0, whole=False
    )
    viewer.until(lambda: viewer.text('#events') == '12:00:00left A11:59:58arrived in A')


def test_what_cannot_be_kept_of_each_place_is_shown_with_its_hours(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    show(broadcaster, viewer, 'begins')
    told = {
        'A': {'verdict': 'within', 'threshold': 60, 'wait': 50, 'words': 'A: in time', 'hours': ''},
        'B': {
            'verdict': 'never',
            'threshold': None,
            'wait': None,
            'words': 'B: never visited',
            'hours': 'daily 08:00-18:00',
        },
    }
    broadcaster.show_parts({'idleness_bounds': told}, 0.0, whole=False)
    line = '1 of 2 places can be visited within their thresholds'
    viewer.until(lambda: viewer.text('#idleness-line') == line)
    broadcaster.show_parts({'kept': 'all 2 places, or little later'}, 0.0, whole=False)
    viewer.until(lambda: viewer.text('#idleness-line') == 'all 2 places, or little later')
    viewer.js('document.getElementById("idleness").open = true')
    assert viewer.text('#idleness-list') == 'B: never visited (daily 08:00-18:00)A: in time'


def test_no_name_becomes_markup_and_each_is_read(broadcaster: Broadcaster, viewer: Viewer) -> None:
    show(broadcaster, viewer, 'hostile')
    viewer.until(lambda: viewer.count('[data-place]') == len(HOSTILE))
    assert viewer.js('return window.broken') is None
    assert viewer.count('main img') == 1
    shown = viewer.js(
        'return [...document.querySelectorAll("[data-place]")].map(e => e.dataset.place)'
    )
    assert sorted(shown) == sorted(HOSTILE)


def test_a_leap_of_the_clock_makes_nothing_wait_longer(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    for name in ('nothing', 'large'):
        show(broadcaster, viewer, name)
    viewer.until(lambda: viewer.text('[data-value=R2]') not in ('', '0:00'))
    minutes, seconds = map(int, viewer.text('[data-value=R2]').split(':'))
    assert 100 <= 60 * minutes + seconds < 160, 'those of the mission, and those since'


def test_an_ended_mission_is_not_taken_for_a_running_one(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    show(broadcaster, viewer, 'ended')
    assert viewer.text('#state').startswith('the mission has ended')
    assert not visible(viewer, '#control-body')


def test_the_next_mission_starts_on_a_clean_page(broadcaster: Broadcaster, viewer: Viewer) -> None:
    show(broadcaster, viewer, 'hostile')
    show(broadcaster, viewer, 'begins')
    assert viewer.js('return mission.state.trail') == []
    assert viewer.text('#decision-line') == 'no decision yet'
    assert viewer.count('#scores td') == 0


def test_enter_does_what_a_forms_first_button_does(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    show(broadcaster, viewer, 'large')
    viewer.driver.find_element('name', 'seconds').clear()
    viewer.driver.find_element('name', 'seconds').send_keys('soon\n')
    viewer.until(lambda: viewer.text('[aria-label=Threshold] #done') == '✓ set soon')


def test_no_link_leads_below_the_header(broadcaster: Broadcaster, viewer: Viewer) -> None:
    show(broadcaster, viewer, 'large')
    long = replace(STATES['large'].task.status, text='charging, for which there are reasons ' * 20)  # type: ignore[type-var]
    broadcaster.show(STATES['large'].having(status=long))
    viewer.until(lambda: 'reasons' in viewer.text('#state'))
    viewer.size(*PHONE)
    for section in ('map-section', 'alarms-section', 'control'):
        viewer.js(f'location.hash = "#{section}"')
        bottom = viewer.js('return document.querySelector("header").getBoundingClientRect().bottom')
        top = viewer.js(f'return document.getElementById("{section}").getBoundingClientRect().top')
        assert bottom <= top < 300
    viewer.size(*DESK)


def test_a_long_report_leaves_the_names_of_nodes_their_room(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    names = ('aruco_detector', 'ontology_map_builder')
    long = NodeReport(0, 'waiting for the arm to rest', ())
    broadcaster.show(
        STATES['begins'].having(nodes=dict.fromkeys(names, frozenset()), reports={names[0]: long})
    )
    viewer.size(*PHONE)
    viewer.until(lambda: 'waiting' in viewer.text('#nodes'))
    script = 'return [...document.querySelectorAll("#nodes th b")].map((b) => '
    script += 'b.parentElement.getBoundingClientRect().height)'
    assert viewer.js(script)[1] < 30, 'one line'
    viewer.size(*DESK)


def test_a_jump_that_leads_nowhere_says_so(viewer: Viewer) -> None:
    def jump(kind: str) -> str:
        raise ValueError(f'no {kind} after this moment')

    page = Page(Broadcaster(), questions={}, actions={'jump': jump}, port=0, replay=True)
    page.start()
    viewer.driver.get(page.address)
    viewer.until(lambda: viewer.text('#connection') == 'replay')
    viewer.click('[data-jump=failure]')
    viewer.until(lambda: viewer.text('#jumped') == 'no failure after this moment')
    logged = [entry['message'] for entry in viewer.driver.get_log('browser')]
    assert all('status of 422' in line for line in logged), logged
    viewer.driver.get(viewer.address)  # as the other tests expect it
    page.stop()
