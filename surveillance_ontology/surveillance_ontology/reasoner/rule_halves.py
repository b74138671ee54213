"""Takes apart rules that compare a value of one half of their body with a value of the other.

See `thresholds` for what becomes of the halves.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from surveillance_ontology.reasoner.clauses import (
    BodyAtom,
    Clause,
    ComputedAtom,
    Constant,
    PredicateAtom,
    Term,
)

_COMPARISONS = {
    'greaterThan': (1, True),
    'greaterThanOrEqual': (1, False),
    'lessThan': (-1, True),
    'lessThanOrEqual': (-1, False),
}
Linear = dict[Term | None, Fraction]


@dataclass(frozen=True)
class Halves:
    """A clause taken apart: its head holds where key < reach (or <=, when not `strict`)."""

    keyed: tuple[BodyAtom, ...]
    reaching: tuple[BodyAtom, ...]
    key: Linear
    reach: Linear
    strict: bool
    computed: tuple[ComputedAtom, ...]


def _linear(term: Term, forms: dict[Term, Linear]) -> Linear:
    if isinstance(term, Constant):
        value = term.value
        if isinstance(value, (int, Fraction)):
            return {None: Fraction(value)}
        raise ValueError
    return forms.get(term, {term: Fraction(1)})


def _sum(parts: list[tuple[int, Linear]]) -> Linear:
    total: Linear = {}
    for sign, part in parts:
        for term, factor in part.items():
            total[term] = total.get(term, Fraction(0)) + sign * factor
    return {term: factor for term, factor in total.items() if factor}


def split_rule(clause: Clause) -> Halves | None:
    """Takes a clause apart; None where it is not of this kind."""
    head = clause.head
    computed = tuple(atom for atom in clause.body if isinstance(atom, ComputedAtom))
    facts = tuple(atom for atom in clause.body if not isinstance(atom, ComputedAtom))
    comparisons = [atom for atom in computed if atom.builtin in _COMPARISONS]
    if len(comparisons) != 1 or not isinstance(head, PredicateAtom):
        return None
    bound = {
        term
        for atom in facts
        if isinstance(atom, PredicateAtom)
        for term in atom.terms
        if isinstance(term, int)
    }
    forms: dict[Term, Linear] = {}
    try:
        pending = [atom for atom in computed if atom is not comparisons[0]]
        for _ in range(len(pending) + 1):
            for atom in tuple(pending):
                if all(isinstance(t, Constant) or t in bound or t in forms for t in atom.terms[1:]):
                    form = _form(atom, forms)
                    if form is None or atom.terms[0] in bound or atom.terms[0] in forms:
                        return None
                    forms[atom.terms[0]] = form
                    pending.remove(atom)
        if pending:
            return None
        comparison = comparisons[0]
        sign, strict = _COMPARISONS[comparison.builtin]
        left, right = (_linear(term, forms) for term in comparison.terms)
    except ValueError:
        return None
    difference = _sum([(sign, left), (-sign, right)])  # holds where this is > 0 (or >= 0)
    components = _components(facts)
    linked = [
        part
        for part in components
        if any(term in difference for atom in part for term in atom.terms)
    ]
    outputs = {term for term in head.terms if isinstance(term, int)}
    keyed_parts = [
        part for part in components if outputs & {term for atom in part for term in atom.terms}
    ]
    if len(components) != 2 or len(linked) != 2 or len(keyed_parts) != 1:
        return None
    keyed = keyed_parts[0]
    reaching = next(part for part in components if part is not keyed)
    own = {term for atom in keyed for term in atom.terms if isinstance(term, int)}
    values = {
        atom.terms[1]
        for atom in keyed
        if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'data'
    }
    if not outputs or not outputs <= own or outputs & values - set(difference):
        return None
    key: Linear = {term: -factor for term, factor in difference.items() if term in own}
    reach: Linear = {term: factor for term, factor in difference.items() if term not in own}
    return Halves(tuple(keyed), tuple(reaching), key, reach, strict, computed)


def _form(atom: ComputedAtom, forms: dict[Term, Linear]) -> Linear | None:
    rest = [_linear(term, forms) for term in atom.terms[1:]]
    if atom.builtin == 'add':
        return _sum([(1, part) for part in rest])
    if atom.builtin == 'subtract':
        return _sum([(1, rest[0]), (-1, rest[1])])
    if atom.builtin in ('unaryMinus', 'unaryPlus'):
        return _sum([(-1 if atom.builtin == 'unaryMinus' else 1, rest[0])])
    return None


def _components(atoms: tuple[BodyAtom, ...]) -> list[list[BodyAtom]]:
    parts: list[tuple[set[Term], list[BodyAtom]]] = []
    for atom in atoms:
        terms: set[Term] = {term for term in atom.terms if isinstance(term, int)}
        members = [atom]
        for part in [part for part in parts if part[0] & terms]:
            parts.remove(part)
            terms |= part[0]
            members = part[1] + members
        parts.append((terms, members))
    return [members for _, members in parts]
