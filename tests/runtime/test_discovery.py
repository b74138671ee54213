"""How a process finds its peers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from surveillance_runtime import discovery
from surveillance_runtime.discovery import prefer_quick_discovery, problem_of


def test_a_process_finds_its_peers_quickly_unless_told_how(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_BUILTIN_TRANSPORTS'):
        monkeypatch.setenv(name, '')
        monkeypatch.delenv(name)
    prefer_quick_discovery()
    profile = Path(os.environ['FASTRTPS_DEFAULT_PROFILES_FILE']).read_text()
    assert '<leaseAnnouncement>' in profile
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', 'mine.xml')
    prefer_quick_discovery()
    assert os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] == 'mine.xml'


SECURED = """
import sys
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node

sys.exit(run_node(lambda: PatrolNode('secured'), []))
"""


def test_a_ros_without_dds_security_says_so_in_one_line() -> None:
    secured = {
        **os.environ,
        'ROS_SECURITY_ENABLE': 'true',
        'ROS_SECURITY_STRATEGY': 'Enforce',
        'ROS_SECURITY_KEYSTORE': '',
    }
    done = subprocess.run(
        [sys.executable, '-c', SECURED], capture_output=True, text=True, timeout=60, env=secured
    )
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith('cannot start: ')
    assert 'expected a ROS with DDS security' in done.stderr


FILES = Path(discovery.__file__).parent


@pytest.mark.parametrize('network', ['', 'localhost', 'open', str(FILES / 'discovery.xml')])
def test_what_a_launch_may_be_open_to(network: str) -> None:
    assert problem_of(network, {}) == ''


@pytest.mark.parametrize(
    ('network', 'text', 'problem'),
    [
        ('lokal', '', 'lokal: expected localhost, open, or a file *.xml'),
        ('none.xml', None, 'none.xml: No such file'),
        ('a.xml', '<dds', 'a.xml: '),
        ('a.xml', '<dds/>', 'a.xml: expected a <participant> with is_default_profile="true"'),
        ('a.xml', '<?xml version="1.0" encoding="no"?><dds/>', 'a.xml: '),
    ],
)
def test_a_profile_that_cannot_be_used_is_named_in_one_line(
    tmp_path: Path, network: str, text: str | None, problem: str
) -> None:
    path = tmp_path / network
    if text is not None:
        path.write_text(text)
    said = problem_of(str(path) if network.endswith('xml') else network, {})
    assert problem in said
    assert said.isprintable()


def test_a_profile_needs_fast_dds() -> None:
    environ = {'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'}
    assert problem_of(str(FILES / 'discovery.xml'), environ).endswith('got rmw_cyclonedds_cpp')


def test_a_machine_without_loopback_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    class NoLoopback:
        def __init__(self, *_: object) -> None:
            raise OSError(99, 'Cannot assign requested address')

    monkeypatch.setattr(discovery.socket, 'socket', NoLoopback)
    said = problem_of('', {})
    assert 'talk over 127.0.0.1, which this machine does not have' in said
    assert '`ip link set lo up`, or --network open' in said
    assert problem_of('open', {}) == ''
