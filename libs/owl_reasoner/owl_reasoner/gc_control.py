"""Large ontologies and the garbage collector, which stops all threads while it looks at objects.

100,000 axioms and what follows from them are a million objects, which live until the ontology is
dropped. A full collection looks through all of them, 0.2 s for which no client is answered.
"""

from __future__ import annotations

import ctypes
import gc
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

LARGE = 10_000
"""Axioms from which on an ontology is kept out of the collector's way."""
PAUSE = 0.0002
"""Seconds for other threads between two parts of an ontology that is given up."""

_lock = threading.Lock()
_inside = 0
_was_on = False
_settled = False
_thread = threading.local()


@contextmanager
def uncollected() -> Iterator[None]:
    """Switch the garbage collector off, where it is on, until the last thread inside is done."""
    with _thread_inside(True):
        yield


@contextmanager
def collected() -> Iterator[None]:
    """Take this thread out of `uncollected` while it waits for a disk, which may never answer."""
    with _thread_inside(False):
        yield


@contextmanager
def _thread_inside(inside: bool) -> Iterator[None]:
    before = getattr(_thread, 'inside', False)
    _switch(inside)
    try:
        yield
    finally:
        _switch(before)


def _switch(inside: bool) -> None:
    """Count this thread among those inside, or no more."""
    global _inside, _was_on
    with _lock:
        if not _inside:
            _was_on = gc.isenabled()
        _inside += inside - getattr(_thread, 'inside', False)
        _thread.inside = inside
        if _inside:
            gc.disable()
        elif _was_on:
            gc.enable()


def settle(axioms: int) -> None:
    """Have the collector look no more at an ontology of so many axioms; call it `uncollected`."""
    global _settled
    if axioms > LARGE:
        _settled = True
        gc.freeze()


def release(parts: Iterable[None], others: bool) -> None:
    """Give the memory of an ontology back to the system; other threads go on meanwhile.

    Args:
        parts: Lets go of a part of the ontology with each step.
        others: There are other large ontologies, which a collection would look through: what is
            left, a few objects that refer to each other in cycles, waits until they are dropped.
    """
    global _settled
    for _ in parts:
        time.sleep(PAUSE)
    # Of small ones the collector finds what is left when it looks by itself, and what others keep
    # out of its way stays there.
    if _settled and not others:
        _settled = False
        gc.unfreeze()
        gc.collect()
    with suppress(OSError, AttributeError):  # Not glibc: it decides itself.
        ctypes.CDLL('libc.so.6').malloc_trim(0)
