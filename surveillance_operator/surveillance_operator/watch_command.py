"""The commands `watch` and `console`: a running mission in this terminal."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace

from surveillance_operator import console_node, mission_view_node
from surveillance_runtime.command_line import CommandParser
from surveillance_runtime.discovery import LAST_DOMAIN


def mission_parser(name: str, description: str) -> CommandParser:
    """Return the parser of a command about a running mission."""
    parser = CommandParser(prog=f'launch.py {name}', description=description)
    parser.add_argument('--namespace', default='', metavar='NAME', help="the robot's namespace")
    parser.add_argument(
        '--domain',
        type=int,
        metavar='N',
        help="the mission's ROS domain, 0 to 101 (default: ROS_DOMAIN_ID, else 0)",
    )
    return parser


def ros_arguments(parser: CommandParser, options: argparse.Namespace) -> list[str]:
    """Return the ROS arguments of a node that looks at a mission, and set its domain."""
    if options.domain is not None and not 0 <= options.domain <= LAST_DOMAIN:
        parser.error(f'--domain {options.domain}: expected a number from 0 to {LAST_DOMAIN}')
    namespace = options.namespace and '/' + options.namespace.strip('/')
    try:
        validate_namespace(namespace or '/')
    except InvalidNamespaceException:
        parser.error(f'--namespace {namespace}: expected letters, digits and _ like robot1')
    if options.domain is not None:
        os.environ['ROS_DOMAIN_ID'] = str(options.domain)
    # What ROS logs would stand in the middle of what is shown.
    arguments = ['--ros-args', '--disable-stdout-logs']
    return [*arguments, '-r', f'__ns:={namespace}'] if namespace else arguments


def main(argv: Sequence[str] | None = None) -> int:
    """Watch until Ctrl-C; with --once the exit code is 1 when there was no mission to be seen."""
    parser = mission_parser(
        'watch',
        'Shows a running mission, simulated or real, until q or Ctrl-C: the map with robot, doors '
        'and obstacles, what the robot does and why. Keys: s stops the robot, r releases it, '
        'p holds the picture, d shows the decision, n the nodes, e the events, f the robots of a '
        'fleet, of which 1 to 9 choose one; S stops all, R releases all. Where the output is no '
        'terminal, it prints a line for each change.',
    )
    parser.add_argument(
        '--robot', default='', metavar='NAME', help='the robot of a fleet to be drawn first'
    )
    parser.add_argument('--once', action='store_true', help='print one picture and end')
    parser.add_argument(
        '--timeout',
        type=float,
        default=5.0,
        metavar='SECONDS',
        help='with --once: longest wait for a mission (default: %(default)g)',
    )
    options = parser.parse_args(argv)
    if not 0.1 <= options.timeout < 1e9:
        parser.error(f'--timeout {options.timeout:g}: expected 0.1 seconds or more')
    arguments = ros_arguments(parser, options)
    arguments += ['-p', f'once:={str(options.once).lower()}', '-p', f'timeout:={options.timeout}']
    return mission_view_node.main([*arguments, *_robot(options)])


def console(argv: Sequence[str] | None = None) -> int:
    """Read commands until `exit` or the end of the input."""
    parser = mission_parser(
        'console',
        'One prompt for a running mission: answers in mode MANUAL, doors, rooms, obstacles, '
        'policy, why, go, stop, pause. `help` lists the commands.',
    )
    parser.add_argument(
        '--robot', default='', metavar='NAME', help='the robot of a fleet to speak to first'
    )
    options = parser.parse_args(argv)
    arguments = ros_arguments(parser, options)
    return console_node.main([*arguments, *_robot(options)])


def _robot(options: argparse.Namespace) -> list[str]:
    return ['-p', f'robot:={options.robot!r}'] if options.robot else []


if __name__ == '__main__':
    sys.exit(main())
