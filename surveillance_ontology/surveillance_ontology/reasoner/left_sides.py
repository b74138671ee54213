"""Class expressions as bodies of clauses: by which facts an individual is known to be a member."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axiom_text import axiom_text, expression_text
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import ClassExpression
from surveillance_ontology.owl.vocabulary import NOTHING, THING, TOP_LITERAL, local_name
from surveillance_ontology.reasoner.clauses import (
    AtLeast,
    BodyAtom,
    Clause,
    Constant,
    HeadAtom,
    Predicate,
    PredicateAtom,
    Program,
    RangeAtom,
    SameAtom,
    Term,
    property_atom,
)
from surveillance_ontology.reasoner.data_inclusion import includes
from surveillance_ontology.reasoner.datatypes import Test, Value, range_test, value_of
from surveillance_ontology.reasoner.normal_forms import normal
from surveillance_ontology.reasoner.property_hierarchy import PropertyHierarchy

Body = tuple[BodyAtom, ...]
_X, _Y = 0, 1


class Unsupported(Exception):
    """Part of an axiom is outside the fragment; the text says which."""


class LeftSides:
    """Collects clauses in `program`; recognises members of class expressions.

    Args:
        tbox: The axioms to come; datatype definitions and property inclusions are looked up.
        abstract: Whether values may be stand-ins ('some', range) for an unknown value in a range.
    """

    def __init__(self, tbox: list[Axiom], abstract: bool) -> None:
        self.program = Program()
        self._abstract = abstract
        self._variables = _Y
        self._described: set[ClassExpression] = set()
        self._recognised: set[ClassExpression] = set()
        self._complements: dict[str, Predicate] = {}
        self._origin: Axiom | None = None
        self._context = 'the ontology'
        self._datatypes = {
            axiom.datatype: axiom.range
            for axiom in tbox
            if isinstance(axiom, ax.DatatypeDefinition)
        }
        self.hierarchy = PropertyHierarchy(tbox)

    def _attempt(self, add: Callable[..., object], *parts: Any) -> None:
        """Adds what can be added of an axiom; the rest is reported."""
        try:
            add(*parts)
        except Unsupported as reason:
            subject = self._context if self._origin is None else axiom_text(self._origin)
            text = f'{subject}: {reason}'
            if text not in self.program.unsupported:
                self.program.unsupported.append(text)

    # --- clauses ---

    def fresh(self) -> int:
        self._variables += 1
        return self._variables

    def clause(self, body: Body, head: HeadAtom) -> None:
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
            for body in self.bodies(expression, _X):
                if body != (PredicateAtom(label, (_X,)),):
                    self.clause(body, PredicateAtom(label, (_X,)))
        return label

    def _filler(self, expression: ClassExpression) -> Predicate | None:
        expression = normal(expression)
        return None if expression == THING else self._recognise(expression)

    def _direction(self, prop: ex.PropertyExpression) -> tuple[Predicate, bool]:
        if isinstance(prop, str):
            return self.program.object(prop), False
        return self.program.object(prop.prop), True

    def test(self, data_range: ex.DataRange) -> Test | None:
        """The test of a range, None where it admits every value."""
        data_range = self._defined(data_range, ())
        if data_range == TOP_LITERAL:
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

    def _defined(self, data_range: ex.DataRange, seen: tuple[str, ...]) -> ex.DataRange:
        if isinstance(data_range, str):
            definition = self._datatypes.get(data_range)
            if definition is None:
                return data_range
            if data_range in seen:
                raise Unsupported(f'the datatype {local_name(data_range)} is defined by itself')
            return self._defined(definition, (*seen, data_range))
        if isinstance(data_range, (ex.DataIntersectionOf, ex.DataUnionOf)):
            kind = type(data_range)
            return kind(tuple(self._defined(operand, seen) for operand in data_range.operands))
        if isinstance(data_range, ex.DataComplementOf):
            return ex.DataComplementOf(self._defined(data_range.operand, seen))
        return data_range

    # --- left sides ---

    def bodies(self, expression: ClassExpression, x: Term) -> list[Body]:
        """Bodies each of which makes `x` a member."""
        expression = normal(expression)
        if isinstance(expression, str):
            if expression == THING:
                return [()]
            if expression == NOTHING:
                return [(PredicateAtom(self.program.nothing, (x,)),)]
            return [(PredicateAtom(self.program.cls(expression), (x,)),)]
        if isinstance(expression, ex.ObjectIntersectionOf):
            parts = [self.bodies(operand, x) for operand in expression.operands]
            return [tuple(atom for part in parts for atom in part) for parts in product(*parts)]
        if isinstance(expression, ex.ObjectUnionOf):
            return [body for operand in expression.operands for body in self.bodies(operand, x)]
        if isinstance(expression, ex.ObjectOneOf):
            return [(SameAtom((x, Constant(name))),) for name in expression.individuals]
        if isinstance(expression, ex.ObjectHasValue):
            return [(self.property(expression.prop, x, Constant(expression.individual)),)]
        if isinstance(expression, ex.ObjectHasSelf):
            return [(self.property(expression.prop, x, x),)]
        if isinstance(expression, ex.DataHasValue):
            value = Constant(value_of(expression.literal), True)
            return [(PredicateAtom(self.program.data(expression.prop), (x, value)),)]
        if isinstance(expression, ex.ObjectSomeValuesFrom):
            return self._related(expression.prop, expression.filler, x)
        if isinstance(expression, ex.DataSomeValuesFrom):
            return [self._valued(expression.prop, expression.range, x)]
        return self._labelled_bodies(expression, x)

    def property(self, prop: ex.PropertyExpression, x: Term, y: Term) -> PredicateAtom:
        return property_atom(self.program, prop, x, y)

    def _related(self, prop: ex.PropertyExpression, filler: ClassExpression, x: Term) -> list[Body]:
        y = self.fresh()
        return [(self.property(prop, x, y), *body) for body in self.bodies(filler, y)]

    def _valued(self, prop: str, data_range: ex.DataRange, x: Term) -> Body:
        v = self.fresh()
        atom = PredicateAtom(self.program.data(prop), (x, v))
        test = self.test(data_range)
        return (atom,) if test is None else (atom, RangeAtom(test, (v,)))

    def _labelled_bodies(self, expression: ClassExpression, x: Term) -> list[Body]:
        """Bodies for an expression that needs a label beside them."""
        functional = self.hierarchy.is_functional
        if isinstance(expression, ex.ObjectMinCardinality):
            if expression.n == 0:
                return [()]
            if expression.n == 1:
                return self._related(expression.prop, expression.filler, x)
        elif isinstance(expression, ex.DataMinCardinality):
            if expression.n == 0:
                return [()]
            if expression.n == 1:
                return [self._valued(expression.prop, expression.range, x)]
        elif isinstance(expression, (ex.ObjectMaxCardinality, ex.DataMaxCardinality)) and (
            expression.n >= 1 and functional(expression.prop)
        ):
            return [()]
        label = self._label(expression)
        bodies: list[Body] = [(PredicateAtom(label, (x,)),)]
        if isinstance(expression, (ex.ObjectMinCardinality, ex.DataMinCardinality)):
            self._count(label, expression)
        elif isinstance(expression, ex.ObjectExactCardinality):
            parts = (expression.n, expression.prop, expression.filler)
            if expression.n >= 1 and functional(expression.prop):
                return bodies + self.bodies(ex.ObjectMinCardinality(*parts), x)
        elif isinstance(expression, ex.DataExactCardinality):
            values = (expression.n, expression.prop, expression.range)
            if expression.n >= 1 and functional(expression.prop):
                return bodies + self.bodies(ex.DataMinCardinality(*values), x)
        elif isinstance(expression, ex.ObjectAllValuesFrom):
            if normal(expression.filler) == THING:
                return [()]
            if functional(expression.prop):
                return bodies + self._related(expression.prop, expression.filler, x)
        elif isinstance(expression, ex.DataAllValuesFrom):
            if functional(expression.prop):
                return [*bodies, self._valued(expression.prop, expression.range, x)]
        elif isinstance(expression, ex.ObjectComplementOf) and isinstance(expression.operand, str):
            self._complements[expression.operand] = label
        return bodies

    def _count(
        self, label: Predicate, expression: ex.ObjectMinCardinality | ex.DataMinCardinality
    ) -> None:
        """Has a label recognised by counting."""
        if expression in self._recognised:
            return
        self._recognised.add(expression)
        filler: Predicate | Test | None
        if isinstance(expression, ex.ObjectMinCardinality):
            prop, inverse = self._direction(expression.prop)
            filler = self._filler(expression.filler)
        else:
            prop, inverse = self.program.data(expression.prop), False
            filler = self.test(expression.range)
        condition = AtLeast(label, expression.n, prop, inverse, filler, self._origin)
        self.program.at_least.append(condition)
