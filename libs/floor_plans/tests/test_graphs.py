"""Graphs of other programs become places, or cost one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import read_place
from floor_plans.imports.command import main

GRAPHS = {
    'three.graph': '3 400 300 0.05 -1.0 2.0\n0 0 0 1 1 E 60\n'
    '1 60 0 2 0 W 60 2 N 40\n2 60 40 1 1 S 40\n',
    'three.geojson': (
        '{"type": "FeatureCollection", "features": ['
        '{"type": "Feature", "properties": {"id": 0}, "geometry": {"type": "Point", '
        '"coordinates": [-1.0, 2.0]}}, {"type": "Feature", "properties": {"id": 1}, "geometry": '
        '{"type": "Point", "coordinates": [2.0, 2.0]}}, {"type": "Feature", '
        '"properties": {"id": 2}, '
        '"geometry": {"type": "Point", "coordinates": [2.0, 4.0]}}, {"type": "Feature", '
        '"properties": {"id": 3, "startid": 0, "endid": 1}, "geometry": {"type": '
        '"MultiLineString", "coordinates": [[[0, 0], [1, 1]]]}}, {"type": "Feature", "properties": '
        '{"id": 4, "startid": 2, "endid": 1}, "geometry": {"type": "MultiLineString", '
        '"coordinates": []}}]}'
    ),
    'three.yaml': (
        'building_name: b\nlevels:\n  L1:\n    lanes:\n    - [0, 1, {}]\n    - [1, 0, {}]\n'
        '    - [1, 2, {}]\n    vertices:\n    - [-1.0, 2.0, {name: ""}]\n'
        '    - [2.0, 2.0, {name: ""}]\n    - [2.0, 4.0, {name: lounge}]\n'
    ),
}


@pytest.mark.parametrize('name', GRAPHS)
def test_a_graph_of_another_program_is_a_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text(GRAPHS[name])
    assert main([name, '--out', 'place.yaml']) == 0
    place = read_place(tmp_path / 'place.yaml').place
    third = 'lounge' if name == 'three.yaml' else 'R3'
    assert place.positions == {'R1': (-1, 2, 0), 'R2': (2, 2, 0), third: (2, 4, 0)}
    assert set(map(frozenset, place.doors.values())) == {
        frozenset({'R1', 'R2'}),
        frozenset({'R2', third}),
    }


@pytest.mark.parametrize('name', GRAPHS)
def test_a_damaged_graph_costs_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for text in (GRAPHS[name][: len(GRAPHS[name]) * 2 // 3], '', 'levels: 3\n', '{}'):
        (tmp_path / name).write_text(text)
        assert main([name, '--out', 'place.yaml']) == 2
        assert capsys.readouterr().err.count('\n') == 1
