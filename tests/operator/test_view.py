"""What whoever watches a mission in a terminal gets to see, by itself and as whole screens."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from state_machines import Interrupt
from surveillance_operator.mission_state import (
    MissionState,
    NodeReport,
    Notice,
)
from surveillance_operator.watch import view
from surveillance_operator.watch.view import (
    MissionView,
    draw_map,
    figure_lines,
    node_page,
    place_lines,
    robot_colour,
    show_once,
)
from tests.operator.missions import DECISION, FLEET, STATUS, whole


def picture(**fields: Any) -> str:
    file = io.StringIO()
    console = Console(file=file, width=100, height=34)
    console.print(MissionView(FLEET['anna'], whole=False, fleet=FLEET, robot='anna', **fields))
    return file.getvalue()


def test_the_terminal_shows_the_robots_and_the_one_that_was_chosen() -> None:
    shown = picture()
    assert shown.splitlines()[0].startswith(' anna · surveillance')
    for line in ('1 anna A on its way to B', '2 bert A on its way to B', 'B is for anna'):
        assert line in shown
    on_map = [line[:50] for line in shown.splitlines()]
    assert all(any(name in line for line in on_map) for name in ('bert', 'carl'))
    assert shown.count('door D closed') == 1
    assert 'anna begins' in picture(page='events')
    assert 'bert begins' in picture(page='events')
    assert 'shares A, B, next B' in picture(page='robots')
    for width in range(40, 120, 7):
        file = io.StringIO()
        view = MissionView(FLEET['bert'], fleet=FLEET, robot='bert')
        Console(file=file, width=width, height=20).print(view)
        assert max(map(len, file.getvalue().splitlines())) <= width


def test_a_picture_is_of_the_robot_that_was_named_or_there_is_none() -> None:
    file, goes_on = io.StringIO(), Interrupt()
    console = Console(file=file, width=100, height=34)
    assert not show_once(lambda: FLEET, goes_on, console, 0.0, 'brt')
    assert file.getvalue() == ''
    goes_on.set()
    assert show_once(lambda: FLEET, goes_on, console, 0.0, 'bert')
    assert file.getvalue().startswith(' bert · surveillance')


def shown(state: MissionState, width: int = 100, height: int = 30, colours: bool = False) -> str:
    console = Console(
        width=width,
        height=height,
        color_system='truecolor' if colours else None,
        force_terminal=colours,
    )
    with console.capture() as capture:
        console.print(MissionView(state), end='')
    return capture.get()


@pytest.mark.parametrize('page', ['map', 'decision'])
def test_a_robot_that_waits_for_help_says_for_what_in_the_place_of_its_decision(page: str) -> None:
    status = replace(STATUS, waiting_for_help=True, text='D is shut; open it')
    console = Console(width=100, height=30, color_system=None)
    with console.capture() as capture:
        console.print(MissionView(whole().having(status=status), page=page), end='')
    text = capture.get()
    assert 'the robot waits for help' in text
    assert text.count('D is shut; open it') == 1
    assert 'B waits longest' not in text


@pytest.mark.parametrize(('width', 'height'), [(100, 30), (80, 24), (40, 30), (40, 12), (7, 3)])
def test_the_picture_fills_any_terminal_exactly(width, height):
    for state in (whole(), MissionState(), whole().having(grid=None)):
        lines = shown(state, width, height).split('\n')
        assert [len(line) for line in lines] == [width] * height


def test_all_that_is_known_can_be_read():
    text = shown(whole())
    for words in (
        'surveillance in mode SIMULATED · ROS domain 7',
        'MOVE_TO_NEXT_ROOM for 0:05',
        'in A, heading for B',
        '80 %',
        'decision 3: A → B [URGENT]',
        'B waits longest',
        'D closed',
        'A 0:02  ●',
        'B 1:30 URGENT ←',
        '12:00:00 arrived in A',
    ):
        assert words in text
    assert text.index('B 1:30') < text.index('A 0:02')


def test_the_map_shows_robot_door_obstacle_trail_and_names_without_colours_too():
    picture = [line[:59] for line in shown(whole()).split('\n')]
    drawn = '\n'.join(picture)
    assert all(character in drawn for character in ('↑', 'X', '*', '·', 'A', 'B'))
    row = next(line for line in picture if '↑' in line)
    assert row.index('·') < row.index('↑') < row.index('X')


def test_a_name_never_covers_another():
    close = {f'ROOM{number}': (1.0 + 0.1 * number, 3.0) for number in range(9)}
    picture = shown(whole().having(grid=None, positions=close, visited_at={}), 60, 20)
    written = [name for name in close if name in picture.split('sketched')[0]]
    assert 0 < len(written) < 9
    assert picture.split('sketched')[0].count('ROOM') == len(written)


def test_colours_tell_an_open_door_from_a_closed_one():
    opened = whole().having(doors={'D': True})
    assert shown(opened, colours=True) != shown(whole(), colours=True)
    assert 'all 1 open' in shown(opened)


def test_what_does_not_come_is_said_in_its_place():
    text = shown(MissionState(where='ROS domain 7'))
    assert 'no mission yet: waiting on ROS domain 7' in text
    for topic in ('map', 'mission_status', 'decision', 'battery_level', 'door_states'):
        assert f'nothing on {topic} yet' in text
    assert 'nothing from the ontology yet' in text
    why = MissionState().having(silent={'map': 'its publisher offers another durability'})
    assert 'nothing on map yet: its publisher offers another durability' in shown(why)


def test_without_a_map_the_places_are_sketched():
    text = shown(whole().having(grid=None, pose=None, links=frozenset({('A', 'B')})))
    assert 'sketched: nothing on map yet' in text
    row = next(line for line in text.split('\n') if '○' in line)
    assert row.index('●') < row.index('.') < row.index('○')


def test_the_end_of_a_node_and_of_the_mission_is_announced():
    crippled = whole().having(ended=frozenset({'battery_controller'}))
    assert 'ended: battery_controller' in shown(crippled)
    assert 'the mission has ended: waiting' in shown(whole().having(nodes={}))


def test_what_does_not_fit_is_said_to_be_left_out():
    many = {f'R{number}': float(number) for number in range(60)}
    assert '… and more places' in shown(whole().having(visited_at=many))
    wordy = replace(DECISION, reason='a reason ' * 200)
    assert '…' in shown(whole().having(decision=wordy))


def test_a_whole_reason_is_read_at_80_columns():
    reason = ' '.join(f'clause {number} of the reason' for number in range(20))
    text = shown(whole().having(decision=replace(DECISION, reason=reason)), 80, 50)
    assert '…' not in text
    assert 'clause 19' in text


@pytest.mark.parametrize(
    ('page', 'words'),
    [('decision', 'B  '), ('nodes', '● up    robot_behavior'), ('events', '12:00:00 arrived in A')],
)
def test_a_key_shows_a_page(page, words):
    console = Console(width=80, height=24, color_system=None)
    state = whole().having(decision=replace(DECISION, scores={'B': 1.5, 'C': 0.5}))
    with console.capture() as capture:
        console.print(MissionView(state, page=page), end='')
    assert words in capture.get()


def test_each_node_has_one_line_with_the_worst_that_it_reports() -> None:
    good, late = NodeReport(0, 'up', ()), NodeReport(1, 'late', ())
    state = MissionState().having(
        nodes={'robot_behavior': frozenset()},
        ended=frozenset({'simulator'}),
        restarts={'robot_behavior': 1},
        reports={'robot_behavior': good, 'robot_behavior: clock': late, 'mission_recorder': good},
    )
    assert [line.plain for line in node_page(state)] == [
        '▲ WARN  robot_behavior: late, started again 1 time',
        '✗ ended simulator',
        '● up    mission_recorder: up',
    ]


def test_a_single_picture_in_a_pipe_is_as_wide_as_columns_says(monkeypatch):
    for columns, width in (('', 100), ('60', 60)):
        monkeypatch.setenv('COLUMNS', columns)
        file = io.StringIO()
        assert show_once(lambda: {'': whole()}, Interrupt(), Console(file=file), timeout=5.0)
        assert max(map(len, file.getvalue().splitlines())) == width


def test_a_single_picture_waits_until_all_has_come_and_no_longer_than_it_may(monkeypatch):
    """`watch --once` printed half a picture while map and battery were on their way."""
    now = [0.0]
    monkeypatch.setattr(view.time, 'monotonic', lambda: now[0])

    class Passing(Interrupt):
        def wait(self, timeout: float | None = None) -> bool:
            assert timeout
            now[0] += timeout
            return self.is_set()

    def shown(come_at: float, *, timeout: float = 1.0) -> str:
        now[0] = 0.0
        late = whole().having(battery=None)
        file = io.StringIO()
        console = Console(file=file)
        told = show_once(
            lambda: {'': whole() if now[0] >= come_at else late}, Passing(), console, timeout
        )
        assert told
        return file.getvalue()

    assert '80 %' in shown(0.0)
    assert now[0] == 0.0, 'what is complete is drawn at once'
    assert '80 %' in shown(1.5)
    assert '80 %' not in shown(9.0)
    assert 2.0 <= now[0] < 2.2
    now[0] = 0.0
    nothing = Console(file=io.StringIO())
    assert not show_once(lambda: {'': MissionState()}, Passing(), nothing, timeout=3.0)
    assert 3.0 <= now[0] < 3.2


OTHER = replace(STATUS, place='B', state='CHARGE', heading_to='', text='')


def fleet() -> dict[str, MissionState]:
    second = whole().having(pose=(4.0, 3.0, 0.0), status=OTHER, battery=15.0, battery_low=True)
    return {'': whole(), 'r1': whole(), 'r2': second}


def drawn(state: MissionState, width: int, height: int, **more: Any) -> list[str]:
    """Return the lines of a screen, without the spaces at their ends and the hour of events."""
    console = Console(width=width, height=height, color_system=None)
    with console.capture() as capture:
        console.print(MissionView(state, **more), end='')
    lines = capture.get().split('\n')
    assert [len(line) for line in lines] == [width] * height
    return [line.rstrip().replace('12:00:00', 'hh:mm:ss') for line in lines]


BESIDE = """
 surveillance in mode SIMULATED · ROS domain 7
█▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀█▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀█ MOVE_TO_NEXT_ROOM for 0:05
█                                      █                  █ in A, heading for B
█                            *        XX                  █ arrived in A
█                  A                  XX         B        █ battery ████████████████░░░░ 80 %
█        ·         ↑                  XX                  █ decision 3: A → B [URGENT]
█                                     XX                  █ B waits longest
█                                     XX                  █ doors D closed, 0 open
█                                     XX                  █ ── places, longest unvisited first ─────
█                                      █                  █ B 1:30 URGENT ← A 0:02  ●
█▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄█▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄█ ── events ──────────────────────────────
                                                            hh:mm:ss arrived in A
"""


SKETCHED = """
 surveillance in mode SIMULATED · ROS domain 7

                  X
          A   *  XX   B
      ·   ●......XX...○
                 X

sketched: nothing on map yet: the simulator or a
map server publishes it; in modes RANDOM and
MANUAL nobody does
MOVE_TO_NEXT_ROOM for 0:05
in A, heading for B
arrived in A
battery ████████████████░░░░ 80 %
decision 3: A → B [URGENT]
B waits longest
doors D closed, 0 open
── events ────────────────────────────────────────
hh:mm:ss arrived in A

"""


OF_A_FLEET = """
 r1 · surveillance in mode SIMULATED · ROS domain 7
█▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀█▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀█ ── robots ──────────────────────────────
█                                    █                █ 1 r1 A on its way to B
█                          *        XX                █ 2 r2 B charge
█                 A                 XX       B        █ ── r1 ──────────────────────────────────
█        ·        ↑                 XX       →        █ MOVE_TO_NEXT_ROOM for 0:05
█                                   XX       r2       █ in A, heading for B
█                                   XX                █ arrived in A
█                                   X█                █ battery ████████████████░░░░ 80 %
█                                    █                █ decision 3: A → B [URGENT]
▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀▀ B waits longest
                                                        doors D closed, 0 open
                                                        ── places, longest unvisited first ─────
                                                        B 1:30 URGENT ← A 0:02  ●
                                                        ── events ──────────────────────────────
                                                        hh:mm:ss arrived in A
                                                        hh:mm:ss r1 arrived in A
                                                        hh:mm:ss r2 arrived in A






 the last line
"""


SCORES = """
 surveillance in mode SIMULATED · ROS domain 7
decision 3: A → B [URGENT]
B waits longest
policy tour, target B
  B                   1.500 ← chosen
  C                   0.500


"""


ROBOTS = """
 r2 · surveillance in mode SIMULATED · ROS domain 7
r1      A         battery 80 %        on its way to B
r2      B         battery 15 % (low)  charge
"""


EVENTS = """
 surveillance in mode SIMULATED · ROS domain 7
hh:mm:ss arrived in A

"""


@pytest.mark.parametrize(
    ('screen', 'width', 'state', 'more'),
    [
        (BESIDE, 100, whole(), {}),
        (
            SKETCHED,
            50,
            whole().having(grid=None, pose=None, links=frozenset({('A', 'B'), ('A', 'gone')})),
            {},
        ),
        (OF_A_FLEET, 96, fleet()['r1'], {'fleet': fleet(), 'robot': 'r1', 'note': 'the last line'}),
        (
            SCORES,
            60,
            whole().having(decision=replace(DECISION, scores={'C': 0.5, 'B': 1.5})),
            {'page': 'decision'},
        ),
        (ROBOTS, 60, whole(), {'page': 'robots', 'fleet': fleet(), 'robot': 'r2'}),
        (EVENTS, 60, whole(), {'page': 'events'}),
    ],
)
def test_a_screen_looks_as_it_should(
    screen: str, width: int, state: MissionState, more: Mapping[str, Any]
) -> None:
    expected = screen.strip('\n').split('\n')
    height = len(screen.split('\n')) - 2
    expected += [''] * (height - len(expected))
    assert drawn(state, width, height, **more) == expected


@pytest.mark.parametrize(
    ('page', 'words'), [('events', 'no events yet'), ('robots', 'this robot is alone')]
)
def test_a_page_without_anything_says_so(page: str, words: str) -> None:
    assert drawn(whole().having(notices=()), 50, 4, page=page)[1:] == [words, '', '']


def test_a_screen_that_is_too_small_keeps_the_state_and_the_last_event() -> None:
    many = {f'R{number:02}': 10.0 + number for number in range(30)}
    events = tuple(Notice(f'event {each:02}', at=1e9 + each) for each in range(20))
    reason = 'word ' * 60
    state = whole().having(
        visited_at=many, notices=events, decision=replace(DECISION, reason=reason)
    )
    lines = drawn(state, 80, 24)
    assert lines[1].endswith('█ MOVE_TO_NEXT_ROOM for 0:05')
    text = '\n'.join(lines)
    assert text.count('event ') == 3
    assert 'event 19' in lines[-1]
    assert '… and more places' in text
    assert text.index('A   never') < text.index('B   never') < text.index('R00')
    tall = '\n'.join(drawn(state, 80, 60))
    assert [f'event {each:02}' in tall for each in range(20)] == [False] * 10 + [True] * 10
    assert '…' not in tall
    assert all(name in tall for name in many)


@pytest.mark.parametrize(
    ('state', 'words'),
    [
        (MissionState(where='here'), ' no mission yet: waiting on here '),
        (whole().having(nodes={}), ' the mission has ended: waiting on ROS domain 7 '),
        (
            whole().having(ended=frozenset({'b', 'a'}), stopped=True),
            ' ended: a, b · ROS domain 7 ',
        ),
        (
            whole().having(stopped=True),
            ' STOPPED until a person releases it (r) · ROS domain 7 ',
        ),
        (whole().having(paused=True), ' surveillance in mode SIMULATED · PAUSED · ROS domain 7 '),
        (whole().having(mode='', status=None), ' mission · ROS domain 7 '),
    ],
)
def test_the_head_says_which_mission_this_is(state: MissionState, words: str) -> None:
    assert drawn(state, 70, 12)[0] == words.rstrip()
    alarmed = 'ended' in words or 'STOPPED' in words or 'no mission' in words
    console = Console(width=70, height=12, color_system='truecolor', force_terminal=True)
    first = console.render_lines(MissionView(state), console.options.update(height=12))[0]
    ground = {str(each.style.bgcolor.name) for each in first if each.style and each.style.bgcolor}
    assert ground == {'red3' if alarmed else 'deep_sky_blue1'}


def test_who_is_stopped_in_a_fleet_is_named() -> None:
    stopped = {**fleet(), 'r2': fleet()['r2'].having(stopped=True)}
    line = drawn(stopped['r2'], 96, 20, fleet=stopped, robot='r2')[0]
    assert line == ' r2 is STOPPED until a person releases it (r) · ROS domain 7'


@pytest.mark.parametrize(
    ('level', 'width', 'low', 'expected'),
    [
        (80.0, 60, False, 'battery ████████████████░░░░ 80 %'),
        (0.0, 60, True, 'battery ░░░░░░░░░░░░░░░░░░░░ 0 % (low)'),
        (100.0, 28, False, 'battery ██████████ 100 %'),
        (47.5, 38, False, 'battery ██████████░░░░░░░░░░ 48 %'),
    ],
)
def test_the_battery_is_a_bar(level: float, width: int, low: bool, expected: str) -> None:
    line = figure_lines(whole().having(battery=level, battery_low=low), width, brief=True)[0]
    assert line.plain == expected
    assert {str(each.style) for each in line.spans} >= {'bold red1' if low else 'green3'}


def test_doors_are_counted_and_the_closed_ones_named() -> None:
    doors = {'D1': True, 'D2': False, 'D3': True, 'D4': False}
    (line,) = figure_lines(whole().having(doors=doors), 40, brief=False)
    assert line.plain == 'doors D2 D4 closed, 2 open'
    assert [str(each.style) for each in line.spans] == ['bold red1']
    (line,) = figure_lines(whole().having(doors={'D1': True}), 40, brief=False)
    assert line.plain == 'doors all 1 open'


def test_places_stand_in_columns_with_the_time_since_their_visit() -> None:
    status = replace(STATUS, avoided=('D',))
    state = whole().having(
        now=10_000.0,
        status=status,
        visited_at={'A': 9_998.2, 'B': 0.0, 'C': 2_800.0, 'D': 6_401.0, 'E': 10_500.0},
        positions={'X': (0.0, 0.0)},
        urgent=frozenset({'C'}),
    )
    assert [line.plain.rstrip() for line in place_lines(state, 56)] == [
        'B   never  ←       X   never',
        'C 2:00:00 URGENT   D   59:59 avoided',
        'A    0:01  ●       E    0:00',
    ]
    assert [len(line) for line in place_lines(state, 20)] == [19] * 6
    assert len(place_lines(state, 38)) == 3
    assert len(place_lines(state, 37)) == 6
    nothing = state.having(visited_at={}, positions={})
    assert 'nothing from the ontology yet' in place_lines(nothing, 60)[0].plain


def test_colours_of_a_fleet_repeat_after_five() -> None:
    names = [f'r{number}' for number in range(7)]
    found = [robot_colour(names, name) for name in names]
    assert len(set(found)) == 5
    assert found[5:] == found[:2]


def styles(state: MissionState) -> dict[str, set[str]]:
    """Return the styles in which each kind of character of a map is drawn."""
    found: dict[str, set[str]] = {}
    for line in draw_map(state, 60, 11, colours=True):
        for segment in line:
            for character in segment.text:
                found.setdefault(character, set()).add(str(segment.style))
    return found


def test_the_colours_of_a_map_tell_what_is_what() -> None:
    seen = styles(whole())
    assert seen['↑'] == {'bold black on yellow1'}
    assert seen['A'] == {'bold white on grey19'}
    assert seen['B'] == {'bold red1 on grey19'}
    assert 'grey85' in seen['█']
    assert 'red1' in seen['█'], 'the closed door'
    assert seen[' '] == {'on grey19'}
    halves = seen['▀'] | seen['▄']
    assert {'orange1 on grey19', 'deep_sky_blue1 on grey19'} <= halves
    opened = styles(whole().having(doors={'D': True}))
    assert 'green3' in opened['█']
    assert 'red1' not in opened['█']
    long = np.column_stack([np.linspace(0.0, 2.9, 301), np.full(301, 2.4)])
    trail = styles(whole().having(trail=np.concatenate([long * 0 + (0.0, 3.6), long])))
    assert {'dodger_blue3', 'deep_sky_blue1'} <= {
        each.split(' ')[0] for each in trail['▀'] | trail['▄']
    }


def test_without_anything_there_is_no_map_and_a_note_of_what_is_missing() -> None:
    lines = draw_map(MissionState(), 40, 5, colours=False)
    text = '\n'.join(''.join(each.text for each in line) for line in lines)
    assert text.startswith('nothing on map yet: the simulator or a')
    assert draw_map(MissionState(), 40, 1, colours=False)[0][0].text.startswith('nothing on map')
    unplaced = draw_map(whole().having(pose=None), 60, 8, colours=False)
    assert ''.join(each.text for each in unplaced[-1]) != ''
    rows = [''.join(each.text for each in line) for line in unplaced]
    assert any('nothing on amcl_pose yet' in row for row in rows)
    assert any('●' in row for row in rows), 'the place that it is in stands for the robot'
