"""The command `urdf`: the description of a robot, as its profile has it."""

from __future__ import annotations

from collections.abc import Sequence

from surveillance_operator.doctor_command import CONFIG
from surveillance_runtime.command_line import CommandParser
from surveillance_runtime.profile import find_profile, read_profile
from surveillance_runtime.profile.description import description
from surveillance_runtime.run_options import BUILT_IN_ROBOT, OPTIONS


def main(argv: Sequence[str] | None = None) -> int:
    """Print a URDF; for robot_state_publisher where the robot's maker gives none."""
    parser = CommandParser(
        prog='launch.py urdf',
        description='Prints the URDF of a robot: its frames, body, wheels, lidars and camera as '
        'its profile has them. In mode SIMULATED it is on the topic robot_description; a real '
        "robot's drivers publish their own, or robot_state_publisher this one.",
    )
    parser.add_argument(
        '--robot', default=BUILT_IN_ROBOT, metavar='NAME|FILE', help=OPTIONS['robot'].help
    )
    options = parser.parse_args(argv)
    try:
        profile = read_profile(find_profile(CONFIG, options.robot)).profile
    except ValueError as error:
        parser.error(str(error))
    print(description(profile), end='')
    return 0
