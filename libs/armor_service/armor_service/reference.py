"""A loaded ontology: what is asserted and derived, what waits, who is mounted, and its lock."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from armor_service.changes import Change, RemoveAxiom, RemoveEntity, RenameEntity, apply_all
from armor_service.protocol import DirectiveError
from armor_service.quarantine import WHOLE, Quarantine, Submission, TooHardError
from armor_service.rendering import render_entity, shown
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.budget import ReasoningBudgetError
from owl_reasoner.reasoner.explanation import Explanation

LONG_BACKLOG = 500
"""Changes since the last reasoning from which on the next counts as slow."""
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


@dataclass(slots=True)
class Buffering:
    """Whether changes, or what follows from them, wait until somebody asks for them.

    Attributes:
        manipulation: Changes wait in `waiting` until APPLY or REASON.
        reasoner: Derived facts follow at REASON only, not after each change.
        waiting: Changes that wait, oldest first.
    """

    manipulation: bool = False
    reasoner: bool = False
    waiting: list[Submission] = field(default_factory=list)

    @property
    def queue(self) -> list[Change]:
        """The changes that wait, oldest first."""
        return [change for told in self.waiting for change in told.changes]

    def take(self) -> list[Submission]:
        """Hand out what waits."""
        taken, self.waiting = self.waiting, []
        return taken


@dataclass(slots=True)
class Effort:
    """What reasoning over a reference takes, and may take.

    Attributes:
        limits: What reasoning over changes may use.
        backlog: Changes since the last reasoning, queued ones included; a measure of its cost.
        heavy: Classes or properties changed since the last reasoning; the next takes longer.
        took: Seconds of processor time of the last reasoning that had something to do.
        base: Seconds of processor time that reasoning took when the ontology was new.
    """

    limits: Limits = Limits()
    backlog: int = 0
    heavy: bool = False
    took: float = 0.0
    base: float = 0.0

    @property
    def is_slow(self) -> bool:
        """Whether the next reasoning may take long."""
        return self.heavy or self.backlog > LONG_BACKLOG or self.took > SLOW


@dataclass(slots=True)
class Reference:
    """One ontology that directives name.

    Whoever reads or changes it holds `lock`. Changes go in through `submit`, `flush` and `reason`.
    Those over which reasoning takes too long are taken back and told; see `Quarantine`.

    Attributes:
        name: Reference name.
        kb: Axioms and derived facts; ``kb.iri`` is what local names are completed with.
        origin: Where it was loaded from.
        buffering: What waits until somebody asks for it.
        mounted: The client that may change it, `NOBODY` for all.
        quarantine: What was not reasoned over yet, and what was taken back.
        effort: What reasoning takes, and may take.
        opened: It was reasoned over since the process began.
        too_hard: Why nothing is derived; empty where it is.
        cancel: Set to end the reasoning that runs.
        revision: Counts what may have changed an answer, so that copies know when they are old.
        dropped: The name does not stand for it any more.
        on_open: Told that it was reasoned over for the first time in this process.
        on_applied: Told which directives' changes were applied, before anybody reasons over them.
        on_reasoning: Told over which of the untested changes is reasoned, or `WHOLE`; and None at
            the end.
        on_completed: Told that the derived facts are up to date.
        on_rolled_back: Told what is taken back, one line each, and the changes that undo it.
    """

    name: str
    kb: KnowledgeBase
    origin: Origin
    buffering: Buffering = field(default_factory=Buffering)
    mounted: str = NOBODY
    quarantine: Quarantine = field(default_factory=Quarantine)
    effort: Effort = field(default_factory=Effort)
    opened: bool = True
    too_hard: str = ''
    cancel: threading.Event = field(default_factory=threading.Event)
    revision: int = 0
    dropped: bool = False
    lock: threading.RLock = field(default_factory=threading.RLock)
    on_open: Callable[[], None] = lambda: None
    on_applied: Callable[[list[Submission]], None] = lambda _: None
    on_reasoning: Callable[[int | None], None] = lambda _: None
    on_completed: Callable[[], None] = lambda: None
    on_rolled_back: Callable[[list[str], list[Change]], None] = lambda *_: None

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

    def open(self) -> None:
        """Reason over an ontology of before this process, without the changes that are too hard."""
        if not self.opened:
            self.opened = True
            with contextlib.suppress(TooHardError):
                # It is no change, and nobody has asked yet.
                self._derive(tell=False)
            self.on_open()

    def submit(self, told: Submission) -> str:
        """Take changes in, at once or into the queue, as the reference is set up.

        Returns:
            Why the changes were taken back; empty where they were not.
        """
        self.effort.backlog += len(told.changes)
        if self.buffering.manipulation:
            self.buffering.waiting.append(told)
            return ''
        before = self.quarantine.count
        self._apply([told])
        return self.quarantine.since(before)

    def missing(self, changes: Iterable[Change]) -> str:
        """Return what the changes remove or rename although it is not there.

        Empty while earlier changes wait for APPLY: they may add it. ARMOR says nothing here. A
        client that replaces a value but names a wrong old one is left with two values.
        """
        if self.buffering.waiting:
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
        if self.buffering.waiting:
            self._apply(self.buffering.take())

    def buffer(self, on: bool) -> None:
        """Switch buffered manipulation; switching it off applies what waits."""
        self.buffering.manipulation = on
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
        before = self.quarantine.count
        self.flush()
        if self.kb.stale:
            self.revision += 1
        self._derive(timeout)
        return self.quarantine.since(before)

    def reason_at_once(self) -> None:
        """Reason over what another program changed, whatever waits for REASON.

        Raises:
            TooHardError: It was ended.
        """
        if self.opened:
            self._derive()
        else:
            self.open()

    def explain(self, fact: Axiom | None) -> Explanation | None:
        """Return why a fact holds (None: the contradiction), within the limits of reasoning.

        Raises:
            TooHardError: It takes too long, or was cancelled; what is derived stays.
        """
        if not self.dropped:
            self.cancel.clear()
        seconds = self.effort.limits.of(self.effort.base, len(self.kb))
        try:
            if fact is None:
                return self.kb.explain_inconsistency(
                    seconds, self.cancel, memory=self.effort.limits.memory
                )
            return self.kb.explain(fact, seconds, self.cancel, memory=self.effort.limits.memory)
        except ReasoningBudgetError as error:
            raise TooHardError(str(error)) from None

    @property
    def is_slow(self) -> bool:
        """Whether the next reasoning may take long."""
        return self.effort.is_slow or not self.opened or bool(self.too_hard)

    def is_free_for(self, client: str) -> bool:
        """Tell whether a client may change the reference or mount on it."""
        return self.mounted in (NOBODY, client)

    def _apply(self, told: list[Submission]) -> None:
        apply_all(self.kb, (change for one in told for change in one.changes))
        self.quarantine.untested += told
        self.revision += 1
        self.on_applied(told)
        if not self.buffering.reasoner and not self.too_hard:
            self._derive()

    def _derive(self, timeout: float = math.inf, tell: bool = True) -> None:
        """Bring the derived facts up to date, without the changes that are too hard.

        Raises:
            TooHardError: It was ended, and the changes stay as they are.
        """
        self.effort.backlog, self.effort.heavy = 0, False
        if not self.kb.stale:
            self.quarantine.untested.clear()
            return
        if not self.dropped:
            self.cancel.clear()
        begin = time.thread_time()
        try:
            if self.quarantine.is_given_up and timeout == math.inf:
                self._roll_back(self.quarantine.ends)
            else:
                self._reason(WHOLE, timeout, tell)
        except ReasoningBudgetError as error:
            self.revision += 1
            if error.limit == 'cancelled' or timeout < math.inf:
                raise TooHardError(str(error)) from None
            self._roll_back(str(error))
        self.effort.took = time.thread_time() - begin
        self.effort.base = self.effort.base or self.effort.took
        self.quarantine.completed()
        self.too_hard = ''
        self.on_completed()

    def _reason(self, place: int, timeout: float = math.inf, tell: bool = True) -> None:
        """Reason once, within the limits; `place` says over which of the changes."""
        count = sum(len(told.changes) for told in self.quarantine.untested)
        if self.kb.starts_anew or self.effort.base == 0.0 or self.quarantine.origin:
            count = len(self.kb)
        seconds = min(timeout, self.effort.limits.of(self.effort.base, count))
        self.on_reasoning(place)
        try:
            self.kb.reason(seconds, self.cancel, memory=self.effort.limits.memory, tell=tell)
        finally:
            self.on_reasoning(None)

    def _roll_back(self, problem: str) -> None:
        """Find the changes over which reasoning takes too long, and go on without them.

        Raises:
            TooHardError: It takes too long without them as well, or was cancelled; the changes stay
                as they are.
        """
        if not self.quarantine.untested:
            # There is no change to blame: what was reasoned over before is nobody's to take back.
            self.too_hard = problem
            raise TooHardError(problem)
        try:
            lines, undo = self.quarantine.roll_back(self.kb, self._reason, problem)
        except ReasoningBudgetError as error:
            self.too_hard = '' if error.limit == 'cancelled' else str(error)
            raise TooHardError(str(error)) from None
        finally:
            self.revision += 1
        self.on_rolled_back(lines, undo)
