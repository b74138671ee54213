"""What follows in every case, though no Horn clause says so."""

from __future__ import annotations

import itertools
from functools import partial

import pytest

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom, ClassAssertion, SubClassOf
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import NOTHING, SWRLB, THING, TOP_LITERAL, XSD
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import UnsupportedError
from owl_reasoner.reasoner.hypertableau.entailment import CaseReasoner, entails

from .wide_ontologies import INDIVIDUALS, PlainOntology, WideOntology

A, B, C, D = (f'x:{name}' for name in 'ABCD')
P, Q, R = (f'x:{name}' for name in 'pqr')
S, T = 'x:s', 'x:t'
i, j, k, m = (f'x:{name}' for name in 'ijkm')
B_OR_C = ex.ObjectUnionOf((B, C))


def reasoned(*axioms: Axiom) -> KnowledgeBase:
    kb = KnowledgeBase('x:', axioms)
    kb.reason()
    return kb


def whole(number: int) -> Literal:
    return Literal(str(number), XSD + 'integer')


def differ(*names: str) -> Axiom:
    return ax.DifferentIndividuals(frozenset(names))


def test_both_cases_lead_to_the_same_class() -> None:
    kb = reasoned(SubClassOf(A, B_OR_C), SubClassOf(B, D), SubClassOf(C, D), ClassAssertion(A, i))
    assert kb.superclasses(A) == {D}
    assert kb.types(i) == {A, D}
    assert kb.unsupported == ()


def test_one_case_is_excluded() -> None:
    denied = ClassAssertion(ex.ObjectComplementOf(B), i)
    kb = reasoned(SubClassOf(A, B_OR_C), ClassAssertion(A, i), denied)
    assert kb.types(i) == {A, C}
    kb.remove(denied)
    kb.reason()
    assert kb.types(i) == {A}
    kb.change([denied, ClassAssertion(ex.ObjectComplementOf(C), i)])
    assert not kb.reason()
    kb.remove(denied)
    assert kb.reason()
    assert kb.types(i) == {A, B}


def test_one_of_several_individuals() -> None:
    kb = reasoned(
        SubClassOf(A, ex.ObjectOneOf((j, k))),
        ClassAssertion(A, i),
        ClassAssertion(B, j),
        ClassAssertion(B, k),
        differ(i, j),
    )
    assert kb.types(i) == {A, B}
    assert ax.SameIndividual(frozenset((i, k))) in set(kb.facts())
    kb.remove(differ(i, j))
    kb.reason()
    assert kb.types(i) == {A, B}
    assert ax.SameIndividual(frozenset((i, k))) not in set(kb.facts())


def test_three_of_whom_two_are_the_same() -> None:
    links = [ax.ObjectPropertyAssertion(P, i, one) for one in (j, k, m)]
    most = ClassAssertion(ex.ObjectMaxCardinality(2, P), i)
    kb = reasoned(most, *links, *(ClassAssertion(A, one) for one in (j, k)), differ(j, k))
    assert kb.unsupported == ()
    kb.add(ClassAssertion(ex.ObjectComplementOf(A), m))
    assert not kb.reason()
    kb.remove(most)
    assert kb.reason()


def test_who_sees_the_king_sees_somebody_above() -> None:
    """The oil-rig puzzle: either way somebody free is next to somebody who is not."""
    links = [ax.ObjectPropertyAssertion(P, *pair) for pair in ((i, j), (j, k))]
    next_to = ex.ObjectIntersectionOf((A, ex.ObjectSomeValuesFrom(P, ex.ObjectComplementOf(A))))
    kb = reasoned(
        *links,
        ClassAssertion(A, i),
        ClassAssertion(ex.ObjectComplementOf(A), k),
        SubClassOf(ex.ObjectSomeValuesFrom(Q, next_to), B),
        *(ax.ObjectPropertyAssertion(Q, m, one) for one in (i, j)),
    )
    assert kb.types(m) == {B}


@pytest.mark.parametrize(
    'axioms',
    [
        [SubClassOf(A, ex.DataMinCardinality(3, S)), ax.DataPropertyRange(S, XSD + 'boolean')],
        [SubClassOf(A, ex.ObjectSomeValuesFrom(P, A)), SubClassOf(THING, ex.ObjectOneOf((i,))),
         ax.IrreflexiveObjectProperty(P)],
        [SubClassOf(A, ex.ObjectSomeValuesFrom(P, B_OR_C)), SubClassOf(B, NOTHING),
         SubClassOf(A, ex.ObjectAllValuesFrom(P, ex.ObjectComplementOf(C)))],
        [SubClassOf(A, ex.ObjectMinCardinality(3, P, B_OR_C)),
         *(SubClassOf(A, ex.ObjectMaxCardinality(1, P, one)) for one in (B, C))],
    ],
)  # fmt: skip
def test_a_class_without_members(axioms: list[Axiom]) -> None:
    kb = reasoned(*axioms, ax.Declaration('class', A), ax.Declaration('class', D))
    assert D in kb.superclasses(A)
    assert kb.holds(SubClassOf(A, NOTHING))


def test_an_endless_chain_of_successors_ends() -> None:
    everybody = ex.ObjectIntersectionOf((B_OR_C, ex.ObjectSomeValuesFrom(P, A)))
    kb = reasoned(SubClassOf(A, everybody), ClassAssertion(A, i), ax.TransitiveObjectProperty(P))
    assert kb.consistent
    assert kb.unsupported == ()


def test_values_in_cases() -> None:
    few = ax.DataPropertyRange(S, ex.DataOneOf((whole(1), whole(2))))
    kb = reasoned(
        few,
        SubClassOf(ex.DataHasValue(S, whole(1)), B),
        SubClassOf(ex.DataHasValue(S, whole(2)), B),
        ClassAssertion(ex.DataSomeValuesFrom(S, XSD + 'integer'), i),
    )
    assert kb.types(i) == {B}


@pytest.mark.parametrize(
    'chain',
    [
        (ax.SymmetricObjectProperty(P), ax.TransitiveObjectProperty(P)),
        (ax.SubPropertyChainOf((P, ex.ObjectInverseOf(P)), Q), ax.SubObjectPropertyOf(Q, R)),
    ],
)
def test_a_chain_over_somebody_unnamed_and_back_joins_the_named(chain: tuple[Axiom, ...]) -> None:
    last = R if isinstance(chain[1], ax.SubObjectPropertyOf) else P
    kb = reasoned(*chain, SubClassOf(A, ex.ObjectSomeValuesFrom(P, THING)), ClassAssertion(A, i))
    assert kb.object_values(last, i) == {i}
    assert kb.unsupported == ()
    denied = ax.NegativeObjectPropertyAssertion(last, i, i)
    kb.add(denied)
    assert not kb.reason()
    kb.change([], [denied])
    assert kb.reason()


def test_a_chain_over_somebody_unnamed_and_back_reaches_nobody_else() -> None:
    chained = (ax.SymmetricObjectProperty(P), ax.TransitiveObjectProperty(P))
    some = SubClassOf(A, ex.ObjectSomeValuesFrom(P, THING))
    above = ax.SubObjectPropertyOf(P, Q)
    kb = reasoned(*chained, some, above, ClassAssertion(A, i), ClassAssertion(A, j))
    assert kb.object_values(Q, i) == {i}
    assert kb.object_values(Q, j) == {j}


@pytest.mark.parametrize(
    'axiom',
    [
        ax.DisjointClasses((A, ex.ObjectUnionOf((B, ex.ObjectComplementOf(NOTHING))))),
        ax.DisjointUnion(D, (A, THING)),
        ax.DisjointClasses((A, ex.ObjectIntersectionOf((A, THING)), D)),
    ],
)
def test_what_is_disjoint_with_everything_is_empty(axiom: Axiom) -> None:
    kb = reasoned(axiom, SubClassOf(C, B))
    assert A in kb.subclasses(NOTHING)
    kb.add(ClassAssertion(A, i))
    assert not kb.reason()


def test_whoever_is_disjoint_with_a_complement_is_in_the_class() -> None:
    outside = ex.ObjectComplementOf(A)
    kb = reasoned(ax.DisjointClasses((outside, ex.ObjectOneOf((i,)))), ClassAssertion(B, j))
    assert kb.instances(A) == {i}
    kb.add(ax.DisjointUnion(C, (B, outside)))
    assert kb.reason()
    assert kb.instances(A) == {i, j}


def test_as_many_values_as_a_range_has_are_all_of_them() -> None:
    some = ex.DataOneOf((whole(1), whole(2), whole(3)))
    all_three = SubClassOf(A, ex.DataMinCardinality(3, P, some))
    two = SubClassOf(B, ex.DataMinCardinality(2, P, some))
    kb = reasoned(all_three, two, ClassAssertion(A, i), ClassAssertion(B, j))
    assert kb.data_values(P, i) == {whole(1), whole(2), whole(3)}
    assert not kb.data_values(P, j)


def test_all_values_of_a_datatype_are_not_asked_for_one_by_one() -> None:
    every_byte = ClassAssertion(ex.DataMinCardinality(256, P, XSD + 'byte'), i)
    cases = CaseReasoner([every_byte], most_steps=2_000)
    found = set(cases.facts(lambda _: False))
    bytes_of_i = {ax.DataPropertyAssertion(P, i, whole(number)) for number in range(-128, 128)}
    assert found == bytes_of_i
    assert not cases.stopped


def test_an_ill_formed_literal_is_a_value_in_no_datatype_for_clauses_and_cases() -> None:
    wrong = Literal('4a', XSD + 'int')
    kb = reasoned(ax.DataPropertyAssertion(S, i, wrong))
    assert kb.consistent
    assert not kb.entails(ClassAssertion(B, i))
    kb.change([SubClassOf(A, B_OR_C), ClassAssertion(A, i)])
    assert kb.reason()
    assert not kb.entails(ClassAssertion(B, i))
    for datatype in ('int', 'string'):
        of_type = ax.DataPropertyRange(S, XSD + datatype)
        kb.add(of_type)
        assert not kb.reason()
        kb.change([], [of_type])
    assert kb.reason()


def test_as_many_values_as_there_are_take_no_search() -> None:
    numbers = ex.DataOneOf(tuple(whole(number) for number in range(40)))
    kb = reasoned(
        ax.DataPropertyRange(S, numbers),
        ClassAssertion(ex.DataMinCardinality(40, S, TOP_LITERAL), i),
    )
    assert kb.consistent
    excluded = ax.NegativeDataPropertyAssertion(S, i, whole(5))
    kb.add(excluded)
    assert not kb.reason()
    kb.remove(excluded)
    assert kb.reason()
    assert kb.unsupported == ()


def test_any_axiom_can_be_asked_for() -> None:
    kb = reasoned(
        SubClassOf(A, B_OR_C),
        ax.SubObjectPropertyOf(P, Q),
        ax.FunctionalObjectProperty(Q),
        ax.ObjectPropertyDomain(Q, A),
        ax.InverseObjectProperties(Q, R),
    )
    assert kb.entails(SubClassOf(ex.ObjectIntersectionOf((A, ex.ObjectComplementOf(B))), C))
    assert kb.entails(ax.FunctionalObjectProperty(P))
    assert kb.entails(ax.ObjectPropertyDomain(P, B_OR_C))
    assert kb.entails(ax.InverseFunctionalObjectProperty(R))
    assert not kb.entails(ax.FunctionalObjectProperty(R))
    assert not kb.entails(SubClassOf(A, B))
    with pytest.raises(UnsupportedError):
        kb.entails(ax.HasKey(A, (P,), ()))


def test_what_classes_leave_open_is_named_after_later_assertions() -> None:
    short = ex.DatatypeRestriction(XSD + 'string', ((XSD + 'pattern', Literal('[a-b]{1,2}')),))
    tested = SubClassOf(A, ex.DataSomeValuesFrom(P, short))
    kb = reasoned(tested, SubClassOf(A, B_OR_C))
    (named,) = kb.unsupported
    assert named.startswith(axiom_text(tested))
    kb.add(ClassAssertion(D, i))
    assert kb.reason()
    assert kb.unsupported == (named,)


def test_a_rule_that_asks_for_one_of_very_many_values_is_named() -> None:
    many = ex.DatatypeRestriction(
        XSD + 'integer',
        ((XSD + 'minInclusive', whole(0)), (XSD + 'maxInclusive', whole(1000))),
    )
    x, v, w = map(ex.Variable, 'xvw')
    body = (
        ex.DataPropertyAtom(S, x, v),
        ex.BuiltinAtom(SWRLB + 'add', (w, v, whole(5))),
        ex.DataPropertyAtom(T, x, w),
    )
    rule = ax.Rule(body, (ex.ClassAtom(D, x),))
    value = ax.DataPropertyAssertion(T, i, whole(7))
    members = (ClassAssertion(ex.DataSomeValuesFrom(S, many), i), ClassAssertion(B_OR_C, i))
    kb = reasoned(rule, value, *members)
    assert all(text.startswith(axiom_text(rule)) for text in kb.unsupported)
    assert kb.unsupported


def test_a_rule_is_named_once_however_many_unknown_values_it_could_apply_by() -> None:
    x, v, w = map(ex.Variable, 'xvw')
    body = (
        ex.DataPropertyAtom(S, x, v),
        ex.BuiltinAtom(SWRLB + 'add', (w, v, whole(5))),
        ex.DataPropertyAtom(T, x, w),
    )
    kb = reasoned(
        ax.Rule(body, (ex.ClassAtom(D, x),)),
        SubClassOf(A, ex.DataSomeValuesFrom(S, XSD + 'integer')),
        SubClassOf(B, ex.DataMinCardinality(2, S, XSD + 'integer')),
        *(ClassAssertion(cls, one) for cls, one in ((A, i), (B, j))),
        *(ax.DataPropertyAssertion(T, one, whole(7)) for one in (i, j)),
    )
    assert len(kb.unsupported) == 1


def test_what_stops_is_named() -> None:
    numbers = [SubClassOf(A, ex.ObjectMinCardinality(30, P, ex.ObjectUnionOf((A, B))))]
    reasoner = CaseReasoner([*numbers, ClassAssertion(A, i)], most_steps=100)
    assert reasoner.consistent()
    assert reasoner.stopped


def test_too_many_assertions_for_a_search_are_given_up() -> None:
    members = [ClassAssertion(A, f'x:n{n}') for n in range(50)]
    links = [ax.ObjectPropertyAssertion(P, f'x:n{n}', f'x:n{n + 1}') for n in range(50)]
    reasoner = CaseReasoner([*members, *links], most_steps=30)
    assert reasoner.consistent()
    assert reasoner.stopped
    assert list(reasoner.facts(lambda _: False)) == []


def test_a_contradiction_leaves_nothing_out() -> None:
    either = ClassAssertion(B_OR_C, i)
    clash = ClassAssertion(ex.ObjectComplementOf(A), i)
    kb = KnowledgeBase('x:', [either, SubClassOf(A, B_OR_C), ClassAssertion(A, i), clash])
    assert not kb.reason()
    assert kb.unsupported == ()
    kb.remove(clash)
    assert kb.reason()
    assert kb.unsupported == ()


def test_a_value_that_nobody_asks_for_needs_no_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    class Counted(CaseReasoner):
        def __init__(self, axioms: list[Axiom], budget: Budget) -> None:
            asked.append(axioms)
            super().__init__(axioms, budget=budget)

    monkeypatch.setattr('owl_reasoner.reasoner.case_completion.CaseReasoner', Counted)
    value = [SubClassOf(A, ex.ObjectHasValue(P, k)), ax.SubObjectPropertyOf(P, Q)]
    facts = [SubClassOf(B, A), ClassAssertion(B, i), ClassAssertion(C, k)]
    kb = reasoned(*value, *facts)
    assert kb.object_values(Q, i) == {k}
    assert asked == []
    # What is asked for may depend on the individual.
    kb.add(SubClassOf(ex.ObjectSomeValuesFrom(Q, C), D))
    assert kb.reason()
    assert asked != []
    assert kb.superclasses(B) == {A, D}
    kb = reasoned(*value, ax.ObjectPropertyRange(Q, D), ax.DisjointClasses((C, D)), facts[2])
    assert kb.holds(SubClassOf(A, NOTHING))


def test_a_rule_that_computes_with_known_values_needs_no_cases(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr('owl_reasoner.reasoner.case_completion.CaseReasoner', None)
    x, v, w = map(ex.Variable, 'xvw')
    following = (ex.DataPropertyAtom(S, x, v), ex.BuiltinAtom(SWRLB + 'add', (w, v, whole(1))))
    adult = ex.DatatypeRestriction(XSD + 'integer', ((XSD + 'minInclusive', whole(18)),))
    kb = reasoned(
        SubClassOf(A, ex.DataSomeValuesFrom(S, XSD + 'integer')),
        SubClassOf(ex.DataSomeValuesFrom(S, adult), B),
        ax.Rule(following, (ex.DataPropertyAtom(T, x, w),)),
        ClassAssertion(A, i),
        ax.DataPropertyAssertion(S, i, whole(20)),
    )
    assert kb.instances(B) == {i}
    assert kb.data_values(T, i) == {whole(21)}
    assert kb.unsupported == ()


def test_a_join_that_takes_too_long_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    few_steps = partial(CaseReasoner, most_steps=200)
    monkeypatch.setattr('owl_reasoner.reasoner.case_completion.CaseReasoner', few_steps)
    x, y = ex.Variable('x'), ex.Variable('y')
    body = (ex.ClassAtom(A, x), ex.ClassAtom(B, y))
    members = [ClassAssertion(cls, f'x:n{n}') for n in range(20) for cls in (A, B)]
    open_case = ClassAssertion(ex.ObjectUnionOf((C, 'x:other')), i)
    pairs = ax.Rule(body, (ex.ObjectPropertyAtom(P, x, y),))
    kb = KnowledgeBase('x:', [*members, open_case, pairs])
    assert kb.reason()
    assert kb.unsupported[-1] == 'the ontology: reasoning by cases took too many steps'
    assert all(text.endswith(': reasoning by cases took too many steps') for text in kb.unsupported)
    assert kb.object_values(P, 'x:n3') == {f'x:n{n}' for n in range(20)}


def test_classes_are_compared_once_individuals_leave_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    few_steps = partial(CaseReasoner, most_steps=200)
    monkeypatch.setattr('owl_reasoner.reasoner.case_completion.CaseReasoner', few_steps)
    many = ClassAssertion(ex.ObjectMinCardinality(30, P, ex.ObjectUnionOf((A, B))), i)
    kb = reasoned(SubClassOf(A, B_OR_C), SubClassOf(B, D), SubClassOf(C, D), many)
    assert kb.unsupported[-1] == 'the ontology: reasoning by cases took too many steps'
    kb.remove(many)
    assert kb.reason()
    assert kb.superclasses(A) == {D}
    assert kb.unsupported == ()


def test_a_rule_takes_part_in_reasoning_by_cases() -> None:
    x = ex.Variable('x')
    rule = ax.Rule((ex.ClassAtom(D, x),), (ex.ClassAtom(B, x),))
    either = SubClassOf(A, ex.ObjectUnionOf((C, D)))
    kb = reasoned(rule, either, SubClassOf(C, B), ClassAssertion(A, i))
    assert kb.holds(ClassAssertion(B, i))
    assert kb.superclasses(A) == set()  # The rule is about named individuals.
    assert kb.unsupported == ()
    needed = {rule, either, SubClassOf(C, B), ClassAssertion(A, i)}
    assert set(kb.justification(ClassAssertion(B, i))) == needed


def test_justifications_are_minimal() -> None:
    needed = [SubClassOf(A, B_OR_C), SubClassOf(B, D), SubClassOf(C, D), ClassAssertion(A, i)]
    kb = reasoned(*needed, SubClassOf(D, THING), ClassAssertion(B, j), SubClassOf(B, C))
    goal = ClassAssertion(D, i)
    found = kb.justification(goal)
    assert entails(found, goal)
    for axiom in found:
        assert not entails([one for one in found if one != axiom], goal)
    explanation = kb.explain(goal)
    assert explanation is not None
    assert set(explanation.sources()) == set(found)
    assert len(kb.justification(SubClassOf(A, D))) in (2, 3)


def test_what_holds_for_everything_needs_no_axiom_that_names_the_individual() -> None:
    x = ex.Variable('x')
    needed = {
        SubClassOf(ex.ObjectComplementOf(A), A),
        ax.Rule((ex.ClassAtom(A, x),), (ex.ClassAtom(B, x),)),
    }
    kb = reasoned(*needed, differ(i, j))
    assert set(kb.justification(ClassAssertion(B, i))) == needed


def test_a_union_or_enumeration_on_the_left_takes_no_choice() -> None:
    people = [f'x:n{n}' for n in range(300)]
    kinds = ex.ObjectOneOf((i, j, k))
    axioms = [ax.EquivalentClasses((D, ex.ObjectUnionOf((A, B)))), ax.EquivalentClasses((C, kinds))]
    others = [ClassAssertion(THING, name) for name in people]
    reasoner = CaseReasoner([*axioms, *others, ClassAssertion(A, 'x:n7')], most_steps=2_000)
    assert reasoner.consistent()
    assert not reasoner.stopped
    found = set(reasoner.facts(lambda _: False))
    assert {ClassAssertion(D, 'x:n7'), ClassAssertion(C, i)} <= found
    assert ClassAssertion(C, 'x:n7') not in found


def test_class_questions_do_not_search_the_individuals_again() -> None:
    # Each of 60 individuals is a choice; 40 classes are asked for on one model of them.
    choices = [ClassAssertion(ex.ObjectUnionOf((A, B)), f'x:n{n}') for n in range(60)]
    classes = [f'x:K{n}' for n in range(40)]
    axioms: list[Axiom] = [SubClassOf(cls, ex.ObjectHasValue(P, i)) for cls in classes]
    axioms.append(SubClassOf(ex.ObjectSomeValuesFrom(P, C), D))
    reasoner = CaseReasoner([*choices, *axioms, ClassAssertion(C, i)], most_steps=2_000)
    found = set(reasoner.hierarchy(classes, lambda *_: False))
    assert not reasoner.stopped
    assert found == {(cls, D) for cls in classes}
    # What is below something only in every case of the individuals is found all the same.
    axioms += [SubClassOf(A, C), SubClassOf(B, C), ClassAssertion(B_OR_C, i)]
    cases = CaseReasoner([*choices, *axioms])
    assert set(cases.hierarchy(classes, lambda *_: False)) == {(cls, D) for cls in classes}


def test_classes_below_unions_that_meet_again_are_compared_in_few_models() -> None:
    axioms: list[Axiom] = []
    for i in range(40):
        axioms.append(SubClassOf(f'x:A{i}', ex.ObjectUnionOf((f'x:B{i}', f'x:C{i}'))))
        axioms += [SubClassOf(f'x:{kind}{i}', f'x:A{i + 1}') for kind in 'BC']
    kb = KnowledgeBase('x:', axioms)
    assert kb.reason(steps=40_000)  # A model for each pair of classes takes ten times as many.
    assert kb.subclasses('x:A40') == {f'x:{kind}{i}' for kind in 'ABC' for i in range(40)}
    assert kb.superclasses('x:A38') == {'x:A39', 'x:A40'}


def test_individuals_that_only_classes_name_exist() -> None:
    assert not reasoned(SubClassOf(ex.ObjectOneOf((i,)), NOTHING), ClassAssertion(A, j)).consistent
    assert not reasoned(SubClassOf(THING, ex.ObjectComplementOf(ex.ObjectOneOf((i,))))).consistent
    kb = reasoned(SubClassOf(A, ex.ObjectHasValue(P, i)), SubClassOf(ex.ObjectOneOf((i,)), B_OR_C))
    assert kb.consistent


@pytest.mark.parametrize('seed', range(40))
def test_changes_lead_to_what_a_fresh_start_finds(seed: int) -> None:
    drawn = WideOntology(seed)
    kb = KnowledgeBase('x:', drawn.ontology(5, 6))
    kb.reason()
    for _ in range(4):
        if drawn.random.random() < 0.5:
            kb.add(drawn.assertion())
        else:
            kb.remove(drawn.random.choice([a for a in kb.axioms() if isinstance(a, ax.Assertion)]))
        consistent = kb.reason()
        fresh = KnowledgeBase('x:', kb.axioms())
        assert fresh.reason() == consistent
        for name in INDIVIDUALS:
            assert kb.types(name) == fresh.types(name)
        assert {a for a in kb.facts() if isinstance(a, ax.ObjectPropertyAssertion)} == {
            a for a in fresh.facts() if isinstance(a, ax.ObjectPropertyAssertion)
        }


def test_a_number_on_the_left_is_not_lost_where_the_right_side_counts_too() -> None:
    # `d` has an empty range, so everybody has exactly none of it.
    nothing = ex.DataIntersectionOf((XSD + 'integer', XSD + 'string'))
    none = ex.DataExactCardinality(0, T, ex.DataOneOf((whole(1), whole(2))))
    some = ex.ObjectSomeValuesFrom(P, ex.DataHasValue(T, whole(1)))
    assert not reasoned(SubClassOf(none, some), ax.DataPropertyRange(T, nothing)).consistent


@pytest.mark.parametrize(
    'few', [ex.ObjectMaxCardinality(1, P), ex.DataMaxCardinality(1, Q, XSD + 'integer')]
)
def test_more_than_a_union_admits_leaves_the_other_choice(few: ex.ClassExpression) -> None:
    kb = reasoned(
        SubClassOf(A, ex.ObjectUnionOf((B, few))),
        ClassAssertion(A, i),
        *(ax.ObjectPropertyAssertion(P, i, other) for other in (j, k)),
        *(ax.DataPropertyAssertion(Q, i, whole(number)) for number in (1, 2)),
        differ(j, k),
    )
    assert kb.types(i) == {A, B}


def test_what_is_recognised_by_a_count_alone_may_be_a_single_individual() -> None:
    """Nobody has more than the three of two individuals: everybody is one and the same."""
    few = ex.ObjectMaxCardinality(3, P, ex.ObjectOneOf((i, k)))
    everybody_is_i = SubClassOf(few, ex.ObjectOneOf((i,)))
    assert not reasoned(everybody_is_i, differ(j, k)).consistent
    assert reasoned(everybody_is_i, ClassAssertion(A, j)).types(i) == {A}


def test_a_class_of_one_individual_is_empty_where_that_individual_is_no_member() -> None:
    apart = ax.DisjointClasses((A, C))
    kb = reasoned(apart, SubClassOf(A, ex.ObjectOneOf((i,))), ClassAssertion(C, i))
    assert kb.holds(SubClassOf(A, NOTHING))
    kb.remove(ClassAssertion(C, i))
    kb.reason()
    assert not kb.holds(SubClassOf(A, NOTHING))


def test_a_class_is_empty_where_the_individual_it_requires_cannot_be_what_it_must() -> None:
    """Nothing unnamed must exist, so the class alone says no more than that it has the value."""
    outside = ClassAssertion(ex.ObjectComplementOf(C), k)
    kb = reasoned(SubClassOf(A, ex.ObjectHasValue(P, k)), ax.ObjectPropertyRange(P, C), outside)
    assert kb.holds(SubClassOf(A, NOTHING))
    kb.remove(outside)
    kb.reason()
    assert not kb.holds(SubClassOf(A, NOTHING))


def test_classes_that_everybody_is_in_or_out_of_are_decided_for_few() -> None:
    """As the W3C's cases 661 to 664 state complements: by whether there is a value."""
    axioms: list[Axiom] = []
    for n in range(16):
        inside, outside, prop = f'x:in{n}', f'x:out{n}', f'x:has{n}'
        axioms += [
            ax.EquivalentClasses((inside, ex.ObjectMaxCardinality(0, prop))),
            ax.EquivalentClasses((outside, ex.ObjectMinCardinality(1, prop))),
            SubClassOf(f'x:out{n}', ex.ObjectSomeValuesFrom(P, f'x:in{(n + 3) % 16}')),
        ]
    axioms.append(SubClassOf('x:in4', ex.ObjectAllValuesFrom(P, 'x:in5')))
    reasoner = CaseReasoner([*axioms, ClassAssertion('x:in4', i)], 50_000)
    assert reasoner.consistent()
    assert not reasoner.stopped
    both = ex.ObjectIntersectionOf(('x:in4', ex.ObjectSomeValuesFrom(P, 'x:out5')))
    assert not CaseReasoner([*axioms, ClassAssertion(both, i)], 50_000).consistent()


def test_nobody_is_put_off_as_being_like_a_named_individual() -> None:
    """All four would be one of three; each has a choice that those three have made."""
    colours = ex.ObjectOneOf((j, k, m))
    only = ex.ObjectAllValuesFrom(P, A)
    four = ex.ObjectIntersectionOf((ex.ObjectMinCardinality(4, P), C))
    axioms = [ax.EquivalentClasses((A, colours)), ax.EquivalentClasses((C, only))]
    assert not CaseReasoner([*axioms, ClassAssertion(four, i)]).consistent()
    three = ex.ObjectIntersectionOf((ex.ObjectMinCardinality(3, P), C))
    assert CaseReasoner([*axioms, ClassAssertion(three, i)]).consistent()


def test_who_is_made_for_an_individual_is_not_put_off_as_being_like_one_made_for_another() -> None:
    """What excludes the role between the two depends on who that individual is."""
    few = ex.ObjectMaxCardinality(1, Q, ex.ObjectHasValue(P, i))
    kb = reasoned(
        SubClassOf(few, ex.ObjectHasSelf(Q)),
        ax.DisjointObjectProperties((P, ex.ObjectInverseOf(Q))),
        ax.ObjectPropertyAssertion(P, k, i),
        ax.ObjectPropertyAssertion(P, i, i),
    )
    assert not kb.consistent


def test_only_holds_of_whoever_cannot_have_a_value_of_a_functional_property() -> None:
    recognised = SubClassOf(ex.ObjectAllValuesFrom(P, A), C)
    none = ClassAssertion(ex.ObjectMaxCardinality(0, P), i)
    assert reasoned(ax.FunctionalObjectProperty(P), recognised, none).holds(ClassAssertion(C, i))


def test_only_holds_of_whoever_cannot_have_a_value_of_a_functional_data_property() -> None:
    recognised = SubClassOf(ex.DataAllValuesFrom(T, XSD + 'integer'), C)
    none = ClassAssertion(ex.DataMaxCardinality(0, T), i)
    assert reasoned(ax.FunctionalDataProperty(T), recognised, none).holds(ClassAssertion(C, i))


def test_a_number_on_the_left_is_not_lost_where_the_right_side_is_its_opposite() -> None:
    # Whoever has one at most has two, so everybody has two.
    most, least = ex.ObjectMaxCardinality(1, P), ex.ObjectMinCardinality(2, P)
    kb = reasoned(
        SubClassOf(most, least),
        SubClassOf(ex.ObjectSomeValuesFrom(P, THING), C),
        ClassAssertion(A, i),
    )
    assert kb.holds(ClassAssertion(C, i))


@pytest.mark.parametrize(
    'counted', [ex.ObjectMaxCardinality(1, Q), ex.ObjectAllValuesFrom(Q, C)], ids=['max', 'only']
)
def test_members_that_cases_find_are_counted(counted: ex.ClassExpression) -> None:
    none = ex.ObjectMaxCardinality(0, Q)
    kb = reasoned(
        ClassAssertion(ex.ObjectMaxCardinality(1, P, counted), i),
        *(ClassAssertion(none, one) for one in (j, k)),
        *(ax.ObjectPropertyAssertion(P, i, one) for one in (j, k)),
    )
    assert kb.holds(ax.SameIndividual(frozenset((j, k))))


def test_members_that_cases_find_have_keys() -> None:
    kb = reasoned(
        ax.HasKey(ex.ObjectAllValuesFrom(Q, C), (), (T,)),
        *(ClassAssertion(ex.ObjectMaxCardinality(0, Q), one) for one in (j, k)),
        *(ax.DataPropertyAssertion(T, one, whole(1)) for one in (j, k)),
    )
    assert kb.holds(ax.SameIndividual(frozenset((j, k))))


def test_a_value_follows_where_another_property_has_the_others() -> None:
    two = ex.DataOneOf((whole(1), whole(2)))
    kb = reasoned(
        ax.DisjointDataProperties((S, T)),
        ClassAssertion(ex.DataSomeValuesFrom(T, two), i),
        ax.DataPropertyAssertion(S, i, whole(1)),
        ax.DataPropertyAssertion(T, j, whole(2)),
    )
    assert kb.holds(ax.DataPropertyAssertion(T, i, whole(2)))


IDLE = ax.Rule((ex.ClassAtom(D, ex.Variable('x:x')),), (ex.ClassAtom('x:E', ex.Variable('x:x')),))
"""A rule that has nothing to do with the rest."""


def number(*facets: tuple[str, int]) -> ex.DataRange:
    return ex.DatatypeRestriction(
        XSD + 'integer', tuple((XSD + name, whole(bound)) for name, bound in facets)
    )


def test_beside_a_rule_too_every_value_that_must_exist_is_looked_at() -> None:
    some = ex.DataSomeValuesFrom(T, number(('minInclusive', 0), ('maxInclusive', 9)))
    kb = reasoned(
        IDLE,
        SubClassOf(A, some),
        SubClassOf(ex.DataSomeValuesFrom(T, number(('maxExclusive', 5))), B),
        SubClassOf(ex.DataSomeValuesFrom(T, number(('minInclusive', 5))), B),
        ClassAssertion(A, i),
    )
    assert kb.holds(ClassAssertion(B, i))
    assert kb.unsupported == ()


def test_beside_a_rule_too_a_full_count_names_who_must_exist() -> None:
    some = ex.ObjectSomeValuesFrom(Q, A)
    most = SubClassOf(B, ex.ObjectMaxCardinality(2, P, THING))
    full = [
        ax.SubObjectPropertyOf(Q, P),
        *(ax.ObjectPropertyAssertion(P, i, one) for one in (j, k)),
        ax.DifferentIndividuals(frozenset({j, k})),
        ClassAssertion(B, i),
    ]
    kb = reasoned(
        IDLE, most, SubClassOf(B, some), SubClassOf(A, C), ax.DisjointClasses((C, D)), *full
    )
    assert kb.unsupported == ()
    assert not kb.holds(ClassAssertion(A, j))
    kb.add(ClassAssertion(D, k))
    assert kb.reason()
    assert kb.holds(ClassAssertion(A, j))
    assert kb.holds(ax.ObjectPropertyAssertion(Q, i, j))
    kb.remove(ClassAssertion(D, k))
    assert kb.reason()
    assert not kb.holds(ClassAssertion(A, j))


def test_beside_a_rule_too_disjoint_properties_share_no_value() -> None:
    kb = reasoned(
        IDLE,
        ax.DisjointDataProperties((S, T)),
        SubClassOf(A, ex.DataSomeValuesFrom(T, ex.DataOneOf((whole(1), whole(2))))),
        *(ax.DataPropertyAssertion(S, i, whole(one)) for one in (1, 2)),
        ClassAssertion(A, i),
    )
    assert not kb.consistent


def test_rules_do_without_cases_where_a_value_is_left() -> None:
    below = ex.DataSomeValuesFrom(T, number(('maxExclusive', 5)))
    kb = reasoned(
        IDLE,
        SubClassOf(A, ex.DataSomeValuesFrom(T, XSD + 'integer')),
        SubClassOf(below, B),
        ClassAssertion(A, i),
    )
    assert kb.unsupported == ()


def test_as_many_values_as_there_are_all_follow() -> None:
    two = ex.DataOneOf((whole(1), whole(2)))
    kb = reasoned(SubClassOf(A, ex.DataMinCardinality(2, T, two)), ClassAssertion(A, i))
    assert kb.holds(ax.DataPropertyAssertion(T, i, whole(1)))
    assert kb.holds(ax.DataPropertyAssertion(T, i, whole(2)))


def test_the_unnamed_may_be_any_of_those_that_a_named_one_may_have() -> None:
    axioms = (
        ax.DifferentIndividuals(frozenset(('i', 'k'))),
        SubClassOf(THING, ex.ObjectHasValue(ex.ObjectInverseOf('p'), 'k')),
        ClassAssertion(ex.ObjectMaxCardinality(3, 'p', THING), 'k'),
    )
    three = ClassAssertion(ex.ObjectMinCardinality(3, 'q', THING), 'i')
    four = ClassAssertion(ex.ObjectMinCardinality(4, 'q', THING), 'i')
    assert reasoned(*axioms, three).consistent
    assert not reasoned(*axioms, four).consistent


def assert_as_by_cases(seed: int) -> None:
    drawn = PlainOntology(seed)
    rng = drawn.random
    axioms = drawn.ontology(rng.randrange(1, 6), rng.randrange(1, 6))
    kb = reasoned(*axioms)
    if kb.unsupported:
        return
    found = CaseReasoner(axioms)
    assert found.consistent() == kb.consistent
    if not kb.consistent:
        return
    assert list(found.facts(kb.holds)) == []
    for one, other in itertools.permutations((*drawn.classes, NOTHING), 2):
        below = SubClassOf(one, other)
        assert one == NOTHING or kb.holds(below) or not entails(axioms, below)


@pytest.mark.parametrize('seed', [4856, 5751, *range(15)])
def test_nothing_is_missed_without_cases(seed: int) -> None:
    assert_as_by_cases(seed)


@pytest.mark.long
@pytest.mark.timeout(0)
def test_nothing_is_missed_without_cases_for_long() -> None:
    for seed in range(10_000):
        assert_as_by_cases(seed)


@pytest.mark.parametrize(('members', 'all_over'), [((A, B), True), ((A,), False), ((B,), False)])
def test_what_only_both_classes_say_of_a_chain_holds_for_members_of_both(
    members: tuple[str, ...], all_over: bool
) -> None:
    kb = reasoned(
        SubClassOf(ex.ObjectIntersectionOf((A, B)), ex.ObjectAllValuesFrom(P, D)),
        ax.TransitiveObjectProperty(P),
        ax.ObjectPropertyAssertion(P, i, j),
        ax.ObjectPropertyAssertion(P, j, k),
        *(ClassAssertion(cls, i) for cls in members),
        # What k is takes cases: F is disjoint with D.
        SubClassOf(C, ex.ObjectUnionOf(('x:E', 'x:F'))),
        ax.DisjointClasses(('x:F', D)),
        ClassAssertion(C, k),
    )
    assert kb.types(k) == ({C, D, 'x:E'} if all_over else {C})


def test_rules_that_forbid_every_value_contradict_a_value_that_must_exist() -> None:
    def forbidden(comparison: str) -> Axiom:
        x, v = ex.Variable('x:x'), ex.Variable('x:v')
        compared = ex.BuiltinAtom(SWRLB + comparison, (v, whole(5)))
        return ax.Rule((ex.DataPropertyAtom(T, x, v), compared), ())

    some = SubClassOf(A, ex.DataSomeValuesFrom(T, number(('minInclusive', 3), ('maxInclusive', 6))))
    below, above = forbidden('lessThan'), forbidden('greaterThanOrEqual')
    assert not reasoned(some, ClassAssertion(A, i), below, above).consistent
    recognised = SubClassOf(ex.DataSomeValuesFrom(T, number(('minInclusive', 5))), B)
    kb = reasoned(some, ClassAssertion(A, i), below, recognised)
    assert kb.consistent
    assert kb.types(i) == {A, B}
    kb = reasoned(some, ClassAssertion(A, i), recognised)
    assert kb.types(i) == {A}


def test_a_value_that_classes_forbid_leaves_the_other() -> None:
    def without(cls: str, value: int) -> Axiom:
        one = ex.DataSomeValuesFrom(T, ex.DataOneOf((whole(value),)))
        return SubClassOf(ex.ObjectIntersectionOf((cls, one)), NOTHING)

    two = ex.DataOneOf((whole(1), whole(2)))
    kb = reasoned(
        SubClassOf(A, ex.DataSomeValuesFrom(T, two)),
        without(B, 1),
        without(C, 2),
        ClassAssertion(A, i),
        ClassAssertion(B, i),
    )
    assert kb.holds(ax.DataPropertyAssertion(T, i, whole(2)))
    assert not kb.holds(ax.DataPropertyAssertion(T, i, whole(1)))
    kb.add(ClassAssertion(C, i))
    assert not kb.reason()


def test_a_rule_by_an_unknown_value_says_something_of_somebody_else() -> None:
    x, y, v = map(ex.Variable, 'xyv')
    large = (ex.DataPropertyAtom(S, x, v), ex.BuiltinAtom(SWRLB + 'greaterThan', (v, whole(3))))
    kb = reasoned(
        ax.Rule((*large, ex.ObjectPropertyAtom(P, x, y)), (ex.ClassAtom(B, y),)),
        SubClassOf(A, ex.DataSomeValuesFrom(S, ex.DataOneOf((whole(4), whole(5))))),
        *(ClassAssertion(cls, i) for cls in (A, B)),
        ax.ObjectPropertyAssertion(P, i, j),
    )
    assert kb.types(j) == {B}


def test_what_cases_said_of_classes_goes_when_there_is_too_much_for_cases(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    outside = ClassAssertion(D, k)
    range_of_p = (ax.ObjectPropertyRange(P, C), ax.DisjointClasses((C, D)))
    kb = reasoned(SubClassOf(A, ex.ObjectHasValue(P, k)), *range_of_p, outside)
    assert kb.holds(SubClassOf(A, NOTHING))
    monkeypatch.setattr('owl_reasoner.reasoner.case_completion._MOST_ASSERTIONS', 3)
    kb.change([ClassAssertion(B, one) for one in (i, j, k, m)], [outside])
    assert kb.reason()
    assert not kb.holds(SubClassOf(A, NOTHING))
    assert kb.unsupported == ('the assertions: too many for reasoning by cases',)


def test_each_part_of_a_union_is_below_the_whole_where_it_is_a_case() -> None:
    kb = reasoned(
        SubClassOf(A, ex.ObjectSomeValuesFrom(P, B_OR_C)),
        ax.DisjointUnion(D, (B, C)),
        SubClassOf(ex.ObjectSomeValuesFrom(P, D), 'x:E'),
    )
    assert kb.superclasses(A) == {'x:E'}
