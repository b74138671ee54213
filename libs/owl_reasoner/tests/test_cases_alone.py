"""Reasoning by cases without the clauses, beside all models over a few elements.

A knowledge base leaves to the cases what no clause finds. Here all of it is theirs, so what they
make of an axiom shows where a clause would have found the same.
"""

from __future__ import annotations

from typing import Any

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import ClassExpression
from owl_reasoner.owl.vocabulary import NOTHING, TOP_LITERAL
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.hypertableau.entailment import CaseReasoner
from owl_reasoner.reasoner.hypertableau.incremental import (
    ChangeHistory,
    IncrementalCases,
    is_plain,
)

from .all_models import AllModels, Vocabulary
from .small_ontologies import A, B, C, P, S, T, i, j, num
from .test_all_models import VOCABULARIES, Draw, compare, questions


def as_in_models(
    cases: CaseReasoner | IncrementalCases,
    axioms: set[Axiom],
    models: AllModels,
    words: Vocabulary,
    exact: bool,
) -> None:
    """Compare the facts that cases find beside the axioms with those of all models.

    Args:
        cases: Reasons over the axioms.
        axioms: What they are.
        models: Those of the axioms.
        words: What the axioms speak of.
        exact: Whether the models are all that matter; else they may have facts of their own.
    """
    consistent = cases.consistent()
    assert consistent >= models.consistent
    found = axioms | (set(cases.facts(axioms.__contains__)) if consistent else set())
    exact = exact and not cases.stopped and not cases.gaps
    assert consistent == models.consistent or not exact
    for question in questions(words) if consistent else ():
        if not isinstance(question, ax.DifferentIndividuals | ax.SubClassOf):
            holds = models.entail(question)
            assert (question in found) <= holds, question
            assert (question in found) == holds or not exact, question
    if consistent and not cases.stopped:
        for pair in cases.hierarchy(words.classes, lambda *_: False):
            assert models.entail(ax.SubClassOf(*pair)), pair


def declared(words: Vocabulary) -> list[Axiom]:
    return [ax.Declaration('individual', name) for name in words.individuals]


@pytest.mark.parametrize('seed', range(50))
def test_cases_alone_find_what_holds_in_all_models(seed: int) -> None:
    existing = seed >= 40
    words = VOCABULARIES[seed % len(VOCABULARIES)]
    draw = Draw(200 + seed, words, existing)
    axioms = [*declared(words), *(draw.schema_axiom() for _ in range(draw.random.randrange(1, 6)))]
    axioms += [draw.assertion() for _ in range(draw.random.randrange(3, 9))]
    models = AllModels(words).of(axioms)
    as_in_models(CaseReasoner(axioms), set(axioms), models, words, not existing)


@pytest.mark.parametrize('seed', range(16))
def test_models_that_are_kept_show_what_holds_in_all_models(seed: int) -> None:
    words = VOCABULARIES[seed % 4]
    draw = Draw(300 + seed, words)
    schema = [draw.schema_axiom() for _ in range(3)]
    schema.append(ax.SubClassOf(A, ex.ObjectUnionOf((draw.left(0), draw.right(1)))))
    said = {draw.assertion(): None for _ in range(6)}
    pool = [axiom for axiom in (*said, *(draw.assertion() for _ in range(6))) if is_plain((axiom,))]
    history = ChangeHistory()
    history.note(pool)
    cases = IncrementalCases(schema, [*declared(words), *said], history, 100_000, Budget())
    models = AllModels(words)
    if not cases.build(said.__contains__):
        return
    for _ in range(6):
        axioms = [*declared(words), *schema, *said]
        as_in_models(cases, set(axioms), models.of(axioms), words, exact=True)
        moved = draw.random.sample(pool, min(2, len(pool)))
        gone = [axiom for axiom in moved if axiom in said]
        come = [axiom for axiom in dict.fromkeys(moved) if axiom not in said]
        if not cases.is_usable or not cases.take(come, gone):
            return
        said = {axiom: None for axiom in (*said, *come) if axiom not in gone}


class Values(Draw):
    """Draws ontologies where some values must exist, each of them one of a few numbers.

    So all of them are in the models, and these are exact. Without object properties each element
    is by itself, and one is enough to refute what is said of classes.
    """

    def data_range(self, depth: int = 1) -> ex.DataRange:
        numbers = self.words.numbers
        if self.random.random() < 0.7:
            chosen = self.random.sample(numbers, self.random.randrange(1, len(numbers) + 1))
            return ex.DataOneOf(tuple(map(num, chosen)))
        return super().data_range(depth)

    def required(self) -> ClassExpression:
        draw, data, some = self.random, self.random.choice(self.words.datas), self.data_range()
        choices: list[ClassExpression] = [
            ex.DataSomeValuesFrom(data, some),
            ex.DataSomeValuesFrom(data, some),
            ex.DataMinCardinality(2, data, some),
            ex.DataMinCardinality(draw.choice([2, 3]), data, TOP_LITERAL),
            ex.DataHasValue(data, num(draw.choice(self.words.numbers))),
            ex.DataAllValuesFrom(data, some),
            ex.DataMaxCardinality(draw.choice([0, 1, 1, 2]), data, some),
        ]
        return draw.choice(choices)

    def recognised(self) -> ClassExpression:
        draw, data, some = self.random, self.random.choice(self.words.datas), self.data_range()
        choices: list[ClassExpression] = [
            ex.DataSomeValuesFrom(data, some),
            ex.DataMinCardinality(draw.choice([1, 2, 2, 3]), data, some),
            ex.ObjectIntersectionOf((ex.DataSomeValuesFrom(data, some), self.named())),
            ex.DataHasValue(data, num(draw.choice(self.words.numbers))),
        ]
        return draw.choice(choices)

    def named(self) -> str:
        return self.random.choice(self.words.classes)

    def schema_axiom(self) -> Axiom:
        draw, datas = self.random, self.words.datas
        choice = draw.randrange(16 if self.words.objects else 14)
        if choice <= 4:
            return ax.SubClassOf(self.named(), self.required())
        if choice <= 8:
            return ax.SubClassOf(self.recognised(), self.named())
        if choice == 9:
            return ax.FunctionalDataProperty(draw.choice(datas))
        if choice == 10:
            return ax.DataPropertyRange(draw.choice(datas), self.data_range())
        if choice == 11:
            return ax.SubClassOf(self.recognised(), self.required())
        if choice <= 13:
            if len(datas) == 1:
                return ax.SubClassOf(*draw.sample(self.words.classes, 2))
            return draw.choice(
                [ax.SubDataPropertyOf(*datas), ax.DisjointDataProperties(tuple(datas))]
            )
        return self.rule() if choice == 14 else super().schema_axiom()

    def assertion(self) -> Axiom:
        draw, words = self.random, self.words
        if words.objects and draw.random() < 0.5:
            return super().assertion()
        record: Any = draw.choice([ax.DataPropertyAssertion, ax.NegativeDataPropertyAssertion])
        number = num(draw.choice(words.numbers))
        made: Axiom = record(draw.choice(words.datas), draw.choice(words.individuals), number)
        return made

    def ontology(self) -> list[Axiom]:
        """Return declarations, the ranges of all values, axioms, and some assertions."""
        draw, numbers = self.random, ex.DataOneOf(tuple(map(num, self.words.numbers)))
        axioms = declared(self.words)
        axioms += [ax.Declaration('class', name) for name in self.words.classes]
        axioms += [ax.DataPropertyRange(prop, numbers) for prop in self.words.datas]
        axioms += [self.schema_axiom() for _ in range(draw.randrange(2, 7))]
        for name in self.words.individuals:
            axioms += [ax.ClassAssertion(self.named(), name), self.assertion()]
        return list(dict.fromkeys(axioms))


OF_VALUES = (
    Vocabulary((A, B, C), (), (S, T), (), (1, 2, 3), unnamed=1),
    Vocabulary((A, B), (P,), (S, T), (i, j)),
    Vocabulary((A, B), (P,), (S,), (i, j), (1, 2, 3)),
    Vocabulary((A, B, C), (), (S, T), (i,), (1, 2, 3)),
)


@pytest.mark.parametrize('words', OF_VALUES, ids=['classes', 'two', 'one', 'alone'])
@pytest.mark.parametrize('first', range(0, 60, 20))
def test_values_that_must_exist_are_as_in_all_models(words: Vocabulary, first: int) -> None:
    for seed in range(first, first + 20):
        axioms = Values(seed, words).ontology()
        models = AllModels(words).of(axioms)
        kb = KnowledgeBase('x:', axioms)
        kb.reason()
        compare(kb, models, words, exact=True)
        if words.unnamed and kb.consistent and not kb.unsupported:
            for cls in words.classes:
                empty = ax.SubClassOf(cls, NOTHING)
                assert kb.holds(empty) == models.entail(empty), empty
        as_in_models(CaseReasoner(axioms), set(axioms), models, words, exact=True)
