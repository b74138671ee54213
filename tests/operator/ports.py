"""Ports for servers that tests start themselves."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import time

from surveillance_runtime.discovery import LAST_DOMAIN


def free_port(domain: int | None = None) -> int:
    """Return a port that nobody else asks for: of the domain, and none that clients are given.

    Args:
        domain: A ROS domain that was claimed; None: the one of this process.
    """
    first = 20000 + (int(os.environ['ROS_DOMAIN_ID']) if domain is None else domain)
    for port in range(first, 32768, LAST_DOMAIN + 1):
        with contextlib.suppress(OSError), socket.socket() as free:
            free.bind(('127.0.0.1', port))
            return port
    raise RuntimeError('no port is free')


def await_listening(port: int, process: subprocess.Popen[bytes]) -> None:
    """Wait until a server takes connections, or has ended."""
    deadline = time.monotonic() + 60.0
    while True:
        with socket.socket() as asking:
            if asking.connect_ex(('127.0.0.1', port)) == 0:
                return
        assert time.monotonic() < deadline, 'the server does not listen'
        with contextlib.suppress(subprocess.TimeoutExpired):
            raise AssertionError(f'the server has ended: {process.wait(0.02)}')
