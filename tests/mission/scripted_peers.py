"""Planner and motion controller by script: each goal is answered by the next turn of a list."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import Point

from state_machines.ros import GoalAbortedError, GoalRun, GoalServer
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_interfaces.action import ComputePath, Control, FollowPath, Plan
from surveillance_runtime.node import PatrolNode

GOOD = 'good'
REJECTED, ABORTED, SILENT = 'rejected', 'aborted', 'silent'
EMPTY, ELSEWHERE, NOT_FINITE, SHORT = 'empty', 'elsewhere', 'not finite', 'short'


class ScriptedMotion(PatrolNode):
    """Serves all four actions of planning and moving.

    Args:
        positions: Where the places are, metres.
    """

    def __init__(self, positions: dict[str, list[float]], **options: Any) -> None:
        super().__init__('scripted_motion', **options)
        self.planning: list[str] = []
        self.moving: list[str] = []
        self.played: list[str] = []
        self._lock = threading.Lock()
        self._positions = positions
        self._recorder = PlaceRecorder(self, MapKnowledge(self, 5.0), 2.0, 'E')
        self._at = Point()
        for kind, name, execute, script in (
            (ComputePath, 'compute_path', self._compute_path, self.planning),
            (Plan, 'motion/planner', self._plan, self.planning),
            (FollowPath, 'follow_path', self._follow_path, self.moving),
            (Control, 'motion/controller', self._control, self.moving),
        ):
            GoalServer(self, kind, name, execute, self._accept(script))

    def _accept(self, script: list[str]) -> Callable[[Any], bool]:
        def accept(_goal: Any) -> bool:
            with self._lock:
                rejected = bool(script) and script[0] == REJECTED
                if rejected:
                    self.played.append(script.pop(0))
            return not rejected

        return accept

    def _turn(self, script: list[str], run: GoalRun) -> str:
        with self._lock:
            turn = script.pop(0) if script else GOOD
        self.played.append(turn)
        if turn == ABORTED:
            raise GoalAbortedError('aborted by script')
        if turn == SILENT:
            run.interrupt.wait(30.0)
        return turn

    def _path(self, goal: Point, run: GoalRun) -> list[Point]:
        turn = self._turn(self.planning, run)
        if turn == EMPTY:
            return []
        if turn == ELSEWHERE:
            return [self._at, Point(x=77.0, y=77.0)]
        if turn == NOT_FINITE:
            return [self._at, Point(x=math.nan, y=0.0)]
        return [self._at, Point(x=(self._at.x + goal.x) / 2.0, y=(self._at.y + goal.y) / 2.0), goal]

    def _compute_path(self, goal: Any, run: GoalRun) -> Any:
        self._at = goal.start
        return ComputePath.Result(path=self._path(goal.goal, run))

    def _plan(self, goal: Any, run: GoalRun) -> Any:
        x, y = self._positions[goal.target][:2]
        return Plan.Result(via_points=self._path(Point(x=x, y=y), run))

    def _drive(self, path: list[Point], run: GoalRun) -> Point:
        turn = self._turn(self.moving, run)
        run.sleep(5.0)
        if turn != SHORT:
            self._at = path[-1]
            self._recorder.tell_point(np.array([self._at.x, self._at.y, 0.0]))
        return self._at

    def _follow_path(self, goal: Any, run: GoalRun) -> Any:
        return FollowPath.Result(position=self._drive(goal.path, run))

    def _control(self, goal: Any, run: GoalRun) -> Any:
        return Control.Result(reached_point=self._drive(goal.point_set, run))
