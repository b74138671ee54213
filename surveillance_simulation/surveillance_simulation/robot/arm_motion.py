"""The arm's motors: they follow one trajectory at a time, within the joints' limits.

Between two points a joint moves on the cubic that meets their positions and velocities (Hermite's
form, as joint_trajectory_controller does), or on a straight line when no velocities are given. A
new trajectory starts from where the arm is at that moment.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from surveillance_runtime.robot_arm import Arm, Array, TrajectoryPoint


class ArmMotion:
    """The arm's joints in time.

    Attributes:
        arm: The arm that moves.
    """

    def __init__(self, arm: Arm) -> None:
        """Put the arm at rest in its home position."""
        self.arm = arm
        self._times = np.array([0.0])
        self._positions: Array = np.array([arm.home])
        self._velocities: Array | None = None

    def follow(self, names: Sequence[str], points: Sequence[TrajectoryPoint], now: float) -> None:
        """Leave the present trajectory and follow another; without points, stop where it is.

        Args:
            names: The joints that the trajectory moves; the others stay where they are.
            points: Where the joints are to be, by rising time.
            now: Time of the start, seconds.

        Raises:
            ValueError: The arm cannot follow it; see `Arm.check`.
        """
        self.arm.check(names, points)
        start = self.positions(now)
        velocity = self.velocities(now)
        column = [self.arm.names.index(name) for name in names]
        times, positions, velocities = [now], [start], [velocity]
        for point in points:
            row = start.copy()
            row[column] = point.positions
            speed = np.zeros_like(row)
            speed[column] = point.velocities or 0.0
            if point.time == 0.0:
                # The controller's own record of the start; the arm is where it is.
                continue
            times.append(now + point.time)
            positions.append(row)
            velocities.append(speed)
        smooth = bool(points) and all(point.velocities for point in points)
        self._times = np.array(times)
        self._positions = np.array(positions)
        self._velocities = np.array(velocities) if smooth else None

    def positions(self, now: float) -> Array:
        """Return the joints' positions (n,) at a time, rad."""
        return self._at(now)[0]

    def velocities(self, now: float) -> Array:
        """Return the joints' velocities (n,) at a time, rad/s."""
        return self._at(now)[1]

    def is_moving(self, now: float) -> bool:
        """Tell whether the trajectory has not ended."""
        return bool(now < self._times[-1])

    def _at(self, now: float) -> tuple[Array, Array]:
        after = int(np.searchsorted(self._times, now, side='right'))
        if after == 0 or after == len(self._times):
            row = self._positions[min(after, len(self._times) - 1)]
            return row.copy(), np.zeros_like(row)
        span = self._times[after] - self._times[after - 1]
        share = (now - self._times[after - 1]) / span
        first, last = self._positions[after - 1], self._positions[after]
        if self._velocities is None:
            return first + share * (last - first), (last - first) / span
        first_speed, last_speed = self._velocities[after - 1], self._velocities[after]
        square, cube = share**2, share**3
        position = (
            (2 * cube - 3 * square + 1) * first
            + (cube - 2 * square + share) * span * first_speed
            + (3 * square - 2 * cube) * last
            + (cube - square) * span * last_speed
        )
        velocity = (
            6 * (square - share) / span * (first - last)
            + (3 * square - 4 * share + 1) * first_speed
            + (3 * square - 2 * share) * last_speed
        )
        return np.clip(position, self.arm.lower, self.arm.upper), velocity
