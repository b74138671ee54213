"""The references that are loaded, found and locked by name; threads may share it."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterable, Iterator

from surveillance_ontology.armor.protocol import DirectiveError
from surveillance_ontology.armor.reference import Reference
from surveillance_ontology.armor.rendering import shown


class Registry:
    """References by name."""

    def __init__(self) -> None:
        self._references: dict[str, Reference] = {}
        self._lock = threading.Lock()

    def __contains__(self, name: object) -> bool:
        return name in self._references

    def names(self) -> list[str]:
        """All names, sorted."""
        return sorted(self._references)

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
            loaded = ', '.join(map(shown, self.names()[:10])) or 'none'
            raise DirectiveError(f'unknown reference {shown(name)}; loaded: {loaded}')
        return ref

    @contextlib.contextmanager
    def locked(self, name: str) -> Iterator[Reference]:
        """Hold a reference's lock.

        Raises:
            DirectiveError: 205, there is no such reference.
        """
        while True:
            ref = self.find(name)
            with ref.lock:
                if not ref.dropped:
                    yield ref
                    return

    @contextlib.contextmanager
    def held(self, names: Iterable[str]) -> Iterator[list[Reference]]:
        """Hold the locks of those references that there are, in an order that excludes deadlock."""
        with contextlib.ExitStack() as locks:
            found = [ref for name in sorted(names) if (ref := self._references.get(name))]
            for ref in found:
                locks.enter_context(ref.lock)
            yield found

    def add(self, ref: Reference) -> None:
        """Enter a reference under its name."""
        with self._lock:
            self._references[ref.name] = ref

    def remove(self, ref: Reference) -> None:
        """Take a reference out; whoever holds it sees that it is dropped."""
        ref.dropped = True
        with self._lock:
            self._references.pop(ref.name, None)
