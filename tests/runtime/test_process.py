"""The process that nodes run in."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from surveillance_runtime.discovery import prefer_quick_discovery

PROGRAM = """
import numpy, scipy.linalg
from threadpoolctl import threadpool_info
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.process import run_nodes

def node():
    print({each['user_api']: each['num_threads'] for each in threadpool_info()})
    raise ParameterError('enough')

run_nodes([node], [])
"""


def test_nodes_compute_on_one_thread_whatever_was_imported_before() -> None:
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM], capture_output=True, text=True, timeout=60
    )
    assert "{'blas': 1" in done.stdout, done


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


STUCK = """
import sys, threading, time
from surveillance_runtime import node, process

node.JOIN_SECONDS = process.JOIN_SECONDS = 0.1

class Stuck(node.PatrolNode):
    def __init__(self):
        super().__init__('stuck')
        for name in ('one', 'two'):
            self.spawn(lambda: threading.Event().wait(), name)
        self.create_timer(0.0, self.work)
    def work(self):
        self.finish()
        time.sleep(1000.0)

sys.exit(process.run_node(Stuck, []))
"""


def test_a_process_whose_threads_do_not_end_ends_all_the_same() -> None:
    done = subprocess.run([sys.executable, '-c', STUCK], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert 'one, two did not end in 0.1 s' in done.stderr


LEFT_BEHIND = """
import warnings
warnings.simplefilter('error')
import rclpy
from surveillance_runtime.process import ExecutorThread

async def ask():
    raise AssertionError('its turn never comes')

context = rclpy.Context()
rclpy.init(context=context)
spinner = ExecutorThread(context)
spinner.executor.create_task(ask)
spinner.stop()
rclpy.shutdown(context=context)
"""


def test_a_coroutine_that_never_had_its_turn_is_closed_without_a_warning() -> None:
    done = subprocess.run(
        [sys.executable, '-c', LEFT_BEHIND], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, '')
