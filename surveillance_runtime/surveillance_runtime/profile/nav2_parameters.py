"""Parameters of Nav2 for a robot, from its profile, laid over those that Nav2 itself comes with.

What Nav2's own file has, plugins and tuning, stays; what the profile knows takes its place: frames,
topics, footprint, speeds, the type of the commands. So a robot is described once. Names are those
of Nav2 for Jazzy (`nav2_bringup/params/nav2_params.yaml`) and of slam_toolbox.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from surveillance_runtime.profile.record import RobotProfile

PARAMETERS = 'ros__parameters'
_COSTMAPS = ('local_costmap', 'global_costmap')


@dataclass(frozen=True)
class Nav2Setting:
    """One parameter of a node of Nav2.

    Attributes:
        path: Keys from the node on, without `ros__parameters`.
        value: Its value.
        is_new: Whether it is set where Nav2's file does not have it; else it belongs to a plugin
            that the file may not use.
    """

    path: tuple[str, ...]
    value: Any
    is_new: bool = True


def settings(profile: RobotProfile, *, use_sim_time: bool = False) -> Iterator[Nav2Setting]:
    """Yield what a profile says to Nav2 and slam_toolbox."""
    frames, topics, drive = profile.frames, profile.topics, profile.drive
    scan = topics.scans[0]
    for name, value in (
        ('base_frame_id', frames.base),
        ('odom_frame_id', frames.odom),
        ('global_frame_id', frames.map),
        ('scan_topic', scan),
    ):
        yield Nav2Setting(('amcl', name), value)
    for name, value in (
        ('base_frame', frames.base),
        ('odom_frame', frames.odom),
        ('map_frame', frames.map),
        ('scan_topic', scan),
        ('mode', 'mapping'),
    ):
        yield Nav2Setting(('slam_toolbox', name), value)
    yield Nav2Setting(('slam_toolbox', 'resolution'), 0.05)
    yield Nav2Setting(('bt_navigator', 'robot_base_frame'), frames.base)
    yield Nav2Setting(('bt_navigator', 'global_frame'), frames.map)
    yield Nav2Setting(('bt_navigator', 'odom_topic'), topics.odom)
    yield from _of_costmaps(profile)
    yield Nav2Setting(('behavior_server', 'robot_base_frame'), frames.base)
    yield Nav2Setting(('behavior_server', 'local_frame'), frames.odom)
    yield Nav2Setting(('behavior_server', 'global_frame'), frames.map)
    yield Nav2Setting(('behavior_server', 'max_rotational_vel'), drive.turn)
    yield from _of_speeds(profile)
    yield Nav2Setting(('collision_monitor', 'base_frame_id'), frames.base)
    yield Nav2Setting(('collision_monitor', 'odom_frame_id'), frames.odom)
    out = topics.wanted if profile.dock.monitor == 'own' else topics.command
    yield Nav2Setting(('collision_monitor', 'cmd_vel_out_topic'), out)
    stamped = profile.types.command == 'TwistStamped'
    for node in (
        'controller_server',
        'behavior_server',
        'velocity_smoother',
        'collision_monitor',
        'docking_server',
    ):
        yield Nav2Setting((node, 'enable_stamped_cmd_vel'), stamped)
    for node in ('amcl', 'slam_toolbox', 'bt_navigator', 'controller_server', 'planner_server'):
        yield Nav2Setting((node, 'use_sim_time'), use_sim_time)


def _of_costmaps(profile: RobotProfile) -> Iterator[Nav2Setting]:
    corners = list(zip(profile.body.footprint[::2], profile.body.footprint[1::2], strict=True))
    for name in _COSTMAPS:
        where = (name, name)
        yield Nav2Setting((*where, 'robot_base_frame'), profile.frames.base)
        if corners:
            text = ', '.join(f'[{x:g}, {y:g}]' for x, y in corners)
            yield Nav2Setting((*where, 'footprint'), f'[{text}]')
        else:
            yield Nav2Setting((*where, 'robot_radius'), profile.body.radius)
        for layer in ('obstacle_layer', 'voxel_layer'):
            for index, scan in enumerate(profile.topics.scans):
                source = 'scan' if index == 0 else f'scan{index + 1}'
                yield Nav2Setting((*where, layer, source, 'topic'), scan, is_new=index > 0)
    yield Nav2Setting(('local_costmap', 'local_costmap', 'global_frame'), profile.frames.odom)
    yield Nav2Setting(('global_costmap', 'global_costmap', 'global_frame'), profile.frames.map)


def _of_speeds(profile: RobotProfile) -> Iterator[Nav2Setting]:
    drive = profile.drive
    plugin = ('controller_server', 'FollowPath')
    for name, value in (
        # MPPI, the controller of Nav2's file for Jazzy.
        ('vx_max', drive.speed),
        ('wz_max', drive.turn),
        ('ax_max', drive.acceleration),
        ('ax_min', -drive.deceleration),
        ('az_max', drive.turn_acceleration),
        # DWB, that of older ones.
        ('max_vel_x', drive.speed),
        ('max_speed_xy', drive.speed),
        ('max_vel_theta', drive.turn),
        ('acc_lim_x', drive.acceleration),
        ('decel_lim_x', -drive.deceleration),
        ('acc_lim_theta', drive.turn_acceleration),
        ('decel_lim_theta', -drive.turn_acceleration),
    ):
        yield Nav2Setting((*plugin, name), value, is_new=False)
    smoother = 'velocity_smoother'
    yield Nav2Setting((smoother, 'max_velocity'), [drive.speed, 0.0, drive.turn])
    yield Nav2Setting((smoother, 'min_velocity'), [-drive.speed, 0.0, -drive.turn])
    yield Nav2Setting((smoother, 'max_accel'), [drive.acceleration, 0.0, drive.turn_acceleration])
    yield Nav2Setting((smoother, 'max_decel'), [-drive.deceleration, 0.0, -drive.turn_acceleration])
    yield Nav2Setting((smoother, 'odom_topic'), profile.topics.odom)


def laid_over(
    nav2: Mapping[str, Any], profile: RobotProfile, *, use_sim_time: bool = False
) -> dict[str, Any]:
    """Return Nav2's parameters with those of a robot in their place.

    Args:
        nav2: What Nav2's own file holds.
        profile: The robot.
        use_sim_time: Whether all live by a simulation's clock.
    """
    result: dict[str, Any] = copy.deepcopy(dict(nav2))
    for setting in settings(profile, use_sim_time=use_sim_time):
        depth = 2 if setting.path[0] in _COSTMAPS else 1
        keys = (*setting.path[:depth], PARAMETERS, *setting.path[depth:])
        at: Any = result
        for key in keys[:-1]:
            if key not in at and not setting.is_new:
                break
            at = at.setdefault(key, {})
        else:
            if setting.is_new or keys[-1] in at:
                at[keys[-1]] = setting.value
    for costmap in _COSTMAPS:
        given = result.get(costmap, {}).get(costmap, {}).get(PARAMETERS, {})
        if profile.body.footprint:
            given.pop('robot_radius', None)
        else:
            given.pop('footprint', None)
        for layer in ('obstacle_layer', 'voxel_layer'):
            _complete_sources(given, layer, len(profile.topics.scans))
    return result


def _complete_sources(costmap: dict[str, Any], layer: str, lidars: int) -> None:
    """Let the further lidars of a layer be like the first; a layer that is not used goes again."""
    sources = costmap.get(layer)
    if not sources:
        return
    if 'scan' not in sources:
        if layer not in costmap.get('plugins', ()):
            del costmap[layer]
        return
    names = ['scan', *(f'scan{index + 1}' for index in range(1, lidars))]
    for name in names[1:]:
        sources[name] = {**sources['scan'], **sources.get(name, {})}
    sources['observation_sources'] = ' '.join(names)
