"""The simulated robot as one: base, lidar, arm and camera in a world, moved on in time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from floor_plans.shapes import Pose
from surveillance_runtime.robot_arm import ARM, Arm, Array
from surveillance_simulation.physics.base import PhysicsBase
from surveillance_simulation.physics.model import PhysicsModel
from surveillance_simulation.physics.sweeping_lidar import SweepingLidar
from surveillance_simulation.robot.arm_motion import ArmMotion
from surveillance_simulation.robot.base import Base, BaseModel
from surveillance_simulation.robot.lidar import LidarModel, Sweep, scan
from surveillance_simulation.world.people import People
from surveillance_simulation.world.simulated_place import SimulatedPlace
from surveillance_simulation.world.walks import Walks

PHYSICS_STEP = 0.05
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
        world: SimulatedPlace,
        base_model: BaseModel | None = None,
        lidar: LidarModel | None = None,
        arm: Arm = ARM,
        rng: np.random.Generator | None = None,
        people: People | None = None,
        physics: PhysicsModel | None = None,
        name: str = '',
        start: Pose | None = None,
    ) -> None:
        """Put the robot at its start; without `rng` its sensors have no errors.

        Args:
            world: The place; may hold other robots, see `robots.Robots`.
            base_model: Its base.
            lidar: Its lidar.
            arm: Its arm.
            rng: Source of all errors.
            people: Who walks about.
            physics: How MuJoCo moves it; None: it moves as it is told.
            name: Its name among several robots.
            start: Where it begins; None: where the place says.

        Raises:
            ImportError: There is a `physics`, and MuJoCo, which computes it, is not installed.
        """
        self.world = world
        self.name = name
        start = start or world.plan.start
        self.lidar = lidar or LidarModel()
        self.base: Base | PhysicsBase
        self._sweeping: SweepingLidar | None = None
        if physics is None:
            self.base = Base(world, start, base_model, rng, name)
        else:
            self.base = PhysicsBase(world, start, base_model, physics)
            self._sweeping = SweepingLidar(self.base, self.lidar, rng)
        self.arm = ArmMotion(arm)
        self.walks = Walks(world)
        self.lens_covered = False
        self.time = 0.0
        self._rng = rng
        self._people = people

    def advance(self, seconds: float) -> None:
        """Move on in time, in steps so short that nothing is driven through."""
        steps = max(1, math.ceil(seconds / PHYSICS_STEP - 1e-9))
        for _ in range(steps):
            self.move_people(seconds / steps, [self.base.pose[:2]])
            self.base.step(seconds / steps)
        self.time += seconds

    def move_people(self, seconds: float, robots: Sequence[tuple[float, float]]) -> None:
        """Let people walk on (for at most 0.1 s) around robots at these points, metres."""
        if self._people is not None:
            self._people.step(seconds, robots, self.base.model.radius)
            self.world.move_people(self._people.poses)
        if self.walks:
            self.walks.step(seconds, robots)

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
        except (KeyError, ValueError, TypeError, OverflowError):
            return False
        finite = all(map(math.isfinite, (x, y, yaw, *odometry, time)))
        doors = self.world.plan.doors
        if not finite or time < 0.0 or any(door not in doors for door in closed):
            return False
        if not self.world.is_free(x, y, self.base.model.radius, self.name):
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
        return scan(self.world, at, self.lidar, self._rng, self.name)

    def camera_pose(self) -> Array:
        """Return the transform (4, 4) from the camera's optical frame to the world, metres."""
        x, y, yaw = self.base.pose
        pose = np.eye(4)
        pose[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
        pose[:2, 3] = x, y
        return np.asarray(pose @ self.arm.arm.camera_frame(self.arm.positions(self.time)))
