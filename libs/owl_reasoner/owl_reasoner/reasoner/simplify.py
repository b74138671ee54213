"""Makes a program smaller without changing what it derives.

Three steps: a label that exactly one class stands for is replaced by the class; clauses whose
labels nothing can reach, or whose results nothing can see, go; and an atom of a body that the other
atoms imply goes, so that `LOCATION(?l), visitedAt(?l, ?v)` becomes `visitedAt(?l, ?v)` where
LOCATION is the domain of visitedAt.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TypeVar

from owl_reasoner.reasoner.clauses import (
    AtLeast,
    AtMost,
    BodyAtom,
    Clause,
    Predicate,
    PredicateAtom,
    Program,
    closure,
    with_predicates,
)

Condition = TypeVar('Condition', AtLeast, AtMost)


def simplify(program: Program, asserted: Iterable[Predicate]) -> None:
    """Simplifies in place; `asserted` are labels that individuals are asserted to belong to."""
    kept = set(asserted)
    program.clauses = list(dict.fromkeys(program.clauses))
    # Aliases first: a label that became a class lets the other steps see what implies what.
    _replace_aliases(program, kept)
    _prune(program, kept)
    drop_implied_atoms(program)
    program.clauses = list(dict.fromkeys(program.clauses))


def _is_label(predicate: Predicate) -> bool:
    return predicate.kind == 'class' and not isinstance(predicate.expression, str | None)


def _source(clause: Clause) -> PredicateAtom | None:
    """Return the body of a clause that only passes members of a class on; None for any other
    clause.
    """
    if len(clause.body) != 1:
        return None
    (atom,) = clause.body
    passes = isinstance(atom, PredicateAtom) and atom.predicate.kind == 'class'
    return atom if passes and atom.terms == clause.head.terms else None  # type: ignore[return-value]


def _replace_aliases(program: Program, kept: set[Predicate]) -> None:
    while True:
        producers: dict[Predicate, list[Clause]] = {}
        for clause in program.clauses:
            if isinstance(clause.head, PredicateAtom) and _is_label(clause.head.predicate):
                producers.setdefault(clause.head.predicate, []).append(clause)
        counted = {condition.head for condition in program.at_least}
        alias: dict[Predicate, Predicate] = {}
        for label, clauses in producers.items():
            # With two producers the label is a union; one that assertions use, that is counted or
            # that excludes something has a meaning beyond its clause.
            if len(clauses) != 1 or label in kept or label in counted or label.disjoint:
                continue
            (clause,) = clauses
            atom = _source(clause)
            if atom is None or atom.predicate is label or atom.predicate in alias:
                continue
            # A rule holds for named individuals alone, so its label is less than the class.
            if clause.named_only or atom.predicate in (program.thing, program.nothing):
                continue
            # No chains of aliases in one pass: the next one takes the rest.
            if label not in alias.values():
                alias[label] = atom.predicate
        if not alias:
            return
        _substitute(program, alias)


def _substitute(program: Program, alias: dict[Predicate, Predicate]) -> None:
    def other(predicate: Predicate) -> Predicate:
        return alias.get(predicate, predicate)

    clauses: dict[Clause, None] = {}
    for clause in (with_predicates(clause, other) for clause in program.clauses):
        body = tuple(dict.fromkeys(clause.body))
        if clause.head not in body:
            clauses[clause if len(body) == len(clause.body) else replace(clause, body=body)] = None
    program.clauses = list(clauses)
    program.at_least = [with_predicates(condition, other) for condition in program.at_least]
    program.at_most = [with_predicates(condition, other) for condition in program.at_most]
    program.keys = [with_predicates(key, other) for key in program.keys]
    program.existentials = [with_predicates(one, other) for one in program.existentials]
    program.labels = {expression: other(label) for expression, label in program.labels.items()}


def _prune(program: Program, kept: set[Predicate]) -> None:
    while True:
        # Pruned from both ends: forwards from what assertions can state, backwards from what
        # queries can see, until nothing goes.
        reached = set(kept) | {condition.head for condition in program.at_least}
        consumed: set[Predicate] = set()
        for clause in program.clauses:
            if isinstance(clause.head, PredicateAtom):
                reached.add(clause.head.predicate)
            consumed.update(a.predicate for a in clause.body if isinstance(a, PredicateAtom))
        conditions: list[AtLeast | AtMost] = [*program.at_least, *program.at_most]
        for condition in conditions:
            if isinstance(condition.filler, Predicate):
                consumed.add(condition.filler)
            if isinstance(condition, AtMost) and condition.label is not None:
                consumed.add(condition.label)
        consumed.update(key.cls for key in program.keys if key.cls is not None)
        consumed.update(existential.label for existential in program.existentials)

        def lives(predicate: Predicate, seen: set[Predicate]) -> bool:
            return predicate in seen or bool(predicate.disjoint) or not _is_label(predicate)

        before = len(program.clauses) + len(program.at_least)
        program.clauses = [
            clause
            for clause in program.clauses
            if all(
                lives(atom.predicate, reached)
                for atom in clause.body
                if isinstance(atom, PredicateAtom)
            )
            and (
                not isinstance(clause.head, PredicateAtom) or lives(clause.head.predicate, consumed)
            )
        ]
        program.at_least = [
            condition for condition in program.at_least if lives(condition.head, consumed)
        ]
        program.at_most = [
            condition
            for condition in program.at_most
            if condition.label is None or lives(condition.label, reached)
        ]
        program.existentials = [
            existential for existential in program.existentials if lives(existential.label, reached)
        ]
        if len(program.clauses) + len(program.at_least) == before:
            return


class _Implications:
    """The facts that clauses with one atom as body derive from others."""

    def __init__(self, clauses: Iterable[Clause]) -> None:
        self._clauses: dict[Predicate, list[tuple[PredicateAtom, PredicateAtom]]] = {}
        self._consequences: dict[PredicateAtom, dict[PredicateAtom, None]] = {}
        for clause in clauses:
            if len(clause.body) != 1 or clause.named_only:
                continue
            body, head = clause.body[0], clause.head
            if isinstance(body, PredicateAtom) and isinstance(head, PredicateAtom):
                # A clause about the same individual twice, or about a certain one, says less than
                # its predicates.
                terms = body.terms
                if all(isinstance(term, int) for term in terms) and len(set(terms)) == len(terms):
                    self._clauses.setdefault(body.predicate, []).append((body, head))

    def imply(self, atoms: Iterable[BodyAtom], wanted: BodyAtom) -> bool:
        """Tell whether one of the atoms alone has the wanted one as consequence."""
        facts = (atom for atom in atoms if isinstance(atom, PredicateAtom))
        return any(wanted in self._of(atom) for atom in facts)

    def _of(self, atom: PredicateAtom) -> dict[PredicateAtom, None]:
        if atom not in self._consequences:
            self._consequences[atom] = closure(atom, self._following)
        return self._consequences[atom]

    def _following(self, atom: PredicateAtom) -> Iterator[PredicateAtom]:
        for body, head in self._clauses.get(atom.predicate, ()):
            binding = dict(zip(body.terms, atom.terms, strict=True))
            terms = tuple(binding.get(term, term) for term in head.terms)
            yield PredicateAtom(head.predicate, terms)


def drop_implied_atoms(program: Program) -> None:
    """Leave out of each body what its other atoms imply."""
    implications = _Implications(program.clauses)
    clauses = []
    for clause in program.clauses:
        body = list(clause.body)
        for atom in clause.body:
            if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'class' and len(body) > 1:
                # From what is left, not from the whole body: two atoms that imply each other would
                # both go.
                rest = [other for other in body if other is not atom]
                if implications.imply(rest, atom):
                    body = rest
        if len(body) > 1 or clause.head not in body:
            clauses.append(replace(clause, body=tuple(body)))
    program.clauses = clauses

    def without_filler(condition: Condition) -> Condition:
        if isinstance(condition.filler, Predicate) and condition.prop.kind == 'object':
            link = PredicateAtom(condition.prop, (1, 0) if condition.inverse else (0, 1))
            if implications.imply([link], PredicateAtom(condition.filler, (1,))):
                return replace(condition, filler=None)
        return condition

    program.at_least = list(map(without_filler, program.at_least))
    program.at_most = list(map(without_filler, program.at_most))
