"""Whether Horn clauses find all that follows.

The engine leaves open whether two individuals are the same, who it is that must exist, and which
value there is. Where a count, a rule or a key depends on it, all cases could have a consequence in
common, which no Horn clause says. Some of it shows in the program, the rest (`OpenCases`) in the
facts that hold. Where they do not suffice, `case_completion` adds what is missing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any, NamedTuple

from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.vocabulary import local_name
from owl_reasoner.reasoner.cardinality import AtMostCounter
from owl_reasoner.reasoner.clauses import (
    AtLeast,
    BodyAtom,
    Clause,
    ComputedAtom,
    Constant,
    DifferentAtom,
    Existential,
    Predicate,
    PredicateAtom,
    Program,
    RangeAtom,
    StoppedError,
    closure,
    turned,
)
from owl_reasoner.reasoner.engine import Engine
from owl_reasoner.reasoner.hypertableau.rule_joins import MOST_TRIED, compared
from owl_reasoner.reasoner.inequality import clique
from owl_reasoner.reasoner.joins import compile_call
from owl_reasoner.reasoner.normal_form import is_positive
from owl_reasoner.reasoner.property_chains import chains_take_cases
from owl_reasoner.reasoner.value_sets import EVERY, ValueSet, point

_MOST_COMPARED = 20_000
"""Where so many values are possible, those that are known leave one."""


class HornCompleteness:
    """Whether the Horn clauses find all that follows, for one program and the facts that hold.

    Args:
        engine: Runs the program, which stays as it is.
        has_rules: Whether there are rules of SWRL.
    """

    def __init__(self, engine: Engine, program: Program, *, has_rules: bool) -> None:
        self._engine, self._has_rules = engine, has_rules
        self._lacks = self._may_lack(program)

    @cached_property
    def _open(self) -> OpenCases:
        # Not before the engine runs the program.
        return OpenCases(self._engine)

    def takes_cases(self) -> bool:
        """Tell whether the clauses may leave something out as the facts stand.

        Where there are rules, that may take too long where it is but open who is the same.
        """
        if self._lacks or self._open.unknowns_matter():
            return True
        return not self._has_rules and next(self._open.sentences(), None) is not None

    def sentences(self) -> Iterator[str]:
        """Yield one sentence for each axiom whose consequences are open in the facts."""
        return self._open.sentences()

    def _may_lack(self, program: Program) -> bool:
        """Tell whether the clauses may leave something out without saying so.

        They do not where nothing unnamed must exist and no class requires something of a certain
        individual that matters, nor where each class that requires somebody says all by itself, no
        chain takes cases, and nothing is counted or excluded. Nor where there
        are rules, and no value that must exist is one of several that matter.
        """
        if program.unsupported or program.interacting:
            return True
        clauses = [clause for clause in program.clauses if not clause.named_only]
        named = [clause.head for clause in clauses if clause.body and names_individual(clause.head)]
        if named and not _change_nothing(named, program, clauses):
            return True  # Whether the class can have members depends on the individual.
        if not program.existentials:
            return False
        if any(names_individual(atom) for clause in clauses for atom in clause.body):
            return True
        if chains_take_cases(program):
            return True
        if self._has_rules:
            return _values_may_split(program)
        values = any(existential.prop.kind == 'data' for existential in program.existentials)
        # The states of chains stand among the labels as tuples.
        classes = (label for label in program.labels if not isinstance(label, tuple))
        return values or bool(program.at_most) or not all(map(is_positive, classes))


def _change_nothing(heads: Iterable[BodyAtom], program: Program, clauses: list[Clause]) -> bool:
    """Tell whether nothing follows from these heads but that one is related: no clause, count or
    key asks for the properties.
    """
    start: dict[Predicate, None] = {}
    for head in heads:
        if not isinstance(head, PredicateAtom) or head.predicate.kind != 'object':
            return False
        start[head.predicate] = None
    above: dict[Predicate, list[Predicate]] = {}
    asked = {least.prop for least in program.at_least}
    asked.update(most.prop for most in program.at_most)
    asked.update(prop for key in program.keys for prop, _ in key.props)
    for clause in clauses:
        asking = [atom.predicate for atom in clause.body if isinstance(atom, PredicateAtom)]
        sup = clause.head.predicate if isinstance(clause.head, PredicateAtom) else None
        alone = len(clause.body) == len(asking) == 1 and asking[0].kind == 'object'
        if alone and sup is not None and sup.kind == 'object':
            above.setdefault(asking[0], []).append(sup)
        else:
            asked.update(asking)
    return asked.isdisjoint(
        prop for one in start for prop in closure(one, lambda sub: above.get(sub, ()))
    )


def names_individual(atom: BodyAtom) -> bool:
    """Tell whether an atom is about a certain individual."""
    return any(isinstance(term, Constant) and not term.is_value for term in atom.terms)


# --- what depends on the facts ---


class OpenCases:
    """Finds the axioms whose consequences are open in the facts of an engine.

    Args:
        engine: Its program stays as it is.
    """

    def __init__(self, engine: Engine) -> None:
        program, network = engine.program, engine.network
        self._program, self._context = program, network.context
        self._unknowns = tuple(_unknowns(program))
        self._lower = [one for one in network.lower if not one.is_data]
        self._upper = [one for one in network.counters if not one.is_data and one.n > 1]
        self._filling = tuple(_filling(program, network.counters))
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
        said: list[Clause] = []
        for unknown in self._unknowns:
            rule, atom, _ = unknown.asking
            if unknown.is_decided or rule is None or rule in said:
                continue
            name = self._with_unknown(unknown)
            if name is not None:
                said.append(rule)
                what = f'a value of {local_name(atom.predicate.name)} that is not known'
                yield _sentence(rule.origin, name, what)

    def unknowns_matter(self) -> bool:
        """Tell whether reasoning by cases is needed for a rule or key that could apply by a value
        which must exist and is not known, or because somebody who must exist is one of those known.
        """
        return any(
            unknown.is_decided and self._with_unknown(unknown) is not None
            for unknown in self._unknowns
        ) or any(self._is_full(*filling) for filling in self._filling)

    def _is_full(self, limit: AtMostCounter, existentials: list[Existential]) -> bool:
        """Tell whether who must exist is for somebody one of those related, as no more may be."""
        for z in limit.succ if limit.label is None else limit.label.members:
            missing = sum(
                one.n
                for one in existentials
                if z in one.label.members and len(_witnesses(one, z)) < one.n
            )
            if missing:
                size = max(1, limit.n + 1 - missing)
                if clique(list(limit.related(z)), size, self._context.different) is not None:
                    return True
        return False

    def _with_unknown(self, unknown: _AskedValue) -> str | None:
        """Return somebody for whom a rule, or a key, could apply by such a value."""
        (clause, atom, _), existential = unknown.asking, unknown.existential
        if not existential.label.members:
            return None
        x = atom.terms[0]
        head = None if clause is None else clause.head
        found: list[str] = []

        def look(z: str) -> None:
            known = (
                isinstance(head, PredicateAtom)
                and head.terms == (x,)
                and z in head.predicate.members
            )
            if not known and len(_witnesses(existential, z)) < existential.n:
                found.append(z)
                raise StoppedError

        label = PredicateAtom(existential.label, (x,))
        try:
            compile_call(self._context, [label, *unknown.known], None, (), (x,), look)()
        except StoppedError:
            return found[0]
        return None

    def _may_add(self, existential: Existential, least: AtLeast, z: str) -> bool:
        """Tell whether what must exist could complete a count, and is not there by name."""
        known = _related(least.prop, least.inverse, z)
        if not known or len(known) + existential.n < least.n:
            return False
        return len(_witnesses(existential, z)) < existential.n

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


def _filling(
    program: Program, upper: list[AtMostCounter]
) -> Iterator[tuple[AtMostCounter, list[Existential]]]:
    """Yield each upper bound with those who must exist that it may count.

    The engine itself finds who is the only one related.
    """
    above: dict[Predicate, list[tuple[Predicate, bool]]] = {}
    for clause in program.clauses:
        atoms = [
            atom
            for atom in (*clause.body, clause.head)
            if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'object'
        ]
        if len(clause.body) == 1 and len(atoms) == 2:
            sub, sup = atoms
            above.setdefault(sub.predicate, []).append((sup.predicate, sup.terms != sub.terms))

    def following(role: tuple[Predicate, bool]) -> list[tuple[Predicate, bool]]:
        found = above.get(role[0], ())
        return [turned((sup, role[1])) if turns else (sup, role[1]) for sup, turns in found]

    reached = [(one, closure((one.prop, one.inverse), following)) for one in program.existentials]
    for limit in upper:
        if not limit.is_data and (limit.n > 1 or limit.filler is not None):
            counted = [one for one, roles in reached if (limit.prop, limit.inverse) in roles]
            if counted:
                yield limit, counted


def _witnesses(existential: Existential, z: str) -> set[Any]:
    """Return what is known of that which must exist."""
    found = _related(existential.prop, existential.inverse, z)
    filler = existential.filler
    if isinstance(filler, ValueSet):
        return {value for value in found if filler.contains(value)}
    return found if filler is None else found & filler.members.keys()


def _related(prop: Predicate, inverse: bool, z: str) -> set[Any]:
    return set((prop.pred if inverse else prop.succ).get(z, ()))


def _sentence(origin: Axiom | None, name: str, what: str = 'which individuals are the same') -> str:
    subject = 'the ontology' if origin is None else axiom_text(origin)
    return (
        f'{subject}: for {local_name(name)} it depends on {what},'
        ' which would need reasoning by cases'
    )


# --- values that must exist ---


class _Asking(NamedTuple):
    """A clause (None: a key) with an atom that a value might fit, and which values it asks for."""

    clause: Clause | None
    atom: PredicateAtom
    values: ValueSet

    @property
    def is_named(self) -> bool:
        """Whether it is about named individuals: a rule, or a key."""
        return self.clause is None or self.clause.named_only

    @property
    def is_joined(self) -> bool:
        """Whether it looks for the value among other values."""
        if self.clause is None:
            return True
        others = (other for other in self.clause.body if other is not self.atom)
        value = self.atom.terms[1]
        return any(isinstance(one, PredicateAtom) and value in one.terms for one in others)

    @property
    def is_computed(self) -> bool:
        """Whether it computes with the value."""
        value = self.atom.terms[1]
        return self.clause is not None and any(
            isinstance(one, ComputedAtom) and value in one.terms and compared(one, value) is None
            for one in self.clause.body
        )


def _asking(program: Program) -> Iterator[_Asking]:
    """Yield each clause and key that asks for values."""
    for key in program.keys:
        for prop, _ in key.props:
            if prop.kind == 'data':
                yield _Asking(None, PredicateAtom(prop, (0, 1)), EVERY)
    for clause in program.clauses:
        for atom in clause.body:
            if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'data':
                yield _Asking(clause, atom, _asked(clause, atom))


def _asked(clause: Clause, atom: PredicateAtom) -> ValueSet:
    """Return the values of an atom for which a clause may apply: all, unless each other atom about
    the value compares it with what the clause itself names.
    """
    value = atom.terms[1]
    if isinstance(value, Constant):
        return point(value.value)
    asked = EVERY
    for other in (*clause.body, clause.head):
        if other is not atom and value in other.terms:
            if isinstance(other, RangeAtom):
                asked &= other.values
            elif isinstance(other, ComputedAtom):
                asked &= compared(other, value) or EVERY
    return asked


class _OpenValue(NamedTuple):
    """What must have values of which it matters which they are.

    `props`: the properties by which it has them. `asking`: what asks for some of them.
    """

    existential: Existential
    props: dict[Predicate, None]
    asking: list[_Asking]


def _open_values(program: Program, rules: bool) -> Iterator[_OpenValue]:
    """Yield the existentials of which it may matter which value there is.

    It does not where a value is left that nothing asks for: then what follows of it follows of any.
    What all the values fit follows in any case. Ranges are taken together, whoever they hold for.
    `rules`: whether rules and keys count among what asks.
    """
    unknown = [one for one in program.existentials if one.prop.kind == 'data']
    if not unknown:
        return
    above: dict[Predicate, list[Predicate]] = {}
    excluding: list[_Asking] = []
    asking: list[_Asking] = []
    for one in _asking(program):
        if one.is_named and not rules:
            continue
        head = None if one.clause is None else one.clause.head
        prop = one.atom.predicate
        if isinstance(head, PredicateAtom) and head.terms[1:] == one.atom.terms[1:]:
            above.setdefault(prop, []).append(head.predicate)
        contradicts = isinstance(head, PredicateAtom) and head.predicate is program.nothing
        if contradicts and not one.is_named and not one.is_joined:
            excluding.append(one)
        else:
            asking.append(one)
    for existential in unknown:
        assert isinstance(existential.filler, ValueSet)
        filler = left = existential.filler
        props = closure(existential.prop, lambda sub: above.get(sub, ()))
        for one in excluding:
            if one.atom.predicate in props and not filler.within(one.values):
                left &= ~one.values
        few = left.size <= _MOST_COMPARED
        fitting = [
            one
            for one in asking
            if one.atom.predicate in props
            and not (filler & one.values).is_empty
            and (few if one.is_joined else one.is_named or not filler.within(one.values))
        ]
        for one in fitting:
            left &= ~one.values
        if fitting and left.size < existential.n:
            yield _OpenValue(existential, props, fitting)


def _values_may_split(program: Program) -> bool:
    """Tell whether it may matter, to more than rules and keys, which value somebody has."""
    return next(_open_values(program, rules=False), None) is not None


class _AskedValue(NamedTuple):
    """A rule or key with an atom that a value might fit which must exist.

    `known`: other atoms, which no such value fits. `is_decided`: whether reasoning by cases finds
    out what follows.
    """

    asking: _Asking
    existential: Existential
    known: list[PredicateAtom]
    is_decided: bool


def _unknowns(program: Program) -> Iterator[_AskedValue]:
    """Yield the rules and keys for which it may matter which value there is."""
    values = list(_open_values(program, rules=True))
    filled = {prop for value in values for prop in value.props}
    for existential, _, asking in values:
        assert isinstance(existential.filler, ValueSet)
        few = existential.filler.size <= MOST_TRIED
        for one in asking:
            if one.is_named:
                known = [
                    other
                    for other in (() if one.clause is None else one.clause.body)
                    if isinstance(other, PredicateAtom)
                    and other.predicate not in filled
                    and one.atom.terms[1] not in other.terms
                ]
                yield _AskedValue(one, existential, known, few or not one.is_computed)
