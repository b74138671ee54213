"""One prompt for a whole fleet."""

from __future__ import annotations

import os
from types import SimpleNamespace
from typing import Any

import pytest

from surveillance_operator.console_commands import answer, completions
from surveillance_operator.console_node import ConsoleNode
from tests.operator.peers import Robot
from tests.operator.prompt import Prompt


def test_the_console_commands_no_other_robot_than_the_one_that_was_named(
    graph: Any, capfd: Any
) -> None:
    anna = Robot(graph, 'anna')
    receiver, sender = os.pipe()
    with os.fdopen(receiver) as source:
        given = {'robot': 'ana', 'peer_timeout': 6.0}
        console = graph.add(ConsoleNode, given, console_source=source)

        def is_heard() -> bool:
            try:
                return 'anna' in ''.join(console.lines())
            except ValueError:  # it is alone yet
                return False

        graph.until(is_heard)
        with os.fdopen(sender, 'w') as keyboard:
            keyboard.write('stop\nrobot anna\nstop\n')
        assert console.ended.wait(60.0)
    assert "robot 'ana' is not heard: expected anna" in capfd.readouterr().out
    assert anna.told == [True], 'told once, by its own name'


def test_a_robot_that_joins_takes_no_commands_from_the_one_that_is_spoken_to(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    receiver, sender = os.pipe()
    with os.fdopen(receiver) as source, os.fdopen(sender, 'w'):
        console = graph.add(ConsoleNode, console_source=source)
        known = SimpleNamespace(robots=('bert',))
        monkeypatch.setattr(console, '_subscriber', known)
        console._actions_for('stop')
        known.robots = ('anna', 'bert')
        assert console.robot == 'bert'
        monkeypatch.undo()
        graph.remove(console)


def test_the_console_speaks_to_one_robot_or_to_all() -> None:
    def told(line: str) -> str:
        actions: Any = None
        (said,) = answer(line, actions, Prompt())
        return said.text

    assert told('robots') == 'anna\nbert'
    assert told('robot bert') == 'you speak to bert'
    assert told('all stop') == 'all stop'
    assert told('all sto') == "all: 'sto': expected 'stop'"
    assert completions('all p') == ['pause']
