"""Translates axioms into Horn clauses and counting conditions.

A class expression that cannot be written in a clause's body (a cardinality, `only`, a complement)
becomes a label: a predicate that holds of what is known to belong to the expression. What no Horn
clause can express is reported, with the axiom, in `Program.unsupported`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import product
from typing import Any

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axiom_text import axiom_text, expression_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import ClassExpression, PropertyExpression
from owl_reasoner.owl.vocabulary import (
    BOTTOM,
    BOTTOM_DATA,
    NOTHING,
    OWL,
    THING,
    local_name,
)
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import (
    AtLeast,
    AtMost,
    BodyAtom,
    Clause,
    ComputedAtom,
    Constant,
    DifferentAtom,
    Existential,
    HeadAtom,
    Key,
    Partial,
    Predicate,
    PredicateAtom,
    Program,
    RangeAtom,
    SameAtom,
    Term,
    UnsupportedError,
    property_atom,
)
from owl_reasoner.reasoner.datatypes import value_of
from owl_reasoner.reasoner.inclusions import (
    PropertyHierarchy,
    class_inclusions,
    directed,
    property_inclusions,
)
from owl_reasoner.reasoner.normal_form import is_positive, normal_form
from owl_reasoner.reasoner.rules import RuleTerms, computed_atom, safe_body
from owl_reasoner.reasoner.value_sets import EVERY, ValueSet, values_of

Body = tuple[BodyAtom, ...]
_X, _Y, _Z = 0, 1, 2
_INCLUDING = (
    *(ax.SubClassOf, ax.EquivalentClasses, ax.DisjointClasses, ax.DisjointUnion),
    *(ax.ObjectPropertyDomain, ax.DataPropertyDomain, ax.ReflexiveObjectProperty),
)
"""Axioms that are translated as the inclusions of classes that they stand for."""
_NEGATIVE = (
    ex.ObjectComplementOf,
    ex.ObjectAllValuesFrom,
    ex.ObjectMaxCardinality,
    ex.DataAllValuesFrom,
    ex.DataMaxCardinality,
)
_RELATING = (
    ex.ObjectSomeValuesFrom,
    ex.ObjectMinCardinality,
    ex.ObjectHasValue,
    ex.ObjectHasSelf,
    ex.DataSomeValuesFrom,
    ex.DataMinCardinality,
    ex.DataHasValue,
)


class Translation:
    """Builds a `Program` from axioms that are not assertions.

    Large because it has one short method for each kind of axiom and expression.

    Args:
        axioms: The ontology's axioms; assertions and annotations among them are passed over.
        asserted: Complex class expressions that individuals are asserted to belong to.
        negated: Properties with negative assertions, as pairs (kind, IRI), kind 'object' or 'data'.
        budget: What it may use.

    Attributes:
        program: The result.
        hierarchy: The property inclusions.
    """

    def __init__(
        self,
        axioms: Iterable[Axiom],
        asserted: Iterable[ClassExpression] = (),
        negated: Iterable[tuple[str, str]] = (),
        budget: Budget | None = None,
    ) -> None:
        budget = budget or Budget()
        budget.stage, budget.at_work = 'reading axioms', self._subject
        tbox = [axiom for axiom in axioms if not isinstance(axiom, (ax.Assertion, ax.Annotation))]
        self.program = Program()
        self._properties, self._rules = _PropertyAxioms(self), _Rules(self)
        self._variables = _Y
        self._described: set[ClassExpression] = set()
        self._recognised: set[ClassExpression] = set()
        self._counted: set[Predicate] = set()
        self._complements: dict[str, Predicate] = {}
        self._origin: Axiom | None = None
        self._context = 'the ontology'
        self._datatypes = {
            axiom.datatype: axiom.range
            for axiom in tbox
            if isinstance(axiom, ax.DatatypeDefinition)
        }
        self.hierarchy = PropertyHierarchy(tbox)
        for axiom in tbox:
            self._origin = axiom
            budget.tick()
            self._attempt(self._axiom, axiom)
        self._origin = None
        for expression in asserted:
            self._context = f'assertions of {expression_text(expression)}'
            self.required(expression)
        for kind, iri in negated:
            self._negate(kind, iri)
        self._top_and_bottom()
        self._complement_labels()
        if any(
            isinstance(clause.head, PredicateAtom) and clause.head.predicate is self.program.apart
            for clause in self.program.clauses
        ):
            self.contradict((self.differs(_X, _X),), _X)
        if self.program.uses_thing:
            self._state_named()

    def _state_named(self) -> None:
        """State that the individuals which axioms name exist."""
        program = self.program
        atoms = (atom for clause in program.clauses for atom in (*clause.body, clause.head))
        terms = dict.fromkeys(term for atom in atoms for term in atom.terms)
        for term in terms:
            if isinstance(term, Constant) and not term.is_value:
                program.clauses.append(Clause((), PredicateAtom(program.thing, (term,))))

    def report(self, reason: str) -> None:
        """Note a part of the axiom at hand that is not used."""
        text = self._sentence(reason)
        if text not in self.program.unsupported:
            self.program.unsupported.append(text)

    def _sentence(self, reason: str) -> str:
        return f'{self._subject()}: {reason}'

    def _subject(self) -> str:
        return self._context if self._origin is None else axiom_text(self._origin)

    def _attempt(self, add: Callable[..., object], *parts: Any) -> None:
        """Add what can be added of an axiom; the rest is reported."""
        try:
            add(*parts)
        except UnsupportedError as reason:
            self.report(str(reason))

    # --- clauses ---

    def fresh(self) -> int:
        """Return the number of a variable that stands in no clause yet."""
        self._variables += 1
        return self._variables

    def clause(self, body: Body, head: HeadAtom, defines: bool = False) -> None:
        """Add a clause; one of a rule is about named individuals, unless it defines a label."""
        program = self.program
        bound = {term for atom in body for term in atom.terms if isinstance(term, int)}
        loose = [term for term in head.terms if isinstance(term, int) and term not in bound]
        # A head about somebody of whom the body says nothing: he has to exist, so the body says
        # that.
        for term in dict.fromkeys(loose):
            program.uses_thing = True
            body = (*body, PredicateAtom(program.thing, (term,)))
        # DL-safe rules (Motik, Sattler and Studer, 2005); a label is defined for everybody, whoever
        # asks for it.
        named_only = isinstance(self._origin, ax.Rule) and not defines
        program.clauses.append(Clause(tuple(dict.fromkeys(body)), head, self._origin, named_only))

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
        """Return a label that holds of everything known to belong to the expression."""
        label = self._label(expression)
        if not isinstance(expression, str) and expression not in self._recognised:
            self._recognised.add(expression)
            for body in self.bodies(expression, _X):
                if body != (PredicateAtom(label, (_X,)),):
                    self.clause(body, PredicateAtom(label, (_X,)), defines=True)
        return label

    def _filler(self, expression: ClassExpression) -> Predicate | None:
        expression = normal_form(expression)
        return None if expression == THING else self._recognise(expression)

    def _direction(self, prop: ex.PropertyExpression) -> tuple[Predicate, bool]:
        if isinstance(prop, str):
            return self.program.object(prop), False
        return self.program.object(prop.prop), True

    def values(self, data_range: ex.DataRange) -> ValueSet | None:
        """Return the values of a range, None where these are all that there are.

        Raises:
            UnsupportedError: The range is not supported.
        """
        try:
            values = values_of(data_range, self._datatypes)
        except ValueError as error:
            raise UnsupportedError(str(error)) from None
        return None if values is EVERY else values

    # --- antecedents ---

    def bodies(self, expression: ClassExpression, x: Term) -> list[Body]:
        """Return the bodies each of which makes `x` a member."""
        expression = normal_form(expression)
        if expression == THING:
            return [()]
        fact = self._fact(expression, x)
        if fact is not None:
            return [(fact,)]
        if isinstance(expression, ex.ObjectIntersectionOf):
            return self._intersection(expression.operands, x)
        if isinstance(expression, ex.ObjectUnionOf):
            return [body for operand in expression.operands for body in self.bodies(operand, x)]
        if isinstance(expression, ex.ObjectOneOf):
            return [(SameAtom((x, Constant(name))),) for name in expression.individuals]
        if isinstance(expression, ex.ObjectSomeValuesFrom):
            return self._related(expression.prop, expression.filler, x)
        if isinstance(expression, ex.DataSomeValuesFrom):
            return [self._valued(expression.prop, expression.range, x)]
        return self._labelled_bodies(expression, x)

    def _fact(self, expression: ClassExpression, x: Term) -> PredicateAtom | None:
        """Return the atom that says as much of `x` as the expression; None where no one does."""
        if isinstance(expression, str):
            return PredicateAtom(self._label(expression), (x,))
        if isinstance(expression, ex.ObjectHasValue):
            return self.property(expression.prop, x, Constant(expression.individual))
        if isinstance(expression, ex.ObjectHasSelf):
            return self.property(expression.prop, x, x)
        if isinstance(expression, ex.DataHasValue):
            value = Constant(value_of(expression.literal), True)
            return PredicateAtom(self.program.data(expression.prop), (x, value))
        return None

    def property(self, prop: ex.PropertyExpression, x: Term, y: Term) -> PredicateAtom:
        """Return the atom that relates two terms; an inverse turns them."""
        return property_atom(self.program, prop, x, y)

    def _related(self, prop: ex.PropertyExpression, filler: ClassExpression, x: Term) -> list[Body]:
        y = self.fresh()
        return [(self.property(prop, x, y), *body) for body in self.simple_bodies(filler, y)]

    def simple_bodies(self, expression: ClassExpression, y: Term) -> list[Body]:
        """Return the bodies that relate `y` to nothing: restrictions in the expression become
        labels.

        So every clause speaks of one individual and what it is directly related to, which is what
        `classification` needs.
        """
        expression = normal_form(expression)
        if isinstance(expression, (str, ex.ObjectOneOf)):
            return self.bodies(expression, y)
        if isinstance(expression, ex.ObjectIntersectionOf) and all(
            isinstance(operand, str) for operand in expression.operands
        ):
            return self.bodies(expression, y)
        if isinstance(expression, ex.ObjectUnionOf):
            parts = [self.simple_bodies(operand, y) for operand in expression.operands]
            return [body for part in parts for body in part]
        return [(PredicateAtom(self._recognise(expression), (y,)),)]

    def _intersection(self, operands: tuple[ClassExpression, ...], x: Term) -> list[Body]:
        """Return the bodies for what is in every operand, at most one of which is spelt out as a
        relation.
        """
        # The product of the alternatives of all operands grows exponentially: all but one get a
        # label, which has its alternatives once.
        spelt_out = [one for one in operands if isinstance(one, (*_RELATING, ex.ObjectUnionOf))]
        parts: list[list[Body]] = []
        for operand in operands:
            if len(spelt_out) > 1 and operand in spelt_out:
                parts.append([(PredicateAtom(self._recognise(operand), (x,)),)])
            else:
                parts.append(self.bodies(operand, x))
        return [tuple(atom for part in choice for atom in part) for choice in product(*parts)]

    def _valued(self, prop: str, data_range: ex.DataRange, x: Term) -> Body:
        v = self.fresh()
        atom = PredicateAtom(self.program.data(prop), (x, v))
        values = self.values(data_range)
        return (atom,) if values is None else (atom, RangeAtom(values, (v,)))

    def _labelled_bodies(self, expression: ClassExpression, x: Term) -> list[Body]:
        """Return the bodies for an expression that needs a label beside them."""
        functional = self.hierarchy.is_functional
        if isinstance(expression, (ex.ObjectMaxCardinality, ex.DataMaxCardinality)) and (
            functional(expression.prop)
        ):
            return [()]
        label = self._label(expression)
        bodies: list[Body] = [(PredicateAtom(label, (x,)),)]
        decided_by: tuple[Predicate, int] | None = None
        if isinstance(expression, (ex.ObjectMinCardinality, ex.DataMinCardinality)):
            self._count(label, expression)
        elif isinstance(expression, ex.ObjectAllValuesFrom):
            if functional(expression.prop):
                bodies += self._related(expression.prop, expression.filler, x)
                prop, inverse = self._direction(expression.prop)
                decided_by = prop, int(inverse)
        elif isinstance(expression, ex.DataAllValuesFrom):
            if functional(expression.prop):
                bodies.append(self._valued(expression.prop, expression.range, x))
                decided_by = self.program.data(expression.prop), 0
        elif isinstance(expression, ex.ObjectComplementOf) and isinstance(expression.operand, str):
            self._complements[expression.operand] = label
        # Not being in a class cannot be derived by Horn clauses from what is absent (open world):
        # reported, unless the hypertableau takes over.
        if isinstance(expression, _NEGATIVE):
            text = self._sentence(
                f'not all members of {expression_text(expression)} are recognised'
            )
            self.program.partial.append(Partial(label, text, decided_by))
        return bodies

    def _count(
        self, label: Predicate, expression: ex.ObjectMinCardinality | ex.DataMinCardinality
    ) -> None:
        """Have a label recognised by counting."""
        if label in self._counted:
            return
        self._counted.add(label)
        condition = AtLeast(label, expression.n, *self._counts(expression), self._origin)
        self.program.at_least.append(condition)

    def _counts(
        self,
        expression: ex.ObjectMinCardinality
        | ex.DataMinCardinality
        | ex.ObjectMaxCardinality
        | ex.DataMaxCardinality,
    ) -> tuple[Predicate, bool, Predicate | ValueSet | None]:
        """Return what is counted: by which property, whether backwards, and in which filler."""
        if isinstance(expression, (ex.ObjectMinCardinality, ex.ObjectMaxCardinality)):
            return *self._direction(expression.prop), self._filler(expression.filler)
        return self.program.data(expression.prop), False, self.values(expression.range)

    # --- consequents ---

    def imply(self, body: Body, expression: ClassExpression, x: Term) -> None:
        """Add the clauses by which the body makes `x` a member."""
        expression = normal_form(expression)
        if expression == THING:
            return
        fact = self._fact(expression, x)
        if fact is not None:
            self.clause(body, fact)
        elif isinstance(expression, ex.ObjectIntersectionOf):
            for operand in expression.operands:
                self._attempt(self.imply, body, operand, x)
        elif isinstance(expression, ex.ObjectUnionOf):
            self._imply_union(body, expression, x)
        elif isinstance(expression, ex.ObjectOneOf):
            self.clause(body, SameAtom((x, Constant(expression.individuals[0]))))
        else:
            label = self._label(expression)
            if body != (PredicateAtom(label, (x,)),):
                self.clause(body, PredicateAtom(label, (x,)))
            if expression not in self._described:
                self._described.add(expression)
                self._describe(label, expression)

    def contradict(self, body: Body, x: Term) -> None:
        """Add that the body never holds; `x` is whom the contradiction is told of."""
        self.clause(body, PredicateAtom(self.program.nothing, (x,)))

    def _imply_union(self, body: Body, expression: ex.ObjectUnionOf, x: Term) -> None:
        positive: list[ClassExpression] = []
        for operand in expression.operands:
            opposite = normal_form(operand, True)
            # Absorption: a negative alternative of a union is a condition instead. With one
            # positive one left it is a Horn clause; with several, a case that the hypertableau
            # tries.
            if is_positive(opposite) and not is_positive(operand):
                body = (*body, PredicateAtom(self._recognise(opposite), (x,)))
            else:
                positive.append(operand)
        if len(positive) > 1:
            raise UnsupportedError('a union on the right side needs reasoning by cases')
        self.imply(body, positive[0] if positive else NOTHING, x)

    def _describe(self, label: Predicate, expression: ClassExpression) -> None:
        """Add what membership in a labelled expression implies."""
        body = (PredicateAtom(label, (_X,)),)
        if isinstance(expression, (ex.ObjectSomeValuesFrom, ex.ObjectMinCardinality)):
            n = expression.n if isinstance(expression, ex.ObjectMinCardinality) else 1
            filler = expression.filler
            required = None if filler == THING else self.required(filler)
            self._exist(label, n, self._direction(expression.prop), required)
        elif isinstance(expression, (ex.DataSomeValuesFrom, ex.DataMinCardinality)):
            n = expression.n if isinstance(expression, ex.DataMinCardinality) else 1
            values = self.values(expression.range)
            every = EVERY if values is None else values
            self._exist(label, n, (self.program.data(expression.prop), False), every)
        elif isinstance(expression, ex.ObjectAllValuesFrom):
            y = self.fresh()
            self.imply((*body, self.property(expression.prop, _X, y)), expression.filler, y)
        elif isinstance(expression, ex.DataAllValuesFrom):
            self.only(body, expression.prop, expression.range)
        elif isinstance(expression, (ex.ObjectMaxCardinality, ex.DataMaxCardinality)):
            most = AtMost(label, expression.n, *self._counts(expression), self._origin)
            self.program.at_most.append(most)
        elif isinstance(expression, ex.ObjectComplementOf):
            self._describe_complement(label, expression.operand)

    def _exist(
        self,
        label: Predicate,
        n: int,
        direction: tuple[Predicate, bool],
        filler: Predicate | ValueSet | None,
    ) -> None:
        existential = Existential(label, n, *direction, filler, self._origin)
        self.program.existentials.append(existential)

    def _describe_complement(self, label: Predicate, operand: ClassExpression) -> None:
        if isinstance(operand, str):
            self.disjoint(label, self.program.cls(operand))
            return
        # Whoever is in the class for any reason, and in its complement, is a contradiction.
        for other in self.bodies(operand, _X):
            self.contradict((PredicateAtom(label, (_X,)), *other), _X)
        if isinstance(operand, ex.ObjectOneOf):
            for name in operand.individuals:
                differs = self.differs(_X, Constant(name))
                self.clause((PredicateAtom(label, (_X,)),), differs)

    def only(self, body: Body, prop: str, data_range: ex.DataRange) -> None:
        """Add that who satisfies the body has values of a range only."""
        values = self.values(data_range)
        if values is not None:
            v = self.fresh()
            atom = PredicateAtom(self.program.data(prop), (_X, v))
            self.contradict((*body, atom, RangeAtom(~values, (v,))), _X)

    def disjoint(self, first: Predicate, second: Predicate) -> None:
        if first is second:
            self.contradict((PredicateAtom(first, (_X,)),), _X)
        else:
            first.disjoint.add(second)
            second.disjoint.add(first)

    def _top_and_bottom(self) -> None:
        """Add the properties that OWL itself gives a meaning.

        What relates nothing is always there: an assertion with it may come at any time.
        """
        program = self.program
        for bottom in (program.object(BOTTOM), program.data(BOTTOM_DATA)):
            self.contradict((PredicateAtom(bottom, (_X, _Y)),), _X)
        for name, table in (('ObjectProperty', program.objects), ('DataProperty', program.datas)):
            if f'{OWL}top{name}' in table:
                text = f'owl:top{name}: it is used like any other property'
                program.unsupported.append(text)

    def differs(self, x: Term, y: Term) -> PredicateAtom:
        return PredicateAtom(self.program.apart, (x, y))

    def _negate(self, kind: str, iri: str) -> None:
        """Add a predicate for negative assertions, which contradict the positive."""
        program = self.program
        prop = program.object(iri) if kind == 'object' else program.data(iri)
        negative = program.negatives[prop] = Predicate(kind, f'not {local_name(iri)}')
        body = (PredicateAtom(prop, (_X, _Y)), PredicateAtom(negative, (_X, _Y)))
        self.contradict(body, _X)

    def required(self, expression: ClassExpression) -> Predicate:
        """Return the label of an expression that an individual must belong to, with what that
        implies.
        """
        label = self._label(expression)
        if not isinstance(expression, str) and expression not in self.program.required:
            self.program.required.add(expression)
            self._attempt(self.imply, (PredicateAtom(label, (_X,)),), expression, _X)
        return label

    def _complement_labels(self) -> None:
        """State that what is disjoint from a class belongs to its complement, where asked for."""
        # At last, when all that excludes a class is known.
        for iri, label in self._complements.items():
            for other in self.program.cls(iri).disjoint:
                if other is not label:
                    head = PredicateAtom(label, (_X,))
                    self.program.clauses.append(Clause((PredicateAtom(other, (_X,)),), head))

    # --- axioms ---

    def _axiom(self, axiom: Axiom) -> None:
        if isinstance(axiom, ax.Rule):
            self._rules.add(axiom)
        elif isinstance(axiom, ax.HasKey):
            self._key(axiom)
        elif isinstance(axiom, _INCLUDING):
            for inclusion in class_inclusions(axiom):
                self._attempt(self._sub_class, *inclusion)
        elif not isinstance(axiom, (ax.Declaration, ax.DatatypeDefinition, ax.Import)):
            self._properties.add(axiom)

    def _sub_class(self, sub: ClassExpression, sup: ClassExpression) -> None:
        if isinstance(sub, ex.ObjectIntersectionOf) and len(sub.operands) == 2 and sup == NOTHING:
            self._disjoint_classes(*map(normal_form, sub.operands))
            return
        sub, sup = normal_form(sub), normal_form(sup)
        if isinstance(sub, ex.ObjectUnionOf):
            for operand in sub.operands:
                self._attempt(self._sub_class, operand, sup)
            return
        opposite = sup.operand if isinstance(sup, ex.ObjectComplementOf) else None
        # Disjoint classes are watched as a table of pairs, not as clauses: a taxonomy has thousands
        # of them.
        if isinstance(sub, str) and isinstance(opposite, str):
            self.disjoint(self._label(sub), self._label(opposite))
        for body in self.bodies(sub, _X):
            self.imply(body, sup, _X)

    def _disjoint_classes(self, first: ClassExpression, second: ClassExpression) -> None:
        if THING in (first, second):
            self._sub_class(second if first == THING else first, NOTHING)
        elif not is_positive(second):
            self._sub_class(first, normal_form(second, True))
        elif not is_positive(first):
            self._sub_class(second, normal_form(first, True))
        else:
            self.disjoint(self._recognise(first), self._recognise(second))

    def _key(self, axiom: ax.HasKey) -> None:
        props = [self._direction(prop) for prop in axiom.object_props]
        props += [(self.program.data(prop), False) for prop in axiom.data_props]
        if props:
            cls = self._filler(axiom.cls)
            self.program.keys.append(Key(cls, tuple(props), axiom))


class _PropertyAxioms:
    """Adds the clauses of axioms about properties to a translation."""

    def __init__(self, to: Translation) -> None:
        self._to = to

    def add(self, axiom: Axiom) -> None:
        """Add the clauses of an axiom about properties."""
        data = isinstance(axiom, (ax.SubDataPropertyOf, ax.EquivalentDataProperties))
        link = self._data_link if data else self._object_link
        for sub, sup in property_inclusions(axiom):
            self._to.clause((link(*sub),), link(*sup))
        if isinstance(axiom, (ax.DisjointObjectProperties, ax.DisjointDataProperties)):
            data = isinstance(axiom, ax.DisjointDataProperties)
            self._disjoint_properties(axiom.props, self._data_link if data else self._object_link)
        elif isinstance(axiom, ax.ObjectPropertyRange):
            self._to.imply((self._to.property(axiom.prop, _X, _Y),), axiom.range, _Y)
        elif isinstance(axiom, ax.DataPropertyRange):
            self._to.only((), axiom.prop, axiom.range)
        else:
            self._characteristic(axiom)

    def _characteristic(self, axiom: Axiom) -> None:
        """Add the clauses of an axiom that says of what kind a property, or a chain, is."""
        program, prop = self._to.program, self._to.property
        if isinstance(axiom, ax.SubPropertyChainOf):
            body = tuple(prop(part, place, place + 1) for place, part in enumerate(axiom.chain))
            self._to.clause(body, prop(axiom.sup, 0, len(axiom.chain)))
        elif isinstance(axiom, ax.TransitiveObjectProperty):
            both = prop(axiom.prop, _X, _Y), prop(axiom.prop, _Y, _Z)
            self._to.clause(both, prop(axiom.prop, _X, _Z))
        elif isinstance(axiom, ax.IrreflexiveObjectProperty):
            program.irreflexive.append(prop(axiom.prop, _X, _X).predicate)
            self._to.contradict((prop(axiom.prop, _X, _X),), _X)
        elif isinstance(axiom, ax.AsymmetricObjectProperty):
            program.asymmetric.append(prop(axiom.prop, _X, _Y).predicate)
            self._to.contradict((prop(axiom.prop, _X, _Y), prop(axiom.prop, _Y, _X)), _X)
        elif isinstance(axiom, (ax.FunctionalObjectProperty, ax.InverseFunctionalObjectProperty)):
            atom = prop(axiom.prop, _X, _Y)
            inverse = (atom.terms[0] == _Y) != isinstance(axiom, ax.InverseFunctionalObjectProperty)
            program.at_most.append(AtMost(None, 1, atom.predicate, inverse, None, axiom))
        elif isinstance(axiom, ax.FunctionalDataProperty):
            program.at_most.append(AtMost(None, 1, program.data(axiom.prop), False, None, axiom))

    def _disjoint_properties(
        self, props: Iterable[PropertyExpression], link: Callable[..., PredicateAtom]
    ) -> None:
        for first, second in ax.pairs_of(props):
            one, two = link(*directed(first)), link(*directed(second))
            pair = (one.predicate, one.terms[0] == _Y, two.predicate, two.terms[0] == _Y)
            self._to.program.disjoint_properties.append(pair)
            self._to.contradict((one, two), _X)

    def _object_link(self, iri: str, inverted: bool = False) -> PredicateAtom:
        pair = (_Y, _X) if inverted else (_X, _Y)
        return PredicateAtom(self._to.program.object(iri), pair)

    def _data_link(self, iri: str, _: bool = False) -> PredicateAtom:
        return PredicateAtom(self._to.program.data(iri), (_X, _Y))


class _Rules:
    """Adds the clauses of SWRL rules to a translation."""

    def __init__(self, to: Translation) -> None:
        self._to = to

    def add(self, rule: ax.Rule) -> None:
        """Add the clauses of one rule."""
        terms = RuleTerms(self._to.fresh)
        alternatives: list[list[tuple[BodyAtom, ...]]] = []
        for atom in rule.body:
            if isinstance(atom, ex.ClassAtom):
                # What it relates to need have no name: that is the label's matter.
                term = terms.individual(atom.argument)
                alternatives.append(self._to.simple_bodies(atom.cls, term))
            elif isinstance(atom, ex.DataRangeAtom):
                term, values = terms.value(atom.argument), self._to.values(atom.range)
                if values is not None:
                    alternatives.append([(RangeAtom(values, (term,)),)])
            else:
                alternatives.append([(self._rule_atom(atom, terms),)])
        for parts in product(*alternatives):
            body = tuple(atom for part in parts for atom in part)
            self._heads(rule, self._bound(body, terms), terms)

    def _rule_atom(
        self, atom: ex.Atom, terms: RuleTerms
    ) -> PredicateAtom | SameAtom | DifferentAtom | ComputedAtom:
        """Return an atom that is not about a class or a data range."""
        if isinstance(atom, ex.BuiltinAtom):
            return computed_atom(atom, terms)
        assert not isinstance(atom, (ex.ClassAtom, ex.DataRangeAtom))
        first = terms.individual(atom.first)
        if isinstance(atom, ex.DataPropertyAtom):
            return PredicateAtom(
                self._to.program.data(atom.prop), (first, terms.value(atom.second))
            )
        second = terms.individual(atom.second)
        if isinstance(atom, ex.ObjectPropertyAtom):
            return self._to.property(atom.prop, first, second)
        kind = SameAtom if isinstance(atom, ex.SameIndividualAtom) else DifferentAtom
        return kind((first, second))

    def _bound(self, body: tuple[BodyAtom, ...], terms: RuleTerms) -> tuple[BodyAtom, ...]:
        """Return the body; whoever stands in no fact of it is a member of owl:Thing."""
        program = self._to.program

        def anybody(term: Term) -> BodyAtom:
            program.uses_thing = True
            return PredicateAtom(program.thing, (term,))

        used = (term for atom in body for term in atom.terms)
        individuals = [t for t in used if isinstance(t, int) and t in terms.individuals]
        return safe_body(body, individuals, lambda atom: isinstance(atom, PredicateAtom), anybody)

    def _heads(self, rule: ax.Rule, body: tuple[BodyAtom, ...], terms: RuleTerms) -> None:
        bound = {term for atom in body for term in atom.terms if isinstance(term, int)}
        if not rule.head:
            subject = next((term for term in sorted(bound) if term in terms.individuals), None)
            self._to.contradict(body, Constant(NOTHING) if subject is None else subject)

        def check(*arguments: Term) -> None:
            if any(isinstance(term, int) and term not in bound for term in arguments):
                raise UnsupportedError('a variable of the head does not stand in the body')

        for atom in rule.head:
            if isinstance(atom, ex.ClassAtom):
                argument = terms.individual(atom.argument)
                check(argument)
                self._to.imply(body, atom.cls, argument)
            elif isinstance(atom, (ex.DataRangeAtom, ex.BuiltinAtom)):
                raise UnsupportedError('a built-in or data range in the head has no meaning here')
            else:
                head = self._rule_atom(atom, terms)
                assert not isinstance(head, ComputedAtom)
                check(*head.terms)
                if isinstance(head, DifferentAtom):
                    head = self._to.differs(*head.terms)
                self._to.clause(body, head)
