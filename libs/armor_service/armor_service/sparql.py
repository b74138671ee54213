"""SPARQL SELECT with a time limit that holds: queries run in processes that end at their time.

The engine is Oxigraph (https://pyoxigraph.readthedocs.io), the fastest of those that were tried; a
query in it cannot be interrupted, hence the processes. A process keeps its RDF graph. A whole graph
of 100,000 axioms takes seconds to write and to read. Most changes are of single facts; for these a
process that has an older graph gets the difference.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from armor_service.access import Settings
from armor_service.protocol import DirectiveError, QueryItem
from armor_service.reference import Reference
from owl_reasoner.gc_control import uncollected
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axioms import (
    Axiom,
    AxiomAnnotation,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    ObjectPropertyAssertion,
    SubClassOf,
)
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.vocabulary import NOTHING, THING

MEMORY = 2 * 1024**3
"""Bytes that a query's process may use."""
GRACE = 1.0
"""Seconds after which a process that did not end itself at its time is killed."""
OUT_OF_MEMORY = 3
"""Exit code of a process that needed more memory."""
IDLE = 2
"""Processes that are kept for the next query."""
KEPT = 5000
"""Facts that changed and are kept; a process whose graph is older gets the whole one."""

_BUILT_IN = (THING, NOTHING)

Fact = ClassAssertion | ObjectPropertyAssertion | DataPropertyAssertion | SubClassOf


class SparqlEngine:
    """Runs queries in processes of its own; threads may share it.

    Args:
        settings: Whether derived facts are seen, the longest time and the most rows.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._graphs = GraphChanges()
        self._lock = threading.Lock()
        self._idle: list[_Worker] = []
        self._busy: set[_Worker] = set()
        self._closed = False

    def note(self, name: str, changes: Changes | None) -> None:
        """Take in a change of a reference; None: it was loaded or dropped."""
        self._graphs.note(name, changes)

    def select(self, ref: Reference, query: str, seconds: float) -> list[list[QueryItem]]:
        """Run a query.

        Args:
            ref: What is asked; its lock is held while it is looked at only.
            query: A SELECT query.
            seconds: Time limit of the query itself. That of all, starting a process and the
                transfer of the graph included, is the setting's.

        Returns:
            The variables that each row binds, and their values: IRIs, labels of blank nodes,
            ``lexical^^datatype`` or ``text@language``; of a plain text the text alone.

        Raises:
            TimeoutError: Stopped at the time limit.
            DirectiveError: Not a valid SELECT query, too many rows, too much memory, too
                deeply nested; or the reference was dropped.
        """
        deadline = time.monotonic() + self._settings.sparql_timeout
        derived = self._settings.sparql_derived

        def update(known: Version | None) -> GraphUpdate | None:
            with ref.held():
                return self._graphs.update(ref, derived, known)

        with ref.held():
            version = self._graphs.version(ref, derived)
        worker = self._take(version)
        try:
            worker.prepare(update, deadline)
            end = min(deadline, time.monotonic() + seconds)
            answer = worker.ask(query, end, self._settings.sparql_rows)
        except BaseException:
            with self._lock:
                self._busy.discard(worker)
            worker.kill()
            if self._closed:
                raise DirectiveError('QUERY SPARQL: the server stops') from None
            raise
        with self._lock:
            self._busy.discard(worker)
            self._idle.append(worker)
            kept = 0 if self._closed else IDLE
            surplus = self._idle[: len(self._idle) - kept]
            self._idle = self._idle[len(self._idle) - kept :]
        for other in surplus:
            other.kill()
        if 'error' in answer:
            raise DirectiveError(f'QUERY SPARQL: {" ".join(str(answer["error"]).split())}')
        return [[QueryItem(*bound) for bound in row] for row in answer['rows']]

    def is_busy(self) -> bool:
        """Tell whether a query runs."""
        return bool(self._busy)

    def forget(self) -> None:
        """End the processes that run no query, and with them the graphs that they keep."""
        with self._lock:
            idle, self._idle = self._idle, []
        for worker in idle:
            worker.kill()

    def close(self) -> None:
        """End the processes, also those that run a query."""
        with self._lock:
            self._closed = True
            idle, self._idle = self._idle, []
            busy = list(self._busy)
        for worker in busy:
            worker.interrupt()
        for worker in idle:
            worker.kill()

    def _take(self, version: Version) -> _Worker:
        with self._lock:
            if self._closed:
                raise DirectiveError('QUERY SPARQL: the server stops')
            if self._idle:
                # The one that has most of it.
                worker = min(self._idle, key=lambda idle: _distance(idle.version, version))
                self._idle.remove(worker)
            else:
                worker = _Worker()
            self._busy.add(worker)
            return worker


def _distance(known: Version | None, wanted: Version) -> tuple[bool, int]:
    if known is None:
        return True, 0
    same = (known.epoch, known.derived) == (wanted.epoch, wanted.derived)
    return not same, abs(wanted.sequence - known.sequence)


class _Worker:
    def __init__(self) -> None:
        self.version: Version | None = None
        self._process = subprocess.Popen(
            [
                sys.executable,
                '-m',
                'armor_service.sparql_worker',
                str(MEMORY),
                str(OUT_OF_MEMORY),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def prepare(
        self, update: Callable[[Version | None], GraphUpdate | None], deadline: float
    ) -> None:
        """Have the process hold the graph as it is now."""
        with uncollected():
            wanted = update(self.version)
            if wanted is None:
                return
            version, whole = wanted.version, wanted.whole
            removed, added = wanted.triples()
            del wanted  # Its axioms are many: gone before a collection sees them.
        self.version = None
        sizes = {'whole': whole, 'removed': len(removed), 'added': len(added)}
        answer = self._exchange(sizes, deadline, removed + added)
        if 'error' in answer:
            raise DirectiveError(f'QUERY SPARQL: {answer["error"]}')
        self.version = version

    def ask(self, query: str, deadline: float, rows: int) -> Any:
        """Return the process's answer to a query on the graph that it holds."""
        return self._exchange({'query': query, 'rows': rows}, deadline)

    def _exchange(self, request: dict[str, Any], deadline: float, payload: bytes = b'') -> Any:
        """Return the answer to a request.

        The process ends itself when its time is over; one that cannot, since it is stopped or hangs
        while it starts, is killed.
        """
        seconds = deadline - time.monotonic()
        if seconds <= 0:
            raise TimeoutError('the query ran into its time limit')
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        answer = b''
        guard = threading.Timer(seconds + GRACE, self._process.kill)
        guard.daemon = True
        guard.start()
        with contextlib.suppress(BrokenPipeError):
            line = json.dumps({**request, 'seconds': seconds}).encode() + b'\n'
            self._process.stdin.write(line + payload)
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        guard.cancel()
        if answer.endswith(b'\n'):
            return json.loads(answer)
        code = self._process.wait()
        if code == -signal.SIGALRM or time.monotonic() >= deadline:
            raise TimeoutError('the query ran into its time limit')
        raise DirectiveError(f'QUERY SPARQL: {_why_ended(code)}')

    def interrupt(self) -> None:
        """End the process; whoever waits for it finds out."""
        self._process.kill()

    def kill(self) -> None:
        """End the process, which nobody waits for."""
        self._process.kill()
        self._process.communicate()


def _why_ended(code: int) -> str:
    if code > 0 and code != OUT_OF_MEMORY:
        return 'the query process could not start; pyoxigraph is needed'
    if code == -signal.SIGSEGV:
        return 'the query nests too deeply'  # Oxigraph's stack ended.
    return 'the query needs too much memory'


@dataclass(frozen=True)
class Version:
    """Which graph a process has.

    Attributes:
        epoch: Tells a loaded ontology from any other.
        derived: Whether derived facts are in it.
        sequence: Counts the changes within an epoch.
        classified: Counts the times that the classes were put in order.
    """

    epoch: int
    derived: bool
    sequence: int
    classified: int = 0


@dataclass(frozen=True)
class GraphUpdate:
    """What brings a process to a version.

    Attributes:
        version: The version.
        whole: Whether `added` is the whole graph, in the place of the one before.
        iri: The ontology's IRI.
        added: Axioms that come.
        removed: Facts that go, before the others come.
    """

    version: Version
    whole: bool
    iri: str
    added: list[Axiom]
    removed: list[Axiom] = field(default_factory=list)

    def triples(self) -> tuple[bytes, bytes]:
        """Return what goes and what comes as N-Triples; needs no lock, and may take long."""
        from owl_reasoner.documents.writing import fact_line, ontology_bytes

        removed = ''.join(map(fact_line, self.removed)).encode()
        annotated = {axiom.axiom for axiom in self.added if isinstance(axiom, AxiomAnnotation)}
        lines: list[str] = []
        rest: list[Axiom] = []
        named: dict[tuple[str, str], None] = {}
        for axiom in self.added:
            line = '' if annotated and axiom in annotated else fact_line(axiom)
            # Labels are all written in one place, which may give others.
            if line and '_:' not in line:
                lines.append(line)
                kind = type(axiom)
                if kind is ClassAssertion:
                    named['class', axiom.cls] = None  # type: ignore[attr-defined]
                elif kind is ObjectPropertyAssertion:
                    named['object_property', axiom.prop] = None  # type: ignore[attr-defined]
                elif kind is DataPropertyAssertion:
                    named['data_property', axiom.prop] = None  # type: ignore[attr-defined]
                else:
                    named.update((entity, None) for entity in entities_of(axiom))
            else:
                rest.append(axiom)
        rest += (Declaration(*entity) for entity in named if entity[1] not in _BUILT_IN)
        return removed, ''.join(lines).encode() + ontology_bytes(rest, self.iri, 'ntriples')


@dataclass
class _Log:
    epoch: int
    sequence: int = 0
    oldest: int = 0
    """A graph of this sequence or a later one can be brought up to date by differences."""
    touched: deque[tuple[int, Fact]] = field(default_factory=deque)
    hierarchy: frozenset[SubClassOf] = frozenset()
    """Which class is below which in the graphs of `hierarchy_since` and later."""
    hierarchy_since: tuple[int, int] = (0, 0)


class GraphChanges:
    """What changed in the graphs of references; call it with the references' locks held."""

    def __init__(self) -> None:
        self._epochs = itertools.count()
        self._logs: dict[str, _Log] = {}

    def note(self, name: str, changes: Changes | None) -> None:
        """Take in a change of a reference; None: it was loaded or dropped."""
        log = self._logs.get(name)
        if log is None:
            return  # Nobody has asked about it yet.
        if changes is None:
            del self._logs[name]
            return
        log.sequence += 1
        for axiom, _ in (*changes.added, *changes.removed):
            if not _is_plain(axiom) or len(log.touched) >= KEPT:
                log.oldest = log.sequence
                log.touched.clear()
                return
            log.touched.append((log.sequence, axiom))  # type: ignore[arg-type]

    def version(self, ref: Reference, derived: bool) -> Version:
        """Return the version of a reference's graph as it is now."""
        log = self._log(ref)
        # That derived facts are given up is not told fact by fact.
        sequence = ref.revision if ref.too_hard else log.sequence
        return Version(log.epoch, derived, sequence, ref.kb.classified)

    def update(self, ref: Reference, derived: bool, known: Version | None) -> GraphUpdate | None:
        """Return what brings a process that has a graph, or none, up to date; None where it is."""
        log, now = self._log(ref), self.version(ref, derived)
        if known == now:
            return None
        found = None
        if known is not None and (known.epoch, known.derived) == (now.epoch, derived):
            found = self._difference(ref, log, known, now)
        if found is not None:
            return GraphUpdate(now, False, ref.kb.iri, *found)
        axioms: list[Axiom] = list(ref.kb.axioms())
        if derived:
            axioms += ref.kb.derived_facts()
            axioms += self._hierarchy(ref, log, now)
        return GraphUpdate(now, True, ref.kb.iri, axioms)

    def _difference(
        self, ref: Reference, log: _Log, known: Version, now: Version
    ) -> tuple[list[Axiom], list[Axiom]] | None:
        """Return what came and what went since a version; None where only all of it will do."""
        if ref.too_hard or known.sequence < log.oldest:
            return None
        touched = dict.fromkeys(fact for at, fact in log.touched if at > known.sequence)
        before = hierarchy = log.hierarchy
        ordered = now.classified != known.classified or any(
            isinstance(fact, SubClassOf)
            # A class that assertions alone name is below owl:Thing as long as they do.
            or (isinstance(fact, ClassAssertion) and not ref.kb.superclasses(str(fact.cls)))
            for fact in touched
        )
        if now.derived and ordered:
            since = log.hierarchy_since
            if known.sequence < since[0] or known.classified < since[1]:
                return None
            hierarchy = self._hierarchy(ref, log, now)
            touched.update(dict.fromkeys(before ^ hierarchy))
        added: list[Axiom] = []
        removed: list[Axiom] = []
        for fact in touched:
            there = fact in hierarchy or _holds(ref.kb, fact, now.derived)
            (added if there else removed).append(fact)
        gone = (iri for fact in removed for kind, iri in entities_of(fact) if kind != 'individual')
        if any(next(ref.kb.axioms_about(iri), None) is None for iri in gone):
            return None  # The declaration of a class or property goes with its last axiom.
        return added, removed

    def _hierarchy(self, ref: Reference, log: _Log, now: Version) -> frozenset[SubClassOf]:
        """Return which class is below which now, and remember it."""
        classes = ref.kb.subclasses(THING) | {THING}
        below = frozenset(SubClassOf(sub, cls) for cls in classes for sub in ref.kb.subclasses(cls))
        if below != log.hierarchy:
            log.hierarchy, log.hierarchy_since = below, (now.sequence, now.classified)
        return below

    def _log(self, ref: Reference) -> _Log:
        log = self._logs.get(ref.name)
        if log is None:
            log = self._logs[ref.name] = _Log(next(self._epochs))
        return log


def _is_plain(axiom: Axiom) -> bool:
    """Tell whether an axiom is one triple."""
    if isinstance(axiom, ClassAssertion):
        return isinstance(axiom.cls, str) and not axiom.individual.startswith('_:')
    if isinstance(axiom, ObjectPropertyAssertion):
        names = (axiom.prop, axiom.subject, axiom.object)
        return all(isinstance(name, str) and not name.startswith('_:') for name in names)
    if isinstance(axiom, SubClassOf):
        return isinstance(axiom.sup, str) and isinstance(axiom.sub, str)
    return isinstance(axiom, DataPropertyAssertion) and not axiom.subject.startswith('_:')


def _holds(kb: KnowledgeBase, fact: Fact, derived: bool) -> bool:
    if fact in kb:
        return True
    if not derived or isinstance(fact, SubClassOf):
        return False
    if isinstance(fact, ClassAssertion):
        return fact.cls in kb.types(fact.individual)
    if isinstance(fact, ObjectPropertyAssertion):
        return fact.object in kb.object_values(str(fact.prop), fact.subject)
    return fact.literal in kb.data_values(fact.prop, fact.subject)
