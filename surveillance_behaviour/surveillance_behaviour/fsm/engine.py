"""The table a machine runs on: one node per state, with its view of userdata and its targets."""

from __future__ import annotations

from typing import Any

from surveillance_behaviour.fsm.state import State


class Exit:
    """Where a transition leaves the container."""

    __slots__ = ('execute', 'label')

    is_exit = True

    def __init__(self, label: str) -> None:
        self.label = label


class Node:
    """One state of a machine as the loop needs it.

    Attributes:
        label: The state's label in its container.
        state: The state.
        execute: What runs it.
        view: The state's view of the container's userdata.
        targets: Where each outcome leads.
    """

    __slots__ = ('execute', 'label', 'state', 'targets', 'view')

    is_exit = False

    def __init__(self, label: str, state: State, view: Any) -> None:
        self.label = label
        self.state = state
        self.execute = state.execute
        self.view = view
        self.targets: dict[str | None, Node | Exit] = {}


class Frame:
    """One execution of a container.

    The thread that executes writes `current` first and looks at `attention` after; a thread that
    wants something raises `attention` first and looks at `current` after. So one of the two always
    sees the other, and the loop needs no lock.

    Attributes:
        current: The node that executes, or the exit that was taken.
        attention: Something beside the next state wants to be looked at.
        preempted: The node whose state was last asked to stop.
    """

    __slots__ = ('attention', 'current', 'preempted')

    def __init__(self, current: Node | Exit) -> None:
        self.current = current
        self.attention = True
        self.preempted: Node | None = None
