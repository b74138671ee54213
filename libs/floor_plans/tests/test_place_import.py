"""The command `import`: rooms and doors of a map, the place it writes, and what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from floor_plans import RoomMap, read_place
from floor_plans.imports import ImportRequest, import_place
from floor_plans.imports.command import main
from floor_plans.occupancy_map import write_map

CONFIG = Path(__file__).with_name('places')


def mapped(folder: Path, place: str, yaw: float = 0.0, resolution: float = 0.05) -> Path:
    """Draw one of the project's places as the map that a robot would have of it."""
    grid = read_place(CONFIG / f'{place}.yaml').plan.grid(resolution)
    cells = grid.cells[::-1]
    write_map(folder / f'{place}.yaml', cells, resolution, (*grid.origin, yaw))
    return folder / f'{place}.yaml'


def hall(folder: Path) -> Path:
    cells = np.full((120, 200), -1, np.int8)
    cells[10:110, 10:190] = 0
    cells[[10, 109], 10:190] = cells[10:110, 10] = cells[10:110, 189] = 100
    for row, column in ((30, 50), (30, 60), (38, 50), (38, 60), (70, 120)):
        cells[row : row + 2, column : column + 2] = 100  # a table's legs, a chair
    write_map(folder / 'hall.yaml', cells, 0.05, (0.0, 0.0, 0.0))
    return folder / 'hall.yaml'


@pytest.mark.parametrize('yaw', [0.0, 0.35])
def test_the_seven_rooms_are_found_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], yaw: float
) -> None:
    monkeypatch.chdir(tmp_path)
    path = mapped(tmp_path, 'seven_rooms', yaw)
    assert main([str(path), '--labels', 'rooms.png']) == 0
    assert '7 doors' in capsys.readouterr().out
    found = read_place(tmp_path / 'seven_rooms_place.yaml').plan
    true = read_place(CONFIG / 'seven_rooms.yaml').plan
    assert found.map is not None
    assert len(found.place.rooms) == 7
    regions = RoomMap(found)
    rooms = {}
    for name, (x, y, _) in true.place.positions.items():
        (own,) = found.map.to_world([(x - found.map.origin[0], y - found.map.origin[1])])
        rooms[name] = regions.room_at(*own)
    assert len(set(rooms.values())) == 7
    pairs = {frozenset(rooms[side] for side in sides) for sides in true.place.doors.values()}
    assert {frozenset(sides) for sides in found.place.doors.values()} == pairs
    assert [door.width for door in found.doors.values()] == pytest.approx([1.2] * 7, abs=0.2)
    labels: Any = cv2.imread(str(tmp_path / 'rooms.png'), cv2.IMREAD_UNCHANGED)
    assert labels.shape == found.map.cells.shape
    assert set(np.unique(labels)) == set(range(8))


def test_an_office_of_forty_rooms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([str(mapped(tmp_path, 'office', resolution=0.1))]) == 0
    found = read_place(tmp_path / 'office_place.yaml').plan
    rooms = [name for name in found.place.rooms if name.startswith('R')]
    assert 40 <= len(rooms) <= 42  # the lobby is no corridor


def test_one_hall_is_one_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([str(hall(tmp_path)), '--out', 'place.yaml']) == 0
    assert list(read_place(tmp_path / 'place.yaml').place.rooms) == ['R1']


def test_the_end_of_what_is_known_is_no_wall(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = hall(tmp_path)
    pixels: Any = cv2.imread(str(tmp_path / 'hall.png'), cv2.IMREAD_GRAYSCALE)
    pixels[70:109, 30:70] = 205
    cv2.imwrite(str(tmp_path / 'hall.png'), pixels)
    assert main([str(path), '--out', 'place.yaml']) == 0
    assert list(read_place(tmp_path / 'place.yaml').place.rooms) == ['R1']


def test_what_cannot_be_imported_costs_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    path = hall(tmp_path)
    (tmp_path / 'there.yaml').touch()
    for words, expected in (
        (['nowhere.yaml'], 'nowhere.yaml'),
        ([str(path), '--out', 'there.yaml'], 'there.yaml: is there already'),
        ([str(path), '--out', 'place.txt'], 'ends in .yaml'),
        ([str(path), '--robot-radius', '4'], 'fits nowhere'),
        (['hall.png'], 'says nothing of its scale'),
        ([str(path), '--resolution', '0.05'], 'says its own resolution'),
    ):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert expected in said
        assert said.count('\n') == 1
    assert not (tmp_path / 'hall_place.yaml').exists()


def test_a_picture_with_its_scale(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    hall(tmp_path)
    assert main(['hall.png', '--resolution', '0.05', '--out', 'place.yaml']) == 0
    assert read_place(tmp_path / 'place.yaml').plan.map is not None


def on_paper(folder: Path, *, entrance: bool = False, sealed: bool = False) -> Path:
    """Draw two rooms with a door on white paper with a margin of 3 m, a pixel being 0.05 m."""
    pixels = np.full((240, 320), 255, np.uint8)
    for line in ((60, 60, 259, 60), (60, 179, 259, 179)):
        cv2.line(pixels, line[:2], line[2:], 0, 3)
    for x in (60, 160, 259):
        cv2.line(pixels, (x, 60), (x, 179), 0, 3)
    if not sealed:
        pixels[110:130, 155:165] = 255
    if entrance:
        pixels[110:132, 255:264] = 255
    cv2.imwrite(str(folder / 'plan.png'), pixels)
    return folder / 'plan.png'


def test_white_paper_around_a_building_is_outside(tmp_path: Path) -> None:
    request = ImportRequest(on_paper(tmp_path), tmp_path / 'place.yaml', resolution=0.05)
    report = import_place(request)
    assert report.found == '2 rooms, 1 door'
    (outside,) = report.content['outside']
    assert outside['area'] == pytest.approx(0.0025 * (240 * 320 - 122 * 202), rel=0.02)
    assert any('--with-outside makes it a room' in line for line in report.lines)
    plan = read_place(tmp_path / 'place.yaml').plan
    assert RoomMap(plan).room_at(1.0, 1.0) is None
    with Image.open(report.content['drawn']) as picture:
        colours = {colour for _, colour in picture.getcolors(1 << 20)}
    assert (0xE4, 0xE8, 0xEC) in colours, 'what is outside is drawn'


def test_a_way_out_is_closed_and_told_or_leads_to_a_room(tmp_path: Path) -> None:
    source = on_paper(tmp_path, entrance=True)
    request = ImportRequest(source, tmp_path / 'place.yaml', resolution=0.05)
    report = import_place(request)
    assert report.found == '2 rooms, 2 doors, one of them leads outside and is closed'
    (entrance,) = report.content['entrances']
    plan = read_place(tmp_path / 'place.yaml').plan
    assert plan.walls[entrance['wall']].length == pytest.approx(1.2, abs=0.15)
    regions = RoomMap(plan)
    assert regions.room_at(12.0, 5.9) == entrance['room']
    assert regions.room_at(14.0, 5.9) is None
    asked = replace(request, with_outside=True, force=True)
    assert len(import_place(asked).content['rooms']) == 3
    assert RoomMap(read_place(tmp_path / 'place.yaml').plan).room_at(14.0, 5.9) is not None


def test_each_part_that_is_left_out_has_its_reason(tmp_path: Path) -> None:
    cells = np.full((120, 300), -1, np.int8)
    cells[10:110, 10:290] = 0
    cells[[10, 109], 10:290] = cells[10:110, 10] = cells[10:110, 289] = 100
    for column in (80, 150, 220):
        cells[10:110, column] = 100
    cells[50:70, 80] = 0  # a door
    cells[56:63, 150] = 0  # 0.35 m: a gap that the robot does not fit through
    write_map(tmp_path / 'map.yaml', cells, 0.05, (0.0, 0.0, 0.0))
    report = import_place(ImportRequest(tmp_path / 'map.yaml', tmp_path / 'place.yaml'))
    assert report.found == '2 rooms, 1 door, 2 parts of the floor left out'
    narrow, walled = sorted(report.content['left_out'], key=lambda each: each['at'][0])
    assert narrow['reason'].startswith('no way in that is wide enough: 0.')
    assert walled['reason'] == 'no door: walls all around'
    assert 7.5 < narrow['at'][0] < 11.0
    assert walled['area'] == pytest.approx(69 * 98 * 0.0025, rel=0.1)
    said = str(report)
    for each in report.content['left_out']:
        assert f'left out, {each["reason"]}: ' in said


def test_a_program_gets_what_a_person_sees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([str(mapped(tmp_path, 'seven_rooms')), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    place = read_place(tmp_path / found['place']).place
    assert {each['name']: each['doors'] for each in found['rooms']} == {
        room: list(doors) for room, doors in place.rooms.items()
    }
    assert {each['name']: tuple(each['joins']) for each in found['doors']} == dict(place.doors)
    assert all(0.5 <= each['confidence'] <= 1.0 for each in (*found['rooms'], *found['doors']))
    assert Path(found['drawn']).stat().st_size > 1000
