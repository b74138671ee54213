"""The parameters of the controllers, declared with their descriptions and checked in one place."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from floor_plans import Station
from lidar_navigation.geometry import Points
from strict_files.settings import converted, parameter
from surveillance_controllers.battery import BatteryParameters
from surveillance_controllers.battery_driver import DriverSettings
from surveillance_runtime import parameter_checks
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_parameters import described_stations

EXECUTION_MODES = ('MANUAL', 'RANDOM', 'SIMULATED', 'ROBOT')
DRIVING_MODES = ('SIMULATED', 'ROBOT')
"""In these a base drives, simulated or real."""


@dataclass(frozen=True)
class ControllerSettings:
    """What every controller is told by its parameters."""

    execution_mode: str = parameter(
        'RANDOM',
        'Where the node takes its actions from: the operator, chance, a simulated or a real robot.',
        choices=EXECUTION_MODES,
    )
    random_seed: int = parameter(
        -1, 'Makes a RANDOM run repeatable; -1 takes another course each time.', minimum=-1
    )
    console: bool = parameter(
        True,
        'In MANUAL mode, read commands from standard input; they always come by ~/command too.',
    )

    @property
    def drives(self) -> bool:
        """Whether a base drives, simulated or real."""
        return self.execution_mode in DRIVING_MODES


@dataclass(frozen=True)
class PeerSettings(ControllerSettings):
    """What a controller is told that asks for map and ontology."""

    peer_timeout: float = parameter(
        10.0,
        'How long map and ontology may take to appear and answer, s of real time.',
        0.1,
        3600.0,
    )


STATION_NOT_GIVEN: Mapping[str, Station] = {'': Station((0.0, 0.0, 0.0))}
"""Where a robot is taken to charge of which nobody says it: where its map begins."""


@dataclass(frozen=True)
class StationSettings(ControllerSettings):
    """What a controller is told that models where the robot is or how far it is charged.

    Attributes:
        stations: The charging stations by their rooms.
    """

    stations: Mapping[str, Station] = field(default_factory=lambda: STATION_NOT_GIVEN)
    dock_reach: float = parameter(
        0.5,
        'SIMULATED and ROBOT: the robot is at the station within this distance of it, m.',
        0.0,
        100.0,
    )
    state_file: str = parameter(
        '',
        'File that keeps what the node models over a restart of its process; empty: nothing is '
        'kept.',
    )


@dataclass(frozen=True)
class BatterySettings(StationSettings):
    """What `battery_controller` is told by its parameters; units as declared."""

    initial_value: int = parameter(
        100, 'Charge at the start, percent.', 0, 100, name='battery_initial_value'
    )
    require_recharge: int = 20
    model: BatteryParameters = field(default_factory=BatteryParameters)
    driver: DriverSettings = field(default_factory=DriverSettings)
    random_battery_time: tuple[float, float] = parameter(
        (10.0, 15.0),
        'RANDOM: shortest and longest time between two changes of the battery, s.',
        check=parameter_checks.times,
    )
    recharge_seconds: float = parameter(
        6.0, 'MANUAL and RANDOM: time in which recharge fills an empty battery, s.', 0.0, 86_400.0
    )
    update_period: float = parameter(
        1.0,
        'SIMULATED and ROBOT: time between two steps of the battery model, s.',
        0.01,
        60.0,
        name='battery_update_period',
    )


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
    settings = node.declare_fields(BatterySettings())
    return replace(
        settings,
        stations=described_stations(node) or STATION_NOT_GIVEN,
        model=node.declare_fields(settings.model, prefix='battery.', mode='SIMULATED and ROBOT'),
        driver=node.declare_fields(settings.driver, prefix='source.'),
        require_recharge=node.parameter(
            'battery_require_recharge',
            settings.require_recharge,
            'Below this charge the battery counts as low, percent.',
            minimum=0,
            maximum=100,
            on_change=on_require_recharge,
        ),
    )


@dataclass(frozen=True)
class MapLimits:
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


@dataclass(frozen=True)
class PlannerSettings(PeerSettings):
    """What `planner_controller` is told by its parameters; units as declared."""

    environment: MapLimits = converted(
        lambda limits: MapLimits(*limits),
        [-1000.0, 1000.0, -1000.0, 1000.0],
        'Limits of the place: [x_min, x_max, y_min, y_max], metres, world frame.',
        name='environment_size',
        check=parameter_checks.rectangle,
    )
    via_point_count: int = parameter(
        10, 'How many via points motion/planner returns, both ends included.', 2, 10_000
    )
    via_point_delay: float = parameter(
        0.1, 'Time between two feedbacks of motion/planner, s.', 0.0, 60.0
    )

    def spacing(self, length: float) -> float:
        """Return the distance of the via points of a path of `length` metres, metres."""
        return max(length, 1e-6) / (self.via_point_count - 1)


@dataclass(frozen=True)
class MotionSettings(PeerSettings, StationSettings):
    """What `motion_controller` is told by its parameters; units as declared."""

    navigator: str = parameter(
        'own',
        'SIMULATED and ROBOT: who drives the base: this node, or Nav2 by its action '
        'navigate_through_poses.',
        choices=('own', 'nav2'),
    )
    docking: str = parameter(
        'none',
        'SIMULATED and ROBOT: a docking server that docks the robot where a way ends at the '
        'station.',
        choices=('none', 'opennav'),
    )
    dock_type: str = parameter('', "The dock's type, as the docking server knows it.")
    dock_staging: float = parameter(
        0.0,
        'How far before its dock the robot is brought, m; 0: the docking server brings it to its '
        'staging pose, by Nav2 (0.7 where this node drives).',
        0.0,
        5.0,
    )
    feedback_period: float = parameter(0.2, 'Time between two feedbacks on the way, s.', 0.01, 60.0)
    place_reach: float = parameter(
        2.0,
        'MANUAL and RANDOM: the robot is in the nearest place within this distance, m.',
        0.0,
        1000.0,
    )
    start_pose: tuple[float, ...] = parameter(
        (),
        'SIMULATED and ROBOT: where the robot starts, as the first guess of where it is: x, y in '
        'metres, yaw in radians; empty: at the station.',
        of=float,
        check=parameter_checks.pose_or_none,
    )
    robot_room: str = parameter(
        '',
        'MANUAL, RANDOM and Nav2: the room in which the robot starts; empty: as the map says that '
        'is built from a message.',
    )


def motion_settings(node: PatrolNode) -> MotionSettings:
    """Declare the parameters of `motion_controller`, but those of its own navigation.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    stations = described_stations(node) or STATION_NOT_GIVEN
    return replace(node.declare_fields(MotionSettings()), stations=stations)


@dataclass(frozen=True)
class NavigationSettings:
    """What `motion_controller` is told of its own navigation where a base drives."""

    sensor_timeout: float = parameter(
        5.0, 'how long map, odom and scan may be silent, s of real time.', 0.1, 3600.0
    )
    track_place: bool = parameter(
        True, 'robot_place follows the robot on its way, not at its end alone.'
    )
    spin: bool = parameter(
        True, 'motion/controller ends with one turn on the spot.', name='spin_on_arrival'
    )
