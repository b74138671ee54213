"""The references of a service by name, and their locks."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterable, Iterator

from armor_service.protocol import DirectiveError
from armor_service.reference import Reference
from armor_service.rendering import shown

UNUSED_WITHIN = 1.0
"""Seconds for which `Registry.held_briefly` waits for a reference while it holds none."""
AT_ONCE = 0.05
"""Seconds for which it waits for one while it holds others."""


class Registry:
    """References by name; threads may share it."""

    def __init__(self) -> None:
        self._references: dict[str, Reference] = {}

    def __contains__(self, name: object) -> bool:
        return name in self._references

    def names(self) -> list[str]:
        """Return all names, sorted."""
        return sorted(self._references)

    def hold_more_than(self, axioms: int) -> bool:
        """Tell whether one of the references has more axioms."""
        return any(len(ref.kb) > axioms for ref in list(self._references.values()))

    def get(self, name: str) -> Reference | None:
        """Find a reference, None when there is none of the name."""
        return self._references.get(name)

    def find(self, name: str) -> Reference:
        """Find a reference.

        Raises:
            DirectiveError: 205, naming those there are.
        """
        ref = self._references.get(name)
        if ref is None:
            raise self._unknown(name)
        return ref

    def _unknown(self, name: str) -> DirectiveError:
        loaded = ', '.join(map(shown, self.names()[:10])) or 'none'
        return DirectiveError(f'unknown reference {shown(name)}; loaded: {loaded}')

    @contextlib.contextmanager
    def locked_if_there(self, name: str) -> Iterator[Reference | None]:
        """Hold a reference's lock; None when there is no such reference."""
        while (ref := self._references.get(name)) is not None:
            with ref.lock:
                if not ref.dropped:
                    yield ref
                    return
        yield None

    @contextlib.contextmanager
    def locked(self, name: str) -> Iterator[Reference]:
        """Hold a reference's lock.

        Raises:
            DirectiveError: 205, there is no such reference.
        """
        with self.locked_if_there(name) as ref:
            if ref is None:
                raise self._unknown(name)
            ref.open()
            yield ref

    @contextlib.contextmanager
    def held(self, names: Iterable[str]) -> Iterator[list[Reference]]:
        """Hold the locks of those references that there are, in an order that excludes deadlock."""
        with contextlib.ExitStack() as locks:
            found = [ref for name in sorted(names) if (ref := self._references.get(name))]
            for ref in found:
                locks.enter_context(ref.lock)
            yield found

    @contextlib.contextmanager
    def held_briefly(self) -> Iterator[list[Reference]]:
        """Hold the locks of all references, of none where somebody has one of them for long.

        Whoever uses another reference does not wait for that one as well.
        """
        found = [ref for name in self.names() if (ref := self._references.get(name))]
        with contextlib.ExitStack() as locks:
            free = all(_becomes_free(ref.lock) for ref in found)
            yield found if free and all(_taken(ref.lock, locks) for ref in found) else []

    def add(self, ref: Reference) -> None:
        """Enter a reference under its name."""
        self._references[ref.name] = ref

    def remove(self, ref: Reference) -> None:
        """Take a reference out; whoever holds it sees that it is dropped."""
        ref.dropped = True
        self._references.pop(ref.name, None)


def _becomes_free(lock: threading.RLock) -> bool:
    if free := lock.acquire(timeout=UNUSED_WITHIN):
        lock.release()
    return free


def _taken(lock: threading.RLock, locks: contextlib.ExitStack) -> bool:
    if taken := lock.acquire(timeout=AT_ONCE):
        locks.callback(lock.release)
    return taken
