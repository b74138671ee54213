"""What the engine leaves open: conclusions that would need reasoning by cases.

Whether two individuals are the same may be unknown. Where a count or a rule depends on it, both
cases could have a consequence in common, which the engine does not derive. It is found out when it
is asked for, from the facts that hold then.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from surveillance_ontology.owl.axiom_text import axiom_text
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.vocabulary import local_name
from surveillance_ontology.reasoner.cardinality import AtLeastCounter, AtMostCounter
from surveillance_ontology.reasoner.clauses import (
    AtLeast,
    Clause,
    Constant,
    DifferentAtom,
    Existential,
    Predicate,
    PredicateAtom,
    Program,
    RangeAtom,
    StoppedError,
    closure,
)
from surveillance_ontology.reasoner.joins import JoinContext, compile_call
from surveillance_ontology.reasoner.value_sets import EVERY, NONE, ValueSet, point

_MOST_COMPARED = 20_000
"""Where so many values are possible, those that are known leave one."""


class OpenCases:
    """Finds the axioms whose consequences are open.

    Args:
        program: What the engine runs.
        context: The engine's tables.
        lower, upper: The engine's counters.
    """

    def __init__(
        self,
        program: Program,
        context: JoinContext,
        lower: list[AtLeastCounter],
        upper: list[AtMostCounter],
    ) -> None:
        self._program, self._context = program, context
        self._lower = [counter for counter in lower if not counter.is_data]
        self._upper = [counter for counter in upper if not counter.is_data and counter.n > 1]
        self._clauses = [
            clause
            for clause in program.clauses
            if any(isinstance(atom, DifferentAtom) for atom in clause.body)
        ]

    def sentences(self) -> Iterator[str]:
        """Yield one sentence for each axiom, with an individual for which it is open."""
        for counter in self._lower:
            for z in counter.succ:
                if z not in counter.head.members and len(counter.related(z)) >= counter.n:
                    yield _sentence(counter.origin, z)
                    break
        for limit in self._upper:
            members = limit.succ if limit.label is None else limit.label.members
            for z in members:
                if len(limit.related(z)) > limit.n and z not in self._program.nothing.members:
                    yield _sentence(limit.origin, z)
                    break
        for existential, least in self._program.meetings:
            for z in existential.label.members:
                if z not in least.head.members and self._may_add(existential, least, z):
                    yield _sentence(least.origin, z)
                    break
        for clause in self._clauses:
            name = self._open_instance(clause)
            if name is not None:
                yield _sentence(clause.origin, name)

    def _may_add(self, existential: Existential, least: AtLeast, z: str) -> bool:
        """Tell whether what must exist could complete a count, and is not there by name."""
        known = _related(least.prop, least.inverse, z)
        if not known or len(known) + existential.n < least.n:
            return False
        witnesses = _related(existential.prop, existential.inverse, z)
        filler = existential.filler
        if isinstance(filler, ValueSet):
            witnesses = {value for value in witnesses if filler.contains(value)}
        elif filler is not None:
            witnesses = witnesses & filler.members.keys()
        return len(witnesses) < existential.n

    def _open_instance(self, clause: Clause) -> str | None:
        apart = [atom.terms for atom in clause.body if isinstance(atom, DifferentAtom)]
        rest = [atom for atom in clause.body if not isinstance(atom, DifferentAtom)]
        terms = list(dict.fromkeys(t for atom in (*clause.body, clause.head) for t in atom.terms))
        bound = {t for atom in rest for t in atom.terms}
        if any(not isinstance(t, Constant) and t not in bound for t in terms):
            return None
        different, names = self._context.different, self._context.representative
        found: list[str] = []

        def look(*values: Any) -> None:
            given = {
                t: names.get(v, v) if isinstance(v, str) else v
                for t, v in zip(terms, values, strict=True)
            }
            pairs = [(given[one], given[other]) for one, other in apart]
            if any(one == other for one, other in pairs):
                return
            if all(different(one, other) for one, other in pairs):
                return
            arguments = tuple(given[term] for term in clause.head.terms)
            head = clause.head
            if isinstance(head, PredicateAtom):
                if head.predicate.holds((head.predicate, *arguments)):
                    return
            elif arguments[0] == arguments[1]:
                return
            found.append(next(iter(pairs[0])))
            raise StoppedError

        try:
            compile_call(self._context, rest, None, (), terms, look)()
        except StoppedError:
            return found[0]
        return None


def values_may_split(program: Program) -> bool:
    """Tell whether it may matter which of its values a data property has that must have some.

    It does not where a value is left that no clause asks for: then what follows of it follows of
    any. Ranges are taken together here, whoever they hold for.
    """
    above: dict[Predicate, list[Predicate]] = {}
    asked: dict[Predicate, ValueSet] = {}
    excluded: dict[Predicate, ValueSet] = {}
    compared: set[Predicate] = set()
    for clause in program.clauses:
        atoms = [atom for atom in clause.body if isinstance(atom, PredicateAtom)]
        links = [atom for atom in atoms if atom.predicate.kind == 'data']
        if clause.named_only or not links:
            continue
        if len(links) > 1:
            compared.update(link.predicate for link in links)
            continue
        prop, (_, value) = links[0].predicate, links[0].terms
        head = clause.head.predicate if isinstance(clause.head, PredicateAtom) else None
        if head is not None and head.kind == 'data' and clause.head.terms[1] == value:
            above.setdefault(prop, []).append(head)
        values = point(value.value) if isinstance(value, Constant) else EVERY
        for atom in clause.body:
            if isinstance(atom, RangeAtom):
                values &= atom.values
        if values is not EVERY:
            table = excluded if head is program.nothing else asked
            table[prop] = table.get(prop, NONE) | values
    for existential in program.existentials:
        if isinstance(existential.filler, ValueSet):
            props = closure(existential.prop, lambda one: above.get(one, ()))
            left = existential.filler
            for prop in props:
                left &= ~excluded.get(prop, NONE)
            if left.size <= _MOST_COMPARED and not compared.isdisjoint(props):
                return True
            for prop in props:
                left &= ~asked.get(prop, NONE)
            if left.size < existential.n and any(prop in asked for prop in props):
                return True
    return False


def _related(prop: Predicate, inverse: bool, z: str) -> set[Any]:
    return set((prop.pred if inverse else prop.succ).get(z, ()))


def _sentence(origin: Axiom | None, name: str) -> str:
    subject = 'the ontology' if origin is None else axiom_text(origin)
    return (
        f'{subject}: for {local_name(name)} it depends on which individuals are the same,'
        ' which would need reasoning by cases'
    )
