"""From the engine's types to the messages of its introspection."""

from __future__ import annotations

import json
from typing import Any

from surveillance_behaviour.fsm.active import ActiveContainer
from surveillance_behaviour.fsm.export import to_mermaid
from surveillance_behaviour.fsm.record import Transition
from surveillance_behaviour.fsm.structure import structure_of
from surveillance_interfaces.msg import (
    FsmContainer,
    FsmEdge,
    FsmStatus,
    FsmStructure,
    FsmTransition,
)


def transition_to_ros(transition: Transition, active: list[str], stamp: Any) -> FsmTransition:
    """One transition, with the paths that are active and the time of publishing."""
    return FsmTransition(
        stamp=stamp,
        sequence=transition.sequence,
        path=transition.path,
        from_state=transition.from_state,
        outcome=transition.outcome,
        to_state=transition.to_state,
        kind=transition.kind,
        duration=float(transition.duration),
        visits=transition.visits,
        active=active,
        userdata_keys=list(transition.userdata),
        userdata_values=[json.dumps(value) for value in transition.userdata.values()],
    )


def transition_from_ros(message: FsmTransition) -> Transition:
    """The transition of a message; its time is the time of publishing, in seconds."""
    return Transition(
        sequence=message.sequence,
        time=message.stamp.sec + message.stamp.nanosec / 1e9,
        path=message.path,
        from_state=message.from_state,
        outcome=message.outcome,
        to_state=message.to_state,
        kind=message.kind,
        duration=message.duration,
        visits=message.visits,
        userdata={
            key: json.loads(value)
            for key, value in zip(message.userdata_keys, message.userdata_values, strict=True)
        },
    )


def status_to_ros(root: ActiveContainer, sequence: int, stamp: Any) -> FsmStatus:
    """What a root is doing, after the transition with number `sequence`."""
    return FsmStatus(
        stamp=stamp,
        root=root.get_name(),
        sequence=sequence,
        running=root.is_running(),
        paused=root.control.paused,
        active=root.control.active_paths(),
        left_behind=root.control.left_behind(),
    )


def structure_to_ros(root: ActiveContainer, stamp: Any) -> FsmStructure:
    """A root and all its containers."""
    return FsmStructure(
        stamp=stamp,
        root=root.get_name(),
        containers=[
            FsmContainer(
                path=structure.path,
                kind=structure.kind,
                states=list(structure.states),
                interrupts=list(structure.interrupts),
                initial_states=structure.initial,
                outcomes=structure.outcomes,
                edges=[
                    FsmEdge(from_state=edge.source, outcome=edge.outcome, to_state=edge.target)
                    for edge in structure.edges
                ],
            )
            for structure in structure_of(root).walk()
        ],
        mermaid=to_mermaid(root),
    )
