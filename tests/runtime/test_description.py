"""The robot's description and the frames that a run publishes: one tree, as TF wants it."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from surveillance_operator.urdf_command import main
from surveillance_runtime.profile import profile_names, read_profile
from surveillance_runtime.profile.description import BASES, description, fixed_frames

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.mark.parametrize('name', profile_names(CONFIG))
def test_the_urdf_of_each_ready_profile_is_one_tree_with_the_frames_that_others_expect(
    name: str,
) -> None:
    profile = read_profile(CONFIG / 'robots' / f'{name}.yaml').profile
    urdf = ElementTree.fromstring(description(profile))
    links = [link.attrib['name'] for link in urdf.iter('link')]
    parents: dict[str, str] = {}
    for joint in urdf.iter('joint'):
        parent, child = joint.find('parent'), joint.find('child')
        assert parent is not None
        assert child is not None
        # A frame has one parent.
        assert child.attrib['link'] not in parents
        parents[child.attrib['link']] = parent.attrib['link']
    assert len(set(links)) == len(links)
    assert set(links) - set(parents) == {profile.frames.base}
    assert set(parents.values()) <= set(links)
    assert {*BASES, profile.frames.camera} <= set(links)
    # A lidar whose mount is not given is on the robot's own tf_static.
    assert not profile.lidars.mounts or set(profile.frames.scans) <= set(links)
    assert not any(link.startswith('/') for link in links)


def test_lidars_are_where_their_mounts_say() -> None:
    profile = read_profile(CONFIG / 'robots' / 'turtlebot4.yaml').profile
    frames = {frame.name: frame for frame in fixed_frames(profile)}
    lidar = frames['rplidar_link']
    assert lidar.parent == profile.frames.base
    assert lidar.xyz[:2] == profile.lidars.mounts[:2]
    assert lidar.rpy[2] == pytest.approx(1.5708)


def test_the_command_prints_it_and_names_a_robot_that_is_not_there(capsys: Any) -> None:
    assert main(['--robot', 'turtlebot3_waffle']) == 0
    assert '<robot name="turtlebot3_waffle">' in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(['--robot', 'turtlebot3_wafle'])
    assert "'turtlebot3_waffle'" in capsys.readouterr().err
