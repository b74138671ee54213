"""Lidars that turn: each ray of a scan is measured at its own moment while the robot drives on."""

from __future__ import annotations

import numpy as np

from floor_plans.shapes import Pose
from surveillance_simulation.physics.base import Floats, PhysicsBase
from surveillance_simulation.robot.lidar import LidarModel, Sweep

_FORGOTTEN = 1.0
"""A lidar that nobody asked for this long does not turn, seconds."""


class _Turning:
    """One lidar: the turn under way and the last whole one."""

    def __init__(self, rays: int) -> None:
        self.ranges = np.zeros(rays)
        self.done = 0.0
        """The part of the present turn that is measured, 0 to 1."""
        self.whole: Floats | None = None
        self.since_whole = 0.0
        self.unasked = 0.0


class SweepingLidar:
    """The lidars of one robot; those that are asked for turn.

    Args:
        base: The robot.
        model: What each can do.
        rng: Source of the noise; None measures exactly.
    """

    def __init__(
        self, base: PhysicsBase, model: LidarModel, rng: np.random.Generator | None
    ) -> None:
        self._base, self._model, self._rng = base, model, rng
        self._turning: dict[Pose, _Turning] = {}
        base.on_step = self._turn

    def measure(self, mount: Pose) -> Sweep | None:
        """Return the last whole turn of a lidar; None where there is none since the last call."""
        sweep = self._base.physics.sweep
        if not sweep:
            return Sweep(self._told(self._cast(mount, self._model.angles)), 0.0, 0.0)
        turning = self._turning.setdefault(mount, _Turning(self._model.rays))
        turning.unasked = 0.0
        if turning.whole is None:
            return None
        whole, turning.whole = turning.whole, None
        return Sweep(self._told(whole), sweep + turning.since_whole, sweep)

    def _cast(self, mount: Pose, angles: Floats) -> Floats:
        return self._base.rays(mount, angles, self._model.range_max)

    def _told(self, ranges: Floats) -> Floats:
        model = self._model
        if self._rng is not None and model.noise > 0:
            ranges = ranges + self._rng.normal(0.0, model.noise, model.rays)
        ranges = np.where(ranges > model.range_max, np.inf, ranges)
        return np.maximum(ranges, model.range_min)

    def _turn(self, dt: float) -> None:
        """Measure what the lidars passed over during the last `dt` seconds."""
        if not self._turning:
            return
        rays, share = self._model.rays, dt / self._base.physics.sweep
        for mount, turning in list(self._turning.items()):
            turning.unasked += dt
            if turning.unasked > _FORGOTTEN:
                del self._turning[mount]
                continue
            turning.since_whole += dt
            left = min(share, 2.0)
            while left > 1e-9:
                part = min(left, 1.0 - turning.done)
                first, last = (round(rays * each) for each in (turning.done, turning.done + part))
                if last > first:
                    turning.ranges[first:last] = self._cast(mount, self._model.angles[first:last])
                turning.done += part
                left -= part
                if turning.done >= 1.0 - 1e-9:
                    turning.whole, turning.done = turning.ranges.copy(), 0.0
                    turning.since_whole = left * self._base.physics.sweep
