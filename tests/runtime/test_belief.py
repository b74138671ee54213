"""Which publisher of a state topic a reader believes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from surveillance_runtime.belief import LONGEST, PATIENCE, UNKNOWN, Belief


def yes() -> bool:
    return True


def no() -> bool:
    return False


def test_the_first_publisher_is_believed_at_once() -> None:
    belief = Belief()
    assert belief.hear(b'a', 7, 0.0, yes)
    assert belief.hear(b'b', 8, 0.1, yes)
    assert belief.value == b'b'


@pytest.mark.parametrize('number', [1, 40, 5000])
def test_a_foreign_message_is_dropped_when_the_owner_answers(number: int) -> None:
    belief = Belief()
    belief.hear(b'owner', 57, 0.0, no)
    assert not belief.hear(b'foreign', number, 0.5, no)
    assert belief.hear(b'owner', 58, 0.51, no)
    assert not belief.settle(10.0)
    assert belief.value == b'owner'


def test_an_owner_that_was_started_again_is_believed_soon() -> None:
    belief = Belief()
    belief.hear(b'before', 57, 0.0, yes)
    assert not belief.hear(b'after', 1, 4.0, yes)
    assert belief.due == 4.0 + PATIENCE
    assert belief.settle(4.0 + PATIENCE)
    assert belief.value == b'after'
    assert belief.hear(b'later', 2, 5.0, yes)


def test_messages_that_got_lost_are_no_other_publisher() -> None:
    belief = Belief()
    belief.hear(b'a', 1, 0.0, yes)
    assert belief.hear(b'b', 4000, 0.1, yes)


def test_a_middleware_that_numbers_nothing_is_believed_while_there_is_one_publisher() -> None:
    belief = Belief()
    belief.hear(b'a', UNKNOWN, 0.0, yes)
    assert belief.hear(b'b', UNKNOWN, 0.1, yes)
    assert not belief.hear(b'c', UNKNOWN, 0.2, no)


@given(
    st.lists(
        st.tuples(st.floats(0.0, 3.0), st.integers(1, 400), st.booleans()), min_size=1, max_size=30
    ),
    st.integers(1, 300),
)
def test_the_owners_word_wins_within_two_seconds(
    foreign: list[tuple[float, int, bool]], count: int
) -> None:
    """Whatever others publish: an owner that answers each and repeats itself is believed."""
    belief, now = Belief(), 0.0
    belief.hear(b'owner', count, now, no)
    for gap, number, alone in foreign:
        # The owner's repetitions until then.
        for step in range(int(gap)):
            count += 1
            belief.settle(now + step + 1)
            belief.hear(b'owner', count, now + step + 1, no)
        now += gap
        belief.settle(now)
        belief.hear(b'foreign', number, now, yes if alone else no)
        count += 1
        belief.settle(now)
        belief.hear(b'owner', count, now, no)
    end = now + LONGEST
    while now < end:
        now += 0.5
        belief.settle(now)
        count += 1
        belief.hear(b'owner', count, now, no)
    belief.settle(now)
    assert belief.value == b'owner'
