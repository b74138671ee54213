"""Which topic a robot that drives by its sensors does not hear: an incident that names it."""

from __future__ import annotations

from surveillance_runtime.incidents import Incidents, Severity

TOPICS = ('map', 'odom', 'scan')
"""What a robot needs to know where it is. The map comes once."""
SILENT_AFTER = 8.0
"""Seconds of real time without a message after which somebody is told; a node that is started
again is there before."""


class SilenceWatch:
    """Begins an incident for a topic that is silent, and ends it when that speaks.

    Args:
        incidents: Where it is told.
        now: Steady time, seconds.
    """

    def __init__(self, incidents: Incidents, now: float) -> None:
        self._incidents = incidents
        self._heard = dict.fromkeys(TOPICS, now)
        self._silent: set[str] = set()
        self._map_came = False

    def hear(self, topic: str, now: float) -> None:
        """Take that a message of a topic came."""
        self._heard[topic] = now
        self._map_came = self._map_came or topic == 'map'
        if topic in self._silent:
            self._silent.discard(topic)
            self._incidents.end(('topic', topic), f'{topic} is published again')

    def look(self, now: float) -> None:
        """Look which topics are silent."""
        for topic, at in self._heard.items():
            if now - at < SILENT_AFTER or topic in self._silent:
                continue
            if topic == 'map' and self._map_came:
                continue
            self._silent.add(topic)
            self._incidents.begin(
                ('topic', topic),
                f'nothing is published on {topic}: the robot cannot drive',
                Severity.ALARM,
            )
