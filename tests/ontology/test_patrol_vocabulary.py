"""What a place becomes in the ontology: its doors, what is asked of it, in which pieces."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from armor_service.client import (
    ArmorClient,
    ArmorServiceInternalError,
    Batch,
    InProcessTransport,
)
from armor_service.protocol import DirectiveRequest, DirectiveResponse, ListResponse
from armor_service.service import ArmorService
from floor_plans import Place, PlaceError, read_place
from libs.armor_service.tests.seven_rooms import IRI, ONTOLOGY
from surveillance_ontology import patrol_directives
from surveillance_ontology.map_keeper import MapKeeper, Reports, RoomNote, Source
from surveillance_ontology.map_ontology import MapOntology, closed_doors, shown_doors
from surveillance_ontology.patrol_vocabulary import (
    OntologyNotReadyError,
    checked_names,
    facts_of,
    never_visited,
)
from surveillance_ontology.robot_ontology import RobotOntology

SEVEN = read_place(Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml').place


def place_of(rooms: dict[str, list[str]], closed: tuple[str, ...] = ()) -> Place:
    doors = {room: tuple(found) for room, found in rooms.items()}
    place = Place(doors, {room: (float(n), 0.0, 0.0) for n, room in enumerate(rooms)}, 'A')
    for door in closed:
        place = place.with_door(door, is_open=False)
    return place


class Listening(InProcessTransport):
    """Keeps what is sent, in its batches; may leave out the last answers of each."""

    def __init__(self) -> None:
        self.service = ArmorService(warn=lambda _: None)
        super().__init__(self.service)
        self.batches: list[list[str]] = []
        self.left_out = 0

    def call(self, request: DirectiveRequest | Batch) -> Any:
        answer = super().call(request)
        if isinstance(request, DirectiveRequest):
            return answer
        self.batches.append([' '.join((each.words, *each.args)) for each in request])
        if not self.left_out:
            return answer
        assert isinstance(answer, ListResponse)
        kept = list(answer.responses)[: -self.left_out]
        if kept:
            kept[-1] = DirectiveResponse(error_description='it is tired')
        return ListResponse(True, True, kept)

    def lines(self) -> list[str]:
        """Return what was sent since this was asked last."""
        sent = [line for batch in self.batches for line in batch]
        self.batches.clear()
        return sent


@pytest.fixture
def transport() -> Iterator[Listening]:
    transport = Listening()
    yield transport
    transport.service.close()


class Halves(NamedTuple):
    """Both halves of one ontology."""

    map: MapOntology
    robot: RobotOntology


def ontology_at(transport: Listening, **more: Any) -> Halves:
    client = ArmorClient('test', 'map', transport)
    return Halves(MapOntology(client, **more), RobotOntology(client, **more))


def test_neither_a_room_nor_a_door_may_have_the_robots_name() -> None:
    fine = place_of({'A': ['D1'], 'B': ['D1']})
    assert checked_names(fine) is fine
    for rooms, robot in (
        ({'A': ['D1'], 'Robot1': ['D1']}, 'Robot1'),
        ({'A': ['Robot1'], 'B': ['Robot1']}, 'Robot1'),
        ({'A': ['D1'], 'tb2': ['D1']}, 'tb2'),
    ):
        with pytest.raises(PlaceError, match=f"'{robot}' is the robot's name: expected another"):
            checked_names(place_of(rooms), robot)
    assert checked_names(place_of({'A': ['D1'], 'tb2': ['D1']}))


def test_a_closed_door_is_left_out_where_most_doors_are() -> None:
    rooms = {'A': ['D1', 'D2'], 'B': ['D1', 'D2', 'D3'], 'C': ['D3', 'D4']}
    assert shown_doors(place_of(rooms)) == {room: tuple(doors) for room, doors in rooms.items()}
    assert shown_doors(place_of(rooms, ('D1',))) == {
        'A': ('D1', 'D2'),
        'B': ('D2', 'D3'),
        'C': ('D3', 'D4'),
    }
    # Of two with as many doors the one whose name is later; a door into nowhere stays.
    assert shown_doors(place_of(rooms, ('D1', 'D3', 'D4'))) == {
        'A': ('D1', 'D2'),
        'B': ('D2', 'D3'),
        'C': ('D4',),
    }


def test_what_an_ontology_does_not_tell_of_a_door_stays_as_it_was() -> None:
    place = place_of({'A': ['D1'], 'B': ['D1', 'D2'], 'C': ['D2'], 'E': ['D3']}, ('D2',))
    everything = {'A': ['D1'], 'B': ['D1', 'D2'], 'C': ['D2'], 'E': ['D3']}
    assert closed_doors(place, everything) == frozenset(), 'both sides have it: it is open'
    assert closed_doors(place, {**everything, 'A': []}) == {'D1'}
    assert closed_doors(place, {**everything, 'C': []}) == {'D2'}
    assert closed_doors(place, {**everything, 'B': ['D1'], 'C': []}) == {'D2'}, 'neither side'
    assert closed_doors(place, {'A': ['D1'], 'B': ['D1']}) == {'D2'}, 'C is not told of'
    assert closed_doors(place, {}) == {'D2'}
    assert closed_doors(place, {**everything, 'E': []}) == frozenset(), 'it leads into one room'


def test_places_classes_and_doors_are_those_of_the_map(transport: Listening) -> None:
    ontology = ontology_at(transport)
    assert not ontology.map.is_loaded()
    ontology.map.build(SEVEN, ONTOLOGY, IRI)
    assert ontology.map.is_loaded()
    assert ontology.robot.reference == 'map'
    assert ontology.map.places() == tuple(sorted(SEVEN.rooms))
    assert ontology.robot.place_classes() == ('LOCATION', 'CORRIDOR', 'ROOM', 'URGENT')
    assert ontology.robot.robot_places() == ()
    ontology.robot.record_place('E', 7)
    assert ontology.robot.robot_places() == ('E',)
    assert ontology.robot.reachable() == {'C1', 'C2'}
    ontology.map.forget()
    assert not ontology.map.is_loaded()


def test_a_subscription_follows_one_robot_or_those_of_a_fleet(transport: Listening) -> None:
    assert ontology_at(transport).robot.robot_place_facts == 'isIn(Robot1, ?)'
    assert ontology_at(transport, robot='tb2').robot.robot_place_facts == 'isIn(tb2, ?)'
    assert ontology_at(transport, fleet=('a', 'b')).robot.robot_place_facts == 'isIn(?, ?)'
    assert facts_of('R1') == (
        'URGENT(R1)',
        'ROOM(R1)',
        'CORRIDOR(R1)',
        'LOCATION(R1)',
        'isIn(?, R1)',
        'canReach(?, R1)',
        'visitedAt(R1, ?)',
        'covered(R1, ?)',
        'hasDoor(R1, ?)',
        'connectedTo(R1, ?)',
    )


def test_the_time_is_told_to_each_robot_when_the_map_is_new(transport: Listening) -> None:
    ontology = ontology_at(transport, robot='a', fleet=('a', 'b'))
    ontology.map.build(SEVEN, ONTOLOGY, IRI, now=90)
    lines = transport.lines()
    told = [line for line in lines if line.startswith('SET DATAPROP IND now')]
    assert told == ['SET DATAPROP IND now a LONG 90', 'SET DATAPROP IND now b LONG 90']
    assert lines.count('REMOVE IND Robot1') == 1, 'the one of the file is none of them'
    ontology.map.build(SEVEN, ONTOLOGY, IRI, now=95, gone=('R9', 'D9'))
    lines = transport.lines()
    assert not any('SET DATAPROP IND' in line for line in lines), 'what it knows stays'
    assert [line for line in lines if 'REMOVE IND' in line] == [
        'REMOVE IND D9',
        'REMOVE IND R9',
        'REMOVE IND Robot1',
    ]
    alone = ontology_at(transport)
    alone.map.forget()
    alone.map.build(SEVEN, ONTOLOGY, IRI, first_visit=12)
    lines = transport.lines()
    assert not any('REMOVE' in line or ' now ' in line for line in lines)
    assert lines.count('SET DATAPROP IND visitedAt R1 LONG 12') == 1


def test_a_change_tells_what_differs_and_no_more(transport: Listening) -> None:
    before = place_of({'A': ['D1', 'D2'], 'B': ['D1'], 'C': ['D2']})
    ontology = ontology_at(transport)
    ontology.map.build(before, ONTOLOGY, IRI)
    transport.lines()
    closed = before.with_door('D1', is_open=False)
    ontology.map.change(before, closed)
    assert transport.lines() == ['REMOVE OBJECTPROP IND hasDoor A D1', 'REASON']
    grown = closed.with_room('E', (4.0, 0.0, 0.0), ['D3'])
    ontology.map.change(closed, grown, 33)
    assert transport.lines() == [
        'ADD OBJECTPROP IND hasDoor E D3',
        'SET DATAPROP IND visitedAt E LONG 33',
        'REASON',
        'DISJOINT IND CLASS ROOM',
        'DISJOINT IND CLASS DOOR',
        'REASON',
    ]
    joined = grown.with_room('C', (2.0, 0.0, 0.0), ['D3'])
    ontology.map.change(grown, joined)
    assert transport.lines() == ['ADD OBJECTPROP IND hasDoor C D3', 'REASON']
    ontology.map.change(joined, joined.with_room('E', (4.0, 0.0, 0.0), ['D4']))
    assert transport.lines() == [
        'ADD OBJECTPROP IND hasDoor E D4',
        'REASON',
        'DISJOINT IND CLASS DOOR',
        'REASON',
    ]
    # D4 was in that room alone, D3 has its other side still.
    ontology.map.change(joined.with_room('E', (4.0, 0.0, 0.0), ['D4']), joined.without_room('E'))
    assert transport.lines() == ['REMOVE IND E', 'REMOVE IND D4', 'REASON']


def test_a_large_map_goes_in_pieces_and_a_snapshot_in_one(
    transport: Listening, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(patrol_directives, 'CHUNK', 4)
    ontology = ontology_at(transport)
    ontology.map.build(SEVEN, ONTOLOGY, IRI)
    sizes = [len(batch) for batch in transport.batches]
    assert max(sizes) == 4
    assert sum(sizes) > 30
    assert ontology.map.places() == tuple(sorted(SEVEN.rooms))
    ontology.robot.record_place('E', 1)
    ontology.robot.snapshot(5.0, ('URGENT',))
    assert max(map(len, transport.batches)) > 4


@pytest.mark.parametrize(
    ('left_out', 'text'),
    [
        (1, '2 answers to 3 directives: it is tired'),
        (3, '0 answers to 3 directives: no reason given'),
    ],
)
def test_a_server_that_answers_too_little_is_told(
    transport: Listening, left_out: int, text: str
) -> None:
    ontology = ontology_at(transport)
    ontology.map.build(SEVEN, ONTOLOGY, IRI)
    transport.left_out = left_out
    with pytest.raises(ArmorServiceInternalError, match=text):
        ontology.robot.record_place('E', 1)


def test_of_several_times_of_a_visit_the_latest_counts(transport: Listening) -> None:
    ontology = ontology_at(transport)
    ontology.map.build(SEVEN, ONTOLOGY, IRI)
    ontology.robot.record_place('E', 1)
    armor = ArmorClient('other', 'map', transport)
    for at in (40, 60, 50):
        armor.manipulation.add_dataprop_to_ind('seenAt', 'Robot1', 'LONG', str(at))
    assert ontology.robot.snapshot(70.0, ()).seen_at == 60
    armor.manipulation.add_dataprop_to_ind('seenAt', 'Robot1', 'STRING', 'noon')
    with pytest.raises(OntologyNotReadyError, match=r'seenAt of Robot1 is .*: expected a whole'):
        ontology.robot.snapshot(70.0, ())


def test_a_place_that_nobody_visited_is_urgent_by_any_clock() -> None:
    assert never_visited(1_700_000_000) == 0
    assert never_visited(10**9 + 1) == 0
    assert never_visited(10**9) == -1
    assert never_visited(0) == -(10**9) - 1


@pytest.mark.parametrize('first_visit', [0, never_visited(5)])
def test_a_time_that_stands_for_no_visit_is_none(transport: Listening, first_visit: int) -> None:
    ontology = ontology_at(transport)
    ontology.map.build(SEVEN, ONTOLOGY, IRI, first_visit)
    ontology.robot.record_place('E', 1)
    assert ontology.robot.snapshot(5.0, (), visits={'R1': 1.0}).visited_at == {'R1': 1.0}


def test_a_place_without_the_robot_is_waited_for(transport: Listening) -> None:
    ontology = ontology_at(transport)
    ontology.map.build(SEVEN, ONTOLOGY, IRI)
    with pytest.raises(OntologyNotReadyError, match=r'^ontology map has Robot1 in no place$'):
        ontology.robot.snapshot(5.0, ())
    ontology.robot.record_place('E', 2_500_000_000)
    assert ontology.robot.snapshot(5.0, (), not_before=2_500_000_000).seen_at == 2_500_000_000
    with pytest.raises(OntologyNotReadyError, match=r'since 2\.5 s$'):
        ontology.robot.snapshot(5.0, (), not_before=2_500_000_001)


def keeper_at(transport: Listening, place: Place | None) -> tuple[MapKeeper, list[str]]:
    said: list[str] = []
    reports = Reports(*[said.append] * 4)
    return MapKeeper(
        ontology_at(transport).map,
        Source(ONTOLOGY, IRI),
        place,
        lambda: 100,
        lambda: False,
        reports,
        lambda: said.append('built'),
    ), said


def test_a_keeper_says_what_it_built_and_what_cannot_be_edited(transport: Listening) -> None:
    keeper, said = keeper_at(transport, None)
    keeper.ensure_built()
    assert (keeper.is_built, said) == (False, [])
    assert keeper.edit(lambda place: place) == 'there is no map yet'
    keeper.extend(
        [
            RoomNote('A', (0.0, 0.0, 0.0), (('B', 'D1'),)),
            RoomNote('B', (1.0, 0.0, 0.0), (('A', 'D1'), ('C', 'D2'))),
            RoomNote('C', (2.0, 0.0, 0.0), (('B', 'D2'),)),
        ],
        'A',
    )
    assert said == ['the map is built: 3 rooms, 2 doors', 'built']
    ontology_at(transport).robot.record_place('C', 1)

    def without(name: str) -> str:
        return keeper.edit(lambda place: keeper.without_room(place, name))

    assert without('C') == 'map.C: the robot is in it, it cannot be removed'
    assert without('Z').startswith('map.Z: ')
    assert keeper.place is not None
    assert sorted(keeper.place.rooms) == ['A', 'B', 'C']
    ontology_at(transport).robot.record_place('B', 2)
    assert without('C') == ''
    assert ontology_at(transport).map.places() == ('A', 'B')
    assert said[2:] == []


def test_a_contradiction_of_the_map_is_mended_once(transport: Listening) -> None:
    keeper, said = keeper_at(transport, SEVEN)
    keeper.ensure_built()
    armor = ArmorClient('other', 'map', transport)
    armor.manipulation.add_ind_to_class('R4', 'DOOR')
    keeper.end_contradiction()
    assert said[2].startswith('the ontology contradicts itself and is built again: ')
    assert len(said) == 3
    assert armor.utils.sync_buffered_reasoner()
    keeper.end_contradiction()
    assert len(said) == 3
    armor.utils.drop_ref()
    keeper.end_contradiction()
    assert len(said) == 3, 'who dropped it announces that'
