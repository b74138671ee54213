from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from launcher import system
from launcher.environment import clean_environ
from launcher.system import (
    no_wheels_advice,
    note_of_unused_ros,
    sourced_ros,
    why_no_wheels,
)
from surveillance_runtime.launch_protocol import NotNowError
from tests.launcher.conftest import ROOT

HERE = ('Linux', 'x86_64', 'glibc', (3, 12))
CHECKOUT = Path('/somewhere/surveillance')


@pytest.mark.parametrize(('sudo', 'typed'), [(True, "sudo sh -c '"), (False, "su -c '")])
def test_who_may_not_install_is_told_what_this_machine_has(monkeypatch, sudo, typed):
    there = {'apt-get'} | ({'sudo'} if sudo else set())
    monkeypatch.setattr(shutil, 'which', lambda name: name if name in there else None)
    monkeypatch.setattr(system, '_privilege', lambda: None)
    with pytest.raises(ValueError, match=f'  {typed}apt-get update && apt-get install -y g\\+\\+'):
        system.install_packages(['g++'])


def test_packages_that_could_not_be_installed_may_be_later(monkeypatch):
    monkeypatch.setattr(shutil, 'which', lambda name: name)
    monkeypatch.setattr(system, '_privilege', lambda: ['false'])  # as without network
    with pytest.raises(NotNowError, match=r'could not install g\+\+'):
        system.install_packages(['g++'])


def test_wheels_fit_the_machines_they_were_built_for():
    assert why_no_wheels(*HERE) == ''


@pytest.mark.parametrize(
    ('machine', 'reason'),
    [
        (('Linux', 'aarch64', 'glibc', (3, 12)), 'Linux on aarch64'),
        (('Darwin', 'arm64', '', (3, 12)), 'Darwin on arm64'),
        (('Linux', 'x86_64', '', (3, 12)), 'glibc'),
        (('Linux', 'x86_64', 'glibc', (3, 14)), 'Python 3.14'),
    ],
)
def test_where_none_fit_it_is_said_why(machine, reason):
    assert reason in why_no_wheels(*machine)


def test_without_wheels_and_ros_the_advice_is_to_install_it(tmp_path):
    advice = no_wheels_advice('no wheels', CHECKOUT, tmp_path / 'none')
    assert 'no ROS 2 Jazzy is installed' in advice
    assert 'https://docs.ros.org/en/jazzy/Installation.html' in advice
    assert 'colcon build' in advice


def test_without_wheels_but_with_ros_the_advice_is_to_build(tmp_path):
    advice = no_wheels_advice('no wheels', CHECKOUT, tmp_path)
    assert 'ROS 2 Jazzy is installed' in advice
    assert f'ln -s {CHECKOUT}' in advice
    assert 'ros2 launch surveillance_behaviour surveillance.launch.py' in advice


def test_an_installed_ros_that_is_not_active_is_pointed_out(tmp_path):
    assert 'colcon build' in note_of_unused_ros(CHECKOUT, tmp_path)
    assert note_of_unused_ros(CHECKOUT, tmp_path / 'none') == ''


def test_the_folders_of_the_checkout_are_no_built_workspace():
    code = (
        'import sys; sys.path.insert(0, sys.argv[1])\n'
        'from launcher.system import sourced_workspace; print(sourced_workspace())'
    )
    done = subprocess.run(
        [sys.executable, '-S', '-c', code, str(ROOT)],
        env=clean_environ(),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    assert done.stdout == 'False\n'


def test_a_sourced_jazzy_is_seen():
    assert sourced_ros({'ROS_DISTRO': 'jazzy', 'AMENT_PREFIX_PATH': '/opt/ros/jazzy'})
    assert not sourced_ros({'ROS_DISTRO': 'humble', 'AMENT_PREFIX_PATH': '/opt/ros/humble'})
    assert not sourced_ros({})
