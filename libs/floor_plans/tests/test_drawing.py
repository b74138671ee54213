"""What the picture of a place shows where: by what its canvas is told to draw."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from floor_plans import FloorPlan, RoomMap, read_place
from floor_plans.drawing import (
    Canvas,
    DrivenRun,
    _between,
    _dashes,
    blend,
    draw_place,
)
from floor_plans.parameters import zones_from

from . import drawn_calls

CONFIG = Path(__file__).with_name('places')
Box = tuple[float, float, float, float]
"""Left, top, right and bottom edge, points of the picture."""


class Drawn(Canvas):
    """A canvas that keeps what it is told to draw."""

    def __init__(self, *where: Any) -> None:
        super().__init__(*where)
        self.texts: list[tuple[str, Box, str]] = []
        self.boxes: list[tuple[Box, str]] = []
        self.lines: list[tuple[Sequence[Sequence[float]], str]] = []
        self.polygons: list[tuple[Sequence[Sequence[float]], str]] = []
        self.discs: list[tuple[Sequence[float], float, str]] = []

    def text(self, at: Any, text: str, size: float, colour: str, anchor: str = 'la') -> None:
        super().text(at, text, size, colour, anchor)
        wide = self.text_width(text, size)
        left = at[0] - {'l': 0.0, 'm': wide / 2, 'r': wide}[anchor[0]]
        top = at[1] - {'a': 0.0, 'm': size / 2}[anchor[1]]
        self.texts.append((text, (left, top, left + wide, top + size), colour))

    def box(self, left: float, top: float, right: float, bottom: float, colour: str) -> None:
        super().box(left, top, right, bottom, colour)
        self.boxes.append(((left, top, right, bottom), colour))

    def line(self, points: Any, colour: str, width: float, dash: Any = None) -> None:
        super().line(points, colour, width, dash)
        self.lines.append((points, colour))

    def polygon(self, outline: Any, colour: str) -> None:
        outline = list(outline)
        super().polygon(outline, colour)
        self.polygons.append((outline, colour))

    def disc(self, centre: Any, radius: float, colour: str) -> None:
        super().disc(centre, radius, colour)
        self.discs.append((centre, radius, colour))

    def where(self, text: str) -> Box:
        """Return where a text stands that is there once."""
        (found,) = (box for words, box, _ in self.texts if words == text)
        return found

    def has(self, box: Box) -> bool:
        return 0 <= box[0] < box[2] <= self.size[0] and 0 <= box[1] < box[3] <= self.size[1]


def middle(box: Box) -> tuple[float, float]:
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def drawn(plan: FloorPlan, monkeypatch: pytest.MonkeyPatch, run: DrivenRun | None = None) -> Drawn:
    made: list[Drawn] = []

    def canvas(*where: Any) -> Drawn:
        made.append(Drawn(*where))
        return made[0]

    monkeypatch.setattr('floor_plans.drawing.Canvas', canvas)
    draw_place(plan, 'The house', 'two words', run)
    return made[0]


@pytest.fixture(params=['seven_rooms', 'patrol_world'])
def plan(request: pytest.FixtureRequest) -> FloorPlan:
    plan = read_place(CONFIG / f'{request.param}.yaml').plan
    assert plan is not None
    return plan


def overlapping(canvas: Drawn) -> Iterator[tuple[str, str]]:
    """Yield the texts of which one covers the other; by design a sign may lie on a name."""
    written = [(text, box) for text, box, colour in canvas.texts if colour != 'white']
    for (one, a), (other, b) in combinations(written, 2):
        if a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]:
            yield one, other


def test_each_thing_is_in_the_picture_and_no_word_covers_another(
    plan: FloorPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    canvas = drawn(plan, monkeypatch)
    assert all(canvas.has(box) for _, box, _ in canvas.texts)
    assert all(canvas.has(box) for box, _ in canvas.boxes)
    for points in [points for points, _ in (*canvas.lines, *canvas.polygons)]:
        assert all(canvas.has((*canvas.at(each), *np.add(canvas.at(each), 1))) for each in points)
    assert not list(overlapping(canvas))
    assert {'The house', 'two words', 'room', 'corridor', 'charging station'} <= {
        text for text, *_ in canvas.texts
    }
    for name, (x, y, _) in plan.place.positions.items():
        assert middle(canvas.where(name)) == pytest.approx(canvas.at((x, y)))
    for before, after in zip(
        ('room', 'corridor', 'charging station'),
        ('corridor', 'charging station', 'way between places'),
        strict=True,
    ):
        gap = canvas.where(after)[0] - canvas.where(before)[2]
        assert 20 < gap < 60, 'a sample of the colour stands before each word'


def test_the_bar_is_as_long_as_it_says(plan: FloorPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    canvas = drawn(plan, monkeypatch)
    (text,) = (text for text, *_ in canvas.texts if text.endswith(' m'))
    left, top, _, bottom = canvas.where(text)
    bars = [
        box
        for box, _ in canvas.boxes
        if box[2] - box[0] == pytest.approx(float(text[:-2]) * canvas.scale)
    ]
    assert len(bars) == 1
    assert bars[0][0] == left
    assert 0 < top - bars[0][3] < 15
    assert bottom < canvas.size[1]
    ends = {middle(box)[0] for box, _ in canvas.boxes if box[3] - box[1] == 10}
    assert {bars[0][0], bars[0][2]} <= ends


def test_a_leaf_opens_into_the_room_with_fewer_doors_and_its_name_is_across(
    plan: FloorPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    canvas, regions = drawn(plan, monkeypatch), RoomMap(plan)
    way = {text: canvas.where(text) for text, *_ in canvas.texts if text in plan.doors}
    assert way.keys() == plan.doors.keys()
    leaves = [points for points, colour in canvas.lines if colour == '#b08a57']
    for number, door in enumerate(plan.doors.values()):
        arc, (hinge, tip) = leaves[2 * number : 2 * number + 2]
        assert hinge == door.ends[0]
        assert math.dist(hinge, tip) == pytest.approx(door.width)
        along, leaf = np.subtract(*door.ends), np.subtract(tip, hinge)
        assert along @ leaf == pytest.approx(0.0, abs=1e-6)
        assert math.dist(min(arc, key=lambda p: math.dist(p, tip)), tip) < 1e-6
        other = door.ends[1]
        assert math.dist(min(arc, key=lambda p: math.dist(p, other)), other) < 1e-6
        inside = regions.room_at(*(np.array([door.x, door.y]) + 0.3 * leaf / door.width))
        sides = plan.place.doors[door.name]
        assert inside in sides
        assert all(
            len(plan.place.rooms[inside or '']) <= len(plan.place.rooms[each]) for each in sides
        )
        x, y = np.subtract(middle(way[door.name]), canvas.at((door.x, door.y))) / canvas.scale
        name = np.array([x, -y])
        assert name @ leaf < 0, 'on the other side'
        assert 0.1 < abs(name @ along) / door.width < door.width / 2, 'beside the way through'
        assert np.hypot(*name) < door.width


def test_walls_leave_doorways_as_wide_as_they_are_and_corners_are_filled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = read_place(CONFIG / 'seven_rooms.yaml').plan
    assert plan is not None
    canvas = drawn(plan, monkeypatch)
    walls = [np.array(points) for points, colour in canvas.polygons if colour == '#3a4350']

    def is_wall(x: float, y: float) -> bool:
        return any(
            np.all(each.min(axis=0) - 1e-9 <= (x, y)) and np.all((x, y) <= each.max(axis=0) + 1e-9)
            for each in walls
        )

    for door in plan.doors.values():
        towards = np.array([math.cos(door.yaw), math.sin(door.yaw)])
        middle_of = np.array([door.x, door.y])
        for side in (-1.0, 1.0):
            assert not is_wall(*(middle_of + side * (door.width / 2 - 0.02) * towards))
            assert is_wall(*(middle_of + side * (door.width / 2 + 0.02) * towards))
    for wall in plan.walls.values():
        for x, y in (wall.start, wall.end):
            assert all(is_wall(x + dx, y + dy) for dx in (-0.04, 0.04) for dy in (-0.04, 0.04))
    assert not is_wall(10.0, 8.0)


def test_a_marker_hangs_before_its_wall_with_its_number_beside_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = read_place(CONFIG / 'patrol_world.yaml').plan
    assert plan is not None
    canvas = drawn(plan, monkeypatch)
    assert plan.markers
    for marker in plan.markers.values():
        facing = np.array([math.cos(marker.yaw), -math.sin(marker.yaw)])
        panels = [
            box
            for box, colour in canvas.boxes
            if colour == '#2f3742'
            and math.dist(middle(box), canvas.at((marker.x, marker.y))) < 12
            and box[2] - box[0] == pytest.approx(box[3] - box[1])
        ]
        assert len(panels) == 1
        off = np.subtract(middle(panels[0]), canvas.at((marker.x, marker.y)))
        assert off @ facing == pytest.approx(np.hypot(*off)), 'into the room'
        (number,) = (
            box
            for text, box, _ in canvas.texts
            if text == str(marker.id) and math.dist(middle(box), middle(panels[0])) < 30
        )
        assert np.subtract(middle(number), middle(panels[0])) @ facing > 0
    assert 'marker' in {text for text, *_ in canvas.texts}


def test_zones_a_station_failures_and_charges_are_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = read_place(CONFIG / 'seven_rooms.yaml').plan
    assert plan is not None
    wet = [8.0, 3.0, 9.0, 3.0, 9.0, 4.0, 8.0, 4.0]
    zones = zones_from(
        {
            'keep_out_zones': {'wet': wet},
            'slow_zones': {'stairs': [0.2, *[each + 5.0 for each in wet]]},
        }
    )
    plan = replace(plan, zones=zones)
    run = DrivenRun(
        driven=[[(5.0, 10.0), (10.0, 8.0)]],
        failures=[(10.0, 6.0)],
        recharges={'E': 3, 'R1': 0},
        threshold=100.0,
        waits={'R1': 200.0, 'R2': 50.0, 'C1': 0.0},
        visits={'R1': 1},
        summary='a long day',
    )
    canvas = drawn(plan, monkeypatch, run)
    assert not list(overlapping(canvas))
    assert all(canvas.has(box) for _, box, _ in canvas.texts)
    texts = {text: (box, colour) for text, box, colour in canvas.texts}
    assert {'a long day', 'visited often', 'waited longest', 'driven', 'failure'} <= texts.keys()
    assert 'planned' not in texts
    assert (texts['wet'][1], texts['stairs: 0.2 m/s'][1]) == ('#c0392b', '#d08a1d')
    assert np.subtract(texts['wet'][0][:2], canvas.at((8.0, 4.0))) == pytest.approx([5, 4])
    for name, colour in (('wet', '#c0392b'), ('stairs', '#d08a1d')):
        outlines = [points for points, each in canvas.lines if each == colour and len(points) == 5]
        corners = {**zones.keep_out, **zones.slow}[name].corners
        assert outlines == [[*corners, corners[0]]]
    crosses = [points for points, colour in canvas.lines if colour == '#c0392b' if len(points) == 2]
    on_map = [ends for ends in crosses if ends[0][1] > 2.0]  # the legend has one, too
    assert len(on_map) == 2
    for ends in on_map:
        assert np.mean(ends, axis=0) == pytest.approx([10.0, 6.0])
        wide = abs(ends[0][0] - ends[1][0]) * canvas.scale
        assert wide == pytest.approx(abs(ends[0][1] - ends[1][1]) * canvas.scale)
        assert 10 <= wide <= 18
    at, radius, colour = canvas.discs[-1]
    assert colour == '#2f8a4c'
    assert at[0] == 5.0
    assert canvas.at(at)[1] - radius > canvas.at((5.0, 10.0))[1] + 10, 'below the sign'
    bolt = np.array(next(points for points, each in canvas.polygons if each == 'white'))
    assert np.all(np.hypot(*(bolt - at).T) * canvas.scale < radius)
    charged = texts['x 3'][0]
    assert charged[0] > canvas.at(at)[0] + radius
    assert charged[1] < canvas.at(at)[1] < charged[3]
    assert 'x 0' not in texts


def test_the_waits_are_bars_in_order_with_the_threshold_across(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = read_place(CONFIG / 'seven_rooms.yaml').plan
    assert plan is not None
    waits = {'R2': 50.0, 'R1': 200.0, 'C1': 0.0, 'R3': 100.0}
    run = DrivenRun(threshold=80.0, waits=waits, visits={'R1': 7})
    canvas = drawn(plan, monkeypatch, run)
    right = canvas.at((plan.bounds[2], 0.0))[0]
    panel = {text: box for text, box, _ in canvas.texts if box[0] > right}
    rows = {name: middle(panel[name])[1] for name in waits}
    assert sorted(waits, key=lambda name: rows[name]) == ['R1', 'R3', 'R2', 'C1']
    bars = {
        name: box
        for box, _ in canvas.boxes
        for name in waits
        if box[0] > right and box[1] < rows[name] < box[3] and box[2] - box[0] > 1.7
    }
    widths = {name: box[2] - box[0] for name, box in bars.items()}
    assert widths['R2'] == pytest.approx(widths['R1'] / 4)
    assert widths['R3'] == pytest.approx(widths['R1'] / 2)
    assert widths['C1'] == 2.0
    begin = {box[0] for box in bars.values()}
    assert len(begin) == 1
    (threshold,) = (
        middle(box)[0] for box, colour in canvas.boxes if colour == '#c0392b' and box[0] > right
    )
    assert threshold - min(begin) == pytest.approx(0.4 * widths['R1'])
    for name, seconds in waits.items():
        words = panel[f'{seconds:.0f} s']
        assert middle(words)[1] == rows[name]
        assert words[0] > bars[name][2]
        assert not words[0] < threshold < words[2], 'the line crosses no number'
    assert middle(panel['7'])[1] == rows['R1']
    assert panel['7'][2] == panel['visits'][2] < canvas.size[0]
    assert panel['urgent after 80 s'][1] > max(rows.values())


def test_a_colour_between_two_is_in_their_proportion() -> None:
    assert [blend('#000000', '#64c8ff', share) for share in (-1.0, 0.0, 0.5, 1.0, 2.0)] == [
        '#000000',
        '#000000',
        '#326480',
        '#64c8ff',
        '#64c8ff',
    ]


@pytest.mark.parametrize(
    ('outline', 'tinted'),
    [
        ([(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)], {(1.5, 1.5)}),
        ([(-1e6, -1e6), (1e6, -1e6), (1e6, 2.0), (-1e6, 2.0)], {(1.5, 1.5), (3.5, 0.5)}),
        ([(-9.0, 1.0), (-8.0, 1.0), (-8.0, 2.0)], set()),
    ],
)
def test_a_zone_is_tinted_as_far_as_it_is_in_the_picture(
    outline: list[tuple[float, float]], tinted: set[tuple[float, float]]
) -> None:
    canvas = Canvas((0.0, 0.0, 4.0, 4.0), 20.0, (5, 5, 5, 5), 'white')
    canvas.tint(outline, '#000000', 0.5)
    picture = canvas.finished()
    for point in ((1.5, 1.5), (3.5, 0.5), (3.5, 3.5)):
        x, y = canvas.at(point)
        shade = 127 if point in tinted else 255
        assert picture.getpixel((int(x), int(y))) == pytest.approx((shade,) * 3, abs=1)


@pytest.mark.parametrize('picture', drawn_calls.PICTURES)
def test_a_picture_is_drawn_as_it_was(picture: str) -> None:
    """Layout is a matter of many small numbers: what changes them is to be looked at.

    `python -m libs.floor_plans.tests.drawn_calls` takes what is drawn now.
    """
    before = (drawn_calls.RECORDS / f'{picture}.txt').read_text('utf-8').splitlines()
    assert drawn_calls.recorded(*drawn_calls.PICTURES[picture]) == before


def colours(canvas: Canvas) -> np.ndarray:
    return np.asarray(canvas.finished()).astype(int)


def plain_canvas() -> Canvas:
    """Return a white canvas of 10 by 5 metres from (-2, 1), 10 points a metre, with margins."""
    return Canvas((-2.0, 1.0, 8.0, 6.0), 10.0, (10, 20, 30, 40), '#ffffff')


def covered(canvas: Canvas, colour: tuple[int, int, int]) -> tuple[int, int, int, int, int]:
    """Return left, top, right, bottom edge and count of the points of a colour."""
    rows, columns = np.nonzero((np.abs(colours(canvas) - colour) < 40).all(axis=2))
    return (
        int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1, len(rows),
    )  # fmt: skip


def test_a_canvas_has_margins_and_its_points_are_tens_of_a_metre() -> None:
    canvas = plain_canvas()
    assert canvas.size == (100 + 10 + 30, 50 + 20 + 40)
    assert canvas.at((-2.0, 6.0)) == (10.0, 20.0)
    assert canvas.at((0.0, 2.5)) == (30.0, 55.0)
    assert (colours(canvas) == 255).all()
    odd = Canvas((0.0, 0.0, 1.01, 2.04), 10.0, (0, 0, 0, 0), '#000000')
    assert odd.size == (11, 21)


def test_shapes_lie_where_they_are_drawn() -> None:
    canvas = plain_canvas()
    canvas.box(20, 30, 40, 50, '#ff0000')
    left, top, right, bottom, count = covered(canvas, (255, 0, 0))
    assert (left, top) == (20, 30)
    assert right - 40 in (0, 1)
    assert bottom - 50 in (0, 1)
    assert count == (right - left) * (bottom - top)
    canvas = plain_canvas()
    canvas.polygon([(0.0, 2.0), (2.0, 2.0), (2.0, 4.0)], '#0000ff')
    left, top, right, bottom, count = covered(canvas, (0, 0, 255))
    assert (left, top, right, bottom) == pytest.approx((30, 40, 50, 60), abs=1)
    assert count == pytest.approx(200, abs=25)
    canvas = plain_canvas()
    canvas.disc((1.0, 3.0), 12.0, '#00ff00')
    left, top, right, bottom, count = covered(canvas, (0, 255, 0))
    assert (left, top, right, bottom) == pytest.approx((28, 38, 52, 62), abs=1)
    assert count == pytest.approx(math.pi * 144, rel=0.08)
    canvas = plain_canvas()
    canvas.arc((1.0, 3.0), 1.0, 0.0, math.pi / 2, '#000000', 2.0)
    left, top, right, bottom, _ = covered(canvas, (0, 0, 0))
    assert (left, top, right, bottom) == pytest.approx((40, 40, 51, 50), abs=2)


def test_a_tint_lets_through_what_is_below() -> None:
    canvas = plain_canvas()
    canvas.tint([(0.0, 2.0), (4.0, 2.0), (4.0, 4.0), (0.0, 4.0)], '#ff0000', 0.4)
    assert colours(canvas)[50, 50].tolist() == pytest.approx([255, 153, 153], abs=2)
    assert colours(canvas)[30, 50].tolist() == [255, 255, 255]


def test_a_line_is_as_wide_as_it_says_and_dashed_where_it_is_asked_to() -> None:
    canvas = plain_canvas()
    canvas.line([(0.0, 3.0), (6.0, 3.0)], '#000000', 4.0)
    left, top, right, bottom, _ = covered(canvas, (0, 0, 0))
    assert (left, right) == pytest.approx((30, 90), abs=1)
    assert bottom - top == pytest.approx(4, abs=1)
    canvas = plain_canvas()
    canvas.line([(0.0, 3.0), (6.0, 3.0)], '#000000', 4.0, dash=(6, 4))
    row = colours(canvas)[50, 30:90, 0] < 128
    assert row.sum() == pytest.approx(36, abs=7)
    assert (np.abs(np.diff(row.astype(int))) > 0).sum() in (11, 12)
    assert _dashes([(0.0, 0.0), (10.0, 0.0), (10.0, 3.0)], 4.0, 3.0) == [
        [(0.0, 0.0), (4.0, 0.0)],
        [(7.0, 0.0), (10.0, 0.0)],
        [(10.0, 0.0), (10.0, 3.0)],
    ]
    assert _between((1.0, 2.0), (3.0, 6.0), 0.25) == (1.5, 3.0)


def test_cells_of_a_map_are_filled_by_their_values() -> None:
    canvas = plain_canvas()
    values = np.zeros((4, 6), np.uint8)
    values[0, 0], values[3, 5], values[1, 2] = 1, 2, 2
    canvas.raster(values, (0.0, 2.0), 0.5, ['#ff0000', '#0000ff'])
    picture = colours(canvas)
    for row, column in np.ndindex(4, 6):
        x, y = canvas.at((0.25 + 0.5 * column, 2.25 + 0.5 * row))
        expected = {0: [255] * 3, 1: [255, 0, 0], 2: [0, 0, 255]}[int(values[row, column])]
        assert picture[int(y), int(x)].tolist() == pytest.approx(expected, abs=3)
    assert covered(canvas, (255, 0, 0))[:4] == pytest.approx((30, 55, 35, 60), abs=1)
    assert (picture[:, 62:] == 255).all(), 'off the map nothing is filled'
    assert (picture[62:] == 255).all()


def test_where_many_ways_lie_the_colour_is_stronger() -> None:
    canvas = plain_canvas()
    way = [(0.0, 3.0), (6.0, 3.0)]
    canvas.traces([way, way, [(3.0, 2.0), (3.0, 5.0)]], '#000000', 3.0, 0.5)
    picture = colours(canvas)
    assert picture[50, 40, 0] == pytest.approx(64, abs=12)
    assert picture[35, 60, 0] == pytest.approx(128, abs=12)
    assert picture[50, 60, 0] == pytest.approx(32, abs=12)
    assert picture[40, 40, 0] == 255


def test_a_sign_is_as_wide_as_its_text_and_round_where_that_is_short() -> None:
    for text, wide in (('R1', None), ('a long name', True)):
        canvas = plain_canvas()
        canvas.pill((70.0, 50.0), text, 10.0, '#0000ff')
        left, top, right, bottom, _ = covered(canvas, (0, 0, 255))
        high = 17.5
        expected = max(high, canvas.text_width(text, 10.0) + 11.0)
        assert right - left == pytest.approx(expected, abs=2)
        assert bottom - top == pytest.approx(high, abs=2)
        assert (left + right) / 2 == pytest.approx(70, abs=1)
        assert (top + bottom) / 2 == pytest.approx(50, abs=1)
        assert wide is None or right - left > 2 * high
        assert (colours(canvas)[top:bottom, left:right] > 200).all(axis=2).sum() > 8, 'the text'
