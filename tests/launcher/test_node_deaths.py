"""What the launcher tells of processes that die: to the node `alarm`, and in the log."""

from __future__ import annotations

from pathlib import Path

import pytest

from launcher.node_deaths import QUIET_AGAIN, NodeDeaths
from surveillance_runtime.event_log import RECORD, read
from surveillance_runtime.incidents import IncidentPhase, IncidentUpdate

pytestmark = pytest.mark.unit

TROUBLE = 'planner_controller died 5 times in 9 s, last: exit code 1'


class Input:
    """The input of the node `alarm`."""

    def __init__(self) -> None:
        self.told: list[IncidentUpdate] = []
        self.lives = True

    def send(self, line: str) -> bool:
        if self.lives:
            self.told.append(IncidentUpdate.from_line(line))
        return self.lives


def test_a_node_that_dies_again_and_again_is_an_incident_until_it_lives() -> None:
    alarm, calls, now = Input(), [], 0.0
    deaths = NodeDeaths(alarm.send, calls.append, now=lambda: now)
    deaths.trouble(['motion_controller', 'planner_controller'], TROUBLE)
    now = 100.0
    deaths.restarted('planner_controller', 'exit code 1')
    deaths.advance(QUIET_AGAIN)
    assert [each.phase for each in alarm.told] == [IncidentPhase.BEGIN, IncidentPhase.UPDATE]
    deaths.advance(now + QUIET_AGAIN)
    assert [each.phase for each in alarm.told] == [
        IncidentPhase.BEGIN,
        IncidentPhase.UPDATE,
        IncidentPhase.END,
    ]
    assert alarm.told[0].text == TROUBLE
    assert {each.owner for each in alarm.told} == {'launch'}
    assert not calls


def test_a_person_is_called_where_the_alarm_itself_does_not_live() -> None:
    alarm, calls = Input(), []
    deaths = NodeDeaths(alarm.send, calls.append)
    alarm.lives = False
    deaths.trouble(['planner_controller'], TROUBLE)
    assert calls == [TROUBLE]
    alarm.lives = True
    deaths.restarted('alarm', 'killed by SIGKILL')
    assert [each.text for each in alarm.told] == [TROUBLE], 'a new one is told what goes on'


def test_restarts_are_in_the_log_of_the_robot(tmp_path: Path) -> None:
    (tmp_path / 'anna').mkdir()
    deaths = NodeDeaths(lambda _: True, lambda _: None, tmp_path)
    deaths.restarted('anna/observer', 'killed by SIGKILL')
    deaths.restarted('armor_server', 'holds 2100 MB of memory')
    (of_anna,), (shared,) = read(tmp_path / 'anna' / RECORD), read(tmp_path / RECORD)
    assert (of_anna.text('node'), of_anna.text('why')) == ('observer', 'killed by SIGKILL')
    assert shared.text('node') == 'armor_server'
