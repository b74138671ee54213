"""The robot's base in MuJoCo: motors, play, wheels that slip, and an odometry that believes them.

The base takes the same commands as `robot.base.Base` and answers the same questions. Its motors
follow the wanted speeds of the wheels with a lag and turn the wheels through a stiff coupling with
play. The odometry counts what the motors turned, with the wheels' nominal size: it sees neither
play nor slip, nor wheels that are larger than they should be.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from floor_plans.shapes import Pose
from surveillance_simulation.optional_mujoco import mujoco
from surveillance_simulation.physics.model import (
    CHASSIS,
    SOLID,
    STEP,
    PhysicsModel,
    compiled,
    require_mujoco,
    standing_at,
)
from surveillance_simulation.robot.base import (
    PUSH_GAP,
    BaseModel,
    bounded,
    following,
    moved,
    wrapped,
)
from surveillance_simulation.world.simulated_place import SimulatedPlace

Floats = npt.NDArray[np.float64]
_STIFFNESS, _DAMPING = 60.0, 0.6
"""Of the coupling between motor and wheel beyond its play, N m / rad and N m s / rad."""
_LOOK_EVERY = 5
"""Contacts are looked for after so many steps."""
_APART = 0.3
"""Who was apart for this long and touches again has run into something again, seconds."""
_SLEEPS_AFTER = 0.5
"""A robot that stands this long is not computed any more until it is told to move, seconds."""
_NORMAL_IS_TOLD = mujoco is not None and 'normal' in str(mujoco.mj_multiRay.__doc__)


class PhysicsBase:
    """The robot's base in MuJoCo; see `robot.base.Base` for what the attributes mean.

    Args:
        world: The place.
        pose: Where the robot stands at first.
        model: Its limits.
        physics: Its body and wheels.
        on_step: Called at most every 10 ms of simulated time while the robot or somebody moves.

    Raises:
        ImportError: MuJoCo is not installed.
    """

    def __init__(
        self,
        world: SimulatedPlace,
        pose: Pose,
        model: BaseModel | None = None,
        physics: PhysicsModel | None = None,
        on_step: Callable[[float], None] = lambda _dt: None,
    ) -> None:
        require_mujoco()
        self.model = model or BaseModel()
        self.physics = physics or PhysicsModel()
        self.odometry = pose
        self.speed = 0.0
        self.turn_speed = 0.0
        self.collisions = 0
        self.travelled = 0.0
        self.on_step = on_step
        self._world = world
        self._wanted = (0.0, 0.0)
        self._since_command = math.inf
        self._ramped = (0.0, 0.0)
        self._motors = [0.0, 0.0]
        """Speeds of the motors, at the wheels, rad/s."""
        self._turned = [0.0, 0.0]
        """How far they have turned, rad."""
        self._apart = _APART
        self._stood = 0.0
        self._left = 0.0
        self._groups = np.array([group == SOLID for group in range(6)], np.uint8)
        self._built: object = None
        self._model: Any = None
        self._data: Any = None
        self._people = 0
        self._put(pose)

    @property
    def pose(self) -> Pose:
        """Where the robot really is: x, y in metres, yaw in rad, world frame."""
        x, y, _, w, i, j, k = self._data.qpos[:7].tolist()
        return x, y, math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))

    @pose.setter
    def pose(self, pose: Pose) -> None:
        self._put(pose)

    @property
    def is_moving(self) -> bool:
        """Whether the base moves, or is told to."""
        return any(self._wanted) or self._stood < _SLEEPS_AFTER

    def command(self, speed: float, turn_speed: float) -> None:
        """Set the wanted velocity: m/s forwards, rad/s anticlockwise; anything not finite is 0."""
        self._wanted = bounded(self.model, speed, turn_speed)
        self._since_command = 0.0
        if any(self._wanted):
            self._stood = 0.0

    def step(self, dt: float) -> None:
        """Move on for `dt` seconds."""
        self._renew()
        self._since_command += dt
        if self._since_command > self.model.command_timeout:
            self._wanted = (0.0, 0.0)
        if not self.is_moving:
            self._place_people()
            mujoco.mj_forward(self._model, self._data)
            self.on_step(dt)
            return
        self._place_people()
        self._left += dt
        while self._left >= STEP - 1e-9:
            count = min(_LOOK_EVERY, max(1, round(self._left / STEP)))
            before = self._data.qpos[:2].copy()
            for _ in range(count):
                self._drive()
                mujoco.mj_step(self._model, self._data)
            self._left -= count * STEP
            way = float(np.hypot(*(self._data.qpos[:2] - before)))
            self.travelled += way
            self._look_for_contact(count * STEP)
            stands = way < 1e-4 and not any(self._ramped) and max(map(abs, self._motors)) < 1e-3
            self._stood = self._stood + count * STEP if stands else 0.0
            self.on_step(count * STEP)

    def push(self, dx: float, dy: float, dyaw: float) -> float:
        """Push the robot sideways, unseen by its wheels, as far as the way is free; metres gone."""
        x, y, yaw = self.pose
        pieces = max(1, math.ceil(math.hypot(dx, dy) / 0.1))
        share = 0.0
        for piece in range(1, pieces + 1):
            part = piece / pieces
            if not self._world.is_free(x + part * dx, y + part * dy, self.model.radius + PUSH_GAP):
                break
            share = part
        self._wanted = self._ramped = (0.0, 0.0)
        self._put((x + share * dx, y + share * dy, wrapped(yaw + dyaw)))
        return math.hypot(dx, dy) * share

    def slip(self, dx: float, dy: float, dyaw: float) -> None:
        """Shift the odometry in the robot's own frame (metres, rad); the robot stays."""
        x, y, yaw = self.odometry
        cos, sin = math.cos(yaw), math.sin(yaw)
        self.odometry = (x + dx * cos - dy * sin, y + dx * sin + dy * cos, wrapped(yaw + dyaw))

    def rays(self, mount: Pose, angles: Floats, furthest: float) -> Floats:
        """Return how far rays go from a lidar at this moment, infinite beyond `furthest`.

        Args:
            mount: Where the lidar is said to sit.
            angles: Directions in the lidar's frame, shape (n,), rad.
            furthest: Metres.

        Returns:
            Shape (n,), metres.
        """
        x, y, yaw = moved_by(mount, self.physics.lidar_offset)
        origin = self._data.xpos[self._body]
        turn = self._data.xmat[self._body].reshape(3, 3)
        start = origin + turn @ np.array([x, y, self.physics.lidar_height])
        flat = np.stack([np.cos(angles + yaw), np.sin(angles + yaw), np.zeros(len(angles))], axis=1)
        count = len(angles)
        hit, away = np.zeros(count, np.int32), np.zeros(count)
        more = {'normal': None} if _NORMAL_IS_TOLD else {}
        mujoco.mj_multiRay(
            m=self._model,
            d=self._data,
            pnt=start,
            vec=np.ascontiguousarray(flat @ turn.T).ravel(),
            geomgroup=self._groups,
            flg_static=True,
            bodyexclude=self._body,
            geomid=hit,
            dist=away,
            nray=count,
            cutoff=furthest,
            **more,
        )
        return np.where((away < 0.0) | (away > furthest), np.inf, away)

    def _drive(self) -> None:
        """Move the motors on by a step, and turn the wheels through their couplings."""
        model, physics, data = self.model, self.physics, self._data
        self._ramped = following(model, self._ramped, self._wanted, STEP)
        speed, turn = self._ramped
        radius, half = physics.wheel_radius, physics.wheel_separation / 2
        share = 1.0 - math.exp(-STEP / physics.motor_lag) if physics.motor_lag else 1.0
        stall = physics.torque / _STIFFNESS + physics.backlash / 2
        turned = [0.0, 0.0]
        for side, sign in ((0, -1.0), (1, 1.0)):
            wanted = (speed + sign * half * turn) / radius
            self._motors[side] += share * (wanted - self._motors[side])
            angle, rate = float(data.qpos[7 + side]), float(data.qvel[6 + side])
            before = self._turned[side]
            gap = before + self._motors[side] * STEP - angle
            # A motor that is too weak stalls.
            gap = min(max(gap, -stall), stall)
            self._turned[side] = angle + gap
            turned[side] = self._turned[side] - before
            beyond = math.copysign(max(abs(gap) - physics.backlash / 2, 0.0), gap)
            torque = _STIFFNESS * beyond
            if beyond:
                torque += _DAMPING * (self._motors[side] - rate)
            data.qfrc_applied[6 + side] = min(max(torque, -physics.torque), physics.torque)
        left, right = (radius * each for each in turned)
        way, turned_by = (left + right) / 2, (right - left) / (2 * half)
        self.odometry = moved(self.odometry, way, turned_by)
        left_speed, right_speed = (radius * each for each in self._motors)
        self.speed = (left_speed + right_speed) / 2
        self.turn_speed = (right_speed - left_speed) / (2 * half)

    def _look_for_contact(self, dt: float) -> None:
        geoms = self._data.contact.geom
        touches = bool(np.isin(geoms, self._chassis).any()) if len(geoms) else False
        if touches and self._apart >= _APART and any(self._ramped):
            self.collisions += 1
        self._apart = 0.0 if touches else self._apart + dt

    def _renew(self) -> None:
        """Build the model anew where doors or things came or went."""
        world = self._world
        people = len(world.bodies)
        now = world.drawn_version, people
        if now == self._built:
            return
        kept = None if self._built is None else (self._data.qpos.copy(), self._data.qvel.copy())
        self._built = now
        self._people = people
        self._model = compiled(world, self.model.radius, self.physics, people)
        self._data = mujoco.MjData(self._model)
        self._body = self._model.body('robot').id
        names = [self._model.geom(each).name for each in range(self._model.ngeom)]
        self._chassis = [i for i, name in enumerate(names) if name.startswith(CHASSIS)]
        if kept is not None:
            self._data.qpos[:], self._data.qvel[:] = kept
        self._place_people()
        mujoco.mj_forward(self._model, self._data)

    def _place_people(self) -> None:
        if not self._people:
            return
        for index, (x, y, radius) in enumerate(self._world.bodies.tolist()):
            body = self._model.body(f'person{index}')
            self._model.geom_size[body.geomadr[0], 0] = radius
            self._model.geom_rbound[body.geomadr[0]] = math.hypot(radius, 1.0)
            self._data.mocap_pos[body.mocapid[0]] = x, y, 0.0

    def _put(self, pose: Pose) -> None:
        """Put the robot somewhere; it stands there."""
        self._renew()
        position, turn = standing_at(pose)
        self._data.qpos[:3], self._data.qpos[3:7] = position, turn
        self._data.qvel[:] = 0.0
        self._turned = self._data.qpos[7:9].tolist()
        self._motors = [0.0, 0.0]
        self._ramped = (0.0, 0.0)
        self.speed = self.turn_speed = 0.0
        self._stood = 0.0
        mujoco.mj_forward(self._model, self._data)


def moved_by(mount: Pose, offset: tuple[float, ...]) -> Pose:
    """Return a mount that is off by x, y, yaw in its own frame's parent."""
    return mount[0] + offset[0], mount[1] + offset[1], mount[2] + offset[2]
