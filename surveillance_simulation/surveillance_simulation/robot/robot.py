"""The simulated robot as one: base, lidar, arm and camera in a world, moved on in time."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from surveillance_runtime.place.rooms import Pose
from surveillance_runtime.robot_arm import ARM, Arm, Array
from surveillance_simulation.physics.base import PhysicsBase
from surveillance_simulation.physics.model import PhysicsModel
from surveillance_simulation.physics.sweeping_lidar import SweepingLidar
from surveillance_simulation.robot.arm_motion import ArmMotion
from surveillance_simulation.robot.base import Base, BaseModel
from surveillance_simulation.robot.lidar import LidarModel, Sweep, scan
from surveillance_simulation.world.people import People
from surveillance_simulation.world.walks import Walks
from surveillance_simulation.world.world import World

_PHYSICS_STEP = 0.05
_STATE = ('x', 'y', 'yaw', 'odometry_x', 'odometry_y', 'odometry_yaw', 'time')
"""Names of the numbers of a state: metres, rad, seconds."""


class Robot:
    """The robot in its world.

    Attributes:
        world: The place.
        base: Its wheels.
        lidar: Its lidar, at the middle of the base.
        arm: Its arm's motors.
        walks: The people who walk a given way.
        lens_covered: Whether something covers its camera.
        time: Seconds since the start.
    """

    def __init__(
        self,
        world: World,
        base_model: BaseModel | None = None,
        lidar: LidarModel | None = None,
        arm: Arm = ARM,
        rng: np.random.Generator | None = None,
        people: People | None = None,
        physics: PhysicsModel | None = None,
    ) -> None:
        """Put the robot at its start; without `rng` its sensors have no errors.

        Raises:
            ImportError: There is a `physics`, and MuJoCo, which computes it, is not installed.
        """
        self.world = world
        self.lidar = lidar or LidarModel()
        self.base: Base | PhysicsBase
        self._sweeping: SweepingLidar | None = None
        if physics is None:
            self.base = Base(world, world.plan.start, base_model, rng)
        else:
            self.base = PhysicsBase(world, world.plan.start, base_model, physics)
            self._sweeping = SweepingLidar(self.base, self.lidar, rng)
        self.arm = ArmMotion(arm)
        self.walks = Walks(world)
        self.lens_covered = False
        self.time = 0.0
        self._rng = rng
        self._people = people

    def advance(self, seconds: float) -> None:
        """Move on in time, in steps so short that nothing is driven through."""
        steps = max(1, math.ceil(seconds / _PHYSICS_STEP - 1e-9))
        for _ in range(steps):
            if self._people is not None:
                x, y, _ = self.base.pose
                self._people.step(seconds / steps, (x, y), self.base.model.radius)
                self.world.move_people(self._people.poses)
            if self.walks:
                self.walks.step(seconds / steps, self.base.pose[:2])
            self.base.step(seconds / steps)
        self.time += seconds

    @property
    def is_moving(self) -> bool:
        """Whether the base moves or is told to, the arm moves, or people walk about."""
        walking = self._people is not None or bool(self.walks)
        return self.base.is_moving or self.arm.is_moving(self.time) or walking

    def state(self) -> dict[str, float | str]:
        """Return what must outlive a process: where the robot is, the time, and the closed doors.

        The arm and people who walk at random begin anew; `staging.Stage` keeps what was staged.
        """
        numbers = (*self.base.pose, *self.base.odometry, self.time)
        closed = '\n'.join(sorted(self.world.closed_doors))
        return {
            **dict(zip(_STATE, numbers, strict=True)),
            'closed': closed,
            'collisions': self.base.collisions,
        }

    def restore(self, state: Mapping[str, float | str]) -> bool:
        """Take up a state; return whether it is one that this place can have."""
        try:
            x, y, yaw, *odometry, time = (float(state[name]) for name in _STATE)
            closed = str(state['closed']).splitlines()
            collisions = int(state['collisions'])
        except (KeyError, ValueError, OverflowError):
            return False
        finite = all(map(math.isfinite, (x, y, yaw, *odometry, time)))
        doors = self.world.plan.doors
        if not finite or time < 0.0 or any(door not in doors for door in closed):
            return False
        if not self.world.is_free(x, y, self.base.model.radius):
            return False
        for door in closed:
            self.world.set_door(door, False)
        self.base.pose = (x, y, yaw)
        self.base.odometry = (odometry[0], odometry[1], odometry[2])
        self.base.collisions = collisions
        self.time = time
        return True

    def measure(self, mount: Pose = (0.0, 0.0, 0.0)) -> Sweep | None:
        """Return what a lidar tells now; None where its turn is not complete."""
        if self._sweeping is not None:
            return self._sweeping.measure(mount)
        return Sweep(self.scan(mount), 0.0, 0.0)

    def scan(self, mount: Pose = (0.0, 0.0, 0.0)) -> npt.NDArray[np.float32]:
        """Return the distances of a lidar that sits on the robot somewhere, see `lidar.scan`."""
        if isinstance(self.base, PhysicsBase):
            return self.base.rays(mount, self.lidar.angles, self.lidar.range_max).astype(np.float32)
        x, y, yaw = self.base.pose
        dx, dy, turn = mount
        cos, sin = math.cos(yaw), math.sin(yaw)
        at = (x + cos * dx - sin * dy, y + sin * dx + cos * dy, yaw + turn)
        return scan(self.world, at, self.lidar, self._rng)

    def camera_pose(self) -> Array:
        """Return the transform (4, 4) from the camera's optical frame to the world, metres."""
        x, y, yaw = self.base.pose
        pose = np.eye(4)
        pose[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
        pose[:2, 3] = x, y
        return np.asarray(pose @ self.arm.arm.camera_frame(self.arm.positions(self.time)))
