"""The ontology's port against the project's own ARMOR, in this process."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_behaviour.peers.armor_knowledge import ArmorKnowledge
from surveillance_behaviour.peers.ports import InterruptedWaitError, LostRobotError, PeerError
from surveillance_fsm import Interrupt
from surveillance_ontology.armor.access import DATA
from surveillance_ontology.armor.client import (
    ArmorClient,
    ArmorServiceCallError,
    InProcessTransport,
)
from surveillance_ontology.armor.service import ArmorService
from surveillance_ontology.map_building import MapBuilding
from surveillance_runtime.place import read_place

PLACE = read_place(Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml')
RULES = ('URGENT', 'CORRIDOR', 'ROOM')
NOBODY = Interrupt()


@pytest.fixture
def transport() -> InProcessTransport:
    transport = InProcessTransport(ArmorService())
    armor = ArmorClient('builder', 'map', transport)
    building = MapBuilding(armor, str(DATA / 'surveillance.owl'), 'http://bnc/exp-rob-lab/2022-23')
    building.build(PLACE, 100, PLACE.start)
    return transport


@pytest.fixture
def armor(transport: InProcessTransport) -> ArmorClient:
    return ArmorClient('test', 'map', transport)


@pytest.fixture
def knowledge(transport: InProcessTransport) -> ArmorKnowledge:
    return ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: 'map')


def test_beliefs_are_what_the_ontology_infers(knowledge: ArmorKnowledge) -> None:
    knowledge.set_urgency_threshold(30.0, NOBODY)
    beliefs = knowledge.beliefs(RULES, 110.7, NOBODY)
    assert beliefs.place == 'E'
    assert beliefs.reachable == ('C1', 'C2')
    assert beliefs.connections['C1'] == ('C2', 'E', 'R1', 'R2')
    assert beliefs.classes['C1'] == {'CORRIDOR', 'ROOM'}
    assert beliefs.classes['R1'] == {'ROOM'}
    assert set(beliefs.visited_at.values()) == {100.0}


@pytest.mark.parametrize(('now', 'urgent'), [(130.0, False), (131.0, True)])
def test_places_become_urgent_beyond_the_threshold(
    knowledge: ArmorKnowledge, now: float, urgent: bool
) -> None:
    knowledge.set_urgency_threshold(30.0, NOBODY)
    assert ('URGENT' in knowledge.beliefs(RULES, now, NOBODY).classes['R1']) is urgent


def test_visits_and_arrivals_replace_what_was_known(
    knowledge: ArmorKnowledge, armor: ArmorClient
) -> None:
    knowledge.note_visit('E', 120.0, NOBODY)
    knowledge.note_arrival('E', 'C1', 127.9, NOBODY)
    beliefs = knowledge.beliefs(RULES, 128.0, NOBODY)
    assert (beliefs.place, beliefs.visited_at['E'], beliefs.visited_at['C1']) == (
        'C1',
        120.0,
        127.0,
    )
    assert armor.query.dataprop_b2_ind('now', 'Robot1') == ['"128"^^xsd:long']
    assert knowledge.robot_place(NOBODY) == 'C1'


def test_a_robot_in_two_places_at_once_is_named_and_found_again(
    knowledge: ArmorKnowledge, armor: ArmorClient
) -> None:
    armor.manipulation.add_objectprop_to_ind('isIn', 'Robot1', 'C1')
    with pytest.raises(LostRobotError, match='Robot1 isIn C1 and E'):
        knowledge.beliefs(RULES, 110.0, NOBODY)
    knowledge.note_arrival('', 'C1', 110.0, NOBODY)
    assert knowledge.beliefs(RULES, 111.0, NOBODY).place == 'C1'


def test_a_map_that_is_built_leaves_the_robot_where_somebody_has_told_it_is() -> None:
    transport = InProcessTransport(ArmorService())
    armor = ArmorClient('builder', 'map', transport)
    ontology, iri = str(DATA / 'surveillance.owl'), 'http://bnc/exp-rob-lab/2022-23'
    armor.utils.load_ref_from_file(ontology, iri, False, 'PELLET', True)
    armor.manipulation.add_objectprop_to_ind('isIn', 'Robot1', 'C1')
    MapBuilding(armor, ontology, iri).build(PLACE, 100, PLACE.start)
    knowledge = ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: 'map')
    assert knowledge.beliefs(RULES, 110.0, NOBODY).place == 'C1'


def test_a_lost_robot_is_named_and_found_again(
    knowledge: ArmorKnowledge, armor: ArmorClient
) -> None:
    armor.manipulation.remove_objectprop_from_ind('isIn', 'Robot1', 'E')
    with pytest.raises(LostRobotError, match='Robot1 isIn no place'):
        knowledge.robot_place(NOBODY)
    armor.manipulation.add_objectprop_to_ind('isIn', 'Robot1', 'E')
    armor.manipulation.add_objectprop_to_ind('isIn', 'Robot1', 'C2')
    with pytest.raises((LostRobotError, PeerError)):
        knowledge.beliefs(RULES, 130.0, NOBODY)
    knowledge.note_arrival('', 'C2', 131.0, NOBODY)
    assert knowledge.beliefs(RULES, 132.0, NOBODY).place == 'C2'


def test_a_visit_time_that_is_none_is_named(knowledge: ArmorKnowledge, armor: ArmorClient) -> None:
    armor.manipulation.add_dataprop_to_ind('visitedAt', 'R1', 'STRING', 'yesterday')
    with pytest.raises(PeerError, match=r'inconsistent|visitedAt of R1'):
        knowledge.beliefs(RULES, 110.0, NOBODY)


def test_a_new_place_is_believed_at_once(knowledge: ArmorKnowledge, armor: ArmorClient) -> None:
    before = knowledge.beliefs(RULES, 110.0, NOBODY)
    armor.manipulation.add_objectprop_to_ind('hasDoor', 'R9', 'D1')
    armor.manipulation.add_dataprop_to_ind('visitedAt', 'R9', 'LONG', '105')
    after = knowledge.beliefs(RULES, 111.0, NOBODY)
    assert set(after.connections) == {*before.connections, 'R9'}


def test_an_unknown_ontology_is_asked_for_anew(transport: InProcessTransport) -> None:
    names = ['other', 'map']
    knowledge = ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: names.pop(0))
    with pytest.raises(PeerError, match="unknown reference 'other'"):
        knowledge.robot_place(NOBODY)
    assert knowledge.robot_place(NOBODY) == 'E'


def test_an_interrupted_call_is_no_fault_of_the_server(transport: InProcessTransport) -> None:
    raised = Interrupt()

    def cut_off(_requests: object) -> object:
        raised.set()
        raise ArmorServiceCallError('interrupted')

    transport.call_list = cut_off  # type: ignore[method-assign, assignment]
    knowledge = ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: 'map')
    with pytest.raises(InterruptedWaitError):
        knowledge.robot_place(raised)
    with pytest.raises(PeerError, match='armor: interrupted'):
        knowledge.robot_place(Interrupt())
