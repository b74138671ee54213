"""What is wrong with a node at present, and the figures that it shows."""

from __future__ import annotations

import threading
import time

from diagnostic_msgs.msg import DiagnosticStatus

RECENT = 10.0
"""For how long a lost message or a restart is a warning, seconds."""
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

Finding = tuple[bytes, str]
"""A level and what it is about, in words."""


class Health:
    """What is wrong with a node at present, and its figures; safe from any thread.

    Attributes:
        lost: How many messages were lost to exceptions of callbacks.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._lost_at = -RECENT
        self._lost_by = ''
        self._findings: dict[str, Finding] = {}
        self._figures: dict[str, str] = {}
        self._lock = threading.Lock()

    def warn(self, subject: str, text: str) -> None:
        """Note a warning on a subject, in place of what was noted on it before."""
        self._note(subject, (WARN, text))

    def error(self, subject: str, text: str) -> None:
        """Note that the node cannot do its work until somebody helps."""
        self._note(subject, (ERROR, text))

    def clear(self, subject: str) -> None:
        """Take back what was noted on a subject."""
        with self._lock:
            self._findings.pop(subject, None)

    def figure(self, name: str, value: object) -> None:
        """Note a figure that is shown with the status."""
        with self._lock:
            self._figures[name] = str(value)

    def lose_message(self, why: str) -> None:
        """Count a message that was lost to an exception; it is a warning for a while."""
        with self._lock:
            self.lost += 1
            self._lost_at, self._lost_by = time.monotonic(), why

    def findings(self) -> list[Finding]:
        """Return what is wrong now."""
        with self._lock:
            found = list(self._findings.values())
            if time.monotonic() - self._lost_at < RECENT:
                found.append((WARN, f'a message was lost: {self._lost_by}'))
        return found

    def figures(self) -> dict[str, str]:
        """Return the figures that were noted."""
        with self._lock:
            return {**self._figures, 'lost_messages': str(self.lost)}

    def _note(self, subject: str, finding: Finding) -> None:
        with self._lock:
            self._findings[subject] = finding
