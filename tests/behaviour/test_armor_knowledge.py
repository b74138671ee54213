"""The ontology's port against the project's own ARMOR, in this process."""

from __future__ import annotations

from pathlib import Path

import pytest

from armor_service.client import (
    ArmorClient,
    ArmorServiceCallError,
    InProcessTransport,
)
from armor_service.service import ArmorService
from floor_plans import read_place
from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.ros_adapters.armor_knowledge import ArmorKnowledge, Whereabouts
from surveillance_ontology.map_ontology import MapOntology
from surveillance_ontology.patrol_vocabulary import DATA
from surveillance_ontology.robot_ontology import RobotOntology, Snapshot

PLACE = read_place(Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml').place
RULES = ('URGENT', 'CORRIDOR', 'ROOM')
NOBODY = Interrupt()


@pytest.fixture
def transport() -> InProcessTransport:
    transport = InProcessTransport(ArmorService())
    armor = ArmorClient('builder', 'map', transport)
    MapOntology(armor).build(
        PLACE, str(DATA / 'surveillance.owl'), 'http://bnc/exp-rob-lab/2022-23', 100
    )
    RobotOntology(armor).record_place('E', 1)
    return transport


@pytest.fixture
def armor(transport: InProcessTransport) -> ArmorClient:
    return ArmorClient('test', 'map', transport)


@pytest.fixture
def knowledge(transport: InProcessTransport) -> ArmorKnowledge:
    return ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: 'map')


def ask(knowledge: ArmorKnowledge, now: float, **visits: float) -> Snapshot:
    return knowledge.snapshot(now, RULES, visits, NOBODY, threshold=30.0)


def test_a_snapshot_is_what_the_ontology_infers(knowledge: ArmorKnowledge) -> None:
    found = ask(knowledge, 110.7)
    assert found.place == 'E'
    assert found.reachable == ('C1', 'C2')
    assert found.connections['C1'] == ('C2', 'E', 'R1', 'R2')
    assert found.classes['C1'] == {'CORRIDOR', 'ROOM'}
    assert found.classes['R1'] == {'ROOM'}
    assert set(found.visited_at.values()) == {100.0}


@pytest.mark.parametrize(('now', 'urgent'), [(130.0, False), (131.0, True)])
def test_places_become_urgent_beyond_the_threshold(
    knowledge: ArmorKnowledge, now: float, urgent: bool
) -> None:
    assert ('URGENT' in ask(knowledge, now).classes['R1']) is urgent


def test_visits_that_the_ontology_does_not_know_are_told_with_the_question(
    knowledge: ArmorKnowledge, armor: ArmorClient
) -> None:
    ask(knowledge, 110.0)
    found = ask(knowledge, 128.0, E=120.0, C1=127.9, R1=50.0)
    assert (found.visited_at['E'], found.visited_at['C1']) == (120.0, 127.0)
    assert found.visited_at['R1'] == 100.0, 'a later visit of somebody else stays'
    assert armor.query.dataprop_b2_ind('now', 'Robot1') == ['"128"^^xsd:long']


def test_the_answer_knows_where_the_robot_was_heard_of_last(
    transport: InProcessTransport, armor: ArmorClient
) -> None:
    heard = Whereabouts()
    heard.note('C1', 5_000_000_000)
    knowledge = ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: 'map', heard)
    with pytest.raises(CallError, match='nobody told it where the robot is'):
        ask(knowledge, 110.0)
    RobotOntology(armor).record_place('C1', 5_000_000_000)
    assert ask(knowledge, 110.0).place == 'C1'
    assert knowledge.await_place('C1', 5.0, NOBODY) == 'C1'
    assert knowledge.await_place('C2', 0.0, NOBODY) == 'C1'


def test_a_lost_robot_is_named(knowledge: ArmorKnowledge, armor: ArmorClient) -> None:
    armor.manipulation.remove_objectprop_from_ind('isIn', 'Robot1', 'E')
    with pytest.raises(CallError, match='Robot1 in no place; nobody tells its place on'):
        ask(knowledge, 110.0)


def test_a_visit_time_that_is_none_is_named(knowledge: ArmorKnowledge, armor: ArmorClient) -> None:
    armor.manipulation.add_dataprop_to_ind('visitedAt', 'R1', 'STRING', 'yesterday')
    with pytest.raises(CallError, match=r'inconsistent|visitedAt of R1'):
        ask(knowledge, 110.0)


def test_a_new_place_is_believed_at_once(knowledge: ArmorKnowledge, armor: ArmorClient) -> None:
    before = ask(knowledge, 110.0)
    armor.manipulation.add_objectprop_to_ind('hasDoor', 'R9', 'D1')
    armor.manipulation.add_dataprop_to_ind('visitedAt', 'R9', 'LONG', '105')
    after = ask(knowledge, 111.0)
    assert set(after.connections) == {*before.connections, 'R9'}


def test_an_unknown_ontology_is_asked_for_anew(transport: InProcessTransport) -> None:
    names = ['other', 'map']
    knowledge = ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: names.pop(0))
    with pytest.raises(CallError, match="unknown reference 'other'"):
        ask(knowledge, 110.0)
    assert ask(knowledge, 110.0).place == 'E'


def test_an_interrupted_call_is_no_fault_of_the_server(transport: InProcessTransport) -> None:
    raised = Interrupt()

    def cut_off(_requests: object) -> object:
        raised.set()
        raise ArmorServiceCallError('interrupted')

    transport.call = cut_off  # type: ignore[method-assign, assignment]
    knowledge = ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: 'map')
    with pytest.raises(CallInterruptedError):
        knowledge.snapshot(110.0, RULES, {}, raised)
    with pytest.raises(CallError, match='armor: interrupted'):
        ask(knowledge, 110.0)


def own(knowledge: ArmorKnowledge, now: float, told: dict[str, float], usual: float) -> Snapshot:
    return knowledge.snapshot(now, RULES, {}, NOBODY, usual, told)


def urgent(found: Snapshot) -> set[str]:
    return {place for place, classes in found.classes.items() if 'URGENT' in classes}


def test_a_place_with_its_own_threshold_is_urgent_by_that_alone(
    knowledge: ArmorKnowledge, armor: ArmorClient
) -> None:
    told = {'R1': 10.0, 'R2': 500.0}
    found = own(knowledge, 111.0, told, 30.0)
    assert found.thresholds == told
    assert urgent(found) == {'R1'}
    assert urgent(own(knowledge, 131.0, told, 30.0)) == set(PLACE.rooms) - {'R2'}
    assert urgent(own(knowledge, 131.0, told, 60.0)) == {'R1'}
    sentence, tree = armor.query.explain('URGENT(R1)') or ('', '')
    assert sentence == 'R1 is URGENT because now 131 - visitedAt 100 = 31 > acceptedWait 10'
    assert 'urgencyThreshold' in tree
    assert urgent(own(knowledge, 601.0, told, 60.0)) == set(PLACE.rooms)


def test_a_threshold_that_somebody_sets_in_the_ontology_overrides_the_place_file(
    knowledge: ArmorKnowledge, armor: ArmorClient
) -> None:
    own(knowledge, 105.0, {'R1': 10.0}, 30.0)
    armor.manipulation.replace_one_dataprop_b2_ind('urgencyThreshold', 'R1', 'LONG', '90')
    armor.manipulation.add_dataprop_to_ind('urgencyThreshold', 'R3', 'LONG', '5')
    found = own(knowledge, 131.0, {'R1': 10.0}, 30.0)
    assert found.thresholds == {'R1': 90.0, 'R3': 5.0}
    assert urgent(found) == set(PLACE.rooms) - {'R1'}
    # The usual threshold is the robot's again once no place accepts a longer wait.
    armor.manipulation.replace_one_dataprop_b2_ind('urgencyThreshold', 'R1', 'LONG', '20')
    assert urgent(own(knowledge, 125.0, {}, 30.0)) == {'R1', 'R3'}
    assert armor.query.dataprop_b2_ind('urgencyThreshold', 'Robot1') == ['"30"^^xsd:long']
    assert armor.query.facts('acceptedWait(R2, ?)') == []


def test_an_ontology_without_the_rule_for_places_is_told_nothing_of_them() -> None:
    transport = InProcessTransport(ArmorService())
    armor = ArmorClient('builder', 'map', transport)
    MapOntology(armor).build(
        PLACE, str(DATA / 'surveillance.owl'), 'http://bnc/exp-rob-lab/2022-23', 100
    )
    ontology = RobotOntology(armor)
    (rule,) = (each for each in armor.query.rules() if 'acceptedWait' in each)
    armor.manipulation.remove_rule(rule)
    ontology.record_place('E', 1)
    found = ontology.snapshot(111.0, RULES, threshold=30.0, own_thresholds={'R1': 10.0})
    assert found.thresholds == {}
    assert armor.query.dataprop_b2_ind('urgencyThreshold', 'R1') == []
