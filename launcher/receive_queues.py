"""Whether a process takes what comes for it from the network: by what waits in its sockets.

A heartbeat shows that a node's executor runs, and not that it hears anybody. Fast DDS receives on a
thread for each socket; one that hangs or spins for ever, as after a packet that it cannot digest
(CVE-2025-64438), leaves a node that works and is deaf. What such a node says to itself proves
nothing: Fast DDS hands that over inside the process. The kernel tells how many bytes wait in each
socket (proc(5), `/proc/net/udp`). Where nothing comes by itself, an empty message is sent there:
a header of RTPS without submessages, which every DDS reads and forgets (DDSI-RTPS 2.5, 8.3.3).

Elsewhere than on Linux nothing is told.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import socket
import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

DEAF_AFTER = 5.0
"""Seconds for which nothing was taken from a socket in which something waits."""
SOCKETS_PERIOD = 3.0
"""Seconds between two looks which sockets a process has."""
_FIRST_PORT, _PORTS = 7400, 250
"""Ports of a domain begin at their product with its number (DDSI-RTPS 2.5, 9.6.2.3)."""
_SHARED = (0, 1)
"""These of a domain's ports all its processes share: for messages to all."""
_EMPTY_MESSAGE = b'RTPS\x02\x03\x00\x00' + bytes(12)
_PIDFD_GETFD = 438
_MOST_NAMED = 5
_MOST_TAKEN, _MOST_SENDERS = 1000, 20
"""Bounds of looking who sends: whoever floods a socket does not hold the watcher."""


@dataclass(frozen=True)
class UdpSocket:
    """A socket as the kernel shows it.

    Attributes:
        address, port: Where it listens.
        waiting: Bytes that nobody has taken.
    """

    address: str
    port: int
    waiting: int


def udp_sockets(lines: Iterable[str]) -> dict[int, UdpSocket]:
    """Return the sockets of `/proc/net/udp`, by their inodes."""
    found = {}
    for line in lines:
        words = line.split()
        with contextlib.suppress(ValueError, IndexError):
            address, port = words[1].split(':')
            raw = socket.inet_ntoa(struct.pack('=I', int(address, 16)))
            waiting = int(words[4].split(':')[1], 16)
            found[int(words[9])] = UdpSocket(raw, int(port, 16), waiting)
    return found


def all_sockets() -> dict[int, UdpSocket]:
    """Return the machine's UDP sockets, by their inodes; none where the kernel does not say."""
    try:
        with open('/proc/net/udp', encoding='ascii') as file:
            return udp_sockets(file)
    except OSError:
        return {}


def descriptors_of(pid: int) -> dict[int, int]:
    """Return a process's sockets: descriptors by their inodes."""
    found = {}
    folder = f'/proc/{pid}/fd'
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            with contextlib.suppress(OSError, ValueError):
                target = os.readlink(f'{folder}/{name}')
                if target.startswith('socket:['):
                    found[int(target[8:-1])] = int(name)
    return found


@dataclass
class _Untaken:
    waiting: int
    since: float


@dataclass
class _Process:
    inodes: Collection[int] = ()
    looked: float = -SOCKETS_PERIOD
    queues: dict[int, _Untaken] = field(default_factory=dict)


class ReceiveQueues:
    """Watches the sockets on which the processes of a ROS domain receive.

    Args:
        domain: The ROS domain.
        sockets: Gives the machine's sockets.
        descriptors: Gives a process's sockets.
    """

    def __init__(
        self,
        domain: int,
        sockets: Callable[[], Mapping[int, UdpSocket]] = all_sockets,
        descriptors: Callable[[int], Mapping[int, int]] = descriptors_of,
    ) -> None:
        self._first = _FIRST_PORT + _PORTS * domain
        self._sockets = sockets
        self._descriptors = descriptors
        self._processes: dict[int, _Process] = {}
        self._sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sender.setblocking(False)

    def excuse(self) -> None:
        """Begin to count anew: the watcher itself did not run."""
        self._processes.clear()

    def look(self, pids: Collection[int], now: float) -> dict[int, str]:
        """Take a look, and return which processes do not receive, and why that is said.

        Args:
            pids: The processes.
            now: Steady time, seconds.
        """
        sockets, told = self._sockets(), {}
        for gone in self._processes.keys() - set(pids):
            del self._processes[gone]
        for pid in pids:
            process = self._processes.setdefault(pid, _Process())
            if now >= process.looked + SOCKETS_PERIOD:
                process.looked, process.inodes = now, self._descriptors(pid).keys()
            own = {each: sockets[each] for each in process.inodes if each in sockets}
            for inode, each in own.items():
                number = each.port - self._first
                if not 0 <= number < _PORTS:
                    continue
                before = process.queues.get(inode)
                if before is None or not each.waiting or each.waiting < before.waiting:
                    process.queues[inode] = _Untaken(each.waiting, now)
                else:
                    before.waiting = each.waiting
                    if now >= before.since + DEAF_AFTER:
                        told[pid] = (
                            f'is deaf: nothing of what waits at its UDP port {each.port} was '
                            f'taken for {now - before.since:.1f} s{self._senders(pid, inode, pids)}'
                        )
                if not each.waiting and number not in _SHARED:
                    self._ask(each)
        return told

    def _ask(self, asked: UdpSocket) -> None:
        address = '127.0.0.1' if asked.address == '0.0.0.0' else asked.address
        with contextlib.suppress(OSError):
            self._sender.sendto(_EMPTY_MESSAGE, (address, asked.port))

    def _senders(self, pid: int, inode: int, own: Collection[int]) -> str:
        """Return who else than this launch has sent what waits in a socket of a lost process."""
        others = set()
        mine = {self._sender.getsockname()[1]}
        taken = itertools.islice(_drained(pid, self._descriptors(pid).get(inode)), _MOST_TAKEN)
        sources = sorted(set(taken))[:_MOST_SENDERS]
        ports = {each.port: number for number, each in self._sockets().items()}
        for address, port in sources:
            if not address.startswith('127.'):
                others.add(address)
            elif port not in mine:
                owner = _owner(ports.get(port))
                if owner is not None and owner[0] not in own:
                    others.add(f'process {owner[0]} ({owner[1]})')
        named = ', '.join(sorted(others)[:_MOST_NAMED])
        return f'; besides this launch there sends {named}' if named else ''


def _drained(pid: int, descriptor: int | None) -> Iterator[tuple[str, int]]:
    """Take what waits in another process's socket; yield from where each message came."""
    if descriptor is None:
        return
    try:
        process = os.pidfd_open(pid)
    except OSError:
        return
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        # Allowed to whoever may trace it, as a parent may.
        copied = libc.syscall(_PIDFD_GETFD, process, descriptor, 0)
    finally:
        os.close(process)
    if copied < 0:
        return
    with socket.socket(fileno=copied) as taken, contextlib.suppress(OSError):
        while True:
            yield taken.recvfrom(1, socket.MSG_DONTWAIT)[1][:2]


def _owner(inode: int | None) -> tuple[int, str] | None:
    """Return a process that has a socket, and the words that it was started with."""
    if inode is None:
        return None
    for name in os.listdir('/proc'):
        if name.isdigit() and inode in descriptors_of(int(name)):
            with contextlib.suppress(OSError):
                with open(f'/proc/{name}/cmdline', 'rb') as file:
                    words = file.read(200).replace(b'\0', b' ').decode('utf-8', 'replace')
                return int(name), ''.join(c if c.isprintable() else ' ' for c in words).strip()
    return None
