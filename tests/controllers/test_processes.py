"""The executables as an operator has them: real processes with a pipe or no input at all."""

from __future__ import annotations

import importlib.util
import signal
import subprocess
import sys

import pytest

NODE = (
    'from surveillance_controllers.{0}_node import main; import sys; sys.exit(main(sys.argv[1:]))'
)


def start(node: str, *parameters: str, stdin: int = subprocess.PIPE) -> subprocess.Popen[str]:
    arguments = [word for parameter in parameters for word in ('-p', parameter)]
    return subprocess.Popen(
        [sys.executable, '-c', NODE.format(node), '--ros-args', *arguments],
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def wait_for(process: subprocess.Popen[str], text: str) -> list[str]:
    """Read the process's lines up to one that has the text."""
    assert process.stdout is not None
    lines: list[str] = []
    for line in process.stdout:
        lines.append(line)
        if text in line:
            return lines
    raise AssertionError(f'{text!r} never came:\n{"".join(lines)}')


def test_a_piped_operator_sets_the_battery_and_leaves(ros_domain: int) -> None:
    process = start('battery_controller', 'execution_mode:=MANUAL')
    out, _ = process.communicate('battery set 15\nbattery set x\nexit\n', timeout=60)
    assert 'The battery is at 15 %.' in out
    assert "battery set: VALUE is 'x': expected a whole number from 0 to 100" in out
    assert 'Stopping.' in out
    assert process.returncode == 0


def test_a_node_without_input_goes_on_until_it_is_told_to_stop(ros_domain: int) -> None:
    process = start('motion_controller', 'execution_mode:=MANUAL', stdin=subprocess.DEVNULL)
    wait_for(process, 'The console is closed (end of input)')
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert 'Traceback' not in out


@pytest.mark.parametrize(
    ('node', 'parameter', 'text'),
    [
        ('battery_controller', 'execution_mode:=SOMETIMES', "got 'SOMETIMES', expected one of"),
        ('planner_controller', 'environment_size:=[1.0]', 'expected four numbers [x_min'),
        (
            'motion_controller',
            'navigator:=nav2',
            'the Python package nav2_msgs is not installed: install ros-jazzy-nav2-msgs',
        ),
    ],
)
def test_a_node_that_cannot_start_says_so_in_one_line(
    ros_domain: int, node: str, parameter: str, text: str
) -> None:
    arguments = [parameter]
    if 'nav2' in parameter:
        if importlib.util.find_spec('nav2_msgs') is not None:
            pytest.skip('nav2_msgs is installed here')
        arguments.append('execution_mode:=SIMULATED')
    process = start(node, *arguments)
    out, _ = process.communicate(timeout=60)
    assert process.returncode != 0
    (complaint,) = [line for line in out.splitlines() if line]
    assert text in complaint
