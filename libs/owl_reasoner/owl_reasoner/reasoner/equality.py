"""Which individuals are known to be the same or would have to be, and what justifies that."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.vocabulary import is_anonymous
from owl_reasoner.reasoner.clauses import Fact, Premises


@dataclass(frozen=True, slots=True)
class Merge:
    """Two individuals found to be the same, by an axiom applied to facts."""

    first: str
    second: str
    origin: Axiom | None
    premises: Premises


def individuals_in(fact: Fact) -> tuple[str, ...]:
    """Return the individuals that a fact is about."""
    return fact[1:2] if fact[0].kind == 'data' else fact[1:]


class Conflicts:
    """Merges of individuals that are known to be different, found by the individuals that they
    mention.
    """

    def __init__(self) -> None:
        self._mentioning: dict[str, dict[Merge, None]] = {}

    def __bool__(self) -> bool:
        return bool(self._mentioning)

    def add(self, merge: Merge) -> None:
        """Take up a merge."""
        for name in self._mentioned(merge):
            self._mentioning.setdefault(name, {})[merge] = None

    def discard(self, merge: Merge) -> None:
        """Forget a merge."""
        for name in self._mentioned(merge):
            merges = self._mentioning[name]
            del merges[merge]
            if not merges:
                del self._mentioning[name]

    def mentioning(self, names: Iterable[str]) -> list[Merge]:
        """Return the merges of these individuals and those justified by facts about them."""
        found: dict[Merge, None] = {}
        for name in names:
            found.update(self._mentioning.get(name, {}))
        return list(found)

    def between(self, first: str, second: str) -> list[Merge]:
        """Return the merges of two individuals, as the merges name them."""
        merges = self._mentioning.get(first, ())
        return [merge for merge in merges if (merge.first, merge.second) == (first, second)]

    @staticmethod
    def _mentioned(merge: Merge) -> set[str]:
        return {merge.first, merge.second}.union(*map(individuals_in, merge.premises))


def _keys(fact: Fact) -> list[Any]:
    """Return under what those who use a premise are found: a difference under each individual."""
    return [(name,) for name in fact[1:]] if fact[0].kind == 'different' else [fact]


class Equality:
    """Classes of individuals known to be the same, each with one representative.

    Attributes:
        representative: From an individual to its representative, where that is another individual.
        members: From a representative to its class, for classes of two and more.
    """

    def __init__(self) -> None:
        self.representative: dict[str, str] = {}
        self.members: dict[str, set[str]] = {}
        self._merges: dict[str, list[Merge]] = {}
        self._used: dict[Any, set[str]] = {}

    def current(self, fact: Fact) -> Fact:
        """Return the fact with every individual under its representative's name."""
        names = self.representative
        if not names:
            return fact
        if len(fact) == 2:
            return fact[0], names.get(fact[1], fact[1])
        predicate, x, y = fact
        return predicate, names.get(x, x), y if predicate.kind == 'data' else names.get(y, y)

    def find(self, individual: str) -> str:
        """Return the representative."""
        return self.representative.get(individual, individual)

    def same(self, individual: str) -> Iterable[str]:
        """Everything that is the same as the individual, itself included."""
        representative = self.find(individual)
        return self.members.get(representative, (representative,))

    def join(self, merge: Merge) -> tuple[str, str]:
        """Join two classes; return (representative that stays, one that goes): the smaller IRI
        stays, before anonymous individuals.
        """
        pair = self.find(merge.first), self.find(merge.second)
        # Not by size, as in union-find: the name that stays is shown to users, and must not depend
        # on the order in which merges come.
        kept, gone = sorted(pair, key=lambda name: (is_anonymous(name), name))
        members = self.members.setdefault(kept, {kept})
        joining = self.members.pop(gone, {gone})
        members |= joining
        for individual in joining:
            self.representative[individual] = kept
        # The merges themselves are kept, not only their result: a class is explained, and split, by
        # them.
        merges = self._merges.setdefault(kept, [])
        merges += self._merges.pop(gone, ())
        merges.append(merge)
        for fact in merge.premises:
            for key in _keys(fact):
                self._used.setdefault(key, set()).add(merge.first)
        return kept, gone

    def split(self, representative: str) -> set[str]:
        """Have every member of the class stand for itself again; return the members."""
        # The whole class, not the part that rested on what went: which members would stay together
        # is found by merging them again, by what still holds.
        members = self.members.pop(representative)
        for individual in members:
            self.representative.pop(individual, None)
        for merge in self._merges.pop(representative, ()):
            for key in (key for fact in merge.premises for key in _keys(fact)):
                users = self._used.get(key)
                if users is not None:
                    users.discard(merge.first)
                    if not users:
                        del self._used[key]
        return members

    def dependents(self, fact: Fact) -> set[str]:
        """Return representatives of the classes whose justification uses a fact, or that the fact
        mentions.
        """
        found: set[str] = set()
        for argument in individuals_in(fact):
            if argument in self.members:
                found.add(argument)
        if self._used:
            # A merge names its premises as they were written then; by now the fact may stand under
            # another name.
            for written in self._spellings(fact):
                for individual in self._used.get(written, ()):
                    found.add(self.find(individual))
        return {name for name in found if name in self.members}

    def resting_on_difference(self, individual: str) -> set[str]:
        """Return representatives of the classes whose justification uses a difference from an
        individual.
        """
        names = self.same(individual) if self._used else ()
        return {self.find(user) for name in names for user in self._used.get((name,), ())}

    def _spellings(self, fact: Fact) -> Iterator[Fact]:
        """Yield the fact with each merged individual in every of its names."""
        yield fact
        for position in range(1, len(fact)):
            argument = fact[position]
            if isinstance(argument, str) and argument in self.members:
                for name in self.members[argument]:
                    yield (*fact[:position], name, *fact[position + 1 :])
                    if len(fact) == 3 and position == 1 and fact[2] in self.members:
                        for other in self.members[fact[2]]:
                            yield (fact[0], name, other)

    def path(self, first: str, second: str) -> list[Merge]:
        """Return the merges that lead from one member of a class to another."""
        merges = self._merges.get(self.find(first), [])
        came: dict[str, Merge | None] = {first: None}
        origin: dict[str, str] = {}
        # Breadth first: the shortest chain of merges is the explanation that is read.
        pending = [first]
        while pending and second not in came:
            here = pending.pop(0)
            for merge in merges:
                for one, other in ((merge.first, merge.second), (merge.second, merge.first)):
                    if one == here and other not in came:
                        came[other], origin[other] = merge, one
                        pending.append(other)
        path: list[Merge] = []
        here = second
        while here != first and here in came:
            merge_here = came[here]
            assert merge_here is not None
            path.append(merge_here)
            here = origin[here]
        return path[::-1]
