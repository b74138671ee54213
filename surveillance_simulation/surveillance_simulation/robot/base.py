"""A round robot on two driven wheels: how it moves, what stops it, and where its odometry has it.

The base follows its velocity command within limits of speed and acceleration, on exact arcs. It is
a disc that nothing passes through: it stops where it touches a wall, and can turn or back away.
Odometry integrates what the wheels did, with errors in proportion to the motion; wheels that spin
against a wall do not count, so a blocked robot does not believe it moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from floor_plans.shapes import Pose
from lidar_navigation.robot_base import robot_deceleration, robot_radius
from strict_files.settings import parameter
from surveillance_simulation.world.simulated_place import SimulatedPlace

_CONTACT = 1e-3
"""Gap that remains between the robot and what it ran into, metres."""

PUSH_GAP = 0.05
"""Gap that a push leaves, metres: more than the robot drives until it has seen what is there."""


@dataclass(frozen=True)
class BaseModel:
    """The base's body, limits and errors.

    Attributes:
        speed: Greatest forward and backward speed, m/s.
    """

    radius: float = robot_radius()
    speed: float = parameter(0.6, 'Greatest speed, m/s.', 0.01, 20.0)
    turn_speed: float = parameter(1.5, 'Greatest turn speed, rad/s.', 0.01, 20.0)
    acceleration: float = parameter(1.0, 'Greatest acceleration, m/s^2.', 0.01, 20.0)
    deceleration: float = robot_deceleration()
    turn_acceleration: float = parameter(4.0, 'Greatest turning acceleration, rad/s^2.', 0.01, 20.0)
    command_timeout: float = parameter(
        0.5, 'Seconds without a command after which the base stops.', 0.01, 20.0
    )
    distance_error: float = parameter(
        0.004, "Standard deviation of the odometry's distance after one metre, metres.", 0.0, 1.0
    )
    turn_error: float = parameter(
        0.003, "Standard deviation of the odometry's heading after one radian, rad.", 0.0, 1.0
    )


def bounded(model: BaseModel, speed: float, turn_speed: float) -> tuple[float, float]:
    """Return a wanted velocity within the base's limits, m/s and rad/s; what is not finite is 0."""
    wanted_speed = speed if math.isfinite(speed) else 0.0
    wanted_turn = turn_speed if math.isfinite(turn_speed) else 0.0
    limit, turn_limit = model.speed, model.turn_speed
    return min(max(wanted_speed, -limit), limit), min(max(wanted_turn, -turn_limit), turn_limit)


def following(
    model: BaseModel, velocity: tuple[float, float], wanted: tuple[float, float], dt: float
) -> tuple[float, float]:
    """Return the velocity after `dt` seconds, m/s and rad/s, within the limits of acceleration.

    The base brakes at most to a stand, then speeds up the other way.
    """
    (speed, turn_speed), (wanted_speed, wanted_turn) = velocity, wanted
    turn_change = model.turn_acceleration * dt
    turn = turn_speed + min(max(wanted_turn - turn_speed, -turn_change), turn_change)
    faster = wanted_speed * speed >= 0.0 and abs(wanted_speed) > abs(speed)
    if faster:
        change = min(abs(wanted_speed - speed), model.acceleration * dt)
        return speed + math.copysign(change, wanted_speed), turn
    goal = wanted_speed if wanted_speed * speed > 0.0 else 0.0
    change = min(abs(goal - speed), model.deceleration * dt)
    return speed + math.copysign(change, goal - speed), turn


class Base:
    """The robot's base in a world.

    Attributes:
        odometry: Where its wheels say it is; equal to the pose at the start.
        speed: Forward speed, m/s.
        turn_speed: Turning speed, rad/s, anticlockwise.
        collisions: How often the robot ran into something by its own motion.
        travelled: Length of the way driven, metres.
    """

    def __init__(
        self,
        world: SimulatedPlace,
        pose: Pose,
        model: BaseModel | None = None,
        rng: np.random.Generator | None = None,
        robot: str = '',
    ) -> None:
        """Put the robot, by its name, into the world; without `rng` the odometry is exact."""
        self.model = model or BaseModel()
        self._robot = robot
        self._world = world
        self.pose = pose
        self.odometry = pose
        self.speed = 0.0
        self.turn_speed = 0.0
        self.collisions = 0
        self.travelled = 0.0
        self._rng = rng
        self._wanted = (0.0, 0.0)
        self._since_command = math.inf
        self._touching = False
        # Nothing solid is nearer than this, so shorter ways need no check.
        self._sure = 0.0
        self._seen_version = -1

    @property
    def pose(self) -> Pose:
        """Where the robot really is: x, y in metres, yaw in rad, world frame."""
        return self._pose

    @pose.setter
    def pose(self, pose: Pose) -> None:
        self._pose = pose
        self._world.move_robot(self._robot, pose[0], pose[1], self.model.radius)

    def command(self, speed: float, turn_speed: float) -> None:
        """Set the wanted velocity: m/s forwards, rad/s anticlockwise; anything not finite is 0."""
        self._wanted = bounded(self.model, speed, turn_speed)
        self._since_command = 0.0

    def step(self, dt: float) -> None:
        """Move on for `dt` seconds (of a size that the robot moves less than its radius in)."""
        self._since_command += dt
        if self._since_command > self.model.command_timeout:
            self._wanted = (0.0, 0.0)
        if not self.is_moving:
            return
        self.speed, self.turn_speed = following(
            self.model, (self.speed, self.turn_speed), self._wanted, dt
        )
        distance, turn = self.speed * dt, self.turn_speed * dt
        reached = self._free_part(distance, turn)
        if reached < 1.0:
            if not self._touching:
                self.collisions += 1
            self._touching = True
            self.speed = 0.0
        elif distance:
            self._touching = False
        self.pose = moved(self.pose, distance * reached, turn * reached)
        if reached < 1.0:
            # A disc that is stopped can still turn on the spot.
            x, y, yaw = self.pose
            self.pose = (x, y, wrapped(yaw + turn * (1.0 - reached)))
            distance *= reached
        self._sure -= abs(distance)
        self.travelled += abs(distance)
        self._count(distance, turn)

    @property
    def is_moving(self) -> bool:
        """Whether the base moves, or is told to."""
        return bool(any(self._wanted) or self.speed or self.turn_speed)

    def push(self, dx: float, dy: float, dyaw: float) -> float:
        """Push the robot sideways, unseen by its wheels, as far as the way is free.

        Who pushes it holds it: it stands until the next command.

        Args:
            dx: Way along the world's x axis, metres.
            dy: Way along the world's y axis, metres.
            dyaw: Turn, rad.

        Returns:
            How far it went, metres.
        """
        x, y, yaw = self.pose
        length = math.hypot(dx, dy)
        pieces = max(1, math.ceil(length / (self.model.radius / 2)))
        gone = 0
        needed = self.model.radius + PUSH_GAP
        for piece in range(1, pieces + 1):
            share = piece / pieces
            if not self._world.is_free(x + share * dx, y + share * dy, needed, self._robot):
                break
            gone = piece
        share = gone / pieces
        self.pose = (x + share * dx, y + share * dy, wrapped(yaw + dyaw))
        self.speed = self.turn_speed = 0.0
        self._wanted = (0.0, 0.0)
        self._sure = 0.0
        return length * share

    def slip(self, dx: float, dy: float, dyaw: float) -> None:
        """Shift the odometry in the robot's own frame (metres, rad); the robot stays."""
        x, y, yaw = self.odometry
        self.odometry = (
            x + dx * math.cos(yaw) - dy * math.sin(yaw),
            y + dx * math.sin(yaw) + dy * math.cos(yaw),
            wrapped(yaw + dyaw),
        )

    def _free_part(self, distance: float, turn: float) -> float:
        """Return the part of a motion, 0 to 1, that ends before the robot touches something."""
        version = self._world.changes_around(self._robot)
        if self._seen_version != version:
            self._seen_version = version
            self._sure = 0.0
        if abs(distance) <= self._sure or not distance:
            return 1.0
        before = self._gap(self.pose)
        if abs(distance) <= before - _CONTACT:
            self._sure = before - _CONTACT
            return 1.0
        after = self._gap(moved(self.pose, distance, turn))
        # Something was put onto the robot: any way that leads out of it is free.
        if after > _CONTACT or after > before:
            return 1.0
        if before <= _CONTACT:
            return 0.0
        low, high = 0.0, 1.0
        for _ in range(12):
            middle = (low + high) / 2
            gap = self._gap(moved(self.pose, distance * middle, turn * middle))
            if gap > _CONTACT:
                low = middle
            else:
                high = middle
        return low

    def _gap(self, pose: Pose) -> float:
        return self._world.clearance(pose[0], pose[1], self._robot) - self.model.radius

    def _count(self, distance: float, turn: float) -> None:
        if self._rng is not None:
            distance += self._rng.normal(0.0, self.model.distance_error * math.sqrt(abs(distance)))
            turn += self._rng.normal(0.0, self.model.turn_error * math.sqrt(abs(turn)))
        self.odometry = moved(self.odometry, distance, turn)


def moved(pose: Pose, distance: float, turn: float) -> Pose:
    """Return the pose after an arc of this length and turn."""
    x, y, yaw = pose
    # The chord of an arc is sinc(turn / 2) times as long and points half way between the ends.
    half = turn / 2
    chord = distance * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    return (
        x + chord * math.cos(yaw + half),
        y + chord * math.sin(yaw + half),
        wrapped(yaw + turn),
    )


def wrapped(angle: float) -> float:
    """Return an angle between -pi and pi, rad."""
    return math.remainder(angle, 2.0 * math.pi)
