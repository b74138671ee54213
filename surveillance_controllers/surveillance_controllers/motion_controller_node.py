"""The node `motion_controller`: moves the robot.

Actions: `follow_path` along a path, and `motion/controller` through via points into a place. How
the robot moves is the execution mode's matter: as the operator says (MANUAL), by chance (RANDOM),
or as the base drives (SIMULATED and ROBOT). It publishes the place that the robot is in as
`robot_place` and writes it into the ontology.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TextIO

from lidar_navigation import geometry
from lidar_navigation.geometry import Points
from state_machines.ros import GoalAbortedError, GoalRun, GoalServer
from surveillance_controllers import conversions, stimuli
from surveillance_controllers.controller_parameters import motion_settings
from surveillance_controllers.manual import commands
from surveillance_controllers.manual.commands import MOTION, ParsedCommand
from surveillance_controllers.manual.requests import CommandConsole
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import BaseMotion, MotionFailedError, place_reached
from surveillance_controllers.motion.holding import Hold
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_controllers.stimuli import glide
from surveillance_interfaces.action import Control, FollowPath
from surveillance_ontology.patrol_vocabulary import OntologyNotReadyError
from surveillance_runtime.conversions import FARTHEST, point_message
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node


class MotionController(PatrolNode):
    """Moves the robot along paths.

    Args:
        console_source: Where the operator's lines come from; standard input unless given.
    """

    def __init__(self, console_source: TextIO | None = None, **node_options: Any) -> None:
        super().__init__('motion_controller', **node_options)
        self._settings = motion_settings(self)
        self._mode = self._settings.execution_mode
        self._draw = stimuli.generator(self._settings.random_seed)
        self._knowledge = MapKnowledge(self, self._settings.peer_timeout)
        self._console: CommandConsole[tuple[float, float]] = CommandConsole(
            self, MOTION, self._carry_out
        )
        localises = self._settings.drives and self._settings.navigator == 'own'
        start = None if localises else self._settings.robot_room
        reach = self._settings.place_reach
        state_file = self._settings.state_file
        self._recorder = PlaceRecorder(self, self._knowledge, reach, start, state_file)
        self._robot: BaseMotion | None = None
        if self._settings.drives:
            self._robot = self._make_robot()
        else:
            self._hold = Hold(self)
        GoalServer(self, FollowPath, 'follow_path', self._follow_path)
        GoalServer(self, Control, 'motion/controller', self._control)
        self.get_logger().info(f'{self._mode} mode')
        if self._mode == 'MANUAL' and self._settings.console:
            self._console.open(console_source)

    def _make_robot(self) -> BaseMotion:
        """Return the way to move that the parameters ask for."""
        # Only here, for the libraries behind it take their time to import.
        from surveillance_controllers.motion.docking import DockingMotion
        from surveillance_controllers.motion.nav2 import Nav2Motion
        from surveillance_controllers.motion.navigation_motion import NavigationMotion

        settings = self._settings
        kind = Nav2Motion if settings.navigator == 'nav2' else NavigationMotion
        motion: BaseMotion = kind(self, self._knowledge, self._recorder, settings)
        return motion if settings.docking == 'none' else DockingMotion(self, motion, settings)

    def _carry_out(self, command: ParsedCommand) -> str:
        seconds, delta = command.values
        assert isinstance(seconds, float)
        assert isinstance(delta, float)
        self._console.answer((seconds, delta))
        return f'Moving for {seconds:g} s.'

    def _follow_path(self, goal: Any, run: GoalRun) -> FollowPath.Result:
        def report(position: Points) -> None:
            run.feedback(FollowPath.Feedback(position=point_message(position)))

        path = _checked(goal.path)
        try:
            end = self._move(path, run, report, 'follow a path')
        except MotionFailedError as failure:
            position = point_message(path[0] if failure.end is None else failure.end)
            raise GoalAbortedError(str(failure), FollowPath.Result(position=position)) from failure
        if self._robot is None:
            self._recorder.tell_point(end)
        return FollowPath.Result(position=point_message(end))

    def _control(self, goal: Any, run: GoalRun) -> Control.Result:
        path = _checked(goal.point_set)
        passed = 0

        def report(position: Points) -> None:
            nonlocal passed
            behind = geometry.points_passed(path, geometry.distance_nearest(path, position))
            if behind > passed:
                passed = behind
                point = point_message(path[passed - 1])
                run.feedback(Control.Feedback(reached_point=point))

        end: Points | None = None
        try:
            end = self._move(path, run, report, 'move through via points')
            if not run.interrupt.is_set():
                self._arrive(path[-1], end, run)
        except (MotionFailedError, OntologyNotReadyError) as failure:
            if isinstance(failure, MotionFailedError):
                end = failure.end
            point = point_message(path[0] if end is None else end)
            raise GoalAbortedError(str(failure), Control.Result(reached_point=point)) from failure
        return Control.Result(reached_point=point_message(end))

    def _arrive(self, goal: Points, end: Points, run: GoalRun) -> None:
        """Make sure that the robot is in a place, tell it, and look around there."""
        if self._robot is None:
            places = self._knowledge.places(run.interrupt)
            place = place_reached(places, end, self._settings.place_reach)
        else:
            place = self._robot.place_reached(goal, end)
        self._recorder.tell(place)
        if self._robot is not None:
            self._robot.look_around(run)

    def _paced(self, report: Callable[[Points], None], run: GoalRun) -> Callable[[Points], None]:
        """Return what reports a position once a `feedback_period`: Nav2 tells one a hundred times a
        second.
        """
        told = -math.inf

        def paced(position: Points) -> None:
            nonlocal told
            if not 0 <= run.now() - told < self._settings.feedback_period:
                told = run.now()
                report(position)

        return paced

    def _move(
        self, path: Points, run: GoalRun, report: Callable[[Points], None], what: str
    ) -> Points:
        if self._robot is not None:
            end = self._robot.follow(path, run, self._paced(report, run))
            report(end)
            return end
        if self._mode == 'MANUAL':
            answer = self._console.ask(commands.move_request(what, path), run.interrupt)
            if answer is None:
                raise MotionFailedError(f'{what}: withdrawn before the operator answered', None)
            seconds, delta = answer
        else:
            seconds, delta = stimuli.move(self._draw)
        end = stimuli.reached(self._draw, path[-1], delta)
        period = self._settings.feedback_period
        return glide(path, seconds, end, run, report, period, lambda: self._hold.active)


def _checked(points: Sequence[Any]) -> Points:
    """Return the points of a goal as an array; aborts the goal when it has none that can be
    followed.
    """
    path = conversions.array_from_points(points)
    if len(path) == 0:
        raise GoalAbortedError('no points, expected at least one')
    for number, point in enumerate(path.tolist(), start=1):
        if not all(abs(coordinate) <= FARTHEST for coordinate in point):
            raise GoalAbortedError(
                f'point {number} is {commands.point(point)}: '
                f'expected finite numbers up to {FARTHEST:g} m'
            )
    return path


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(MotionController, args)
