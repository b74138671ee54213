"""Axioms to Horn clauses and counting conditions.

A class expression that cannot be spelt out in a clause's body (a cardinality, `only`, a complement)
becomes a
label: a predicate that holds of what is known to belong to the expression. What no Horn clause can
express is reported, with the axiom, in `Program.unsupported`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import product
from typing import Any

from surveillance_ontology import axioms as ax
from surveillance_ontology.axiom_text import axiom_text, expression_text
from surveillance_ontology.axioms import NOTHING, THING, Axiom, ClassExpression, local_name
from surveillance_ontology.reasoner.clauses import (
    AtLeast,
    AtMost,
    BodyAtom,
    Clause,
    Constant,
    DifferentAtom,
    Existential,
    HeadAtom,
    Key,
    Predicate,
    PredicateAtom,
    Program,
    RangeAtom,
    SameAtom,
    Term,
    property_atom,
)
from surveillance_ontology.reasoner.datatypes import Test, Value, range_test, value_of
from surveillance_ontology.reasoner.normal_forms import is_positive, negated, normal
from surveillance_ontology.reasoner.property_hierarchy import PropertyHierarchy

Body = tuple[BodyAtom, ...]
_X, _Y = 0, 1


class Unsupported(Exception):
    """Part of an axiom is outside the fragment; the text says which."""


class Normaliser:
    """Builds a `Program` from axioms that are not assertions.

    Args:
        axioms: The ontology's axioms; assertions and annotations among them are passed over.
        asserted: Complex class expressions that individuals are asserted to belong to.
        negated: Properties with negative assertions, as pairs (kind, IRI), kind 'object' or 'data'.
        abstract: Whether values may be stand-ins ('some', range) for an unknown value in a range.
    """

    def __init__(
        self,
        axioms: Iterable[Axiom],
        asserted: Iterable[ClassExpression] = (),
        negated: Iterable[tuple[str, str]] = (),
        abstract: bool = False,
    ) -> None:
        self.program = Program()
        self._abstract = abstract
        self._variables = _Y
        self._described: set[ClassExpression] = set()
        self._recognised: set[ClassExpression] = set()
        self._complements: dict[str, Predicate] = {}
        self._origin: Axiom | None = None
        self._context = 'the ontology'
        tbox = [
            axiom
            for axiom in axioms
            if not isinstance(axiom, (ax.Assertion, ax.AnnotationAssertion))
        ]
        self._datatypes = {
            axiom.datatype: axiom.range
            for axiom in tbox
            if isinstance(axiom, ax.DatatypeDefinition)
        }
        self.hierarchy = PropertyHierarchy(tbox)
        for axiom in tbox:
            self._origin = axiom
            self._attempt(self._axiom, axiom)
        self._origin = None
        for expression in asserted:
            self._context = f'assertions of {expression_text(expression)}'
            self._attempt(self.label_asserted, expression)
        for kind, iri in negated:
            self._negate(kind, iri)
        self._complement_labels()
        if any(
            isinstance(clause.head, PredicateAtom)
            and clause.head.predicate is self.program.different
            for clause in self.program.clauses
        ):
            self._contradict((self._differs(_X, _X),), _X)

    def _attempt(self, add: Callable[..., None], *parts: Any) -> None:
        """Adds what can be added of an axiom; the rest is reported."""
        try:
            add(*parts)
        except Unsupported as reason:
            subject = self._context if self._origin is None else axiom_text(self._origin)
            text = f'{subject}: {reason}'
            if text not in self.program.unsupported:
                self.program.unsupported.append(text)

    def _differs(self, x: Term, y: Term) -> PredicateAtom:
        return PredicateAtom(self.program.different, (x, y))

    def _negate(self, kind: str, iri: str) -> None:
        """A predicate for negative assertions, which contradict the positive."""
        program = self.program
        prop = program.object(iri) if kind == 'object' else program.data(iri)
        negative = program.negatives[prop] = Predicate(kind, f'not {local_name(iri)}')
        body = (PredicateAtom(prop, (_X, _Y)), PredicateAtom(negative, (_X, _Y)))
        self._contradict(body, _X)

    def label_asserted(self, expression: ClassExpression) -> Predicate:
        """The label of an expression that individuals are asserted to belong to, with what it
        implies.
        """
        label = self._label(expression)
        self._imply((PredicateAtom(label, (_X,)),), expression, _X)
        return label

    # --- clauses ---

    def _fresh(self) -> int:
        self._variables += 1
        return self._variables

    def _clause(self, body: Body, head: HeadAtom) -> None:
        program = self.program
        bound = {term for atom in body for term in atom.terms if isinstance(term, int)}
        loose = [term for term in head.terms if isinstance(term, int) and term not in bound]
        for term in dict.fromkeys(loose):
            program.uses_thing = True
            body = (*body, PredicateAtom(program.thing, (term,)))
        program.clauses.append(Clause(tuple(dict.fromkeys(body)), head, self._origin))

    def _label(self, expression: ClassExpression) -> Predicate:
        if isinstance(expression, str):
            if expression == THING:
                self.program.uses_thing = True
                return self.program.thing
            return self.program.nothing if expression == NOTHING else self.program.cls(expression)
        label = self.program.labels.get(expression)
        if label is None:
            label = Predicate('class', expression_text(expression), expression)
            self.program.labels[expression] = label
        return label

    def _recognise(self, expression: ClassExpression) -> Predicate:
        """A label that holds of everything known to belong to the expression."""
        label = self._label(expression)
        if not isinstance(expression, str) and expression not in self._recognised:
            self._recognised.add(expression)
            for body in self._bodies(expression, _X):
                if body != (PredicateAtom(label, (_X,)),):
                    self._clause(body, PredicateAtom(label, (_X,)))
        return label

    def _filler(self, expression: ClassExpression) -> Predicate | None:
        expression = normal(expression)
        return None if expression == THING else self._recognise(expression)

    def _direction(self, prop: ax.PropertyExpression) -> tuple[Predicate, bool]:
        if isinstance(prop, str):
            return self.program.object(prop), False
        return self.program.object(prop.prop), True

    def _test(self, data_range: ax.DataRange) -> Test | None:
        """The test of a range, None where it admits every value."""
        data_range = self._defined(data_range, ())
        if data_range == ax.TOP_LITERAL:
            return None
        test = range_test(data_range)
        if test is None:
            raise Unsupported(f'the data range {expression_text(data_range)} is not supported')
        if not self._abstract:
            return test

        def abstract_test(value: Value) -> bool:
            if isinstance(value, tuple) and value[0] == 'some':
                return includes(data_range, value[1])
            return test(value)

        return abstract_test

    def _defined(self, data_range: ax.DataRange, seen: tuple[str, ...]) -> ax.DataRange:
        if isinstance(data_range, str):
            definition = self._datatypes.get(data_range)
            if definition is None:
                return data_range
            if data_range in seen:
                raise Unsupported(f'the datatype {local_name(data_range)} is defined by itself')
            return self._defined(definition, (*seen, data_range))
        if isinstance(data_range, (ax.DataIntersectionOf, ax.DataUnionOf)):
            kind = type(data_range)
            return kind(tuple(self._defined(operand, seen) for operand in data_range.operands))
        if isinstance(data_range, ax.DataComplementOf):
            return ax.DataComplementOf(self._defined(data_range.operand, seen))
        return data_range

    def _complement_labels(self) -> None:
        """What is disjoint from a class belongs to its complement, where the complement is asked
        for.
        """
        for iri, label in self._complements.items():
            for other in self.program.cls(iri).disjoint:
                if other is not label:
                    head = PredicateAtom(label, (_X,))
                    self.program.clauses.append(Clause((PredicateAtom(other, (_X,)),), head))

    # --- left sides ---

    def _bodies(self, expression: ClassExpression, x: Term) -> list[Body]:
        """Bodies each of which makes `x` a member."""
        expression = normal(expression)
        if isinstance(expression, str):
            if expression == THING:
                return [()]
            if expression == NOTHING:
                return [(PredicateAtom(self.program.nothing, (x,)),)]
            return [(PredicateAtom(self.program.cls(expression), (x,)),)]
        if isinstance(expression, ax.ObjectIntersectionOf):
            parts = [self._bodies(operand, x) for operand in expression.operands]
            return [tuple(atom for part in parts for atom in part) for parts in product(*parts)]
        if isinstance(expression, ax.ObjectUnionOf):
            return [body for operand in expression.operands for body in self._bodies(operand, x)]
        if isinstance(expression, ax.ObjectOneOf):
            return [(SameAtom((x, Constant(name))),) for name in expression.individuals]
        if isinstance(expression, ax.ObjectHasValue):
            return [(self._property(expression.prop, x, Constant(expression.individual)),)]
        if isinstance(expression, ax.ObjectHasSelf):
            return [(self._property(expression.prop, x, x),)]
        if isinstance(expression, ax.DataHasValue):
            value = Constant(value_of(expression.literal), True)
            return [(PredicateAtom(self.program.data(expression.prop), (x, value)),)]
        if isinstance(expression, ax.ObjectSomeValuesFrom):
            return self._related(expression.prop, expression.filler, x)
        if isinstance(expression, ax.DataSomeValuesFrom):
            return [self._valued(expression.prop, expression.range, x)]
        return self._labelled_bodies(expression, x)

    def _property(self, prop: ax.PropertyExpression, x: Term, y: Term) -> PredicateAtom:
        return property_atom(self.program, prop, x, y)

    def _related(self, prop: ax.PropertyExpression, filler: ClassExpression, x: Term) -> list[Body]:
        y = self._fresh()
        return [(self._property(prop, x, y), *body) for body in self._bodies(filler, y)]

    def _valued(self, prop: str, data_range: ax.DataRange, x: Term) -> Body:
        v = self._fresh()
        atom = PredicateAtom(self.program.data(prop), (x, v))
        test = self._test(data_range)
        return (atom,) if test is None else (atom, RangeAtom(test, (v,)))

    def _labelled_bodies(self, expression: ClassExpression, x: Term) -> list[Body]:
        """Bodies for an expression that needs a label beside them."""
        functional = self.hierarchy.is_functional
        if isinstance(expression, ax.ObjectMinCardinality):
            if expression.n == 0:
                return [()]
            if expression.n == 1:
                return self._related(expression.prop, expression.filler, x)
        elif isinstance(expression, ax.DataMinCardinality):
            if expression.n == 0:
                return [()]
            if expression.n == 1:
                return [self._valued(expression.prop, expression.range, x)]
        elif isinstance(expression, (ax.ObjectMaxCardinality, ax.DataMaxCardinality)):
            if expression.n >= 1 and functional(expression.prop):
                return [()]
        label = self._label(expression)
        bodies: list[Body] = [(PredicateAtom(label, (x,)),)]
        if isinstance(expression, ax.ObjectMinCardinality):
            if expression not in self._recognised:
                self._recognised.add(expression)
                prop, inverse = self._direction(expression.prop)
                filler = self._filler(expression.filler)
                condition = AtLeast(label, expression.n, prop, inverse, filler, self._origin)
                self.program.at_least.append(condition)
        elif isinstance(expression, ax.DataMinCardinality):
            if expression not in self._recognised:
                self._recognised.add(expression)
                data = self.program.data(expression.prop)
                test = self._test(expression.range)
                condition = AtLeast(label, expression.n, data, False, test, self._origin)
                self.program.at_least.append(condition)
        elif isinstance(expression, ax.ObjectExactCardinality):
            parts = (expression.n, expression.prop, expression.filler)
            if expression.n >= 1 and functional(expression.prop):
                return bodies + self._bodies(ax.ObjectMinCardinality(*parts), x)
        elif isinstance(expression, ax.DataExactCardinality):
            values = (expression.n, expression.prop, expression.range)
            if expression.n >= 1 and functional(expression.prop):
                return bodies + self._bodies(ax.DataMinCardinality(*values), x)
        elif isinstance(expression, ax.ObjectAllValuesFrom):
            if normal(expression.filler) == THING:
                return [()]
            if functional(expression.prop):
                return bodies + self._related(expression.prop, expression.filler, x)
        elif isinstance(expression, ax.DataAllValuesFrom):
            if functional(expression.prop):
                return [*bodies, self._valued(expression.prop, expression.range, x)]
        elif isinstance(expression, ax.ObjectComplementOf) and isinstance(expression.operand, str):
            self._complements[expression.operand] = label
        return bodies

    # --- right sides ---

    def _imply(self, body: Body, expression: ClassExpression, x: Term) -> None:
        """Adds the clauses by which the body makes `x` a member."""
        expression = normal(expression)
        if isinstance(expression, str):
            if expression == NOTHING:
                self._contradict(body, x)
            elif expression != THING:
                self._clause(body, PredicateAtom(self.program.cls(expression), (x,)))
        elif isinstance(expression, ax.ObjectIntersectionOf):
            for operand in expression.operands:
                self._attempt(self._imply, body, operand, x)
        elif isinstance(expression, ax.ObjectUnionOf):
            self._imply_union(body, expression, x)
        elif isinstance(expression, ax.ObjectOneOf):
            if len(expression.individuals) != 1:
                raise Unsupported(
                    'which of several individuals it is would need reasoning by cases'
                )
            self._clause(body, SameAtom((x, Constant(expression.individuals[0]))))
        elif isinstance(expression, ax.ObjectHasValue):
            self._clause(body, self._property(expression.prop, x, Constant(expression.individual)))
        elif isinstance(expression, ax.ObjectHasSelf):
            self._clause(body, self._property(expression.prop, x, x))
        elif isinstance(expression, ax.DataHasValue):
            value = Constant(value_of(expression.literal), True)
            self._clause(body, PredicateAtom(self.program.data(expression.prop), (x, value)))
        else:
            label = self._label(expression)
            if body != (PredicateAtom(label, (x,)),):
                self._clause(body, PredicateAtom(label, (x,)))
            if expression not in self._described:
                self._described.add(expression)
                self._describe(label, expression)

    def _contradict(self, body: Body, x: Term) -> None:
        self._clause(body, PredicateAtom(self.program.nothing, (x,)))

    def _imply_union(self, body: Body, expression: ax.ObjectUnionOf, x: Term) -> None:
        positive: list[ClassExpression] = []
        for operand in expression.operands:
            opposite = negated(operand)
            if is_positive(opposite) and not is_positive(operand):
                alternatives = self._bodies(opposite, x)
                if len(alternatives) != 1:
                    raise Unsupported('a union on the right side needs reasoning by cases')
                body = (*body, *alternatives[0])
            else:
                positive.append(operand)
        if len(positive) > 1:
            raise Unsupported('a union on the right side needs reasoning by cases')
        self._imply(body, positive[0] if positive else NOTHING, x)

    def _describe(self, label: Predicate, expression: ClassExpression) -> None:
        """What membership in a labelled expression implies."""
        x, body = _X, (PredicateAtom(label, (_X,)),)
        program = self.program
        if isinstance(expression, (ax.ObjectSomeValuesFrom, ax.ObjectMinCardinality)):
            n = expression.n if isinstance(expression, ax.ObjectMinCardinality) else 1
            filler = normal(expression.filler)
            if n == 1 and isinstance(filler, ax.ObjectOneOf) and len(filler.individuals) == 1:
                self._clause(
                    body, self._property(expression.prop, x, Constant(filler.individuals[0]))
                )
            elif n > 0:
                prop, inverse = self._direction(expression.prop)
                program.existentials.append(Existential(label, n, prop, inverse, filler))
                if n == 1 and self.hierarchy.is_functional(expression.prop):
                    y = self._fresh()
                    self._imply((*body, self._property(expression.prop, x, y)), filler, y)
        elif isinstance(expression, (ax.DataSomeValuesFrom, ax.DataMinCardinality)):
            n = expression.n if isinstance(expression, ax.DataMinCardinality) else 1
            data = program.data(expression.prop)
            if n > 0:
                self._test(expression.range)
                value_range = self._defined(expression.range, ())
                program.existentials.append(Existential(label, n, data, False, value_range))
            if n > 0 and self.hierarchy.is_functional(expression.prop):
                self._only(body, expression.prop, expression.range)
        elif isinstance(expression, ax.ObjectAllValuesFrom):
            y = self._fresh()
            self._imply((*body, self._property(expression.prop, x, y)), expression.filler, y)
        elif isinstance(expression, ax.DataAllValuesFrom):
            self._only(body, expression.prop, expression.range)
        elif isinstance(expression, ax.ObjectMaxCardinality):
            prop, inverse = self._direction(expression.prop)
            if expression.n == 0:
                for related in self._related(expression.prop, expression.filler, x):
                    self._contradict((*body, *related), x)
            else:
                filler_label = self._filler(expression.filler)
                program.at_most.append(
                    AtMost(label, expression.n, prop, inverse, filler_label, self._origin)
                )
        elif isinstance(expression, ax.DataMaxCardinality):
            data = program.data(expression.prop)
            if expression.n == 0:
                self._contradict((*body, *self._valued(expression.prop, expression.range, x)), x)
            else:
                test = self._test(expression.range)
                program.at_most.append(AtMost(label, expression.n, data, False, test, self._origin))
        elif isinstance(expression, ax.ObjectExactCardinality):
            parts = (expression.n, expression.prop, expression.filler)
            self._imply(body, ax.ObjectMinCardinality(*parts), x)
            self._imply(body, ax.ObjectMaxCardinality(*parts), x)
        elif isinstance(expression, ax.DataExactCardinality):
            values = (expression.n, expression.prop, expression.range)
            self._imply(body, ax.DataMinCardinality(*values), x)
            self._imply(body, ax.DataMaxCardinality(*values), x)
        elif isinstance(expression, ax.ObjectComplementOf):
            if isinstance(expression.operand, str):
                self._disjoint(label, program.cls(expression.operand))
            else:
                for other in self._bodies(expression.operand, x):
                    self._contradict((*body, *other), x)

    def _only(self, body: Body, prop: str, data_range: ax.DataRange) -> None:
        test = self._test(data_range)
        if test is not None:
            v = self._fresh()
            atom = PredicateAtom(self.program.data(prop), (_X, v))
            self._contradict((*body, atom, RangeAtom(_Outside(test), (v,))), _X)

    def _disjoint(self, first: Predicate, second: Predicate) -> None:
        if first is second:
            self._contradict((PredicateAtom(first, (_X,)),), _X)
        else:
            first.disjoint.add(second)
            second.disjoint.add(first)

    # --- axioms ---

    def _axiom(self, axiom: Axiom) -> None:
        if isinstance(axiom, ax.SubClassOf):
            self._sub_class(axiom.sub, axiom.sup)
        elif isinstance(axiom, ax.EquivalentClasses):
            for sub in axiom.classes:
                for sup in axiom.classes:
                    if sub is not sup:
                        self._attempt(self._sub_class, sub, sup)
        elif isinstance(axiom, ax.DisjointClasses):
            self._all_disjoint(axiom.classes)
        elif isinstance(axiom, ax.DisjointUnion):
            self._all_disjoint(axiom.classes)
            for part in axiom.classes:
                self._attempt(self._sub_class, part, axiom.cls)
            self._attempt(self._sub_class, axiom.cls, ax.ObjectUnionOf(axiom.classes))
        elif isinstance(axiom, ax.Rule):
            from surveillance_ontology.reasoner.swrl_rules import normalise_rule

            normalise_rule(self, axiom)
        elif isinstance(axiom, ax.Import):
            raise Unsupported('imports are not followed')
        elif isinstance(axiom, ax.HasKey):
            self._key(axiom)
        elif not isinstance(axiom, (ax.Declaration, ax.DatatypeDefinition)):
            from surveillance_ontology.reasoner.property_axioms import normalise_property_axiom

            normalise_property_axiom(self, axiom)

    def _sub_class(self, sub: ClassExpression, sup: ClassExpression) -> None:
        sub, sup = normal(sub), normal(sup)
        if isinstance(sub, ax.ObjectUnionOf):
            for operand in sub.operands:
                self._attempt(self._sub_class, operand, sup)
            return
        if isinstance(sub, str) and isinstance(sup, ax.ObjectComplementOf):
            if isinstance(sup.operand, str):
                self._disjoint(self._label(sub), self._label(sup.operand))
        for body in self._bodies(sub, _X):
            self._imply(body, sup, _X)

    def _all_disjoint(self, classes: tuple[ClassExpression, ...]) -> None:
        labels = [self._recognise(normal(expression)) for expression in classes]
        for position, first in enumerate(labels):
            for second in labels[position + 1 :]:
                self._disjoint(first, second)

    def _key(self, axiom: ax.HasKey) -> None:
        props = [self._direction(prop) for prop in axiom.object_props]
        props += [(self.program.data(prop), False) for prop in axiom.data_props]
        if props:
            cls = self._filler(axiom.cls)
            self.program.keys.append(Key(cls, tuple(props), axiom))

    # --- for the modules that normalise properties and rules ---

    imply, bodies, clause, contradict, fresh = _imply, _bodies, _clause, _contradict, _fresh
    test, only, property = _test, _only, _property
    different = DifferentAtom


class _Outside:
    """The complement of a test, comparable so that equal conditions fall together."""

    __slots__ = ('_test',)

    def __init__(self, test: Test) -> None:
        self._test = test

    def __call__(self, value: Value) -> bool:
        return not self._test(value)


def includes(outer: ax.DataRange, inner: ax.DataRange) -> bool:
    """Whether every value of `inner` is known to be in `outer` (sound, not complete)."""
    if outer == inner or outer == ax.TOP_LITERAL:
        return True
    if isinstance(inner, ax.DatatypeRestriction):
        return includes(outer, inner.datatype)
    if isinstance(inner, ax.DataOneOf):
        test = range_test(outer)
        return test is not None and all(test(value_of(literal)) for literal in inner.literals)
    if isinstance(inner, ax.DataUnionOf):
        return all(includes(outer, operand) for operand in inner.operands)
    if isinstance(inner, ax.DataIntersectionOf):
        return any(includes(outer, operand) for operand in inner.operands)
    if isinstance(outer, ax.DataUnionOf):
        return any(includes(operand, inner) for operand in outer.operands)
    if isinstance(outer, str) and isinstance(inner, str):
        return outer in _WIDER.get(inner, ())
    return False


def _wider() -> dict[str, set[str]]:
    below = {
        'decimal': ('integer',),
        'integer': ('nonPositiveInteger', 'long', 'nonNegativeInteger'),
        'nonPositiveInteger': ('negativeInteger',),
        'long': ('int', 'unsignedInt'),
        'int': ('short', 'unsignedShort'),
        'short': ('byte', 'unsignedByte'),
        'nonNegativeInteger': ('positiveInteger', 'unsignedLong'),
        'unsignedLong': ('unsignedInt',),
        'unsignedInt': ('unsignedShort',),
        'unsignedShort': ('unsignedByte',),
        'string': ('normalizedString',),
        'normalizedString': ('token',),
        'token': ('language', 'NMTOKEN', 'Name'),
        'Name': ('NCName',),
        'dateTime': ('dateTimeStamp',),
    }
    wider: dict[str, set[str]] = {}

    def mark(name: str, above: set[str]) -> None:
        wider.setdefault(ax.XSD + name, set()).update(above)
        for child in below.get(name, ()):
            mark(child, above | {ax.XSD + name})

    for name in below:
        mark(name, set())
    for name in ('decimal', 'integer'):
        wider.setdefault(ax.XSD + name, set()).update((ax.OWL + 'real', ax.OWL + 'rational'))
    return wider


_WIDER = _wider()
