"""Whole launches with real processes, on a clock that the test drives."""

from __future__ import annotations

import itertools
import os
import re
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from rclpy.clock import Clock, ClockType
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage

from tests.launcher.conftest import Started, gone

PROCESS = str(Path(__file__).with_name('mission_process.py'))
PARAMETERS = """
/**:
  ros__parameters:
    use_sim_time: true
"""
SPEED = 20.0
TICK = 0.02


@pytest.fixture
def clock(graph) -> None:
    """Provide simulated time that passes `SPEED` times as fast as real time."""
    publisher = graph.node.create_publisher(ClockMessage, 'clock', 10)
    ticks = itertools.count(1)

    def tick() -> None:
        now = Time(nanoseconds=round(next(ticks) * TICK * SPEED * 1e9))
        publisher.publish(ClockMessage(clock=now.to_msg()))

    steady = Clock(clock_type=ClockType.STEADY_TIME)
    graph.node.create_timer(TICK, tick, clock=steady)


@pytest.fixture
def launch(start, tmp_path, ros_domain) -> Callable[..., Started]:
    parameters = tmp_path / 'parameters.yaml'
    parameters.write_text(PARAMETERS)

    def begin(*options: str) -> Started:
        shared = ('--params', str(parameters), '--domain', str(ros_domain))
        return start(PROCESS, str(tmp_path / 'runs'), *shared, *options)

    return begin


def process_of(launched: Started, node: str, after: int = 0) -> int:
    return int(launched.until(rf'started {node} \(process (\d+)\)', after=after)[1])


@pytest.mark.parametrize('moment', ['surveillance in mode', 'started armor_server'])
def test_ctrl_c_in_the_middle_of_the_start_ends_it(launch, moment):
    mission = launch('--mode', 'RANDOM', '--record', 'off')
    mission.until(moment)
    code, _ = mission.end(signal.SIGINT)
    assert code in (0, 130)
    assert 'Traceback' not in '\n'.join(mission.lines)
    started = re.findall(r'\(process (\d+)\)', '\n'.join(mission.lines))
    assert gone([int(process) for process in started], 0)


def test_a_mission_goes_on_after_kills_and_ctrl_c_ends_it_with_its_summary_and_nothing_left(
    launch, clock, tmp_path
):
    mission = launch('--mode', 'RANDOM')
    mission.until(r'robot_behavior +\| decision 1:')
    mission.until(r'robot_behavior +\| arrived in')
    # What is known and what moves die below the one that decides, and then that one; tests/mission
    # has them all.
    for nodes in (('armor_server', 'motion_controller'), ('robot_behavior',)):
        seen = len(mission.lines)
        for node in nodes:
            started = [line for line in mission.lines if f'started {node} ' in line]
            os.kill(int(started[-1].split('process ')[1].rstrip(')')), signal.SIGKILL)
        for node in nodes:
            mission.until(rf'{node} died \(killed by SIGKILL\)', after=seen)
            process_of(mission, node, after=seen)
        back = len(mission.lines)
        for _ in range(2):  # the first may still be an answer from before
            mission.until(r'robot_behavior +\| arrived in', after=back)
            back = len(mission.lines)
    assert mission.end(signal.SIGINT)[0] == 0
    output = '\n'.join(mission.lines)
    assert gone([int(process) for process in re.findall(r'\(process (\d+)\)', output)], 0)
    assert 'every process has ended' in output
    assert 'Traceback' not in output
    _, stopping, end = output.partition('SIGINT: stopping')
    assert stopping
    assert 'killed' not in end
    assert 'visits' in output
    assert 'decisions by rule' in output
    (folder,) = (tmp_path / 'runs').iterdir()
    assert {'events.jsonl', 'launch.log', 'parameters'} <= {p.name for p in folder.iterdir()}


def test_a_mission_that_did_not_begin_in_its_time_is_a_failure(launch):
    mission = launch('--only', 'robot_behavior', '--for', '3')
    mission.until('Mission: nothing was recorded')
    assert mission.process.wait(60.0) == 1
    assert sum('| started' in line for line in mission.lines) == 1


def test_one_console_serves_the_three_controllers(launch, clock):
    mission = launch('--mode', 'MANUAL', '--record', 'off')
    mission.write('fly')
    mission.until(r"console +\| 'fly' is no command: expected one of battery, plan, ")
    asked = mission.until(r'planner_controller +\| New request').string
    mission.write('plan set [[6, 9, 0], oops]')
    mission.until(r"console +\| plan set: .*'oops'")
    # A node that was found a moment ago may not be heard: then the robot asks again.
    paths = {'planner_controller.* New request': 'plan set [[6, 9, 0]]'}
    mission.answer('motion_controller.* New request', paths, mission.lines.index(asked))
    seen = len(mission.lines)
    mission.write('battery set 15')
    mission.until(r'battery_controller +\| The battery is at 15 %')
    mission.write('move 2 0.1')
    drives = {**paths, 'motion_controller.* New request': 'move 2 0.1'}
    mission.answer(r'robot_behavior +\| arrived in', drives, seen)
    # The level reaches the robot when it does: until then it goes on as before.
    answers = {
        'planner_controller.* New request': 'plan set []',
        'motion.* New request': 'move 1 0',
    }
    mission.answer(r'robot_behavior +\| decision \d+: .*\[recharge\] the battery', answers, seen)
    mission.write('exit battery_controller')
    mission.until('battery_controller has ended by itself')
    mission.write('exit')
    code, _ = mission.end()
    assert code == 0
    assert 'exit: stopping' in '\n'.join(mission.lines)
