"""A place: what is accepted, what is refused and in which words, and its graph."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from floor_plans import Place, PlaceError, read_place
from floor_plans.parameters import make_place
from strict_files.files import FileError
from tests.seven_rooms import SEVEN_ROOMS

POSITIONS = {room: [float(index), 0.0] for index, room in enumerate(SEVEN_ROOMS)}


def seven() -> Place:
    return make_place(SEVEN_ROOMS, POSITIONS, 'E', ['E'])


def test_graph_queries() -> None:
    place = seven()
    assert place.doors['D5'] == ('C1', 'C2')
    assert place.reachable('R1') == set(SEVEN_ROOMS)


def test_a_closed_door_can_be_opened_again() -> None:
    closed = seven().with_door('D1', is_open=False)
    assert closed.closed == {'D1'}
    assert closed.with_door('D1', is_open=True) == seven()


def test_rooms_join_and_leave() -> None:
    grown = seven().with_room('R5', (1, 2), ['D8'])
    assert grown.reachable('R5') == {'R5'}
    joined = grown.with_room('C1', grown.positions['C1'], ['D8'])
    assert joined.reachable('R5') == {*SEVEN_ROOMS, 'R5'}
    assert joined.rooms['C1'] == ('D1', 'D2', 'D5', 'D6', 'D8')
    assert 'R5' not in joined.without_room('R5').rooms
    assert 'R1' in seven().without_room('R1').with_room('R1', (1, 1, 0), ['D1']).rooms


@pytest.mark.parametrize(
    ('edit', 'words'),
    [
        (lambda p: p.with_room('R1', (0, 0), ['D1']), 'exists already'),
        (lambda p: p.with_room('R9', (0, 0), []), 'no doors'),
        (lambda p: p.with_room('R9', (0, 0), ['D1']), 'already joins R1 and C1'),
        (lambda p: p.with_room('D1', (0, 0), ['D9']), 'name of a door'),
        (lambda p: p.with_room('R9', (0, float('nan')), ['D9']), 'expected [x, y]'),
        (lambda p: p.with_room('R 9', (0, 0), ['D9']), 'expected letters'),
        (lambda p: p.with_room('R9', (0, 0), ['D9', 'D9']), "duplicate door 'D9'"),
        (lambda p: p.with_room('R9', (0, 0), ['E']), 'name of a room'),
        (lambda p: p.without_room('R9'), 'no such room'),
        (lambda p: p.without_room('E'), 'charging station'),
        (lambda p: p.without_room('C1'), 'only way to R1, R2'),
        (lambda p: p.with_door('D9', is_open=True), 'no such door'),
    ],
)
def test_edits_that_cannot_be(edit: object, words: str) -> None:
    with pytest.raises(PlaceError, match=words.replace('[', r'\[').replace(']', r'\]')):
        edit(seven())  # type: ignore[operator]


def changed(**parts: object) -> tuple[object, ...]:
    given = {'rooms': SEVEN_ROOMS, 'positions': POSITIONS, 'start': 'E', 'stations': ['E'], **parts}
    return tuple(given.values())


@pytest.mark.parametrize(
    ('description', 'words'),
    [
        (changed(rooms={**SEVEN_ROOMS, 'E': ['D6', 'D9']}), "door 'D9' is in only one place, E"),
        (changed(rooms={**SEVEN_ROOMS, 'R1': ['D1', 'D5']}), 'is in 3 places'),
        (changed(rooms={**SEVEN_ROOMS, 'R1': ['D1', 'D1']}), "map.R1: duplicate door 'D1'"),
        (changed(rooms={**SEVEN_ROOMS, 'R1': []}), 'map.R1: expected a list of at least one door'),
        (changed(rooms={**SEVEN_ROOMS, 'R1': ['E']}), "door 'E' has the name of a room"),
        (changed(rooms={**SEVEN_ROOMS, 'R1': [1]}), 'quote it'),
        (changed(rooms={}), 'map: expected rooms'),
        (
            changed(positions={k: v for k, v in POSITIONS.items() if k != 'R3'}),
            "room_positions: no position for room 'R3'",
        ),
        (changed(positions={**POSITIONS, 'X': [1, 2]}), 'room_positions.X: no such room'),
        (changed(positions={**POSITIONS, 'R1': [1]}), 'room_positions.R1: expected'),
        (changed(positions={**POSITIONS, 'R1': ['1', '2']}), 'room_positions.R1: expected'),
        (changed(start='X'), "robot_room: no room 'X'"),
        (changed(stations=['E', 'X']), "recharge_rooms: no room 'X'"),
        (changed(stations=['E', 'E']), "recharge_rooms: duplicate room 'E'"),
        (
            changed(
                rooms={'A': ['D1'], 'B': ['D1'], 'C': ['D2'], 'D': ['D2']},
                positions={room: [0, 0] for room in 'ABCD'},
                start='A',
                stations=[],
            ),
            "map.C: cannot be reached from the start 'A'",
        ),
    ],
)
def test_descriptions_that_are_no_place(description: tuple[object, ...], words: str) -> None:
    with pytest.raises(PlaceError) as refusal:
        make_place(*description)
    assert words in str(refusal.value)
    assert '\n' not in str(refusal.value)


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
    path = Path(__file__).parents[2] / 'config' / f'{name}.yaml'
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
