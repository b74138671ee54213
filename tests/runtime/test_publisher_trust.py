"""Which publisher of a topic a reader believes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from surveillance_runtime.publisher_trust import PATIENCE, SILENT, PublisherTrust

OWNER, OTHER, AGAIN = b'1', b'2', b'3'


class World:
    """A graph, and a reader that looks when it is to."""

    def __init__(self, owner: str = '', only: bool = False) -> None:
        self.nodes: dict[bytes, str] = {}
        self.now = 0.0
        self.trust = PublisherTrust(lambda: self.nodes, owner, only)

    def wait(self, seconds: float) -> None:
        end = self.now + seconds
        while self.trust.due is not None and self.trust.due <= end:
            self.now = self.trust.due
            self.trust.settle(self.now)
        self.now = end

    def say(self, publisher: bytes, value: bytes) -> bytes | None:
        self.trust.hear(value, publisher, self.now)
        return self.trust.value


def test_the_first_publisher_is_believed_as_long_as_it_is_there() -> None:
    world = World()
    world.nodes = {OWNER: '/map_server', OTHER: '/stranger'}
    assert world.say(OWNER, b'a') == b'a'
    assert world.say(OTHER, b'x') == b'a'
    world.wait(60.0)
    assert world.trust.value == b'a'
    assert world.trust.rivals == ('/stranger',)
    assert world.say(OWNER, b'b') == b'b'
    del world.nodes[OWNER]
    world.wait(2 * PATIENCE)
    assert world.trust.value == b'x'
    assert world.trust.rivals == ()


def test_a_message_goes_with_its_sender() -> None:
    world = World()
    world.nodes = {OWNER: '/map_server', OTHER: '/stranger'}
    world.say(OWNER, b'a')
    world.say(OTHER, b'x')
    del world.nodes[OTHER]
    world.wait(1.0)
    del world.nodes[OWNER]
    world.wait(60.0)
    assert world.trust.value == b'a'


def test_an_owner_that_was_killed_and_started_again_is_believed() -> None:
    """The graph still has the dead one."""
    world = World()
    world.nodes = {OWNER: '/battery', AGAIN: '/battery', OTHER: '/stranger'}
    world.say(OWNER, b'a')
    world.say(AGAIN, b'b')
    world.say(OTHER, b'x')
    world.wait(SILENT / 2)
    assert world.trust.value == b'a'
    world.wait(SILENT)
    assert world.trust.value == b'b'


def test_a_namesake_is_not_believed_while_the_owner_speaks() -> None:
    world = World()
    world.nodes = {OWNER: '/battery', AGAIN: '/battery'}
    world.say(OWNER, b'a')
    for _ in range(20):
        world.say(AGAIN, b'x')
        world.wait(1.0)
        assert world.say(OWNER, b'a') == b'a'


def test_the_owner_by_name_is_believed_whoever_spoke_first() -> None:
    world = World('/battery')
    world.nodes = {OTHER: '/stranger'}
    assert world.say(OTHER, b'x') == b'x'
    world.nodes[OWNER] = '/battery'
    world.say(OWNER, b'a')
    world.wait(2 * PATIENCE)
    assert world.trust.value == b'a'
    world.say(OTHER, b'y')
    world.wait(2 * PATIENCE)
    assert world.trust.value == b'a'


@pytest.mark.parametrize('leaves', [False, True])
def test_where_only_the_owner_may_speak_nobody_else_is_believed(leaves: bool) -> None:
    world = World('/monitor', only=True)
    world.nodes = {OTHER: '/stranger'}
    assert world.say(OTHER, b'x') is None
    if leaves:
        world.nodes = {}
    world.wait(5.0)
    assert world.trust.value is None
    world.nodes[OWNER] = '/monitor'
    assert world.say(OWNER, b'a') == b'a'


def test_one_of_whom_the_graph_knows_nothing_yet_waits_for_a_moment() -> None:
    world = World('/battery')
    assert world.say(OWNER, b'a') is None
    world.nodes = {OWNER: '/battery'}
    world.wait(2 * PATIENCE)
    assert world.trust.value == b'a'


@given(
    st.lists(
        st.tuples(st.floats(0.0, 3.0), st.sampled_from([OTHER, AGAIN, b'4', b'']), st.booleans()),
        min_size=1,
        max_size=30,
    ),
    st.booleans(),
)
def test_the_owners_word_wins_whatever_others_say(
    foreign: list[tuple[float, bytes, bool]], named: bool
) -> None:
    """Also one that repeats nothing, as map_server."""
    world = World('/owner' if named else '')
    world.nodes = {OWNER: '/owner'}
    world.say(OWNER, b'owner')
    for gap, publisher, leaves in foreign:
        world.wait(gap)
        world.nodes[publisher] = '/stranger'
        assert world.say(publisher, b'foreign') == b'owner'
        if leaves:
            del world.nodes[publisher]
    world.wait(10.0)
    assert world.trust.value == b'owner'
