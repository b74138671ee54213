"""Which sensor a robot that drives by it does not hear any more: an incident that names it.

What never came is told by `graph_check.InputWatch`, with what is there instead; each has one
incident.
"""

from __future__ import annotations

from surveillance_runtime.incidents import Incidents, Severity

SILENT_AFTER = 8.0
"""Seconds of real time without a message after which somebody is told; a node that is started
again is there before."""


class SilenceWatch:
    """Begins an incident for a topic that falls silent, and ends it when that speaks.

    Args:
        incidents: Where it is told.
    """

    def __init__(self, incidents: Incidents) -> None:
        self._incidents = incidents
        self._heard: dict[str, float] = {}
        self._silent: set[str] = set()

    def hear(self, topic: str, now: float) -> None:
        """Take that a message of a topic came, at a steady time, seconds."""
        self._heard[topic] = now
        if topic in self._silent:
            self._silent.discard(topic)
            self._incidents.end(('topic', topic), f'{topic} is published again')

    def look(self, now: float) -> None:
        """Look which topics are silent."""
        for topic, at in self._heard.items():
            if now - at < SILENT_AFTER or topic in self._silent:
                continue
            self._silent.add(topic)
            self._incidents.begin(
                ('topic', topic),
                f'nothing is published on {topic}: the robot cannot drive',
                Severity.ALARM,
            )
