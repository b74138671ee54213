"""Making a container's nodes, and saying what went wrong when one was executed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from surveillance_fsm.container import describe
from surveillance_fsm.engine import LOWEST, Node
from surveillance_fsm.exceptions import (
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
)
from surveillance_fsm.limits import Limits, limited
from surveillance_fsm.state import State
from surveillance_fsm.takeover import keep_out
from surveillance_fsm.user_data import Remapper, UserData, undeclared_write
from surveillance_fsm.waiting import Clock


def make_node(
    path: str,
    state: State,
    userdata: UserData,
    clock: Clock,
    *,
    remapping: Mapping[str, str] | None = None,
    constants: Mapping[str, Any] | None = None,
    limits: Limits | None = None,
    priority: float = LOWEST,
) -> Node:
    """Make the node of one state; its targets are left to the container.

    Args:
        path: The state's path.
        state: The state.
        userdata: The container's userdata.
        clock: What the state's waits go by.
        remapping: From the state's keys to the container's.
        constants: Values of keys that come from no userdata.
        limits: Time limits and retries.
        priority: Of an interrupt.
    """

    def make_view() -> Remapper:
        return Remapper(
            userdata,
            state.get_registered_input_keys(),
            state.get_registered_output_keys(),
            remapping or {},
            constants,
            path,
        )

    within, _, label = path.rpartition('/')
    node = Node(within, label, state, make_view, priority)
    if isinstance(state, State):
        state._fsm_clock = clock
    left = getattr(state, '_fsm_left', None)
    if left is not None and not left.is_set():
        keep_out(node, left)
    node.limits = limits
    if limits is not None:
        node.execute = limited(path, node, limits)
    return node


def user_fault(path: str, node: Node, error: Exception) -> SmachError:
    """The engine's error for what a state's code raised; to be raised from that."""
    return undeclared_write(node.view, error) or InvalidUserCodeError(
        f"State '{path}' of type {type(node.state).__name__} raised {describe(error)}"
    )


def wrong_outcome(path: str, node: Node, outcome: object) -> InvalidTransitionError:
    """The error for an outcome that a state did not declare."""
    returned = 'None instead of an outcome' if outcome is None else f'outcome {outcome!r}'
    return InvalidTransitionError(
        f"State '{path}' of type {type(node.state).__name__} returned {returned}: its outcomes are "
        f'{sorted(node.state.get_registered_outcomes())}'
    )
