"""The consoles: on a terminal with editing and completion, from a pipe, and one for all
controllers."""

from __future__ import annotations

import os
import pty
import termios
import threading
from pathlib import Path
from typing import Any

from geometry_msgs.msg import Point
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.input.vt100 import Vt100Input
from prompt_toolkit.output import DummyOutput
from std_msgs.msg import String, UInt8

from state_machines.ros import GoalCaller
from surveillance_controllers.battery_controller_node import BatteryController
from surveillance_controllers.manual.commands import BATTERY, Grammar
from surveillance_controllers.manual.prompt import Console
from surveillance_controllers.manual.terminal import TerminalLines, WordCompleter
from surveillance_controllers.planner_controller_node import PlannerController
from surveillance_interfaces.action import ComputePath
from surveillance_operator.console_node import ConsoleNode
from surveillance_runtime.logging import LINES_AT_ONCE
from surveillance_runtime.qos import STATE_QOS


def test_a_terminal_edits_lines_until_the_end_of_input() -> None:
    lines: list[str] = []
    with create_pipe_input() as keyboard:
        console = Console('test', lines.append, lambda _: [], terminal=(keyboard, DummyOutput()))
        keyboard.send_text('battery sett\x7f 15\r')
        keyboard.send_text('lost\x15exit\r')
        keyboard.send_text('\x04')
        assert console.run() == 'end of input'
    assert lines == ['battery set 15', 'exit']


def test_completion_replaces_the_word_being_typed() -> None:
    completer = WordCompleter(Grammar(BATTERY).completions)

    def proposed(text: str) -> list[tuple[str, int]]:
        found = completer.get_completions(Document(text), CompleteEvent())
        return [(c.text, c.start_position) for c in found]

    assert proposed('bat') == [('battery', -3)]
    assert proposed('battery ') == [('offset', 0), ('set', 0)]


def test_keys_between_two_prompts_are_not_echoed_and_go_to_the_next_one() -> None:
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    with os.fdopen(theirs) as stream:
        lines = TerminalLines('test', lambda _: [], (Vt100Input(stream), DummyOutput()))
        with lines.shown():
            os.write(ours, b'battery')
            between = termios.tcgetattr(theirs)[3]
            os.write(ours, b' set 15\r')
            assert lines.read() == 'battery set 15'
            assert termios.tcgetattr(theirs)[3] == between
        assert termios.tcgetattr(theirs) == before
    os.close(ours)
    assert not between & termios.ECHO
    assert between & termios.ISIG


def test_control_c_at_the_prompt_interrupts() -> None:
    with create_pipe_input() as keyboard:
        console = Console('test', print, lambda _: [], terminal=(keyboard, DummyOutput()))
        keyboard.send_text('\x03')
        assert console.run() == 'interrupted'


def test_a_terminal_console_can_be_stopped_while_it_waits() -> None:
    with create_pipe_input() as keyboard:
        first = threading.Event()
        endings: list[str] = []
        console = Console(
            'test', lambda _: first.set(), lambda _: [], terminal=(keyboard, DummyOutput())
        )
        thread = threading.Thread(target=lambda: endings.append(console.run()))
        thread.start()
        keyboard.send_text('x\r')
        assert first.wait(60.0)
        console.stop()
        thread.join(60.0)
        assert endings == ['stopped']
        console.stop()


def test_a_pipe_gives_its_last_line_also_without_an_end(operator: Any) -> None:
    lines: list[str] = []
    console = Console('test', lines.append, lambda _: [], source=operator.source)
    operator.type('one\n\ntwo')
    print('three', end='', file=operator._keyboard, flush=True)
    operator.hang_up()
    assert console.run() == 'end of input'
    assert lines == ['one', '', 'two', 'three']


def test_a_file_is_read_like_a_pipe(tmp_path: Path) -> None:
    commands = tmp_path / 'commands'
    commands.write_bytes(b'battery set 5\r\nmove 1 0')
    lines: list[str] = []
    with commands.open() as source:
        assert Console('test', lines.append, lambda _: [], source=source).run() == 'end of input'
    assert lines == ['battery set 5', 'move 1 0']


def test_no_line_of_a_file_is_taken_after_a_stop(tmp_path: Path) -> None:
    commands = tmp_path / 'commands'
    commands.write_text('one\nexit\ntwo\n')
    lines: list[str] = []

    def take(line: str) -> None:
        lines.append(line)
        if line == 'exit':
            console.stop()

    with commands.open() as source:
        console = Console('test', take, lambda _: [], source=source)
        assert console.run() == 'stopped'
    assert lines == ['one', 'exit']


def test_one_console_addresses_every_controller(graph: Any, operator: Any, capfd: Any) -> None:
    silent = {'execution_mode': 'MANUAL', 'console': False}
    graph.add(BatteryController, silent)
    graph.add(PlannerController, silent)
    levels = graph.listen(UInt8, 'battery_level', STATE_QOS)
    node = graph.add(ConsoleNode, {'peer_timeout': 5.0}, console_source=operator.source)
    operator.type('battery set 42')
    graph.until(lambda: levels and levels[-1].data == 42)
    operator.type('plan set []')
    operator.type('move 1 0')
    operator.type('jump')
    operator.type('exit\ngo R3')
    assert node.ended.wait(60.0)
    assert node.failure is None
    node.stop()
    shown = capfd.readouterr().out
    assert '[battery_controller] The battery is at 42 %.' in shown
    assert 'no request is waiting: expected one before this command' in shown
    assert 'motion_controller is not running' in shown.splitlines()
    assert 'go: ' not in shown
    assert "'jump' is no command: expected one of battery, " in shown


def test_a_request_is_announced_once_with_its_controller_before_each_line(
    graph: Any, operator: Any, capfd: Any
) -> None:
    graph.add(PlannerController, {'execution_mode': 'MANUAL', 'console': False})
    console = graph.add(ConsoleNode, console_source=operator.source)
    caller = GoalCaller(graph.node, ComputePath, 'compute_path')
    ends: list[str] = []
    goal = ComputePath.Goal(goal=Point(x=1.0))
    thread = threading.Thread(
        target=lambda: ends.append(caller.run(goal, accept_timeout=60.0).status)
    )
    thread.start()
    told = graph.listen(String, 'planner_controller/announcement', STATE_QOS)
    graph.until(lambda: told)
    operator.type('plan set [[1, 2, 0]]')
    thread.join(60.0)
    assert ends == ['succeeded']
    console.stop()
    shown = [line for line in capfd.readouterr().out.splitlines() if 'Answer with' in line]
    assert len(shown) == 1
    assert shown[0].startswith('[planner_controller] ')


def test_an_announcement_commands_no_terminal_and_is_no_flood(
    graph: Any, operator: Any, capfd: Any
) -> None:
    graph.add(ConsoleNode, console_source=operator.source)
    topic = 'battery_controller/announcement'
    publisher = graph.node.create_publisher(String, topic, STATE_QOS)
    publisher.publish(String(data='\x1b[2Jcleared\n' + 'more\n' * 1000))
    shown: list[str] = []

    def read() -> bool:
        shown.extend(capfd.readouterr().out.splitlines())
        return len(shown) >= LINES_AT_ONCE / 2

    graph.until(read)
    assert '[battery_controller] \\x1b[2Jcleared' in shown
    assert len(shown) < 500
