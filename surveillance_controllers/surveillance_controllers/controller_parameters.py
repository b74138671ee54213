"""The parameters of the controllers, declared with their descriptions and checked in one place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

from surveillance_controllers.battery_model import BatteryParameters
from surveillance_controllers.polyline import Points
from surveillance_controllers.poses import Pose
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError

EXECUTION_MODES = ('MANUAL', 'RANDOM', 'SIMULATED')

_BATTERY_MODEL = {
    'capacity': 'Energy of a full battery, Wh.',
    'rest_power': 'Drawn all the time, W.',
    'joules_per_metre': 'Drawn by driving, J/m.',
    'joules_per_radian': 'Drawn by turning, J/rad.',
    'equipment_power': 'Drawn by arm and camera while the arm moves, W.',
    'charging_power': 'Given by the station while the battery is below taper_from, W.',
    'taper_from': 'State of charge from which charging slows down, between 0 and 1.',
    'taper_floor': 'Least charging power as a part of charging_power.',
    'empty_voltage': 'Voltage of an empty battery, V.',
    'full_voltage': 'Voltage of a full battery, V.',
}


def execution_mode(node: PatrolNode) -> str:
    """Declares `execution_mode`."""
    mode: str = node.parameter(
        'execution_mode',
        'RANDOM',
        'Where the node takes its actions from: the operator, chance, or the simulated robot.',
        choices=EXECUTION_MODES,
        read_only=True,
    )
    return mode


def random_seed(node: PatrolNode) -> int:
    """Declares `random_seed`."""
    seed: int = node.parameter(
        'random_seed',
        -1,
        'Makes a RANDOM run repeatable; -1 takes another course each time.',
        minimum=-1,
        read_only=True,
    )
    return seed


def reads_console(node: PatrolNode) -> bool:
    """Declares `console`."""
    reads: bool = node.parameter(
        'console',
        True,
        'In MANUAL mode, read commands from standard input; they always come by ~/command too.',
        read_only=True,
    )
    return reads


def _interval(values: Sequence[float]) -> str | None:
    good = len(values) == 2 and 0 < values[0] <= values[1]
    return None if good else 'two numbers above 0, the shortest and the longest time'


def _pose(values: Sequence[float]) -> str | None:
    return None if len(values) == 3 else 'three numbers: x, y, yaw'


def station_pose(node: PatrolNode) -> Pose:
    """Declares `station`."""
    x, y, yaw = node.parameter(
        'station',
        [0.0, 0.0, 0.0],
        'Where the charging station is: x, y in metres, yaw in radians, world frame.',
        check=_pose,
        read_only=True,
    )
    return x, y, yaw


def dock_reach(node: PatrolNode) -> float:
    """Declares `dock_reach`."""
    reach: float = node.parameter(
        'dock_reach',
        0.5,
        'SIMULATED: the robot is at the station within this distance of it, m.',
        minimum=0.0,
        maximum=100.0,
        read_only=True,
    )
    return reach


@dataclass(frozen=True)
class BatterySettings:
    """What `battery_controller` is told by its parameters; units as declared."""

    initial_value: int
    require_recharge: int
    model: BatteryParameters
    random_seed: int
    random_battery_time: tuple[float, float]
    recharge_seconds: float
    station: Pose
    dock_reach: float
    update_period: float
    console: bool


def battery_settings(
    node: PatrolNode, on_require_recharge: Callable[[int], None]
) -> BatterySettings:
    """Declares the parameters of `battery_controller`.

    Args:
        node: The node.
        on_require_recharge: Told when `battery_require_recharge` is set at run time.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    defaults = BatteryParameters()
    model = {
        field.name: node.parameter(
            f'battery.{field.name}',
            getattr(defaults, field.name),
            'SIMULATED: ' + _BATTERY_MODEL[field.name],
            minimum=0.0,
            read_only=True,
        )
        for field in fields(defaults)
    }
    try:
        parameters = BatteryParameters(**model)
    except ValueError as error:
        raise ParameterError(f'parameter battery.{error}') from None
    interval = node.parameter(
        'random_battery_time',
        [10.0, 15.0],
        'RANDOM: shortest and longest time between two changes of the battery, s.',
        check=_interval,
        read_only=True,
    )
    return BatterySettings(
        initial_value=node.parameter(
            'battery_initial_value',
            100,
            'Charge at the start, percent.',
            minimum=0,
            maximum=100,
            read_only=True,
        ),
        require_recharge=node.parameter(
            'battery_require_recharge',
            20,
            'Below this charge the battery counts as low, percent.',
            minimum=0,
            maximum=100,
            on_change=on_require_recharge,
        ),
        model=parameters,
        random_seed=random_seed(node),
        random_battery_time=(interval[0], interval[1]),
        recharge_seconds=node.parameter(
            'recharge_seconds',
            6.0,
            'MANUAL and RANDOM: time in which recharge fills an empty battery, s.',
            minimum=0.0,
            maximum=86_400.0,
            read_only=True,
        ),
        station=station_pose(node),
        dock_reach=dock_reach(node),
        update_period=node.parameter(
            'battery_update_period',
            1.0,
            'SIMULATED: time between two steps of the battery model, s.',
            minimum=0.01,
            maximum=60.0,
            read_only=True,
        ),
        console=reads_console(node),
    )


def peer_timeout(node: PatrolNode) -> float:
    """Declares `peer_timeout`."""
    timeout: float = node.parameter(
        'peer_timeout',
        10.0,
        'How long map and ontology may take to appear and answer, s of real time.',
        minimum=0.1,
        maximum=3600.0,
        read_only=True,
    )
    return timeout


@dataclass(frozen=True)
class Environment:
    """The limits within which the planner plans, metres, world frame."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    def contains(self, point: Sequence[float] | Points) -> bool:
        """Whether a point lies within the limits."""
        return bool(self.x_min <= point[0] <= self.x_max and self.y_min <= point[1] <= self.y_max)

    def __str__(self) -> str:
        return f'[{self.x_min:g}, {self.x_max:g}, {self.y_min:g}, {self.y_max:g}]'


def _limits(values: Sequence[float]) -> str | None:
    good = len(values) == 4 and values[0] < values[1] and values[2] < values[3]
    return None if good else 'four numbers [x_min, x_max, y_min, y_max], each pair rising'


@dataclass(frozen=True)
class PlannerSettings:
    """What `planner_controller` is told by its parameters; units as declared."""

    environment: Environment
    via_point_count: int
    via_point_delay: float
    random_seed: int
    peer_timeout: float
    console: bool

    def spacing(self, length: float) -> float:
        """The distance of the via points of a path of `length` metres, metres."""
        return max(length, 1e-6) / (self.via_point_count - 1)


def planner_settings(node: PatrolNode) -> PlannerSettings:
    """Declares the parameters of `planner_controller`.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    limits = node.parameter(
        'environment_size',
        [-1000.0, 1000.0, -1000.0, 1000.0],
        'Limits of the place: [x_min, x_max, y_min, y_max], metres, world frame.',
        check=_limits,
        read_only=True,
    )
    return PlannerSettings(
        environment=Environment(*limits),
        via_point_count=node.parameter(
            'via_point_count',
            10,
            'How many via points motion/planner returns, both ends included.',
            minimum=2,
            maximum=10_000,
            read_only=True,
        ),
        via_point_delay=node.parameter(
            'via_point_delay',
            0.1,
            'Time between two feedbacks of motion/planner, s.',
            minimum=0.0,
            maximum=60.0,
            read_only=True,
        ),
        random_seed=random_seed(node),
        peer_timeout=peer_timeout(node),
        console=reads_console(node),
    )


@dataclass(frozen=True)
class MotionSettings:
    """What `motion_controller` is told by its parameters; units as declared."""

    navigator: str
    docking: str
    dock_type: str
    station: Pose
    dock_reach: float
    feedback_period: float
    place_reach: float
    random_seed: int
    peer_timeout: float
    console: bool


def motion_settings(node: PatrolNode) -> MotionSettings:
    """Declares the parameters of `motion_controller`.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    return MotionSettings(
        navigator=node.parameter(
            'navigator',
            'own',
            'SIMULATED: who drives the base: this node, or Nav2 by its action navigate_to_pose.',
            choices=('own', 'nav2'),
            read_only=True,
        ),
        docking=node.parameter(
            'docking',
            'none',
            'SIMULATED: a docking server that docks the robot where a way ends at the station.',
            choices=('none', 'opennav'),
            read_only=True,
        ),
        dock_type=node.parameter(
            'dock_type', '', "The dock's type, as the docking server knows it.", read_only=True
        ),
        station=station_pose(node),
        dock_reach=dock_reach(node),
        feedback_period=node.parameter(
            'feedback_period',
            0.2,
            'Time between two feedbacks on the way, s.',
            minimum=0.01,
            maximum=60.0,
            read_only=True,
        ),
        place_reach=node.parameter(
            'place_reach',
            2.0,
            'MANUAL, RANDOM and Nav2: the robot is in the nearest place within this distance, m.',
            minimum=0.0,
            maximum=1000.0,
            read_only=True,
        ),
        random_seed=random_seed(node),
        peer_timeout=peer_timeout(node),
        console=reads_console(node),
    )
