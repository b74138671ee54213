"""The command `fleet`: a table of the robots, and a word for one or all."""

from __future__ import annotations

import math

from builtin_interfaces.msg import Time

from state_machines.exceptions import CallError
from surveillance_interfaces.msg import FleetRobot
from surveillance_operator.fleet_command import carry_out, table


def test_the_table_says_what_each_robot_does():
    heard = {
        'robot2': FleetRobot(
            robot='robot2', place='E', dock='E', charging_until=90.0, runs_until=math.nan
        ),
        'robot1': FleetRobot(
            robot='robot1',
            place='C1',
            heading_to='R1',
            is_moving=True,
            tour=['C1', 'R1'],
            stop='R1',
            stamp=Time(sec=100),
            runs_until=1300.0,
        ),
        'robot3': FleetRobot(robot='robot3', place='R3', taken_out=True, runs_until=math.nan),
    }
    assert table(heard) == [
        'robot1  C1        on its way to R1; shares C1, R1, next R1, battery for 20 min',
        'robot2  E         charging at E; no share',
        'robot3  R3        taken out; no share',
    ]


def test_a_word_reaches_all_whatever_becomes_of_one(capsys):
    def call(word: str, robot: str) -> str:
        if robot == 'robot2':
            raise CallError('robot2/stop: nobody offers it')
        return f'{word} done'

    assert carry_out('stop', ['robot1', 'robot2', 'robot3'], call) == 1
    said = capsys.readouterr()
    assert said.out.splitlines() == ['robot1: stop done', 'robot3: stop done']
    assert said.err == 'robot2: robot2/stop: nobody offers it\n'
