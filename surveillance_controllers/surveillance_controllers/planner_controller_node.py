"""The node `planner_controller`: computes paths.

Actions: `compute_path` between two points, and `motion/planner` from where the robot is to a place,
as equally spaced via points. What was planned last is on the topic `plan`, latched, for viewers.
Where a path comes from is the execution mode's matter: the operator (MANUAL), chance (RANDOM), or
the map with its walls, doors and obstacles (SIMULATED and ROBOT).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
from nav_msgs.msg import Path

from floor_plans.parameters import AT_STATION
from lidar_navigation import geometry
from lidar_navigation.geometry import Points
from state_machines.ros import GoalAbortedError, GoalRun, GoalServer
from surveillance_controllers import conversions, stimuli
from surveillance_controllers.controller_parameters import PlannerSettings
from surveillance_controllers.manual import commands
from surveillance_controllers.manual.commands import PLANNER, ParsedCommand, Point3
from surveillance_controllers.manual.requests import CommandConsole
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_interfaces.action import ComputePath, Plan
from surveillance_ontology.patrol_vocabulary import OntologyNotReadyError
from surveillance_runtime.conversions import point_messages
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.profile.parameters import declared_frames
from surveillance_runtime.state_topics import OwnedTopic

if TYPE_CHECKING:
    from surveillance_controllers.planning.map_planner import NavigationPlanning


class PlannerController(PatrolNode):
    """Answers where to drive.

    Args:
        console_source: Where the operator's lines come from; standard input unless given.
    """

    def __init__(self, console_source: TextIO | None = None, **node_options: Any) -> None:
        super().__init__('planner_controller', **node_options)
        self._settings = self.declare_fields(PlannerSettings())
        self._mode = self._settings.execution_mode
        self._draw = stimuli.generator(self._settings.random_seed)
        self._knowledge = MapKnowledge(self, self._settings.peer_timeout)
        self._console: CommandConsole[tuple[Point3, ...]] = CommandConsole(
            self, PLANNER, self._carry_out
        )
        self._simulated: NavigationPlanning | None = None
        if self._settings.drives:
            # Only here, for the libraries of the search take their time to import.
            from surveillance_controllers.planning.map_planner import NavigationPlanning

            timeout = self._settings.peer_timeout
            self._simulated = NavigationPlanning(self, self._knowledge, timeout)
        self._frames = declared_frames(self, 'map')
        self._shown = OwnedTopic(self, Path, 'plan')
        GoalServer(self, ComputePath, 'compute_path', self._compute_path)
        GoalServer(self, Plan, 'motion/planner', self._plan)
        self.get_logger().info(f'{self._mode} mode')
        if self._mode == 'MANUAL' and self._settings.console:
            self._console.open(console_source)

    def _carry_out(self, command: ParsedCommand) -> str:
        (points,) = command.values
        assert isinstance(points, tuple)
        self._console.answer(points)
        count = '1 point' if len(points) == 1 else f'{len(points)} points'
        return f'A path with {count} between start and goal.'

    def _compute_path(self, goal: Any, run: GoalRun) -> ComputePath.Result:
        start, end = conversions.array_from_points([goal.start, goal.goal])
        path = self._path(start, end, run, 'compute a path')
        self._show(path)
        return ComputePath.Result(path=point_messages(path))

    def _plan(self, goal: Any, run: GoalRun) -> Plan.Result:
        try:
            target = self._knowledge.position(goal.target, run.interrupt)
            start = self._start(goal.target.removesuffix(AT_STATION), run)
        except OntologyNotReadyError as error:
            raise GoalAbortedError(f'no way to {goal.target!r}: {error}') from error
        for what, point in (('the robot', start), (f'place {goal.target!r}', target)):
            if not self._settings.environment.contains(point):
                raise GoalAbortedError(
                    f'{what} is at {commands.point(point)}: expected within '
                    f'environment_size {self._settings.environment}'
                )
        if self._mode == 'RANDOM':
            path = np.array([start, target])
        else:
            path = self._path(start, target, run, f'plan the way to {goal.target}')
        self._show(path)
        spacing = self._settings.spacing(geometry.length(path))
        via_points = point_messages(geometry.equally_spaced(path, spacing))
        for count in range(1, len(via_points) + 1):
            run.feedback(Plan.Feedback(via_points=via_points[:count]))
            if not run.sleep(self._settings.via_point_delay):
                break
        return Plan.Result(via_points=via_points)

    def _show(self, path: Points) -> None:
        stamp = self.get_clock().now().to_msg()
        self._shown.publish(conversions.path_from_array(path, stamp, self._frames.map))

    def _start(self, target: str, run: GoalRun) -> Points:
        if self._simulated is not None:
            return self._simulated.start(target, run)
        place = self._knowledge.robot_place(run.interrupt)
        return self._knowledge.position(place, run.interrupt)

    def _path(self, start: Points, goal: Points, run: GoalRun, what: str) -> Points:
        if not (np.isfinite(start).all() and np.isfinite(goal).all()):
            raise GoalAbortedError(
                f'{what} from {commands.point(start)} to {commands.point(goal)}: '
                'expected finite coordinates'
            )
        if self._simulated is not None:
            return self._simulated.path(start, goal, run, what)
        between: Sequence[Point3] | None
        if self._mode == 'MANUAL':
            text = commands.path_request(what, start, goal)
            between = self._console.ask(text, run.interrupt)
            if between is None:
                raise GoalAbortedError(f'{what}: withdrawn before the operator answered')
        else:
            between = stimuli.via_points(self._draw)
        return np.array([start, *between, goal])


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(PlannerController, args)
