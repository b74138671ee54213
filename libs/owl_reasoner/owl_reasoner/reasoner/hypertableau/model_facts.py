"""Reads what named individuals are in a model, and on which choices that rests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import THING, TOP
from owl_reasoner.reasoner.datatypes import literal_of
from owl_reasoner.reasoner.hypertableau.dl_clauses import DLClauses
from owl_reasoner.reasoner.hypertableau.model import Choices
from owl_reasoner.reasoner.hypertableau.search import CaseSearch

_UNSURE = ~0
"""All choices: those of a fact that a model only hints at, so that it is asked for."""
CLASSES, VALUES, RELATIONS, EVERY_KIND = 1, 2, 4, 7
"""Kinds of facts about an individual, as bits; who is the same counts as a relation."""
Held: TypeAlias = tuple[Axiom, Choices]
"""A fact, and the choices that it depends on."""


def kind_of(fact: Axiom) -> int:
    """Return of which kind a fact is."""
    if isinstance(fact, ax.ClassAssertion):
        return CLASSES
    return VALUES if isinstance(fact, ax.DataPropertyAssertion) else RELATIONS


class ModelFacts:
    """The facts of the model that a search has found.

    Args:
        rules: Whose model it is.
        search: Has it.
    """

    def __init__(self, rules: DLClauses, search: CaseSearch) -> None:
        self._rules, self._search = rules, search
        # The steps from each state of what accepts a property's chains.
        self._automata: dict[str, dict[int, list[tuple[int | None, int]]]] = {}

    def all(self) -> Iterator[Held]:
        """Yield every fact about named individuals."""
        model = self._search.model
        for x in [x for x in model.alive() if model.names[x]]:
            yield from self.about(x)

    def about(self, x: int, kinds: int = EVERY_KIND) -> Iterator[Held]:
        """Yield the facts, of some kinds, whose subject is one named individual, under each of its
        names.
        """
        model = self._search.model
        for name in model.names[x]:
            _, owner = model.individual(name)
            for cls, choices in self._classes(x) if kinds & CLASSES else ():
                yield ax.ClassAssertion(cls, name), choices | owner
            for prop, literal, choices in self._literals(x) if kinds & VALUES else ():
                yield ax.DataPropertyAssertion(prop, name, literal), choices | owner
            if not kinds & RELATIONS:
                continue
            for other in model.names[x]:
                if name < other:
                    pair = frozenset((name, other))
                    yield ax.SameIndividual(pair), owner | model.individual(other)[1]
            for prop, y, choices in self._relations(x):
                for other in model.names[y]:
                    more = model.individual(other)[1]
                    yield ax.ObjectPropertyAssertion(prop, name, other), choices | owner | more

    def _classes(self, x: int) -> Iterator[tuple[str, Choices]]:
        for concept, choices in self._search.model.labels[x].items():
            cls = self._rules.names[concept]
            if cls and cls != THING:
                yield cls, choices

    def _literals(self, x: int) -> Iterator[tuple[str, Literal, Choices]]:
        """Return the values of an individual that are known: (property, literal, choices).

        Where a value differs from others that could be all but one of its set, each of the set may
        follow, and is asked for.
        """
        model = self._search.model
        there = model.values[x]
        for v in there:
            values, choices = model.sets[v]
            only = values.only
            for prop, more in model.props[v].items():
                if only is not None:
                    yield prop, literal_of(only), choices | more
                elif values.size <= len(there):
                    apart = sum(model.different(v, w) is not None for w in there if w != v)
                    if apart >= values.size - 1:
                        yield from ((prop, literal_of(one), _UNSURE) for one in values.members())

    def _relations(self, x: int) -> Iterator[tuple[str, int, Choices]]:
        """Return named individuals that one is related to: (property, individual, choices)."""
        model, rules = self._search.model, self._rules
        for y, roles in model.out[x].items():
            if model.names[y]:
                for role, choices in roles.items():
                    if role > 0 and not rules.roles.is_complex(rules.roles.names[role]):
                        yield rules.roles.names[role], y, choices
        if model.out[x] or x in self._search.blocked:
            for prop in rules.roles.complex_props():
                if prop != TOP:
                    yield from self._along(x, prop)

    def _along(self, x: int, prop: str) -> Iterator[tuple[str, int, Choices]]:
        """Follow a property that chains imply through the model.

        A blocked individual has the neighbours of the one in whose place it is, but not its parent:
        what is reached through these is asked for.
        """
        search, model = self._search, self._search.model
        steps = self._automata.get(prop)
        if steps is None:
            steps = self._automata[prop] = {}
            for before, step, after in self._rules.roles.steps(prop):
                steps.setdefault(before, []).append((step, after))
        reached: dict[tuple[int, int], int] = {(x, 0): 0}
        pending = [(x, 0)]
        while pending:
            place = pending.pop()
            y, state = place
            choices = reached[place]
            if state == 1 and model.names[y]:
                yield prop, y, choices
            for step, after in steps.get(state, ()):
                if step is None:
                    following = [(y, 0)]
                else:
                    following = [
                        (z, roles[step] if one == y else _UNSURE)
                        for one in {y, search.blocked.get(y, y)}
                        for z, roles in model.out[one].items()
                        if step in roles
                    ]
                for z, more in following:
                    if (z, after) not in reached:
                        reached[z, after] = choices | more
                        pending.append((z, after))
