"""Between the engine's records and the messages of the introspection."""

from __future__ import annotations

import json
from typing import Any

from surveillance_fsm.active import ActiveContainer
from surveillance_fsm.export import to_mermaid
from surveillance_fsm.record import Transition
from surveillance_fsm.structure import structure_of
from surveillance_interfaces.msg import (
    FsmContainer,
    FsmEdge,
    FsmStatus,
    FsmStructure,
    FsmTransition,
)
from surveillance_runtime.conversions import seconds_of


def transition_message(transition: Transition, active: list[str], stamp: Any) -> FsmTransition:
    """A transition of a machine, with the paths that are active and the time of publishing."""
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


def transition_from(message: FsmTransition) -> Transition:
    """The transition of a message; its time is the time of publishing, in seconds."""
    return Transition(
        sequence=message.sequence,
        time=seconds_of(message.stamp),
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


def status_message(root: ActiveContainer, sequence: int, stamp: Any) -> FsmStatus:
    """What a machine's root is doing, after the transition with number `sequence`."""
    return FsmStatus(
        stamp=stamp,
        root=root.get_name(),
        sequence=sequence,
        running=root.is_running(),
        paused=root.control.paused,
        active=root.control.active_paths(),
        left_behind=root.control.left_behind(),
    )


def structure_message(root: ActiveContainer, stamp: Any) -> FsmStructure:
    """A machine's root and all its containers."""
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
