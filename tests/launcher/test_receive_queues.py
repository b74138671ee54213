"""A process that takes nothing from the network: it is told, ended, and started again."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import struct
import subprocess
import sys
from dataclasses import replace

import pytest

from benchmarks.machine_faults import FrozenThreads
from launcher.receive_queues import (
    DEAF_AFTER,
    ReceiveQueues,
    UdpSocket,
    _drained,
    all_sockets,
    udp_sockets,
)
from tests.launcher.conftest import USER_ENVIRON
from tests.launcher.test_supervisor import DRIVER

PORT = 7411


def queues(waiting: list[int], port: int = PORT) -> ReceiveQueues:
    """Return a watch over one process, 1, with one socket in which so many bytes wait in turn."""
    steps = iter(waiting)
    return ReceiveQueues(
        0,
        lambda: {10: UdpSocket('127.0.0.1', port, next(steps, waiting[-1]))},
        lambda _pid: {10: 99_999},
    )


def told(waiting: list[int], port: int = PORT) -> list[bool]:
    """Return at which looks, one a second, the process is said to be deaf."""
    watch = queues(waiting, port)
    return [1 in watch.look([1], float(second)) for second in range(len(waiting))]


def test_what_waits_and_is_not_taken_is_told() -> None:
    last = int(DEAF_AFTER)
    assert told([0] + [300] * (last + 1)) == [False] * last + [True, True]


@pytest.mark.parametrize(
    'waiting',
    [[0] * 20, [300, 0] * 10, [900, 600] * 10, [900, 901, 902, 903, 600] * 4],
)
def test_whoever_takes_something_now_and_then_is_not_deaf(waiting: list[int]) -> None:
    assert not any(told(waiting))


@pytest.mark.parametrize('port', [80, 7399, 7650, 55_020])
def test_sockets_of_another_purpose_do_not_count(port: int) -> None:
    assert not any(told([300] * 20, port))


def test_after_a_sleep_of_the_machine_it_is_counted_anew() -> None:
    watch = queues([300])
    assert not watch.look([1], 0.0)
    watch.excuse()
    assert not watch.look([1], 100.0)
    assert watch.look([1], 106.0)


def test_the_kernel_s_lines_are_read_and_strange_ones_left() -> None:
    address = struct.unpack('=I', socket.inet_aton('127.0.0.1'))[0]
    line = f' 5: {address:08X}:1CF3 00000000:0000 07 00000000:000001F4 00:0 0 0 0 77 2 0'
    lines = ['  sl  local_address', line, '', 'x:y z', line.replace('01F4', 'zz')]
    assert udp_sockets(lines) == {77: UdpSocket('127.0.0.1', 7411, 500)}


def test_a_sleeping_socket_is_sent_something() -> None:
    with contextlib.ExitStack() as sockets:
        domain, number = -1, 0
        while domain < 0 or number < 2:  # one that all processes share, or of no domain
            taken = sockets.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            taken.bind(('127.0.0.1', 0))
            port = taken.getsockname()[1]
            domain, number = divmod(port - 7400, 250)
        watch = ReceiveQueues(
            domain, lambda: {10: UdpSocket('127.0.0.1', port, 0)}, lambda _pid: {10: 3}
        )
        watch.look([1], 0.0)
        taken.settimeout(60.0)
        assert taken.recv(100)[:4] == b'RTPS'


NODE = """
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
run_node(lambda: PatrolNode('hearing'), [])
"""


@pytest.mark.skipif(sys.platform != 'linux', reason='looks at what the Linux kernel tells')
def test_a_node_whose_receiving_threads_stand_is_started_again(start, ros_domain) -> None:
    environ = {**USER_ENVIRON, 'ROS_DOMAIN_ID': str(ros_domain)}
    launch = start(DRIVER, f'hearing={NODE}', environ=environ)
    pid = int(launch.until(r'started hearing \(process (\d+)\)')[1])
    launch.until(r'hearing +\| .*ready')
    try:
        frozen = FrozenThreads(pid, 'dds.udp')
    except OSError as error:
        pytest.skip(str(error))
    try:
        said = launch.until(r'hearing is deaf: nothing of what waits at its UDP port \d+ was taken')
        after = launch.lines.index(said.string)
        launch.until(r'hearing +\| .*ready', after=after)
    finally:
        frozen.close()
    assert launch.end(signal.SIGINT)[0] == 0


def test_who_else_sends_to_a_deaf_process_is_named() -> None:
    flood = (
        'import socket, sys\n'
        'out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)\n'
        "for _ in range(500): out.sendto(b'x', ('127.0.0.1', int(sys.argv[1])))\n"
        "print('sent', flush=True)\n"
        'sys.stdin.read()\n'
    )

    def sockets() -> dict[int, UdpSocket]:
        # As if its port were one of the domain's: to a true one other tests' nodes send as well.
        return {
            number: replace(each, port=PORT) if number == inode else each
            for number, each in all_sockets().items()
        }

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(('127.0.0.1', 0))
        inode, here = os.fstat(deaf.fileno()).st_ino, os.getpid()
        deaf.sendto(b'x', deaf.getsockname())
        if inode not in all_sockets() or not [*_drained(here, deaf.fileno())]:
            pytest.skip('this kernel does not show what waits in sockets')
        watch = ReceiveQueues(0, sockets)
        words = [sys.executable, '-c', flood, str(deaf.getsockname()[1])]
        with subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as stranger:
            assert stranger.stdout is not None
            assert stranger.stdout.readline() == 'sent\n'
            assert not watch.look([here], 0.0)
            text = watch.look([here], DEAF_AFTER)[here]
            stranger.communicate('')
    assert f'; besides this launch there sends process {stranger.pid} (' in text
