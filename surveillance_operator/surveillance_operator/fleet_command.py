"""The command `fleet`: all robots of a patrol in one table, and one word for one or all of them.

launch.py fleet                       # who is where, who does what
launch.py fleet stop all              # every robot stands until it is released
launch.py fleet out robot2            # robot2 leaves the patrol; the others take its places
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

import rclpy

from floor_plans.fleet import problem_in_robot_name
from strict_files.suggestions import nearest
from surveillance_operator.fleet_actions import ALL, WORDS, FleetActions
from surveillance_operator.fleet_subscriber import FleetSubscriber
from surveillance_operator.fleet_table import fleet_lines
from surveillance_operator.watch_command import mission_parser, ros_arguments
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import BY_NAME
from surveillance_runtime.process import ExecutorThread

LISTEN = 3.0
"""How long robots are listened for, seconds."""
PERIOD = 0.2
"""Seconds between two looks at what they say."""
TIMEOUT = 2.0


def main(argv: Sequence[str] | None = None) -> int:
    """Print the robots, or carry a word out; exit code 1: no robot was heard, or one refused."""
    parser = mission_parser(
        'fleet',
        'Shows the robots that share a patrol: place, share, charge, who waits for whom. With a '
        'word it has one robot or all do it: '
        + '; '.join(f'{word}: {meaning}' for word, (meaning, _) in WORDS.items())
        + '.',
    )
    parser.add_argument('word', nargs='?', metavar='|'.join(WORDS), help='what they are to do')
    parser.add_argument('robot', nargs='?', default=ALL, help='its name (default: %(default)s)')
    options = parser.parse_args(argv)
    if options.word is not None and options.word not in WORDS:
        parser.error(f'{options.word!r}: expected {nearest(options.word, WORDS)}')
    if options.robot != ALL and (problem := problem_in_robot_name(options.robot, BY_NAME)):
        parser.error(f'robot {options.robot[:80]!r}: {problem}')
    rclpy.init(args=ros_arguments(parser, options))
    node, spinner = PatrolNode('fleet_view'), ExecutorThread()
    spinner.executor.add_node(node)
    spinner.start()
    try:
        if options.word is not None and options.robot != ALL:
            names = [options.robot]
            return carry_out(options.word, names, FleetActions(node, lambda: names, TIMEOUT))
        subscriber = FleetSubscriber(node, PERIOD)
        time.sleep(LISTEN)  # until each robot had time to say a word
        if subscriber.robots == ('',):
            print('no robot of a fleet was heard: expected a run with --robots')
            return 1
        if options.word is not None:
            actions = FleetActions(node, lambda: subscriber.robots, TIMEOUT)
            return carry_out(options.word, subscriber.robots, actions)
        for line in fleet_lines(subscriber.see()):
            print(line)
        return 0
    finally:
        node.stop()
        spinner.stop()
        node.destroy_node()
        rclpy.try_shutdown()


def carry_out(word: str, robots: Sequence[str], actions: FleetActions) -> int:
    """Have robots do something, each whatever becomes of the others.

    Args:
        word: One of `WORDS`.
        robots: Their names.
        actions: Does it.

    Returns:
        The exit code: 1 where one did not do it.
    """
    outcomes = actions.outcomes(robots, WORDS[word][1])
    for robot, (done, said) in outcomes.items():
        print(f'{robot}: {said}', file=sys.stdout if done else sys.stderr)
    return int(not all(done for done, _ in outcomes.values()))


if __name__ == '__main__':
    sys.exit(main())
