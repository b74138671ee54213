"""The node `alarm` hears the incidents of all nodes, also those told before it was there."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from rclpy.parameter import Parameter

from surveillance_operator.alarm_node import Alarm
from surveillance_runtime.event_log import RECORD, read
from surveillance_runtime.incident_topic import IncidentPublisher
from surveillance_runtime.incidents import IncidentPhase, Severity
from surveillance_runtime.node import PatrolNode

DOOR = ('door', 'D1')


def phases(folder: Path) -> list[tuple[str, str]]:
    """Return what the log tells of incidents: cause and phase."""
    if not (folder / RECORD).exists():
        return []
    told = [each for each in read(folder / RECORD) if each.name == 'incident']
    return [(each.text('name'), each.text('phase')) for each in told]


def test_a_person_is_called_also_for_what_began_before(graph: Any, tmp_path: Path) -> None:
    said = tmp_path / 'said'
    script = tmp_path / 'call.sh'
    script.write_text(f'printf "%s\\n" "$@" >> "{said}"\n')
    robot = graph.add(partial(PatrolNode, 'robot_behavior'))
    robot.incidents.begin(DOOR, 'D1 is closed', Severity.ALARM)
    parameters = {'command': f"sh '{script}'", 'folder': str(tmp_path)}
    graph.add(Alarm, parameters=parameters)
    graph.until(lambda: said.exists() and said.read_text() == 'D1 is closed\n')
    robot.incidents.end(DOOR, 'it is open')
    graph.until(lambda: ('D1', 'end') in phases(tmp_path))
    graph.until(lambda: 'all clear after' in said.read_text())
    assert phases(tmp_path) == [('D1', 'begin'), ('D1', 'call'), ('D1', 'end')]


def test_a_changed_parameter_is_in_the_log(graph: Any, tmp_path: Path) -> None:
    graph.add(Alarm, parameters={'folder': str(tmp_path)})
    robot = graph.add(partial(PatrolNode, 'robot_behavior'))
    robot.parameter('speed', 0.5, 'Speed, m/s.')

    def is_kept() -> bool:
        # Whoever listens late hears of no earlier change.
        value = robot.get_parameter('speed').value
        robot.set_parameters([Parameter('speed', value=value + 0.5)])
        path = tmp_path / RECORD
        kept = [each for each in read(path) if each.name == 'parameter'] if path.exists() else []
        return any((e.text('node'), e.text('name')) == ('robot_behavior', 'speed') for e in kept)

    graph.until(is_kept)


@pytest.mark.parametrize('first', [IncidentPhase.UPDATE, IncidentPhase.END])
def test_a_stranger_cannot_end_the_alarm_of_another_node(
    graph: Any, tmp_path: Path, first: IncidentPhase
) -> None:
    graph.add(Alarm, parameters={'folder': str(tmp_path)})
    robot = graph.add(partial(PatrolNode, 'robot_behavior'))
    stranger = graph.add(partial(PatrolNode, 'stranger'))
    robot.incidents.begin(DOOR, 'D1 is closed', Severity.ALARM)
    graph.until(lambda: ('D1', 'call') in phases(tmp_path))
    (told,) = robot.incidents.updates()
    said = graph.said()
    foreign = IncidentPublisher(stranger)
    foreign.publish(replace(told, phase=first, acknowledged_by='a stranger'))
    foreign.publish(replace(told, phase=IncidentPhase.END))
    graph.until(lambda: any('which is not believed' in line for line in said))
    robot.incidents.end(DOOR)
    graph.until(lambda: ('D1', 'end') in phases(tmp_path))
