"""What the engine leaves open: conclusions that would need reasoning by cases.

Whether two individuals are the same may be unknown, and which value a property has that must have
one. Where a count or a rule depends on it, all cases could have a consequence in common, which the
engine does not derive. It is found out when it is asked for, from the facts that hold then.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from surveillance_ontology.owl.axiom_text import axiom_text
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import DataComplementOf, DatatypeRestriction
from surveillance_ontology.owl.vocabulary import OWL, XSD, local_name
from surveillance_ontology.reasoner.cardinality import AtLeastCounter, AtMostCounter
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
    Term,
    closure,
)
from surveillance_ontology.reasoner.datatypes import literal_of
from surveillance_ontology.reasoner.joins import JoinContext, compile_call
from surveillance_ontology.reasoner.value_sets import EVERY, NONE, ValueSet, point, value_set

_MOST_COMPARED = 20_000
"""Where so many values are possible, those that are known leave one."""
_COMPARISONS = {
    'lessThan': ('maxExclusive', 'minExclusive'),
    'lessThanOrEqual': ('maxInclusive', 'minInclusive'),
    'greaterThan': ('minExclusive', 'maxExclusive'),
    'greaterThanOrEqual': ('minInclusive', 'maxInclusive'),
}
"""Built-ins, with the facet for a number as second and as first argument."""


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
        for clause, atom, existential in rules_on_unknown_values(self._program):
            name = self._unknown_value(clause, atom, existential)
            if name is not None:
                prop = local_name(atom.predicate.name)
                yield _sentence(clause.origin, name, f'a value of {prop} that is not known')

    def _unknown_value(
        self, clause: Clause, atom: PredicateAtom, existential: Existential
    ) -> str | None:
        """Return somebody for whom the rule could apply by a value that is not known."""
        x, value = atom.terms
        rest = [
            other
            for other in clause.body
            if isinstance(other, PredicateAtom) and other is not atom and value not in other.terms
        ]
        found: list[str] = []

        def look(z: str) -> None:
            head = clause.head
            if not isinstance(head, PredicateAtom) or head.terms != (x,):
                known = False
            else:
                known = z in head.predicate.members
            if not known and len(_witnesses(existential, z)) < existential.n:
                found.append(z)
                raise StoppedError

        label = PredicateAtom(existential.label, (x,))
        try:
            compile_call(self._context, [label, *rest], None, (), (x,), look)()
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


def rules_on_unknown_values(
    program: Program,
) -> Iterator[tuple[Clause, PredicateAtom, Existential]]:
    """Yield the rules with an atom that a value might fit which must exist, and need not be known.

    None does where enough values are left that no rule asks for.
    """
    unknown = [one for one in program.existentials if one.prop.kind == 'data']
    if not unknown:
        return
    above: dict[Predicate, list[Predicate]] = {}
    asking: list[tuple[Clause, PredicateAtom, ValueSet]] = []
    for clause in program.clauses:
        head = clause.head
        for atom in clause.body:
            if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'data':
                if isinstance(head, PredicateAtom) and head.terms[1:] == atom.terms[1:]:
                    above.setdefault(atom.predicate, []).append(head.predicate)
                asking.append((clause, atom, _asked(clause, atom)))
    for existential in unknown:
        filler = existential.filler if isinstance(existential.filler, ValueSet) else EVERY
        props = closure(existential.prop, lambda one: above.get(one, ()))
        fitting = [
            (clause, atom, asked)
            for clause, atom, asked in asking
            if atom.predicate in props
            and not (filler & asked).is_empty
            and (clause.named_only or not filler.within(asked))
            and (filler.size <= _MOST_COMPARED or not _is_joined(clause, atom))
        ]
        left = filler
        for _, _, asked in fitting:
            left &= ~asked
        if left.size < existential.n:
            for clause, atom, _ in fitting:
                if clause.named_only:
                    yield clause, atom, existential


def _is_joined(clause: Clause, atom: PredicateAtom) -> bool:
    """Tell whether a rule looks for the value of an atom among other values, which are known."""
    others = (other for other in clause.body if other is not atom)
    return any(
        isinstance(other, PredicateAtom) and atom.terms[1] in other.terms for other in others
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
                asked &= _compared(other, value)
    return asked


def _compared(atom: ComputedAtom, value: Term) -> ValueSet:
    """Return the values for which a comparison with a number holds; all, for other built-ins."""
    facets = _COMPARISONS.get(atom.builtin)
    number = atom.terms[atom.terms[0] == value]
    bound = number.value if isinstance(number, Constant) else None
    if facets is None or not isinstance(bound, int | Fraction):
        return EVERY
    facet = facets[atom.terms[0] != value]
    real = OWL + 'real'
    others = value_set(DataComplementOf(real))
    numbers = value_set(DatatypeRestriction(real, ((XSD + facet, literal_of(bound)),)))
    return EVERY if numbers is None or others is None else numbers | others


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
