"""Loaded ontologies under their reference names: buffers, who is mounted, locks."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from armor_service.changes import (
    Change,
    RemoveAxiom,
    RemoveEntity,
    RenameEntity,
    apply_all,
)
from armor_service.protocol import DirectiveError
from armor_service.rendering import render_entity, shown
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.java_reasoning import JavaKnowledgeBase

LONG_BACKLOG = 500
"""Changes since the last reasoning from which on the next counts as slow."""
UNUSED_WITHIN = 1.0
"""Seconds for which `Registry.held_briefly` waits for a reference while it holds none."""
AT_ONCE = 0.05
"""Seconds for which it waits for one while it holds others."""
SLOW = 0.01
"""Seconds of processor time of the last reasoning from which on the next counts as slow."""
PATIENCE = 5.0
"""Seconds for making an explanation short; nobody else can use the ontology meanwhile."""
NOBODY = 'none'
"""How ARMOR says that no client is mounted; a client of this name counts as none."""


NATIVE = ('', 'PELLET', 'NATIVE')
"""Names of the reasoner of this package; PELLET is what ARMOR's clients send."""
JAVA = {'HERMIT': 'hermit', 'OPENLLET': 'pellet', 'PELLET_JAVA': 'pellet'}
"""Names of the Java reasoners, see `java_reasoning`."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where an ontology came from.

    Attributes:
        path: File or URL that was loaded; the target of SAVE without a path. Empty: none.
        format: Format of that file, in which SAVE writes.
        prefixes: Namespace prefixes of that file, which SAVE uses.
        reasoner: The Java reasoner that was asked for, empty for the native one.
    """

    path: str
    format: str
    prefixes: Mapping[str, str] = field(default_factory=dict)
    reasoner: str = ''

    @property
    def file(self) -> Path | None:
        """The file that SAVE without a path writes to, None when it came from the web."""
        return Path(self.path) if self.path and '://' not in self.path else None


def knowledge_base(base: str, axioms: Iterable[Axiom], reasoner: str) -> KnowledgeBase:
    """Make a knowledge base with the reasoner of a name; the native one for unknown names."""
    kind = JAVA.get(reasoner.upper())
    kb = JavaKnowledgeBase(base, axioms, kind) if kind else KnowledgeBase(base, axioms)
    kb.patience = PATIENCE
    return kb


@dataclass(slots=True)
class Reference:
    """One ontology that directives name.

    Whoever reads or changes it holds `lock`. Changes go in through `submit`, `flush` and `reason`.

    Attributes:
        name: Reference name.
        kb: Axioms and derived facts; ``kb.iri`` is what local names are completed with.
        origin: Where it was loaded from.
        buffered_manipulation: Changes wait in `queue` until `flush`.
        buffered_reasoner: Derived facts follow at `reason` only, not after each change.
        mounted: The client that may change it, `NOBODY` for all.
        queue: Changes that wait.
        backlog: Changes since the last reasoning, queued ones included; a measure of its cost.
        heavy: Classes or properties changed since the last reasoning; the next takes longer.
        took: Seconds of processor time of the last reasoning that had something to do.
        revision: Counts what may have changed an answer, so that copies know when they are old.
        dropped: The name does not stand for it any more.
    """

    name: str
    kb: KnowledgeBase
    origin: Origin
    buffered_manipulation: bool = False
    buffered_reasoner: bool = False
    mounted: str = NOBODY
    queue: list[Change] = field(default_factory=list)
    backlog: int = 0
    heavy: bool = False
    took: float = 0.0
    revision: int = 0
    dropped: bool = False
    lock: threading.RLock = field(default_factory=threading.RLock)

    @contextlib.contextmanager
    def held(self) -> Iterator[KnowledgeBase]:
        """Hold the lock.

        Raises:
            DirectiveError: 205, the name does not stand for it any more.
        """
        with self.lock:
            if self.dropped:
                raise DirectiveError(f'{shown(self.name)} was dropped meanwhile')
            yield self.kb

    def submit(self, changes: list[Change]) -> None:
        """Take changes in, at once or into the queue, as the reference is set up."""
        self.backlog += len(changes)
        if self.buffered_manipulation:
            self.queue += changes
        else:
            self._apply(changes)

    def missing(self, changes: Iterable[Change]) -> str:
        """Return what changes are to take away or rename and is not there; not while others wait.

        ARMOR says nothing. A value that was to be replaced, and is another, leaves two of them.
        """
        if self.queue:
            return ''
        found: list[str] = []
        for change in changes:
            if isinstance(change, RemoveAxiom):
                if change.axiom not in self.kb:
                    found.append(f'{axiom_text(change.axiom)} was not asserted')
            elif isinstance(change, RenameEntity | RemoveEntity):
                iri = change.old if isinstance(change, RenameEntity) else change.iri
                if not self.kb.is_known(change.kind, iri):
                    kind = change.kind.replace('_', ' ')
                    found.append(f'{self.name} has no {kind} {render_entity(iri)}')
        return '; '.join(found)

    def flush(self) -> None:
        """Apply the queued changes."""
        if self.queue:
            queued, self.queue = self.queue, []
            self._apply(queued)

    def buffer(self, on: bool) -> None:
        """Switch buffered manipulation; switching it off applies what waits."""
        self.buffered_manipulation = on
        if not on:
            self.flush()

    def reason(self) -> bool:
        """Apply the queued changes and bring the derived facts up to date.

        Returns:
            Whether the ontology is consistent.
        """
        self.flush()
        if self.kb.stale:
            self.revision += 1
        return self._derive()

    @property
    def is_slow(self) -> bool:
        """Whether the next reasoning may take long."""
        much = self.heavy or self.backlog > LONG_BACKLOG
        return much or self.took > SLOW or bool(self.origin.reasoner)

    def is_free_for(self, client: str) -> bool:
        """Tell whether a client may change the reference or mount on it."""
        return self.mounted in (NOBODY, client)

    def _apply(self, changes: list[Change]) -> None:
        apply_all(self.kb, changes)
        self.revision += 1
        if not self.buffered_reasoner:
            self._derive()

    def _derive(self) -> bool:
        self.backlog, self.heavy = 0, False
        stale, begin = self.kb.stale, time.thread_time()
        consistent = self.kb.reason()
        if stale:
            self.took = time.thread_time() - begin
        return consistent


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
