"""From a running program to another one: which clauses come and go, where nothing else differs.

An engine that holds 100,000 facts need not derive them anew because one class came below another.
Classes may become disjoint, and upper bounds may come, or cease to be. What is more than that (a
lower bound, a key, ...) is watched by objects that count what they saw from the beginning; where
such a part differs, the engine is made anew.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, fields
from typing import Any, TypeVar

from owl_reasoner.reasoner.clauses import (
    AtMost,
    BodyAtom,
    Clause,
    ComputedAtom,
    Existential,
    HeadAtom,
    Predicate,
    PredicateAtom,
    Program,
    RangeAtom,
    SameAtom,
    Term,
    with_predicates,
)
from owl_reasoner.reasoner.threshold_rules import split_rule

_Key = Hashable
_Pair = tuple[Predicate, Predicate]
_Rename = Callable[[Predicate], Predicate]
_N = TypeVar('_N')


@dataclass(frozen=True)
class ProgramChange:
    """What turns a running program into another one.

    Attributes:
        program: The other one; it has predicates of its own.
        removed: Clauses of the running program that go.
        clauses: All that it is to have afterwards, in its own predicates.
        added: Those of them that come.
        parted, joined: Pairs of classes, in the running program's predicates, that come to be
            disjoint, or cease to be.
        limits: The upper bounds that there are afterwards; those that stay are the same objects.
        existentials, meetings: As in `Program`, in the running program's predicates.
        predicate: Gives the running program's predicate for one of the other's.
    """

    program: Program
    removed: list[Clause]
    clauses: list[Clause]
    added: list[Clause]
    parted: list[_Pair]
    joined: list[_Pair]
    limits: list[AtMost]
    existentials: list[Existential]
    meetings: list[Any]
    predicate: Callable[[Predicate], Predicate]

    def apply(self, running: Program) -> None:
        """Give the running program all that the other one has; predicates with facts stay."""
        wanted = self.program
        running.classes = self._table(running.classes, wanted.classes)
        running.objects = self._table(running.objects, wanted.objects)
        running.datas = self._table(running.datas, wanted.datas)
        running.labels = self._table(running.labels, wanted.labels)
        running.required = wanted.required
        running.clauses, running.existentials = self.clauses, self.existentials
        running.at_most = self.limits
        running.meetings, running.unsupported = self.meetings, wanted.unsupported

    def _table(self, mine: dict[_N, Predicate], wanted: dict[_N, Predicate]) -> dict[_N, Predicate]:
        filled = {name: one for name, one in mine.items() if one.members or one.succ}
        return {**filled, **{name: self.predicate(one) for name, one in wanted.items()}}


def program_change(running: Program, wanted: Program) -> ProgramChange | None:
    """Return what is to be done to a running program; None where it takes a new engine."""
    mine = _Predicates(running, wanted)
    if _rest(running, _itself) != _rest(wanted, mine):
        return None
    present: dict[_Key, list[Clause]] = {}
    for clause in running.clauses:
        present.setdefault(_clause_key(clause, _itself), []).append(clause)
    clauses: list[Clause] = []
    added: list[Clause] = []
    for key, clause in {_clause_key(clause, mine): clause for clause in wanted.clauses}.items():
        same = present.pop(key, None)
        if same is None:
            same = [with_predicates(clause, mine)]
            added += same
        clauses += same
    removed = [clause for gone in present.values() for clause in gone]
    if any(isinstance(c.head, SameAtom) or split_rule(c) is not None for c in (*removed, *added)):
        return None
    kept = {_record_key(limit, _itself): limit for limit in running.at_most}
    limits = [
        kept.get(_record_key(limit, mine)) or with_predicates(limit, mine)
        for limit in wanted.at_most
    ]
    before = _disjoint(running, _itself)
    after = _disjoint(wanted, mine)
    for one in wanted.predicates():
        if mine(one) is one:
            one.disjoint = set()  # The running engine fills it, in its own predicates.
    return ProgramChange(
        wanted,
        removed,
        clauses,
        added,
        [pair for pair in after if pair not in before and pair[::-1] not in before],
        [pair for pair in before if pair not in after and pair[::-1] not in after],
        limits,
        [with_predicates(existential, mine) for existential in wanted.existentials],
        [tuple(with_predicates(one, mine) for one in pair) for pair in wanted.meetings],
        mine,
    )


class _Predicates:
    """Gives the running program's predicate for one of a wanted program.

    Where it has none, the wanted program's own is taken, from then on.
    """

    def __init__(self, running: Program, wanted: Program) -> None:
        self._fixed = {getattr(wanted, name): getattr(running, name) for name in _FIXED}
        self._known = {(one.kind, one.expression): one for one in _named(running)}
        negatives = {self(prop): negative for prop, negative in running.negatives.items()}
        for prop, negative in wanted.negatives.items():
            self._fixed[negative] = negatives.get(self(prop), negative)

    def __call__(self, predicate: Predicate) -> Predicate:
        fixed = self._fixed.get(predicate)
        return fixed or self._known.setdefault((predicate.kind, predicate.expression), predicate)


_FIXED = ('thing', 'nothing', 'apart', 'same')


def _itself(predicate: Predicate) -> Predicate:
    return predicate


def _named(program: Program) -> Iterator[Predicate]:
    """Yield the predicates that stand for an expression."""
    atoms = (atom for clause in program.clauses for atom in (*clause.body, clause.head))
    used = (atom.predicate for atom in atoms if isinstance(atom, PredicateAtom))
    return (one for one in (*program.predicates(), *used) if one.expression is not None)


# --- keys: equal for what is the same in two programs ---


def _clause_key(clause: Clause, predicate: _Rename) -> _Key:
    """Return the clause with its variables numbered as they come; its axiom is part of it."""
    numbers: dict[int, int] = {}

    def term(term: Term) -> _Key:
        return numbers.setdefault(term, len(numbers)) if isinstance(term, int) else term

    def atom(atom: BodyAtom | HeadAtom) -> _Key:
        terms = tuple(map(term, atom.terms))
        if isinstance(atom, PredicateAtom):
            return (predicate(atom.predicate), terms)
        if isinstance(atom, RangeAtom):
            return (atom.values, terms)
        if isinstance(atom, ComputedAtom):
            return (atom.builtin, terms)
        return (type(atom), terms)

    body = tuple(map(atom, clause.body))
    return (body, atom(clause.head), clause.origin, clause.named_only)


def _record_key(record: Any, predicate: _Rename) -> _Key:
    """Return a condition by its parts."""
    return tuple(_value_key(getattr(record, entry.name), predicate) for entry in fields(record))


def _value_key(value: Any, predicate: _Rename) -> Any:
    if isinstance(value, tuple):
        return tuple(_value_key(part, predicate) for part in value)
    return predicate(value) if isinstance(value, Predicate) else value


def _rest(program: Program, predicate: _Rename) -> _Key:
    """Return all but clauses and what serves the classification alone."""
    return (
        program.uses_thing,
        tuple(_record_key(condition, predicate) for condition in program.at_least),
        tuple(_record_key(key, predicate) for key in program.keys),
        tuple(map(predicate, program.irreflexive)),
        tuple(map(predicate, program.asymmetric)),
        tuple(_value_key(pair, predicate) for pair in program.disjoint_properties),
        frozenset(map(predicate, program.negatives.values())),
    )


def _disjoint(program: Program, predicate: Callable[[Predicate], Predicate]) -> dict[_Pair, None]:
    """Return each pair of disjoint classes once."""
    found: dict[_Pair, None] = {}
    for one in program.predicates():
        for other in one.disjoint:
            pair = predicate(one), predicate(other)
            if pair[::-1] not in found:
                found[pair] = None
    return found
