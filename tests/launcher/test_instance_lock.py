"""Two launches do not start the same nodes in the same place."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys

import pytest

from launcher.instance_lock import claim
from launcher.run import Run
from launcher.run_processes import ros_domain
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.node_table import select
from tests.launcher.conftest import ROOT

RANDOM = select('RANDOM')
HERE = f'{os.getpid()}'
"""In place of a domain: claims hold for the whole machine, other test runs among them."""


@pytest.fixture
def held():
    """Claim nodes; the claims end with the test."""
    with contextlib.ExitStack() as claims:

        def hold(*asked):
            descriptors = claim(*asked)
            for descriptor in descriptors:
                claims.callback(os.close, descriptor)
            return descriptors

        yield hold


def test_the_same_nodes_are_claimed_once_and_again_after_that(held):
    first = claim(RANDOM, HERE, None)
    with pytest.raises(NotNowError) as caught:
        claim(select('RANDOM', only=['armor_server', 'simulator']), HERE, None)
    message = str(caught.value)
    assert message.startswith(
        f'already running in ROS domain {HERE} (process {os.getpid()}): armor_'
    )
    assert 'simulator' not in message
    assert '\n' not in message
    held(select('RANDOM', only=['simulator']), HERE, None)
    for descriptor in first:
        os.close(descriptor)
    assert held(RANDOM, HERE, None)


def test_other_domains_and_namespaces_are_free(held):
    assert held(RANDOM, HERE, None)
    assert held(RANDOM, f'{HERE}.2', None)
    assert held(RANDOM, HERE, '/robot2')
    with pytest.raises(NotNowError, match='namespace robot2'):
        claim(RANDOM, HERE, 'robot2')


def test_a_namespace_of_any_length_is_claimed(held):
    assert held(RANDOM, HERE, 'robot' * 100)
    with pytest.raises(NotNowError, match='already running'):
        claim(RANDOM, HERE, 'robot' * 100)


@pytest.mark.skipif(os.getuid() != 0, reason='needs root, to become somebody else')
def test_what_another_user_runs_is_claimed_too():
    script = (
        'import os, sys; from launcher.instance_lock import claim; '
        'from surveillance_runtime.node_table import NODES; os.setuid(65534); '
        'held = claim(NODES, sys.argv[1], None); print("held", flush=True); input()'
    )
    words = [sys.executable, '-c', script, HERE]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, cwd=ROOT, stdin=pipe, stdout=pipe, text=True) as other:
        assert other.stdout.readline() == 'held\n'
        with pytest.raises(NotNowError, match=f'process {other.pid}'):
            claim(RANDOM, HERE, None)
        other.stdin.write('\n')


@pytest.mark.parametrize('given', ['x', '-1', '102', '1.5'])
def test_a_domain_of_the_environment_that_is_none_is_named(monkeypatch, given):
    monkeypatch.setenv('ROS_DOMAIN_ID', given)
    with pytest.raises(ValueError, match=f"ROS_DOMAIN_ID: got '{given}', expected a number from 0"):
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
