"""The command `doctor`: what a mission awaits of a robot, what comes, and what is missing."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from surveillance_operator.watch_command import mission_parser, ros_arguments
from surveillance_runtime.graph_check import Listener
from surveillance_runtime.profile import find_profile, read_profile
from surveillance_runtime.profile.check_up import awaited, findings, table, unplaced
from surveillance_runtime.run_options import BUILT_IN_ROBOT, OPTIONS

_IN_CHECKOUT = Path(__file__).resolve().parents[2] / 'config'
_INSTALLED = Path(sys.prefix) / 'share' / 'surveillance' / 'config'
CONFIG = _IN_CHECKOUT if _IN_CHECKOUT.exists() else _INSTALLED
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
    options = parser.parse_args(argv)
    if not 0.5 <= options.seconds <= 3600.0:
        parser.error(f'--seconds {options.seconds:g}: expected 0.5 to 3600')
    try:
        profile = read_profile(find_profile(CONFIG, options.robot)).profile
    except ValueError as error:
        parser.error(str(error))
    options.namespace = options.namespace or profile.namespace
    wanted = awaited(profile, options.namespace)
    rclpy.init(args=ros_arguments(parser, options))
    node = Node('robot_doctor', start_parameter_services=False, enable_rosout=False)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        listener, until = Listener(node, wanted), time.monotonic() + options.seconds
        while (left := until - time.monotonic()) > 0:
            listener.look()
            executor.spin_once(timeout_sec=min(left, 0.1))
        seen = listener.look()
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    print(f'robot {profile.name}, listened for {options.seconds:g} s')
    lines = table(wanted, seen, options.seconds)
    for line in (*lines, *unplaced(profile, seen, options.namespace)):
        print(line)
    lacking = any(each.is_needed and any(findings(each, seen, 0.0)) for each in wanted)
    return 1 if lacking else 0


if __name__ == '__main__':
    sys.exit(main())
