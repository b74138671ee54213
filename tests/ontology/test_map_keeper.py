"""The ontology says of a place what the place says of itself, through every change of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armor_service.client import (
    ArmorClient,
    ArmorServiceCallError,
    Batch,
    InProcessTransport,
)
from armor_service.protocol import DirectiveRequest
from armor_service.service import ArmorService
from floor_plans import Place, PlaceError
from floor_plans.parameters import description_of, make_place
from libs.armor_service.tests.seven_rooms import IRI, ONTOLOGY, SEVEN_ROOMS
from surveillance_ontology.map_keeper import MapKeeper, Reports, RoomNote, Source, extended
from surveillance_ontology.map_ontology import MapOntology, closed_doors, shown_doors
from surveillance_ontology.robot_ontology import RobotOntology

ROOMS = [*SEVEN_ROOMS, 'N1', 'N2']
DOORS = [*sorted({door for doors in SEVEN_ROOMS.values() for door in doors}), 'X1', 'X2']


def seven() -> Place:
    positions = {room: [float(n), 0.0] for n, room in enumerate(SEVEN_ROOMS)}
    return make_place(SEVEN_ROOMS, positions, 'E', ['E'])


Edit = Callable[[Place], Place]
EDITS = st.one_of(
    st.builds(
        lambda door, is_open: lambda place: place.with_door(door, is_open=is_open),
        st.sampled_from(DOORS),
        st.booleans(),
    ),
    st.builds(
        lambda room, doors: lambda place: place.with_room(room, (0.0, 0.0, 0.0), doors),
        st.sampled_from(ROOMS),
        st.lists(st.sampled_from(DOORS), min_size=1, max_size=2, unique=True),
    ),
    st.builds(lambda room: lambda place: place.without_room(room), st.sampled_from(ROOMS)),
)


@settings(max_examples=25)
@given(st.lists(EDITS, max_size=8))
def test_connections_are_those_of_the_place_after_any_edits(edits: list[Edit]) -> None:
    service = ArmorService(warn=lambda _: None)
    client = ArmorClient('test', 'map', InProcessTransport(service))
    ontology = MapOntology(client)
    place = ontology.build(seven(), ONTOLOGY, IRI)
    RobotOntology(client).record_place('E', 100)
    for edit in edits:
        try:
            after = edit(place)
        except PlaceError:
            continue
        ontology.change(place, after)
        place = after
    assert client.query.ind_b2_class('LOCATION') == sorted(place.rooms)
    for room in place.rooms:
        doors = set(place.rooms[room]) - place.closed
        neighbours = {other for door in doors for other in place.doors[door]} - {room}
        assert client.query.objectprop_b2_ind('connectedTo', room) == sorted(neighbours)
    assert client.utils.sync_buffered_reasoner(), 'consistent'
    assert ontology.build(place, ONTOLOGY, IRI).closed == place.closed
    service.close()


@given(st.sets(st.sampled_from(sorted(seven().doors))))
@settings(max_examples=60)
def test_closed_doors_are_recognised_again(closed: set[str]) -> None:
    place = seven()
    for door in closed:
        place = place.with_door(door, is_open=False)
    shown = shown_doors(place)
    assert closed_doors(place, shown) == closed
    hidden = sum(len(doors) for doors in SEVEN_ROOMS.values()) - sum(map(len, shown.values()))
    assert hidden == len(closed), 'each closed door stays on one of its sides'


def test_a_map_grows_by_messages() -> None:
    first = extended(
        None,
        [
            RoomNote('A', (0, 0, 0), (('B', 'D1'),)),
            RoomNote('B', (1, 0, 0), (('A', 'D1'), ('C', 'D2'))),
        ],
        'A',
    )
    assert first.rooms == {'A': ('D1',), 'B': ('D1', 'D2')}
    second = extended(first, [RoomNote('C', (2, 0, 0), (('A', 'D3'),))], '')
    assert second.rooms['A'] == ('D1', 'D3'), 'the other side of a new door is entered as well'
    assert second.start == 'A'
    moved = extended(second, [RoomNote('C', (5, 0, 0), (('A', 'D3'),))], 'C')
    assert (moved.positions['C'], moved.start) == ((5, 0, 0), 'C')
    for notes, robot_room, words in (
        ([], '', 'no rooms'),
        ([RoomNote('A', (0, 0, 0), (('A', 'D1'),))], '', 'connected to itself'),
        ([RoomNote('A', (0, 0, 0), ())], '', 'no doors'),
        ([RoomNote('A', (0, 0, 0), (('B', 'D1'),))] * 2, '', 'described twice'),
        ([RoomNote('A', (0, 0, 0), (('B', 'D1'),))], 'Z', "no room 'Z'"),
    ):
        with pytest.raises(PlaceError, match=words):
            extended(None, notes, robot_room)


class Flaky(InProcessTransport):
    """A transport to a server that is away for the first calls."""

    def __init__(self, service: ArmorService, away: int) -> None:
        super().__init__(service)
        self.away = away

    def call(self, request: DirectiveRequest | Batch) -> Any:
        self._reach()
        return super().call(request)

    def _reach(self) -> None:
        if self.away > 0:
            self.away -= 1
            raise ArmorServiceCallError('no server')


class Replaced(InProcessTransport):
    """A transport whose server is killed and started anew behind each LOAD, so many times."""

    def __init__(self, times: int) -> None:
        super().__init__(ArmorService(warn=lambda _: None))
        self.times = times

    def call(self, request: DirectiveRequest | Batch) -> Any:
        answer = super().call(request)
        is_load = isinstance(request, DirectiveRequest) and request.command == 'LOAD'
        if is_load and self.times > 0:
            self.times -= 1
            super().__init__(ArmorService(warn=lambda _: None))
        return answer


def keeper_of(
    ontology: MapOntology, path: str, built: list[int]
) -> tuple[MapKeeper, dict[str, list[str]]]:
    """Return a keeper of the seven rooms, and what it says."""
    said: dict[str, list[str]] = {'info': [], 'warn': [], 'refused': [], 'failed': []}
    reports = Reports(**{kind: lines.append for kind, lines in said.items()})
    source = Source(path, IRI)
    return MapKeeper(
        ontology, source, seven(), lambda: 100, lambda: False, reports, lambda: built.append(1)
    ), said


def test_a_server_that_is_replaced_behind_the_load_is_loaded_again() -> None:
    client = ArmorClient('test', 'map', Replaced(2))
    built: list[int] = []
    keeper, said = keeper_of(MapOntology(client), ONTOLOGY, built)
    keeper.ensure_built()
    assert (keeper.is_built, built, said['failed']) == (True, [1], [])
    assert len(said['warn']) == 2
    assert "unknown reference 'map'" in said['warn'][0]
    for times, warned, failed in ((9, 9, 0), (1000, 9, 1)):
        replaced = MapOntology(ArmorClient('test', 'map', Replaced(times)))
        keeper, said = keeper_of(replaced, ONTOLOGY, built)
        keeper.ensure_built()
        assert (len(said['warn']), len(said['failed'])) == (warned, failed), 'it ends after ten'
        assert keeper.is_built is not bool(failed)
        assert all('unknown reference' in line for line in said['failed'])


def test_places_may_count_as_visited_when_the_map_was_first_built() -> None:
    """With `urgent_at_start` off nothing is URGENT at once, also after a server was lost."""
    client = ArmorClient('test', 'map', InProcessTransport(ArmorService(warn=lambda _: None)))
    ontology, now = MapOntology(client), [100]
    for at_start, visited in ((False, dict.fromkeys(SEVEN_ROOMS, 100.0)), (True, {})):
        now[0] = 100
        client.utils.drop_ref()
        keeper = MapKeeper(
            ontology,
            Source(ONTOLOGY, IRI, urgent_at_start=at_start),
            seven(),
            lambda: now[0],
            lambda: False,
            Reports(*[lambda _: None] * 4),
            lambda: None,
        )
        for now[0] in (100, 150):
            keeper.ensure_built()
            RobotOntology(client).record_place('E', now[0])
            found = RobotOntology(client).snapshot(now[0] + 1.0, ('URGENT',), threshold=1000.0)
            assert found.visited_at == visited
            assert all(bool(each) is at_start for each in found.classes.values())
            client.utils.drop_ref()


def test_the_keeper_goes_on_until_the_server_is_there(tmp_path: Path) -> None:
    service = ArmorService(warn=lambda _: None)
    transport = Flaky(service, away=3)
    client = ArmorClient('test', 'map', transport)
    ontology = MapOntology(client)
    built: list[int] = []
    kept, said = keeper_of(ontology, ONTOLOGY, built)
    kept.ensure_built()
    assert (kept.is_built, built, len(said['warn'])) == (True, [1], 1)
    kept.ensure_built()
    assert built == [1], 'it is there'
    assert kept.edit(lambda place: place.with_door('D1', is_open=False)) == ''
    client.utils.drop_ref()
    kept.ensure_built()
    assert client.query.objectprop_b2_ind('isIn', 'Robot1') == [], 'who knows it tells it'
    RobotOntology(client).record_place('C1', 5)
    assert client.query.objectprop_b2_ind('canReach', 'Robot1') == ['C2', 'E', 'R2']
    transport.away = 100
    assert kept.edit(lambda place: place.with_door('D1', is_open=True)).startswith(
        'the ontology was not changed'
    )
    assert kept.place is not None
    assert 'D1' in kept.place.closed, 'what the ontology does not have is not remembered either'
    transport.away = 0
    kept.extend([RoomNote('R9', (0, 0, 0), (('R9', 'D9'),))], '')
    assert 'connected to itself' in said['refused'][0]
    client.utils.drop_ref()
    missing, said = keeper_of(ontology, str(tmp_path / 'none.owl'), built)
    missing.ensure_built()
    assert said['failed'][0].startswith('cannot build the map: path ')
    service.close()


@pytest.mark.parametrize(
    'content',
    [
        '',
        '[]',
        '{"described": null}',
        '[' * 100_000,
        '{"described": %s, "edited": {"map": 3}}',
        '{"described": %s, "edited": {"map": {"A": ["D"]}, "room_positions": {"A": [1'
        + '0' * 400
        + ', 0]}, "robot_room": "A"}}',
    ],
)
def test_a_state_file_that_cannot_be_used_is_told_and_left(tmp_path: Path, content: str) -> None:
    path = tmp_path / 'state.json'
    path.write_text(content.replace('%s', json.dumps(description_of(seven()))))
    said: list[str] = []
    keeper = MapKeeper(
        MapOntology(ArmorClient('test', 'map', Replaced(0))),
        Source(ONTOLOGY, IRI, state_file=str(path)),
        seven(),
        lambda: 100,
        lambda: False,
        Reports(said.append, said.append, said.append, said.append),
        lambda: None,
    )
    assert keeper.place == seven()
    assert len(said) == 1
    assert said[0].startswith(f'parameter state_file: {path}: ')


class Dies(InProcessTransport):
    """A transport whose client is killed when it sends a change."""

    dies = ''

    def call(self, request: DirectiveRequest | Batch) -> Any:
        if not isinstance(request, DirectiveRequest) and any(self.dies in r.args for r in request):
            raise KeyboardInterrupt
        return super().call(request)


def kept(service: ArmorService, path: str, place: Place | None) -> tuple[MapKeeper, list[str]]:
    """Return a keeper with a state file, and what it says."""
    said: list[str] = []
    source = Source(ONTOLOGY, IRI, state_file=path)
    client = ArmorClient('test', 'map', Dies(service))
    reports = Reports(lambda _: None, said.append, said.append, said.append)
    keeper = MapKeeper(
        MapOntology(client), source, place, lambda: 100, lambda: False, reports, lambda: None
    )
    keeper.ensure_built()
    return keeper, said


def test_a_builder_killed_within_an_edit_makes_up_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = ArmorService(warn=lambda _: None)
    path = str(tmp_path / 'state.json')
    edits: tuple[tuple[str, Callable[[Place], Place]], ...] = (
        ('R5', lambda place: place.with_room('R5', (1, 2, 0), ['D8'])),
        ('R1', lambda place: place.without_room('R1')),
    )
    for name, edit in edits:
        keeper, _ = kept(service, path, seven())
        monkeypatch.setattr(Dies, 'dies', name)
        with pytest.raises(KeyboardInterrupt):
            keeper.edit(edit)
        monkeypatch.undo()
    keeper, said = kept(service, path, seven())
    query = ArmorClient('test', 'map', InProcessTransport(service)).query
    assert keeper.place is not None
    assert sorted(query.ind_b2_class('LOCATION')) == sorted(keeper.place.rooms)
    assert ('R5' in keeper.place.rooms, 'R1' in keeper.place.rooms, said) == (True, False, [])
    other = make_place(
        seven().rooms, {room: [9.0, 9.0] for room in seven().rooms}, seven().start, []
    )
    keeper, said = kept(service, path, other)
    assert sorted(query.ind_b2_class('LOCATION')) == sorted(other.rooms), 'R5 leads nowhere'
    assert len(said) == 1
    assert 'of another place' in said[0]
    service.close()


def test_rooms_that_another_place_had_leave_an_ontology_that_was_kept(tmp_path: Path) -> None:
    service = ArmorService(warn=lambda _: None)
    path = str(tmp_path / 'state.json')
    for name in ('R1', 'Kitchen', 'R1'):
        rooms = {name if room == 'R1' else room: doors for room, doors in seven().rooms.items()}
        place = make_place(rooms, dict.fromkeys(rooms, (1.0, 2.0)), seven().start, [])
        _, said = kept(service, path, place)
        query = ArmorClient('test', 'map', InProcessTransport(service)).query
        assert sorted(query.ind_b2_class('LOCATION')) == sorted(rooms)
        assert said == []
    service.close()


def test_a_map_that_was_sent_is_known_to_the_next_process(tmp_path: Path) -> None:
    service = ArmorService(warn=lambda _: None)
    path = str(tmp_path / 'state.json')
    keeper, _ = kept(service, path, None)
    keeper.extend([RoomNote('A', (1, 0, 0), (('B', 'D'),))], 'A')
    keeper.extend([RoomNote('B', (2, 0, 0), (('A', 'D'),))], '')
    again, said = kept(service, path, None)
    assert (again.place, again.is_built, said) == (keeper.place, True, [])
    service.close()


def test_a_map_that_is_sent_again_changes_nothing_that_was_edited(tmp_path: Path) -> None:
    service = ArmorService(warn=lambda _: None)
    path = str(tmp_path / 'state.json')
    sent = [
        RoomNote('E', (0, 0, 0), (('A', 'D1'), ('B', 'D2'), ('C', 'D3'))),
        RoomNote('A', (1, 0, 0), (('E', 'D1'),)),
        RoomNote('B', (2, 0, 0), (('E', 'D2'),)),
        RoomNote('C', (3, 0, 0), (('E', 'D3'),)),
    ]
    keeper, said = kept(service, path, None)
    keeper.extend(sent, 'A')
    changes: tuple[Callable[[Place], Place], ...] = (
        lambda place: place.without_room('A'),
        lambda place: place.without_room('B'),
        lambda place: place.with_room('B', (7, 7, 0), ['D2']),
    )
    for change in changes:
        assert keeper.edit(change) == ''
    for again in (keeper, kept(service, path, None)[0]):
        again.extend(sent, 'A')
        assert again.place is not None
        assert sorted(again.place.rooms) == ['B', 'C', 'E']
        assert again.place.positions['B'] == (7, 7, 0)
    again.extend([RoomNote('F', (4, 0, 0), (('E', 'D4'),))], 'A')
    assert 'F' in again.place.rooms
    assert again.edit(lambda place: place.with_room('A', (1, 0, 0), ['D1'])) == ''
    assert 'A' in again.place.rooms
    assert said == []
    service.close()


@pytest.mark.parametrize('path', ['n' * 300, '~nobody-of-this-name/state.json'])
def test_a_state_file_that_no_file_can_be_is_told(path: str) -> None:
    service = ArmorService(warn=lambda _: None)
    keeper, said = kept(service, path, seven())
    assert keeper.place == seven()
    assert all(line.startswith('parameter state_file: ') for line in said)
    assert keeper.edit(lambda place: place.with_room('R5', (1, 2, 0), ['D8'])) == ''
    assert said[-1].endswith('these rooms are lost at a restart')
    service.close()
