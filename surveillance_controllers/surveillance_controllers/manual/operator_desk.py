"""Requests that wait for an operator: each is announced, shown on demand, and answered by a
console command.

A worker thread that carries out an action calls `OperatorDesk.ask` and sleeps until somebody
answers or its goal is interrupted. The console's thread calls `OperatorDesk.answer`. Requests are
answered in the order in which they came.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from surveillance_controllers.manual.console_commands import CommandError

Answer = TypeVar('Answer')


class Interruption(Protocol):
    """A flag that calls back when it is raised, as `surveillance_runtime.waiting.Interrupt`
    does."""

    def is_set(self) -> bool:
        """Tells whether the flag is raised."""

    def subscribe(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Has `callback` called when the flag is raised (at once if it is); returns what undoes
        that."""


@dataclass(eq=False)
class _Request(Generic[Answer]):
    description: str
    answered: threading.Event = field(default_factory=threading.Event)
    answer: Answer | None = None


class OperatorDesk(Generic[Answer]):
    """The requests that wait for the operator of one controller.

    Args:
        announce: Shows the operator a text of one or more lines.
    """

    def __init__(self, announce: Callable[[str], None]) -> None:
        self._announce = announce
        self._lock = threading.Lock()
        self._waiting: list[_Request[Answer]] = []

    @property
    def status(self) -> str:
        """What waits at the moment, in words."""
        with self._lock:
            waiting = [request.description for request in self._waiting]
        return '\n'.join(waiting) if waiting else 'No request is waiting.'

    def ask(self, description: str, interruption: Interruption) -> Answer | None:
        """Waits until the operator answers.

        Args:
            description: What is asked, shown to the operator: lines of text.
            interruption: Ends the wait; the operator is told.

        Returns:
            The answer, or None when the wait was interrupted.
        """
        request: _Request[Answer] = _Request(description)
        with self._lock:
            self._waiting.append(request)
        self._announce(description)
        unsubscribe = interruption.subscribe(request.answered.set)
        try:
            request.answered.wait()
        finally:
            unsubscribe()
            with self._lock:
                withdrawn = request in self._waiting
                if withdrawn:
                    self._waiting.remove(request)
        if withdrawn:
            self._announce('The request was withdrawn: ' + description.partition('\n')[0])
            return None
        return request.answer

    def answer(self, answer: Answer) -> None:
        """Answers the request that has waited longest.

        Raises:
            CommandError: No request is waiting.
        """
        with self._lock:
            if not self._waiting:
                raise CommandError('no request is waiting: expected one before this command')
            request = self._waiting.pop(0)
        request.answer = answer
        request.answered.set()
