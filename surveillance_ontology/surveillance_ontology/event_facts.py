"""What was noticed, as facts of the ontology beside the patrol's own.

    events = EventOntology(ArmorClient('me', 'surveillance', transport))
    events.tell([EventFact(3, 'Door', 'closed', 'R3', ...)])

An event is an individual of the class `Event`, with its first and its last sighting, which are
`Observation`s (in the sense of SOSA, W3C 2017). Its state and its severity are classes, too. While
an event of the severity alert is open, the place in which it was observed is ALERT: URGENT at once
until the next visit, and from then on after the event's `checkedEvery` seconds without a visit.
`QUERY EXPLAIN` with `ALERT(R3)` proves it from the observations. The rules of the patrol are as
they were. What is over leaves the ontology, so that the number of facts is bounded.

The vocabulary is told with the first event, so that any ontology with the patrol's names can take
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from armor_service.client import ArmorClient, ArmorServiceInternalError
from armor_service.protocol import DirectiveRequest, DirectiveResponse, name_in
from indoor_watch import Kind
from surveillance_ontology.patrol_vocabulary import ROBOT

KINDS = tuple(kind.capitalize() for kind in Kind)
STATES = ('Open', 'Acknowledged', 'Normal', 'False', 'Over')
LEVELS = ('Notice', 'Warning', 'Alert')
MOST_EVENTS = 20
"""So many are told, the most severe and newest."""

VOCABULARY = (
    'Class: Observation SubClassOf: <http://www.w3.org/ns/sosa/Observation>',
    *(f'Class: {kind}Observation SubClassOf: Observation' for kind in KINDS),
    'Class: Event',
    *(f'Class: {state}Event SubClassOf: Event' for state in STATES),
    *(f'Class: {level}Event SubClassOf: Event' for level in LEVELS),
    'ObjectProperty: inPlace Range: LOCATION',
    'ObjectProperty: hasSighting Domain: Event Range: Observation',
    'DataProperty: observedAt Range: xsd:long',
    'DataProperty: beganAt Domain: Event Range: xsd:long',
    'DataProperty: checkedEvery Domain: Event Range: xsd:long',
    *(
        f'DataProperty: {name} Range: xsd:string'
        for name in ('atPosition', 'observedState', 'subject', 'evidence', 'comparedWith', 'by')
    ),
    'DataProperty: confidence Range: xsd:double',
    'Class: ALERT SubClassOf: LOCATION',
)
RULES = (
    # EXPLAIN goes from the place over the event to what was observed.
    'OpenEvent(?event), AlertEvent(?event), hasSighting(?event, ?observation), '
    'inPlace(?observation, ?place) -> ALERT(?place)',
    'ALERT(?place), OpenEvent(?event), AlertEvent(?event), inPlace(?event, ?place), '
    'beganAt(?event, ?began), visitedAt(?place, ?visit), '
    'swrlb:greaterThan(?began, ?visit) -> URGENT(?place)',
    'ALERT(?place), OpenEvent(?event), AlertEvent(?event), inPlace(?event, ?place), '
    'checkedEvery(?event, ?limit), now(?robot, ?time), visitedAt(?place, ?visit), '
    'swrlb:subtract(?gap, ?time, ?visit), swrlb:greaterThan(?gap, ?limit) -> URGENT(?place)',
)


@dataclass(frozen=True)
class EventSighting:
    """One observation of an event.

    Attributes:
        stamp: When, whole seconds of ROS time.
        confidence: 0 to 1.
        position: Where: x, y in metres, map frame; None: not known.
        evidence: The file that shows it; or empty.
        compared_with: What it was compared with; or empty.
        by: Whose observation it is.
    """

    stamp: int
    confidence: float
    position: tuple[float, float] | None = None
    evidence: str = ''
    compared_with: str = ''
    by: str = ROBOT


@dataclass(frozen=True)
class EventFact:
    """An event as the ontology has it.

    Attributes:
        number: Its number.
        kind: One of `KINDS`.
        seen: The state that was seen, such as closed.
        place: In which place.
        subject: Which door or marker; or empty.
        level: One of `LEVELS`.
        state: One of `STATES`.
        first, last: Its first and last sighting.
        checked_every: While it is open its place is URGENT after so many seconds without a visit.
    """

    number: int
    kind: str
    seen: str
    place: str
    subject: str
    level: str
    state: str
    first: EventSighting
    last: EventSighting
    checked_every: int

    def __post_init__(self) -> None:
        for value, known in ((self.kind, KINDS), (self.level, LEVELS), (self.state, STATES)):
            if value not in known:
                raise ValueError(f'got {value!r}, expected one of {", ".join(known)}')


class EventOntology:
    """Keeps the ontology's events as they are; one thread at a time.

    Args:
        armor: A client of the ontology's reference.
        robot: Whose events they are: with several robots they have names of their own.
    """

    def __init__(self, armor: ArmorClient, robot: str = ROBOT) -> None:
        self._armor = armor
        self._prefix = 'Event' if robot == ROBOT else f'{robot}Event'
        self._told: dict[int, EventFact] = {}

    def tell(self, events: Sequence[EventFact]) -> None:
        """Bring the ontology to these events, which are all there are.

        Also an ontology that was built anew meanwhile, or that still has events of an earlier
        process.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses, for example because it has no such ontology.
        """
        kept = sorted(events, key=lambda each: (-LEVELS.index(each.level), -each.last.stamp))
        wanted = {each.number: each for each in kept[:MOST_EVENTS]}
        there = self._there()
        todo = []
        if there is None:
            todo += [self._request('ADD AXIOM', frame) for frame in VOCABULARY]
            todo += [self._request('ADD RULE', rule) for rule in RULES]
        names = {self._name(number): number for number in wanted}
        told = {}
        for name in sorted(there or ()):
            number = names.get(name)
            if number is not None and self._told.get(number) == wanted[number]:
                told[number] = wanted[number]
            else:
                for part in ('', 'First', 'Last'):
                    todo.append(self._request('REMOVE IND', name + part))
        for number, event in wanted.items():
            if number not in told:
                todo += self._facts(event)
        if todo:
            self._carry_out([*todo, self._request('REASON')])
        self._told = wanted

    def _there(self) -> set[str] | None:
        """Return the events of this robot that the ontology has; None: it lacks the vocabulary."""
        (rules,) = self._carry_out([self._request('QUERY RULES')])
        if not any('checkedEvery' in rule for rule in rules.queried_objects):
            return None
        (answer,) = self._carry_out([self._request('QUERY IND CLASS', 'Event')])
        names = (name_in(text) for text in answer.queried_objects)
        return {
            name
            for name in names
            if name.startswith(self._prefix) and name[len(self._prefix) :].isdigit()
        }

    def _name(self, number: int) -> str:
        return f'{self._prefix}{number}'

    def _facts(self, event: EventFact) -> list[DirectiveRequest]:
        request, name = self._request, self._name(event.number)
        todo = [
            request('ADD IND CLASS', name, f'{event.state}Event'),
            request('ADD IND CLASS', name, f'{event.level}Event'),
            request('ADD OBJECTPROP IND', 'inPlace', name, event.place),
            self._value('beganAt', name, 'LONG', str(event.first.stamp)),
            self._value('observedAt', name, 'LONG', str(event.last.stamp)),
            self._value('checkedEvery', name, 'LONG', str(event.checked_every)),
        ]
        for part, seen in (('First', event.first), ('Last', event.last)):
            sighting = name + part
            position = '' if seen.position is None else '{:.2f} {:.2f}'.format(*seen.position)
            todo += [
                request('ADD IND CLASS', sighting, f'{event.kind}Observation'),
                request('ADD OBJECTPROP IND', 'inPlace', sighting, event.place),
                request('ADD OBJECTPROP IND', 'hasSighting', name, sighting),
                self._value('observedAt', sighting, 'LONG', str(seen.stamp)),
                self._value('confidence', sighting, 'DOUBLE', f'{seen.confidence:.3f}'),
            ]
            texts = {
                'observedState': event.seen,
                'subject': event.subject,
                'atPosition': position,
                'evidence': seen.evidence,
                'comparedWith': seen.compared_with,
                'by': seen.by,
            }
            todo += [
                self._value(prop, sighting, 'STRING', text) for prop, text in texts.items() if text
            ]
        return todo

    def _value(self, prop: str, individual: str, kind: str, value: str) -> DirectiveRequest:
        return self._request('ADD DATAPROP IND', prop, individual, kind, value)

    def _request(self, words: str, *args: str) -> DirectiveRequest:
        return self._armor.request(words, *args)

    def _carry_out(self, requests: Sequence[DirectiveRequest]) -> list[DirectiveResponse]:
        answers = list(self._armor.batch(requests).responses)
        for wanted, answer in zip(requests, answers, strict=False):
            if not answer.success:
                words = ' '.join((wanted.words, *wanted.args[:3]))
                raise ArmorServiceInternalError(
                    f'{words}: {answer.error_description or "refused"}', answer.exit_code
                )
        return answers
