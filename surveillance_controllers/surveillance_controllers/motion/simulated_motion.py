"""Motion for `motion_controller` in SIMULATED mode: the base drives, and the ontology follows
it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from surveillance_controllers import conversions
from surveillance_controllers.geometry.polyline import Points
from surveillance_controllers.geometry.poses import Pose
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import MotionFailed
from surveillance_controllers.motion.driving import Drive, Spin, State
from surveillance_controllers.motion.pilot import Pilot
from surveillance_controllers.motion.place_tracking import PlaceTracking
from surveillance_controllers.motion.robot_base import RobotBase, RobotSilent
from surveillance_controllers.motion.robot_parameters import RobotSettings
from surveillance_controllers.planning.grid_planning import NoPath
from surveillance_interfaces.action import ComputePath
from surveillance_runtime.action_server import GoalRun
from surveillance_runtime.calls import CallError, GoalCaller
from surveillance_runtime.node import PatrolNode


class SimulatedMotion:
    """Drives the base along paths.

    Args:
        node: The motion controller's node.
        settings: The robot, and how long to wait for its sensors and peers.
        knowledge: Map and ontology.
    """

    def __init__(self, node: PatrolNode, settings: RobotSettings, knowledge: MapKnowledge) -> None:
        self._settings = settings
        self._wait_for_peer = settings.peer_timeout
        self._planner = GoalCaller(node, ComputePath, 'compute_path')
        pilot = Pilot(settings.doors, guesses=[settings.station])
        self._base = RobotBase(node, pilot, settings.sensor_timeout, self._on_place)
        self._base.set_positions(settings.positions)
        self._tracking = PlaceTracking(node, self._base, knowledge, settings)

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Drives along a path of shape (n, 3).

        Returns:
            Where the robot is then, shape (3,).

        Raises:
            MotionFailed: It did not get there.
        """
        drive = Drive(path[:, :2], self._settings.drive)
        goal = path[-1]
        told = -np.inf

        def on_step(pose: Pose) -> None:
            nonlocal told
            if not 0 <= run.now() - told < self._settings.feedback_period:
                told = run.now()
                report(_point(pose))

        def another_path(pose: Pose) -> Points:
            return self._ask_planner(_point(pose), goal, run)

        try:
            end = _point(self._base.drive(drive, run.interrupt, on_step, another_path))
        except RobotSilent as error:
            raise MotionFailed(str(error), self._here()) from error
        if drive.state is State.FAILED:
            raise MotionFailed(drive.reason, end)
        report(end)
        return end

    def place_reached(self, goal: Points, end: Points, _run: GoalRun) -> str:
        """The place the robot is in after a drive.

        Args:
            goal: Where the robot should be, shape (3,).
            end: Where it is, shape (3,).
            _run: The goal that is carried out.

        Raises:
            MotionFailed: It is not in the goal's place.
        """
        wanted, place = self._base.place_at(goal), self._base.place_at(end)
        if place is None or place != wanted:
            raise MotionFailed(f'the robot stopped in {place}: expected {wanted}', end)
        return place

    def look_around(self, run: GoalRun) -> None:
        """Turns once on the spot, as the place's exploration asks for.

        Raises:
            MotionFailed: The robot's sensors are silent.
        """
        if self._settings.spin:
            try:
                self._base.spin(Spin(), run.interrupt)
            except RobotSilent as error:
                raise MotionFailed(str(error), self._here()) from error

    def _here(self) -> Points | None:
        pose = self._base.pose
        return None if pose is None else _point(pose)

    def _on_place(self) -> bool:
        self._tracking.wake()
        return self._settings.track_place

    def _ask_planner(self, start: Points, goal: Points, run: GoalRun) -> Points:
        request = ComputePath.Goal(
            start=conversions.point_from(start), goal=conversions.point_from(goal)
        )
        try:
            end = self._planner.run(
                request,
                accept_timeout=self._wait_for_peer,
                result_timeout=self._wait_for_peer,
                interrupt=run.interrupt,
            )
        except CallError as error:
            raise NoPath(str(error)) from error
        if end.status != 'succeeded':
            raise NoPath('the planner finds no other path')
        return conversions.array_from_points(end.result.path)[:, :2]


def _point(pose: Pose) -> Points:
    return np.array([pose[0], pose[1], 0.0])
