"""A simulated robot that drives from room to room by the cores alone, on its own clock.

What benchmarks of driving share: one loop of sensing, steering and moving (`look`), and drives to
rooms drawn by chance (`rooms`). What they compare is theirs: they are told of each scan and step.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from lidar_navigation import (
    Drive,
    DriveParameters,
    DriveState,
    GridPlanner,
    Navigator,
    NoPathError,
    PlanningParameters,
    Velocity,
)
from lidar_navigation.geometry import Points, Scan
from surveillance_simulation.robot.robot import Robot

PERIOD = 0.1
"""Seconds between two commands."""
STAY = 20
"""Steps for which it stays where it arrived, as the mission does."""


class DrivenRobot:
    """A robot with its navigator and planner.

    Args:
        robot: It, in its world.
        radius: Of its footprint, for planner and drive, metres; None: the default.
        moved: Called when it has moved, before it senses.
        seen: Told of each scan and its stamp, after the navigator.
        stepped: Called after each step.

    Attributes:
        grid: The map that it drives by.
        steps_ms: Processor time of the navigator for each scan, ms.
    """

    def __init__(
        self,
        robot: Robot,
        radius: float | None = None,
        moved: Callable[[], None] = lambda: None,
        seen: Callable[[Scan, float], None] = lambda scan, stamp: None,
        stepped: Callable[[], None] = lambda: None,
    ) -> None:
        self.robot, self._moved, self._seen, self._stepped = robot, moved, seen, stepped
        self.world = robot.world
        self.grid = self.world.plan.grid()
        doors = {door.name: door.segment for door in self.world.plan.doors.values()}
        planning = PlanningParameters() if radius is None else PlanningParameters(radius=radius)
        self._parameters = DriveParameters() if radius is None else DriveParameters(radius=radius)
        self.planner = GridPlanner(self.grid, planning, doors=doors)
        self.navigator = Navigator(doors)
        self.navigator.set_map(self.grid)
        self.steps_ms: list[float] = []

    def look(self) -> None:
        """Move for one period, sense, and steer by what was sensed."""
        robot, navigator = self.robot, self.navigator
        robot.advance(PERIOD)
        self._moved()
        navigator.move(robot.base.odometry, robot.time)
        told = robot.measure()
        velocity = Velocity()
        if told is not None:
            stamp, angles = robot.time - told.age, robot.lidar.angles
            times = np.arange(len(angles)) * told.duration / len(angles)
            scan = Scan(
                angles,
                np.asarray(told.ranges, float),
                robot.lidar.range_max,
                times=times if told.age else None,
            )
            begun = time.thread_time()
            velocity = navigator.see(scan, stamp) or velocity
            self.steps_ms.append((time.thread_time() - begun) * 1e3)
            self._seen(scan, stamp)
        robot.base.command(velocity.speed, velocity.turn)
        self._stepped()

    def path_to(self, goal: tuple[float, float]) -> Points:
        """Return a path from where the robot believes to be, around what it sees.

        Raises:
            NoPathError: There is none.
        """
        assert self.navigator.pose is not None
        self.planner.set_obstacles(self.navigator.obstacles, self.navigator.obstacles_stay)
        return self.planner.plan(self.navigator.pose[:2], goal)

    def rooms(
        self, rng: np.random.Generator, until: Callable[[], bool]
    ) -> Iterator[tuple[str, Drive | str]]:
        """Drive to rooms drawn by chance, one after the other; look at each step.

        Args:
            rng: Chance.
            until: Whether to end, asked between steps.

        Yields:
            The room, and the drive that ended; or why there was no path at first.
        """
        place = self.world.plan.place
        names = list(place.rooms)
        while not until():
            room = names[int(rng.integers(len(names)))]
            goal = place.positions[room][:2]
            try:
                drive = Drive(self.path_to(goal), self._parameters)
            except NoPathError as error:
                yield room, f'no path: {str(error).split("(")[0]}'
                self.look()
                continue
            self.navigator.task = drive
            while not drive.state.ended and not until():
                self.look()
                if drive.state is DriveState.ASKING:
                    try:
                        drive.new_path(self.path_to(goal))
                    except NoPathError as error:
                        drive.no_path(str(error))
            self.navigator.task = None
            if not drive.state.ended:
                return
            yield room, drive
            for _ in range(STAY):
                self.look()
