"""Sets of facts that follow the server's messages, against facts that are kept one by one."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armor_service.facts import FactChange, FactSet, ShortFact, parse_fact, parse_names, short_name

NAMES = st.sampled_from(
    ['R1', 'R2', 'A,B', '?x', 'C(1)', '"5"^^xsd:long', '"a, \\"b\\""^^xsd:string']
)
PREDICATES = st.sampled_from(['URGENT', 'isIn', 'A B', 'P(1)'])
FACTS = st.builds(ShortFact, PREDICATES, st.lists(NAMES, min_size=1, max_size=2).map(tuple))


@given(FACTS)
def test_a_fact_is_read_as_it_is_shown(fact: ShortFact) -> None:
    assert parse_fact(str(fact)) == fact
    assert parse_fact(f'  {fact} ') == fact
    assert fact.matches(fact)
    assert ShortFact('?', ('?',) * len(fact.arguments)).matches(fact)
    assert not ShortFact(fact.predicate, ('?',) * (len(fact.arguments) + 1)).matches(fact)
    assert not ShortFact(fact.predicate + 'x', fact.arguments).matches(fact)


@pytest.mark.parametrize(
    'text',
    ['p(<a>!b)', 'p(<a>xb)', 'p(a b)', 'p(a\tb)', 'p(a,b,)', 'p(a,b c)', 'p(a-,)', 'p(a', 'p a)'],
)
def test_only_a_comma_parts_two_arguments(text: str) -> None:
    with pytest.raises(ValueError, match='expected CLASS'):
        parse_fact(text)


def test_names_are_left_as_they_are_written_or_made_short() -> None:
    assert parse_names('<x:y#p>(<x:y#a>, "1"^^<x:y#t>)') == ShortFact(
        '<x:y#p>', ('<x:y#a>', '"1"^^<x:y#t>')
    )
    assert short_name('<http://x.org/y#a>') == 'a'
    assert short_name('http://x.org/y#a') == 'a'
    assert short_name('"http://x.org/y#a"^^xsd:string') == '"http://x.org/y#a"^^xsd:string'
    assert short_name('owl:sameAs') == 'owl:sameAs'
    assert short_name('<a') == '<a'
    with pytest.raises(ValueError, match=r"^'x{80}': expected CLASS"):
        parse_fact('x' * 90)


R1, R2 = ShortFact('URGENT', ('R1',)), ShortFact('URGENT', ('R2',))
CHANGES = st.lists(
    st.tuples(
        st.sampled_from([R1, R2, ShortFact('isIn', ('R1', 'R2'))]), st.booleans(), st.booleans()
    ),
    max_size=5,
)


@settings(max_examples=100)
@given(st.lists(CHANGES, max_size=4), st.sampled_from(['URGENT(?)', 'URGENT(R1)', '?(?, ?)']))
def test_a_fact_holds_until_it_is_neither_asserted_nor_derived(
    messages: list[list[FactChange]], pattern: str
) -> None:
    followed = FactSet(pattern)
    asserted, derived = {R1}, {R1, R2}
    matching = {fact for fact in (R1, R2) if parse_fact(pattern).matches(fact)}
    assert followed.follow(7, [(R2, True, False)]) is None
    assert dict(followed.replace(matching, matching & asserted)) == dict.fromkeys(matching, True)
    # What is asserted is not known to be derived as well.
    derived -= asserted
    for number, changes in enumerate(messages):
        before = asserted | derived
        for fact, came, is_derived in changes:
            kept = derived if is_derived else asserted
            (kept.add if came else kept.discard)(fact)
        told = followed.follow(8 + number, changes)
        after = asserted | derived
        wanted = parse_fact(pattern)
        assert told is not None
        assert len(told) == len(dict(told))
        assert dict(told) == {
            fact: fact in after for fact in before ^ after if wanted.matches(fact)
        }
        assert followed.facts == {fact for fact in after if wanted.matches(fact)}


def test_a_message_that_was_missed_is_noticed_and_made_up_for() -> None:
    followed = FactSet('URGENT(?)')
    assert followed.facts == frozenset()
    assert followed.concerns([(parse_fact('ROOM(R1)'), True, True), (R1, False, True)])
    assert not followed.concerns([(parse_fact('ROOM(R1)'), True, True)])
    # The first one tells where the count is.
    assert followed.follow(3, [(R1, True, True)]) is None
    assert followed.replace([], []) == []
    assert followed.follow(4, [(R1, True, True)]) == [(R1, True)]
    for missed in (6, 6, 5):
        assert followed.follow(missed, [(R2, True, True)]) is None
    assert followed.replace([R2], [R2]) == [(R1, False), (R2, True)]
    assert followed.follow(6, [(R2, False, True)]) == []
    assert followed.follow(7, [(R2, False, False)]) == [(R2, False)]
    assert followed.replace([R2, R1], []) == [(R1, True), (R2, True)]
    assert followed.replace([], []) == [(R1, False), (R2, False)]


def test_another_server_may_count_on_by_chance() -> None:
    followed = FactSet('URGENT(?)')
    assert followed.follow(3, []) is None
    assert followed.replace([R1], [R1]) == [(R1, True)]
    followed.forget_sequence()
    assert followed.follow(4, []) is None
    assert followed.follow(5, [(R1, False, False)]) == [(R1, False)]
