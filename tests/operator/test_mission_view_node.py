"""The watching node among real and scripted peers."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from rich.console import Console

from surveillance_interfaces.msg import MissionStatus
from surveillance_operator import mission_view_node
from surveillance_operator.mission_view_node import MissionViewNode
from tests.operator.peers import say


def test_what_a_peer_says_commands_no_terminal(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    printed: list[str] = []
    monkeypatch.setattr(mission_view_node, 'print_lines', printed.append)
    said = MissionStatus(state='MOVE', place='\x1b[2J', heading_to='E\nlaunch | forged')
    publisher = say(graph, 'mission_status', said)
    view = graph.add(MissionViewNode)
    graph.until(lambda: view.state.task.status)
    told = r'in \x1b[2J, heading for E\nlaunch | forged'
    graph.until(lambda: any(told in line for line in printed))
    assert publisher is not None


def test_a_terminal_that_cannot_draw_gets_lines(
    graph: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    dumb = partial(Console, force_terminal=True, _environ={'TERM': 'dumb'})
    monkeypatch.setattr(mission_view_node, 'Console', dumb)
    graph.add(MissionViewNode)
    assert capsys.readouterr().out.startswith('watching ROS domain')
