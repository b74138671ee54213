"""One whole mission for all that is looked at from outside: pages in a browser, terminals."""

from __future__ import annotations

import contextlib
import signal
import socket
from collections.abc import Iterator

import pytest

from surveillance_runtime.discovery import LAST_DOMAIN
from surveillance_runtime.testing import claim_domain
from tests.launcher.conftest import ROOT, Started

LAUNCH = [str(ROOT / '.venv/bin/python'), str(ROOT / 'launch.py')]


def free_port(domain: int) -> int:
    """Return a port that nobody else asks for: of the domain, and none that clients are given."""
    for port in range(20000 + domain, 32768, LAST_DOMAIN + 1):
        with contextlib.suppress(OSError), socket.socket() as free:
            free.bind(('127.0.0.1', port))
            return port
    raise RuntimeError('no port is free')


@pytest.fixture(scope='module')
def mission_domain() -> int:
    """Provide a ROS domain that no test in this process uses."""
    return claim_domain()


@pytest.fixture(scope='module')
def mission(mission_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Started]:
    """Provide a patrol at four times real time, with a page that may control it."""
    port = free_port(mission_domain)  # a page that is started again keeps its address
    words = ['--composed', '--web-control', '--web-address', f'127.0.0.1:{port}']
    words += ['--domain', str(mission_domain), '--record', str(tmp_path_factory.mktemp('runs'))]
    words += ['-p', 'speed:=4.0', '--params', str(ROOT / 'config/fast.yaml')]
    started = Started([*LAUNCH, *words])
    started.until('decision 1')
    yield started
    started.end(signal.SIGINT)
