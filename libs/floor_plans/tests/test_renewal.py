"""A newer map of a building: what keeps its name, what moves with the map, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from floor_plans import RoomMap, read_place
from floor_plans.imports import ImportRequest, import_place
from floor_plans.imports.renewal import alignment
from floor_plans.occupancy_grid import Grid
from floor_plans.occupancy_map import read_map, write_map

SEVEN = Path(__file__).with_name('places') / 'seven_rooms.yaml'
MORE = """
    thresholds: {R1: 60.0, R4: 90.0}
    hours: {R3: mon-fri 08:00-18:00}
    keep_out: [R2]
    keep_out_zones:
      stairs: [8.5, 8.6, 9.5, 8.6, 9.5, 10.0, 8.5, 10.0]
"""
YAW = math.radians(5.0)


def newer(folder: Path, *, with_wall: bool) -> Path:
    """Draw the seven rooms as a map that lies 2 m beside the older one, turned by 5 degrees."""
    grid = read_place(SEVEN).plan.grid()
    cells = grid.cells.copy()
    if with_wall:
        row, column = grid.cell_of(14.0, 12.0)
        cells[row : row + 60, column] = 100
    x, y = grid.origin
    write_map(folder / 'newer.yaml', cells[::-1], grid.resolution, (x + 2.0, y - 1.0, YAW))
    return folder / 'newer.yaml'


def moved(x: float, y: float) -> tuple[float, float]:
    """Return a point of the older map on the newer one."""
    grid = read_place(SEVEN).plan.grid()
    dx, dy = x - grid.origin[0], y - grid.origin[1]
    return (
        grid.origin[0] + 2.0 + math.cos(YAW) * dx - math.sin(YAW) * dy,
        grid.origin[1] - 1.0 + math.sin(YAW) * dx + math.cos(YAW) * dy,
    )


def older(folder: Path) -> Path:
    path = folder / 'older.yaml'
    path.write_text(SEVEN.read_text() + MORE)
    return path


def test_a_shift_and_a_turn_are_found_to_a_cell(tmp_path: Path) -> None:
    old, new = read_place(SEVEN).plan.grid(), read_map(newer(tmp_path, with_wall=True)).grid
    found = alignment(old, new)
    assert found.agreement > 0.9
    assert found.yaw == pytest.approx(-YAW, abs=0.003)
    for point in ((2.0, 2.0), (16.0, 14.0)):
        assert found.to_old([moved(*point)])[0] == pytest.approx(point, abs=0.08)
        assert found.to_new(found.to_old([point]))[0] == pytest.approx(point)


def test_rooms_doors_zones_and_rules_outlive_a_newer_map(tmp_path: Path) -> None:
    source = newer(tmp_path, with_wall=False)
    request = ImportRequest(source, tmp_path / 'place.yaml', update=older(tmp_path))
    report = import_place(request)
    was, now = read_place(older(tmp_path)), read_place(tmp_path / 'place.yaml')
    assert {name: set(sides) for name, sides in now.place.doors.items()} == {
        name: set(sides) for name, sides in was.place.doors.items()
    }
    regions = RoomMap(now.plan)
    for room, (x, y, _) in was.place.positions.items():
        assert regions.room_at(*moved(x, y)) == room
    assert now.rules == was.rules
    for corner, before in zip(
        now.plan.zones.keep_out['stairs'].corners,
        was.plan.zones.keep_out['stairs'].corners,
        strict=True,
    ):
        assert corner == pytest.approx(moved(*before), abs=0.1)
    (x, y, yaw), (old_x, old_y, old_yaw) = now.plan.start, was.plan.start
    assert (x, y) == pytest.approx(moved(old_x, old_y), abs=0.1)
    assert yaw == pytest.approx(old_yaw + YAW, abs=0.01)
    assert any(line.startswith('rooms kept: ') for line in report.lines)
    assert report.content['changes'] == []


def test_a_new_wall_makes_a_new_room_and_all_others_keep_their_names(tmp_path: Path) -> None:
    source = newer(tmp_path, with_wall=True)
    report = import_place(ImportRequest(source, tmp_path / 'p.yaml', update=older(tmp_path)))
    place = read_place(tmp_path / 'p.yaml').place
    was = read_place(older(tmp_path)).place
    assert set(was.rooms) < set(place.rooms)
    assert set(was.doors) < set(place.doors)
    assert [(each['name'], each['kept']) for each in report.content['changes']] == [('R5', 'new')]
    assert any(line.startswith('room R5 is new: it was a part of ') for line in report.lines)


def test_a_change_of_a_newer_map_is_taken_or_not_piece_by_piece(tmp_path: Path) -> None:
    source, old = newer(tmp_path, with_wall=True), older(tmp_path)
    request = ImportRequest(source, tmp_path / 'p.yaml', update=old, keep_old=('R5',))
    report = import_place(request)
    assert [(each['name'], each['kept']) for each in report.content['changes']] == [('R5', 'old')]
    place = read_place(tmp_path / 'p.yaml').place
    assert {name: set(sides) for name, sides in place.doors.items()} == {
        name: set(sides) for name, sides in read_place(old).place.doors.items()
    }
    with pytest.raises(ValueError, match=r"^--keep-old: no change 'R9': expected 'R5'"):
        import_place(replace(request, keep_old=('R9',), force=True))


def test_a_room_whose_wall_is_gone_comes_back_with_what_was_said_of_it(tmp_path: Path) -> None:
    """The newer map shows no wall any more between R4 and what is beside it."""
    plan = read_place(older(tmp_path)).plan
    grid = plan.grid()
    cells = grid.cells.copy()
    gone = next(name for name in plan.place.rooms['R4'] if len(plan.place.doors[name]) == 2)
    door = plan.doors[gone]
    for along in np.arange(-2.0, 2.0, 0.02):
        for across in np.arange(-0.15, 0.15, 0.02):
            x = door.x + along * math.cos(door.yaw) - across * math.sin(door.yaw)
            y = door.y + along * math.sin(door.yaw) + across * math.cos(door.yaw)
            cells[grid.cell_of(x, y)] = 0
    write_map(tmp_path / 'open.yaml', cells[::-1], grid.resolution, (*grid.origin, 0.0))
    out = tmp_path / 'p.yaml'
    request = ImportRequest(tmp_path / 'open.yaml', out, update=older(tmp_path))
    report = import_place(request)
    assert 'R4' not in read_place(out).place.rooms
    changes = {each['name']: each for each in report.content['changes']}
    assert changes['R4']['can_keep_old']
    import_place(replace(request, keep_old=('all',), force=True))
    now = read_place(out)
    assert set(now.place.doors[gone]) == set(plan.place.doors[gone])
    assert now.rules.thresholds['R4'] == 90.0
    x, y, _ = plan.place.positions['R4']
    assert RoomMap(now.plan).room_at(x, y) == 'R4'


def test_another_building_is_refused(tmp_path: Path) -> None:
    cells = np.full((200, 300), -1, np.int8)
    cells[10:190, 10:290] = 0
    cells[[10, 189], 10:290] = cells[10:190, 10] = cells[10:190, 289] = 100
    for column in range(40, 280, 37):
        cells[60:150, column] = 100
    write_map(tmp_path / 'other.yaml', cells, 0.05, (0.0, 0.0, 0.0))
    request = ImportRequest(tmp_path / 'other.yaml', tmp_path / 'p.yaml', update=older(tmp_path))
    with pytest.raises(ValueError, match=r'^--update .*older\.yaml: the maps agree by \d+%: expec'):
        import_place(request)
    assert not (tmp_path / 'p.yaml').exists()
    with pytest.raises(ValueError, match='nothing stands on one of the maps'):
        alignment(Grid(np.zeros((9, 9), np.int8), 0.05), Grid(cells, 0.05))
