"""Random ontologies in the whole fragment, and random changes to them, from one seed each."""

# mypy takes a random choice of classes for an object.
# mypy: disable-error-code="arg-type"

from __future__ import annotations

import random

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import ClassExpression, Literal, Variable
from owl_reasoner.owl.vocabulary import SWRLB, THING, TOP_LITERAL, XSD

BASE = 'http://example.org/random#'
CLASSES = [BASE + name for name in 'ABCDE']
OBJECTS = [BASE + name for name in ('p', 'q', 'r')]
DATAS = [BASE + name for name in ('s', 't')]
INDIVIDUALS = [BASE + name for name in ('i', 'j', 'k', 'l', 'm')]
_X, _Y, _Z, _V, _W = (Variable(BASE + name) for name in ('x', 'y', 'z', 'v', 'w'))


class RandomOntology:
    """Draws axioms.

    Args:
        seed: Equal seeds draw equal axioms.
        plain: Leave out what owlready2's copy of HermiT refuses (rules with built-ins).
    """

    def __init__(self, seed: int, plain: bool = False) -> None:
        self.random = random.Random(seed)
        self.plain = plain

    # --- parts ---

    def literal(self) -> Literal:
        choice = self.random.random()
        if choice < 0.7:
            return Literal(str(self.random.randrange(4)), XSD + 'integer')
        if choice < 0.85:
            return Literal(str(self.random.randrange(4)), XSD + 'long')
        if choice < 0.95:
            return Literal(f'{self.random.randrange(4)}.0', XSD + 'decimal')
        return Literal('text', XSD + 'string')

    def prop(self) -> ex.PropertyExpression:
        name = self.random.choice(OBJECTS)
        return ex.ObjectInverseOf(name) if self.random.random() < 0.2 else name

    def data_range(self) -> ex.DataRange:
        choice = self.random.random()
        if choice < 0.5:
            return XSD + 'integer'
        if choice < 0.8:
            bound = Literal(str(self.random.randrange(4)), XSD + 'integer')
            facet = self.random.choice(['minInclusive', 'maxExclusive'])
            return ex.DatatypeRestriction(XSD + 'integer', ((XSD + facet, bound),))
        return TOP_LITERAL

    def named(self) -> str:
        return self.random.choice(CLASSES)

    def filler(self, depth: int, right: bool) -> ClassExpression:
        """Return what a restriction speaks of: nested to the given depth."""
        choice = self.random.random()
        if choice < 0.2:
            return THING
        if choice < 0.7 or not depth:
            return self.named()
        return self.right(depth) if right else self.left(depth)

    def left(self, depth: int = 4) -> ClassExpression:
        """Return an expression whose members can be recognised, nested to the given depth."""
        choice = self.random.randrange(12) if depth else 0
        if choice <= 3:
            return self.named()
        if choice == 4:
            return ex.ObjectIntersectionOf((self.left(depth - 1), self.left(depth - 1)))
        if choice == 5:
            return ex.ObjectUnionOf((self.left(depth - 1), self.left(depth - 1)))
        if choice in (6, 7):
            return ex.ObjectSomeValuesFrom(self.prop(), self.filler(depth - 1, False))
        if choice == 8:
            return ex.ObjectMinCardinality(
                self.random.choice([1, 2, 2, 3]), self.prop(), self.filler(depth - 1, False)
            )
        if choice == 9:
            if self.random.random() < 0.5:
                return ex.ObjectHasValue(self.prop(), self.random.choice(INDIVIDUALS))
            return ex.ObjectOneOf((self.random.choice(INDIVIDUALS),))
        if choice == 10:
            data = self.random.choice(DATAS)
            if self.random.random() < 0.4:
                return ex.DataHasValue(data, self.literal())
            return ex.DataSomeValuesFrom(data, self.data_range())
        return ex.DataMinCardinality(2, self.random.choice(DATAS), self.data_range())

    def right(self, depth: int = 4) -> ClassExpression:
        """Return an expression whose membership has Horn consequences, nested to the given
        depth.
        """
        choice = self.random.randrange(18) if depth else 0
        if choice <= 4:
            return self.named()
        if choice == 5:
            return ex.ObjectIntersectionOf((self.named(), self.right(depth - 1)))
        if choice in (6, 7):
            return ex.ObjectAllValuesFrom(self.prop(), self.filler(depth - 1, True))
        if choice == 8:
            return ex.ObjectMaxCardinality(
                self.random.choice([0, 1, 1, 2]), self.prop(), self.filler(depth - 1, False)
            )
        if choice == 9:
            return ex.ObjectHasValue(self.prop(), self.random.choice(INDIVIDUALS))
        if choice == 10:
            return ex.ObjectComplementOf(self.named())
        if choice == 11:
            return ex.DataMaxCardinality(1, self.random.choice(DATAS), self.data_range())
        if choice == 12:
            return ex.ObjectExactCardinality(1, self.prop(), self.filler(0, True))
        if choice in (13, 14):
            return ex.ObjectSomeValuesFrom(self.prop(), self.filler(depth - 1, True))
        if choice == 15:
            return ex.DataSomeValuesFrom(self.random.choice(DATAS), self.data_range())
        if choice == 16:
            number = self.random.choice([1, 2, 3])
            return ex.DataMinCardinality(number, self.random.choice(DATAS), self.data_range())
        return ex.DataHasValue(self.random.choice(DATAS), self.literal())

    def rule(self) -> ax.Rule:
        p, q, r = (self.random.choice(OBJECTS) for _ in range(3))
        s, t = self.random.choice(DATAS), self.random.choice(DATAS)
        shape = self.random.randrange(3 if self.plain else 7)
        link = ex.ObjectPropertyAtom
        value = ex.DataPropertyAtom
        if shape == 0:
            body: tuple[ex.Atom, ...] = (link(p, _X, _Y), link(q, _Y, _Z))
            return ax.Rule(body, (link(r, _X, _Z),))
        if shape == 1:
            body = (link(p, _X, _Y), link(q, _Z, _Y), ex.DifferentIndividualsAtom(_X, _Z))
            return ax.Rule(body, (link(r, _X, _Z),))
        if shape == 2:
            body = (ex.ClassAtom(self.named(), _X), link(p, _X, _Y))
            if self.random.random() < 0.5:
                return ax.Rule(body, (ex.ClassAtom(self.named(), _Y),))
            pair = self.random.choice([ex.SameIndividualAtom, ex.DifferentIndividualsAtom])
            return ax.Rule(body, (pair(_X, _Y),))
        compare = SWRLB + self.random.choice(['greaterThan', 'lessThanOrEqual'])
        if shape in (3, 4):
            body = (
                value(s, _X, _V),
                value(t, _Y, _W),
                ex.ClassAtom(self.named(), _Y),
                ex.BuiltinAtom(SWRLB + 'subtract', (_Z, _V, _W)),
                ex.BuiltinAtom(compare, (_Z, Literal('1', XSD + 'integer'))),
            )
            return ax.Rule(body, (ex.ClassAtom(self.named(), self.random.choice([_X, _Y])),))
        if shape == 5:
            body = (value(s, _X, _V), link(p, _X, _Y), value(t, _Y, _W))
            body = (*body, ex.BuiltinAtom(compare, (_V, _W)))
            return ax.Rule(body, (link(q, _Y, _X),))
        body = (
            value(s, _X, _V),
            ex.BuiltinAtom(SWRLB + 'add', (_W, _V, Literal('1', XSD + 'integer'))),
        )
        limit = ex.BuiltinAtom(SWRLB + 'lessThan', (_V, Literal('5', XSD + 'integer')))
        return ax.Rule((*body, limit), (value(t, _X, _W),))

    # --- axioms ---

    def schema_axiom(self) -> Axiom:
        choice = self.random.randrange(22)
        objects, prop = self.random.choice(OBJECTS), self.prop()
        if choice <= 5:
            return ax.SubClassOf(self.left(), self.right())
        if choice == 6:
            return ax.EquivalentClasses((self.named(), self.left()))
        if choice == 7:
            return ax.DisjointClasses(tuple(self.random.sample(CLASSES, 2)))
        if choice == 8:
            return ax.SubObjectPropertyOf(prop, objects)
        if choice == 9:
            return ax.InverseObjectProperties(objects, self.random.choice(OBJECTS))
        if choice == 10:
            return self.random.choice([ax.SymmetricObjectProperty, ax.TransitiveObjectProperty])(
                objects
            )
        if choice == 11:
            return ax.SubPropertyChainOf((prop, self.prop()), objects)
        if choice == 12:
            return ax.FunctionalObjectProperty(prop)
        if choice == 13:
            kinds = [ax.AsymmetricObjectProperty, ax.IrreflexiveObjectProperty]
            return self.random.choice(kinds)(objects)
        if choice == 14:
            return ax.ObjectPropertyDomain(prop, self.right())
        if choice == 15:
            return ax.ObjectPropertyRange(prop, self.right())
        if choice == 16:
            return ax.FunctionalDataProperty(self.random.choice(DATAS))
        if choice == 17:
            return ax.DataPropertyRange(self.random.choice(DATAS), self.data_range())
        if choice == 18:
            return ax.SubDataPropertyOf(*self.random.sample(DATAS, 2))
        if choice == 19:
            if self.random.random() < 0.5:
                return ax.HasKey(self.named(), (), (self.random.choice(DATAS),))
            return ax.DisjointObjectProperties(tuple(self.random.sample(OBJECTS, 2)))
        return self.rule()

    def assertion(self) -> Axiom:
        choice = self.random.random()
        one, two = self.random.choice(INDIVIDUALS), self.random.choice(INDIVIDUALS)
        if choice < 0.22:
            if self.random.random() < 0.12:
                return ax.ClassAssertion(self.right(), one)
            return ax.ClassAssertion(self.named(), one)
        if choice < 0.58:
            return ax.ObjectPropertyAssertion(self.random.choice(OBJECTS), one, two)
        if choice < 0.8:
            return ax.DataPropertyAssertion(self.random.choice(DATAS), one, self.literal())
        if choice < 0.9:
            members = self.random.sample(INDIVIDUALS, self.random.choice([2, 2, 3, 4]))
            return ax.DifferentIndividuals(frozenset(members))
        if choice < 0.94:
            return ax.SameIndividual(frozenset(self.random.sample(INDIVIDUALS, 2)))
        if choice < 0.97:
            return ax.NegativeObjectPropertyAssertion(self.random.choice(OBJECTS), one, two)
        return ax.Declaration('individual', one)

    def ontology(self, schema: int, assertions: int) -> list[Axiom]:
        declared: list[Axiom] = [ax.Declaration('class', name) for name in CLASSES]
        declared += [ax.Declaration('object_property', name) for name in OBJECTS]
        declared += [ax.Declaration('data_property', name) for name in DATAS]
        drawn = [self.schema_axiom() for _ in range(schema)]
        drawn += [self.assertion() for _ in range(assertions)]
        return list(dict.fromkeys(declared + drawn))
