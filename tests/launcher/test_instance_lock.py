"""Two launches do not start the same nodes in the same place."""

from __future__ import annotations

import os
import signal

import pytest

from launcher.instance_lock import claim, runtime_folder
from launcher.run import Run
from launcher.run_processes import ros_domain
from launcher.system import LaunchError
from surveillance_runtime.node_table import select

RANDOM = select('RANDOM')


def test_the_same_nodes_are_claimed_once_and_again_after_that(tmp_path):
    held = claim(RANDOM, '7', None, tmp_path)
    with pytest.raises(LaunchError) as caught:
        claim(select('RANDOM', only=['armor_server', 'simulator']), '7', None, tmp_path)
    message = str(caught.value)
    assert message.startswith(f'already running in ROS domain 7 (process {os.getpid()}): armor_')
    assert 'simulator' not in message
    assert '\n' not in message
    claim(select('RANDOM', only=['simulator']), '7', None, tmp_path)
    for descriptor in held:
        os.close(descriptor)
    assert claim(RANDOM, '7', None, tmp_path)


def test_other_domains_and_namespaces_are_free(tmp_path):
    assert claim(RANDOM, '7', None, tmp_path)
    assert claim(RANDOM, '8', None, tmp_path)
    assert claim(RANDOM, '7', '/robot2', tmp_path)
    with pytest.raises(LaunchError, match='namespace robot2'):
        claim(RANDOM, '7', 'robot2', tmp_path)


def test_where_nothing_can_be_written_nothing_is_claimed(tmp_path):
    (tmp_path / 'file').write_text('')
    assert claim(RANDOM, '7', None, tmp_path / 'file') == []


@pytest.mark.parametrize('given', ['x', '-1', '102', '1.5'])
def test_a_domain_of_the_environment_that_is_none_is_named(monkeypatch, given):
    monkeypatch.setenv('ROS_DOMAIN_ID', given)
    with pytest.raises(
        LaunchError, match=f"ROS_DOMAIN_ID: got '{given}', expected a number from 0"
    ):
        ros_domain(Run())
    assert ros_domain(Run(domain=3)) == '3'


def test_a_second_launch_says_that_the_first_is_there(start, tmp_path, ros_domain):
    from tests.launcher.test_launch import PROCESS

    options = (PROCESS, str(tmp_path), '--only', 'armor_server', '--domain', str(ros_domain))
    first = start(*options)
    first.until('started armor_server')
    second = start(*options)
    code, _ = second.end()
    assert code == os.EX_TEMPFAIL
    (complaint,) = second.lines
    assert f'already running in ROS domain {ros_domain} (process {first.process.pid})' in complaint
    assert first.end(signal.SIGINT)[0] == 0


def test_planted_links_are_not_followed(tmp_path):
    target = tmp_path / 'precious'
    target.write_text('precious')
    folder = tmp_path / 'nodes'
    folder.mkdir()
    for node in RANDOM:
        (folder / f'7..{node.name}').symlink_to(target)
        (folder / f'7.{node.name}').symlink_to(target)
    claim(RANDOM, '7', None, folder)
    assert target.read_text() == 'precious'
    (tmp_path / 'linked').symlink_to(folder)
    assert claim(RANDOM, '8', None, tmp_path / 'linked') == []


def test_the_claims_lie_in_the_users_own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_RUNTIME_DIR', str(tmp_path))
    assert runtime_folder() == tmp_path / 'surveillance'
    held = claim(RANDOM, '7', None)
    assert held
    assert (tmp_path / 'surveillance').stat().st_mode & 0o077 == 0
    monkeypatch.delenv('XDG_RUNTIME_DIR')
    assert str(os.getuid()) in runtime_folder().name
    for descriptor in held:
        os.close(descriptor)
