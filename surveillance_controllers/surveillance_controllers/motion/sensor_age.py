"""How fast the robot may be by the age of what it saw: a robot that sees nothing stands.

From speed v the base stands after v / a seconds. So that it stands `STANDSTILL` seconds after the
first message that did not come, its speed is at most a (period + STANDSTILL - age): messages that
come on time, or a little late, leave it as it is. The period is what the messages themselves show.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

STANDSTILL = 0.3
"""The robot stands this long after the first message that did not come, seconds."""
REACTION = 0.05
"""Time between a decision and the base's obedience, seconds."""
LEAD = 0.1
"""A command to brake is for this much later, seconds: a base that waits for a late one loses time
that it cannot make up, since it brakes as hard as it can."""
LATE = 0.01
"""Messages that are late by this slow no robot down, seconds."""
LONGEST_PERIOD = 0.25
"""A sensor that is slower than this lets the robot drive slowly, or not at all; seconds."""
_COUNT = 10
"""Intervals of which the period is the mean."""


class SensorAge:
    """The age of the messages of some topics, and the speed that it leaves.

    Args:
        topics: All of them have to be heard.
        deceleration: With which the base brakes when it must, m/s^2.
        standstill: The robot stands this long after the first message that did not come, seconds.
    """

    def __init__(
        self, topics: Iterable[str], deceleration: float, standstill: float = STANDSTILL
    ) -> None:
        self._deceleration = deceleration
        self._standstill = standstill
        self._heard = {topic: (-math.inf, deque([0.1], _COUNT)) for topic in topics}
        self._stands_at = dict.fromkeys(self._heard, -math.inf)

    def hear(self, topic: str, now: float) -> None:
        """Note a message of a topic that came now, seconds."""
        before, intervals = self._heard[topic]
        if before <= now <= before + LONGEST_PERIOD + self._standstill:
            intervals.append(now - before)
        self._heard[topic] = now, intervals
        self._stands_at[topic] = (
            now + min(sum(intervals) / len(intervals), LONGEST_PERIOD) + self._standstill
        )

    def left(self, now: float) -> tuple[float, str]:
        """Return the seconds within which the robot must stand, and the topic they are due to.

        Nothing is left when it should stand already.
        """
        at, topic = min((at, topic) for topic, at in self._stands_at.items())
        return at - now, topic

    @property
    def top_speed(self) -> float:
        """The speed that messages allow which come on time, or `LATE` after that, m/s."""
        return max(0.0, self._deceleration * (self._standstill - REACTION - LATE))

    def seconds_to_brake(self, speed: float, now: float) -> float:
        """Return after how long a robot of some speed, m/s, must brake if nothing is heard."""
        return self.left(now)[0] - REACTION - abs(speed) / self._deceleration

    def share(self, speed: float, now: float) -> float:
        """Return the part of a wanted speed, m/s, that the robot may drive with, 0 to 1."""
        left = self.left(now)[0] - REACTION
        braking = abs(speed) / self._deceleration
        if left <= 0.0:
            return 0.0
        return 1.0 if left >= braking else left / braking
