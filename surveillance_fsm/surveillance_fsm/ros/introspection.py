"""Watching and steering a machine over ROS: typed topics, and services that answer."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

import surveillance_fsm as fsm
from surveillance_fsm.active import ActiveContainer
from surveillance_fsm.export import to_ascii
from surveillance_fsm.record import Transition, TransitionFeed
from surveillance_fsm.ros.conversions import (
    status_message,
    structure_message,
    transition_message,
)
from surveillance_fsm.structure import state_at
from surveillance_interfaces.msg import FsmStatus, FsmStructure, FsmTransition
from surveillance_interfaces.srv import ForceOutcome, SetInitialState

HISTORY = 200
"""Transitions that a viewer receives that comes late."""

_LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
_TRANSITIONS = QoSProfile(
    depth=HISTORY,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


class IntrospectionServer:
    """Publishes what a root does and lets it be paused, stepped and steered.

    Below `server_name`: the topics ``fsm/transition`` (every transition, numbered), ``fsm/status``
    and ``fsm/structure``, all latched, and the services ``fsm/pause``, ``fsm/step``,
    ``fsm/resume``, ``fsm/force_outcome`` and ``fsm/set_initial_state``.

    Args:
        node: The node that serves.
        server_name: Prefix of the names; empty for none.
        state: The root.
        path: The root's name in paths; a leading slash is dropped, as is ``/`` alone, for the name
            the root has.
    """

    def __init__(self, node: Node, server_name: str, state: ActiveContainer, path: str) -> None:
        self._node = node
        self._root = state
        if path.strip('/'):
            state.set_name(path.strip('/'))
        prefix = f'{server_name.rstrip("/")}/fsm' if server_name else 'fsm'
        self._prefix = prefix
        self._feed: TransitionFeed | None = None
        self._sequence = 0
        self._transitions = node.create_publisher(
            FsmTransition, f'{prefix}/transition', _TRANSITIONS
        )
        self._status = node.create_publisher(FsmStatus, f'{prefix}/status', _LATCHED)
        self._structure = node.create_publisher(FsmStructure, f'{prefix}/structure', _LATCHED)
        control = state.control
        for name, action in (
            ('pause', control.pause),
            ('resume', control.resume),
            ('step', control.step),
        ):
            node.create_service(Trigger, f'{prefix}/{name}', self._trigger(action))
        node.create_service(ForceOutcome, f'{prefix}/force_outcome', self._force_outcome)
        node.create_service(SetInitialState, f'{prefix}/set_initial_state', self._set_initial_state)

    def start(self) -> None:
        """Draw the machine in the log, on level debug, and begin to publish."""
        self._node.get_logger().debug(f'state machine:\n{to_ascii(self._root)}')
        self._structure.publish(structure_message(self._root, self._stamp()))
        self._feed = TransitionFeed(self._root, self._publish)
        self._root.register_start_cb(self._changed)
        self._root.register_termination_cb(self._changed)
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

    def _publish_status(self) -> None:
        self._status.publish(status_message(self._root, self._sequence, self._stamp()))

    def _changed(self, *_: Any) -> None:
        if self._feed is not None:
            self._publish_status()

    def _trigger(self, action: Callable[[], None]) -> Callable[[Any, Any], Any]:
        def serve(_request: Any, response: Any) -> Any:
            return self._answer(response, action)

        return serve

    def _force_outcome(self, request: Any, response: Any) -> Any:
        return self._answer(
            response, lambda: self._root.control.force_outcome(request.path, request.outcome)
        )

    def _set_initial_state(self, request: Any, response: Any) -> Any:
        def act() -> None:
            container = state_at(self._root, request.path)
            if not isinstance(container, fsm.Container):
                raise fsm.InvalidStateError(f"'{request.path}' is not a container")
            userdata = fsm.UserData()
            values = json.loads(request.userdata or '{}')
            if not isinstance(values, dict):
                raise fsm.InvalidStateError(
                    f'userdata must be a JSON object, not {request.userdata!r}'
                )
            for key, value in values.items():
                userdata[key] = value
            container.set_initial_state(list(request.initial_states), userdata)

        return self._answer(response, act)

    def _answer(self, response: Any, action: Callable[[], None]) -> Any:
        try:
            action()
        except (fsm.SmachError, KeyError, ValueError) as error:
            response.success = False
            response.message = str(error.args[0] if isinstance(error, KeyError) else error)
            return response
        response.success = True
        self._publish_status()
        return response
