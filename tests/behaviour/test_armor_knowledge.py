"""The ontology's port against the project's own ARMOR, in this process."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from surveillance_behaviour.peers.armor_knowledge import ArmorKnowledge, Whereabouts
from surveillance_behaviour.peers.ports import AwayError, InterruptedWaitError, PeerError
from surveillance_fsm import Interrupt
from surveillance_ontology.armor.access import DATA
from surveillance_ontology.armor.client import (
    ArmorClient,
    ArmorServiceCallError,
    InProcessTransport,
)
from surveillance_ontology.armor.service import ArmorService
from surveillance_ontology.patrol_ontology import PatrolOntology
from surveillance_runtime.place import read_place

PLACE = read_place(Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml')
RULES = ('URGENT', 'CORRIDOR', 'ROOM')
NOBODY = Interrupt()


@pytest.fixture
def transport() -> InProcessTransport:
    transport = InProcessTransport(ArmorService())
    ontology = PatrolOntology(ArmorClient('builder', 'map', transport))
    ontology.build(PLACE, str(DATA / 'surveillance.owl'), 'http://bnc/exp-rob-lab/2022-23')
    ontology.record_place('E', 1)
    return transport


@pytest.fixture
def ontology(transport: InProcessTransport) -> PatrolOntology:
    return PatrolOntology(ArmorClient('test', 'map', transport))


@pytest.fixture
def whereabouts() -> Whereabouts:
    return Whereabouts()


@pytest.fixture
def knowledge(transport: InProcessTransport, whereabouts: Whereabouts) -> ArmorKnowledge:
    return ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: 'map', whereabouts)


def test_beliefs_are_what_the_ontology_infers(knowledge: ArmorKnowledge) -> None:
    knowledge.set_urgency_threshold(30.0, NOBODY)
    beliefs = knowledge.beliefs(RULES, 110.7, NOBODY, {'E': 100.0})
    assert beliefs.place == 'E'
    assert beliefs.reachable == ('C1', 'C2')
    assert beliefs.connections['C1'] == ('C2', 'E', 'R1', 'R2')
    assert beliefs.classes['C1'] == {'URGENT', 'CORRIDOR', 'ROOM'}
    assert beliefs.classes['E'] == {'CORRIDOR', 'ROOM'}
    assert beliefs.visited_at == {'E': 100.0}


def test_beliefs_wait_for_the_place_that_was_heard_of(
    transport: InProcessTransport, ontology: PatrolOntology, whereabouts: Whereabouts
) -> None:
    knowledge = ArmorKnowledge(
        'test', transport, Interrupt(), lambda _interrupt: 'map', whereabouts, 10.0
    )
    whereabouts.note('C1', 500)
    late = threading.Timer(0.1, lambda: ontology.record_place('C1', 500))
    late.start()
    assert knowledge.beliefs(RULES, 110.0, NOBODY).place == 'C1'
    late.join()


def test_beliefs_that_know_nothing_of_the_place_are_refused_in_time(
    knowledge: ArmorKnowledge, whereabouts: Whereabouts
) -> None:
    whereabouts.note('C1', 500)
    with pytest.raises(PeerError, match='armor: nobody told it where the robot is'):
        knowledge.beliefs(RULES, 110.0, NOBODY)
    whereabouts.note('', 600)
    with pytest.raises(PeerError, match='armor: nobody told it where the robot is'):
        knowledge.beliefs(RULES, 110.0, NOBODY)


def test_a_place_is_waited_for_as_long_as_somebody_tells_it(
    knowledge: ArmorKnowledge, whereabouts: Whereabouts
) -> None:
    assert knowledge.await_place('C1', 60.0, NOBODY) == '', 'nobody ever told: no wait'
    whereabouts.note('E', 1)
    assert knowledge.await_place('C1', 0.05, NOBODY) == 'E'
    late = threading.Timer(0.05, lambda: whereabouts.note('C1', 2))
    late.start()
    assert knowledge.await_place('C1', 60.0, NOBODY) == 'C1'
    late.join()
    raised = Interrupt()
    threading.Timer(0.05, raised.set).start()
    with pytest.raises(InterruptedWaitError):
        knowledge.await_place('E', 60.0, raised)


def test_an_unknown_ontology_is_asked_for_anew(transport: InProcessTransport) -> None:
    names = ['other', 'map']
    knowledge = ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: names.pop(0))
    with pytest.raises(PeerError, match="unknown reference 'other'"):
        knowledge.set_urgency_threshold(5.0, NOBODY)
    knowledge.set_urgency_threshold(5.0, NOBODY)


def test_an_interrupted_call_is_no_fault_of_the_server(transport: InProcessTransport) -> None:
    raised = Interrupt()

    def cut_off(_requests: object) -> object:
        raised.set()
        raise ArmorServiceCallError('interrupted')

    transport.call_list = cut_off  # type: ignore[method-assign, assignment]
    knowledge = ArmorKnowledge('test', transport, Interrupt(), lambda _interrupt: 'map')
    with pytest.raises(InterruptedWaitError):
        knowledge.beliefs(RULES, 1.0, raised)
    with pytest.raises(AwayError, match='armor: interrupted'):
        knowledge.beliefs(RULES, 1.0, Interrupt())
