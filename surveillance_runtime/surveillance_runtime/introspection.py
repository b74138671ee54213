"""Watching and steering a machine over ROS: typed topics, and services that answer."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

import state_machines as fsm
from state_machines import Container
from state_machines.exceptions import CallError
from state_machines.export import to_ascii
from state_machines.ros import ServiceCaller
from state_machines.ros.waiting import seconds
from state_machines.structure import Structure, state_at
from state_machines.transitions import Transition, TransitionFeed
from surveillance_interfaces.msg import (
    FsmStatus,
    FsmStructure,
    FsmTransition,
    SmachContainerInitialStatusCmd,
    SmachContainerStatus,
    SmachContainerStructure,
)
from surveillance_interfaces.srv import ForceOutcome, SetAutonomy, SetInitialState
from surveillance_runtime.machine_messages import (
    smach_status_messages,
    smach_structure_messages,
    status_message,
    structure_message,
    transition_message,
    userdata_from,
    userdata_text,
)

HISTORY = 200
"""Transitions that a viewer receives that comes late."""

STRUCTURE_TOPIC = '/smach/container_structure'
STATUS_TOPIC = '/smach/container_status'
INIT_STATUS_TOPIC = '/smach/container_init'
"""The names of SMACH's topics below the server's."""

CONTAINERS = 1000
"""Containers of which SMACH's topics keep the last message for a viewer that comes late."""


def _latched(depth: int) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


class IntrospectionServer:
    """Publishes what a root does and lets it be paused, stepped and steered.

    Below `server_name`: the topics ``fsm/transition`` (every transition, numbered), ``fsm/status``
    and ``fsm/structure``, all latched, and the services ``fsm/pause``, ``fsm/step``,
    ``fsm/resume``, ``fsm/force_outcome``, ``fsm/set_initial_state``, ``fsm/set_autonomy`` and
    ``fsm/approve`` (a transition that waits for a person; empty fields stand for the only one, and
    for the outcome that the state ended with).

    Beside them, SMACH's own topics with the fields of its messages: ``smach/container_structure``,
    ``smach/container_status`` (both a message for each container) and ``smach/container_init``,
    which sets where a container begins.

    Args:
        node: The node that serves.
        server_name: Prefix of the names; empty for none.
        state: The root.
        path: The root's name in paths; a leading slash is dropped, as is ``/`` alone, for the name
            the root has.
        on_pause: Told when the machine is paused, and when it goes on or makes a step.
    """

    def __init__(
        self,
        node: Node,
        server_name: str,
        state: Container,
        path: str,
        on_pause: Callable[[bool], object] = lambda _paused: None,
    ) -> None:
        self._node = node
        self._root = state
        if path.strip('/'):
            state.set_name(path.strip('/'))
        server = server_name.rstrip('/')
        fsm_names = f'{server}/fsm' if server else 'fsm'
        self._feed: TransitionFeed | None = None
        self._sequence = 0
        self._containers: dict[str, Structure] = {}
        # Another thread reports commands: the newer message goes out last.
        self._smach_turn = threading.Lock()

        def publisher(kind: Any, name: str, depth: int) -> Any:
            return node.create_publisher(kind, name, _latched(depth))

        self._transitions = publisher(FsmTransition, f'{fsm_names}/transition', HISTORY)
        self._status = publisher(FsmStatus, f'{fsm_names}/status', 1)
        self._structure = publisher(FsmStructure, f'{fsm_names}/structure', 1)
        structure, status, init = (
            f'{server}{topic}' if server else topic.lstrip('/')
            for topic in (STRUCTURE_TOPIC, STATUS_TOPIC, INIT_STATUS_TOPIC)
        )
        self._smach_structure = publisher(SmachContainerStructure, structure, CONTAINERS)
        self._smach_status = publisher(SmachContainerStatus, status, CONTAINERS)
        node.create_subscription(SmachContainerInitialStatusCmd, init, self._on_initial_state, 10)
        control = state.control

        def pausing(change: Callable[[], None], paused: bool) -> Callable[[Any], None]:
            def act(_request: Any) -> None:
                change()
                on_pause(paused)

            return act

        for kind, name, action in (
            (Trigger, 'pause', pausing(control.pause, True)),
            (Trigger, 'resume', pausing(control.resume, False)),
            (Trigger, 'step', pausing(control.step, False)),
            (ForceOutcome, 'force_outcome', lambda r: control.force_outcome(r.path, r.outcome)),
            (ForceOutcome, 'approve', lambda r: control.approve(r.path, r.outcome)),
            (SetAutonomy, 'set_autonomy', lambda r: control.set_autonomy(r.level)),
            (
                SetInitialState,
                'set_initial_state',
                lambda r: self._set_initial(r.path, r.initial_states, r.userdata),
            ),
        ):
            node.create_service(kind, f'{fsm_names}/{name}', partial(self._serve, action))

    def start(self) -> None:
        """Draw the machine in the log, on level debug, and begin to publish."""
        self._node.get_logger().debug(f'state machine:\n{to_ascii(self._root)}')
        self._structure.publish(structure_message(self._root, self._stamp()))
        for message in smach_structure_messages(self._root, self._stamp()):
            self._smach_structure.publish(message)
        self._containers = {each.path: each for each in Structure(self._root).walk()}
        self._publish_smach(self._containers.values(), 'initial state')
        self._feed = TransitionFeed(self._root, self._publish, self._changed)
        self._publish_status()

    def stop(self) -> None:
        """End publishing; the entities go with the node."""
        if self._feed is not None:
            self._feed.close()
            self._feed = None

    def _stamp(self) -> Any:
        return self._node.get_clock().now().to_msg()

    def _publish(self, transition: Transition) -> None:
        self._sequence = transition.sequence
        message = transition_message(transition, self._root.control.active_paths(), self._stamp())
        self._transitions.publish(message)
        self._publish_status()
        place = self._containers.get(transition.path)
        if place is not None:
            info = f'{transition.from_state}: {transition.outcome} -> {transition.to_state}'
            # All that was inside what was left is idle now, or was put aside.
            left = [
                inner
                for label, state in place.inner.items()
                if label == transition.from_state or not transition.from_state
                for inner in state.walk()
            ]
            self._publish_smach([place, *left], info)

    def _changed(self, path: str) -> None:
        """Tell of a container that begins or goes on, and of all when the root has ended."""
        self._publish_status()
        running = self._root.is_running()
        # One that was added after `start` is not known.
        changed = [each for each in self._containers.values() if each.path == path or not running]
        self._publish_smach(changed, 'started' if running else 'ended')

    def _publish_status(self) -> None:
        self._status.publish(status_message(self._root, self._sequence, self._stamp()))

    def _publish_smach(self, containers: Iterable[Structure], info: str) -> None:
        with self._smach_turn:
            for message in smach_status_messages(containers, info, self._stamp()):
                self._smach_status.publish(message)

    def _on_initial_state(self, message: SmachContainerInitialStatusCmd) -> None:
        try:
            self._set_initial(message.path.strip('/'), message.initial_states, message.local_data)
        except (fsm.SmachError, KeyError) as error:
            self._node.get_logger().warn(f'{INIT_STATUS_TOPIC}: {_said(error)}')

    def _set_initial(self, path: str, labels: Sequence[str], userdata: str) -> None:
        container = state_at(self._root, path)
        if not isinstance(container, fsm.Container):
            raise fsm.InvalidStateError(f"'{path}' is not a container")
        container.set_initial_state(list(labels), userdata_from(userdata))
        self._publish_smach(
            [each for each in self._containers.values() if each.container is container],
            'initial state set',
        )

    def _serve(self, action: Callable[[Any], object], request: Any, response: Any) -> Any:
        """Do what a request asks for, and answer whether it was done, or why not."""
        try:
            action(request)
        except (fsm.SmachError, KeyError) as error:
            response.success, response.message = False, _said(error)
        else:
            response.success = True
            self._publish_status()
        return response


def _said(error: Exception) -> str:
    """Return what an error says; a KeyError alone would show it in quotes."""
    if isinstance(error, KeyError) and not isinstance(error, fsm.SmachError):
        return str(error.args[0])
    return str(error)


class IntrospectionClient:
    """Finds introspection servers and sets where their containers begin, with SMACH's methods.

    Args:
        node: The node that looks; an executor must spin it in another thread.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        # None of them may go while a node spins.
        self._callers: dict[str, ServiceCaller] = {}

    def get_servers(self) -> list[str]:
        """Return the names of the servers that are there, fully resolved."""
        wanted = 'surveillance_interfaces/msg/SmachContainerStructure'
        return sorted(
            name[: -len(STRUCTURE_TOPIC)]
            for name, types in self._node.get_topic_names_and_types()
            if name.endswith(STRUCTURE_TOPIC)
            and wanted in types
            and self._node.count_publishers(name)
        )

    def set_initial_state(
        self,
        server: str,
        path: str,
        initial_states: Sequence[str],
        initial_userdata: fsm.UserData | None = None,
        timeout: Any = 10.0,
    ) -> bool:
        """Set where a container begins, and add to its userdata.

        Args:
            server: The server's name.
            path: The container's path, with or without a slash before it.
            initial_states: Labels of the states to begin with.
            initial_userdata: Userdata that JSON can hold.
            timeout: Seconds of steady time (or an rclpy ``Duration``) for the server to say that it
                has done so.

        Returns:
            Whether it said so.
        """
        name = f'{server}/fsm/set_initial_state'
        if server not in self._callers:
            self._callers[server] = ServiceCaller(self._node, SetInitialState, name)
        userdata = initial_userdata if initial_userdata is not None else fsm.UserData()
        request = SetInitialState.Request(
            path=path.strip('/'),
            initial_states=list(initial_states),
            userdata=userdata_text(userdata),
        )
        try:
            answer = self._callers[server].call(request, seconds(timeout) or 0.0)
        except CallError as error:
            self._node.get_logger().warn(str(error))
            return False
        if not answer.success:
            self._node.get_logger().warn(f'{name}: {answer.message}')
        return bool(answer.success)
