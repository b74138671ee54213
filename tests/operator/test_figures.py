"""One table of figures, from which every view shows them; and no list that lacks one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from std_msgs.msg import Float32

from patrol_policy.promises import Promise
from surveillance_operator import figures
from surveillance_operator.console_commands import answer
from surveillance_operator.figures import FIGURES, Figure, Heard, figures_line, figures_of
from surveillance_operator.fleet_table import fleet_lines
from surveillance_operator.mission_state import (
    RECORD_OF,
    RECORDS,
    MissionState,
)
from surveillance_operator.page import server
from surveillance_operator.page_state import PARTS, PatchMaker, traced
from surveillance_operator.recording.timeline import Timeline, TimelineWriter
from surveillance_operator.topics import TOPICS, read_message, topic_of
from surveillance_operator.watch.view import MissionView
from tests.operator.prompt import Prompt

from .test_mission_view import whole

HUMIDITY = Figure(
    'humidity',
    'humidity',
    lambda state: f'{state.measured["humidity"]:.0f} %' if state.measured else '',
    lambda state: state.measured.get('humidity', 0.0) > 80.0,
    is_brief=True,
    heard=Heard('humidity', 'std_msgs/msg/Float32', lambda message: message.data),
)
INNER = {
    'now': 'the time goes with each message',
    'namespace': 'the robot is chosen by its name',
    'measured': 'each figure reads its own of it',
    'pose_time': 'pairs scans with poses',
    'lidar': 'becomes the scan on the map',
    'camera': 'becomes the markers on the map',
    'stands': 'becomes the markers on the map',
    'localised': 'says whose pose counts',
    'trail': 'is lengthened by whoever follows the pose',
}
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


def test_no_two_records_of_a_state_have_a_field_of_the_same_name() -> None:
    assert len(RECORD_OF) == sum(len(each.__dataclass_fields__) for each in RECORDS.values())


def test_each_field_of_a_state_is_shown_by_some_part_or_said_to_be_inner() -> None:
    promise = Promise('A', 'within', 240.0, 60.0, 'A within 240 s')
    state = whole().having(promises=(promise,))
    read = set(INNER) | set(RECORDS)
    for compute in PARTS.values():
        read |= traced(compute, state)[1].keys()
    assert RECORD_OF.keys() - read == set()
    assert INNER.keys() <= RECORD_OF.keys()


def test_the_page_draws_each_part_and_asks_for_no_other() -> None:
    text = (server.STATIC / 'main.js').read_text('utf-8')
    drawn = text[text.index('const MAP_PARTS') : text.index('function receive')]
    needs = set(re.findall(r"'(\w+)'", ''.join(re.findall(r'\[[^\[\]]*\]', drawn))))
    assert PARTS.keys() - needs == set(), 'a part that no section of the page draws'
    of_the_page = {'robots', 'trail'}
    of_old_recordings = {'battery'}
    assert needs - PARTS.keys() == of_the_page | of_old_recordings


def test_a_part_is_computed_anew_when_a_field_that_it_reads_changes() -> None:
    computed = []

    def part(state: MissionState) -> Any:
        computed.append(state)
        return [state.whereabouts, state.task.battery if state.task.stopped else None]

    maker = PatchMaker()
    maker._parts = {'part': part}
    state = MissionState().having(robot_place='A')
    assert maker.patch(state) == {'part': ['in A', None]}
    assert maker.patch(state.having(battery=5.0, policy='tour')) == {}
    assert len(computed) == 1, 'the battery was not read'
    assert maker.patch(state.having(robot_place='B')) == {'part': ['in B', None]}
    assert maker.patch(state.having(stopped=True, battery=5.0)) == {'part': ['in A', 5.0]}
    assert maker.patch(state.having(stopped=True, battery=6.0)) == {'part': ['in A', 6.0]}


def test_figures_follow_the_state() -> None:
    state = MissionState().having(
        battery=15.0, battery_low=True, doors={'D1': False, 'D2': True, 'D3': True}
    )
    known = {each.figure.name: each for each in figures_of(state)}
    assert (known['battery'].words, known['battery'].is_bad) == ('15 % (low)', True)
    assert known['battery'].share == 0.15
    assert known['doors'].words == 'D1 closed, 2 open'
    assert figures_line(state) == 'battery 15 % (low) · doors D1 closed, 2 open'
    assert figures_line(MissionState()) == ''
