"""The command `doctor`: what a mission awaits of a robot, what comes, what is missing, and what
cannot be true; with consent it moves the robot to see."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import rclpy
from lifecycle_msgs.srv import GetState
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from indoor_watch import detectors
from lidar_navigation import Footprint
from lidar_navigation.geometry import Mount
from strict_files.files import replace_text
from surveillance_operator.motion_probe import NEAR, MotionProbe
from surveillance_operator.watch_command import mission_parser, ros_arguments
from surveillance_runtime.graph_check import Listener
from surveillance_runtime.profile import find_profile, read_profile
from surveillance_runtime.profile.check_up import (
    awaited,
    findings,
    looked_at,
    named,
    table,
    unplaced,
)
from surveillance_runtime.profile.motion_check import MotionRecord, motion_doubts
from surveillance_runtime.profile.record import RobotProfile
from surveillance_runtime.profile.truth_check import RobotDoubt, amended, doubts
from surveillance_runtime.run_options import BUILT_IN_ROBOT, OPTIONS

_IN_CHECKOUT = Path(__file__).resolve().parents[2] / 'config'
_INSTALLED = Path(sys.prefix) / 'share' / 'surveillance' / 'config'
CONFIG = _IN_CHECKOUT if _IN_CHECKOUT.exists() else _INSTALLED
NAV2_NODES = (
    'map_server',
    'amcl',
    'controller_server',
    'planner_server',
    'behavior_server',
    'bt_navigator',
    'velocity_smoother',
    'collision_monitor',
    'docking_server',
)
"""Nodes of Nav2 that have to be active where they run."""
SECONDS = 4.0
"""For how long is listened, unless asked otherwise; s."""


def main(argv: Sequence[str] | None = None) -> int:
    """Listen for some seconds and print a report; exit code 1: something needed is missing."""
    parser = mission_parser(
        'doctor',
        'Looks at the topics of a robot for some seconds and says what a mission awaits, what '
        'comes (who, type, quality of service, rate, frame, age of the stamps), what is missing '
        'and the nearest that is there.',
    )
    parser.add_argument(
        '--robot', default=BUILT_IN_ROBOT, metavar='NAME|FILE', help=OPTIONS['robot'].help
    )
    parser.add_argument(
        '--seconds',
        type=float,
        default=SECONDS,
        metavar='SECONDS',
        help='how long to listen (default: %(default)g)',
    )
    parser.add_argument(
        '--move',
        action='store_true',
        help='also moves the robot, 30 cm forth and back and a quarter turn, and compares what '
        'odometry and scans say of it; asks before it does',
    )
    parser.add_argument('--yes', action='store_true', help='with --move: do not ask')
    parser.add_argument(
        '--write', action='store_true', help='write what is found into the profile, if it is a file'
    )
    options = parser.parse_args(argv)
    if not 0.5 <= options.seconds <= 3600.0:
        parser.error(f'--seconds {options.seconds:g}: expected 0.5 to 3600')
    try:
        file = read_profile(find_profile(CONFIG, options.robot))
    except ValueError as error:
        parser.error(str(error))
    profile = file.profile
    options.namespace = options.namespace or profile.namespace
    wanted = awaited(profile, options.namespace)
    rclpy.init(args=ros_arguments(parser, options))
    node = Node('robot_doctor', start_parameter_services=False, enable_rosout=False)
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def spin(seconds: float) -> None:
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=min(left, 0.1))

    moved: MotionRecord | None = None
    mount = _mount_of(profile)
    try:
        within = 0.8 * Footprint(profile.body.radius, profile.body.footprint).inscribed
        every = (*wanted, *looked_at(profile, options.namespace))
        listener, until = Listener(node, every, within=within), time.monotonic() + options.seconds
        while time.monotonic() < until:
            listener.look()
            spin(0.1)
        seen = listener.look()
        if profile.dock.navigator == 'nav2':
            seen = replace(seen, **_of_nav2(node, options.namespace, spin))
        if mount is None and (heard := seen.heard.get(wanted[2].topic)) is not None:
            x, y, yaw, upside_down = seen.places.get(heard.frame, (0.0, 0.0, 0.0, False))
            mount = Mount((x, y, yaw), upside_down)
        if options.move:
            probe = MotionProbe(node, profile, options.namespace, mount or Mount())
            spin(1.0)
            moved = _moved(probe, spin, asks=not options.yes)
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    print(f'robot {profile.name}, listened for {options.seconds:g} s')
    for line in (
        *table(wanted, seen, options.seconds),
        *unplaced(profile, seen, options.namespace),
    ):
        print(line)
    if seen.publishers.get(named(profile.topics.image, options.namespace)):
        with suppress(ValueError):
            print(detectors.described())
    found = list(doubts(profile, seen, options.namespace))
    if moved is not None:
        found += motion_doubts(moved, profile, (mount or Mount(),))
    for doubt in found:
        print(f'DOUBT   {doubt.text}' + (f'\n        write: {doubt.line}' if doubt.key else ''))
    if moved is not None and not found:
        print('it moves as it is commanded, and odometry and scans agree')
    _amend(file.path, found, writes=options.write)
    lacking = any(each.is_needed and any(findings(each, seen, 0.0)) for each in wanted)
    return 1 if lacking or found else 0


def _mount_of(profile: RobotProfile) -> Mount | None:
    """Return where the first lidar sits by the profile; None: tf_static says it."""
    if not profile.lidars.mounts:
        return None
    x, y, yaw, roll = profile.lidars.mounts[:4]
    return Mount((x, y, yaw), math.cos(roll) < 0.0)


def _moved(probe: MotionProbe, spin: Callable[[float], None], *, asks: bool) -> MotionRecord | None:
    """Move the robot, if a person consents and there is room; return what was heard."""
    if not probe.has_room():
        print(
            f'not moved: something stands within {NEAR:g} m of the robot, or no scan comes: give '
            'it room all around'
        )
        return None
    if asks:
        print('The robot will drive 30 cm forth and back and turn by a quarter to the left.')
        answer = input('Is it on the floor, with room all around, and a hand at its stop? [y/N] ')
        if answer.strip().lower() not in ('y', 'yes'):
            print('not moved')
            return None
    return probe.carry_out(spin)


def _of_nav2(node: Node, namespace: str, spin: Callable[[float], None]) -> dict[str, Any]:
    """Return the states of Nav2's nodes, and the footprint that its costmap has."""
    asked = {}
    for name in NAV2_NODES:
        client = node.create_client(GetState, named(f'{name}/get_state', namespace))
        if client.wait_for_service(0.5):
            asked[name] = client.call_async(GetState.Request())
    costmap = named('local_costmap/local_costmap/get_parameters', namespace)
    shape = node.create_client(GetParameters, costmap)
    told = None
    if shape.wait_for_service(0.5):
        told = shape.call_async(GetParameters.Request(names=['footprint']))
    spin(1.0)
    states = {
        name: future.result().current_state.label for name, future in asked.items() if future.done()
    }
    states |= {name: 'silent' for name, future in asked.items() if not future.done()}
    corners: list[list[float]] = []
    if told is not None and told.done() and told.result().values:
        with suppress(ValueError, TypeError):
            corners = [
                [float(x), float(y)] for x, y in json.loads(told.result().values[0].string_value)
            ]
    return {'states': states, 'footprint': corners}


def _amend(path: Path, found: Sequence[RobotDoubt], *, writes: bool) -> None:
    """Write the lines into a profile of the user's, or offer it."""
    # Of two that say the same key the first: what tf_static says is exact, what scans say is not.
    lines = list({each.key: each for each in reversed(found) if each.key}.values())
    if not lines:
        return
    if not writes:
        print(f'\n--write writes {"it" if len(lines) == 1 else "these lines"} into {path}')
        return
    if path.is_relative_to(CONFIG):
        print(
            f'\nnot written: {path} is a ready profile: copy it and give the copy as --robot FILE'
        )
        return
    text = path.read_text('utf-8')
    for each in lines:
        text = amended(text, each.key, each.value)
    replace_text(path, text)
    print(f'\nwritten into {path}: {"; ".join(each.line for each in lines)}')


if __name__ == '__main__':
    sys.exit(main())
