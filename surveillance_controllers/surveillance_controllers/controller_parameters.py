"""The parameters of the controllers, declared with their descriptions and checked in one place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, field, replace

from surveillance_controllers.battery.model import BatteryParameters
from surveillance_controllers.geometry import Points, Pose
from surveillance_runtime import parameter_checks
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Described, declare_fields

EXECUTION_MODES = ('MANUAL', 'RANDOM', 'SIMULATED')


def execution_mode(node: PatrolNode) -> str:
    """Declare `execution_mode`."""
    mode: str = node.parameter(
        'execution_mode',
        'RANDOM',
        'Where the node takes its actions from: the operator, chance, or the simulated robot.',
        choices=EXECUTION_MODES,
        read_only=True,
    )
    return mode


_RANDOM_SEED = Described(
    'Makes a RANDOM run repeatable; -1 takes another course each time.', minimum=-1
)
_CONSOLE = Described(
    'In MANUAL mode, read commands from standard input; they always come by ~/command too.'
)
_STATION = Described(
    'Where the charging station is: x, y in metres, yaw in radians, world frame.',
    check=parameter_checks.pose,
)
_STATE_FILE = Described(
    'File that keeps what the node models over a restart of its process; empty: nothing is kept.'
)
_DOCK_REACH = Described(
    'SIMULATED: the robot is at the station within this distance of it, m.', 0.0, 100.0
)
_PEER_TIMEOUT = Described(
    'How long map and ontology may take to appear and answer, s of real time.', 0.1, 3600.0
)

_BATTERY_MODEL = {
    field: Described('SIMULATED: ' + text, 0.0)
    for field, text in {
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
    }.items()
}
_BATTERY = {
    'initial_value': Described(
        'Charge at the start, percent.', 0, 100, name='battery_initial_value'
    ),
    'random_seed': _RANDOM_SEED,
    'random_battery_time': Described(
        'RANDOM: shortest and longest time between two changes of the battery, s.',
        check=parameter_checks.times,
    ),
    'recharge_seconds': Described(
        'MANUAL and RANDOM: time in which recharge fills an empty battery, s.', 0.0, 86_400.0
    ),
    'station': _STATION,
    'dock_reach': _DOCK_REACH,
    'update_period': Described(
        'SIMULATED: time between two steps of the battery model, s.',
        *(0.01, 60.0),
        name='battery_update_period',
    ),
    'state_file': _STATE_FILE,
    'console': _CONSOLE,
}
_BATTERY_AT_RUN_TIME = {
    'require_recharge': Described(
        'Below this charge the battery counts as low, percent.',
        *(0, 100),
        name='battery_require_recharge',
    ),
}


@dataclass(frozen=True)
class BatterySettings:
    """What `battery_controller` is told by its parameters; units as declared."""

    initial_value: int = 100
    require_recharge: int = 20
    model: BatteryParameters = field(default_factory=BatteryParameters)
    random_seed: int = -1
    random_battery_time: tuple[float, float] = (10.0, 15.0)
    recharge_seconds: float = 6.0
    station: Pose = (0.0, 0.0, 0.0)
    dock_reach: float = 0.5
    update_period: float = 1.0
    state_file: str = ''
    console: bool = True


def battery_settings(
    node: PatrolNode, on_require_recharge: Callable[[int], None]
) -> BatterySettings:
    """Declare the parameters of `battery_controller`.

    Args:
        node: The node.
        on_require_recharge: Told when `battery_require_recharge` is set at run time.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    model = declare_fields(node, BatteryParameters(), _BATTERY_MODEL, prefix='battery.')
    return declare_fields(
        node,
        declare_fields(node, BatterySettings(model=model), _BATTERY),
        _BATTERY_AT_RUN_TIME,
        on_change=lambda _, value: on_require_recharge(value),
    )


@dataclass(frozen=True)
class Environment:
    """The limits within which the planner plans, metres, world frame."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    def contains(self, point: Sequence[float] | Points) -> bool:
        """Tell whether a point lies within the limits."""
        return bool(self.x_min <= point[0] <= self.x_max and self.y_min <= point[1] <= self.y_max)

    def __str__(self) -> str:
        return f'[{self.x_min:g}, {self.x_max:g}, {self.y_min:g}, {self.y_max:g}]'


_PLANNER = {
    'via_point_count': Described(
        'How many via points motion/planner returns, both ends included.', 2, 10_000
    ),
    'via_point_delay': Described('Time between two feedbacks of motion/planner, s.', 0.0, 60.0),
    'random_seed': _RANDOM_SEED,
    'peer_timeout': _PEER_TIMEOUT,
    'console': _CONSOLE,
}


@dataclass(frozen=True)
class PlannerSettings:
    """What `planner_controller` is told by its parameters; units as declared."""

    environment: Environment = Environment(-1000.0, 1000.0, -1000.0, 1000.0)
    via_point_count: int = 10
    via_point_delay: float = 0.1
    random_seed: int = -1
    peer_timeout: float = 10.0
    console: bool = True

    def spacing(self, length: float) -> float:
        """Return the distance of the via points of a path of `length` metres, metres."""
        return max(length, 1e-6) / (self.via_point_count - 1)


def planner_settings(node: PatrolNode) -> PlannerSettings:
    """Declare the parameters of `planner_controller`.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    settings = declare_fields(node, PlannerSettings(), _PLANNER)
    limits = node.parameter(
        'environment_size',
        list(astuple(settings.environment)),
        'Limits of the place: [x_min, x_max, y_min, y_max], metres, world frame.',
        check=parameter_checks.rectangle,
        read_only=True,
    )
    return replace(settings, environment=Environment(*limits))


_MOTION = {
    'navigator': Described(
        'SIMULATED: who drives the base: this node, or Nav2 by its action navigate_through_poses.',
        choices=('own', 'nav2'),
    ),
    'docking': Described(
        'SIMULATED: a docking server that docks the robot where a way ends at the station.',
        choices=('none', 'opennav'),
    ),
    'dock_type': Described("The dock's type, as the docking server knows it."),
    'station': _STATION,
    'dock_reach': _DOCK_REACH,
    'feedback_period': Described('Time between two feedbacks on the way, s.', 0.01, 60.0),
    'place_reach': Described(
        'MANUAL, RANDOM and Nav2: the robot is in the nearest place within this distance, m.',
        *(0.0, 1000.0),
    ),
    'robot_room': Described(
        'MANUAL, RANDOM and Nav2: the room in which the robot starts; empty: as the map says that '
        'is built from a message.'
    ),
    'state_file': _STATE_FILE,
    'random_seed': _RANDOM_SEED,
    'peer_timeout': _PEER_TIMEOUT,
    'console': _CONSOLE,
}


@dataclass(frozen=True)
class MotionSettings:
    """What `motion_controller` is told by its parameters; units as declared."""

    navigator: str = 'own'
    docking: str = 'none'
    dock_type: str = ''
    station: Pose = (0.0, 0.0, 0.0)
    dock_reach: float = 0.5
    feedback_period: float = 0.2
    place_reach: float = 2.0
    robot_room: str = ''
    state_file: str = ''
    random_seed: int = -1
    peer_timeout: float = 10.0
    console: bool = True


def motion_settings(node: PatrolNode) -> MotionSettings:
    """Declare the parameters of `motion_controller`.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    return declare_fields(node, MotionSettings(), _MOTION)
