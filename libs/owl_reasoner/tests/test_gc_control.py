"""The garbage collector leaves large ontologies alone until they are dropped."""

from __future__ import annotations

import gc
import threading
import weakref

import pytest

from owl_reasoner import gc_control


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
    with gc_control.uncollected():
        assert not gc.isenabled()
        with gc_control.uncollected():
            pass
        assert not gc.isenabled(), 'the outer one is not over'
    assert gc.isenabled()


def test_the_collector_stays_off_until_the_last_thread_is_done() -> None:
    entered, done = threading.Event(), threading.Event()

    def first() -> None:
        with gc_control.uncollected():
            entered.set()
            done.wait(30.0)

    thread = threading.Thread(target=first)
    thread.start()
    assert entered.wait(30.0)
    with gc_control.uncollected():
        done.set()
        thread.join(30.0)
        assert not gc.isenabled()
    assert gc.isenabled()


def test_whoever_waits_for_a_disk_leaves_the_collector_on() -> None:
    with gc_control.collected():
        assert gc.isenabled()
    with gc_control.uncollected(), gc_control.uncollected():
        with gc_control.collected():
            assert gc.isenabled()
        assert not gc.isenabled()
    assert gc.isenabled()


def test_what_was_made_and_dropped_meanwhile_is_looked_at_soon() -> None:
    with gc_control.uncollected():
        rings = [Ring() for _ in range(gc_control.LARGE + 1)]
        gone = weakref.ref(rings[0])
        del rings
    gc.collect(1)
    assert gone() is None, 'it waits for a collection of everything, which may not come'


def test_what_settled_is_looked_at_again_when_something_was_dropped() -> None:
    ring = Ring()
    gone = weakref.ref(ring)
    gc_control.settle(gc_control.LARGE + 1)
    del ring
    gc.collect()
    assert gone() is not None, 'the collector does not look at it'
    gc_control.release([], others=True)
    assert gone() is not None, 'a collection would look through the others'
    gc_control.release([], others=False)
    assert gone() is None
    gc.unfreeze()


def test_small_ontologies_stay_with_the_collector() -> None:
    before = gc.get_freeze_count()
    gc_control.settle(10)
    assert gc.get_freeze_count() == before


def test_a_small_ontology_that_is_dropped_leaves_alone_what_others_keep_from_the_collector() -> (
    None
):
    ring = Ring()
    gone = weakref.ref(ring)
    gc.freeze()
    del ring
    gc_control.settle(10)
    gc_control.release([], others=False)
    gc.collect()
    assert gone() is not None
    gc.unfreeze()
