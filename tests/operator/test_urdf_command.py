"""The command `urdf`."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import pytest

from surveillance_operator.urdf_command import main


def test_the_description_of_a_robot_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['--robot', 'turtlebot4']) == 0
    robot = ElementTree.fromstring(capsys.readouterr().out)
    links = {each.get('name') for each in robot.iter('link')}
    parents = {each.get('link') for each in robot.iter('parent')}
    assert robot.tag == 'robot'
    assert parents <= links


def test_a_robot_that_there_is_not_costs_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['--robot', 'turtlebt4'])
    assert ended.value.code == 2
    assert 'turtlebot4' in capsys.readouterr().err
