"""How a process finds its peers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from surveillance_runtime.discovery import prefer_quick_discovery


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
