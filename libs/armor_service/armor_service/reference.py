"""Loaded ontologies under their reference names: buffers, who is mounted, locks."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from armor_service.changes import (
    AddAxiom,
    Change,
    RemoveAxiom,
    RemoveEntity,
    RenameEntity,
    apply_all,
    change_text,
)
from armor_service.protocol import DirectiveError
from armor_service.rendering import render_entity, shown
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.budget import ReasoningBudgetError
from owl_reasoner.reasoner.explanation import Explanation

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
"""Names of the reasoner of this project; PELLET is what ARMOR's clients send."""
PER_BASE = 20.0
"""How often the first reasoning's time a change may take."""
PER_AXIOM = 0.0002
"""Seconds of processor time for each axiom that is reasoned over, some ten times what it needs."""
MOST_DEATHS = 2
"""Ends of the process while it reasons over one ontology after which it is not tried again."""
WHOLE = -1
"""All changes at once."""
SHOWN = 3
"""Changes of one directive that a line names."""
KEPT = 100
"""Lines of `Reference.quarantine`."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where an ontology came from.

    Attributes:
        path: File or URL that was loaded; the target of SAVE without a path. Empty: none.
        format: Format of that file, in which SAVE writes.
        prefixes: Namespace prefixes of that file, which SAVE uses.
    """

    path: str
    format: str
    prefixes: Mapping[str, str] = field(default_factory=dict)

    @property
    def file(self) -> Path | None:
        """The file that SAVE without a path writes to, None when it came from the web."""
        return Path(self.path) if self.path and '://' not in self.path else None


def knowledge_base(base: str, axioms: Iterable[Axiom]) -> KnowledgeBase:
    """Make a knowledge base whose clock is the processor time of the thread that uses it.

    What reasoning takes is then the same on a busy machine.
    """
    kb = KnowledgeBase(base, axioms, clock=time.thread_time)
    kb.patience = PATIENCE
    return kb


@dataclass(frozen=True, slots=True)
class Told:
    """What one client's directive changes.

    Attributes:
        client: Who sent it.
        time: When, seconds since the epoch.
        changes: What it asks for.
    """

    client: str
    time: float
    changes: tuple[Change, ...]

    def __str__(self) -> str:
        text = '; '.join(map(change_text, self.changes[:SHOWN]))
        more = f' and {len(self.changes) - SHOWN} more' if len(self.changes) > SHOWN else ''
        when = datetime.fromtimestamp(self.time).isoformat(' ', 'seconds') if self.time else ''
        return f'{text}{more} (of client {shown(self.client)}{", " if when else ""}{when})'


@dataclass(frozen=True, slots=True)
class Limits:
    """What reasoning over changes may use.

    Attributes:
        seconds: Seconds of processor time, beside what the size of ontology and changes allows.
        memory: Bytes by which the process may grow.
    """

    seconds: float = math.inf
    memory: float = math.inf

    def of(self, base: float, axioms: int) -> float:
        """Return the seconds of processor time for an ontology.

        Args:
            base: What reasoning over it took when it was new, seconds of processor time.
            axioms: How many axioms are to be reasoned over.
        """
        return self.seconds + PER_BASE * base + PER_AXIOM * axioms


class TooHardError(Exception):
    """Reasoning over an ontology was ended; its text says by what and where."""


@dataclass(slots=True)
class Reference:
    """One ontology that directives name.

    Whoever reads or changes it holds `lock`. Changes go in through `submit`, `flush` and `reason`.
    Those over which reasoning takes too long are taken back, one client's directive at a time, and
    told; what they were stays in `quarantine`.

    Attributes:
        name: Reference name.
        kb: Axioms and derived facts; ``kb.iri`` is what local names are completed with.
        origin: Where it was loaded from.
        buffered_manipulation: Changes wait in `waiting` until `flush`.
        buffered_reasoner: Derived facts follow at `reason` only, not after each change.
        mounted: The client that may change it, `NOBODY` for all.
        waiting: Changes that wait.
        untested: Changes since the last reasoning that was completed.
        quarantine: One line for each directive that was taken back.
        quarantined: How many there were in this process.
        backlog: Changes since the last reasoning, queued ones included; a measure of its cost.
        heavy: Classes or properties changed since the last reasoning; the next takes longer.
        took: Seconds of processor time of the last reasoning that had something to do.
        base: Seconds of processor time that reasoning took when the ontology was new.
        limits: What reasoning over changes may use.
        opened: It was reasoned over since the process began.
        too_hard: Why nothing is derived; empty where it is.
        cancel: Set to end the reasoning that runs.
        revision: Counts what may have changed an answer, so that copies know when they are old.
        dropped: The name does not stand for it any more.
        origin_axioms: What was asserted before `untested`, where the process did not reason yet.
        deaths: How often the process ended while it reasoned over the ontology.
        died_at: Over which of `untested`, or `WHOLE`.
        on_reasoning: Told over which of `untested` is reasoned, or `WHOLE`; and None at the end.
        on_completed: Told that the derived facts are up to date.
        on_taken_back: Told what is taken back, one line each, and the changes that undo it.
    """

    name: str
    kb: KnowledgeBase
    origin: Origin
    buffered_manipulation: bool = False
    buffered_reasoner: bool = False
    mounted: str = NOBODY
    waiting: list[Told] = field(default_factory=list)
    untested: list[Told] = field(default_factory=list)
    quarantine: list[str] = field(default_factory=list)
    quarantined: int = 0
    backlog: int = 0
    heavy: bool = False
    took: float = 0.0
    base: float = 0.0
    limits: Limits = Limits()
    opened: bool = True
    too_hard: str = ''
    cancel: threading.Event = field(default_factory=threading.Event)
    revision: int = 0
    dropped: bool = False
    lock: threading.RLock = field(default_factory=threading.RLock)
    origin_axioms: tuple[Axiom, ...] = ()
    deaths: int = 0
    died_at: int = -1
    on_reasoning: Callable[[int | None], None] = lambda _: None
    on_completed: Callable[[], None] = lambda: None
    on_taken_back: Callable[[list[str], list[Change]], None] = lambda *_: None

    @contextlib.contextmanager
    def held(self) -> Iterator[KnowledgeBase]:
        """Hold the lock.

        Raises:
            DirectiveError: 205, the name does not stand for it any more.
        """
        with self.lock:
            if self.dropped:
                raise DirectiveError(f'{shown(self.name)} was dropped meanwhile')
            self.open()
            yield self.kb

    @property
    def queue(self) -> list[Change]:
        """The changes that wait, oldest first."""
        return [change for told in self.waiting for change in told.changes]

    def open(self) -> None:
        """Reason over an ontology of before this process, without the changes that are too hard."""
        if not self.opened:
            self.opened = True
            with contextlib.suppress(TooHardError):
                self._derive()

    def submit(self, told: Told) -> str:
        """Take changes in, at once or into the queue, as the reference is set up.

        Returns:
            Why the changes were taken back; empty where they were not.
        """
        self.backlog += len(told.changes)
        if self.buffered_manipulation:
            self.waiting.append(told)
            return ''
        before = self.quarantined
        self._apply([told])
        return self._taken_since(before)

    def missing(self, changes: Iterable[Change]) -> str:
        """Return what the changes remove or rename although it is not there.

        Empty while earlier changes wait for APPLY: they may add it. ARMOR says nothing here. A
        client that replaces a value but names a wrong old one is left with two values.
        """
        if self.waiting:
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
        if self.waiting:
            queued, self.waiting = self.waiting, []
            self._apply(queued)

    def buffer(self, on: bool) -> None:
        """Switch buffered manipulation; switching it off applies what waits."""
        self.buffered_manipulation = on
        if not on:
            self.flush()

    def reason(self, timeout: float = math.inf) -> str:
        """Apply the queued changes and bring the derived facts up to date.

        Args:
            timeout: Seconds of processor time after which to end and leave all changes as they are.

        Returns:
            What was taken back, see `quarantine`; empty: nothing was.

        Raises:
            TooHardError: It was ended; nothing is derived until the next one.
        """
        before = self.quarantined
        self.flush()
        if self.kb.stale:
            self.revision += 1
        self._derive(timeout)
        return self._taken_since(before)

    def _taken_since(self, before: int) -> str:
        count = self.quarantined - before
        return '; '.join(self.quarantine[-count:]) if count else ''

    def explain(self, fact: Axiom | None) -> Explanation | None:
        """Return why a fact holds (None: the contradiction), within the limits of reasoning.

        Raises:
            TooHardError: It takes too long, or was cancelled; what is derived stays.
        """
        if not self.dropped:
            self.cancel.clear()
        seconds = self.limits.of(self.base, len(self.kb))
        try:
            if fact is None:
                return self.kb.explain_inconsistency(
                    seconds, self.cancel, memory=self.limits.memory
                )
            return self.kb.explain(fact, seconds, self.cancel, memory=self.limits.memory)
        except ReasoningBudgetError as error:
            raise TooHardError(str(error)) from None

    @property
    def is_slow(self) -> bool:
        """Whether the next reasoning may take long."""
        much = self.heavy or self.backlog > LONG_BACKLOG
        return much or self.took > SLOW or not self.opened or bool(self.too_hard)

    def is_free_for(self, client: str) -> bool:
        """Tell whether a client may change the reference or mount on it."""
        return self.mounted in (NOBODY, client)

    def _apply(self, told: list[Told]) -> None:
        apply_all(self.kb, (change for one in told for change in one.changes))
        self.untested += told
        self.revision += 1
        if not self.buffered_reasoner and not self.too_hard:
            self._derive()

    def _derive(self, timeout: float = math.inf) -> None:
        """Bring the derived facts up to date, without the changes that are too hard.

        Raises:
            TooHardError: It was ended, and the changes stay as they are.
        """
        self.backlog, self.heavy = 0, False
        if not self.kb.stale:
            self.untested.clear()
            return
        if not self.dropped:
            self.cancel.clear()
        begin = time.thread_time()
        try:
            if self.deaths < MOST_DEATHS:
                self._reason(timeout)
            else:
                self._take_back(f'the process ended {self.deaths} times while it reasoned over it')
        except ReasoningBudgetError as error:
            self.revision += 1
            if error.limit == 'cancelled' or timeout < math.inf:
                raise TooHardError(str(error)) from None
            self._take_back(str(error))
        self.took = time.thread_time() - begin
        self.base = self.base or self.took
        self.untested.clear()
        self.too_hard, self.deaths, self.origin_axioms = '', 0, ()
        self.on_completed()

    def _reason(self, timeout: float = math.inf, place: int = WHOLE) -> None:
        """Reason once, within the limits; `place` says over which of the changes."""
        count = sum(len(told.changes) for told in self.untested)
        if self.base == 0.0 or self.origin_axioms:
            count = len(self.kb)
        seconds = min(timeout, self.limits.of(self.base, count))
        self.on_reasoning(place)
        try:
            self.kb.reason(seconds, self.cancel, memory=self.limits.memory)
        finally:
            self.on_reasoning(None)

    def _take_back(self, problem: str) -> None:
        """Find the changes over which reasoning takes too long, and go on without them.

        All changes since the last reasoning go, then they come again one directive at a time.

        Raises:
            TooHardError: It takes too long without them as well, or was cancelled; the changes stay
                as they are.
        """
        told = list(self.untested)
        net: dict[Axiom, int] = {}

        def note(changes: Changes) -> None:
            for step, batch in ((1, changes.added), (-1, changes.removed)):
                for axiom, derived in batch:
                    if not derived:
                        net[axiom] = net.get(axiom, 0) + step

        taken: list[tuple[Told, str]] = []
        unsubscribe = self.kb.subscribe(note)
        try:
            self._go_back()
            self._reason()
            for place, one in enumerate(told):
                if why := self._tried(one, place, problem if len(told) == 1 else ''):
                    taken.append((one, why))
        except ReasoningBudgetError as error:
            self.kb.change(*([axiom for axiom in net if net[axiom] == step] for step in (-1, 1)))
            self.too_hard = '' if error.limit == 'cancelled' else str(error)
            raise TooHardError(str(error)) from None
        finally:
            unsubscribe()
            self.revision += 1
        self.quarantine += [f'{one}: {why}' for one, why in taken]
        self.quarantined += len(taken)
        del self.quarantine[:-KEPT]
        gone: list[Change] = [RemoveAxiom(axiom) for axiom, step in net.items() if step < 0]
        come: list[Change] = [AddAxiom(axiom) for axiom, step in net.items() if step > 0]
        self.on_taken_back(self.quarantine[-len(taken) :] if taken else [], [*gone, *come])

    def _go_back(self) -> None:
        """Have the axioms of the last reasoning that was completed, or of the last snapshot."""
        if self.origin_axioms:
            wanted = dict.fromkeys(self.origin_axioms)
            present = dict.fromkeys(self.kb.axioms())
            self.kb.change(
                [axiom for axiom in wanted if axiom not in present],
                [axiom for axiom in present if axiom not in wanted],
            )
        else:
            self.kb.revert()

    def _tried(self, told: Told, place: int, problem: str) -> str:
        """Apply a change and reason; return why it was taken back, empty where it was not."""
        if not problem and self.deaths >= MOST_DEATHS and place == self.died_at:
            problem = f'the process ended {self.deaths} times while it reasoned over it'
        if problem:
            return problem
        apply_all(self.kb, told.changes)
        try:
            self._reason(place=place)
        except ReasoningBudgetError as error:
            if error.limit == 'cancelled':
                raise
            self.kb.revert()
            self._reason()
            return str(error)
        return ''


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
