"""Open-RMF's `building.yaml` becomes a place: its walls, doors, names, chargers and levels."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import RoomMap, read_place
from floor_plans.imports.command import main

HALF = """\
  {name}:
    elevation: {elevation}
    drawing: {{filename: floor.png}}
    fiducials: {fiducials}
    measurements:
    - [0, 1, {{distance: [3, {distance}]}}]
    vertices:
{vertices}
    walls:
    - [0, 1, {{texture_name: [1, default]}}]
    - [1, 2, {{texture_name: [1, default]}}]
    - [2, 3, {{}}]
    - [3, 0, {{}}]
    - [4, 5, {{}}]
    - [6, 7, {{}}]
    doors:
    - [5, 6, {{name: [1, "{name} door"], type: [1, hinged], motion_axis: [1, start]}}]
    floors:
    - {{vertices: [0, 1, 2, 3], parameters: {{texture_name: [1, blue]}}}}
    lanes:
    - [8, 9, {{bidirectional: [4, true], graph_idx: [2, 0]}}]
"""
# Two rooms of 5 m by 4 m, a wall between them with a door of 1 m; a pixel is 0.02 m, rows go down.
PIXELS = [
    *((0, 0), (500, 0), (500, 200), (0, 200)),
    *((250, 0), (250, 75), (250, 125), (250, 200), (100, 100), (400, 150)),
]
NAMES = ('', '', '', '', '', '', '', '', 'reception', 'ward 2')


def level(name: str, elevation: float, scale: float = 1.0, shift: float = 0.0) -> str:
    rows = []
    for (x, y), called in zip(PIXELS, NAMES, strict=True):
        more = ', {is_charger: [4, true]}' if called == 'reception' else ''
        rows.append(f'    - [{shift + scale * x}, {shift + scale * y}, 0, "{called}"{more}]')
    fiducials = [[shift + scale * x, shift + scale * y, f'f{x}'] for x, y in ((0, 0), (500, 200))]
    return HALF.format(
        name=name,
        elevation=elevation,
        fiducials=fiducials,
        distance=10.0 if scale == 1.0 else 77.0,  # only the reference level's are used
        vertices='\n'.join(rows),
    )


def building(folder: Path, *levels: str, head: str = 'coordinate_system: reference_image') -> Path:
    path = folder / 'clinic.building.yaml'
    path.write_text(f'name: clinic\n{head}\nlevels:\n' + ''.join(levels) + 'lifts: {}\n')
    return path


def test_a_building_becomes_a_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    path = building(tmp_path, level('L1', 0.0))
    assert main([str(path), '--labels', 'rooms.png']) == 0
    said = capsys.readouterr().out
    assert '2 rooms, 1 door' in said
    assert 'level L1 as a map: clinic_place_map.yaml' in said
    plan = read_place(tmp_path / 'clinic_place.yaml').plan
    # Open-RMF's frame: the pixel's row turned upwards.
    assert plan.place.positions == {'reception': (2, -2, 0), 'ward_2': (8, -3, 0)}
    assert plan.place.start == 'reception'
    assert plan.stations['reception'].pose == (2.0, -2.0, 0.0)
    door = plan.doors['L1_door']
    assert (door.x, door.y, door.width) == pytest.approx((5.0, -2.0, 1.0), abs=1e-3)
    regions = RoomMap(plan)
    assert regions.room_at(4.5, -0.5) == 'reception'
    assert regions.room_at(5.5, -0.5) == 'ward_2'
    assert regions.room_at(-1.0, 1.0) is None
    assert plan.map is not None
    grid = plan.map.grid
    assert grid.bounds == pytest.approx((-0.5, -4.5, 10.5, 0.5)), 'half a metre around'
    assert [grid.at(grid.cells, *at) for at in ((1, -1), (5, -1), (5, -2), (0, -2), (-0.3, 0))] == [
        *(0, 100, 0, 100, -1)
    ]


def test_a_level_lies_over_the_reference_level(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    path = building(tmp_path, level('L1', 0.0), level('L2', 4.0, scale=2.0, shift=300.0))
    assert main([str(path)]) == 2
    said = capsys.readouterr().err
    assert '2 levels (L1, L2), and a place is one floor: expected --level with one of them' in said
    assert said.count('\n') == 1
    assert main([str(path), '--level', 'L3']) == 2
    assert "no level 'L3'" in capsys.readouterr().err
    assert main([str(path), '--level', 'L2']) == 0
    place = read_place(tmp_path / 'clinic_place.yaml').place
    assert place.positions['ward_2'] == pytest.approx((8, -3, 0), abs=1e-3)


def test_a_wall_without_floors_closes_the_building(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = level('L1', 0.0).split('    floors:')[0]
    assert main([str(building(tmp_path, text))]) == 0
    plan = read_place(tmp_path / 'clinic_place.yaml').plan
    assert set(plan.place.rooms) == {'reception', 'ward_2'}
    assert plan.map is not None
    assert plan.map.grid.at(plan.map.grid.cells, -0.3, -2.0) == -1


def test_a_damaged_building_costs_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = level('L1', 0.0)
    for text, head, expected in (
        (whole.replace('[6, 7,', '[6, 70,'), '', 'walls: vertex 70 is not there'),
        (
            whole.replace('    measurements:\n    - [0, 1,', '    pieces:\n    - [0, 1,'),
            '',
            'pixel',
        ),
        (whole.replace('[0, 0, 0,', '[0, .nan, 0,').replace('[0.0, 0.0', '[.nan, 0'), '', 'finite'),
        (whole.replace('distance: [3, 10.0]', 'distance: [3, far]'), '', 'far'),
        (whole.split('    walls:')[0], '', 'no walls'),
        (whole, 'coordinate_system: wgs84', 'coordinate_system wgs84: expected reference_image'),
        (whole.replace('    doors:', '    doors: ['), '', 'no YAML'),
    ):
        assert main([str(building(tmp_path, text, head=head)), '--force']) == 2, expected
        said = capsys.readouterr().err
        assert expected in said
        assert said.count('\n') == 1
    path = building(tmp_path, whole)
    assert main([str(path), '--resolution', '0.1']) == 2
    assert 'expected no --resolution' in capsys.readouterr().err
