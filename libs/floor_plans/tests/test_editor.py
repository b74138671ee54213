"""Editing a place: what each change makes of the file, what is refused, and what is kept."""

from __future__ import annotations

import codecs
import shutil
import threading
from pathlib import Path
from zoneinfo import available_timezones

import numpy as np
import pytest

from floor_plans import read_place
from floor_plans.editor import PlaceEditor
from floor_plans.imports import ImportRequest, import_place
from floor_plans.map_rooms import propose
from floor_plans.occupancy_map import read_map, write_map
from floor_plans.writing import format_place
from strict_files.files import FileError

SEVEN = Path(__file__).with_name('places') / 'seven_rooms.yaml'


@pytest.fixture
def typed(tmp_path: Path) -> PlaceEditor:
    """Provide a place with walls, as a person typed it."""
    shutil.copy(SEVEN, tmp_path / 'place.yaml')
    return PlaceEditor(tmp_path / 'place.yaml')


@pytest.fixture
def scanned(tmp_path: Path) -> PlaceEditor:
    """Provide the same place as a map, with the rooms that are proposed for it."""
    grid = read_place(SEVEN).plan.grid()
    write_map(tmp_path / 'map.yaml', grid.cells[::-1], 0.05, (*grid.origin, 0.0))
    found = propose(read_map(tmp_path / 'map.yaml'), 0.22)
    text = format_place({'map_file': 'map.yaml', **found.parameters}, 'Made by a test.')
    (tmp_path / 'place.yaml').write_text(text)
    return PlaceEditor(tmp_path / 'place.yaml')


def test_a_room_is_removed_with_its_doors_and_brought_back(typed: PlaceEditor) -> None:
    typed.apply('set_keep_out', {'room': 'R3', 'on': True})
    assert typed.apply('remove_room', {'room': 'R3'}) == 'R3 is removed'
    typed.save()
    written = read_place(typed.path)
    assert 'R3' not in written.place.rooms
    assert 'D3' not in {*written.place.doors, *written.plan.doors}
    assert 'R3' not in (typed.now.described.get('keep_out') or ())
    typed.undo()
    assert typed.now.plan.place.doors['D3'] == ('R3', 'C2')
    with pytest.raises(ValueError, match='C2: is the only way to R3, R4'):
        typed.apply('remove_room', {'room': 'C2'})
    with pytest.raises(ValueError, match='holds a charging station'):
        typed.apply('remove_room', {'room': 'E'})


def room_at(editor: PlaceEditor, x: float, y: float) -> str:
    return editor.now.regions.room_at(x, y) or ''


@pytest.mark.parametrize('kind', ['typed', 'scanned'])
def test_a_room_is_cut_and_joined_again(kind: str, request: pytest.FixtureRequest) -> None:
    editor: PlaceEditor = request.getfixturevalue(kind)
    before = editor.now.plan.place
    east, west = room_at(editor, 17, 13), room_at(editor, 8, 13)
    assert east == west
    # Not as far as the walls: it is carried on to them.
    editor.apply('cut', {'x1': 14, 'y1': 11, 'x2': 14, 'y2': 13})
    sides = {room_at(editor, 13, 12), room_at(editor, 15, 12)}
    assert len(sides) == 2
    place = editor.now.plan.place
    assert len(place.rooms) == 8
    fourth = room_at(editor, 15, 15)
    (door,) = place.rooms[fourth]
    assert room_at(editor, 15, 12) in place.doors[door], 'the doors go with their side'
    editor.save()
    assert len(read_place(editor.path).place.rooms) == 8, 'as anybody reads it'
    first, second = (room_at(editor, x, 12) for x in (13, 15))
    editor.apply('join', {'first': first, 'second': second})
    after = editor.now.plan.place
    assert {frozenset(sides) for sides in after.doors.values()} == {
        frozenset(sides) for sides in before.doors.values()
    } or kind == 'typed'
    assert room_at(editor, 15, 12) == room_at(editor, 13, 12) == first


def test_what_a_line_cannot_cut_is_said(typed: PlaceEditor, scanned: PlaceEditor) -> None:
    for editor in (typed, scanned):
        with pytest.raises(ValueError, match='runs through no room'):
            editor.apply('cut', {'x1': -50, 'y1': 0, 'x2': -40, 'y2': 0})
        with pytest.raises(ValueError, match='expected two points'):
            editor.apply('cut', {'x1': 9, 'y1': 3, 'x2': 9, 'y2': 3})
        with pytest.raises(ValueError, match="x1 'a': expected a number"):
            editor.apply('cut', {'x1': 'a', 'y1': 3, 'x2': 9, 'y2': 3})
        with pytest.raises(ValueError, match='no change'):
            editor.apply('saw', {})
        with pytest.raises(ValueError, match='missing a required argument'):
            editor.apply('cut', {'x1': 1})
        assert not editor.undoable


def test_two_rooms_with_a_wall_between_become_one_through_the_opening(typed: PlaceEditor) -> None:
    typed.apply('join', {'first': 'C1', 'second': 'R1'})
    assert room_at(typed, 10, 5) == room_at(typed, 10, 8) == 'C1'
    assert 'D1' not in typed.now.plan.doors
    grid = typed.now.plan.grid()
    assert grid.at(grid.free, 10.0, 6.5), 'the opening is still there'
    assert not grid.at(grid.free, 9.0, 6.5), 'and the wall beside it'


def test_a_door_finds_its_wall_or_its_opening(typed: PlaceEditor, scanned: PlaceEditor) -> None:
    typed.apply('move_door', {'name': 'D1', 'x': 11.0, 'y': 6.7})
    assert typed.now.plan.doors['D1'].y == pytest.approx(6.5)
    with pytest.raises(ValueError, match=r'no wall of 1\.2 m or more within 1 m'):
        typed.apply('move_door', {'name': 'D1', 'x': 11.0, 'y': 4.2})
    with pytest.raises(ValueError, match="no door 'D11': expected 'D1'"):
        typed.apply('move_door', {'name': 'D11', 'x': 11.0, 'y': 4.2})
    name = next(name for name, door in scanned.now.plan.doors.items() if abs(door.y - 6.5) < 0.3)
    door = scanned.now.plan.doors[name]
    scanned.apply('move_door', {'name': name, 'x': door.x + 0.2, 'y': 6.5})
    found = scanned.now.plan.doors[name]
    assert found.width == pytest.approx(1.2, abs=0.15)
    assert found.x == pytest.approx(door.x, abs=0.1)


def test_names_keep_their_place_and_comments_and_undo_takes_all_back(typed: PlaceEditor) -> None:
    text = SEVEN.read_text().replace('R1: [D1]', 'R1: [D1]  # where the coffee is')
    typed.path.write_text(text)
    typed.reload()
    typed.apply('rename', {'kind': 'room', 'name': 'R1', 'new': 'kitchen'})
    typed.apply('rename', {'kind': 'door', 'name': 'D1', 'new': 'flap'})
    typed.apply('rename', {'kind': 'room', 'name': 'E', 'new': 'dock'})
    typed.apply('set_rule', {'room': 'kitchen', 'key': 'thresholds', 'value': 600})
    written = typed.text()
    assert 'kitchen: [flap] # where the coffee is\n      R2: [D2]' in written
    assert 'robot_room: dock' in written
    assert '# Walls by their centre lines' in written
    for _ in range(4):
        typed.undo()
    assert typed.text() == text
    with pytest.raises(ValueError, match='nothing to undo'):
        typed.undo()
    for _ in range(4):
        typed.redo()
    assert typed.text() == written
    assert typed.is_changed
    typed.save()
    typed.undo()
    typed.undo()
    typed.save()
    assert 'E: [D6, D7]' in typed.path.read_text()
    assert 'kitchen: [flap] # where the coffee is' in typed.path.read_text()


def test_the_file_s_own_checks_refuse_a_change(typed: PlaceEditor) -> None:
    corners = [[9, 4], [11, 4], [11, 6], [9, 6]]
    said = typed.problem_with('set_zone', {'kind': 'keep_out', 'corners': corners})
    assert said == 'room_positions.R1: (10, 5) lies in the keep-out zone K1: expected it outside'
    said = typed.problem_with('remove_door', {'name': 'D1'})
    assert said == 'map.R1: expected a list of at least one door, got []'
    said = typed.problem_with('set_rule', {'room': 'R1', 'key': 'hours', 'value': 'mon 8'})
    assert said.startswith('hours.R1: ')
    said = typed.problem_with('move_point', {'room': 'R1', 'x': 10, 'y': 8})
    assert said == '(10.00, 8.00) lies in C1: expected R1'
    said = typed.problem_with('set_rule', {'room': 'R1', 'key': 'classes', 'value': 'HALL'})
    assert said == "classes.R1: 'HALL': expected ROOM or CORRIDOR"
    assert not typed.is_changed
    said = typed.problem_with('set_text', {'key': 'time_zone', 'value': 'Europe/Rome'})
    assert said == '' or 'Europe/Rome' not in available_timezones()


def test_what_somebody_else_wrote_is_not_overwritten(typed: PlaceEditor) -> None:
    typed.apply('move_station', {'x': 4, 'y': 9})
    assert typed.now.plan.stations['E'].pose == (4.0, 9.0, 0.0)
    typed.path.write_text(typed.path.read_text() + '# a note\n')
    with pytest.raises(FileError, match='changed by somebody else'):
        typed.save()
    typed.reload()
    assert not typed.is_changed
    typed.apply('set_marker', {'id': 7, 'x': 7.1, 'y': 4, 'z': 1.0, 'yaw': 0.0})
    typed.apply('add_door', {'x': 12.4, 'y': 4.0})
    typed.save()
    assert '# a note' in typed.path.read_text()
    plan = read_place(typed.path).plan
    assert plan.markers['M1'].id == 7
    assert set(plan.place.doors['D8']) == {'R1', 'R2'}


@pytest.mark.parametrize('turn', range(5))
def test_of_two_saves_at_once_one_is_refused(tmp_path: Path, turn: int) -> None:
    path = tmp_path / 'place.yaml'
    path.write_text(SEVEN.read_text())
    editors = [PlaceEditor(path), PlaceEditor(path)]
    for number, each in enumerate(editors):
        each.apply('set_rule', {'room': 'R1', 'key': 'thresholds', 'value': 600 + number})
    ready, said = threading.Barrier(2), {}

    def save(number: int) -> None:
        ready.wait(60.0)
        try:
            said[number] = editors[number].save()
        except FileError as error:
            said[number] = str(error)

    threads = [threading.Thread(target=save, args=(number,)) for number in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    (winner,) = [number for number, text in said.items() if text.startswith('written')]
    assert 'changed by somebody else' in said[1 - winner]
    assert f'R1: {600 + winner}' in path.read_text()


@pytest.mark.parametrize('mark', [b'', codecs.BOM_UTF8])
@pytest.mark.parametrize('line_end', ['\n', '\r\n'])
def test_a_file_stays_as_it_was_but_for_the_change(
    tmp_path: Path, mark: bytes, line_end: str
) -> None:
    path = tmp_path / 'place.yaml'
    before = mark + SEVEN.read_text().replace('\n', line_end).encode()
    path.write_bytes(before)
    path.chmod(0o640)
    editor = PlaceEditor(path)
    editor.apply('set_rule', {'room': 'R1', 'key': 'thresholds', 'value': 600})
    editor.save()
    after = path.read_bytes()
    lines = after.decode('utf-8-sig').split(line_end)
    assert after.startswith(mark)
    assert set(before.decode('utf-8-sig').split(line_end)) <= set(lines)
    assert any('R1: 600' in line for line in lines)
    assert after.count(b'\r') == (after.count(b'\n') if line_end == '\r\n' else 0)
    assert path.stat().st_mode & 0o777 == 0o640
    editor.undo()
    editor.save()
    assert path.read_bytes() == before


def test_a_zone_over_the_only_way_names_what_falls_apart(typed: PlaceEditor) -> None:
    corners = [[8.0, 6.6], [8.6, 6.6], [8.6, 9.9], [8.0, 9.9]]
    typed.apply('set_zone', {'kind': 'keep_out', 'corners': corners})
    across = [[x + 3.2, y] for x, y in corners]
    assert typed.problem_with('set_zone', {'kind': 'keep_out', 'corners': across}) == (
        'room_positions.R1: a robot of 0.44 m cannot drive from E to R1, C1: expected no wall or '
        'a keep-out zone in the way'
    )


def test_the_part_with_the_station_is_where_the_robot_charges(scanned: PlaceEditor) -> None:
    room = room_at(scanned, 5, 10)
    scanned.apply('move_station', {'x': 3.0, 'y': 12.0})
    scanned.apply('cut', {'x1': 2.5, 'y1': 11.0, 'x2': 6.5, 'y2': 11.0})
    with_station = room_at(scanned, 3.0, 12.0)
    assert scanned.now.plan.place.recharge_rooms == (with_station,)
    assert room in scanned.now.plan.place.rooms
    other = room_at(scanned, 8, 12)
    scanned.apply('add_station', {'x': 9, 'y': 12})
    assert set(scanned.now.plan.stations) == {with_station, other}
    with pytest.raises(ValueError, match='both have a charging station'):
        scanned.apply('join', {'first': with_station, 'second': other})
    scanned.apply('move_station', {'x': 8.5, 'y': 12, 'room': other})
    scanned.apply('remove_station', {'room': with_station})
    assert scanned.now.plan.place.recharge_rooms == (other,)
    scanned.save()
    assert read_place(scanned.path).plan.stations[other].pose[:2] == (8.5, 12.0)


def test_a_part_that_was_left_out_becomes_a_room_and_is_left_out_again(tmp_path: Path) -> None:
    cells = np.full((140, 320), 0, np.int8)  # free up to the edge, as white paper is
    cells[[20, 119], 20:300] = cells[20:120, 20] = cells[20:120, 299] = 100
    cells[20:120, 120] = cells[20:120, 220] = 100
    cells[60:80, 120] = 0  # a door
    cells[67:73, 220] = 0  # a gap of 0.3 m
    cells[60:84, 20] = 0  # a way out
    write_map(tmp_path / 'map.yaml', cells, 0.05, (0.0, 0.0, 0.0))
    report = import_place(ImportRequest(tmp_path / 'map.yaml', tmp_path / 'place.yaml'))
    assert report.found.startswith('2 rooms, 2 doors, one of them leads outside')
    editor = PlaceEditor(tmp_path / 'place.yaml')
    outside, behind = editor.now.left_out
    plan = editor.now.plan
    assert outside.is_outside
    assert outside.reason(plan) == 'outside of the building'
    assert behind.reason(plan).startswith('its way in is closed: a wall of 0.')
    assert room_at(editor, *behind.at) == ''
    with pytest.raises(ValueError, match='expected more than 0'):
        editor.apply('take_part', {'x': behind.at[0], 'y': behind.at[1]})
    with pytest.raises(ValueError, match='lies in R1: expected a part that is no room'):
        editor.apply('take_part', dict(zip('xy', plan.place.positions['R1'][:2], strict=True)))
    said = editor.apply('take_part', {'x': outside.at[0], 'y': outside.at[1]})
    taken = room_at(editor, *outside.at)
    assert said.startswith(f'{taken} is a room, joined by ')
    editor.save()
    assert len(read_place(editor.path).place.rooms) == 3
    assert [part.is_outside for part in editor.now.left_out] == [False]
    editor.undo()
    assert len(editor.now.left_out) == 2


@pytest.mark.parametrize('kind', ['typed', 'scanned'])
def test_one_tap_on_a_door_joins_its_rooms_or_walls_it_off(
    kind: str, request: pytest.FixtureRequest
) -> None:
    editor: PlaceEditor = request.getfixturevalue(kind)
    place = editor.now.plan.place
    door = next(
        name
        for name, rooms in place.doors.items()
        if {len(place.rooms[room]) for room in rooms} == {1, 4}
    )
    small, large = sorted(place.doors[door], key=lambda room: len(place.rooms[room]))
    areas = {room: int(editor.now.regions.mask(room).sum()) for room in (small, large)}
    keeps = max(areas, key=areas.__getitem__)
    editor.apply('join_at', {'name': door})
    assert door not in editor.now.plan.doors
    assert keeps in editor.now.plan.place.rooms
    assert len(editor.now.plan.place.rooms) == len(place.rooms) - 1
    editor.undo()
    with pytest.raises(ValueError, match='expected'):
        editor.apply('wall_off', {'name': door})  # the only way into its room
    between = next(
        name
        for name, rooms in place.doors.items()
        if all(len(place.rooms[room]) >= 2 for room in rooms)
        and len(set(place.rooms[rooms[0]]) & set(place.rooms[rooms[1]])) == 1
    )
    at = editor.now.plan.doors[between]
    assert editor.apply('wall_off', {'name': between}) == f'{between} is a wall'
    assert between not in editor.now.plan.place.doors
    grid = editor.now.plan.grid()
    assert not grid.at(grid.free, at.x, at.y)
    editor.save()
    assert between not in read_place(editor.path).place.doors
    with pytest.raises(ValueError, match=f'no door .*{between}|stands nowhere'):
        editor.apply('wall_off', {'name': between})


def test_doubtful_doors_are_told_the_least_sure_first(tmp_path: Path, typed: PlaceEditor) -> None:
    assert typed.now.doubtful == (), 'a person typed them'
    cells = np.full((120, 240), 100, np.int8)
    cells[10:110, 10:120] = cells[10:110, 124:154] = 0
    cells[40:84, 120:124] = 0  # 2.2 m
    cells[10:110, 158:230] = 0
    cells[50:68, 154:158] = 0
    write_map(tmp_path / 'map.yaml', cells, 0.05, (0.0, 0.0, 0.0))
    (tmp_path / 'wide.yaml').write_text(
        format_place(
            {
                'map_file': 'map.yaml',
                'map': {'A': ['D1'], 'B': ['D1', 'D2'], 'C': ['D2']},
                'room_positions': {'A': [2.0, 3.0], 'B': [6.9, 3.0], 'C': [10.0, 3.0]},
                'robot_room': 'A',
                'recharge_rooms': ['A'],
                'station': [2.0, 3.0, 0.0],
                'doors': {'D1': [6.1, 2.9, 1.5708, 2.2], 'D2': [7.8, 3.05, 1.5708, 0.9]},
            },
            'Made by a test.',
        )
    )
    assert PlaceEditor(tmp_path / 'wide.yaml').now.doubtful == (('door', 'D1'),)
