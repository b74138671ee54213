"""From a running program to another one: which clauses come and go, where nothing else differs.

An engine that holds 100,000 facts need not derive them anew because one class came below another.
Classes may become disjoint, and upper bounds may come, or cease to be. What is more than that (a
lower bound, a key, ...) is watched by objects that count what they saw from the beginning; where
such a part differs, the engine is made anew.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from surveillance_ontology.reasoner.clauses import (
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
)
from surveillance_ontology.reasoner.threshold_rules import split_rule

_Key = Hashable
_Pair = tuple[Predicate, Predicate]
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
    old, new = _Keys(running), _Keys(wanted)
    if old.rest() != new.rest():
        return None
    present: dict[_Key, list[Clause]] = {}
    for clause in running.clauses:
        present.setdefault(old.clause(clause), []).append(clause)
    of_running = _Translation(running, old, new)
    clauses: list[Clause] = []
    added: list[Clause] = []
    for key, clause in {new.clause(clause): clause for clause in wanted.clauses}.items():
        same = present.pop(key, None)
        if same is None:
            same = [of_running.record(clause)]
            added += same
        clauses += same
    removed = [clause for gone in present.values() for clause in gone]
    if any(isinstance(c.head, SameAtom) or split_rule(c) is not None for c in (*removed, *added)):
        return None
    kept = {old.record(limit): limit for limit in running.at_most}
    limits = [kept.get(new.record(limit)) or of_running.record(limit) for limit in wanted.at_most]
    before = _disjoint(running, lambda one: one)
    after = _disjoint(wanted, of_running.predicate)
    for one in wanted.predicates():
        if of_running.predicate(one) is one:
            one.disjoint = set()  # The running engine fills it, in its own predicates.
    return ProgramChange(
        wanted,
        removed,
        clauses,
        added,
        [pair for pair in after if pair not in before and pair[::-1] not in before],
        [pair for pair in before if pair not in after and pair[::-1] not in after],
        limits,
        [of_running.record(existential) for existential in wanted.existentials],
        [tuple(map(of_running.record, pair)) for pair in wanted.meetings],
        of_running.predicate,
    )


class _Keys:
    """Names the parts of one program so that equal ones of another have equal names."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._fixed: dict[Predicate, _Key] = {
            program.thing: 'thing',
            program.nothing: 'nothing',
            program.apart: 'apart',
            program.same: 'same',
        }
        for prop, negative in program.negatives.items():
            self._fixed[negative] = ('not', prop.kind, prop.expression)

    def predicate(self, predicate: Predicate) -> _Key:
        """Return what the predicate stands for."""
        return self._fixed.get(predicate) or (predicate.kind, predicate.expression)

    def clause(self, clause: Clause) -> _Key:
        """Return the clause with its variables numbered as they come; its axiom is part of it."""
        numbers: dict[int, int] = {}

        def term(term: Term) -> _Key:
            return numbers.setdefault(term, len(numbers)) if isinstance(term, int) else term

        def atom(atom: BodyAtom | HeadAtom) -> _Key:
            terms = tuple(map(term, atom.terms))
            if isinstance(atom, PredicateAtom):
                return (self.predicate(atom.predicate), terms)
            if isinstance(atom, RangeAtom):
                return (atom.values, terms)
            if isinstance(atom, ComputedAtom):
                return ('computed', atom.builtin, terms)
            return (type(atom), terms)

        body = tuple(map(atom, clause.body))
        return (body, atom(clause.head), clause.origin, clause.named_only)

    def rest(self) -> _Key:
        """Return all but clauses and what serves the classification alone."""
        program, predicate = self._program, self.predicate
        return (
            program.uses_thing,
            tuple(map(self.record, program.at_least)),
            tuple(map(self.record, program.keys)),
            tuple(map(predicate, program.irreflexive)),
            tuple(map(predicate, program.asymmetric)),
            tuple(map(self._value, program.disjoint_properties)),
            frozenset(map(predicate, program.negatives.values())),
        )

    def record(self, record: Any) -> _Key:
        """Return a condition by its parts."""
        return tuple(self._value(getattr(record, entry.name)) for entry in fields(record))

    def _value(self, value: Any) -> Any:
        if isinstance(value, Predicate):
            return self.predicate(value)
        if isinstance(value, tuple):
            return tuple(map(self._value, value))
        return value


class _Translation:
    """Writes parts of a wanted program in the predicates of the running one."""

    def __init__(self, running: Program, old: _Keys, new: _Keys) -> None:
        self._known = {old.predicate(one): one for one in _all(running)}
        self._key = new.predicate

    def predicate(self, predicate: Predicate) -> Predicate:
        """Return the running program's predicate; where it has none, this one from now on."""
        return self._known.setdefault(self._key(predicate), predicate)

    def record(self, record: Any) -> Any:
        """Return a clause, an atom or a condition, rewritten."""
        changed: dict[str, Any] = {}
        for entry in fields(record):
            value = getattr(record, entry.name)
            if isinstance(value, Predicate):
                changed[entry.name] = self.predicate(value)
            elif entry.name == 'body':
                changed['body'] = tuple(map(self.record, value))
            elif entry.name == 'head':
                changed['head'] = self.record(value)
        return replace(record, **changed) if changed else record


def _disjoint(program: Program, predicate: Callable[[Predicate], Predicate]) -> dict[_Pair, None]:
    """Return each pair of disjoint classes once."""
    found: dict[_Pair, None] = {}
    for one in program.predicates():
        for other in one.disjoint:
            pair = predicate(one), predicate(other)
            if pair[::-1] not in found:
                found[pair] = None
    return found


def _all(program: Program) -> Iterable[Predicate]:
    yield program.same
    yield from program.predicates()
    for clause in program.clauses:
        for atom in (*clause.body, clause.head):
            if isinstance(atom, PredicateAtom):
                yield atom.predicate
