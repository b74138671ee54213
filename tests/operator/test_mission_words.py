"""What a mission is about, in words."""

from __future__ import annotations

from dataclasses import replace

from surveillance_operator.fleet_table import fleet_lines
from surveillance_operator.mission_changes import follow
from surveillance_operator.mission_state import (
    FleetReport,
    NodeReport,
)
from surveillance_operator.mission_words import doing, troubles
from tests.operator.missions import FLEET


def test_what_a_robot_does_and_what_is_wrong_with_it_is_said_in_words() -> None:
    anna = FLEET['anna']
    assert doing(anna) == 'on its way to B'
    fleet_report = anna.task.fleet_report
    assert fleet_report is not None
    waiting = replace(fleet_report, is_moving=False)
    assert doing(anna.having(fleet_report=waiting)) == 'waits to go to B'
    out = anna.having(fleet_report=FleetReport(taken_out=True))
    assert doing(out) == 'taken out of the patrol'
    assert [each.text for each in follow(anna, out, 1.0)[1]] == ['taken out of the patrol']
    reports = {
        'anna/battery_controller': NodeReport(3, 'silent', ()),
        'anna/motion_controller': NodeReport(2, 'no odometry', ()),
        'bert/motion_controller': NodeReport(2, 'not mine', ()),
        'armor_server': NodeReport(2, 'of all', ()),
    }
    bad = anna.having(stopped=True, reports=reports, ended=frozenset({'robot_behavior'}))
    assert troubles(bad) == [
        'stopped until a person releases it',
        'ended: robot_behavior',
        'motion_controller: no odometry',
        'silent: battery_controller',
    ]
    assert troubles(anna.having(nodes={})) == ['none of its programs is heard']
    lines = fleet_lines({'anna': bad, '': FLEET[''].having(ended=frozenset({'simulator'}))})
    assert lines[0].split() == [
        'anna',
        'A',
        'battery',
        '80',
        '%',
        'stopped;',
        'shares',
        'A,',
        'B,',
        'next',
        'B',
    ]
    assert lines[-1] == 'shared  ! ended: simulator'
