"""The reasoner beside all models over a few elements: what holds, and what does not, is the same.

Most ontologies drawn here say nothing of somebody who must exist: a part of a model is a model, so
the elements that have names are enough, and both must agree exactly. Of the others everything that
the reasoner finds must hold in the models there are.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from itertools import combinations, product
from typing import Any

import pytest

from owl_reasoner import KnowledgeBase, Unknown
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import ClassExpression
from owl_reasoner.owl.vocabulary import NOTHING, SWRLB, THING, TOP_LITERAL, XSD

from .all_models import COMPARISONS, FACETS, AllModels, Vocabulary, terms_of
from .small_ontologies import A, B, C, P, Q, S, T, V, W, X, Y, Z, i, j, k, m, num

VOCABULARIES = (
    Vocabulary((A, B, C), (P, Q), (), (i, j)),
    Vocabulary((A, B), (P,), (S, T), (i, j)),
    Vocabulary((A, B), (P,), (), (i, j, k)),
    Vocabulary((A,), (P,), (S,), (i, j, k)),
    Vocabulary((A, B, C), (P, Q), (), (i,), unnamed=1),
)
OF_PROPERTIES: tuple[Any, ...] = (
    ax.FunctionalObjectProperty,
    ax.InverseFunctionalObjectProperty,
    ax.IrreflexiveObjectProperty,
    ax.AsymmetricObjectProperty,
    ax.SymmetricObjectProperty,
    ax.TransitiveObjectProperty,
    ax.ReflexiveObjectProperty,
)
LARGER: tuple[Any, ...] = (
    ax.FunctionalObjectProperty,
    ax.InverseFunctionalObjectProperty,
    ax.TransitiveObjectProperty,
)
"""Those that three elements refute."""


class Draw:
    """Draws axioms of which a part of a model is a model; with `existing` others as well."""

    def __init__(self, seed: int, words: Vocabulary, existing: bool = False) -> None:
        self.random = random.Random(seed)
        self.words, self.existing = words, existing

    def prop(self) -> ex.PropertyExpression:
        name = self.random.choice(self.words.objects)
        return ex.ObjectInverseOf(name) if self.random.random() < 0.25 else name

    def data_range(self, depth: int = 1) -> ex.DataRange:
        draw = self.random
        choice = draw.randrange(9 if depth else 6)
        if choice <= 1:
            return draw.choice([XSD + 'integer', XSD + 'decimal', TOP_LITERAL, XSD + 'string'])
        if choice <= 3:
            facet = (XSD + draw.choice([*FACETS]), num(draw.randrange(4)))
            return ex.DatatypeRestriction(XSD + 'integer', (facet,))
        if choice <= 5:
            numbers = draw.sample(self.words.numbers, draw.choice([1, 1, 2]))
            return ex.DataOneOf(tuple(map(num, numbers)))
        if choice == 6:
            return ex.DataComplementOf(self.data_range(0))
        record: Any = draw.choice([ex.DataUnionOf, ex.DataIntersectionOf])
        joined: ex.DataRange = record((self.data_range(0), self.data_range(0)))
        return joined

    def some_individuals(self) -> tuple[str, ...]:
        names = self.words.individuals
        return tuple(self.random.sample(names, self.random.randrange(1, len(names) + 1)))

    def left(self, depth: int = 2) -> ClassExpression:
        """Return a class whose members some facts make."""
        if self.existing and self.random.random() < 0.15:
            return ex.ObjectAllValuesFrom(self.prop(), self.right(depth - 1 if depth else 0))
        draw, less = self.random, depth - 1
        choice = draw.randrange(16 if self.words.datas else 12) if depth else draw.randrange(3)
        if choice <= 2:
            return draw.choice([*self.words.classes, *self.words.classes, THING])
        if choice in (3, 4):
            record: Any = draw.choice([ex.ObjectIntersectionOf, ex.ObjectUnionOf])
            joined: ClassExpression = record((self.left(less), self.left(less)))
            return joined
        if choice in (5, 6):
            return ex.ObjectSomeValuesFrom(self.prop(), self.left(less))
        if choice == 7:
            return ex.ObjectMinCardinality(draw.choice([1, 2, 2]), self.prop(), self.left(less))
        if choice == 8:
            return ex.ObjectComplementOf(self.right(less))
        return self._either(choice, min)

    def right(self, depth: int = 2) -> ClassExpression:
        """Return a class whose members have to have, or not to have, some facts."""
        draw, less = self.random, depth - 1
        if self.existing and draw.random() < 0.3:
            return ex.ObjectSomeValuesFrom(self.prop(), self.right(less if depth else 0))
        choice = draw.randrange(16 if self.words.datas else 12) if depth else draw.randrange(3)
        if choice <= 2:
            return draw.choice([*self.words.classes, *self.words.classes, NOTHING])
        if choice == 3:
            return ex.ObjectIntersectionOf((self.right(less), self.right(less)))
        if choice == 4:
            return ex.ObjectUnionOf((self.right(less), self.right(less)))
        if choice == 5:
            return ex.ObjectComplementOf(self.left(less))
        if choice in (6, 7):
            return ex.ObjectAllValuesFrom(self.prop(), self.right(less))
        if choice == 8:
            return ex.ObjectMaxCardinality(draw.choice([0, 1, 1, 2]), self.prop(), self.left(less))
        return self._either(choice, max)

    def _either(self, choice: int, least_or_most: object) -> ClassExpression:
        draw = self.random
        if choice in (9, 10) and not self.words.individuals:
            return draw.choice(self.words.classes)
        if choice == 9:
            return ex.ObjectHasValue(self.prop(), draw.choice(self.words.individuals))
        if choice == 10:
            return ex.ObjectOneOf(self.some_individuals())
        if choice == 11:
            return ex.ObjectHasSelf(self.prop())
        data = draw.choice(self.words.datas)
        if choice == 12:
            return ex.DataHasValue(data, num(draw.choice(self.words.numbers)))
        is_least = least_or_most is min
        if choice == 13:
            counted: Any = ex.DataMinCardinality if is_least else ex.DataMaxCardinality
            made: ClassExpression = counted(draw.choice([1, 2]), data, self.data_range())
            return made
        return (ex.DataSomeValuesFrom if is_least else ex.DataAllValuesFrom)(
            data, self.data_range()
        )

    def schema_axiom(self) -> Axiom:
        draw, words = self.random, self.words
        choice = draw.randrange(22 if words.datas else 18)
        if choice <= 5:
            return ax.SubClassOf(self.left(), self.right())
        if choice == 6:
            return ax.EquivalentClasses((draw.choice(words.classes), self.left(0)))
        if choice == 7:
            return ax.DisjointClasses((self.left(1), self.left(1)))
        if choice == 8:
            parts = self.left(0), draw.choice(words.classes)
            return ax.DisjointUnion(draw.choice(words.classes), parts)
        if choice in (9, 10):
            made: Axiom = draw.choice(OF_PROPERTIES)(self.prop())
            return made
        if choice == 11:
            kinds = [ax.SubObjectPropertyOf, ax.InverseObjectProperties]
            related: Axiom = draw.choice(kinds)(self.prop(), self.prop())
            return related
        if choice == 12:
            record: Any = draw.choice([ax.EquivalentObjectProperties, ax.DisjointObjectProperties])
            several: Axiom = record((self.prop(), self.prop()))
            return several
        if choice == 13:
            return ax.SubPropertyChainOf((self.prop(), self.prop()), self.prop())
        if choice == 14:
            domain: Any = draw.choice([ax.ObjectPropertyDomain, ax.ObjectPropertyRange])
            ranged: Axiom = domain(self.prop(), self.right())
            return ranged
        if choice <= 16:
            return self.rule()
        if choice == 17:
            if words.datas and draw.random() < 0.5:
                return ax.HasKey(self.left(0), (), (draw.choice(words.datas),))
            return ax.HasKey(self.left(0), (self.prop(),), ())
        data, other = (draw.choice(words.datas) for _ in range(2))
        if choice == 18:
            return ax.DataPropertyDomain(data, self.right())
        if choice == 19:
            return ax.DataPropertyRange(data, self.data_range())
        if choice == 20:
            kind: Any = draw.choice([ax.EquivalentDataProperties, ax.DisjointDataProperties])
            pair: Axiom = kind((data, other))
            return pair if draw.random() < 0.5 else ax.FunctionalDataProperty(data)
        return ax.SubDataPropertyOf(data, other)

    def rule(self) -> ax.Rule:
        draw = self.random
        people = [X, Y, Z]
        about: list[ex.Atom] = [
            ex.ObjectPropertyAtom(self.prop(), *draw.sample(people, 2)) for _ in range(2)
        ]
        about.append(ex.ClassAtom(self.left(1), draw.choice(people)))
        record: Any = draw.choice([ex.SameIndividualAtom, ex.DifferentIndividualsAtom])
        about.append(record(*draw.sample([*people, *self.words.individuals], 2)))
        body = draw.sample(about, draw.choice([1, 2, 2, 3]))
        heads: list[ex.Atom] = [
            ex.ClassAtom(self.right(1), draw.choice(people)),
            ex.ObjectPropertyAtom(draw.choice(self.words.objects), *draw.sample(people, 2)),
            record(*draw.sample(people, 2)),
        ]
        if self.words.datas:
            values = [ex.DataPropertyAtom(draw.choice(self.words.datas), X, V)]
            values.append(ex.DataPropertyAtom(draw.choice(self.words.datas), Y, W))
            compare = SWRLB + draw.choice([*COMPARISONS])
            number = num(draw.choice(self.words.numbers))
            other: ex.DataArgument = W if draw.random() < 0.5 else number
            body = [*values, ex.BuiltinAtom(compare, (V, other)), *body[:1]]
            heads.append(ex.DataPropertyAtom(draw.choice(self.words.datas), Y, V))
        known = {term for atom in body for term in terms_of(atom)}
        fit = [head for head in heads if known >= {*terms_of(head)}]
        return ax.Rule(tuple(body), tuple(draw.sample(fit, 1)) if fit else ())

    def assertion(self) -> Axiom:
        draw, words = self.random, self.words
        one, other = draw.choice(words.individuals), draw.choice(words.individuals)
        choice = draw.randrange(14 if words.datas else 11)
        if choice <= 2:
            return ax.ClassAssertion(draw.choice(words.classes), one)
        if choice == 3:
            return ax.ClassAssertion(self.right(), one)
        if choice <= 7:
            return ax.ObjectPropertyAssertion(draw.choice(words.objects), one, other)
        if choice == 8:
            return ax.NegativeObjectPropertyAssertion(draw.choice(words.objects), one, other)
        if choice <= 10:
            if len(words.individuals) == 1:
                return (
                    ax.ClassAssertion(self.left(1), one) if self.existing else self.schema_axiom()
                )
            record: Any = ax.DifferentIndividuals if draw.random() < 0.7 else ax.SameIndividual
            made: Axiom = record(frozenset(draw.sample(words.individuals, 2)))
            return made
        value = num(draw.choice(words.numbers))
        if choice == 13 and draw.random() < 0.4:
            return ax.NegativeDataPropertyAssertion(draw.choice(words.datas), one, value)
        return ax.DataPropertyAssertion(draw.choice(words.datas), one, value)


def questions(words: Vocabulary) -> Iterator[Axiom]:
    """Yield every fact of a vocabulary, and which class may be below which."""
    yield from (ax.ClassAssertion(*pair) for pair in product(words.classes, words.individuals))
    people = list(product(words.individuals, repeat=2))
    for prop in words.objects:
        yield from (ax.ObjectPropertyAssertion(prop, *pair) for pair in people)
    for prop, one, number in product(words.datas, words.individuals, words.numbers):
        yield ax.DataPropertyAssertion(prop, one, num(number))
    for two in combinations(words.individuals, 2):
        yield ax.SameIndividual(frozenset(two))
        yield ax.DifferentIndividuals(frozenset(two))
    if words.unnamed:
        yield from (ax.SubClassOf(*pair) for pair in product(words.classes, repeat=2))


def compare(kb: KnowledgeBase, models: AllModels, words: Vocabulary, exact: bool) -> None:
    exact = exact and not kb.unsupported
    assert kb.consistent >= models.consistent
    if exact:
        assert kb.consistent == models.consistent
    if not kb.consistent:
        return
    for question in questions(words):
        found, holds = kb.holds(question), models.entail(question)
        assert found <= holds, question
        if exact and isinstance(question, ax.DifferentIndividuals):
            # Not all of it is derived: it may take a search for a model.
            answer = kb.entails(question)
            found = holds if isinstance(answer, Unknown) else answer
        if exact:
            assert found == holds, question


@pytest.mark.parametrize('existing', [False, True])
@pytest.mark.parametrize('seed', range(40))
def test_what_holds_is_what_holds_in_all_models(seed: int, existing: bool) -> None:
    words = VOCABULARIES[seed % len(VOCABULARIES)]
    draw = Draw(seed, words, existing)
    declared = [ax.Declaration('individual', name) for name in words.individuals]
    axioms = [draw.schema_axiom() for _ in range(draw.random.randrange(1, 6))]
    axioms += [draw.assertion() for _ in range(draw.random.randrange(3, 9))]
    models = AllModels(words)
    kb = KnowledgeBase('x:', [*declared, *axioms])
    for _ in range(3):
        kb.reason()
        compare(kb, models.of(kb.axioms()), words, not existing)
        gone = draw.random.choice([axiom for axiom in kb.axioms() if axiom not in declared])
        kb.change([draw.random.choice([draw.assertion, draw.schema_axiom])()], [gone])


@pytest.mark.parametrize('existing', [False, True])
@pytest.mark.parametrize('seed', range(12))
def test_assertions_that_come_and_go_leave_what_holds_in_all_models(
    seed: int, existing: bool
) -> None:
    """Where it takes cases, models stay between such changes."""
    words = VOCABULARIES[seed % 4]
    draw = Draw(100 + seed, words, existing)
    parts = ex.ObjectUnionOf((draw.left(0), draw.right(1)))
    axioms: list[Axiom] = [ax.Declaration('individual', name) for name in words.individuals]
    axioms += [ax.SubClassOf(A, parts), *(draw.schema_axiom() for _ in range(2))]
    kb = KnowledgeBase('x:', [*axioms, *(draw.assertion() for _ in range(4))])
    models = AllModels(words)
    moving: Axiom | None = None
    for step in range(10):
        kb.reason()
        compare(kb, models.of(kb.axioms()), words, not existing)
        # One fact moves, as a clock does; now and then another one comes or goes.
        come: list[Axiom] = [draw.assertion()]
        gone = [moving] if moving is not None else []
        moving = come[0]
        if step % 3 == 2:
            others = [axiom for axiom in kb.axioms() if isinstance(axiom, ax.Assertion)]
            gone += draw.random.sample(others, min(1, len(others)))
        kb.change(come, [axiom for axiom in gone if axiom not in come])


class Merging(Draw):
    """Draws what makes individuals the same, keeps them apart, and links them."""

    def schema_axiom(self) -> Axiom:
        draw = self.random
        pair, back = draw.sample([X, Y, Z, V], 2), ex.ObjectInverseOf(P)
        links = ex.ObjectPropertyAtom(P, X, Y), ex.ObjectPropertyAtom(P, Z, V)
        apart = ex.DifferentIndividualsAtom(X, Z)
        record: Any = draw.choice([ex.SameIndividualAtom, ex.DifferentIndividualsAtom])
        found: Axiom = draw.choice(
            [
                ax.FunctionalObjectProperty(P),
                ax.InverseFunctionalObjectProperty(P),
                ax.SubClassOf(THING, ex.ObjectMaxCardinality(draw.choice([1, 2]), back)),
                ax.SubClassOf(ex.ObjectHasValue(P, i), ex.ObjectOneOf(self.some_individuals())),
                ax.SubClassOf(ex.ObjectMinCardinality(2, P), ex.ObjectHasSelf(P)),
                ax.HasKey(THING, (P,), ()),
                ax.SymmetricObjectProperty(P),
                ax.IrreflexiveObjectProperty(P),
                ax.SubPropertyChainOf((P, back, P), P),
                ax.Rule(links[: draw.choice([1, 2])], (record(*pair),)),
                ax.Rule((*links, apart), (ex.ObjectPropertyAtom(P, X, V),)),
            ]
        )
        if isinstance(found, ax.Rule):
            known = {term for atom in found.body for term in terms_of(atom)}
            return found if known >= set(pair) else self.schema_axiom()
        return found

    def assertion(self) -> Axiom:
        draw, names = self.random, self.words.individuals
        choice = draw.randrange(8)
        if choice <= 3:
            return ax.ObjectPropertyAssertion(P, draw.choice(names), draw.choice(names))
        if choice == 4:
            return ax.NegativeObjectPropertyAssertion(P, draw.choice(names), draw.choice(names))
        record: Any = ax.SameIndividual if choice == 5 else ax.DifferentIndividuals
        made: Axiom = record(frozenset(draw.sample(names, draw.choice([2, 2, 3]))))
        return made


@pytest.mark.parametrize('seed', range(16))
def test_who_is_the_same_and_why_is_so_in_all_models(seed: int) -> None:
    words = Vocabulary((), (P,), (), (i, j, k, m))
    draw = Merging(seed, words)
    declared: list[Axiom] = [ax.Declaration('individual', name) for name in words.individuals]
    axioms = [*declared, *(draw.schema_axiom() for _ in range(draw.random.choice([1, 2, 3])))]
    kb = KnowledgeBase('x:', [*axioms, *(draw.assertion() for _ in range(5))])
    models, others = AllModels(words), AllModels(words)
    for _ in range(7):
        kb.reason()
        compare(kb, models.of(kb.axioms()), words, exact=True)
        asked: list[Axiom | None] = [None]
        if kb.consistent:
            known = [q for q in questions(words) if kb.holds(q) and q not in set(kb.axioms())]
            asked = [*draw.random.sample(known, min(2, len(known)))]
        for question in asked:
            told = kb.explain(question) if question else kb.explain_inconsistency()
            if told is not None:
                others.of([*declared, *told.sources()])
                assert others.entail(question) if question else not others.consistent
            fewest = kb.justification(question)
            assert bool(fewest) == bool(told) or kb.unsupported
            for left_out in (None, *fewest):
                others.of([*declared, *(axiom for axiom in fewest if axiom != left_out)])
                follows = others.entail(question) if question else not others.consistent
                assert follows == (left_out is None and bool(fewest)) or kb.unsupported
        assertions = [axiom for axiom in kb.axioms() if isinstance(axiom, ax.Assertion)]
        gone = draw.random.sample(assertions, min(draw.random.choice([0, 1, 2]), len(assertions)))
        kb.change([draw.assertion() for _ in range(draw.random.choice([0, 1, 2]))], gone)


def goals(words: Vocabulary) -> list[Axiom]:
    """Return axioms of all kinds that can be asked for, each refuted by two elements or none."""
    a, b = words.classes[:2]
    p = words.objects[0]
    found: list[Axiom] = [record((a, b)) for record in (ax.EquivalentClasses, ax.DisjointClasses)]
    found += [ax.DisjointUnion(a, (b, ex.ObjectSomeValuesFrom(p, a)))]
    found += [ax.SubClassOf(*pair) for pair in product((a, b, THING, NOTHING), repeat=2)]
    found.append(ax.SubClassOf(ex.ObjectSomeValuesFrom(p, a), ex.ObjectComplementOf(b)))
    for prop in (p, ex.ObjectInverseOf(p)):
        found += [record(prop) for record in OF_PROPERTIES if record not in LARGER]
        found += [record(prop, b) for record in (ax.ObjectPropertyDomain, ax.ObjectPropertyRange)]
    roles: tuple[ex.PropertyExpression, ...] = (p, ex.ObjectInverseOf(p))
    for both in product(roles, words.objects):
        found += [ax.EquivalentObjectProperties(both), ax.DisjointObjectProperties(both)]
        kinds: tuple[Any, ...] = (ax.SubObjectPropertyOf, ax.InverseObjectProperties)
        found += [record(*both) for record in kinds]
    for one in words.individuals:
        found.append(ax.ClassAssertion(ex.ObjectComplementOf(a), one))
        found += [ax.NegativeObjectPropertyAssertion(p, one, each) for each in words.individuals]
    return [*found, *questions(words)]


def larger_goals(words: Vocabulary) -> list[Axiom]:
    """Return axioms that it may take more elements, or other values, to refute."""
    p, back = words.objects[0], ex.ObjectInverseOf(words.objects[0])
    found: list[Axiom] = [record(prop) for record in LARGER for prop in (p, back)]
    found += [ax.SubPropertyChainOf(chain, p) for chain in ((p, back), (p, p, p), (back, back))]
    for data in words.datas:
        found += [
            ax.FunctionalDataProperty(data),
            ax.DataPropertyDomain(data, words.classes[0]),
            ax.DataPropertyRange(data, ex.DataOneOf((num(1),))),
            ax.SubClassOf(words.classes[0], ex.DataSomeValuesFrom(data, TOP_LITERAL)),
        ]
        for one, number in product(words.individuals, words.numbers):
            found.append(ax.NegativeDataPropertyAssertion(data, one, num(number)))
    return found


@pytest.mark.parametrize('seed', range(24))
def test_an_axiom_of_any_kind_follows_as_it_does_in_all_models(seed: int) -> None:
    words = (
        Vocabulary((A, B), (P,), (), (i,), unnamed=2),
        Vocabulary((A, B), (P,), (S,), (i,), unnamed=1),
        Vocabulary((A, B), (P, Q), (), (), unnamed=2),
    )[seed % 3]
    draw = Draw(seed, words)
    axioms: list[Axiom] = [ax.Declaration('individual', name) for name in words.individuals]
    while len(axioms) < draw.random.choice([3, 4, 6, 8]):
        axioms.append(draw.schema_axiom())
    models = AllModels(words).of(axioms)
    kb = KnowledgeBase('x:', axioms)
    kb.reason()
    exact = words.unnamed == 2
    for goal in [*draw.random.sample(goals(words), 14), *larger_goals(words)]:
        answer = kb.entails(goal)
        if not isinstance(answer, Unknown):
            holds = models.entail(goal)
            assert answer <= holds, goal
            if exact and goal not in larger_goals(words):
                assert answer == holds, goal
