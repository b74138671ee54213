"""The parameters of the behaviour's nodes, declared and checked in one place.

What can sensibly change while the mission runs may be set at run time, and counts from the next
choice on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

from surveillance_behaviour.chooser import ChoiceSettings
from surveillance_behaviour.mission import MissionSettings
from surveillance_behaviour.policy.battery import BatteryLimits
from surveillance_behaviour.policy.policies import DEFAULT_POLICY, POLICIES
from surveillance_behaviour.policy.rules import DEFAULT_RULES, Rules
from surveillance_behaviour.recovery import RecoveryLimits
from surveillance_behaviour.ros_ports import Deadlines
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError

_DEADLINES = {
    'answer': "a service's answer, and for a goal to be accepted",
    'build': 'the ontology to be built, and for looking around at the start',
    'plan': 'a path; 0: as long as the planner lives',
    'move': 'following a path; 0: as long as the controller lives',
    'charge': 'the battery to get on while it is charged by `recharge`; 0: for ever',
}
_RECOVERY = {
    'path_tries': 'Times a place is tried before another one is chosen.',
    'place_tries': 'Places given up in a row before the robot goes back.',
    'avoid_seconds': 'How long a place that was given up is left alone at first, s.',
    'longest_avoid': 'The longest time a place is left alone, s.',
    'help_seconds': 'The first pause while waiting for help, s.',
    'longest_help': 'The longest pause while waiting for help, s.',
}


def choice_settings(node: PatrolNode) -> ChoiceSettings:
    """Declares what a choice depends on; the result follows changes at run time.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    default = ChoiceSettings()
    settings = ChoiceSettings()

    def follow(name: str) -> Callable[[Any], None]:
        return lambda value: setattr(settings, name, value)

    settings.urgency_threshold = node.parameter(
        'urgency_threshold',
        int(default.urgency_threshold),
        'Seconds without a visit after which a place is URGENT.',
        minimum=0,
        maximum=10**9,
        on_change=follow('urgency_threshold'),
    )
    settings.exploration_seconds = node.parameter(
        'exploration_seconds',
        default.exploration_seconds,
        'Seconds the robot takes to explore a place.',
        minimum=0.0,
        maximum=86400.0,
        on_change=follow('exploration_seconds'),
    )
    settings.speed = node.parameter(
        'robot_speed',
        default.speed,
        "Metres per second at which the robot drives, to tell a move's time.",
        minimum=0.001,
        maximum=100.0,
        on_change=follow('speed'),
    )
    settings.policy = node.parameter(
        'policy',
        DEFAULT_POLICY,
        'How a place is chosen among those that the rules allow.',
        choices=tuple(POLICIES),
        on_change=follow('policy'),
    )
    settings.rules = Rules(
        tuple(
            node.parameter(
                'rooms_priority',
                list(DEFAULT_RULES),
                'Classes of places by falling priority; empty: any place within reach.',
                of=str,
                check=_rules_expected,
                on_change=lambda names: setattr(settings, 'rules', Rules(tuple(names))),
            )
        )
    )
    settings.recharge_rooms = tuple(
        node.parameter(
            'recharge_rooms',
            list(default.recharge_rooms),
            'Places with a charging station.',
            of=str,
            check=lambda names: None if names else 'at least one place',
            on_change=lambda names: setattr(settings, 'recharge_rooms', tuple(names)),
        )
    )
    settings.battery = _battery_limits(node, settings)
    return settings


def _battery_limits(node: PatrolNode, settings: ChoiceSettings) -> BatteryLimits:
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
    """Declares everything about the mission but the deadlines.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    default = MissionSettings()
    recovery = {
        field.name: node.parameter(
            f'recovery.{field.name}',
            getattr(default.recovery, field.name),
            _RECOVERY[field.name],
            minimum=1 if 'tries' in field.name else 0.0,
            maximum=1000 if 'tries' in field.name else 86400.0,
            read_only=True,
        )
        for field in fields(RecoveryLimits)
    }
    return MissionSettings(
        choice=choice_settings(node),
        recovery=RecoveryLimits(**recovery),
        arrival_tolerance=node.parameter(
            'arrival_tolerance',
            default.arrival_tolerance,
            "How far from its path's end the robot may stop and still have arrived, m.",
            minimum=0.0,
            maximum=1000.0,
            read_only=True,
        ),
        goal_tolerance=node.parameter(
            'goal_tolerance',
            default.goal_tolerance,
            "How far from the goal a planner's path may end, m.",
            minimum=0.0,
            maximum=1000.0,
            read_only=True,
        ),
        charge_stall_seconds=node.parameter(
            'charge_stall_seconds',
            default.charge_stall_seconds,
            'How long the level may stay the same at the station before the robot docks anew, s; '
            '0: for ever.',
            minimum=0.0,
            maximum=86400.0,
            read_only=True,
        ),
    )


def deadlines(node: PatrolNode, names: Sequence[str] = tuple(_DEADLINES)) -> Deadlines:
    """Declares the deadlines of the peers, seconds of steady time."""
    default = Deadlines()
    return Deadlines(
        **{
            name: node.parameter(
                f'deadline.{name}',
                getattr(default, name),
                f'Seconds of real time for {_DEADLINES[name]}.',
                minimum=0.1 if name in ('answer', 'build') else 0.0,
                maximum=86400.0,
                read_only=True,
            )
            for name in names
        }
    )


def random_seed(node: PatrolNode) -> int:
    """Declares the seed of the policies that take a chance."""
    seed: int = node.parameter(
        'random_seed',
        -1,
        'Makes the policies that draw repeatable; -1 takes another course each time.',
        minimum=-1,
        read_only=True,
    )
    return seed


def _rules_expected(names: Sequence[str]) -> str | None:
    try:
        Rules(tuple(names))
    except ValueError as error:
        return f'names of classes of places, each once ({error})'
    return None
