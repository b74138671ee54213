"""Which individuals are known to be different, decided for a pair when it is asked for.

Pairs are never listed: a set of all-different individuals is a number that its members carry, and
difference that follows from other facts (disjoint classes, functional properties with different
values, ...) is looked up in the facts of the two individuals. Where such a fact comes or goes, its
individual is *touched*, and whatever asks for differences of that individual is asked again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Protocol

from owl_reasoner.owl.axioms import DifferentIndividuals
from owl_reasoner.reasoner.clauses import Fact, Predicate, Premises, Program

_MAX_PAIRS = 1000


class Evidence(Protocol):
    """One way in which two individuals can be known to be different."""

    def premises(self, x: str, y: str) -> Iterator[Premises]:
        """Return each set of facts by which `x` and `y` differ."""


class EvidenceOfValues(Evidence, Protocol):
    """Two individuals differ because what they are related to does."""

    def pairs(self, x: str, y: str) -> Iterator[tuple[str, str]]:
        """Pairs of individuals each of which, if different, makes `x` and `y` different."""


class Inequality:
    """Inequality between representatives of individuals.

    Attributes:
        evidence: By which facts two individuals differ.
        through: By which differences of others they do.
        denied: Individuals of whom it was ever answered that one is not known to differ from some
            other: whoever asked may have to ask again for these alone.
    """

    def __init__(self, program: Program) -> None:
        self.predicate = program.different
        self._own: dict[str, set[int]] = {}
        self._merged: dict[str, set[int]] = {}
        self._numbers: dict[DifferentIndividuals, int] = {}
        self._axioms: dict[int, DifferentIndividuals] = {}
        self._next = 0
        self._apart = program.apart
        self.evidence: list[Evidence] = []
        self.through: list[EvidenceOfValues] = []
        self.denied: set[str] = set()

    # --- stated differences ---

    def state(self, axiom: DifferentIndividuals) -> None:
        """Add a set of individuals all different from each other."""
        # A set of n individuals costs n entries; the pairs would be n times as many, and a map of
        # 1,000 rooms states one such set.
        number = self._next = self._next + 1
        self._numbers[axiom] = number
        self._axioms[number] = axiom
        own = self._own
        for individual in axiom.individuals:
            numbers = own.get(individual)
            if numbers is None:
                own[individual] = {number}
            else:
                numbers.add(number)

    def withdraw(self, axiom: DifferentIndividuals) -> None:
        """Take such a set away."""
        number = self._numbers.pop(axiom)
        del self._axioms[number]
        for individual in axiom.individuals:
            numbers = self._own[individual]
            numbers.discard(number)
            if not numbers:
                del self._own[individual]

    def merge(self, representative: str, members: Iterable[str]) -> None:
        """One individual now stands for all members."""
        numbers: set[int] = set()
        for member in members:
            self._merged.pop(member, None)
            numbers |= self._own.get(member, set())
        self._merged[representative] = numbers

    def split(self, representative: str) -> None:
        """Undoes `merge`."""
        self._merged.pop(representative, None)

    def stated(self, x: str, y: str) -> bool:
        """Tell whether the two are in one all-different set."""
        own = self._own
        if self._merged:
            first = self._merged.get(x) or own.get(x)
            second = self._merged.get(y) or own.get(y)
        else:
            first, second = own.get(x), own.get(y)
        return first is not None and second is not None and not first.isdisjoint(second)

    def stating(self, members: Iterable[str], others: Iterable[str]) -> DifferentIndividuals | None:
        """Return an axiom by which some member differs from some other."""
        others = tuple(others)
        for x in members:
            for y in others:
                for number in self._own.get(x, set()) & self._own.get(y, set()):
                    return self._axioms[number]
        return None

    # --- known differences ---

    def different(self, x: str, y: str) -> bool:
        """Tell whether two individuals are known to be different."""
        if x == y:
            return False
        own = self._own
        if not self._merged:
            first = own.get(x)
            if first is not None:
                second = own.get(y)
                if second is not None and not first.isdisjoint(second):
                    return True
        elif self.stated(x, y):
            return True
        # The cheap sources first: sets, then rules, then what facts imply.
        if self._apart.succ and self._stated_by_rule(x, y):
            return True
        if (self.evidence or self.through) and self._follows(x, y):
            return True
        self.denied.add(x)
        self.denied.add(y)
        return False

    def _follows(self, x: str, y: str) -> bool:
        """Tell whether facts show the difference, of these two or of pairs that it comes down
        to.
        """
        seen = {(x, y)}
        pending = [(x, y)]
        for pair in pending:
            for evidence in self.evidence:
                for _ in evidence.premises(*pair):
                    return True
            # What each pair comes down to may be very many pairs: beyond these the difference
            # counts as not known, which is sound.
            if len(seen) > _MAX_PAIRS:
                continue
            for counter in self.through:
                for one, other in counter.pairs(*pair):
                    if one == other or (one, other) in seen:
                        continue
                    if self.stated(one, other) or self._stated_by_rule(one, other):
                        return True
                    seen.add((one, other))
                    pending.append((one, other))
        return False

    def _stated_by_rule(self, x: str, y: str) -> bool:
        stated = self._apart.succ
        return y in stated.get(x, ()) or x in stated.get(y, ())

    def premises(self, x: str, y: str) -> Iterator[Premises]:
        """Yield each set of facts by which two individuals differ; an empty set where it is
        stated.
        """
        if x == y:
            return
        if self.stated(x, y):
            yield ()
        for one, other in ((x, y), (y, x)):
            if other in self._apart.succ.get(one, ()):
                yield ((self._apart, one, other),)
        for evidence in (*self.evidence, *self.through):
            yield from evidence.premises(x, y)


class DisjointClassEvidence:
    """Members of disjoint classes differ."""

    def __init__(self, predicates: Iterable[Predicate]) -> None:
        self._predicates = predicates

    def premises(self, x: str, y: str) -> Iterator[Premises]:
        for predicate in self._predicates:
            if x in predicate.members:
                for other in predicate.disjoint:
                    if y in other.members:
                        yield ((predicate, x), (other, y))


class IrreflexiveEvidence:
    """What is related by a property that relates nothing to itself differs."""

    def __init__(self, predicate: Predicate) -> None:
        self._predicate = predicate

    def premises(self, x: str, y: str) -> Iterator[Premises]:
        for one, other in ((x, y), (y, x)):
            if other in self._predicate.succ.get(one, ()):
                yield ((self._predicate, one, other),)


class AsymmetricEvidence:
    """If a is related to x and y to a by an asymmetric property, x and y differ."""

    def __init__(self, predicate: Predicate) -> None:
        self._predicate = predicate

    def premises(self, x: str, y: str) -> Iterator[Premises]:
        predicate = self._predicate
        for one, other in ((x, y), (y, x)):
            for middle in _shared(predicate.pred.get(one), predicate.succ.get(other)):
                yield ((predicate, middle, one), (predicate, other, middle))


class DisjointPropertyEvidence:
    """Two individuals that stand in disjoint properties to the same third differ.

    `turned` says that the second property is read backwards. A negated assertion is such a property
    too.
    """

    def __init__(self, first: Predicate, second: Predicate, turned: bool) -> None:
        self._first, self._second, self._turned = first, second, turned

    def premises(self, x: str, y: str) -> Iterator[Premises]:
        first, second = self._first, self._second
        if first.kind == 'object':
            for ours in _among(first, x, y):
                for theirs in _among(second, x, y):
                    yield (ours, theirs)
        if self._turned:
            of_subject, of_value = second.pred, second.succ
        else:
            of_subject, of_value = second.succ, second.pred
        for one, other in ((x, y), (y, x)):
            for value in _shared(first.succ.get(one), of_subject.get(other)):
                fact = (second, value, other) if self._turned else (second, other, value)
                yield ((first, one, value), fact)
            if first.kind == 'object':
                for subject in _shared(first.pred.get(one), of_value.get(other)):
                    fact = (second, other, subject) if self._turned else (second, subject, other)
                    yield ((first, subject, one), fact)


def _shared(some: Mapping[Any, None] | None, others: Mapping[Any, None] | None) -> list[Any]:
    if not some or not others:
        return []
    few, many = (some, others) if len(some) < len(others) else (others, some)
    return [one for one in few if one in many]


def _among(predicate: Predicate, x: str, y: str) -> Iterator[Fact]:
    """Yield facts that relate the two, or one of them to itself: loops, were they one."""
    for subject in (x, y):
        values = predicate.succ.get(subject, ())
        for value in (x, y):
            if value in values:
                yield (predicate, subject, value)


def cliques(
    items: list[str], size: int, different: Callable[[str, str], bool], budget: int = 20_000
) -> Iterator[list[str]]:
    """Yield each choice of `size` items that are pairwise different, until `budget` items were
    tried.
    """
    chosen: list[str] = []
    places = [0]
    while places and budget > 0:
        place = places[-1]
        if place > len(items) - (size - len(chosen)):
            places.pop()
            if chosen:
                chosen.pop()
                places[-1] += 1
            continue
        budget -= 1
        item = items[place]
        if all(different(item, other) for other in chosen):
            chosen.append(item)
            if len(chosen) < size:
                places.append(place + 1)
                continue
            yield list(chosen)
            chosen.pop()
        places[-1] += 1


def clique(items: list[str], size: int, different: Callable[[str, str], bool]) -> list[str] | None:
    """Return the first of `cliques`; None where there is none."""
    return next(cliques(items, size, different), None)
