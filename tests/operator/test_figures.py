"""One table of figures, from which every view shows them; and no list that lacks one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from std_msgs.msg import Float32

from surveillance_operator import figures
from surveillance_operator.console_commands import answer
from surveillance_operator.figures import FIGURES, Figure, FigureTopic, figures_line, figures_of
from surveillance_operator.fleet_table import fleet_lines
from surveillance_operator.mission_state import (
    MissionState,
)
from surveillance_operator.page_state import PatchMaker
from surveillance_operator.recording.timeline import Timeline, TimelineWriter
from surveillance_operator.topics import TOPICS, read_message, topic_of
from surveillance_operator.watch.view import MissionView
from surveillance_runtime.incident_topic import message_from
from surveillance_runtime.incidents import Cause, IncidentPhase, IncidentUpdate, Severity
from tests.operator.prompt import Prompt

HUMIDITY = Figure(
    'humidity',
    'humidity',
    lambda state: f'{state.measured["humidity"]:.0f} %' if state.measured else '',
    lambda state: state.measured.get('humidity', 0.0) > 80.0,
    is_brief=True,
    heard=FigureTopic('humidity', 'std_msgs/msg/Float32', lambda message: message.data),
)


"""The fields that no view shows by themselves, with what they are for."""


def screen(state: MissionState) -> str:
    console = Console(width=100, height=30, color_system=None)
    with console.capture() as capture:
        console.print(MissionView(state), end='')
    return capture.get()


def test_a_new_entry_of_the_table_is_all_that_a_new_figure_takes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(figures, 'FIGURES', (*FIGURES, HUMIDITY))
    state = MissionState(now=5.0)
    assert 'humidity' not in screen(state)
    state = read_message(state, topic_of(HUMIDITY), Float32(data=85.0))
    assert 'humidity 85 %' in screen(state)
    assert ['humidity', 'humidity', '85 %', True, None] in PatchMaker().patch(state)['figures']
    assert 'humidity 85 %' in fleet_lines({'anna': state})[0]

    class Spoken(Prompt):
        def figures(self) -> str:
            return figures_line(state)

    nobody: Any = type('', (), {'command': lambda *_: 'idle'})()
    assert answer('status', nobody, Spoken())[0].text == 'humidity 85 %'
    writer = TimelineWriter(tmp_path / 'timeline.jsonl')
    writer.add(state, 1000.0)
    writer.close()
    _, _, replayed = Timeline(tmp_path / 'timeline.jsonl').at(1000.0)
    assert replayed['brief'] == 'humidity 85 %'


def test_each_figure_stands_once_and_has_its_topic_for_itself() -> None:
    names = [each.name for each in FIGURES]
    assert len(set(names)) == len(names)
    topics = [each.name for each in TOPICS]
    assert len(set(topics)) == len(topics)
    for each in FIGURES:
        assert each.heard is None or each.heard.topic in topics, each.name


def test_the_voltage_of_a_driver_is_shown_and_none_where_it_is_not_measured() -> None:
    (figure,) = (each for each in FIGURES if each.name == 'voltage')
    topic = topic_of(figure)
    state = read_message(MissionState(), topic, topic.kind(voltage=24.25))
    assert figure.words(state) == '24.2 V'
    state = read_message(state, topic, topic.kind(voltage=float('nan')))
    assert figure.words(state) == ''


def test_figures_follow_the_state() -> None:
    state = MissionState().having(
        battery=15.0, battery_low=True, doors={'D1': False, 'D2': True, 'D3': True}
    )
    known = {each.figure.name: each for each in figures_of(state)}
    assert (known['battery'].words, known['battery'].is_bad) == ('15 % (low)', True)
    assert known['battery'].fraction == 0.15
    assert known['doors'].words == 'D1 closed, 2 open'
    assert figures_line(state) == 'battery 15 % (low) · doors D1 closed, 2 open'
    assert figures_line(MissionState()) == ''


def test_incidents_are_a_figure_of_all_views_until_they_are_over() -> None:
    (topic,) = (each for each in TOPICS if each.name == 'incidents')
    state = MissionState(namespace='anna')

    def told(phase: IncidentPhase, robot: str = 'anna', **more: Any) -> MissionState:
        update = IncidentUpdate(
            *(phase, Cause('door', 'D1'), Severity.ALARM, 'D1 is closed'),
            robot=robot,
            node='robot_behavior',
            **more,
        )
        return read_message(state, topic, message_from(update, 1.0))

    state = told(IncidentPhase.BEGIN, robot='bert')
    assert 'incidents' not in figures_line(state), 'it is of another robot'
    state = told(IncidentPhase.BEGIN)
    assert figures_line(state) == 'incidents D1 is closed'
    (shown,) = (each for each in figures_of(state) if each.figure.name == 'incidents')
    assert shown.is_bad
    state = told(IncidentPhase.UPDATE, acknowledged_by='a person')
    assert figures_line(state) == 'incidents D1 is closed (a person takes care)'
    state = told(IncidentPhase.END)
    assert figures_line(state) == ''
