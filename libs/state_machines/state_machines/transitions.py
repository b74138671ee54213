"""What a machine does: numbered transitions, brought to a consumer.

The machine's thread only appends to a queue; numbering, counting and turning userdata into JSON
happen where the queue is emptied.
"""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any

from state_machines.container import Container
from state_machines.exceptions import describe
from state_machines.log import logerr
from state_machines.program import Noted, RawTransition, unfold

QUEUE_LENGTH = 100_000
"""Transitions that may wait to be consumed; the oldest are lost beyond that, as numbers show."""


@dataclass(frozen=True)
class Transition:
    """One transition.

    Attributes:
        sequence: Counted from 1 over all containers of the root.
        time: Seconds on the machine's clock.
        path: Path of the container.
        from_state: Label of the state that ended; empty for all states of a concurrence, and for an
            interrupt that ran first of all.
        outcome: What it ended with.
        to_state: Label entered, or the container's outcome when `kind` is ``exit``; empty for all
            states of a concurrence.
        kind: ``transition``, ``exit``, ``interrupt``, ``resume``, ``forced``, or ``ended`` for a
            child of a concurrence.
        duration: Seconds that `from_state` took.
        visits: How often `to_state` has been entered, this time included.
        userdata: The container's userdata as far as JSON can show it.
    """

    sequence: int
    time: float
    path: str
    from_state: str
    outcome: str
    to_state: str
    kind: str
    duration: float
    visits: int
    userdata: dict[str, Any] = field(default_factory=dict)


def presentable(userdata: dict[str, Any]) -> dict[str, Any]:
    """Return the part of userdata that JSON can show."""
    part = {}
    for key, value in userdata.items():
        try:
            json.dumps(value, allow_nan=False)
        except Exception:
            # Whatever it is that its class, or a thread that changes it meanwhile, raises.
            continue
        part[key] = value
    return part


class TransitionFeed:
    """Brings a root's transitions to a consumer on a thread of its own.

    Args:
        machine: The root.
        consume: Takes each `Transition`, in order, on the feed's thread.
        changed: Told the path of each container that begins or goes on, that asks a person or has
            an answer, and of the root when that has ended; in order with the transitions.
    """

    def __init__(
        self,
        machine: Container,
        consume: Callable[[Transition], object],
        changed: Callable[[str], object] = lambda _path: None,
    ) -> None:
        self._consume = consume
        self._changed = changed
        # An event among the transitions is set by whoever comes to it.
        self._queue: SimpleQueue[RawTransition | threading.Event] = SimpleQueue()
        self._lost: deque[None] = deque()
        self._visits: dict[tuple[str, str], int] = {}
        self._entered: dict[str, float] = {}
        self._sequence = 0
        self._closing = False
        self._thread = threading.Thread(target=self._run, name='fsm transitions', daemon=True)
        self._thread.start()
        self._end_reports = machine.control.add_trace(self._take)

    def _take(self, raw: RawTransition) -> None:
        # Several threads may come here at once: each of these is one step.
        queue = self._queue
        queue.put(raw)
        if queue.qsize() > QUEUE_LENGTH:
            with suppress(Empty):
                oldest = queue.get_nowait()
                if isinstance(oldest, threading.Event):
                    queue.put(oldest)
                elif unfold(oldest).is_transition:
                    self._lost.append(None)

    def flush(self, timeout: float | None = None) -> bool:
        """Wait until everything so far has been consumed; tells whether that was in time."""
        consumed = threading.Event()
        self._queue.put(consumed)
        return consumed.wait(timeout)

    def close(self, timeout: float = 5.0) -> None:
        """Stop reporting, consume what is left and end the thread."""
        self._end_reports()
        self._closing = True
        self._queue.put(threading.Event())
        self._thread.join(timeout)

    def _run(self) -> None:
        while True:
            raw = self._queue.get()
            if isinstance(raw, threading.Event):
                raw.set()
            else:
                try:
                    self._tell(unfold(raw))
                except Exception as error:
                    logerr(f'Reporting a transition raised {describe(error)}')
            if self._closing and self._queue.empty():
                return

    def _tell(self, noted: Noted) -> None:
        while self._lost:
            # What was lost leaves a gap.
            self._lost.pop()
            self._sequence += 1
        if noted.kind == 'entered':
            self._entered[noted.path] = noted.time
            return
        if noted.kind in ('end', 'question'):
            self._changed(noted.path)
            return
        place = (noted.path, noted.target)
        visits = self._visits[place] = self._visits.get(place, 0) + 1
        since = self._entered.get(noted.path, noted.time)
        if noted.kind != 'ended':
            self._entered[noted.path] = noted.time
        if noted.kind == 'start':
            self._changed(noted.path)
            return
        self._sequence += 1
        self._consume(
            Transition(
                self._sequence,
                noted.time,
                noted.path,
                noted.source,
                noted.outcome,
                noted.target,
                noted.kind,
                noted.time - since,
                visits,
                presentable(noted.userdata),
            )
        )
