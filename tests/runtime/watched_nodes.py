"""A node whose words about its health are heard."""

from __future__ import annotations

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from surveillance_runtime.diagnostics import DiagnosticsThread
from surveillance_runtime.node import PatrolNode


class Plain(PatrolNode):
    def __init__(self, **options: Any) -> None:
        super().__init__('plain', **options)


class Watched:
    """A node whose health is published often, and what came of it."""

    def __init__(self, graph: Any, namespace: str = '') -> None:
        self.late = 0.0
        self.heard = graph.listen(DiagnosticArray, '/diagnostics')
        self.node = graph.add(Plain, namespace=namespace)
        self.thread = DiagnosticsThread([self.node], lambda: self.late)
        self._graph = graph

    def until(self, level: bytes) -> DiagnosticStatus:
        """Wait for a status of a level."""
        del self.heard[:]
        found = self._graph.until(
            lambda: [each for m in list(self.heard) for each in m.status if each.level == level]
        )
        return found[-1]
