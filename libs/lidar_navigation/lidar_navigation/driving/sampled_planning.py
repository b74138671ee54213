"""A local planner that samples: around what moves, before it, or out of its way.

Model predictive path integral control (Williams et al., "Information theoretic MPC for model-based
reinforcement learning", ICRA 2017): sequences of velocities are drawn around the last plan, each is
rolled out through the next seconds, priced, and the plan becomes their mean, weighted by their
prices. Prices know the path, what stands (the scan) and what moves (at constant velocity). What
counts against a sequence is to move near somebody, not to stand near: a robot that can do nothing
better stands still. What comes of it is checked once more by itself (`is_safe`).

Everything is in the robot's frame at the moment of planning.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidar_navigation.driving.path_following import DriveParameters, Velocity
from lidar_navigation.geometry import Points
from lidar_navigation.localisation.tracking import Mover

Floats = NDArray[np.float32]

MOVER_RIM = 0.15
"""Points this near to something that moves are its own, metres."""
SLOWER = (1.0, 0.7, 0.4, 0.2)
"""Parts of the planned speed that are tried, so that the robot can stand before anybody."""


@dataclass(frozen=True)
class SamplingParameters:
    """How the planner samples and prices.

    Attributes:
        samples: Sequences drawn in each step.
        steps: Moments of a sequence.
        step: Time between two of them, seconds.
        reverse: Top speed backwards, m/s.
        speed_spread: Standard deviation of the speeds drawn, m/s.
        turn_spread: Of the turning speeds, rad/s.
        temperature: Sequences that cost much more than this above the best do not count.
        reach: Nothing further away than this is looked at, metres.
        cell: Of the grid of distances to what stands, metres.
        gap: Wanted between the robot and what moves, metres;
        gap_growth: it grows with the time ahead, m/s.
    """

    samples: int = 300
    steps: int = 20
    step: float = 0.15
    reverse: float = 0.3
    speed_spread: float = 0.3
    turn_spread: float = 0.6
    temperature: float = 0.3
    reach: float = 3.2
    cell: float = 0.05
    gap: float = 0.15
    gap_growth: float = 0.08


class SampledPlanner:
    """Plans a robot's next seconds again and again.

    Args:
        robot: The robot's limits.
    """

    def __init__(self, robot: DriveParameters) -> None:
        self._robot = robot
        self._parameters = p = SamplingParameters()
        self._rng = np.random.default_rng(0)
        self._plan: Floats = np.zeros((p.steps, 2), np.float32)
        self._ahead = (np.arange(p.steps) + 1.0) * p.step
        # Noise is drawn at a few moments and linear between them: the sequences are smooth.
        knots = np.linspace(0, p.steps - 1, 5)
        self._blend = np.stack(
            [np.interp(np.arange(p.steps), knots, row) for row in np.eye(5)], axis=1
        ).astype(np.float32)

        self._manoeuvres = self._known_manoeuvres()
        # Every 10 cm of its edge is looked at.
        self._edge = robot.body.outline(0.1).astype(np.float32)

    def _known_manoeuvres(self) -> Floats:
        """Return what chance alone seldom draws: stand, back off, swerve; (n, steps, 2)."""
        p, top = self._parameters, self._robot.speed
        known = [np.full((p.steps, 2), 0.0)]
        known += [np.tile([-p.reverse, turn], (p.steps, 1)) for turn in (0.0, 0.5, -0.5)]
        sides = np.repeat(
            [1.0, -1.0, 0.0], [p.steps // 3, p.steps // 3, p.steps - p.steps // 3 * 2]
        )
        for speed in (top, top / 2):
            for turn in (0.6, 1.0, -0.6, -1.0):
                known.append(np.stack([np.full(p.steps, speed), turn * sides], axis=1))
        return np.array(known, np.float32)

    def forget(self) -> None:
        """Begin from nothing, as after a time without planning."""
        self._plan[:] = 0.0

    def step(
        self,
        path: Points,
        seen: Points,
        movers: Sequence[Mover],
        velocity: Velocity,
        dt: float,
    ) -> Velocity:
        """Return the velocity for the next moment.

        From it, the robot can stand before anybody comes whom it moves towards.

        Args:
            path: The way ahead at equal distances, shape (n, 2), n of at least 2, metres.
            seen: What the lidar sees, shape (m, 2), metres.
            movers: What moves.
            velocity: The velocity commanded last.
            dt: Time since the last step, seconds.
        """
        self._shift(dt)
        away = self._away_from(_standing(seen, movers))
        controls = self._drawn(velocity, path)
        prices = self._prices(controls, path, away, movers)
        weights = np.exp(-(prices - prices.min()) / self._parameters.temperature)
        weights /= weights.sum()
        self._plan = np.tensordot(weights, controls, axes=1).astype(np.float32)
        # The mean of two good ways around somebody can be a bad one.
        if self._prices(self._plan[None], path, away, movers)[0] > prices.min() + 2.0:
            self._plan = controls[int(prices.argmin())].copy()
        speed, turn = (float(each) for each in self._plan[0])
        for share in SLOWER:
            slower = Velocity(speed * share, turn)
            if is_safe(slower, movers, self._robot):
                return slower
        return Velocity(0.0, turn)

    def _prices(
        self, controls: Floats, path: Points, away: Floats, movers: Sequence[Mover]
    ) -> Floats:
        """Return what sequences cost, shape (samples,); `away` as of `_away_from`."""
        poses = rolled_out(controls, self._parameters.step)
        return (
            self._of_standing(poses, controls, away)
            + self._of_moving(poses, controls, movers)
            + path_cost(poses, path)
            + price_of_effort(controls)
        )

    def _shift(self, dt: float) -> None:
        p = self._parameters
        moments = np.minimum(np.arange(p.steps) + dt / p.step, p.steps - 1)
        for column in range(2):
            self._plan[:, column] = np.interp(moments, np.arange(p.steps), self._plan[:, column])

    def _pursuit(self, path: Points) -> Floats:
        """Return the velocity that leads back to the path and along it, shape (2,)."""
        robot = self._robot
        look = path[int(np.argmin(np.abs(np.hypot(*path.T) - 0.6)))]
        bearing = math.atan2(look[1], look[0])
        speed = robot.speed * max(math.cos(bearing), 0.0)
        turn = min(max(1.5 * bearing, -robot.turn), robot.turn)
        return np.array([speed, turn], np.float32)

    def _drawn(self, velocity: Velocity, path: Points) -> Floats:
        """Return the sequences of speed and turning speed, shape (samples, steps, 2)."""
        p, robot = self._parameters, self._robot
        spread = np.array([p.speed_spread, p.turn_spread], np.float32)
        noise = self._rng.standard_normal((p.samples, 5, 2), dtype=np.float32) * spread
        controls = np.einsum('sk,nkc->nsc', self._blend, noise)
        half = p.samples // 2
        controls[:half] += self._plan
        controls[half:] += self._pursuit(path)
        controls[: len(self._manoeuvres)] = self._manoeuvres
        controls[len(self._manoeuvres)] = self._plan
        controls[half] = self._pursuit(path)
        last = np.array([velocity.speed, velocity.turn], np.float32)
        change = np.array([robot.acceleration, robot.turn_acceleration], np.float32) * p.step
        low = np.array([-p.reverse, -robot.turn], np.float32)
        high = np.array([robot.speed, robot.turn], np.float32)
        np.clip(controls, low, high, out=controls)
        for moment in range(p.steps):
            np.clip(controls[:, moment], last - change, last + change, out=controls[:, moment])
            last = controls[:, moment]
        return np.asarray(controls, np.float32)

    def _away_from(self, stands: Points) -> Floats:
        """Return how far the cells around the robot are from what stands, metres.

        Returns:
            Shape (side, side), the robot in the middle, rows along y.
        """
        p = self._parameters
        side = 2 * math.ceil(p.reach / p.cell)
        near = stands[(np.abs(stands) < p.reach - p.cell).all(axis=1)]
        column, row = ((near + p.reach) / p.cell).astype(np.intp).T
        open_cells = np.ones((side, side), np.uint8)
        open_cells[row, column] = 0
        return np.asarray(cv2.distanceTransform(open_cells, cv2.DIST_L2, 3) * np.float32(p.cell))

    def _of_standing(self, poses: Floats, controls: Floats, away: Floats) -> Floats:
        """Return what coming near to what stands costs, shape (samples,)."""
        p = self._parameters
        gaps = self._gaps(poses, away)
        moving = np.abs(controls[..., 0]) > 0.02
        touched = (gaps < self._robot.margin + p.cell / 2) & moving
        beside = np.exp(-np.maximum(gaps, 0.0) / 0.1)
        return np.asarray(50.0 * touched.sum(axis=1) + 0.5 * beside.sum(axis=1), np.float32)

    def _gaps(self, poses: Floats, away: Floats) -> Floats:
        """Return how far the robot is from what stands at each pose, shape (samples, steps)."""
        p, body = self._parameters, self._robot.body
        if body.is_round:
            at = np.clip((poses[..., :2] + p.reach) / p.cell, 0, len(away) - 1).astype(np.intp)
            return np.asarray(away[at[..., 1], at[..., 0]] - body.radius)
        cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        least = np.full(poses.shape[:2], np.inf, np.float32)
        for x, y in self._edge:
            column = (poses[..., 0] + cos * x - sin * y + p.reach) / p.cell
            row = (poses[..., 1] + sin * x + cos * y + p.reach) / p.cell
            last = len(away) - 1
            at_row = np.clip(row, 0, last).astype(np.intp)
            at_column = np.clip(column, 0, last).astype(np.intp)
            np.minimum(least, away[at_row, at_column], out=least)
        return least

    def _of_moving(self, poses: Floats, controls: Floats, movers: Sequence[Mover]) -> Floats:
        """Return what moving near to what moves costs, shape (samples,)."""
        p = self._parameters
        price = np.zeros(len(poses), np.float32)
        moving = 0.5 + np.abs(controls[..., 0]) / self._robot.speed
        sooner = np.linspace(1.5, 0.5, p.steps, dtype=np.float32)
        for mover in movers:
            x = np.float32(mover.x) + np.float32(mover.vx) * self._ahead.astype(np.float32)
            y = np.float32(mover.y) + np.float32(mover.vy) * self._ahead.astype(np.float32)
            dx, dy = x - poses[..., 0], y - poses[..., 1]
            if not self._robot.body.is_round:
                dx, dy = _turned_back(dx, dy, poses[..., 2])
            gaps = self._robot.body.gap(dx, dy).astype(np.float32) - np.float32(mover.radius)
            wanted = (p.gap + p.gap_growth * self._ahead).astype(np.float32)
            near = 20.0 * (gaps < wanted) + 2.0 * np.exp(-np.maximum(gaps - wanted, 0) / 0.25)
            price += (near * moving * sooner).sum(axis=1)
        return price


def path_cost(poses: Floats, path: Points) -> Floats:
    """Return what leaving the path costs, less what getting on along it is worth.

    Args:
        poses: Where sequences lead, x, y and yaw, shape (samples, steps, 3).
        path: At equal distances, shape (n, 2), n of at least 2, metres.

    Returns:
        Shape (samples,).
    """
    line = path.astype(np.float32)
    some = poses[:, 1::3, :2]
    gaps = np.hypot(some[..., 0, None] - line[:, 0], some[..., 1, None] - line[:, 1])
    off = gaps.min(axis=2)
    done = gaps[:, -1].argmin(axis=1)
    spacing = float(np.hypot(*(path[1] - path[0])))
    end = np.hypot(*(poses[:, -1, :2] - line[-1]).T)
    ahead = np.diff(line, axis=0, append=2 * line[-1:] - line[-2:-1])
    heading = np.arctan2(ahead[done, 1], ahead[done, 0])
    askew = 1.0 - np.cos(poses[:, -1, 2] - heading)
    # Towards the end of a short path, coming nearer to it counts.
    left = (len(path) - 1 - done) * spacing + off[:, -1] + 0.3 * end
    return np.asarray(1.0 * off.sum(axis=1) + 4.0 * left + askew, np.float32)


def price_of_effort(controls: Floats) -> Floats:
    """Return what driving backwards and changes of the velocity cost, shape (samples,).

    Args:
        controls: Speeds and turning speeds, shape (samples, steps, 2).
    """
    back = np.maximum(-controls[..., 0], 0.0).sum(axis=1)
    rough = np.abs(np.diff(controls, axis=1)).sum(axis=(1, 2))
    return np.asarray(1.5 * back + 0.15 * rough, np.float32)


def _standing(seen: Points, movers: Sequence[Mover]) -> Points:
    """Return the points that belong to nothing that moves, shape (n, 2)."""
    for each in movers:
        gaps = np.hypot(seen[:, 0] - each.x, seen[:, 1] - each.y) - each.radius
        seen = seen[gaps > MOVER_RIM]
    return seen


def _turned_back(x: Any, y: Any, yaw: Any) -> tuple[Any, Any]:
    """Return vectors in the frame of a robot that looks along `yaw`."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return cos * x + sin * y, cos * y - sin * x


def rolled_out(controls: Floats, step: float) -> Floats:
    """Return where sequences of velocities lead, x, y and yaw, shape (samples, steps, 3)."""
    turns = controls[..., 1] * np.float32(step)
    yaw = np.cumsum(turns, axis=1)
    middle = yaw - turns / 2
    ways = controls[..., 0] * np.float32(step)
    x = np.cumsum(ways * np.cos(middle), axis=1)
    y = np.cumsum(ways * np.sin(middle), axis=1)
    return np.stack([x, y, yaw], axis=-1)


def is_safe(
    velocity: Velocity, movers: Sequence[Mover], robot: DriveParameters, gap: float = 0.03
) -> bool:
    """Tell whether the robot will stand before anybody comes within `gap` metres of it.

    Passive safety (Macek, Vasquez, Fraichard, Siegwart, 2009): somebody may walk into a robot that
    stands, or that moves away; it does not move into anybody.

    Args:
        velocity: To be commanded now; the robot brakes after its latency.
        movers: What moves, robot's frame.
        robot: The robot's limits.
        gap: Kept free, metres.
    """
    if not movers or velocity.speed == 0.0:
        return True
    brake = abs(velocity.speed) / robot.acceleration
    times = np.linspace(0.0, robot.latency + brake, 12)
    braking = np.maximum(times - robot.latency, 0.0)
    way = np.minimum(times, robot.latency) + braking - 0.5 * braking**2 / max(brake, 1e-6)
    turn = velocity.turn * way
    x = velocity.speed * way * np.cos(turn / 2)
    y = velocity.speed * way * np.sin(turn / 2)
    towards = math.copysign(1.0, velocity.speed)
    for mover in movers:
        dx = mover.x + mover.vx * times - x
        dy = mover.y + mover.vy * times - y
        gaps = robot.body.gap(*_turned_back(dx, dy, turn)) - mover.radius
        near = gaps < gap
        first = int(near.argmax())
        # Who comes from behind walks into the robot, not the robot into them.
        closing = towards * (dx[first] * math.cos(turn[first]) + dy[first] * math.sin(turn[first]))
        if near[first] and closing > 0:
            return False
    return True
