"""A place's file: what is refused in it, with its line."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from floor_plans import read_place
from strict_files.files import FileError

GOOD = """\
/**:
  ros__parameters:
    map:
      A: [D1]
      B: [D1]
    room_positions: {A: [0.0, 1.0], B: [2.0, 3.0]}
    robot_room: A
    recharge_rooms: [B]
"""


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('B: [D1]', 'A: [D1]', ":5: duplicate key 'A', first given in line 4"),
        ('      B: [D1]', '      B: [D1, D2]', ":5: map.B: door 'D2' is in only one place"),
        ('robot_room: A', 'robot_room: C', ":7: robot_room: no room 'C'"),
        ('[2.0, 3.0]', '[2.0, x]', ':6: room_positions.B: expected [x, y]'),
        ('[2.0, 3.0]', f'[2.0, {"9" * 400}]', ':6: 9999999999'),
        ('    robot_room: A\n', '', "parameter 'robot_room' is missing"),
        ('robot_room', 'robot_rom', ':7: robot_rom: unknown parameter'),
        ('    robot_room: A', '    robot_room: A\n    dors:\n      D1: 1', ':9: dors.D1: unknown'),
        ('/**', '/other', "expected the top-level key '/**'"),
        ('ros__parameters', 'parameters', "expected 'ros__parameters:'"),
        ('B: [D1]', 'B: [D1', 'not valid YAML'),
        ('B: [D1]', 'B: &x [D1]\n      C: *x', ':6: not valid YAML: an alias'),
        ('    robot_room: A', '    map.A: [D1]', ":7: duplicate key 'map.A'"),
        (
            'recharge_rooms: [B]',
            'recharge_rooms: [B, A]',
            ":8: recharge_rooms: room 'A' has no station: expected [B] alone, or stations",
        ),
        (
            '    recharge_rooms: [B]',
            '    recharge_rooms: [B, A]\n    station: [2.0, 3.0, 0.0]',
            ":8: recharge_rooms: room 'A' has no station: expected [B] alone, or stations",
        ),
    ],
)
def test_errors_of_a_file_name_the_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / 'place.yaml'
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(FileError) as refusal:
        read_place(path)
    assert str(refusal.value).startswith(str(path))
    assert words in str(refusal.value)
    assert '\n' not in str(refusal.value)


def test_files_that_are_not_there_or_not_text(tmp_path: Path) -> None:
    with pytest.raises(FileError, match='No such file'):
        read_place(tmp_path / 'none.yaml')
    binary = tmp_path / 'binary.yaml'
    binary.write_bytes(b'\xff\xfe\x00')
    with pytest.raises(FileError, match='not UTF-8'):
        read_place(binary)


@pytest.mark.parametrize('name', ['seven_rooms', 'patrol_world', 'office'])
def test_the_places_that_come_along_are_places(name: str) -> None:
    path = Path(__file__).with_name('places') / f'{name}.yaml'
    place = read_place(path).place
    assert place.reachable(place.start) == set(place.rooms)


def problem_of(path: Path) -> str:
    """Return what is wrong with a place's file; empty when nothing is."""
    try:
        read_place(path)
    except FileError as error:
        return str(error)
    return ''


@settings(max_examples=60)
@given(st.text(max_size=200))
def test_any_text_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    path = tmp_path_factory.mktemp('fuzz') / 'place.yaml'
    path.write_text(GOOD.replace('[D1]', text, 1), encoding='utf-8', errors='surrogatepass')
    assert '\n' not in problem_of(path)
