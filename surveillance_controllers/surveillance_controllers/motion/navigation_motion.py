"""Motion for `motion_controller` in SIMULATED mode: the base drives, and `robot_place` follows
it."""

from __future__ import annotations

from collections.abc import Callable

from surveillance_controllers import conversions
from surveillance_controllers.geometry import Points, Pose, point_of
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import MotionFailedError, expect_place
from surveillance_controllers.motion.base_interface import RobotBase
from surveillance_controllers.motion.driving import Drive, Spin, State
from surveillance_controllers.motion.navigator import Navigator
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_controllers.motion.robot_parameters import RobotSettings
from surveillance_controllers.planning.grid_planning import NoPathError
from surveillance_fsm.ros import CallError, GoalCaller, GoalRun
from surveillance_interfaces.action import ComputePath
from surveillance_runtime.conversions import point_message
from surveillance_runtime.node import PatrolNode


class NavigationMotion:
    """Drives the base along paths.

    Args:
        node: The motion controller's node.
        settings: The robot, and how long to wait for its sensors and peers.
        knowledge: Map and ontology.
        recorder: Is told the place that the robot is in.
    """

    def __init__(
        self,
        node: PatrolNode,
        settings: RobotSettings,
        knowledge: MapKnowledge,
        recorder: PlaceRecorder,
    ) -> None:
        self._settings = settings
        self._recorder = recorder
        self._wait_for_peer = settings.motion.peer_timeout
        self._planner = GoalCaller(node, ComputePath, 'compute_path')
        navigator = Navigator(settings.doors, guesses=[settings.motion.station])
        tell = recorder.tell if settings.track_place else lambda _place, _stamp: None
        self._base = RobotBase(
            node,
            navigator,
            settings.sensor_timeout,
            tell,
            settings.lidar_mount,
            settings.drive.deceleration,
            settings.drive.radius,
        )
        self._base.set_positions(settings.positions)
        knowledge.assume(settings.positions)
        # The places that come and go change what the robot's place can be.
        knowledge.follow_places(self._base.set_positions)

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Drive along a path of shape (n, 3).

        Returns:
            Where the robot is then, shape (3,).

        Raises:
            MotionFailedError: It did not get there.
        """
        drive = Drive(path[:, :2], self._settings.drive)
        goal = path[-1]

        def on_step(pose: Pose) -> None:
            report(point_of(pose))

        def another_path(pose: Pose) -> Points:
            return self._ask_planner(point_of(pose), goal, run)

        end = point_of(self._base.drive(drive, run.interrupt, on_step, another_path))
        if drive.state is State.FAILED:
            raise MotionFailedError(drive.reason, end)
        self._recorder.tell(self._base.place_at(end) if self._base.is_sure else None)
        return end

    def place_reached(self, goal: Points, end: Points, _run: GoalRun) -> str:
        """Return the place the robot is in after a drive.

        Args:
            goal: Where the robot should be, shape (3,).
            end: Where it is, shape (3,).
            _run: The goal that is carried out.

        Raises:
            MotionFailedError: It is not in the goal's place.
        """
        if not self._base.is_sure:
            raise MotionFailedError('the robot does not know in which of several places it is', end)
        return expect_place(self._base.place_at(end), self._base.place_at(goal), end)

    def look_around(self, run: GoalRun) -> None:
        """Turn once on the spot, as the place's exploration asks for.

        Raises:
            MotionFailedError: The robot's sensors are silent.
        """
        if self._settings.spin:
            self._base.spin(Spin(), run.interrupt)

    def _ask_planner(self, start: Points, goal: Points, run: GoalRun) -> Points:
        request = ComputePath.Goal(start=point_message(start), goal=point_message(goal))
        try:
            end = self._planner.run(
                request,
                accept_timeout=self._wait_for_peer,
                result_timeout=self._wait_for_peer,
                interrupt=run.interrupt,
            )
        except CallError as error:
            raise NoPathError(str(error)) from error
        if end.status != 'succeeded':
            raise NoPathError('the planner finds no other path')
        return conversions.array_from_points(end.result.path)[:, :2]
