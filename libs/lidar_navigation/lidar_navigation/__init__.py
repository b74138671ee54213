"""A wheeled robot with a lidar, without ROS: where it is, how it gets there, what it has not seen.

Begin with `python -m lidar_navigation.demo`, then `Navigator`: odometry and scans go in, a velocity
comes out. `localisation` says where the robot is, `planning` finds paths, `driving` follows them,
`exploration` maps a building. What this module lists is public, and imported when it is first used.

Public modules: `geometry`, `robot_base`, `coverage`, `driving.path_following`,
`exploration.scan_matching`, `localisation.odometry`, `localisation.scan_fit`, `testing`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lidar_navigation.driving.driving import Drive as Drive
    from lidar_navigation.driving.driving import DriveState as DriveState
    from lidar_navigation.driving.driving import Spin as Spin
    from lidar_navigation.driving.navigator import Navigator as Navigator
    from lidar_navigation.driving.path_following import DriveParameters as DriveParameters
    from lidar_navigation.driving.path_following import Velocity as Velocity
    from lidar_navigation.exploration.exploration import Exploration as Exploration
    from lidar_navigation.exploration.exploration import Phase as Phase
    from lidar_navigation.exploration.foreign_map import ForeignMap as ForeignMap
    from lidar_navigation.exploration.frontiers import FrontierParameters as FrontierParameters
    from lidar_navigation.exploration.map_building import MapBuilder as MapBuilder
    from lidar_navigation.exploration.map_building import MappingParameters as MappingParameters
    from lidar_navigation.footprint import Footprint as Footprint
    from lidar_navigation.localisation.localisation import Localiser as Localiser
    from lidar_navigation.localisation.mount_check import MountCheck as MountCheck
    from lidar_navigation.localisation.mount_check import MountFinding as MountFinding
    from lidar_navigation.localisation.place_locator import PlaceLocator as PlaceLocator
    from lidar_navigation.localisation.true_odometry import TrueOdometry as TrueOdometry
    from lidar_navigation.planning.grid_planning import GridPlanner as GridPlanner
    from lidar_navigation.planning.grid_planning import NoPathError as NoPathError
    from lidar_navigation.planning.grid_planning import PlanningParameters as PlanningParameters

_HOME = {
    'Drive': 'driving.driving',
    'DriveParameters': 'driving.path_following',
    'DriveState': 'driving.driving',
    'Exploration': 'exploration.exploration',
    'Footprint': 'footprint',
    'ForeignMap': 'exploration.foreign_map',
    'FrontierParameters': 'exploration.frontiers',
    'GridPlanner': 'planning.grid_planning',
    'Localiser': 'localisation.localisation',
    'MapBuilder': 'exploration.map_building',
    'MappingParameters': 'exploration.map_building',
    'MountCheck': 'localisation.mount_check',
    'MountFinding': 'localisation.mount_check',
    'Navigator': 'driving.navigator',
    'NoPathError': 'planning.grid_planning',
    'Phase': 'exploration.exploration',
    'PlaceLocator': 'localisation.place_locator',
    'PlanningParameters': 'planning.grid_planning',
    'Spin': 'driving.driving',
    'TrueOdometry': 'localisation.true_odometry',
    'Velocity': 'driving.path_following',
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
