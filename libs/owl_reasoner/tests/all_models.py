"""What holds in every model over a few elements, by looking at all of them.

One bit of a whole number stands for one interpretation of a small vocabulary, so an axiom is the
number of the interpretations in which it holds, computed by `&`, `|` and `~` alone as the OWL 2
Direct Semantics (https://www.w3.org/TR/owl2-direct-semantics/, section 2) has it. Nothing of the
reasoner is used.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations, product
from operator import and_, or_
from typing import Any

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import NOTHING, OWL, SWRLB, THING, TOP_LITERAL, XSD

Terms = Mapping[ex.Variable, Any]
Comparison = Callable[[Any, Any], bool]
FACETS: dict[str, Comparison] = {
    'minInclusive': operator.ge,
    'maxInclusive': operator.le,
    'minExclusive': operator.gt,
    'maxExclusive': operator.lt,
}
COMPARISONS: dict[str, Comparison] = {
    'equal': operator.eq,
    'notEqual': operator.ne,
    'lessThan': operator.lt,
    'lessThanOrEqual': operator.le,
    'greaterThan': operator.gt,
    'greaterThanOrEqual': operator.ge,
}


@dataclass(frozen=True)
class Vocabulary:
    """Names, and the whole numbers that data properties may have as values."""

    classes: Sequence[str]
    objects: Sequence[str]
    datas: Sequence[str]
    individuals: Sequence[str]
    numbers: Sequence[int] = (1, 2)
    unnamed: int = 0
    """How many elements there may be that no individual stands for."""


class Worlds:
    """All interpretations in which individuals stand for given elements.

    Args:
        words: The vocabulary.
        named: The element that each individual stands for, counted from 0.
        unnamed: How many elements more there are.
    """

    def __init__(self, words: Vocabulary, named: Mapping[str, int], unnamed: int = 0) -> None:
        self.named, self.numbers = named, words.numbers
        self.elements = range(len(set(named.values())) + unnamed)
        facts = [
            *product(words.classes, self.elements),
            *product(words.objects, self.elements, self.elements),
            *product(words.datas, self.elements, self.numbers),
        ]
        self.all = (1 << (1 << len(facts))) - 1
        # A variable's truth table: blocks of zeros and ones of its own length by turns.
        self._facts = {
            fact: self.all ^ (self.all // ((1 << (1 << place)) + 1))
            for place, fact in enumerate(facts)
        }

    # --- expressions ---

    def linked(self, prop: ex.PropertyExpression, x: int, y: int) -> int:
        if isinstance(prop, ex.ObjectInverseOf):
            return self.linked(prop.prop, y, x)
        if prop in (OWL + 'topObjectProperty', OWL + 'bottomObjectProperty'):
            return self.all if 'top' in prop else 0
        return self._facts[prop, x, y]

    def valued(self, prop: str, x: int, number: int) -> int:
        return self._facts.get((prop, x, number), 0)

    def admits(self, data_range: Any, number: int) -> bool:
        if isinstance(data_range, str):
            return data_range in (TOP_LITERAL, *(XSD + name for name in ('integer', 'decimal')))
        if isinstance(data_range, ex.DataOneOf):
            return number in map(number_of, data_range.literals)
        if isinstance(data_range, ex.DataComplementOf):
            return not self.admits(data_range.operand, number)
        if isinstance(data_range, ex.DatatypeRestriction):
            return self.admits(data_range.datatype, number) and all(
                FACETS[facet.removeprefix(XSD)](number, number_of(bound))
                for facet, bound in data_range.facets
            )
        found = [self.admits(operand, number) for operand in data_range.operands]
        return any(found) if isinstance(data_range, ex.DataUnionOf) else all(found)

    def at_least(self, count: int, parts: Iterable[int]) -> int:
        """Return where so many of the parts hold."""
        reached = [self.all, *(0 for _ in range(count))]
        for part in parts:
            for size in range(count, 0, -1):
                reached[size] |= reached[size - 1] & part
        return reached[count]

    def member(self, expression: Any, x: int) -> int:
        if isinstance(expression, str):
            if expression in (THING, NOTHING):
                return self.all if expression == THING else 0
            return self._facts[expression, x]
        kind = type(expression).__name__
        if kind == 'ObjectComplementOf':
            return self.all ^ self.member(expression.operand, x)
        if kind in ('ObjectIntersectionOf', 'ObjectUnionOf'):
            parts = [self.member(operand, x) for operand in expression.operands]
            return reduce(and_ if 'Inter' in kind else or_, parts)
        if kind == 'ObjectOneOf':
            return self.all if x in {self.named[i] for i in expression.individuals} else 0
        if kind == 'ObjectHasValue':
            return self.linked(expression.prop, x, self.named[expression.individual])
        if kind == 'ObjectHasSelf':
            return self.linked(expression.prop, x, x)
        if kind == 'DataHasValue':
            return self.valued(expression.prop, x, number_of(expression.literal))
        return self._restricted(kind, expression, x)

    def _restricted(self, kind: str, expression: Any, x: int) -> int:
        """Return where so many of what the element is related to are in the filler."""
        prop = expression.prop
        if kind.startswith('Object'):
            whole = [self.linked(prop, x, y) for y in self.elements]
            inside = [self.member(expression.filler, y) for y in self.elements]
        else:
            whole = [self.valued(prop, x, number) for number in self.numbers]
            ranged = expression.range
            inside = [self.all * self.admits(ranged, number) for number in self.numbers]
        if 'AllValues' in kind:
            return self._every(a ^ self.all | b for a, b in zip(whole, inside, strict=True))
        counted = [a & b for a, b in zip(whole, inside, strict=True)]
        if 'SomeValues' in kind:
            return self.at_least(1, counted)
        enough = self.at_least(expression.n, counted)
        few = self.all ^ self.at_least(expression.n + 1, counted)
        return enough if 'Min' in kind else few if 'Max' in kind else enough & few

    def _every(self, parts: Iterable[int]) -> int:
        return reduce(and_, parts, self.all)

    def implied(self, one: int, other: int) -> int:
        return one ^ self.all | other

    # --- axioms ---

    def holds(self, axiom: Axiom) -> int:
        """Return where an axiom holds."""
        kind = type(axiom).__name__
        found: int = getattr(self, f'_{kind}', self._of_properties)(axiom)
        return found

    def _Declaration(self, _: Any) -> int:  # noqa: N802
        return self.all

    def _ClassAssertion(self, axiom: Any) -> int:  # noqa: N802
        return self.member(axiom.cls, self.named[axiom.individual])

    def _ObjectPropertyAssertion(self, axiom: Any) -> int:  # noqa: N802
        return self.linked(axiom.prop, self.named[axiom.subject], self.named[axiom.object])

    def _NegativeObjectPropertyAssertion(self, axiom: Any) -> int:  # noqa: N802
        return self.all ^ self._ObjectPropertyAssertion(axiom)

    def _DataPropertyAssertion(self, axiom: Any) -> int:  # noqa: N802
        return self.valued(axiom.prop, self.named[axiom.subject], number_of(axiom.literal))

    def _NegativeDataPropertyAssertion(self, axiom: Any) -> int:  # noqa: N802
        return self.all ^ self._DataPropertyAssertion(axiom)

    def _SameIndividual(self, axiom: Any) -> int:  # noqa: N802
        return self.all if len({self.named[i] for i in axiom.individuals}) == 1 else 0

    def _DifferentIndividuals(self, axiom: Any) -> int:  # noqa: N802
        places = [self.named[i] for i in axiom.individuals]
        return self.all if len(set(places)) == len(places) else 0

    def _SubClassOf(self, axiom: Any) -> int:  # noqa: N802
        return self._below(axiom.sub, axiom.sup)

    def _EquivalentClasses(self, axiom: Any) -> int:  # noqa: N802
        return self._every(self._below(a, b) for a, b in product(axiom.classes, repeat=2))

    def _DisjointClasses(self, axiom: Any) -> int:  # noqa: N802
        return self._every(
            self.all ^ (self.member(a, x) & self.member(b, x))
            for a, b in combinations(axiom.classes, 2)
            for x in self.elements
        )

    def _DisjointUnion(self, axiom: Any) -> int:  # noqa: N802
        union = ex.ObjectUnionOf(axiom.classes)
        return self._DisjointClasses(axiom) & self._EquivalentClasses(
            ax.EquivalentClasses((axiom.cls, union))
        )

    def _below(self, sub: Any, sup: Any) -> int:
        return self._every(
            self.implied(self.member(sub, x), self.member(sup, x)) for x in self.elements
        )

    def _HasKey(self, axiom: Any) -> int:  # noqa: N802
        named = sorted(set(self.named.values()))
        found = self.all
        for one, other in combinations(named, 2):
            # A key identifies named individuals, by named ones.
            parts = [self.member(axiom.cls, one), self.member(axiom.cls, other)]
            for prop in axiom.object_props:
                shared = [self.linked(prop, one, y) & self.linked(prop, other, y) for y in named]
                parts.append(reduce(or_, shared))
            for prop in axiom.data_props:
                shared = [
                    self.valued(prop, one, n) & self.valued(prop, other, n) for n in self.numbers
                ]
                parts.append(reduce(or_, shared))
            found &= self.all ^ self._every(parts)
        return found

    def _of_properties(self, axiom: Any) -> int:
        kind = type(axiom).__name__
        if kind == 'InverseObjectProperties':
            inverse = ax.EquivalentObjectProperties((turned(axiom.first), axiom.second))
            return self._of_properties(inverse)
        if kind in ('ObjectPropertyDomain', 'DataPropertyDomain'):
            some = ex.ObjectMinCardinality if kind[0] == 'O' else ex.DataMinCardinality
            return self._below(some(1, axiom.prop), axiom.domain)
        if kind == 'ObjectPropertyRange':
            return self._below(THING, ex.ObjectAllValuesFrom(axiom.prop, axiom.range))
        if kind == 'DataPropertyRange':
            return self._below(THING, ex.DataAllValuesFrom(axiom.prop, axiom.range))
        if kind == 'SubPropertyChainOf':
            return self._chained(axiom.chain, axiom.sup)
        if kind == 'TransitiveObjectProperty':
            return self._chained((axiom.prop, axiom.prop), axiom.prop)
        if kind == 'SymmetricObjectProperty':
            return self._chained((turned(axiom.prop),), axiom.prop)
        if kind in ('SubObjectPropertyOf', 'SubDataPropertyOf'):
            return self._included(axiom.sub, axiom.sup)
        if kind.startswith('Equivalent'):
            return self._every(self._included(a, b) for a, b in product(axiom.props, repeat=2))
        if kind.startswith('Disjoint'):
            return self._every(self._apart(a, b) for a, b in combinations(axiom.props, 2))
        if kind == 'AsymmetricObjectProperty':
            return self._apart(axiom.prop, turned(axiom.prop))
        if kind == 'ReflexiveObjectProperty':
            return self._below(THING, ex.ObjectHasSelf(axiom.prop))
        if kind == 'IrreflexiveObjectProperty':
            return self._below(ex.ObjectHasSelf(axiom.prop), NOTHING)
        if kind == 'FunctionalDataProperty':
            return self._below(THING, ex.DataMaxCardinality(1, axiom.prop))
        prop = turned(axiom.prop) if kind.startswith('InverseF') else axiom.prop
        assert kind.endswith('FunctionalObjectProperty'), kind
        return self._below(THING, ex.ObjectMaxCardinality(1, prop))

    def _pairs(self, prop: Any) -> Iterator[int]:
        """Yield, for each pair in a fixed order, where a property relates it."""
        if isinstance(prop, ex.ObjectInverseOf) or (prop, 0, 0) in self._facts:
            yield from (self.linked(prop, x, y) for x in self.elements for y in self.elements)
        else:
            yield from (self.valued(prop, x, n) for x in self.elements for n in self.numbers)

    def _included(self, sub: Any, sup: Any) -> int:
        both = zip(self._pairs(sub), self._pairs(sup), strict=True)
        return self._every(self.implied(a, b) for a, b in both)

    def _apart(self, first: Any, second: Any) -> int:
        both = zip(self._pairs(first), self._pairs(second), strict=True)
        return self._every(self.all ^ (a & b) for a, b in both)

    def _chained(self, chain: Sequence[Any], sup: Any) -> int:
        found = self.all
        for path in product(self.elements, repeat=len(chain) + 1):
            steps = zip(chain, path[:-1], path[1:], strict=True)
            walked = self._every(self.linked(prop, x, y) for prop, x, y in steps)
            found &= self.implied(walked, self.linked(sup, path[0], path[-1]))
        return found

    # --- rules, about named individuals ---

    def _Rule(self, rule: Any) -> int:  # noqa: N802
        people: dict[ex.Variable, None] = {}
        values: dict[ex.Variable, None] = {}
        for atom in (*rule.body, *rule.head):
            for place, term in enumerate(terms_of(atom)):
                if isinstance(term, ex.Variable):
                    about_values = isinstance(atom, ex.BuiltinAtom | ex.DataRangeAtom) or (
                        place and isinstance(atom, ex.DataPropertyAtom)
                    )
                    (values if about_values else people)[term] = None
        named = sorted(set(self.named.values()))
        found = self.all
        for elements in product(named, repeat=len(people)):
            for numbers in product(self.numbers, repeat=len(values)):
                given = {**dict(zip(people, elements)), **dict(zip(values, numbers))}  # noqa: B905
                body = self._every(self._atom(atom, given) for atom in rule.body)
                if body:
                    head = self._every(self._atom(atom, given) for atom in rule.head)
                    found &= self.implied(body, head if rule.head else 0)
        return found

    def _atom(self, atom: Any, given: Terms) -> int:
        terms = [self._term(term, given) for term in terms_of(atom)]
        if isinstance(atom, ex.ClassAtom):
            return self.member(atom.cls, *terms)
        if isinstance(atom, ex.DataRangeAtom):
            return self.all * self.admits(atom.range, *terms)
        if isinstance(atom, ex.ObjectPropertyAtom):
            return self.linked(atom.prop, *terms)
        if isinstance(atom, ex.DataPropertyAtom):
            return self.valued(atom.prop, *terms)
        if isinstance(atom, ex.BuiltinAtom):
            return self.all * COMPARISONS[atom.builtin.removeprefix(SWRLB)](*terms)
        same = terms[0] == terms[1]
        return self.all * (same == isinstance(atom, ex.SameIndividualAtom))

    def _term(self, term: Any, given: Terms) -> Any:
        if isinstance(term, ex.Variable):
            return given[term]
        return number_of(term) if isinstance(term, Literal) else self.named[term]


def turned(prop: Any) -> Any:
    return prop.prop if isinstance(prop, ex.ObjectInverseOf) else ex.ObjectInverseOf(prop)


def terms_of(atom: Any) -> tuple[Any, ...]:
    if isinstance(atom, ex.BuiltinAtom):
        return atom.arguments
    if isinstance(atom, ex.ClassAtom | ex.DataRangeAtom):
        return (atom.argument,)
    return (atom.first, atom.second)


def number_of(literal: Literal) -> int:
    return int(literal.lexical)


class AllModels:
    """The models of axioms, whoever individuals are."""

    def __init__(self, words: Vocabulary) -> None:
        self._worlds = [
            Worlds(words, named, unnamed)
            for named in places(words.individuals)
            for unnamed in range(words.unnamed + 1)
            if named or unnamed  # There is always some element.
        ]
        self._models: list[int] = []

    def of(self, axioms: Iterable[Axiom]) -> AllModels:
        """Have the models be those of the axioms."""
        axioms = list(axioms)
        self._models = [reduce(and_, map(w.holds, axioms), w.all) for w in self._worlds]
        return self

    @property
    def consistent(self) -> bool:
        return any(self._models)

    def entail(self, axiom: Axiom) -> bool:
        """Tell whether an axiom holds in all models."""
        found = zip(self._worlds, self._models, strict=True)
        return not any(models and models & ~world.holds(axiom) for world, models in found)


def places(individuals: Sequence[str]) -> Iterator[dict[str, int]]:
    """Yield each way in which some individuals may be the same."""
    found: list[dict[str, int]] = [{}]
    for name in individuals:
        found = [
            {**named, name: place}
            for named in found
            for place in range(len(set(named.values())) + 1)
        ]
    yield from found
