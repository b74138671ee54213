"""Random ontologies with every construct of OWL 2 DL, from one seed each.

They keep OWL 2 DL's restrictions (only simple properties are counted, chains are regular), so that
HermiT and Pellet take them.
"""

# mypy takes a random choice of classes for an object.
# mypy: disable-error-code="assignment, operator, return-value, list-item, arg-type"

from __future__ import annotations

import random

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import ClassExpression, DataRange, Literal
from owl_reasoner.owl.vocabulary import NOTHING, OWL, THING, TOP_LITERAL, XSD

BASE = 'http://example.org/wide#'
CLASSES = [BASE + name for name in 'ABCDEFGH']
SIMPLE = [BASE + name for name in ('p', 'q', 'r')]
LONG = [BASE + name for name in ('t', 'u')]
"""Properties that may be transitive or implied by chains, later ones above earlier ones."""
OBJECTS = [*SIMPLE, *LONG]
DATAS = [BASE + name for name in ('d', 'e')]
INDIVIDUALS = [BASE + name for name in 'ijkl']
TOP, BOTTOM = OWL + 'topObjectProperty', OWL + 'bottomObjectProperty'
_NUMBERS = ('integer', 'int', 'byte', 'nonNegativeInteger', 'positiveInteger', 'decimal')
_FACETS = ('minInclusive', 'maxInclusive', 'minExclusive', 'maxExclusive')
_DATATYPES = (
    *(XSD + name for name in (*_NUMBERS, 'string', 'boolean', 'float', 'double', 'dateTime')),
    *(XSD + name for name in ('anyURI', 'hexBinary', 'token', 'unsignedByte', 'negativeInteger')),
    *(OWL + 'real', OWL + 'rational', TOP_LITERAL),
)
_DATATYPE = BASE + 'defined'


class WideOntology:
    """Draws axioms.

    Args:
        seed: Equal seeds draw equal axioms.
        cases: How likely a class expression is drawn whose consequences may need reasoning by
            cases: a union, an enumeration or a complement, wherever it stands.
        special: How likely a property in a class is owl:topObjectProperty or
            owl:bottomObjectProperty.

    Attributes:
        defined: Whether data ranges may use a datatype that the ontology defines.
        classes, simples, longs, datas, individuals: The names it draws from; `longs` are the
            object properties that may be transitive or implied by chains.
    """

    def __init__(self, seed: int, cases: float = 0.2, special: float = 0.0) -> None:
        self.random = random.Random(seed)
        self._cases, self._special = cases, special
        self.defined = False
        self.classes, self.simples, self.longs = CLASSES, SIMPLE, LONG
        self.datas, self.individuals = DATAS, INDIVIDUALS

    # --- values ---

    def literal(self) -> Literal:
        draw = self.random
        number = draw.randrange(-1, 4)
        return draw.choices(
            [
                Literal(str(number), XSD + 'integer'),
                Literal(str(abs(number)), XSD + draw.choice(['int', 'byte', 'unsignedByte'])),
                Literal(f'{number}.{draw.choice("05")}', XSD + 'decimal'),
                Literal(draw.choice(['', 'a', 'ab', 'b c']), XSD + 'string'),
                Literal(draw.choice(['true', 'false', '1']), XSD + 'boolean'),
                Literal(f'{number}.5', XSD + draw.choice(['float', 'double'])),
                Literal(f'200{abs(number)}-01-01T00:00:00Z', XSD + 'dateTime'),
                Literal('http://example.org/', XSD + 'anyURI'),
            ],
            [8, 3, 3, 3, 2, 2, 2, 1],
        )[0]

    def data_range(self, depth: int = 2) -> DataRange:
        draw = self.random
        choice = draw.randrange(10) if depth else draw.randrange(6)
        if choice <= 1:
            return _DATATYPE if self.defined and draw.random() < 0.3 else draw.choice(_DATATYPES)
        if choice <= 4:
            kind = draw.random()
            facet = XSD + draw.choice(_FACETS)
            if kind < 0.6:
                datatype = XSD + draw.choice(_NUMBERS)
                bound = Literal(str(draw.randrange(1, 4)), datatype)
                facets = [(facet, bound)]
                if draw.random() < 0.4:
                    bound = Literal(str(draw.randrange(1, 5)), datatype)
                    facets.append((XSD + draw.choice(_FACETS), bound))
            elif kind < 0.75:
                datatype = XSD + draw.choice(['float', 'double'])
                facets = [(facet, Literal(f'{draw.randrange(3)}.5', datatype))]
            elif kind < 0.88:
                datatype = XSD + 'string'
                size = Literal(str(draw.randrange(3)), XSD + 'nonNegativeInteger')
                name = draw.choice(['length', 'minLength', 'maxLength', 'pattern'])
                facets = [(XSD + name, Literal('a.*') if name == 'pattern' else size)]
            else:
                datatype = XSD + 'dateTime'
                moment = f'200{draw.randrange(4)}-01-01T00:00:00Z'
                facets = [(facet, Literal(moment, datatype))]
            return ex.DatatypeRestriction(datatype, tuple(facets))
        if choice == 5:
            number = draw.choice([1, 1, 2, 3])
            return ex.DataOneOf(tuple(dict.fromkeys(self.literal() for _ in range(number))))
        if choice == 6:
            return ex.DataComplementOf(self.data_range(depth - 1))
        kind = draw.choice([ex.DataIntersectionOf, ex.DataUnionOf])
        return kind((self.data_range(depth - 1), self.data_range(depth - 1)))

    # --- classes ---

    def named(self) -> str:
        return self.random.choice(self.classes)

    @property
    def objects(self) -> list[str]:
        """The object properties."""
        return [*self.simples, *self.longs]

    def simple(self) -> ex.PropertyExpression:
        name = self.random.choice(self.simples)
        return ex.ObjectInverseOf(name) if self.random.random() < 0.25 else name

    def prop(self) -> ex.PropertyExpression:
        if self._special and self.random.random() < self._special:
            return self.random.choice([TOP, TOP, BOTTOM])
        name = self.random.choice(self.objects)
        return ex.ObjectInverseOf(name) if self.random.random() < 0.25 else name

    def expression(self, depth: int = 4) -> ClassExpression:
        """Return a class expression, nested to the given depth."""
        draw = self.random
        if not depth or draw.random() < 0.3:
            return self._leaf()
        less = depth - draw.choice([1, 1, 2, depth])
        if draw.random() < self._cases:
            choice = draw.randrange(4)
            if choice == 0:
                return ex.ObjectComplementOf(self.expression(less))
            if choice == 1:
                members = draw.sample(self.individuals, draw.choice([1, 2, 2, 3]))
                return ex.ObjectOneOf(tuple(members))
            return ex.ObjectUnionOf((self.expression(less), self.expression(depth - 1)))
        choice = draw.randrange(16)
        if choice <= 1:
            return ex.ObjectIntersectionOf((self.expression(less), self.expression(depth - 1)))
        if choice <= 4:
            return ex.ObjectSomeValuesFrom(self.prop(), self.expression(depth - 1))
        if choice <= 6:
            return ex.ObjectAllValuesFrom(self.prop(), self.expression(depth - 1))
        if choice == 7:
            return ex.ObjectHasValue(self.prop(), draw.choice(self.individuals))
        if choice == 8:
            return ex.ObjectHasSelf(draw.choice(self.simples))
        if choice <= 10:
            kind = draw.choice(
                [ex.ObjectMinCardinality, ex.ObjectMaxCardinality, ex.ObjectExactCardinality]
            )
            filler = THING if draw.random() < 0.4 else self.expression(less)
            return kind(draw.choice([0, 1, 1, 2, 2, 3]), self.simple(), filler)
        data = draw.choice(self.datas)
        if choice == 11:
            return ex.DataHasValue(data, self.literal())
        if choice <= 13:
            return ex.DataSomeValuesFrom(data, self.data_range())
        if choice == 14:
            return ex.DataAllValuesFrom(data, self.data_range())
        counted = draw.choice(
            [ex.DataMinCardinality, ex.DataMaxCardinality, ex.DataExactCardinality]
        )
        return counted(draw.choice([0, 1, 2, 3]), data, self.data_range())

    def _leaf(self) -> ClassExpression:
        chance = self.random.random()
        if chance < 0.04:
            return THING
        return NOTHING if chance < 0.06 else self.named()

    # --- axioms ---

    def class_axiom(self) -> Axiom:
        draw = self.random
        choice = draw.randrange(12)
        if choice <= 4:
            return ax.SubClassOf(self.named(), self.expression())
        if choice <= 6:
            return ax.SubClassOf(self.expression(), self.expression())
        if choice <= 8:
            if draw.random() < 0.15:
                return ax.EquivalentClasses((self.named(), self.named(), self.expression(2)))
            return ax.EquivalentClasses((self.named(), self.expression()))
        if choice <= 10:
            if draw.random() < 0.25:
                return ax.DisjointClasses((self.expression(2), self.expression(2)))
            return ax.DisjointClasses(tuple(draw.sample(self.classes, draw.choice([2, 2, 3, 4]))))
        whole, *parts = draw.sample(self.classes, draw.choice([3, 3, 4]))
        parts += [self.expression(1)] if self._cases else []
        return ax.DisjointUnion(whole, tuple(parts))

    def property_axiom(self) -> Axiom:
        return self.random.choice(
            [
                *[self._inclusion] * 5,
                *[self._characteristic] * 6,
                *[self._domain_or_range] * 5,
                *[self._data_axiom] * 3,
                self._key,
            ]
        )()

    def _inclusion(self) -> Axiom:
        draw = self.random
        choice = draw.randrange(10)
        if choice <= 2:
            return ax.SubObjectPropertyOf(self.simple(), draw.choice(self.objects))
        if choice == 3:
            return ax.InverseObjectProperties(*draw.sample(self.simples, 2))
        if choice == 4:
            return ax.EquivalentObjectProperties((draw.choice(self.simples), self.simple()))
        if choice <= 7:
            # Regular: `t` may be made of simple properties and itself, `u` also of `t`.
            target = draw.choice(self.longs)
            lower = [*self.simples, *self.longs[: self.longs.index(target)]]
            steps = [self._turned(draw.choice(lower)) for _ in range(draw.choice([1, 1, 2]))]
            other = draw.choice([self._turned(draw.choice(lower)), target])
            chain = (other, *steps) if draw.random() < 0.5 else (*steps, other)
            return ax.SubPropertyChainOf(chain, target)
        if choice == 8:
            one, other = draw.sample(self.simples, 2)
            return ax.DisjointObjectProperties((one, self._turned(other)))
        return ax.DisjointObjectProperties(tuple(self.simples))

    def _turned(self, name: str) -> ex.PropertyExpression:
        return ex.ObjectInverseOf(name) if self.random.random() < 0.25 else name

    def _characteristic(self) -> Axiom:
        draw = self.random
        simple = [
            *[ax.FunctionalObjectProperty] * 3,
            *[ax.InverseFunctionalObjectProperty] * 2,
            ax.AsymmetricObjectProperty,
            ax.IrreflexiveObjectProperty,
        ]
        every = [
            *[ax.SymmetricObjectProperty] * 2,
            *[ax.ReflexiveObjectProperty] * 2,
            *[ax.TransitiveObjectProperty] * 2,
        ]
        kind = draw.choice([*simple, *every])
        if kind in simple:
            return kind(self.simple())
        name = draw.choice(self.longs if kind is ax.TransitiveObjectProperty else self.objects)
        return kind(self._turned(name))

    def _domain_or_range(self) -> Axiom:
        kind = self.random.choice([ax.ObjectPropertyDomain, ax.ObjectPropertyRange])
        return kind(self._turned(self.random.choice(self.objects)), self.expression(3))

    def _data_axiom(self) -> Axiom:
        draw = self.random
        choice = draw.randrange(8)
        prop, pair = draw.choice(self.datas), tuple(draw.sample(self.datas, 2))
        if choice <= 1:
            return ax.FunctionalDataProperty(prop)
        if choice <= 3:
            return ax.DataPropertyRange(prop, self.data_range())
        if choice == 4:
            return ax.DataPropertyDomain(prop, self.expression(2))
        if choice == 5:
            return ax.DisjointDataProperties(pair)
        if choice == 6:
            return ax.EquivalentDataProperties(pair)
        return ax.SubDataPropertyOf(*pair)

    def _key(self) -> Axiom:
        draw = self.random
        cls = self.named() if draw.random() < 0.7 else self.expression(2)
        objects = draw.choice([(), (), (self.simple(),), tuple(draw.sample(self.simples, 2))])
        datas = tuple(draw.sample(self.datas, draw.choice([1, 1, 2] if not objects else [0, 1])))
        return ax.HasKey(cls, objects, datas)

    def assertion(self) -> Axiom:
        draw = self.random
        chance = draw.random()
        one, two = draw.choice(self.individuals), draw.choice(self.individuals)
        if chance < 0.2:
            return ax.ClassAssertion(self.named(), one)
        if chance < 0.32:
            return ax.ClassAssertion(self.expression(), one)
        if chance < 0.6:
            return ax.ObjectPropertyAssertion(draw.choice(self.objects), one, two)
        if chance < 0.75:
            return ax.DataPropertyAssertion(draw.choice(self.datas), one, self.literal())
        if chance < 0.85:
            number = min(draw.choice([2, 2, 3, 4]), len(self.individuals))
            members = draw.sample(self.individuals, number)
            return ax.DifferentIndividuals(frozenset(members))
        if chance < 0.9:
            return ax.SameIndividual(frozenset(draw.sample(self.individuals, 2)))
        if chance < 0.95:
            return ax.NegativeObjectPropertyAssertion(draw.choice(self.objects), one, two)
        return ax.NegativeDataPropertyAssertion(draw.choice(self.datas), one, self.literal())

    def ontology(self, schema: int, assertions: int) -> list[Axiom]:
        """Return declarations, axioms about classes and properties, and assertions."""
        declared: list[Axiom] = [ax.Declaration('class', name) for name in self.classes]
        declared += [ax.Declaration('object_property', name) for name in self.objects]
        declared += [ax.Declaration('data_property', name) for name in self.datas]
        declared += [ax.Declaration('individual', name) for name in self.individuals]
        if self.random.random() < 0.2:
            declared += [
                ax.Declaration('datatype', _DATATYPE),
                ax.DatatypeDefinition(_DATATYPE, self.data_range()),
            ]
            self.defined = True
        drawn = [
            self.class_axiom() if self.random.random() < 0.6 else self.property_axiom()
            for _ in range(schema)
        ]
        drawn += [self.assertion() for _ in range(assertions)]
        return list(dict.fromkeys(declared + drawn))


_EXPRESSIONS = (
    *('name', 'and', 'or', 'not', 'one of', 'some', 'only', 'has', 'self'),
    *('min', 'max', 'exactly', 'data has', 'data some', 'data only', 'data count'),
)
_AXIOMS = ('subclass', 'class', 'inclusion', 'characteristic', 'domain', 'data', 'key', 'rule')
_X, _Y, _Z, _V = (ex.Variable(BASE + name) for name in 'xyzv')


class DenseOntology(WideOntology):
    """Draws ontologies of few names and few kinds of axioms, so that these meet.

    How often each kind is drawn, and from how many names, is drawn first. There are rules, too.

    Args:
        seed: Equal seeds draw equal axioms.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        draw = self.random
        self.classes = CLASSES[: draw.randrange(2, 5)]
        self.simples = SIMPLE[: draw.randrange(2, 4)]
        self.longs = LONG[: draw.randrange(1, 3)]
        self.individuals = INDIVIDUALS[: draw.randrange(2, 5)]
        self._likely = {kind: draw.random() ** 3 for kind in (*_EXPRESSIONS, *_AXIOMS)}
        self._values = draw.choice(['numbers', 'strings', 'moments', 'all'])
        if draw.random() < 0.4:
            self._likely |= {'or': 0.0, 'not': 0.0, 'one of': 0.0}
        if draw.random() < 0.7:
            self._likely['rule'] = 0.0

    def _kind(self, kinds: tuple[str, ...]) -> str:
        return self.random.choices(kinds, [self._likely[kind] for kind in kinds])[0]

    def literal(self) -> Literal:
        draw = self.random
        if self._values == 'numbers':
            kind = draw.choice(['integer', 'integer', 'byte', 'decimal'])
            return Literal(str(draw.randrange(4)), XSD + kind)
        if self._values == 'strings':
            return Literal(draw.choice(['', 'a', 'b', 'ab', 'abc']))
        if self._values == 'moments':
            zone = draw.choice(['Z', 'Z', '+01:00', ''])
            return Literal(f'2000-01-0{draw.randrange(1, 4)}T00:00:00{zone}', XSD + 'dateTime')
        return super().literal()

    def data_range(self, depth: int = 2) -> DataRange:
        draw = self.random
        if self._values == 'all' or draw.random() < 0.1:
            return super().data_range(depth)
        choice = draw.randrange(8 if depth else 6)
        if choice <= 1:
            number = draw.choice([1, 2, 2, 3])
            return ex.DataOneOf(tuple(dict.fromkeys(self.literal() for _ in range(number))))
        if choice <= 5:
            if self._values == 'strings':
                facets = ['length', 'minLength', 'maxLength']
                bounds = [Literal(str(draw.randrange(4)), XSD + 'nonNegativeInteger')]
                bounds.append(Literal(str(draw.randrange(4)), XSD + 'nonNegativeInteger'))
            else:
                facets, bounds = [*_FACETS], [self.literal(), self.literal()]
            kind = {'strings': 'string', 'moments': 'dateTime'}.get(self._values, 'integer')
            if kind == 'integer':
                bounds = [Literal(bound.lexical, XSD + 'integer') for bound in bounds]
            pairs = zip(draw.sample(facets, 2), bounds, strict=True)
            kept = draw.choice([1, 2])
            chosen = tuple((XSD + facet, bound) for facet, bound in pairs)[:kept]
            return ex.DatatypeRestriction(XSD + kind, chosen)
        if choice == 6:
            return ex.DataComplementOf(self.data_range(depth - 1))
        operator = draw.choice([ex.DataIntersectionOf, ex.DataUnionOf])
        return operator((self.data_range(depth - 1), self.data_range(depth - 1)))

    def expression(self, depth: int = 3) -> ClassExpression:
        draw = self.random
        kind = self._kind(_EXPRESSIONS) if depth and draw.random() < 0.75 else 'name'
        if kind in ('and', 'or'):
            operands = (self.expression(depth - 1), self.expression(depth - 1))
            return (
                ex.ObjectIntersectionOf(operands) if kind == 'and' else ex.ObjectUnionOf(operands)
            )
        if kind == 'not':
            return ex.ObjectComplementOf(self.expression(depth - 1))
        if kind == 'one of':
            number = draw.randrange(1, len(self.individuals) + 1)
            return ex.ObjectOneOf(tuple(draw.sample(self.individuals, number)))
        if kind == 'some':
            return ex.ObjectSomeValuesFrom(self.prop(), self.expression(depth - 1))
        if kind == 'only':
            return ex.ObjectAllValuesFrom(self.prop(), self.expression(depth - 1))
        if kind == 'has':
            return ex.ObjectHasValue(self.prop(), draw.choice(self.individuals))
        if kind == 'self':
            return ex.ObjectHasSelf(self.simple())
        if kind in ('min', 'max', 'exactly'):
            counted = {
                'min': ex.ObjectMinCardinality,
                'max': ex.ObjectMaxCardinality,
                'exactly': ex.ObjectExactCardinality,
            }[kind]
            filler = THING if draw.random() < 0.4 else self.expression(depth - 1)
            return counted(draw.choice([0, 1, 1, 2, 2, 3]), self.simple(), filler)
        data = draw.choice(self.datas)
        if kind == 'data has':
            return ex.DataHasValue(data, self.literal())
        if kind == 'data some':
            return ex.DataSomeValuesFrom(data, self.data_range())
        if kind == 'data only':
            return ex.DataAllValuesFrom(data, self.data_range())
        if kind == 'data count':
            numbered = draw.choice(
                [ex.DataMinCardinality, ex.DataMaxCardinality, ex.DataExactCardinality]
            )
            return numbered(draw.choice([0, 1, 1, 2, 3]), data, self.data_range())
        return self._leaf()

    def class_axiom(self) -> Axiom:
        if self.random.random() < 0.7:
            return ax.SubClassOf(self.expression(2), self.expression())
        return ax.EquivalentClasses((self.named(), self.expression()))

    def property_axiom(self) -> Axiom:
        kind = self._kind(_AXIOMS)
        if kind == 'inclusion':
            draw = self.random
            choice = draw.randrange(4)
            if choice == 0:
                return ax.SubObjectPropertyOf(self.simple(), self.prop())
            if choice == 1:
                return ax.InverseObjectProperties(self.simple(), self.simple())
            if choice == 2:
                one, other = draw.sample(self.simples, 2)
                return ax.DisjointObjectProperties((one, self._turned(other)))
            target = draw.choice(self.longs)
            lower = [*self.simples, *self.longs[: self.longs.index(target)]]
            steps = [self._turned(draw.choice(lower)) for _ in range(draw.choice([1, 1, 2]))]
            other = draw.choice([self._turned(draw.choice(lower)), target])
            return ax.SubPropertyChainOf((*steps, other), target)
        if kind == 'characteristic':
            return self._characteristic()
        if kind == 'domain':
            return self._domain_or_range()
        if kind == 'data':
            return self._data_axiom()
        if kind == 'key':
            return self._key()
        return self.rule() if kind == 'rule' else self.class_axiom()

    def rule(self) -> ax.Rule:
        """Return a rule without built-ins."""
        draw = self.random
        body = [self._atom(data=True) for _ in range(draw.choice([1, 2, 2, 3]))]
        bound = {term for atom in body for term in _variables(atom)}
        pairs = (ex.SameIndividualAtom, ex.DifferentIndividualsAtom)
        head = self._atom()
        for _ in range(50):
            if set(_variables(head)) <= bound:
                break
            head = self._atom(head=True)
        else:
            head = ex.ClassAtom(self.named(), draw.choice(self.individuals))
        if {_X, _Y} <= bound and draw.random() < 0.2:
            body.append(draw.choice(pairs)(_X, _Y))
        return ax.Rule(tuple(body), (head,))

    def _atom(self, data: bool = False, head: bool = False) -> ex.Atom:
        draw = self.random
        one, other = (
            draw.choice([_X, _X, _Y, _Z, draw.choice(self.individuals)]) for _ in range(2)
        )
        choice = draw.randrange(5)
        if choice == 0:
            return ex.ClassAtom(self.named(), one)
        if choice == 1 and head:
            pairs = (ex.SameIndividualAtom, ex.DifferentIndividualsAtom)
            return draw.choice(pairs)(one, other)
        if choice == 1 and data:
            argument = self.literal() if draw.random() < 0.5 else _V
            return ex.DataPropertyAtom(draw.choice(self.datas), one, argument)
        return ex.ObjectPropertyAtom(draw.choice(self.objects), one, other)


class PlainOntology(DenseOntology):
    """Draws small ontologies without unions and complements; many need no reasoning by cases.

    Args:
        seed: Equal seeds draw equal axioms.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        draw = self.random
        self._likely |= {'or': 0.0, 'not': 0.0, 'rule': 0.0}
        self._likely['one of'] *= draw.choice([0, 1])
        self._likely['characteristic'] += 0.3
        for kind in ('only', 'max'):
            if draw.random() < 0.5:
                self._likely[kind] += 0.3
        if draw.random() < 0.6:
            data = ('data has', 'data some', 'data only', 'data count', 'data')
            self._likely |= dict.fromkeys(data, 0.0)
        if draw.random() < 0.5:
            self._likely['key'] = 0.0

    def expression(self, depth: int = 2) -> ClassExpression:
        drawn = super().expression(min(depth, 2))
        return ex.ObjectOneOf(drawn.individuals[:1]) if isinstance(drawn, ex.ObjectOneOf) else drawn

    def assertion(self) -> Axiom:
        if self.random.random() < 0.3:
            return ax.ClassAssertion(self.expression(1), self.random.choice(self.individuals))
        return super().assertion()


def _variables(atom: ex.Atom) -> list[ex.Variable]:
    terms = [getattr(atom, name, None) for name in ('argument', 'first', 'second')]
    return [term for term in terms if isinstance(term, ex.Variable)]
