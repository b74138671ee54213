"""Between the engine's records and the messages of the introspection."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from std_msgs.msg import Header

from state_machines import Container, InvalidStateError
from state_machines.export import to_mermaid
from state_machines.structure import Structure
from state_machines.transitions import Transition, presentable
from state_machines.userdata import UserData, raw
from strict_files.regular_files import parse_json
from surveillance_interfaces.msg import (
    FsmContainer,
    FsmEdge,
    FsmQuestion,
    FsmStatus,
    FsmStructure,
    FsmTransition,
    SmachContainerStatus,
    SmachContainerStructure,
)


def transition_message(transition: Transition, active: list[str], stamp: Any) -> FsmTransition:
    """Return a transition of a machine, with the paths that are active and the time of
    publishing.
    """
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


def status_message(root: Container, sequence: int, stamp: Any) -> FsmStatus:
    """Return what a machine's root is doing, after the transition with number `sequence`."""
    return FsmStatus(
        stamp=stamp,
        root=root.get_name(),
        sequence=sequence,
        running=root.is_running(),
        paused=root.control.paused,
        active=root.control.active_paths(),
        left_behind=root.control.left_behind(),
        autonomy=int(root.control.autonomy),
        questions=[
            FsmQuestion(
                path=question.path,
                outcome=question.outcome,
                to_state=question.target,
                level=int(question.approval.level),
                outcomes=list(question.outcomes),
                timeout=float(question.approval.timeout or 0.0),
                otherwise=question.approval.otherwise,
            )
            for question in root.control.questions()
        ],
    )


def structure_message(root: Container, stamp: Any) -> FsmStructure:
    """Return a machine's root and all its containers."""
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
            for structure in Structure(root).walk()
        ],
        mermaid=to_mermaid(root),
    )


def userdata_from(text: str) -> UserData:
    """Userdata of a JSON object; an empty text has none.

    Raises:
        InvalidStateError: It is no JSON object.
    """
    try:
        values = parse_json(text or '{}')
    except ValueError as error:
        raise InvalidStateError(f'userdata must be a JSON object: {error}') from None
    if not isinstance(values, dict):
        raise InvalidStateError(f'userdata must be a JSON object, not {text[:80]!r}')
    userdata = UserData()
    raw(userdata).update(values)
    return userdata


def userdata_text(userdata: UserData) -> str:
    """Userdata as a JSON object, as far as JSON can show it."""
    return json.dumps(presentable(dict(raw(userdata))))


# SMACH's own messages.


def smach_path(path: str) -> str:
    """Return a path as SMACH's introspection writes it."""
    return f'/{path}'


def smach_structure_messages(root: Container, stamp: Any) -> list[SmachContainerStructure]:
    """Return a machine's root and all its containers, a message each."""
    return [
        SmachContainerStructure(
            header=Header(stamp=stamp),
            path=smach_path(structure.path),
            children=list(structure.members),
            internal_outcomes=[edge.outcome for edge in structure.edges],
            outcomes_from=[edge.source for edge in structure.edges],
            outcomes_to=[edge.target for edge in structure.edges],
            container_outcomes=structure.outcomes,
        )
        for structure in Structure(root).walk()
    ]


def smach_status_messages(
    structures: Iterable[Structure], info: str, stamp: Any
) -> list[SmachContainerStatus]:
    """Return what containers are doing, a message each.

    Args:
        structures: The containers.
        info: What has changed.
        stamp: The time of publishing.
    """
    return [
        SmachContainerStatus(
            header=Header(stamp=stamp),
            path=smach_path(structure.path),
            initial_states=structure.container.get_initial_states(),
            active_states=structure.container.get_active_states(),
            local_data=userdata_text(structure.container.userdata),
            info=info,
        )
        for structure in structures
    ]
