"""Servers of Nav2 that answer as told, with classes that stand in for their types, and a goal's run
whose time passes when somebody sleeps.

nav2_msgs comes with Nav2 and is no wheel; `tests/mission/test_nav2_mission.py` has the types
themselves.
"""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from state_machines import Interrupt
from state_machines.ros import GoalEnd, GoalRun
from surveillance_controllers.motion import nav2 as nav2_motion
from surveillance_controllers.motion import nav2_goals
from surveillance_runtime.node import PatrolNode
from tests.nav2_definitions import ACTIONS, stand_in

PATH = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]])
TYPES = {name: stand_in(name) for name in ACTIONS}


def result(action: str, **fields: Any) -> Any:
    return TYPES[action].Result(**fields)


class Servers:
    """Action servers that answer as told and keep what they were asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Any]] = []
        self.ends: dict[str, Any] = {}
        self.states: dict[str, list[str]] = {}
        self.is_there = True
        self.feedback: list[Any] = []

    def caller(self, _node: Any, _type: Any, name: str) -> Any:
        def run(goal: Any, *, on_feedback: Any = None, **_deadlines: Any) -> GoalEnd:
            self.asked.append((name, goal))
            for message in self.feedback if on_feedback else ():
                on_feedback(message)
            end = self.ends.get(name, GoalEnd('succeeded', SimpleNamespace(success=True)))
            if isinstance(end, list):
                end = end.pop(0) if len(end) > 1 else end[0]
            if isinstance(end, Exception):
                raise end
            return end

        return SimpleNamespace(run=run, is_ready=lambda: self.is_there)

    def states_of(self, _node: Any, _type: Any, name: str) -> Any:
        """Answers get_state of one node of Nav2 by `states`, else as a node that is not there."""
        server = name.partition('/')[0]

        def call(_request: Any, _timeout: float, _interrupt: Any) -> Any:
            states = self.states[server]
            label = states.pop(0) if len(states) > 1 else states[0]
            return SimpleNamespace(current_state=SimpleNamespace(label=label))

        return SimpleNamespace(is_ready=lambda: server in self.states, call=call)

    @property
    def names(self) -> list[str]:
        """What was asked, by the names of the actions."""
        return [name for name, _ in self.asked]


def scripted(monkeypatch: pytest.MonkeyPatch) -> Servers:
    """Have all goals and questions to Nav2 go to servers that answer as told."""
    servers = Servers()
    package, module = ModuleType('nav2_msgs'), ModuleType('nav2_msgs.action')
    vars(package)['action'] = module
    vars(module).update(TYPES)
    monkeypatch.setitem(sys.modules, 'nav2_msgs', package)
    monkeypatch.setitem(sys.modules, 'nav2_msgs.action', module)
    monkeypatch.setattr(nav2_goals, 'GoalCaller', servers.caller)
    monkeypatch.setattr(nav2_goals, 'ServiceCaller', servers.states_of)
    return servers


class Run(GoalRun):
    """A goal's run whose time passes when somebody sleeps."""

    def __init__(self) -> None:
        self.interrupt, self.cancelled = Interrupt(), False
        self.time = 0.0
        self.pauses: list[float] = []

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> bool:
        self.time += seconds
        self.pauses.append(seconds)
        return not self.interrupt.is_set()


class Recorder:
    """Keeps the places that it is told."""

    def __init__(self) -> None:
        self.places: list[Any] = []

    def tell(self, place: str) -> None:
        self.places.append(place)


class Knowledge:
    """Knows where the places are at once."""

    def __init__(self, positions: dict[str, Any]) -> None:
        self._positions = positions

    def assume(self, positions: dict[str, Any]) -> None:
        pass

    def follow_places(self, take: Any) -> None:
        take(self._positions)


def nav2(graph: Any, recorder: Any = None, flat: Any = None, **more: Any) -> nav2_motion.Nav2Motion:
    settings: Any = SimpleNamespace(peer_timeout=60.0)
    knowledge: Any = Knowledge({} if flat is None else flat.POSITIONS)
    doors = {} if flat is None else {'doors.D': [4.05, 1.5, np.pi / 2, 1.0]}
    taken: Any = recorder or Recorder()
    node = graph.add(PatrolNode, doors | more, name='motion_controller')
    return nav2_motion.Nav2Motion(node, knowledge, taken, settings)
