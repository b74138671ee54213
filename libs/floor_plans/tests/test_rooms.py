"""A place: what is accepted, what is refused and in which words, and its graph."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import Place, PlaceError, read_place
from floor_plans.parameters import make_place

PLACES = Path(__file__).with_name('places')
SEVEN_ROOMS = read_place(PLACES / 'seven_rooms.yaml').place.rooms
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
