"""Driving along a path with a differential drive: regulated pure pursuit.

The robot steers on the arc to a point of the path some way ahead (pure pursuit, Coulter 1992). Its
speed is regulated as by Macenski et al., "Regulated Pure Pursuit for Robot Path Tracking"
(Autonomous Robots, 2023): slower in tight arcs, near obstacles and towards the end. Two things are
added. How far ahead the point lies follows the path: only as far as the path stays close to the
straight line to it, so that corners are not cut. And the lidar limits the speed so that the robot
always can stop before what it sees on its arc.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lidar_navigation import geometry
from lidar_navigation.footprint import Footprint, poses_on_arc
from lidar_navigation.geometry import Points, Pose, angle_between
from lidar_navigation.robot_base import robot_deceleration, robot_footprint, robot_radius
from strict_files.settings import parameter


@dataclass(frozen=True)
class DriveParameters:
    """The robot's limits and tracking settings.

    Attributes:
        margin: Gap kept between the robot and what the lidar sees, metres.
        acceleration: Of the speed, m/s^2; also with which a drive brakes.
        jerk: Greatest change of the acceleration, m/s^3; only to avoid a contact it brakes at once.
        shortest_look: Least distance of the point steered to, metres.
        longest_look: Greatest distance of the point steered to, metres.
        look_time: The point lies this many seconds ahead at the present speed, within the two.
        deviation: The path may leave the line to the point by this much, metres.
        tight_arc: Arcs of a smaller radius than this are driven slower, metres.
        caution: Where an obstacle is nearer than this to the robot's side, it drives slower,
            metres.
        creep: What regulation does not reduce the speed below, m/s.
        turn_first: Where the point lies further to the side than this, turn on the spot, rad.
        settle: Towards the end the robot goes the remaining way in this time constant, seconds.
        latency: Time between seeing and braking, seconds; two periods of the lidar and a half.
    """

    radius: float = robot_radius()
    footprint: tuple[float, ...] = robot_footprint()
    margin: float = parameter(0.04, 'Kept from what the lidar sees, m.', 0.01, 20.0)
    speed: float = parameter(0.6, 'Top speed, m/s.', 0.01, 20.0)
    turn: float = parameter(1.5, 'Top turning speed, rad/s.', 0.01, 20.0)
    acceleration: float = parameter(0.8, 'Acceleration, m/s^2.', 0.01, 20.0)
    deceleration: float = robot_deceleration()
    turn_acceleration: float = parameter(3.0, 'Turning acceleration, rad/s^2.', 0.01, 20.0)
    jerk: float = 4.0
    shortest_look: float = 0.25
    longest_look: float = 0.8
    look_time: float = 1.2
    deviation: float = 0.05
    tight_arc: float = 0.6
    caution: float = 0.25
    creep: float = 0.1
    turn_first: float = 0.9
    tolerance: float = parameter(0.08, 'The end is reached within this distance, m.', 0.01, 20.0)
    settle: float = 1.0
    latency: float = 0.3

    @cached_property
    def body(self) -> Footprint:
        """The robot's shape."""
        return Footprint(self.radius, self.footprint)


@dataclass(frozen=True)
class Velocity:
    """Speed forwards, m/s, and turning speed anticlockwise, rad/s."""

    speed: float = 0.0
    turn: float = 0.0

    def slowed_to(self, top: float) -> Velocity:
        """Return the velocity on the same arc that is at most so fast, m/s."""
        if abs(self.speed) <= top:
            return self
        share = top / abs(self.speed)
        return Velocity(self.speed * share, self.turn * share)


@dataclass(frozen=True)
class Guidance:
    """What one step of following says.

    Attributes:
        velocity: The velocity to command.
        done: The end of the path is reached.
        blocked: Something seen on the way leaves no room to go on.
        off_path: Distance from the path, metres.
    """

    velocity: Velocity
    done: bool
    blocked: bool
    off_path: float


class PathFollower:
    """Follows one path.

    Args:
        path: Points of shape (n, 2), n of at least 1, metres.
        parameters: The robot's limits and tracking settings.

    Attributes:
        path: Its points that are not all the same, shape (m, 2), metres.
        progress: Way along the path done so far, metres.
        limit: Top speed for the moment, m/s, where that is less than the robot's.
    """

    def __init__(self, path: ArrayLike, parameters: DriveParameters | None = None) -> None:
        self.parameters = parameters or DriveParameters()
        given = np.asarray(path, dtype=float)[:, :2]
        keep = np.concatenate(([True], np.hypot(*np.diff(given, axis=0).T) > 1e-6))
        self.path: Points = given[keep]
        self._along = geometry.distances_along(self.path)
        self._steps = np.diff(self.path, axis=0)
        self._lengths = np.diff(self._along)
        self.progress = 0.0
        self.limit = math.inf
        self._velocity = Velocity()
        self._acceleration = 0.0

    @property
    def length(self) -> float:
        """Length of the path, metres."""
        return float(self._along[-1])

    def step(self, pose: Pose, seen: Points, dt: float) -> Guidance:
        """Decide the velocity for the next moment.

        Args:
            pose: Where the robot is, in the path's frame.
            seen: What the lidar sees, points in the robot's frame, shape (n, 2), metres.
            dt: Time since the last step, seconds.
        """
        p = self.parameters
        position = np.array(pose[:2])
        off_path = self._project(position)
        remaining = self._remaining(position)
        if remaining == 0.0:
            return self._end(off_path)
        target = self._target(position)
        bearing = math.atan2(target[1] - pose[1], target[0] - pose[0])
        side = angle_between(pose[2], bearing)
        if abs(side) > p.turn_first:
            speed, turn = self._turn(side, seen, dt)
            stuck = turn == 0.0 and self._velocity.turn == 0.0
            return self._guide(speed, turn, stuck, off_path, dt)
        distance = max(math.dist(target, position), 1e-6)
        curvature = 2 * math.sin(side) / distance
        wanted = min(
            p.speed,
            self.limit,
            math.sqrt(2 * p.acceleration * max(remaining, 0.0)),
            max(remaining / p.settle, p.creep),
        )
        if abs(curvature) * p.tight_arc > 1:
            wanted /= abs(curvature) * p.tight_arc
        beside = float(p.body.gap(*seen.T).min()) if len(seen) else math.inf
        if beside < p.caution:
            wanted *= max(beside, 0.0) / p.caution
        wanted = max(wanted, min(p.creep, self.limit, remaining / max(dt, 1e-6)))
        safe = self._safe_speed(seen, curvature, p.body, math.inf)
        blocked = safe < 0.02
        speed = min(self._sped(min(wanted, safe), dt), safe)
        turn = speed * curvature
        if abs(turn) > p.turn:
            turn = math.copysign(p.turn, turn)
            speed = turn / curvature
        limited = self._ramped(self._velocity.turn, turn, p.turn_acceleration * dt)
        if limited != turn:
            # Until it turns as it should, the robot goes another way than the arc looked at.
            late = abs(turn - limited) / p.turn_acceleration
            speed = self._safely(speed, limited, seen, speed * (late + p.latency))
        return self._guide(speed, limited, blocked, off_path, dt)

    def step_with(
        self,
        choose: Callable[[Points, Velocity], Velocity],
        pose: Pose,
        seen: Points,
        dt: float,
    ) -> Guidance:
        """Follow the path as somebody else chooses, within the robot's limits.

        Args:
            choose: Given the way ahead in the robot's frame, shape (n, 2), at equal distances, and
                the velocity commanded last, returns the velocity to command.
            pose: Where the robot is, in the path's frame.
            seen: What the lidar sees, points in the robot's frame, shape (n, 2), metres.
            dt: Time since the last step, seconds.
        """
        p = self.parameters
        position = np.array(pose[:2])
        off_path = self._project(position)
        if self._remaining(position) == 0.0:
            return self._end(off_path)
        end = min(self.progress + 2.5, self.length)
        count = max(2, math.ceil((end - self.progress) / 0.1) + 1)
        way = self._at(np.linspace(self.progress, end, count)) - position
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        wanted = choose(way @ np.array([[cos, -sin], [sin, cos]]), self._velocity)
        turn = self._ramped(self._velocity.turn, wanted.turn, p.turn_acceleration * dt)
        speed = self._sped(min(max(wanted.speed, -self.limit), self.limit), dt)
        return self._guide(self._safely(speed, turn, seen), turn, False, off_path, dt)

    def _at(self, along: Points) -> Points:
        """Return the points at some ways along the path, shape (n, 2), metres."""
        return np.array([np.interp(along, self._along, axis) for axis in self.path.T]).T

    def _remaining(self, position: Points) -> float:
        """Return how far the end is, metres; 0 when it is reached."""
        p = self.parameters
        to_end = math.dist(self.path[-1], position)
        if to_end <= p.tolerance and self.length - self.progress <= 2 * p.tolerance:
            return 0.0
        return max(self.length - self.progress, to_end)

    def _end(self, off_path: float) -> Guidance:
        self._velocity = Velocity()
        return Guidance(self._velocity, True, False, off_path)

    def _safe_speed(self, seen: Points, curvature: float, body: Footprint, way: float) -> float:
        """Return the speed from which the robot stops before what it sees on an arc, m/s.

        Args:
            seen: Points in the robot's frame, shape (n, 2), metres.
            curvature: Of the arc, 1/m.
            body: The robot's shape.
            way: How much of the arc is looked at, metres; at most what a stop from top speed takes.

        Returns:
            At most the top speed, which also stands for: nothing is on that way.
        """
        p = self.parameters
        # Braking begins after the latency, and counts on less than the full deceleration.
        a, t = 0.8 * p.acceleration, p.latency
        horizon = min(way, p.speed * t + p.speed**2 / (2 * a) + 0.1)
        room = room_ahead(seen, curvature, body, p.margin, horizon)
        return p.speed if room >= horizon else min(p.speed, speed_to_stop(room, a, t))

    def _safely(self, speed: float, turn: float, seen: Points, way: float = math.inf) -> float:
        """Return the speed, or less where the robot could not stop on the arc that this turn
        makes.
        """
        if speed == 0.0:
            return 0.0
        safe = self._safe_speed(*as_forwards(speed, turn, seen, self.parameters.body), way)
        return math.copysign(min(abs(speed), safe), speed)

    def is_clear(self, obstacles: Points, margin: float, ahead: float) -> bool:
        """Tell whether the next part of the path keeps the robot away from obstacles.

        What is nearer already counts only where going on brings it closer.

        Args:
            obstacles: Points of shape (n, 2), metres, in the path's frame.
            margin: What is kept from each, metres.
            ahead: How much of the path is looked at, metres.
        """
        if not len(obstacles):
            return True
        end = min(self.progress + ahead, self.length)
        count = max(2, math.ceil((end - self.progress) / 0.05) + 1)
        way = self._at(np.linspace(self.progress, end, count))
        steps = np.diff(way, axis=0, append=2 * way[-1:] - way[-2:-1])
        poses = np.column_stack([way, np.arctan2(steps[:, 1], steps[:, 0])])
        gaps = self.parameters.body.gap_at(poses, obstacles)
        return bool((gaps >= np.minimum(margin, gaps[0] - 1e-3)).all())

    def halt(self, seen: Points, dt: float) -> Velocity:
        """Brakes to a stand, gently unless something is near.

        Args:
            seen: What the lidar sees, points in the robot's frame, shape (n, 2), metres.
            dt: Time since the last step, seconds.
        """
        p = self.parameters
        turn = self._ramped(self._velocity.turn, 0.0, p.turn_acceleration * dt)
        speed = self._sped(0.0, dt)
        self._take(Velocity(self._safely(speed, turn, seen), turn), dt)
        return self._velocity

    def _guide(
        self, speed: float, turn: float, blocked: bool, off_path: float, dt: float
    ) -> Guidance:
        self._take(Velocity(float(speed), float(turn)), dt)
        return Guidance(self._velocity, False, blocked, off_path)

    def _turn(self, side: float, seen: Points, dt: float) -> tuple[float, float]:
        p = self.parameters
        top = min(p.turn, math.sqrt(2 * p.turn_acceleration * abs(side)))
        wanted = math.copysign(top, side)
        # Braking counts on less than the full deceleration, as for the speed.
        top = safe_turn(wanted, seen, p.body, p.margin, 0.8 * p.turn_acceleration, p.latency)
        wanted = math.copysign(top, wanted)
        turn = self._ramped(self._velocity.turn, wanted, p.turn_acceleration * dt)
        speed = self._sped(0.0, dt)
        return self._safely(speed, turn, seen), turn

    def _sped(self, wanted: float, dt: float) -> float:
        """Return the next speed towards a wanted one, within the limits of acceleration and jerk.

        Args:
            wanted: Speed, m/s.
            dt: Time since the last step, seconds.
        """
        if dt <= 0.0:
            return self._velocity.speed
        p = self.parameters
        gap = wanted - self._velocity.speed
        # So that the acceleration can end where the speed is as wanted.
        top = min(p.acceleration, math.sqrt(2 * p.jerk * abs(gap)))
        acceleration = self._ramped(self._acceleration, math.copysign(top, gap), p.jerk * dt)
        step = acceleration * dt
        if gap * step > 0 and abs(step) > abs(gap):
            return wanted
        speed = self._velocity.speed + step
        # An acceleration that ends does not turn the way around.
        return speed if speed * self._velocity.speed > 0 or speed * wanted > 0 else 0.0

    def _take(self, velocity: Velocity, dt: float) -> None:
        """Remember what is commanded now, and the acceleration that it asks for."""
        if dt > 0.0:
            top = self.parameters.acceleration
            asked = (velocity.speed - self._velocity.speed) / dt
            self._acceleration = min(max(asked, -top), top)
        self._velocity = velocity

    @staticmethod
    def _ramped(now: float, wanted: float, change: float) -> float:
        return now + min(max(wanted - now, -change), change)

    def _project(self, position: Points) -> float:
        """Move the progress to the nearest point of the path ahead; return the distance to it."""
        if len(self.path) == 1:
            return float(np.hypot(*(self.path[0] - position)))
        # Only a window: where a path comes back past itself, the near leg ahead must not be taken.
        window = self.progress + 2 * self.parameters.longest_look
        first = max(0, int(np.searchsorted(self._along, self.progress, side='right')) - 1)
        last = min(len(self.path) - 1, int(np.searchsorted(self._along, window)))
        last = max(last, first + 1) if first + 1 < len(self.path) else first
        if last == first:
            first -= 1
        (x, y), (dx, dy) = self.path[first:last].T, self._steps[first:last].T
        begin, lengths = self._along[first:last], self._lengths[first:last]
        along = begin + ((position[0] - x) * dx + (position[1] - y) * dy) / lengths
        along = np.maximum(along, np.maximum(begin, self.progress))
        along = np.minimum(along, np.minimum(begin + lengths, window))
        share = (along - begin) / lengths
        gaps = np.hypot(x + share * dx - position[0], y + share * dy - position[1])
        nearest = int(np.argmin(gaps))
        self.progress = float(max(self.progress, min(along[nearest], self.length)))
        return float(gaps[nearest])

    def _target(self, position: Points) -> Points:
        p = self.parameters
        look = min(max(self._velocity.speed * p.look_time, p.shortest_look), p.longest_look)
        ahead = self._at(self.progress + look * np.arange(9) / 8)
        first = max(1, math.ceil(8 * p.shortest_look / look))
        for index in range(8, first, -1):
            line = ahead[index] - position
            between = ahead[1:index] - position
            across = np.abs(line[0] * between[:, 1] - line[1] * between[:, 0])
            if (across <= p.deviation * max(math.hypot(*line), 1e-9)).all():
                return np.asarray(ahead[index])
        return np.asarray(ahead[first])


def speed_to_stop(room: float, deceleration: float, latency: float) -> float:
    """Return the speed from which the robot stops within some room, m/s.

    Args:
        room: Metres, 0 or more.
        deceleration: With which it brakes, m/s^2.
        latency: Seconds until it begins to brake.
    """
    lost = deceleration * latency
    return max(0.0, math.sqrt(lost**2 + 2.0 * deceleration * room) - lost)


def as_forwards(
    speed: float, turn: float, seen: Points, body: Footprint
) -> tuple[Points, float, Footprint]:
    """Return what is seen, the curvature of the arc and the shape, as of a robot that drives
    forwards.

    One that drives backwards does so in a frame that is turned round: what is seen lies on the
    other side, and it turns to the same one.

    Args:
        speed: m/s, not 0.
        turn: rad/s.
        seen: Points in the robot's frame, shape (n, 2), metres.
        body: The robot's shape.
    """
    if speed > 0.0:
        return seen, turn / speed, body
    return -seen, turn / -speed, body.turned_round


def room_ahead(
    seen: Points, curvature: float, body: Footprint, margin: float, horizon: float
) -> float:
    """Return how far the robot can go on an arc before a point comes within a margin of it.

    A point that is nearer already only counts where going on brings it closer, so that a robot that
    stands too near to something can leave it.

    Args:
        seen: Points in the robot's frame, shape (n, 2), metres.
        curvature: Of the arc, positive to the left, 1/m.
        body: The robot's shape.
        margin: Kept free around it, metres.
        horizon: Longest way looked at, metres.

    Returns:
        Metres along the arc, at most `horizon`.
    """
    if not len(seen):
        return horizon
    reach = body.circumscribed + margin
    x, y = np.abs(seen.T)
    near = seen[(x <= horizon + reach) & (y <= horizon + reach)]
    if not len(near):
        return horizon
    count = math.ceil(horizon / 0.04)
    if not body.is_round:
        # Its corners swing out.
        count = max(count, math.ceil(min(horizon * abs(curvature), math.pi) / 0.1))
    way = np.linspace(0.0, horizon, max(2, count) + 1)
    # Beyond a half turn the robot comes back; it will not go that far on one arc.
    arc = poses_on_arc(curvature, way[np.abs(way * curvature) <= math.pi])
    at = _first_contact(body.gap_at(arc, near), margin)
    return horizon if at is None else float(at * way[1])


def safe_turn(
    turn: float, seen: Points, body: Footprint, margin: float, deceleration: float, latency: float
) -> float:
    """Return how fast the robot may turn on the spot, rad/s, at most as wanted; 0 or more.

    A round robot that turns touches nothing. Of another one the corners swing out: it may turn as
    fast as it can still stop before a point comes within a margin of it.

    Args:
        turn: What is wanted, rad/s, anticlockwise.
        seen: Points in the robot's frame, shape (n, 2), metres.
        body: The robot's shape.
        margin: Kept free around it, metres.
        deceleration: With which it stops turning, rad/s^2.
        latency: Seconds until it begins to.
    """
    wanted = abs(turn)
    if body.is_round or not wanted or not len(seen):
        return wanted
    near = seen[np.hypot(*seen.T) <= body.circumscribed + margin]
    if not len(near):
        return wanted
    horizon = wanted * latency + wanted**2 / (2.0 * deceleration)
    angles = np.linspace(0.0, horizon, max(2, math.ceil(horizon / 0.04)) + 1)
    poses = np.column_stack([np.zeros((len(angles), 2)), math.copysign(1.0, turn) * angles])
    at = _first_contact(body.gap_at(poses, near), margin)
    if at is None:
        return wanted
    return min(wanted, speed_to_stop(float(at * angles[1]), deceleration, latency))


def _first_contact(gap: Points, margin: float) -> float | None:
    """Return at which step a point first comes within a margin, between two of them linearly.

    Args:
        gap: From the robot to each point with each step, shape (steps, points), metres.
        margin: Metres; of a point that is nearer at first, only coming nearer counts.
    """
    hit = gap < np.minimum(margin, gap[0] - 1e-3)
    hit[0] = False
    blocked = hit.any(axis=1)
    if not blocked.any():
        return None
    index = int(np.argmax(blocked))
    before, after = gap[index - 1, hit[index]], gap[index, hit[index]]
    bound = np.minimum(margin, gap[0, hit[index]])
    share = np.clip((before - bound) / np.maximum(before - after, 1e-9), 0.0, 1.0).min()
    return float(index - 1 + share)
