"""SPARQL SELECT with a time limit that holds: queries run in processes that end at their time.

The engine is Oxigraph (https://pyoxigraph.readthedocs.io), the fastest of those that were tried; a
query in it cannot be interrupted, hence the processes. A process keeps its graph: further queries
cost no transfer, or that of the difference.
"""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

from surveillance_ontology.armor.protocol import DirectiveError, QueryItem
from surveillance_ontology.memory import uncollected

if TYPE_CHECKING:
    # Not in the processes, which need nothing else of the package.
    from surveillance_ontology.armor.sparql_graph import GraphUpdate, Version

MEMORY = 2 * 1024**3
"""Bytes that a query's process may use."""
OUT_OF_MEMORY = 3
"""Exit code of a process that needed more memory."""
IDLE = 2
"""Processes that are kept for the next query."""

Update: TypeAlias = 'Callable[[Version | None], GraphUpdate | None]'
"""Gives what brings a process with a graph of a version, or none, up to date; None: it is."""


class SparqlEngine:
    """Runs queries in processes of its own; threads may share it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[_Worker] = []
        self._busy: set[_Worker] = set()
        self._closed = False

    def select(
        self,
        version: Version,
        update: Update,
        query: str,
        seconds: float,
        limit: float,
        rows: int,
    ) -> list[list[QueryItem]]:
        """Run a query.

        Args:
            version: Which graph; equal versions are the same graph.
            update: Makes what a process lacks of this version or a newer one.
            query: A SELECT query.
            seconds: Time limit of the query itself.
            limit: Time limit of all, starting a process and the transfer of the graph included.
            rows: Most rows.

        Returns:
            The variables that each row binds, and their values: IRIs, labels of blank nodes,
            ``lexical^^datatype`` or ``text@language``; of a plain text the text alone.

        Raises:
            TimeoutError: Stopped at the time limit.
            DirectiveError: Not a valid SELECT query, too many rows, too much memory, too
                deeply nested.
        """
        deadline = time.monotonic() + limit
        worker = self._take(version)
        try:
            worker.prepare(update, deadline)
            answer = worker.ask(query, min(deadline, time.monotonic() + seconds), rows)
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
            [sys.executable, '-m', 'surveillance_ontology.armor.sparql_worker', str(MEMORY)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def prepare(self, update: Update, deadline: float) -> None:
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
        """Return the answer to a request; the process ends itself when its time is over."""
        seconds = deadline - time.monotonic()
        if seconds <= 0:
            raise TimeoutError('the query ran into its time limit')
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        answer = b''
        with contextlib.suppress(BrokenPipeError):
            line = json.dumps({**request, 'seconds': seconds}).encode() + b'\n'
            self._process.stdin.write(line + payload)
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        if answer.endswith(b'\n'):
            return json.loads(answer)
        code = self._process.wait()
        if code == -signal.SIGALRM:
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
