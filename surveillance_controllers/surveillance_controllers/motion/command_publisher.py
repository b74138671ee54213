"""Publishes velocity commands, limited by the age of what the robot's sensors told.

A new command goes out at once. When a message is overdue, the last command goes out again and
again, slower each time, until the robot stands: a robot that sees nothing stands.

From speed v the base stands after v / a seconds. Messages that come on time, or a little late,
leave the speed as it is: it falls from the moment at which the base must brake so that it stands
`STANDSTILL` seconds after the first message that did not come. Where nothing was seen ahead, and
scans alone are late, the robot may take longer, up to `longest_silence` (`blind_time`): its speed
falls later, and by the age of what it saw. The period of the messages is what they themselves show.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Iterable

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped

from lidar_navigation import Footprint, Velocity
from lidar_navigation.driving.path_following import as_forwards, room_ahead
from lidar_navigation.geometry import Points
from surveillance_controllers import conversions
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.profile.parameters import CommandSettings

WATCH_PERIOD = 0.01
"""Time between two commands of a robot that is stopped, seconds."""
BRAKING_STEPS = 20
"""In so many steps a robot is stopped that may take longer."""
STANDSTILL = 0.3
"""The robot stands this long after the first message that did not come, seconds, where something
was near."""
LONGEST_SILENCE = 1.0
"""It stands this long after it, seconds, where nothing was ahead. (`source_timeout` of Nav2's
collision monitor is 1 to 5 s, at full speed until then.)"""
LATENCY = 0.15
"""Time between seeing and braking, seconds: a period of the lidar and a half."""
WALKING = 1.0
"""So fast may come towards a robot what it does not see, m/s."""
REACTION = 0.05
"""Time between a decision and the base's obedience, seconds."""
LEAD = 0.1
"""A command to brake is for this much later, seconds: a base that waits for a late one loses time
that it cannot make up, since it brakes as hard as it can."""
LATE = 0.01
"""Messages that are late by this slow no robot down, seconds."""
LONGEST_PERIOD = 0.25
"""A sensor that is slower than this lets the robot drive slowly, or not at all; seconds."""
TELL_AGAIN = 10.0
"""A topic that falls silent again and again is told of once in this time, seconds."""
_COUNT = 10
"""Intervals of which the period is the mean."""


def blind_time(
    velocity: Velocity,
    seen: Points,
    body: Footprint,
    margin: float,
    longest: float = LONGEST_SILENCE,
) -> float:
    """Return how long after a missed message the robot may take until it stands, seconds.

    It is the time to a collision with the nearest thing ahead, if that walks towards the robot.
    Ahead is also what stands so near beside the arc that it may step onto it within `STANDSTILL`.

    Args:
        velocity: With which the robot drives.
        seen: What was seen last, robot's frame, shape (n, 2), metres.
        body: The robot's shape.
        margin: Kept free around it, metres.
        longest: Never longer than this, seconds.
    """
    shortest = min(STANDSTILL, longest)
    if velocity.speed == 0.0 or longest == shortest:
        return shortest  # a turn on the spot overshoots
    closing = abs(velocity.speed) + WALKING
    horizon = closing * (longest + LATENCY)
    margin += WALKING * STANDSTILL
    # What is as near already counts, too: `room_ahead` lets a robot leave it.
    if (body.gap_at(np.zeros((1, 3)), seen) <= margin).any():
        return shortest
    forwards = as_forwards(velocity.speed, velocity.turn, seen, body)
    room = room_ahead(*forwards, margin, horizon)
    return min(longest, max(shortest, room / closing - LATENCY))


class SensorAge:
    """The age of the messages of some topics, and the speed that it leaves.

    Args:
        topics: All of them have to be heard.
        deceleration: With which the base brakes when it must, m/s^2.
        standstill: The robot stands this long after the first message that did not come, seconds.
        commands: The one of them that wants the speed; the others see.
    """

    def __init__(
        self,
        topics: Iterable[str],
        deceleration: float,
        standstill: float = STANDSTILL,
        commands: str = '',
    ) -> None:
        self._commands = commands
        self._deceleration = deceleration
        self._standstill = standstill
        self._heard = {topic: (-math.inf, deque([0.1], _COUNT)) for topic in topics}
        self._stands_at = dict.fromkeys(self._heard, -math.inf)

    def hear(self, topic: str, now: float) -> None:
        """Note a message of a topic that came now, seconds."""
        before, intervals = self._heard[topic]
        # Whoever drives by what is late now repeats its commands: that is not their period.
        repeated = topic == self._commands and self.is_blind(now)
        if before <= now <= before + LONGEST_PERIOD + self._standstill and not repeated:
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

    def is_blind(self, now: float) -> bool:
        """Tell whether what sees, not only a command, is overdue by more than a little."""
        sees = (at for topic, at in self._stands_at.items() if topic != self._commands)
        return now > min(sees, default=math.inf) - self._standstill + LATE

    @property
    def top_speed(self) -> float:
        """The highest speed, m/s, while every message comes at most `LATE` seconds too late."""
        return max(0.0, self._deceleration * (self._standstill - REACTION - LATE))

    def seconds_to_brake(self, speed: float, now: float) -> float:
        """Return after how long a robot of some speed, m/s, must brake if nothing is heard."""
        return self.left(now)[0] - REACTION - abs(speed) / self._deceleration

    def share(self, speed: float, now: float, more: float = 0.0) -> float:
        """Return the part of a wanted speed that the robot may drive with, 0 to 1.

        Args:
            speed: The wanted one, m/s.
            now: Seconds.
            more: The robot may take so much longer until it stands, seconds: for half of that it
                drives on, in the other half it slows down.
        """
        left = self.left(now)[0] - REACTION + more
        braking = abs(speed) / self._deceleration + more / 2
        if left <= 0.0:
            return 0.0
        return 1.0 if left >= braking else left / braking


class CommandPublisher:
    """The only publisher of a node's velocity commands; may be used from any thread.

    Args:
        node: The node that commands.
        topic: Of the commands.
        frame: That the commands are in, the robot's own, where they are stamped.
        heard: Topics without which the robot stands; `hear` is to be told of their messages.
        deceleration: With which the base brakes when it must, m/s^2.
        on_silence: Told the topic for whose silence the robot stands, once until it drives again,
            and not more often than each `TELL_AGAIN`.
        standstill: The robot stands this long after the first message that did not come, seconds.
        patience: Returns the time that a robot with some velocity may take in place of
            `standstill`, by what it saw last, seconds. It is asked when what sees is overdue, and
            may not wait.
        commands: The topic of `heard` by which somebody else commands: where it alone is overdue,
            nobody drives, and the robot may not take longer.

    Attributes:
        wanted: The last command, before it was limited by the age of what was heard.
        topic: The full name of the topic.
        type_name: The type of the commands, `package/Name`.
    """

    def __init__(
        self,
        node: PatrolNode,
        topic: str,
        heard: Iterable[str],
        deceleration: float,
        on_silence: Callable[[str], None],
        standstill: float = STANDSTILL,
        frame: str = '',
        patience: Callable[[Velocity], float] | None = None,
        commands: str = '',
    ) -> None:
        stamped = node.declare_fields(CommandSettings()).command_type == 'TwistStamped'
        self._frame = frame
        self._clock = node.get_clock()
        self._logger = node.get_logger()
        self._on_silence = on_silence
        self._age = SensorAge(heard, deceleration, standstill, commands)
        self._standstill, self._patience = standstill, patience
        # Of what was seen last: how much longer the robot may take, and the speed it had then.
        self._more: float | None = None
        self._top = 0.0
        self._lock = threading.Lock()
        self._publisher = node.create_publisher(TwistStamped if stamped else Twist, topic, 1)
        self._is_stamped = stamped
        self.type_name = f'geometry_msgs/{"TwistStamped" if stamped else "Twist"}'
        self.topic = str(node.resolve_topic_name(topic))
        self._timer = node.create_timer(WATCH_PERIOD, self._limit_again, autostart=False)
        self._silent = ''
        self._told: dict[str, float] = {}
        self.wanted = Velocity()

    def hear(self, topic: str) -> None:
        """Note that a message of a topic has come."""
        with self._lock:
            self._age.hear(topic, self._now())
            if self._more:  # one that begins to stand goes on, until the next command
                self._more = None

    def command(self, velocity: Velocity) -> None:
        """Publish a command as far as the age of what was heard allows it."""
        with self._lock:
            self.wanted, self._more = self.sustained(velocity), None
            now = self._now()
            self._publish(now)
            self._watch(now)

    def sustained(self, velocity: Velocity) -> Velocity:
        """Return the velocity, or less where the robot would brake before each message."""
        top, speed = self._age.top_speed, abs(velocity.speed)
        if speed <= top + 1e-6:
            return velocity
        self._logger.warn(
            f'{speed:.2f} m/s is commanded, {top:.2f} m/s is driven: at a higher speed the robot '
            'could not stop in time with robot_deceleration if its sensors went silent',
            once=True,
        )
        return Velocity(velocity.speed * top / speed, velocity.turn * top / speed)

    def _limit_again(self) -> None:
        with self._lock:
            now = self._now()
            if self._age.share(self.wanted.speed, now) < 1.0:
                self._publish(now)
            self._watch(now)

    def _share(self, now: float) -> float:
        """Return the part of what is wanted that goes out."""
        speed = abs(self.wanted.speed)
        if self._age.share(speed, now) == 1.0:
            self._top = max(self._top, speed) if self._age.is_blind(now) else speed
            return 1.0
        # Whoever commands may brake for the same silence: that is not to count twice.
        top = max(self._top, speed)
        if self._more is None:
            longest = self._standstill
            if self._patience is not None and self._age.is_blind(now):
                # Of the speed it had: slower now, it came nearer all the same.
                faster = top / speed if speed else 1.0
                wanted = Velocity(self.wanted.speed * faster, self.wanted.turn * faster)
                longest = self._patience(wanted)
            self._more = max(0.0, longest - self._standstill)
        # A new command, too, is for a little later: else it would end what the last one began.
        share = self._age.share(top, now + LEAD, self._more)
        return min(1.0, share * top / speed) if speed else share

    def _publish(self, now: float) -> None:
        share = self._share(now)
        limited = Velocity(share * self.wanted.speed, share * self.wanted.turn)
        twist = conversions.twist_from(limited)
        if self._is_stamped:
            message = TwistStamped(twist=twist)
            message.header.stamp, message.header.frame_id = self._clock.now().to_msg(), self._frame
            self._publisher.publish(message)
        else:
            self._publisher.publish(twist)
        silent = self._age.left(now)[1] if share == 0.0 and self.wanted != Velocity() else ''
        if silent and not self._silent:
            told = self._told.get(silent, -math.inf)
            if not told <= now < told + TELL_AGAIN:
                self._told[silent] = now
                self._on_silence(silent)
        self._silent = silent

    def _watch(self, now: float) -> None:
        """Look again when the speed must fall."""
        if self.wanted == Velocity() or self._silent:
            self._timer.cancel()
            return
        wait = self._age.seconds_to_brake(self.wanted.speed, now)
        step = max(WATCH_PERIOD, (self._more or 0.0) / BRAKING_STEPS)
        self._timer.timer_period_ns = int(1e9 * max(wait, step))
        self._timer.reset()

    def _now(self) -> float:
        # What `Clock.now` does, without an object for the time: it is asked for often.
        clock = self._clock.handle
        with clock:
            return float(clock.get_now().nanoseconds) / 1e9
