"""The parameters of the behaviour's nodes, declared and checked in one place.

What can sensibly change while the mission runs may be set at run time, and counts from the next
choice on.
"""

from __future__ import annotations

from collections.abc import Sequence

from surveillance_behaviour.decision import DecisionSettings
from surveillance_behaviour.mission.mission import MissionSettings
from surveillance_behaviour.mission.recovery import RecoveryLimits
from surveillance_behaviour.peers.ros_ports import Deadlines
from surveillance_runtime.node import PatrolNode


def choice_settings(node: PatrolNode, *, explores: bool = True) -> DecisionSettings:
    """Declare what a decision depends on; the result follows changes at run time.

    Args:
        node: The node.
        explores: Whether the robot explores each place for a while.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    settings = DecisionSettings() if explores else DecisionSettings(exploration_seconds=0.0)
    settings = node.declare_fields(
        settings,
        without=() if explores else ('exploration_seconds',),
        on_change=lambda new: vars(settings).update(vars(new)),
    )
    return settings


def mission_settings(node: PatrolNode) -> MissionSettings:
    """Declare everything about the mission but the deadlines.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    recovery = node.declare_fields(RecoveryLimits(), prefix='recovery.')
    return node.declare_fields(MissionSettings(choice_settings(node), recovery))


def deadlines(node: PatrolNode, without: Sequence[str] = ()) -> Deadlines:
    """Declare the deadlines of the peers, seconds of steady time."""
    return node.declare_fields(Deadlines(), prefix='deadline.', without=without)


def random_seed(node: PatrolNode) -> int:
    """Declare the seed of the policies that take a chance."""
    seed: int = node.parameter(
        'random_seed',
        -1,
        'Makes the policies that draw repeatable; -1 takes another course each time.',
        minimum=-1,
        read_only=True,
    )
    return seed


def record_path(node: PatrolNode) -> str:
    """Declare the file of the mission record; what was learned is kept beside it."""
    path: str = node.parameter(
        'record',
        '',
        'File that the mission is recorded in, and beside which `FILE.experience.json` keeps what '
        'was learned (visits, leg times, battery); empty: none.',
        read_only=True,
    )
    return path
