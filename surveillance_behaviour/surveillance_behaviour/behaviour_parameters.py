"""The parameters of the behaviour's nodes, declared and checked in one place.

What can sensibly change while the mission runs may be set at run time, and counts from the next
choice on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from surveillance_behaviour.decision import (
    DEFAULT_RULES,
    DecisionSettings,
    Rules,
    rules_expected,
)
from surveillance_behaviour.mission.mission import MissionSettings
from surveillance_behaviour.mission.recovery import RecoveryLimits
from surveillance_behaviour.peers.ros_ports import Deadlines
from surveillance_behaviour.policy.battery_reserve import BatteryLimits
from surveillance_behaviour.policy.policies import POLICIES
from surveillance_runtime import parameter_checks
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Described, ParameterError, declare_fields

_DAY = 86400.0
_EXPLORATION = 'exploration_seconds'
_CHOICE = {
    _EXPLORATION: Described('Seconds the robot takes to explore a place.', 0.0, _DAY),
    'speed': Described(
        "Metres per second, to tell a move's time before any was driven.",
        *(0.001, 100.0),
        name='robot_speed',
    ),
    'policy': Described(
        'How a place is chosen among those that the rules allow.', choices=tuple(POLICIES)
    ),
    'recharge_rooms': Described(
        'Places with a charging station.',
        of=str,
        check=parameter_checks.not_empty,
    ),
}
_RECOVERY = {
    'path_tries': Described('Times a place is tried before another one is chosen.', 1, 1000),
    'place_tries': Described('Places given up in a row before the robot goes back.', 1, 1000),
    'avoid_seconds': Described(
        'How long a place that was given up is left alone at first, s.', 0.0, _DAY
    ),
    'longest_avoid': Described('The longest time a place is left alone, s.', 0.0, _DAY),
    'help_seconds': Described('The first pause while waiting for help, s.', 0.0, _DAY),
    'longest_help': Described('The longest pause while waiting for help, s.', 0.0, _DAY),
}
_MISSION = {
    'arrival_tolerance': Described(
        "How far from its path's end the robot may stop and still have arrived, m.", 0.0, 1000.0
    ),
    'goal_tolerance': Described("How far from the goal a planner's path may end, m.", 0.0, 1000.0),
    'charge_stall_seconds': Described(
        'How long the level may stay the same at the station before the robot docks anew, s; '
        '0: for ever.',
        *(0.0, _DAY),
    ),
}
_DEADLINES = {
    name: Described(f'Seconds of real time for {text}.', least, _DAY)
    for name, least, text in (
        ('answer', 0.1, "a service's answer, and for a goal to be accepted"),
        ('build', 0.1, 'the ontology to be built, and for looking around at the start'),
        ('plan', 0.0, 'a path; 0: as long as the planner lives'),
        ('move', 0.0, 'following a path; 0: as long as the controller lives'),
        ('charge', 0.0, 'the battery to get on while it is charged by `recharge`; 0: for ever'),
    )
}


def choice_settings(node: PatrolNode, *, explores: bool = True) -> DecisionSettings:
    """Declare what a decision depends on; the result follows changes at run time.

    Args:
        node: The node.
        explores: Whether the robot explores each place for a while.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    described = {name: how for name, how in _CHOICE.items() if explores or name != _EXPLORATION}
    settings = declare_fields(
        node,
        DecisionSettings(exploration_seconds=2.0 if explores else 0.0),
        described,
        on_change=lambda *change: setattr(settings, *change),
    )
    settings.urgency_threshold = node.parameter(
        'urgency_threshold',
        int(settings.urgency_threshold),
        'Seconds without a visit after which a place is URGENT.',
        minimum=0,
        maximum=10**9,
        on_change=lambda value: setattr(settings, 'urgency_threshold', value),
    )
    settings.rules = Rules(
        tuple(
            node.parameter(
                'rooms_priority',
                list(DEFAULT_RULES),
                'Classes of places by falling priority; empty: any place within reach.',
                of=str,
                check=rules_expected,
                on_change=lambda names: setattr(settings, 'rules', Rules(tuple(names))),
            )
        )
    )
    settings.battery = _battery_limits(node, settings)
    return settings


def _battery_limits(node: PatrolNode, settings: DecisionSettings) -> BatteryLimits:
    default = BatteryLimits()
    values: dict[str, float] = {
        'require_recharge': default.require_recharge,
        'stop_recharge': default.stop_recharge,
        'margin': default.margin,
    }

    def expected(name: str) -> Callable[[float], str | None]:
        def check(value: float) -> str | None:
            try:
                BatteryLimits(**{**values, name: float(value)})
            except ValueError as error:
                return str(error).removeprefix('expected ').partition(', got')[0]
            return None

        return check

    def follow(name: str) -> Callable[[float], None]:
        def changed(value: float) -> None:
            values[name] = float(value)
            settings.battery = replace(settings.battery, **{name: float(value)})

        return changed

    declared = (
        ('battery_stop_recharge', 'stop_recharge', 'Charge from which it may stop charging, %.'),
        ('battery_require_recharge', 'require_recharge', 'Charge below which it must charge, %.'),
        ('battery_margin', 'margin', 'Charge left after the worst leg and the way home, %.'),
    )
    for name, field, description in declared:
        values[field] = node.parameter(
            name,
            int(values[field]),
            description,
            minimum=0,
            maximum=100,
            check=expected(field) if field == 'require_recharge' else None,
            on_change=follow(field),
        )
    try:
        return BatteryLimits(**values)
    except ValueError as error:
        raise ParameterError(f'parameter battery_require_recharge: {error}') from None


def mission_settings(node: PatrolNode) -> MissionSettings:
    """Declare everything about the mission but the deadlines.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    recovery = declare_fields(node, RecoveryLimits(), _RECOVERY, prefix='recovery.')
    settings = MissionSettings(choice=choice_settings(node), recovery=recovery)
    return declare_fields(node, settings, _MISSION)


def deadlines(node: PatrolNode, names: Sequence[str] = tuple(_DEADLINES)) -> Deadlines:
    """Declare the deadlines of the peers, seconds of steady time."""
    described = {name: _DEADLINES[name] for name in names}
    return declare_fields(node, Deadlines(), described, prefix='deadline.')


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
