"""The command `fleet`: all robots of a patrol in one table, and one word for one or all of them.

launch.py fleet                       # who is where, who does what
launch.py fleet stop all              # every robot stands until it is released
launch.py fleet out robot2            # robot2 leaves the patrol; the others take its places
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence

import rclpy
from std_srvs.srv import SetBool, Trigger

from state_machines.exceptions import CallError
from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import FleetRobot
from surveillance_operator.watch_command import mission_parser, ros_arguments
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import ExecutorThread
from surveillance_runtime.run_parameters import BEHAVIOUR_NODE
from surveillance_runtime.suggestions import nearest

FLEET_TOPIC = 'fleet_robots'
LISTEN = 3.0
"""How long robots are listened for, seconds."""
TIMEOUT = 2.0
ALL = 'all'
WORDS = {
    'pause': 'no further step of the mission begins',
    'go': 'the mission goes on',
    'stop': 'the robot stands until it is released',
    'release': 'it may drive again',
    'out': 'it leaves the patrol; the others take its places',
    'in': 'it is given a share again',
}


def main(argv: Sequence[str] | None = None) -> int:
    """Print the robots, or carry a word out; exit code 1: no robot was heard, or one refused."""
    parser = mission_parser(
        'fleet',
        'Shows the robots that share a patrol: place, share, charge, who waits for whom. With a '
        'word it has one robot or all do it: '
        + '; '.join(f'{word}: {meaning}' for word, meaning in WORDS.items())
        + '.',
    )
    parser.add_argument('word', nargs='?', metavar='|'.join(WORDS), help='what they are to do')
    parser.add_argument('robot', nargs='?', default=ALL, help='its name (default: %(default)s)')
    options = parser.parse_args(argv)
    if options.word is not None and options.word not in WORDS:
        parser.error(f'{options.word!r}: expected {nearest(options.word, WORDS)}')
    rclpy.init(args=ros_arguments(parser, options))
    node, spinner = PatrolNode('fleet_view'), ExecutorThread()
    heard: dict[str, FleetRobot] = {}
    node.create_subscription(
        FleetRobot, FLEET_TOPIC, lambda told: heard.__setitem__(told.robot, told), 200
    )
    spinner.executor.add_node(node)
    spinner.start()
    try:
        if options.word is not None and options.robot != ALL:
            return carry_out(options.word, [options.robot], _caller(node))
        _listen(heard)
        if not heard:
            print('no robot of a fleet was heard: expected a run with --robots')
            return 1
        if options.word is not None:
            return carry_out(options.word, sorted(heard), _caller(node))
        for line in table(heard):
            print(line)
        return 0
    finally:
        node.stop()
        spinner.stop()
        node.destroy_node()
        rclpy.try_shutdown()


def _listen(heard: Mapping[str, FleetRobot]) -> None:
    """Wait until each robot had time to say a word."""
    until = time.monotonic() + LISTEN
    while time.monotonic() < until:
        time.sleep(0.1)


def _caller(node: PatrolNode) -> Callable[[str, str], str]:
    def call(word: str, robot: str) -> str:
        if word in ('pause', 'go'):
            what = 'pause' if word == 'pause' else 'resume'
            caller = ServiceCaller(node, Trigger, f'{robot}/{BEHAVIOUR_NODE}/fsm/{what}')
            answer = caller.call(Trigger.Request(), TIMEOUT, discovery=TIMEOUT)
        elif word in ('stop', 'release'):
            caller = ServiceCaller(node, SetBool, f'{robot}/stop')
            request = SetBool.Request(data=word == 'stop')
            answer = caller.call(request, TIMEOUT, discovery=TIMEOUT)
        else:
            caller = ServiceCaller(node, SetBool, f'{robot}/take_out')
            request = SetBool.Request(data=word == 'out')
            answer = caller.call(request, TIMEOUT, discovery=TIMEOUT)
        if not answer.success:
            raise CallError(answer.message)
        return str(answer.message) or WORDS[word]

    return call


def carry_out(word: str, robots: Sequence[str], call: Callable[[str, str], str]) -> int:
    """Have robots do something, each whatever becomes of the others.

    Args:
        word: One of `WORDS`.
        robots: Their names.
        call: Asks one robot and returns what it says.

    Returns:
        The exit code: 1 where one did not do it.
    """
    code = 0
    for robot in robots:
        try:
            print(f'{robot}: {call(word, robot)}')
        except CallError as error:
            print(f'{robot}: {error}', file=sys.stderr)
            code = 1
    return code


def table(heard: Mapping[str, FleetRobot]) -> list[str]:
    """Return what the robots say of themselves, one line each."""
    lines = []
    width = max(map(len, heard))
    for name in sorted(heard):
        told = heard[name]
        lines.append(f'{name:<{width}}  {told.place:<8}  {_doing(told)}; {_share(told)}')
    return lines


def _doing(told: FleetRobot) -> str:
    if told.taken_out:
        return 'taken out'
    if told.dock and told.dock == told.place:
        return f'charging at {told.dock}'
    if told.heading_to:
        kind = 'on its way to' if told.is_moving else 'waits to go to'
        return f'{kind} {told.heading_to}' + (f' to charge at {told.dock}' if told.dock else '')
    return 'explores or stays'


def _share(told: FleetRobot) -> str:
    if not told.tour:
        return 'no share'
    left = told.runs_until - (told.stamp.sec + 1e-9 * told.stamp.nanosec)
    battery = f', battery for {left / 60.0:.0f} min' if math.isfinite(left) else ''
    return f'shares {", ".join(told.tour)}, next {told.stop}{battery}'


if __name__ == '__main__':
    sys.exit(main())
