"""Class expressions as heads of clauses: what membership implies."""

from __future__ import annotations

from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.expressions import ClassExpression
from surveillance_ontology.owl.vocabulary import NOTHING, THING
from surveillance_ontology.reasoner.clauses import (
    AtMost,
    Constant,
    Existential,
    Predicate,
    PredicateAtom,
    RangeAtom,
    SameAtom,
    Term,
)
from surveillance_ontology.reasoner.datatypes import Test, Value, value_of
from surveillance_ontology.reasoner.left_sides import Body, LeftSides, Unsupported
from surveillance_ontology.reasoner.normal_forms import is_positive, negated, normal

_X = 0


class RightSides(LeftSides):
    """Adds what follows from membership in class expressions."""

    # --- right sides ---

    def imply(self, body: Body, expression: ClassExpression, x: Term) -> None:
        """Adds the clauses by which the body makes `x` a member."""
        expression = normal(expression)
        if isinstance(expression, str):
            if expression == NOTHING:
                self.contradict(body, x)
            elif expression != THING:
                self.clause(body, PredicateAtom(self.program.cls(expression), (x,)))
        elif isinstance(expression, ex.ObjectIntersectionOf):
            for operand in expression.operands:
                self._attempt(self.imply, body, operand, x)
        elif isinstance(expression, ex.ObjectUnionOf):
            self._imply_union(body, expression, x)
        elif isinstance(expression, ex.ObjectOneOf):
            if len(expression.individuals) != 1:
                raise Unsupported(
                    'which of several individuals it is would need reasoning by cases'
                )
            self.clause(body, SameAtom((x, Constant(expression.individuals[0]))))
        elif isinstance(expression, ex.ObjectHasValue):
            self.clause(body, self.property(expression.prop, x, Constant(expression.individual)))
        elif isinstance(expression, ex.ObjectHasSelf):
            self.clause(body, self.property(expression.prop, x, x))
        elif isinstance(expression, ex.DataHasValue):
            value = Constant(value_of(expression.literal), True)
            self.clause(body, PredicateAtom(self.program.data(expression.prop), (x, value)))
        else:
            label = self._label(expression)
            if body != (PredicateAtom(label, (x,)),):
                self.clause(body, PredicateAtom(label, (x,)))
            if expression not in self._described:
                self._described.add(expression)
                self._describe(label, expression)

    def contradict(self, body: Body, x: Term) -> None:
        self.clause(body, PredicateAtom(self.program.nothing, (x,)))

    def _imply_union(self, body: Body, expression: ex.ObjectUnionOf, x: Term) -> None:
        positive: list[ClassExpression] = []
        for operand in expression.operands:
            opposite = negated(operand)
            if is_positive(opposite) and not is_positive(operand):
                alternatives = self.bodies(opposite, x)
                if len(alternatives) != 1:
                    raise Unsupported('a union on the right side needs reasoning by cases')
                body = (*body, *alternatives[0])
            else:
                positive.append(operand)
        if len(positive) > 1:
            raise Unsupported('a union on the right side needs reasoning by cases')
        self.imply(body, positive[0] if positive else NOTHING, x)

    def _describe(self, label: Predicate, expression: ClassExpression) -> None:
        """What membership in a labelled expression implies."""
        x, body = _X, (PredicateAtom(label, (_X,)),)
        program = self.program
        if isinstance(expression, (ex.ObjectSomeValuesFrom, ex.ObjectMinCardinality)):
            n = expression.n if isinstance(expression, ex.ObjectMinCardinality) else 1
            filler = normal(expression.filler)
            if n == 1 and isinstance(filler, ex.ObjectOneOf) and len(filler.individuals) == 1:
                self.clause(
                    body, self.property(expression.prop, x, Constant(filler.individuals[0]))
                )
            elif n > 0:
                prop, inverse = self._direction(expression.prop)
                program.existentials.append(Existential(label, n, prop, inverse, filler))
                if n == 1 and self.hierarchy.is_functional(expression.prop):
                    y = self.fresh()
                    self.imply((*body, self.property(expression.prop, x, y)), filler, y)
        elif isinstance(expression, (ex.DataSomeValuesFrom, ex.DataMinCardinality)):
            n = expression.n if isinstance(expression, ex.DataMinCardinality) else 1
            data = program.data(expression.prop)
            if n > 0:
                self.test(expression.range)
                value_range = self._defined(expression.range, ())
                program.existentials.append(Existential(label, n, data, False, value_range))
            if n > 0 and self.hierarchy.is_functional(expression.prop):
                self.only(body, expression.prop, expression.range)
        elif isinstance(expression, ex.ObjectAllValuesFrom):
            y = self.fresh()
            self.imply((*body, self.property(expression.prop, x, y)), expression.filler, y)
        elif isinstance(expression, ex.DataAllValuesFrom):
            self.only(body, expression.prop, expression.range)
        elif isinstance(expression, ex.ObjectMaxCardinality):
            prop, inverse = self._direction(expression.prop)
            if expression.n == 0:
                for related in self._related(expression.prop, expression.filler, x):
                    self.contradict((*body, *related), x)
            else:
                filler_label = self._filler(expression.filler)
                program.at_most.append(
                    AtMost(label, expression.n, prop, inverse, filler_label, self._origin)
                )
        elif isinstance(expression, ex.DataMaxCardinality):
            data = program.data(expression.prop)
            if expression.n == 0:
                self.contradict((*body, *self._valued(expression.prop, expression.range, x)), x)
            else:
                test = self.test(expression.range)
                program.at_most.append(AtMost(label, expression.n, data, False, test, self._origin))
        elif isinstance(expression, ex.ObjectExactCardinality):
            parts = (expression.n, expression.prop, expression.filler)
            self.imply(body, ex.ObjectMinCardinality(*parts), x)
            self.imply(body, ex.ObjectMaxCardinality(*parts), x)
        elif isinstance(expression, ex.DataExactCardinality):
            values = (expression.n, expression.prop, expression.range)
            self.imply(body, ex.DataMinCardinality(*values), x)
            self.imply(body, ex.DataMaxCardinality(*values), x)
        elif isinstance(expression, ex.ObjectComplementOf):
            if isinstance(expression.operand, str):
                self._disjoint(label, program.cls(expression.operand))
            else:
                for other in self.bodies(expression.operand, x):
                    self.contradict((*body, *other), x)

    def only(self, body: Body, prop: str, data_range: ex.DataRange) -> None:
        test = self.test(data_range)
        if test is not None:
            v = self.fresh()
            atom = PredicateAtom(self.program.data(prop), (_X, v))
            self.contradict((*body, atom, RangeAtom(_Outside(test), (v,))), _X)

    def _disjoint(self, first: Predicate, second: Predicate) -> None:
        if first is second:
            self.contradict((PredicateAtom(first, (_X,)),), _X)
        else:
            first.disjoint.add(second)
            second.disjoint.add(first)


class _Outside:
    """The complement of a test, comparable so that equal conditions fall together."""

    __slots__ = ('_test',)

    def __init__(self, test: Test) -> None:
        self._test = test

    def __call__(self, value: Value) -> bool:
        return not self._test(value)
