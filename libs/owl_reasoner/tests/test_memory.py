"""The garbage collector leaves large ontologies alone until they are dropped."""

from __future__ import annotations

import gc
import threading
import weakref

import pytest

from owl_reasoner import memory


@pytest.fixture(autouse=True)
def nothing_else_is_released() -> None:
    """Wait for what other tests dropped: it is released some time later, and unfreezes all."""
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer):
            thread.cancel()
            thread.join(60.0)


class Ring:
    """An object in a cycle, as axioms and rules are."""

    def __init__(self) -> None:
        self.itself = self


def test_the_collector_is_off_inside_and_as_before_outside() -> None:
    assert gc.isenabled()
    with memory.uncollected():
        assert not gc.isenabled()
        with memory.uncollected():
            pass
        assert not gc.isenabled(), 'the outer one is not over'
    assert gc.isenabled()


def test_the_collector_stays_off_until_the_last_thread_is_done() -> None:
    entered, done = threading.Event(), threading.Event()

    def first() -> None:
        with memory.uncollected():
            entered.set()
            done.wait(30.0)

    thread = threading.Thread(target=first)
    thread.start()
    assert entered.wait(30.0)
    with memory.uncollected():
        done.set()
        thread.join(30.0)
        assert not gc.isenabled()
    assert gc.isenabled()


def test_whoever_waits_for_a_disk_leaves_the_collector_on() -> None:
    with memory.collected():
        assert gc.isenabled()
    with memory.uncollected(), memory.uncollected():
        with memory.collected():
            assert gc.isenabled()
        assert not gc.isenabled()
    assert gc.isenabled()


def test_what_was_made_and_dropped_meanwhile_is_looked_at_soon() -> None:
    with memory.uncollected():
        rings = [Ring() for _ in range(memory.LARGE + 1)]
        gone = weakref.ref(rings[0])
        del rings
    gc.collect(1)
    assert gone() is None, 'it waits for a collection of everything, which may not come'


def test_what_settled_is_looked_at_again_when_something_was_dropped() -> None:
    ring = Ring()
    gone = weakref.ref(ring)
    memory.settle(memory.LARGE + 1)
    del ring
    gc.collect()
    assert gone() is not None, 'the collector does not look at it'
    memory.release([], others=True)
    assert gone() is not None, 'a collection would look through the others'
    memory.release([], others=False)
    assert gone() is None
    gc.unfreeze()


def test_small_ontologies_stay_with_the_collector() -> None:
    before = gc.get_freeze_count()
    memory.settle(10)
    assert gc.get_freeze_count() == before


def test_a_small_ontology_that_is_dropped_leaves_alone_what_others_keep_from_the_collector() -> (
    None
):
    ring = Ring()
    gone = weakref.ref(ring)
    gc.freeze()
    del ring
    memory.settle(10)
    memory.release([], others=False)
    gc.collect()
    assert gone() is not None
    gc.unfreeze()
