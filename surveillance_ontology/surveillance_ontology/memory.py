"""Large ontologies and the garbage collector, which stops all threads while it looks at objects.

100,000 axioms and what follows from them are a million objects, which live until the ontology is
dropped. A full collection looks through all of them, 0.2 s for which no client is answered.
"""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Iterator
from contextlib import contextmanager, suppress

LARGE = 10_000
"""Axioms from which on an ontology is kept out of the collector's way."""


@contextmanager
def uncollected() -> Iterator[None]:
    """Switch the garbage collector off for a while, where it is on."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def settle(axioms: int) -> None:
    """Have the collector look no more at an ontology of so many axioms; call it `uncollected`."""
    if axioms > LARGE:
        gc.freeze()


def release() -> None:
    """Give the memory of what was dropped back to the system."""
    gc.unfreeze()
    gc.collect()  # Axioms and rules refer to each other in cycles.
    gc.freeze()
    with suppress(OSError, AttributeError):  # Not glibc: it decides itself.
        ctypes.CDLL('libc.so.6').malloc_trim(0)
