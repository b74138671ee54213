"""What a profile means to the nodes of a run: their parameters, and the names of their topics."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from strict_files.files import FileError
from surveillance_runtime.configuration import Entry, Layer
from surveillance_runtime.parameters import specs_of
from surveillance_runtime.profile.reading import ProfileFile
from surveillance_runtime.profile.record import MOST_TIMEOUT, RobotProfile

MONITOR = 'collision_monitor'
MODEL_TOPIC = 'battery_state'
BESIDE_NAV2 = 'patrol'
"""Where Nav2 drives, the action `follow_path` and the topic `plan` are in this namespace below the
robot's own: Nav2's controller and planner have those names."""
DRIVER_TOPIC = 'robot_battery_state'
"""What `battery_controller` calls the topic of a driver of the battery."""

_EVERY = '/**'
_PARAMETERS = {
    'topics.scans': ('robot.scans',),
    'frames.map': ('robot.frames.map',),
    'frames.odom': ('robot.frames.odom',),
    'frames.base': ('robot.frames.base',),
    'frames.scans': ('robot.frames.scans',),
    'frames.camera': ('robot.frames.camera',),
    'frames.transform_tolerance': ('robot.frames.transform_tolerance',),
    'lidars.mounts': ('lidar_mounts',),
    'lidars.sweep': ('robot.sweep',),
    'odometry.scale': ('odometry.scale',),
    'odometry.turn_scale': ('odometry.turn_scale',),
    'lidars.height': ('simulator:physics.lidar_height',),
    'body.height': ('simulator:physics.height',),
    'body.footprint': ('robot.footprint',),
    'drive.deceleration': ('robot_deceleration',),
    'drive.speed': ('motion_controller:drive.speed', 'explorer:drive.speed'),
    'drive.turn': ('motion_controller:drive.turn', 'explorer:drive.turn'),
    'drive.acceleration': ('motion_controller:drive.acceleration', 'explorer:drive.acceleration'),
    'drive.turn_acceleration': (
        'motion_controller:drive.turn_acceleration',
        'explorer:drive.turn_acceleration',
    ),
    'wheels.separation': ('simulator:physics.wheel_separation',),
    'wheels.radius': ('simulator:physics.wheel_radius',),
    'wheels.speed': ('simulator:base.speed',),
    'wheels.turn_speed': ('simulator:base.turn_speed',),
    'wheels.acceleration': ('simulator:base.acceleration',),
    'wheels.turn_acceleration': ('simulator:base.turn_acceleration',),
    'types.arm': ('arm_controller:robot.arm_type',),
    'topics.arm': ('arm_controller:robot.arm_action',),
    'battery.source': ('battery_controller:source.source',),
    'battery.full': ('battery_controller:source.full',),
    'battery.voltages': ('battery_controller:source.voltages',),
    'battery.timeout': ('battery_controller:source.timeout',),
    'dock.navigator': ('motion_controller:navigator',),
    'dock.docking': ('motion_controller:docking',),
    'dock.dock_type': ('motion_controller:dock_type',),
    'dock.staging': ('motion_controller:dock_staging',),
    'dock.reach': ('battery_controller:dock_reach', 'motion_controller:dock_reach'),
}
"""Parameters that a value of the profile is for, `NODE:NAME`, or NAME of every node that has it.

`body.radius` and the names of topics are no such values: see `profile_layer` and `remappings`.
"""


def profile_layer(file: ProfileFile) -> Layer:
    """Return the parameters that a profile gives to the nodes."""
    return Layer(str(file.path), tuple(_entries(file)))


def _entries(file: ProfileFile) -> Iterator[Entry]:
    profile = file.profile
    values = {spec.name: spec.default for spec in specs_of(profile)}
    for name, targets in _PARAMETERS.items():
        origin = profile.origins.get(name, f'{file.path} (by default)')
        for target in targets:
            node, _, parameter = target.rpartition(':')
            pattern = f'/**/{node}' if node else _EVERY
            yield Entry(pattern, parameter, values[name], origin)
    where = 'body.footprint' if profile.body.footprint else 'body.radius'
    origin = profile.origins.get(where, f'{file.path} (by default)')
    yield Entry(_EVERY, 'robot_radius', profile.body.reach, origin)
    yield from _of_commands(file)


def _of_commands(file: ProfileFile) -> Iterator[Entry]:
    origin = file.profile.origins.get('types.command', f'{file.path} (by default)')
    for node in (MONITOR, 'simulator'):
        yield Entry(f'/**/{node}', 'robot.command_type', file.profile.types.command, origin)
    yield Entry(f'/**/{MONITOR}', 'robot.wanted_type', file.profile.wanted_type, origin)


def check_behaviour(file: ProfileFile, behaviour: str) -> None:
    """Make sure that a robot can do what a behaviour asks of it.

    Raises:
        FileError: It has no arm, and the behaviour looks around with one.
    """
    if behaviour == 'patrol' and file.profile.arm == 'none':
        origin = file.profile.origins.get('arm', str(file.path))
        raise FileError(
            f'{origin}: arm: none, but --behaviour patrol looks for markers with a camera on an '
            'arm: expected --behaviour surveillance, or a robot with an arm'
        )


def check_base(file: ProfileFile, mode: str) -> None:
    """Make sure that a real base is known to stand when nobody commands it any more.

    Raises:
        FileError: It takes too long, and nobody says that it may; or nobody says how long.
    """
    drive, name = file.profile.drive, 'drive.command_timeout'
    if mode != 'ROBOT' or drive.long_timeout:
        return
    expected = (
        f'expected at most {MOST_TIMEOUT:g} s (cmd_vel_timeout of its driver), or '
        'drive.long_timeout: true where the robot may drive on when the patrol dies'
    )
    if name not in file.profile.origins:
        raise FileError(
            f'{file.path}: {name} is missing, after how many seconds of silence the base stands: '
            f'{expected}; `doctor --move` measures it'
        )
    if drive.command_timeout > MOST_TIMEOUT:
        raise FileError(f'{file.profile.origins[name]}: {drive.command_timeout:g} s: {expected}')


def unmonitored_entries(file: ProfileFile, nodes: Collection[str]) -> Iterator[Entry]:
    """Yield what changes when nobody monitors: the controller talks to the base itself."""
    if 'motion_controller' in nodes and MONITOR not in nodes:
        origin = f'no {MONITOR}'
        yield Entry(
            '/**/motion_controller', 'robot.command_type', file.profile.types.command, origin
        )


def remappings(profile: RobotProfile, nodes: Collection[str], mode: str) -> list[tuple[str, str]]:
    """Return from which name to which each topic is renamed, for all nodes of a run alike.

    Args:
        profile: The robot.
        nodes: Names of the nodes that the run starts.
        mode: The run's; in ROBOT the topic of the battery is a driver's.
    """
    topics = profile.topics
    monitored = MONITOR in nodes or 'motion_controller' not in nodes
    pairs = {
        'cmd_vel': topics.wanted if monitored else topics.command,
        'cmd_vel_monitored': topics.command,
        'odom': topics.odom,
        'imu': topics.imu,
        'map': topics.map,
        'camera/rgb/image_raw': topics.image,
        'camera/rgb/camera_info': topics.camera_info,
        'joint_states': topics.joint_states,
        'arm/joint_trajectory': topics.arm,
    }
    if profile.dock.navigator == 'nav2':
        pairs |= out_of_nav2s_way()
    if len(topics.scans) == 1:
        pairs['scan'] = topics.scans[0]
    if mode == 'ROBOT' and profile.battery.source == 'topic':
        pairs[MODEL_TOPIC] = pairs[DRIVER_TOPIC] = topics.battery
    return [(old, new) for old, new in pairs.items() if new and old != new]


def out_of_nav2s_way() -> dict[str, str]:
    """Return what this project's names become that Nav2 has, too, with other types.

    rcl renames the services and topics of an action, and not the action (Jazzy).
    """
    parts = ('send_goal', 'cancel_goal', 'get_result', 'feedback', 'status')
    names = [*(f'follow_path/_action/{part}' for part in parts), 'plan']
    return {name: f'{BESIDE_NAV2}/{name}' for name in names}


def parameter_values(profile: RobotProfile) -> dict[str, Any]:
    """Return each value of a profile by its key."""
    return {spec.name: spec.default for spec in specs_of(profile)}
