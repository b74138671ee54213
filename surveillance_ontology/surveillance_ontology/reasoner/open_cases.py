"""What the engine leaves open: conclusions that would need reasoning by cases.

Whether two individuals are the same may be unknown, and which value a property has that must have
one. Where a count, a rule or a key depends on it, all cases could have a consequence in common,
which the engine does not derive. It is found out when it is asked for, from the facts that hold
then.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from surveillance_ontology.owl.axiom_text import axiom_text
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.vocabulary import local_name
from surveillance_ontology.reasoner.cardinality import AtLeastCounter, AtMostCounter
from surveillance_ontology.reasoner.case_joins import MOST_TRIED, compared
from surveillance_ontology.reasoner.clauses import (
    AtLeast,
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
from surveillance_ontology.reasoner.difference import clique
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

    Attributes:
        clauses: The program's clauses when this was made; a changed program has another list.
    """

    def __init__(
        self,
        program: Program,
        context: JoinContext,
        lower: list[AtLeastCounter],
        upper: list[AtMostCounter],
    ) -> None:
        self._program, self._context = program, context
        self.clauses = program.clauses
        self._asked = tuple(_asked_for_unknown(program))
        self._lower = [counter for counter in lower if not counter.is_data]
        self._upper = [counter for counter in upper if not counter.is_data and counter.n > 1]
        self._filling = tuple(_filling(program, upper))
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
        for asked in self._asked:
            name = None if asked.is_decided else self._with_unknown(asked)
            if name is not None and asked.clause is not None:
                prop = local_name(asked.atom.predicate.name)
                yield _sentence(asked.clause.origin, name, f'a value of {prop} that is not known')

    def unknowns_matter(self) -> bool:
        """Tell whether reasoning by cases is needed for a rule or key that could apply by a value
        which must exist and is not known, or because somebody who must exist is one of those known.
        """
        return any(
            asked.is_decided and self._with_unknown(asked) is not None for asked in self._asked
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

    def _with_unknown(self, asked: _Asked) -> str | None:
        """Return somebody for whom a rule, or a key, could apply by such a value."""
        clause, existential = asked.clause, asked.existential
        if not existential.label.members:
            return None
        x = asked.atom.terms[0]
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
            compile_call(self._context, [label, *asked.known], None, (), (x,), look)()
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


def values_may_split(program: Program) -> bool:
    """Tell whether it may matter which of its values a data property has that must have some.

    It does not where a value is left that no clause asks for: then what follows of it follows of
    any. Ranges are taken together here, whoever they hold for.
    """
    above: dict[Predicate, list[Predicate]] = {}
    asked: dict[Predicate, list[ValueSet]] = {}
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
        if values is not EVERY and head is program.nothing:
            excluded[prop] = excluded.get(prop, NONE) | values
        elif values is not EVERY:
            asked.setdefault(prop, []).append(values)
    for existential in program.existentials:
        if isinstance(existential.filler, ValueSet):
            props = closure(existential.prop, lambda one: above.get(one, ()))
            left = existential.filler
            for prop in props:
                left &= ~excluded.get(prop, NONE)
            if left.size <= _MOST_COMPARED and not compared.isdisjoint(props):
                return True
            # What all its values fit follows in any case.
            splitting = [
                values
                for prop in props
                for values in asked.get(prop, ())
                if not existential.filler.within(values)
            ]
            for values in splitting:
                left &= ~values
            if splitting and left.size < existential.n:
                return True
    return False


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


class _Asked(NamedTuple):
    """A rule (None: a key) with an atom that a value might fit which must exist.

    `known`: other atoms, which no such value fits. `is_decided`: whether reasoning by cases finds
    out what follows.
    """

    clause: Clause | None
    atom: PredicateAtom
    existential: Existential
    known: list[PredicateAtom]
    is_decided: bool


def _asked_for_unknown(program: Program) -> Iterator[_Asked]:
    """Yield the rules and keys for which it may matter which value there is.

    None does where enough values are left that no rule asks for.
    """
    unknown = [one for one in program.existentials if one.prop.kind == 'data']
    if not unknown:
        return
    above: dict[Predicate, list[Predicate]] = {}
    asking: list[tuple[Clause | None, PredicateAtom, ValueSet]] = [
        (None, PredicateAtom(prop, (0, 1)), EVERY)
        for key in program.keys
        for prop, _ in key.props
        if prop.kind == 'data'
    ]
    for clause in program.clauses:
        head = clause.head
        for atom in clause.body:
            if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'data':
                if isinstance(head, PredicateAtom) and head.terms[1:] == atom.terms[1:]:
                    above.setdefault(atom.predicate, []).append(head.predicate)
                asking.append((clause, atom, _asked(clause, atom)))
    reached = {one.prop: closure(one.prop, lambda sub: above.get(sub, ())) for one in unknown}
    filled = {prop for props in reached.values() for prop in props}
    for existential in unknown:
        filler = existential.filler if isinstance(existential.filler, ValueSet) else EVERY
        props = reached[existential.prop]
        fitting = [
            (one, atom, asked)
            for one, atom, asked in asking
            if atom.predicate in props
            and not (filler & asked).is_empty
            and (one is None or one.named_only or not filler.within(asked))
            and (filler.size <= _MOST_COMPARED or not _is_joined(one, atom))
        ]
        left = filler
        for _, _, asked in fitting:
            left &= ~asked
        if left.size < existential.n:
            for one, atom, _ in fitting:
                if one is None or one.named_only:
                    known = [
                        other
                        for other in (() if one is None else one.body)
                        if isinstance(other, PredicateAtom)
                        and other.predicate not in filled
                        and atom.terms[1] not in other.terms
                    ]
                    decided = filler.size <= MOST_TRIED or not _is_computed(one, atom)
                    yield _Asked(one, atom, existential, known, decided)


def _is_joined(clause: Clause | None, atom: PredicateAtom) -> bool:
    """Tell whether a rule, or a key, looks for the value of an atom among other values."""
    if clause is None:
        return True
    others = (other for other in clause.body if other is not atom)
    return any(
        isinstance(other, PredicateAtom) and atom.terms[1] in other.terms for other in others
    )


def _is_computed(clause: Clause | None, atom: PredicateAtom) -> bool:
    """Tell whether a rule computes with the value of an atom."""
    value = atom.terms[1]
    return clause is not None and any(
        isinstance(other, ComputedAtom) and value in other.terms and compared(other, value) is None
        for other in clause.body
    )


def _asked(clause: Clause, atom: PredicateAtom) -> ValueSet:
    """Return the values of an atom for which a rule may apply: all, unless each other atom about
    the value compares it with what the rule itself names.
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
