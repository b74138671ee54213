"""What the ontology knows of a patrol, at any size: a generated map, and a robot that walks on it.

The map is a chain of corridors, each joined to the next by a door, with seven rooms on each.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from owl_reasoner.documents.reading import read_ontology
from owl_reasoner.owl.axioms import (
    Axiom,
    DataPropertyAssertion,
    DifferentIndividuals,
    ObjectPropertyAssertion,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD

IRI = 'http://bnc/exp-rob-lab/2022-23'
_ROOT = Path(__file__).resolve().parent.parent
SCHEMA = _ROOT / 'surveillance_ontology' / 'surveillance_ontology' / 'data' / 'surveillance.owl'
START = 1_665_579_740
ROOMS_ON_A_CORRIDOR = 7


def named(name: str) -> str:
    return f'{IRI}#{name}'


def seconds(value: int) -> Literal:
    return Literal(str(value), XSD + 'long')


class Patrol:
    """A generated map and a robot that walks from place to place on it."""

    def __init__(self, places: int) -> None:
        corridors = max(1, round(places / (ROOMS_ON_A_CORRIDOR + 1)))
        self.robot = named('Robot1')
        names = [named(f'C{number}') for number in range(1, corridors + 1)]
        self.doors: dict[str, list[str]] = {name: [] for name in names}
        self.beyond: dict[str, list[str]] = {name: [] for name in names}
        self._door_number = 0
        for one, other in pairwise(names):
            self._join(one, other)
        for number in range(places - corridors):
            room = named(f'R{number + 1}')
            self.doors[room], self.beyond[room] = [], []
            self._join(room, names[number * corridors // (places - corridors)])
        self.visited = {name: START + order for order, name in enumerate(self.doors)}
        self.place, self.now = names[0], START + places
        self.threshold = max(3, places - 3)
        self._steps = 0

    def _join(self, one: str, other: str) -> None:
        self._door_number += 1
        for place, neighbour in ((one, other), (other, one)):
            self.doors[place].append(named(f'D{self._door_number}'))
            self.beyond[place].append(neighbour)

    def assertions(self) -> Iterator[Axiom]:
        """Yield the map and the robot."""
        for place, doors in self.doors.items():
            for door in doors:
                yield ObjectPropertyAssertion(named('hasDoor'), place, door)
            yield self._visit(place)
        yield DifferentIndividuals(frozenset(self.doors))
        all_doors = frozenset(door for doors in self.doors.values() for door in doors)
        if len(all_doors) > 1:
            yield DifferentIndividuals(all_doors)
        yield self._is_in()
        yield self._now()
        yield DataPropertyAssertion(named('urgencyThreshold'), self.robot, seconds(self.threshold))

    def _visit(self, place: str) -> Axiom:
        return DataPropertyAssertion(named('visitedAt'), place, seconds(self.visited[place]))

    def _is_in(self) -> Axiom:
        return ObjectPropertyAssertion(named('isIn'), self.robot, self.place)

    def _now(self) -> Axiom:
        return DataPropertyAssertion(named('now'), self.robot, seconds(self.now))

    def step(self) -> tuple[list[Axiom], list[Axiom], tuple[str, ...]]:
        """Go to a neighbour: assertions that go, those that come, and the words of a Java
        `visit`.
        """
        self._steps += 1
        neighbours = self.beyond[self.place]
        target = neighbours[self._steps % len(neighbours)]
        gone = [self._is_in(), self._now(), self._visit(target)]
        words = [self.robot, self.place, target, str(self.now)]
        self.now += 1
        words += [str(self.now), str(self.visited[target]), str(self.now)]
        self.place, self.visited[target] = target, self.now
        return gone, [self._is_in(), self._now(), self._visit(target)], tuple(words)


def schema() -> list[Axiom]:
    """Return the project's own ontology without what it states of individuals' values."""
    axioms = read_ontology(SCHEMA, IRI).axioms
    return [axiom for axiom in axioms if not isinstance(axiom, DataPropertyAssertion)]
