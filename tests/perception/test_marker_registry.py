"""The registry of markers: the seven rooms, and wrong files."""

from __future__ import annotations

from pathlib import Path

import pytest

from strict_files.files import FileError
from surveillance_perception.marker_registry import read_registry

CONFIG = Path(__file__).parents[2] / 'config'


def test_registry_holds_the_seven_markers():
    markers = read_registry(CONFIG / 'markers.yaml')
    assert {marker_id: place.room for marker_id, place in markers.items()} == {
        11: 'E',
        12: 'C1',
        13: 'C2',
        14: 'R1',
        15: 'R2',
        16: 'R3',
        17: 'R4',
    }
    assert (markers[16].x, markers[16].y) == (9.0, 3.0)
    assert dict(markers[12].connections) == {'D5': 'E', 'D7': 'C2', 'D1': 'R1', 'D2': 'R2'}


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('', ':1: expected a mapping, got nothing'),
        ('markers: []', ":1: expected a mapping 'markers'"),
        ('markers: {}', "'markers' is empty"),
        ('markers: {1: {room: A, x: 0, y: 0, connections: {D: B}}', ':1: not valid YAML'),
        ('markers: {a: {room: A, x: 0, y: 0, connections: {D: B}}}', 'markers.a: an id must be'),
        ('markers: {-1: {room: A, x: 0, y: 0, connections: {D: B}}}', 'markers.-1: an id must be'),
        ('markers: {[1]: E}', ':1: expected a name as key'),
        ('markers:\n  1: E', ":2: markers.1: expected 'room', 'x', 'y' and 'connections'"),
        (
            'markers: {1: {room: 3, x: 0, y: 0, connections: {D: B}}}',
            '1.room: place name 3:',
        ),
        ('markers: {1: {room: A, x: no, y: 0, connections: {D: B}}}', '1.x: expected a number in'),
        ('markers: {1: {room: A, x: .nan, y: 0, connections: {D: B}}}', 'got nan'),
        (
            'markers: {1: {room: A, x: 0, y: 0, connections: {}}}',
            '1.connections: expected',
        ),
        ('markers: {1: {room: A, x: 0, y: 0, connections: {D: A}}}', 'D: leads from A to itself'),
        (
            'markers: {1: {room: A, z: 0, x: 0, y: 0, connections: {D: B}}}',
            '1.z: unknown, exp',
        ),
        (
            'markers:\n  1: {room: A, x: 0, y: 0, connections: {D: B}}\n'
            '  1: {room: B, x: 0, y: 0, connections: {D: A}}\n',
            ":3: duplicate key '1', first given in line 2",
        ),
        (
            'markers:\n  1: {room: A, x: 0, y: 0, connections: {D: B}}\n'
            '  01: {room: B, x: 0, y: 0, connections: {D: A}}\n',
            ':3: markers.01: the id is given twice',
        ),
        ('markers: {1: &a {room: A, x: 0, y: 0, connections: {D: *a}}}', 'an alias'),
    ],
)
def test_wrong_registry_is_refused_in_one_line_that_names_the_file(tmp_path, text, reason):
    path = tmp_path / 'markers.yaml'
    path.write_text(text)
    with pytest.raises(FileError) as error:
        read_registry(path)
    assert str(error.value).startswith(str(path))
    assert reason in str(error.value)
    assert '\n' not in str(error.value)


def test_registry_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileError, match='No such file'):
        read_registry(tmp_path / 'none.yaml')
