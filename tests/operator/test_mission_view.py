"""What whoever watches a mission gets to see."""

from __future__ import annotations

import io
import math
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from floor_plans import Grid
from patrol_policy.world import Decision
from state_machines import Interrupt
from surveillance_operator.mission_changes import changes, follow
from surveillance_operator.mission_state import (
    MissionState,
    NodeReport,
    Notice,
    Status,
)
from surveillance_operator.watch import raster, view
from surveillance_operator.watch.raster import Viewport, rasterise
from surveillance_operator.watch.view import MissionView, node_page, show_once

STATUS = Status(95.0, 'surveillance', 'MOVE_TO_NEXT_ROOM', 'A', 'B', False, 'arrived in A', ())
DECISION = Decision(90.0, 'A', 'B', 'B', 'URGENT', 'tour', 'B waits longest', {})


def two_rooms() -> Grid:
    """Return a room of 4 x 2 m and one of 2 x 2 m, a wall of 5 cm with an opening of 1 m
    between.
    """
    cells = np.zeros((40, 120), np.int8)
    cells[[0, -1], :] = cells[:, [0, 80, -1]] = 100
    cells[10:30, 80] = 0
    return Grid(cells, 0.05, (-1.0, 2.0))


def whole() -> MissionState:
    return MissionState().having(
        where='ROS domain 7',
        now=100.0,
        mode='SIMULATED',
        nodes={'robot_behavior': frozenset({'1'})},
        status=STATUS,
        decision=DECISION,
        decision_number=3,
        battery=80.0,
        grid=two_rooms(),
        positions={'A': (1.0, 3.0), 'B': (4.0, 3.0)},
        doors={'D': False},
        door_lines={'D': (3.0, 2.5, 3.0, 3.5)},
        visited_at={'A': 98.0, 'B': 10.0},
        urgent=frozenset({'B'}),
        pose=(1.0, 3.0, math.pi / 2),
        trail=np.array([(0.0, 3.0), (1.0, 3.0)]),
        obstacles=np.array([(2.0, 3.5)]),
        notices=(Notice('arrived in A', at=time.mktime((2026, 1, 1, 12, 0, 0, 0, 0, -1))),),
    )


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


@settings(max_examples=60)
@given(st.integers(1, 90), st.integers(1, 50), st.integers(1, 90), st.integers(1, 50), st.data())
def test_every_wall_is_in_the_picture_where_its_points_are(height, width, columns, rows, data):
    at = data.draw(st.integers(0, height - 1)), data.draw(st.integers(0, width - 1))
    cells = np.zeros((height, width), np.int8)
    cells[at] = 100
    grid = Grid(cells, 0.1, (-3.0, 5.0))
    frame = Viewport.around(grid.known, columns, rows)
    assert 1 <= frame.columns <= columns
    assert 1 <= frame.rows <= rows
    picture = rasterise(grid, frame)
    assert picture.shape == (2 * frame.rows, frame.columns)
    assert (picture == raster.WALL).any()
    # Of the pixels that a cell is in, the last one is its own: look at its lower right corner.
    corner = -3.0 + 0.1 * (at[1] + 1) - 1e-5, 5.0 + 0.1 * at[0] + 1e-5
    assert picture[tuple(frame.pixels([corner])[0])] == raster.WALL


def test_a_picture_keeps_the_aspect_and_leaves_out_what_is_not_known():
    cells = np.full((200, 200), -1, np.int8)
    cells[50:70, 100:180] = 0
    grid = Grid(cells, 0.5)
    assert grid.known == (50.0, 25.0, 90.0, 35.0)
    frame = Viewport.around(grid.known, 40, 40)
    assert (frame.columns, frame.rows, frame.scale) == (40, 5, 1.0)
    assert (rasterise(grid, frame) == raster.FREE).all()


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


def test_a_node_that_is_started_again_is_told_though_the_killed_one_still_seems_there():
    before = whole()
    again = before.having(nodes={'robot_behavior': frozenset({'1', '2'})})
    told = [change.text for change in changes(before, again)]
    assert told == ['robot_behavior was started again']
    assert list(changes(again, again.having(nodes={'robot_behavior': frozenset({'2'})}))) == []


def test_each_change_is_told_once_in_one_line():
    before, after = MissionState(), whole()
    first = {change.text: change.detail for change in changes(before, after)}
    assert first['decision 3: A → B [URGENT]'] == 'B waits longest'
    assert {'door D closed', 'B is URGENT', 'arrived in A', 'battery at 80 %'} <= first.keys()
    assert 'something stands at (2.0, 3.5)' in first
    assert list(changes(after, after)) == []
    later = after.having(
        doors={'D': True},
        obstacles=np.empty((0, 2)),
        battery=70.0,
        nodes={},
        ended=frozenset({'robot_behavior'}),
    )
    assert [change.text for change in changes(after, later)] == [
        'battery at 70 %',
        'door D opened',
        'nothing stands about any more',
        'every node has ended: waiting for the next mission',
    ]


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


def test_a_node_that_reports_nothing_is_up_and_each_start_again_is_counted() -> None:
    def running(process: str, before: MissionState) -> MissionState:
        new = before.having(nodes={'robot_behavior': frozenset({process})})
        return follow(before, new, 0.0)[0]

    state = running('1', MissionState())
    assert [line.plain for line in node_page(state)] == ['● up    robot_behavior']
    state = running('3', running('2', state))
    (line,) = node_page(state)
    assert line.plain == '● up    robot_behavior, started again 2 times'
