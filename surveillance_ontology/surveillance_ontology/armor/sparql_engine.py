"""SPARQL SELECT with a time limit that holds: queries run in processes that can be killed.

The engine is Oxigraph (https://pyoxigraph.readthedocs.io), the fastest of those that were tried; a
query in it cannot be interrupted, hence the processes. A process keeps its graph: further queries
cost no transfer, or that of the difference.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from surveillance_ontology.armor.protocol import DirectiveError
from surveillance_ontology.memory import uncollected

if TYPE_CHECKING:
    # Not in the processes, which need nothing else of the package.
    from surveillance_ontology.armor.sparql_graph import GraphUpdate, Version

MEMORY = 2 * 1024**3
"""Bytes that a query's process may use."""
GRACE = 1.0
"""Seconds that a process outlives its time limit when nobody kills it."""
OUT_OF_MEMORY = 3
"""Exit code of a process that needed more memory."""
IDLE = 2
"""Processes that are kept for the next query."""

Update: TypeAlias = 'Callable[[Version | None], GraphUpdate | None]'
"""Gives what brings a process with a graph of a version, or none, up to date; None: it is."""


@dataclass(frozen=True)
class Binding:
    """A variable's value in one row.

    Attributes:
        variable: Without the question mark.
        value: An IRI, a blank node's label, or a literal's lexical form.
        datatype: A literal's datatype; empty for anything else.
        language: A literal's language tag, or empty.
    """

    variable: str
    value: str
    datatype: str
    language: str


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
    ) -> list[list[Binding]]:
        """Run a query.

        Args:
            version: Which graph; equal versions are the same graph.
            update: Makes what a process lacks of this version or a newer one.
            query: A SELECT query.
            seconds: Time limit of the query itself.
            limit: Time limit of all, starting a process and the transfer of the graph included.
            rows: Most rows.

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
        return [[Binding(*bound) for bound in row] for row in answer['rows']]

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
            # The one that has most of it.
            self._idle.sort(key=lambda worker: _distance(worker.version, version))
            worker = self._idle[0] if self._idle else None
            if worker is None:
                worker = _Worker()
            else:
                self._idle.remove(worker)
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
            bufsize=0,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._in = self._process.stdin.fileno()
        self._out = self._process.stdout.fileno()
        os.set_blocking(self._in, False)

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
        seconds = max(deadline - time.monotonic(), 0.0) + GRACE
        return self._exchange({'query': query, 'rows': rows, 'seconds': seconds}, deadline)

    def _exchange(self, request: dict[str, Any], deadline: float, payload: bytes = b'') -> Any:
        self._send(json.dumps(request).encode() + b'\n' + payload, deadline)
        return json.loads(self._receive(deadline))

    def interrupt(self) -> None:
        """End the process; whoever waits for it finds out."""
        self._process.kill()

    def kill(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if pipe is not None:
                    pipe.close()

    def _send(self, data: bytes, deadline: float) -> None:
        view = memoryview(data)
        while view:
            self._await(deadline, writing=True)
            try:
                view = view[os.write(self._in, view) :]
            except BrokenPipeError:
                raise DirectiveError(f'QUERY SPARQL: {self._why_ended()}') from None

    def _receive(self, deadline: float) -> bytes:
        parts: list[bytes] = []
        while not parts or not parts[-1].endswith(b'\n'):
            self._await(deadline, writing=False)
            part = os.read(self._out, 1 << 20)
            if not part:
                raise DirectiveError(f'QUERY SPARQL: {self._why_ended()}')
            parts.append(part)
        return b''.join(parts)

    def _why_ended(self) -> str:
        code = self._process.wait()
        if code > 0 and code != OUT_OF_MEMORY:
            return 'the query process could not start; pyoxigraph is needed'
        if code == -signal.SIGSEGV:
            return 'the query nests too deeply'  # Oxigraph's stack ended.
        return 'the query needs too much memory'

    def _await(self, deadline: float, *, writing: bool) -> None:
        remaining = deadline - time.monotonic()
        descriptor = self._in if writing else self._out
        reading, to_write = ([], [descriptor]) if writing else ([descriptor], [])
        if remaining <= 0 or not any(select.select(reading, to_write, [], remaining)):
            raise TimeoutError('the query ran into its time limit')
