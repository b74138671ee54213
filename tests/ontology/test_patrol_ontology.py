"""What robot and ontology say to each other, against the project's own server in this process."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from armor_service.client import (
    ArmorClient,
    ArmorServiceInternalError,
    InProcessTransport,
)
from armor_service.service import ArmorService
from floor_plans import read_place
from libs.armor_service.tests.seven_rooms import IRI, ONTOLOGY
from surveillance_ontology.map_ontology import MapOntology
from surveillance_ontology.patrol_vocabulary import OntologyNotReadyError
from surveillance_ontology.robot_ontology import RobotOntology

PLACE = read_place(Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml').place
RULES = ('URGENT', 'CORRIDOR', 'ROOM')


class Counting(InProcessTransport):
    """Counts what goes to the server and comes back."""

    trips = 0

    def call(self, request):  # type: ignore[no-untyped-def]
        self.trips += 1
        return super().call(request)


@pytest.fixture
def transport() -> Iterator[Counting]:
    service = ArmorService(warn=lambda _: None)
    yield Counting(service)
    service.close()


@pytest.fixture
def armor(transport: Counting) -> ArmorClient:
    return ArmorClient('test', 'map', transport)


@pytest.fixture
def ontology(armor: ArmorClient) -> RobotOntology:
    MapOntology(armor).build(PLACE, ONTOLOGY, IRI, now=100)
    ontology = RobotOntology(armor)
    ontology.record_place('E', 100)
    RobotOntology(armor).snapshot(100.0, (), threshold=30.0)  # by somebody else
    return ontology


def tell_visits(transport: Counting, visits: dict[str, float]) -> None:
    """Tell of visits as somebody else does."""
    armor = ArmorClient('visitor', 'map', transport)
    for place, at in visits.items():
        armor.call('SET', 'DATAPROP', 'IND', ['visitedAt', place, 'LONG', str(int(at))])
    armor.utils.sync_buffered_reasoner()


def test_the_classes_of_places_are_those_below_location(ontology: RobotOntology) -> None:
    assert set(ontology.place_classes()) == {'LOCATION', 'ROOM', 'CORRIDOR', 'URGENT'}


def test_a_snapshot_is_what_the_ontology_infers(ontology: RobotOntology) -> None:
    found = ontology.snapshot(110.7, RULES)
    assert (found.place, found.seen_at, found.reachable) == ('E', 100, ('C1', 'C2'))
    assert found.connections['C1'] == ('C2', 'E', 'R1', 'R2')
    assert found.classes['C1'] == {'URGENT', 'CORRIDOR', 'ROOM'}
    assert found.classes['R1'] == {'URGENT', 'ROOM'}
    assert found.visited_at == {}, 'nobody has visited anything'


@pytest.mark.parametrize(('now', 'urgent'), [(130.0, False), (131.0, True)])
def test_places_become_urgent_beyond_the_threshold(
    ontology: RobotOntology, transport: Counting, now: float, urgent: bool
) -> None:
    tell_visits(transport, {'R1': 100.0})
    assert ('URGENT' in ontology.snapshot(now, RULES).classes['R1']) is urgent


def test_each_verb_is_one_round_trip(ontology: RobotOntology, transport: Counting) -> None:
    ontology.snapshot(110.0, RULES)
    before = transport.trips
    ontology.record_place('C1', 200)
    ontology.snapshot(120.0, RULES, visits={'C1': 120.0}, not_before=200)
    ontology.snapshot(121.0, RULES, threshold=20.0)
    assert transport.trips - before == 3


def test_the_robot_is_in_one_place_whoever_tells_it(transport: Counting) -> None:
    # Two clients, an ontology that is built again in between, and foreign assertions.
    first, second = (RobotOntology(ArmorClient(name, 'map', transport)) for name in ('one', 'two'))
    armor = ArmorClient('foreign', 'map', transport)
    MapOntology(ArmorClient('one', 'map', transport)).build(PLACE, ONTOLOGY, IRI, now=100)
    for order in itertools.permutations(('build', 'first', 'second', 'foreign')):
        for step in order:
            match step:
                case 'build':
                    MapOntology(ArmorClient('one', 'map', transport)).build(PLACE, ONTOLOGY, IRI)
                case 'first':
                    first.record_place('E', 1)
                case 'second':
                    second.record_place('C1', 2)
                case 'foreign':
                    armor.manipulation.add_objectprop_to_ind('isIn', 'Robot1', 'R4')
        second.record_place('C2', 3)
        assert second.robot_places() == ('C2',)
        assert second.snapshot(5.0, RULES).place == 'C2'


def test_a_server_that_comes_back_empty_during_a_leg_never_has_two_places(
    ontology: RobotOntology, transport: Counting, armor: ArmorClient
) -> None:
    """The defect: the builder entered the start, the behaviour its arrival, for good."""
    tell_visits(transport, {'E': 110.0})
    MapOntology(armor).forget()
    builder = MapOntology(ArmorClient('builder', 'map', transport))
    builder.build(PLACE, ONTOLOGY, IRI, now=115)
    with pytest.raises(OntologyNotReadyError, match='has Robot1 in no place'):
        ontology.snapshot(116.0, RULES, not_before=116)
    ontology.record_place('C1', 116)
    builder.build(PLACE, ONTOLOGY, IRI, now=117)
    found = ontology.snapshot(118.0, RULES, visits={'E': 110.0, 'C1': 116.0}, not_before=116)
    assert found.place == 'C1'
    assert found.visited_at == {'E': 110.0, 'C1': 116.0}, 'no visit is invented'
    assert armor.utils.sync_buffered_reasoner(), 'consistent'


def test_visits_that_the_ontology_forgot_are_told_and_later_ones_are_left(
    ontology: RobotOntology, transport: Counting, armor: ArmorClient
) -> None:
    visits = {'E': 105.0, 'C1': 109.9, 'R9': 3.0}
    ontology.snapshot(110.0, RULES, visits=visits)
    tell_visits(transport, {'E': 111.0})
    found = ontology.snapshot(112.0, RULES, visits=visits)
    assert found.visited_at == {'E': 111.0, 'C1': 109.0}
    MapOntology(armor).forget()
    MapOntology(armor).build(PLACE, ONTOLOGY, IRI)
    ontology.record_place('E', 112)
    found = ontology.snapshot(113.0, RULES, visits=visits)
    assert found.visited_at == {'E': 105.0, 'C1': 109.0}
    assert 'R9' not in found.connections, 'a place that is not on the map does not come to be'


def test_a_later_visit_of_somebody_else_stays(ontology: RobotOntology, transport: Counting) -> None:
    tell_visits(transport, {'E': 111.0})
    fresh = RobotOntology(ArmorClient('fresh', 'map', transport))
    found = fresh.snapshot(112.0, RULES, visits={'E': 105.0, 'C1': 106.0})
    assert found.visited_at == {'E': 111.0, 'C1': 106.0}, 'at the first snapshot'
    tell_visits(transport, {'R1': 118.0})
    found = fresh.snapshot(120.0, RULES, visits={'R1': 115.0, 'E': 120.0})
    assert found.visited_at == {'E': 120.0, 'C1': 106.0, 'R1': 118.0}, 'between two snapshots'


def test_visits_that_lie_ahead_of_a_clock_that_was_set_back_are_told_anew(
    ontology: RobotOntology,
) -> None:
    ontology.snapshot(110.0, RULES, visits={'E': 105.0, 'C1': 109.0})
    found = ontology.snapshot(60.0, RULES, visits={'E': 55.0, 'C1': 59.0})
    assert found.visited_at == {'E': 55.0, 'C1': 59.0}


def test_a_room_that_was_taken_away_does_not_come_back_by_a_visit(
    ontology: RobotOntology, armor: ArmorClient
) -> None:
    ontology.snapshot(110.0, RULES)
    MapOntology(armor).change(PLACE, PLACE.without_room('R4'))
    found = ontology.snapshot(120.0, RULES, visits={'R4': 115.0, 'E': 120.0})
    assert 'R4' not in found.connections
    assert 'R4' not in MapOntology(armor).places()


def test_a_snapshot_waits_for_the_place_that_is_on_its_way(ontology: RobotOntology) -> None:
    ontology.snapshot(110.0, RULES)
    with pytest.raises(OntologyNotReadyError, match='nobody told it where'):
        ontology.snapshot(110.0, RULES, not_before=500_000_000)
    late = threading.Timer(0.1, lambda: ontology.record_place('C1', 500_000_000))
    late.start()
    found = ontology.snapshot(111.0, RULES, not_before=500_000_000, patience=10.0)
    late.join()
    assert found.place == 'C1'
    ended = threading.Event()
    ended.set()
    with pytest.raises(OntologyNotReadyError):
        ontology.snapshot(111.0, RULES, not_before=10**18, patience=10.0, interrupt=ended)


def test_what_clashes_is_named(ontology: RobotOntology, armor: ArmorClient) -> None:
    assert MapOntology(armor).contradiction() == ''
    armor.manipulation.add_ind_to_class('R1', 'DOOR')
    with pytest.raises(OntologyNotReadyError, match='ontology map is inconsistent'):
        ontology.snapshot(110.0, RULES)
    assert 'R1 is LOCATION and R1 is DOOR' in MapOntology(armor).contradiction()


def test_a_contradiction_is_named_while_it_lasts_and_the_last_map_serves(
    ontology: RobotOntology, armor: ArmorClient
) -> None:
    def clash() -> None:
        armor.manipulation.add_ind_to_class('R4', 'DOOR')
        assert not armor.utils.sync_buffered_reasoner()

    clash()
    with pytest.raises(OntologyNotReadyError, match=r'inconsistent because .*R4 is DOOR'):
        ontology.snapshot(130.0, RULES)
    armor.manipulation.remove_ind_from_class('R4', 'DOOR')
    before = ontology.snapshot(130.0, RULES)
    assert before.contradiction == ''
    clash()
    ontology.record_place('C1', 5)
    during = ontology.snapshot(140.0, RULES, visits={'C1': 139.5})
    assert 'R4 is DOOR' in during.contradiction
    assert during.contradiction.isprintable()
    assert (during.place, during.visited_at['C1']) == ('C1', 139.5)
    assert during.reachable == before.connections['C1']
    armor.manipulation.remove_ind_from_class('R4', 'DOOR')
    after = ontology.snapshot(150.0, RULES, visits={'C1': 139.5})
    assert (after.contradiction, after.place) == ('', 'C1')


def test_a_contradiction_that_ends_while_it_is_waited_for_is_named_once(
    ontology: RobotOntology, armor: ArmorClient
) -> None:
    class Mended(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            armor.manipulation.remove_ind_from_class('R4', 'DOOR')
            return False

    armor.manipulation.add_ind_to_class('R4', 'DOOR')
    first = ontology.snapshot(130.0, RULES, patience=60.0, interrupt=Mended())
    assert 'R4 is DOOR' in first.contradiction
    assert first.reachable == ('C1', 'C2')
    assert ontology.snapshot(131.0, RULES).contradiction == ''


def test_a_time_of_visit_that_is_none_is_named(ontology: RobotOntology, armor: ArmorClient) -> None:
    armor.manipulation.add_dataprop_to_ind('visitedAt', 'R1', 'STRING', 'yesterday')
    with pytest.raises(OntologyNotReadyError, match=r'inconsistent|visitedAt of R1'):
        ontology.snapshot(110.0, RULES)


def test_a_map_that_is_built_after_the_robot_told_its_place_keeps_its_closed_doors(
    armor: ArmorClient, transport: Counting
) -> None:
    armor.utils.load_ref_from_file(ONTOLOGY, IRI, False, 'PELLET', True)
    ontology = RobotOntology(armor)
    ontology.record_place('C1', 1)
    tell_visits(transport, {'C1': 90.0})
    closed = PLACE.with_door('D1', is_open=False)
    assert MapOntology(armor).build(closed, ONTOLOGY, IRI).closed == {'D1'}
    found = ontology.snapshot(110.0, RULES)
    assert (found.place, found.visited_at) == ('C1', {'C1': 90.0})
    assert found.reachable == ('C2', 'E', 'R2')


def test_a_place_that_joins_is_in_the_next_snapshot(
    ontology: RobotOntology, armor: ArmorClient
) -> None:
    before = ontology.snapshot(110.0, RULES)
    armor.manipulation.add_objectprop_to_ind('hasDoor', 'R9', 'D1')
    armor.manipulation.add_dataprop_to_ind('visitedAt', 'R9', 'LONG', '105')
    after = ontology.snapshot(111.0, RULES)
    assert set(after.connections) == {*before.connections, 'R9'}


def test_several_robots_share_an_ontology(transport: Counting) -> None:
    one = RobotOntology(ArmorClient('one', 'map', transport))
    two = RobotOntology(ArmorClient('two', 'map', transport), robot='Robot2')
    MapOntology(ArmorClient('one', 'map', transport)).build(PLACE, ONTOLOGY, IRI)
    one.record_place('E', 1)
    two.record_place('C1', 2)
    tell_visits(transport, {'C1': 50.0})
    assert (one.snapshot(60.0, RULES).place, two.snapshot(60.0, RULES).place) == ('E', 'C1')
    assert two.snapshot(60.0, RULES).reachable == ('C2', 'E', 'R1', 'R2')
    assert one.snapshot(60.0, RULES).visited_at == {'C1': 50.0}


def test_a_snapshot_waits_for_an_ontology_that_is_built_anew(
    ontology: RobotOntology, transport: Counting
) -> None:
    builder = MapOntology(ArmorClient('builder', 'map', transport))
    steps = iter(
        (
            lambda: None,
            lambda: ArmorClient('builder', 'map', transport).utils.load_ref_from_file(
                ONTOLOGY, IRI, False, 'PELLET', True
            ),
            lambda: builder.build(PLACE, ONTOLOGY, IRI),
            lambda: RobotOntology(ArmorClient('builder', 'map', transport)).record_place('C1', 120),
        )
    )

    class Pause:
        """What happens while the snapshot waits."""

        def wait(self, timeout: float) -> bool:
            next(steps)()
            return False

    before = ontology.snapshot(120.0, RULES, visits={'E': 100.0})
    builder.forget()
    found = ontology.snapshot(
        121.0,
        RULES,
        visits={'E': 100.0, 'C1': 120.0},
        threshold=30.0,
        patience=60.0,
        interrupt=Pause(),
    )
    assert next(steps, None) is None, 'no step of the building was taken for the whole'
    assert (found.place, found.visited_at) == ('C1', {'E': 100.0, 'C1': 120.0})
    assert found.connections == before.connections
    assert 'URGENT' not in found.classes['E'], 'it knows the threshold again'


def test_an_ontology_that_is_not_there_is_refused_with_its_name(transport: Counting) -> None:
    ontology = RobotOntology(ArmorClient('one', 'none', transport))
    with pytest.raises(ArmorServiceInternalError, match="unknown reference 'none'"):
        ontology.record_place('E', 1)


def test_how_much_of_a_place_was_in_view_is_a_fact_and_told_once(
    ontology: RobotOntology, armor: ArmorClient, transport: Counting
) -> None:
    ontology.snapshot(130.0, ())
    ontology.record_coverage({'R1': 97, 'nowhere': 5})
    trips = transport.trips
    ontology.record_coverage({'R1': 97})
    assert transport.trips == trips
    ontology.record_coverage({'R1': 40})
    assert armor.query.dataprop_b2_ind('covered', 'R1') == ['"40"^^xsd:long']
