"""Whole screens of the terminal view, as whoever watches a mission has them before them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from floor_plans import Grid
from surveillance_operator.mission_state import MissionState, Notice
from surveillance_operator.watch import raster
from surveillance_operator.watch.raster import CharacterCanvas, Viewport
from surveillance_operator.watch.view import (
    MissionView,
    draw_map,
    figure_lines,
    place_lines,
    robot_colour,
)

from .test_mission_view import DECISION, STATUS, whole

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
FLEET = """
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
        (FLEET, 96, fleet()['r1'], {'fleet': fleet(), 'robot': 'r1', 'note': 'the last line'}),
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


@pytest.mark.parametrize(
    ('box', 'size', 'expected'),
    [
        ((0.0, 0.0, 10.0, 10.0), (20, 10), (0.5, 20, 10)),
        ((0.0, 0.0, 10.0, 4.0), (20, 10), (0.5, 20, 4)),
        ((0.0, 0.0, 10.0, 4.5), (20, 10), (0.5, 20, 5)),
        ((-3.0, 2.0, 1.0, 12.0), (20, 10), (0.5, 8, 10)),
        ((5.0, 5.0, 5.0, 5.0), (20, 10), (1e-6, 1, 1)),
    ],
)
def test_a_frame_is_the_largest_that_fits(
    box: tuple[float, float, float, float], size: tuple[int, int], expected: tuple[float, int, int]
) -> None:
    frame = Viewport.around(box, *size)
    assert (frame.left, frame.top) == (box[0], box[3])
    assert (frame.scale, frame.columns, frame.rows) == pytest.approx(expected)


def test_a_canvas_draws_dots_lines_marks_and_arrows_where_they_are() -> None:
    frame = Viewport(0.0, 4.0, 0.5, 8, 4)
    canvas = CharacterCanvas(frame)
    canvas.dots([(0.1, 3.9), (3.9, 0.1), (-0.1, 2.0), (4.1, 2.0), (2.0, 4.1)], raster.OBSTACLE)
    canvas.line((0.25, 1.25), (3.75, 1.25), raster.LINK)
    canvas.line((1.25, 3.75), (1.25, 2.25), raster.TRAIL)
    plain = [''.join(each.text for each in line) for line in canvas.lines(colours=False)]
    assert plain == ['* ·     ', '  ·     ', '........', '       *']
    for number, arrow in enumerate('→↗↑↖←↙↓↘'):
        canvas.arrow((2.1, 2.9, number * math.pi / 4 + 0.3), raster.Style())
        assert ''.join(each.text for each in [*canvas.lines(colours=False)][1])[4] == arrow
    labelled = CharacterCanvas(Viewport(0.0, 4.0, 0.5, 8, 4))
    for _ in range(6):
        labelled.label(2.1, 2.1, 'name', raster.Style())
    rows = [''.join(each.text for each in line) for line in labelled.lines(colours=False)]
    assert rows == ['   name ', '   name ', '   name ', '   name ']
    narrow = CharacterCanvas(Viewport(0.0, 4.0, 0.5, 3, 4))
    narrow.label(0.1, 2.1, 'name', raster.Style())
    assert not any(''.join(each.text for each in line).strip() for line in narrow.lines())


def test_a_grid_is_drawn_as_its_own_cells_where_they_are_as_large() -> None:
    rng = np.random.default_rng(3)
    cells = rng.choice(np.array([-1, 0, 100], np.int8), (12, 9))
    grid = Grid(cells, 0.5, (1.0, 2.0))
    picture = raster.rasterise(grid, Viewport(1.0, 8.0, 0.5, 9, 6))
    kinds = np.where(cells == 100, raster.WALL, np.where(cells == 0, raster.FREE, raster.UNKNOWN))
    assert (picture == kinds[::-1]).all()
    halved = raster.rasterise(grid, Viewport(1.0, 8.0, 1.0, 5, 3))
    for row in range(6):
        for column in range(5):
            block = kinds[::-1][2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
            assert halved[row, column] == block.max()
    beyond = raster.rasterise(grid, Viewport(1.0, 8.0, 0.5, 11, 7))
    assert (beyond[:12, :9] == picture).all()
    assert (beyond[12:] == raster.UNKNOWN).all()
    assert (beyond[:, 9:] == raster.UNKNOWN).all()


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
