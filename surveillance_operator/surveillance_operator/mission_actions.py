"""What a person can do to a mission, each with an answer in words: for the console and the page.

All calls block until the answer or a deadline, so they belong on a worker thread. What was not done
raises one line that says why: `ValueError` where it was refused, `CallError` where nobody answers.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from geometry_msgs.msg import Point
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import SetBool, Trigger

from armor_service.facts import parse_fact
from floor_plans.parameters import problem_in_name
from state_machines.exceptions import CallError, CallInterruptedError
from state_machines.ros import ServiceCaller, UnavailableError
from strict_files.suggestions import nearest
from surveillance_interfaces.srv import (
    AddRoom,
    ConsoleCommand,
    DrainBattery,
    ForceOutcome,
    GoTo,
    MarkerRoutine,
    PlaceObstacle,
    ReferenceName,
    RemoveObstacle,
    RemoveRoom,
    SetAutonomy,
    SetDoor,
    WhyNot,
)
from surveillance_ontology.armor_client import (
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
)
from surveillance_ontology.map_ontology import MapOntology
from surveillance_ontology.patrol_vocabulary import facts_of
from surveillance_operator.stop_button import StopButton
from surveillance_operator.topics import BEHAVIOUR, CONTROLLERS
from surveillance_runtime.configuration import argument_value, declared
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import SHARED, name_for
from surveillance_runtime.parameters import shown
from surveillance_runtime.place_changes import description_text

_DISCOVERY = 2.0
"""Seconds in which a node that has just started finds the services that there are."""
_OPTIONAL = ('simulation/', 'observer/', 'move_arm', 'alarm/')
"""How the names of services begin that a mission need not have."""
_OFFERED_BY = {
    'simulation': ('simulator',),
    'ontology_map': ('ontology_map_builder',),
    'move_arm': ('arm_controller',),
    'go_to': (BEHAVIOUR, 'reasoner'),
    'why_not': (BEHAVIOUR, 'reasoner'),
    'armor_interface_srv': ('armor_server',),
}
"""The nodes that a service needs, by the first word of its name; else that word is the node."""
_KINDS: Mapping[str, Any] = {
    'simulation/set_door': SetDoor,
    'ontology_map/set_door': SetDoor,
    'simulation/place_obstacle': PlaceObstacle,
    'simulation/remove_obstacle': RemoveObstacle,
    'simulation/drain_battery': DrainBattery,
    'simulation/stage': ConsoleCommand,
    'observer/command': ConsoleCommand,
    'alarm/command': ConsoleCommand,
    'ontology_map/set_place': ConsoleCommand,
    'ontology_map/add_room': AddRoom,
    'ontology_map/remove_room': RemoveRoom,
    'ontology_map/reference_name': ReferenceName,
    'move_arm': MarkerRoutine,
    'go_to': GoTo,
    'why_not': WhyNot,
    f'{BEHAVIOUR}/set_parameters': SetParameters,
    f'{BEHAVIOUR}/fsm/approve': ForceOutcome,
    f'{BEHAVIOUR}/fsm/set_autonomy': SetAutonomy,
    **dict.fromkeys((f'{BEHAVIOUR}/fsm/{word}' for word in ('pause', 'step', 'resume')), Trigger),
    **dict.fromkeys((f'{name}/command' for name in CONTROLLERS), ConsoleCommand),
}
"""The services that are looked for from the start; others for parameters once they are used."""
_PARAMETER_KINDS: Mapping[str, Any] = {
    'get_parameters': GetParameters,
    'list_parameters': ListParameters,
    'set_parameters': SetParameters,
}
AUTONOMY = ('off', 'low', 'high', 'full')
"""The levels of autonomy, in the order of their numbers."""
ARM_SECONDS = 60.0
"""Deadline of a movement of the arm, whose answer comes when it has arrived."""


class MissionActions:
    """Calls the services of a mission.

    Args:
        node: The node that calls; an executor must spin it.
        timeout: Deadline of each call, seconds.
        robot: The robot of a fleet whose mission it is; empty: that of the node's namespace.
        shared: The actions of the node's own namespace, whose services the robots share.
    """

    def __init__(
        self,
        node: PatrolNode,
        timeout: float = 5.0,
        *,
        robot: str = '',
        shared: MissionActions | None = None,
    ) -> None:
        self._node = node
        self._timeout = timeout
        self._robot = robot
        self._callers: dict[str, ServiceCaller] = {} if shared is None else shared._callers
        for service, kind in _KINDS.items():
            name = name_for(robot, service)
            if name not in self._callers:
                self._callers[name] = ServiceCaller(node, kind, name)
        self._stop = StopButton(node, robot)
        self._out = ServiceCaller(node, SetBool, name_for(robot, 'take_out'))
        self._armor: ArmorClient | None = None
        self._found_by = time.monotonic() + min(_DISCOVERY, timeout)

    def set_door(self, door: str, is_open: bool) -> str:
        """Open or close a door: a simulated one, or else as the map has it."""
        wanted: dict[str, Any] = {'door': _name(door), 'open': bool(is_open)}
        try:
            return self._request('simulation/set_door', **wanted)
        except UnavailableError:
            return self._request('ontology_map/set_door', **wanted)

    def place_obstacle(self, name: str, x: float, y: float, radius: float) -> str:
        """Put a cylinder in the simulated robot's way, metres."""
        at = {'x': _number('x', x), 'y': _number('y', y), 'radius': _number('radius', radius)}
        return self._request('simulation/place_obstacle', name=_name(name), **at)

    def remove_obstacle(self, name: str) -> str:
        """Take an obstacle away."""
        return self._request('simulation/remove_obstacle', name=_name(name))

    def stage(self, line: str) -> str:
        """Change the simulated place by a line such as `door D1 ajar 30`."""
        return self._line('simulation/stage', line)

    def event(self, line: str) -> str:
        """Answer an event of the observer: `events`, `acknowledge 3`, `normal 3` or `false 3`."""
        return self._line('observer/command', line)

    def alarm(self, line: str) -> str:
        """Say something of an alarm to the node `alarm`, see `desk.handling`."""
        return self._line('alarm/command', line)

    def drain_battery(self, percent: float) -> str:
        """Take charge out of the simulated battery."""
        return self._request('simulation/drain_battery', percent=_number('percent', percent))

    def add_room(self, name: str, x: float, y: float, doors: Sequence[str]) -> str:
        """Add a place to the map and the ontology."""
        return self._request(
            'ontology_map/add_room',
            room_name=_name(name),
            position=Point(x=_number('x', x), y=_number('y', y)),
            doors=[_name(door) for door in doors],
        )

    def remove_room(self, name: str) -> str:
        """Remove a place from the map and the ontology."""
        return self._request('ontology_map/remove_room', room_name=_name(name))

    def set_place(self, described: Mapping[str, Any]) -> str:
        """Have the mission go on in a place that was changed; its parameters as in its file."""
        answer = self._call('ontology_map/set_place', line=description_text(described))
        if not answer.accepted:
            raise ValueError(answer.answer)
        return str(answer.answer)

    def go_to(self, place: str) -> str:
        """Send the robot to a place next; an empty one calls it home."""
        return self._request('go_to', place=_name(place) if place else '')

    def why_not(self, place: str) -> tuple[str, list[str]]:
        """Return why the robot would not go to a place now, and the premises of that."""
        answer = self._call('why_not', place=_name(place))
        if not answer.success:
            raise ValueError(answer.message or f'no answer about {place}')
        return answer.message, list(answer.premises)

    def machine(self, word: str) -> str:
        """Pause, step or resume the state machine, or approve the transition that waits."""
        if word == 'approve':
            return self.approve()
        if word not in ('pause', 'step', 'resume'):
            raise ValueError(f'{word!r}: expected pause, step, resume or approve')
        answer = self._call(f'{BEHAVIOUR}/fsm/{word}')
        if not answer.success:
            raise ValueError(answer.message or f'{word} was refused')
        done = {'pause': 'paused', 'step': 'one step made', 'resume': 'going on'}
        return str(answer.message) or f'state machine: {done[word]}'

    def approve(self, outcome: str = '') -> str:
        """Have the transition be made that waits for a person, or that of another outcome."""
        self._request(f'{BEHAVIOUR}/fsm/approve', outcome=str(outcome))
        return f'going on with {outcome}' if outcome else 'approved'

    def set_autonomy(self, level: str) -> str:
        """Set how much the machine does by itself: off, low, high or full."""
        if level not in AUTONOMY:
            raise ValueError(f'{level!r}: expected {nearest(level, AUTONOMY)}')
        self._request(f'{BEHAVIOUR}/fsm/set_autonomy', level=AUTONOMY.index(level))
        return f'autonomy: {level}'

    def stop(self, on: bool) -> str:
        """Have the robot stand, whoever commands it, or release it."""
        return self._stop.press(bool(on))

    def take_out(self, out: bool) -> str:
        """Take the robot out of its fleet's patrol, or put it back; the others share its places."""
        request = SetBool.Request(data=bool(out))
        try:
            answer = self._out.call(
                request, self._timeout, self._node.stopping, discovery=min(1.0, self._timeout)
            )
        except UnavailableError:
            away = self._away(BEHAVIOUR) or 'this robot shares its patrol with no other'
            raise UnavailableError(away) from None
        if not answer.success:
            raise ValueError(answer.message or 'refused')
        return str(answer.message)

    def set_threshold(self, seconds: str) -> str:
        """Set after how long a place is URGENT, seconds."""
        return self.set_parameter(BEHAVIOUR, 'urgency_threshold', seconds)

    def set_policy(self, policy: str) -> str:
        """Set how a place is chosen among those that the rules allow."""
        return self.set_parameter(BEHAVIOUR, 'policy', policy)

    def parameters(self, node: str) -> dict[str, Any]:
        """Return the values that a node's parameters have now, by name."""
        names = sorted(self._call(f'{node}/list_parameters').result.names)
        values = self._call(f'{node}/get_parameters', names=names).values
        return {
            name: value.tolist() if hasattr(value, 'tolist') else value
            for name, value in zip(names, map(parameter_value_to_python, values), strict=False)
        }

    def set_parameter(self, node: str, name: str, text: str) -> str:
        """Set a parameter of a running node to a value as `-p NAME:=VALUE` has it."""
        spec = declared(node, name)
        if spec.read_only:
            raise ValueError(
                f'{name} is read once, when {node} starts: give it there, as -p {node}:{name}:=...'
            )
        value = argument_value(text)
        if isinstance(spec.default, str) and not isinstance(value, str):
            value = text
        value = spec.accept(value)
        parameter = Parameter(name, value=value).to_parameter_msg()
        (result,) = self._call(f'{node}/set_parameters', parameters=[parameter]).results
        if not result.successful:
            raise ValueError(result.reason or f'{name} was refused')
        return f'{name} of {node} is {shown(value)}'

    def move_arm(self, pose: str) -> str:
        """Move the camera arm to a named pose: left, home, right, back; or stop it."""
        number = getattr(MarkerRoutine.Request, str(pose).upper(), None)
        if not isinstance(number, int):
            raise ValueError(f'{pose!r}: expected left, home, right, back or stop')
        return self._request('move_arm', ARM_SECONDS, pos=number)

    def command(self, controller: str, line: str) -> str:
        """Give a controller one of its console's commands: the answers of mode MANUAL."""
        if controller not in CONTROLLERS:
            raise ValueError(f'{controller!r}: expected {nearest(controller, CONTROLLERS)}')
        return self._line(f'{controller}/command', line)

    def _line(self, service: str, line: str) -> str:
        answer = self._call(service, line=str(line)[:20_000])
        if not answer.accepted:
            raise ValueError(answer.answer)
        return str(answer.answer)

    def facts(self, place: str) -> list[tuple[str, bool]]:
        """Return what the ontology knows of a place: facts, and whether each is asserted."""
        queries = facts_of(_name(place))
        found = self._ask(lambda armor: [armor.query.facts_by_origin(each) for each in queries])
        if not any(every for every, _ in found):
            places = self._ask(lambda armor: MapOntology(armor).places())
            raise ValueError(f'nothing is known of {place}: expected {nearest(place, places)}')
        return [(str(fact), fact in asserted) for every, asserted in found for fact in every]

    def explain(self, fact: str) -> list[tuple[int, str]]:
        """Return the proof of a fact: lines with their depth, each following from those below."""
        try:
            parse_fact(fact)
        except (ValueError, IndexError) as error:
            raise ValueError(str(error)) from None
        proof = self._ask(lambda armor: armor.query.explain(fact))
        if proof is None:
            raise ValueError(f'{fact} does not hold')
        lines = proof[1].splitlines()
        return [((len(line) - len(line.lstrip())) // 2, line.strip()) for line in lines]

    def _ask(self, question: Callable[[Any], Any]) -> Any:
        try:
            if self._armor is None:
                answer = self._call('ontology_map/reference_name')
                self._armor = ArmorClient(
                    self._node,
                    self._node.get_name(),
                    answer.name,
                    timeout=self._timeout,
                    interrupt=self._node.stopping,
                )
            return question(self._armor)
        except ArmorServiceCallError as error:
            raise ValueError(self._away('armor_interface_srv') or str(error)) from None
        except ArmorServiceInternalError as error:
            raise ValueError(str(error)) from None

    def _request(self, service: str, timeout: float | None = None, **fields: Any) -> str:
        answer = self._call(service, timeout, **fields)
        if not answer.success:
            raise ValueError(answer.message or f'{service} refused')
        return str(answer.message) or 'done'

    def _call(self, service: str, timeout: float | None = None, **fields: Any) -> Any:
        kind = _KINDS.get(service) or _PARAMETER_KINDS[service.rpartition('/')[2]]
        name = name_for(self._robot, service)
        if name not in self._callers:
            self._callers[name] = ServiceCaller(self._node, kind, name)
        discovery = self._timeout
        if service.startswith(_OPTIONAL):
            # Nobody waits for a service that this kind of mission does not have.
            discovery = max(min(0.5, self._timeout), self._found_by - time.monotonic())
        try:
            return self._callers[name].call(
                kind.Request(**fields),
                timeout or self._timeout,
                self._node.stopping,
                discovery=discovery,
            )
        except UnavailableError as error:
            raise UnavailableError(self._away(service) or str(error)) from None
        except CallInterruptedError:
            away = self._away(service) or f'this program ends before {service} has answered'
            raise CallError(away) from None

    def _away(self, service: str) -> str:
        """Say which node a service lacks; empty when all that it needs are there."""
        first = service.partition('/')[0]
        there = self._node.get_node_names_and_namespaces()
        own = self._node.get_namespace()
        for name in _OFFERED_BY.get(first, (first,)):
            robot = '' if name in SHARED else self._robot
            if (name, f'{own.rstrip("/")}/{robot}' if robot else own) not in there:
                return f'{name_for(robot, name)} is not running'
        return ''


def _name(text: str) -> str:
    if problem := problem_in_name('given', text):
        raise ValueError(problem)
    return text


def _number(what: str, value: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f'{what} {str(value)[:40]!r}: expected a finite number')
    return number
