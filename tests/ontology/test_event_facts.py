"""Events as facts: an alert makes its place URGENT, is proved by observations, leaves again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from armor_service.client import ArmorClient, ArmorServiceInternalError, InProcessTransport
from armor_service.protocol import DirectiveRequest, ListResponse
from armor_service.service import ArmorService
from floor_plans import read_place
from libs.armor_service.tests.seven_rooms import IRI
from surveillance_ontology.event_facts import MOST_EVENTS, EventFact, EventOntology, EventSighting
from surveillance_ontology.map_ontology import MapOntology
from surveillance_ontology.patrol_vocabulary import ONTOLOGY
from surveillance_ontology.robot_ontology import RobotOntology

PLACE = read_place(Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml').place
SEEN = EventSighting(130, 0.98, (10.0, 14.5), '3_130_door-D3-closed.jpg')
DOOR = EventFact(3, 'Door', 'closed', 'R3', 'D3', 'Alert', 'Open', SEEN, SEEN, 20)


@pytest.fixture
def armor() -> Iterator[ArmorClient]:
    service = ArmorService(warn=lambda _: None)
    armor = ArmorClient('test', 'map', InProcessTransport(service))
    build(armor)
    yield armor
    service.close()


def build(armor: ArmorClient) -> None:
    MapOntology(armor).build(PLACE, str(ONTOLOGY), IRI, now=100)
    ontology = RobotOntology(armor)
    ontology.record_place('E', 100)


def urgent(armor: ArmorClient, now: float, **visits: float) -> set[str]:
    """Return the URGENT places where all were visited at 120, or when it says."""
    visited = dict.fromkeys(PLACE.rooms, 120.0) | visits
    snapshot = RobotOntology(armor).snapshot(now, ['URGENT'], visits=visited, threshold=1000.0)
    return {place for place, classes in snapshot.classes.items() if classes}


def ask(armor: ArmorClient, *words: str) -> list[str]:
    answer = armor.batch([armor.request(*words)]).responses[0]
    assert answer.success, answer.error_description
    return list(answer.queried_objects)


def test_an_alert_is_urgent_until_the_next_visit_and_then_sooner_than_usual(armor: ArmorClient):
    events = EventOntology(armor)
    assert urgent(armor, 131.0) == set()
    events.tell([DOOR])
    assert urgent(armor, 131.0) == {'R3'}
    assert urgent(armor, 141.0, R3=140.0) == set()
    assert urgent(armor, 161.0, R3=140.0) == {'R3'}
    events.tell([replace(DOOR, state='Acknowledged')])
    assert urgent(armor, 161.0, R3=140.0) == set()
    events.tell([replace(DOOR, level='Warning')])
    assert urgent(armor, 161.0, R3=140.0) == set()


def test_an_alert_is_proved_from_its_observations(armor: ArmorClient):
    EventOntology(armor).tell([DOOR])
    sentence, tree = ask(armor, 'QUERY EXPLAIN', 'ALERT(R3)')
    assert sentence.startswith('R3 is ALERT because')
    assert 'Event3First' in tree or 'Event3Last' in tree
    assert '"closed"' in ' '.join(ask(armor, 'QUERY DATAPROP IND', 'observedState', 'Event3Last'))
    assert 'http://www.w3.org/ns/sosa/Observation' in ' '.join(
        ask(armor, 'QUERY CLASS IND', 'Event3Last')
    )
    assert ask(armor, 'QUERY EXPLAIN', 'URGENT(R3)')


def test_each_sighting_says_when_where_how_surely_and_by_whom(armor: ArmorClient):
    later = EventSighting(150, 0.5, compared_with='empty.jpg', by='tb2')
    EventOntology(armor).tell([replace(DOOR, subject='', last=later)])
    expected = {
        'observedAt': ('130', '150'),
        'confidence': ('0.98', '0.5'),
        'atPosition': ('10.00 14.50', None),
        'evidence': ('3_130_door-D3-closed.jpg', None),
        'comparedWith': (None, 'empty.jpg'),
        'by': ('Robot1', 'tb2'),
        'subject': (None, None),
    }
    for prop, values in expected.items():
        for part, value in zip(('First', 'Last'), values, strict=True):
            told = ask(armor, 'QUERY DATAPROP IND', prop, f'Event3{part}')
            assert (told == []) if value is None else (f'"{value}' in told[0]), (prop, part)
    assert '"130"' in ask(armor, 'QUERY DATAPROP IND', 'beganAt', 'Event3')[0]
    assert '"150"' in ask(armor, 'QUERY DATAPROP IND', 'observedAt', 'Event3')[0]


def test_only_what_has_changed_is_told_again(armor: ArmorClient, monkeypatch: pytest.MonkeyPatch):
    events = EventOntology(armor)
    other = replace(DOOR, number=4, place='R1')
    events.tell([DOOR, other])
    sent: list[str] = []
    carry_out = armor.batch

    def listened(requests: list[DirectiveRequest]) -> ListResponse:
        sent.extend(' '.join((each.words, *each.args)) for each in requests)
        return carry_out(requests)

    monkeypatch.setattr(armor, 'batch', listened)
    events.tell([DOOR, replace(other, state='Over')])
    assert any(line.startswith('REMOVE IND') and 'Event4Last' in line for line in sent)
    assert not any('Event3' in line for line in sent)
    sent.clear()
    events.tell([DOOR, replace(other, state='Over')])
    assert {line.split()[0] for line in sent} == {'QUERY'}


def test_what_the_server_refuses_is_told_with_the_directive(armor: ArmorClient):
    armor.utils.drop_ref()
    with pytest.raises(ArmorServiceInternalError, match=r'QUERY RULES.*: unknown reference'):
        EventOntology(armor).tell([DOOR])


def test_what_is_over_leaves_and_their_number_is_bounded(armor: ArmorClient):
    events = EventOntology(armor)
    before = len(ask(armor, 'QUERY FACT', 'inPlace(?, ?)'))
    many = [replace(DOOR, number=number, level='Warning') for number in range(10, 60)]
    events.tell([DOOR, *many])
    names = ask(armor, 'QUERY IND CLASS', 'Event')
    assert len(names) == MOST_EVENTS
    assert any(name.endswith('Event3>') for name in names)
    events.tell([])
    assert not ask(armor, 'QUERY IND CLASS', 'Event')
    assert not ask(armor, 'QUERY IND CLASS', 'Observation')
    assert len(ask(armor, 'QUERY FACT', 'inPlace(?, ?)')) == before


def test_an_ontology_that_was_built_anew_is_told_again(armor: ArmorClient):
    events = EventOntology(armor)
    events.tell([DOOR])
    armor.utils.drop_ref()
    build(armor)
    assert urgent(armor, 131.0) == set()
    events.tell([DOOR])
    assert urgent(armor, 131.0) == {'R3'}


def test_an_earlier_process_of_the_same_robot_is_followed_and_another_robot_is_left(
    armor: ArmorClient,
):
    EventOntology(armor).tell([DOOR])
    EventOntology(armor, 'tb2').tell([replace(DOOR, number=1, place='R1')])
    EventOntology(armor).tell([])
    assert urgent(armor, 131.0) == {'R1'}


def test_a_name_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="got 'Cat', expected one of Door, Object"):
        replace(DOOR, kind='Cat')
