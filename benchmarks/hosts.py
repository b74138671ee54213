"""Hosts of a network on one machine: network namespaces on an Ethernet segment that fails.

Each host is a namespace of its own with one interface besides the loopback. A thread passes the
frames between them, as a switch that has learned who is where, and delays, drops or stops those
between two hosts as a bad radio link does. That needs root and `/dev/net/tun`, not the kernel's
netem. Nothing stays behind: a namespace lives as long as a process that ends with this one.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import heapq
import itertools
import os
import random
import select
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

TUNSETIFF = 0x400454CA  # linux/if_tun.h
IFF_TAP, IFF_NO_PI = 0x0002, 0x1000
CLONE_NEWNET = 0x40000000  # linux/sched.h
LONGEST_FRAME = 65536
MULTICAST = b'\x01\x00\x5e'
"""How the receiver of a frame to many begins in IPv4 (RFC 1112)."""


def may_be_made() -> bool:
    """Tell whether this user may make hosts on this machine."""
    if sys.platform != 'linux' or os.geteuid() != 0 or not Path('/dev/net/tun').exists():
        return False
    return subprocess.run(['unshare', '-n', 'ip', 'link'], capture_output=True).returncode == 0


class Host:
    """One namespace, with the address 10.77.0.NUMBER.

    Attributes:
        number: From 1.
        frames: The descriptor of what it sends and gets.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        script = 'ip link set lo up; echo up; exec sleep infinity'
        self._holder = subprocess.Popen(
            ['setpriv', '--pdeathsig', 'KILL', 'unshare', '-n', 'sh', '-c', script],
            stdout=subprocess.PIPE,
        )
        assert self._holder.stdout is not None
        self._holder.stdout.readline()
        name = f'host{os.getpid()}-{number}'[-15:]
        self.frames = os.open('/dev/net/tun', os.O_RDWR | os.O_NONBLOCK)
        request = struct.pack('16sH22x', name.encode(), IFF_TAP | IFF_NO_PI)
        fcntl.ioctl(self.frames, TUNSETIFF, request)
        _run('ip', 'link', 'set', name, 'netns', str(self._holder.pid))
        for words in (
            ('addr', 'add', f'10.77.0.{number}/24', 'dev', name),
            ('link', 'set', name, 'up'),
            ('route', 'add', 'default', 'dev', name),  # multicast goes this way, too
        ):
            _run(*self.words('ip', *words))

    def words(self, *command: str) -> list[str]:
        """Return a command that runs another one in this host."""
        return ['nsenter', f'--net=/proc/{self._holder.pid}/ns/net', *command]

    def enter(self) -> None:
        """Have this thread, and those that it starts from now on, be of this host."""
        with open(f'/proc/{self._holder.pid}/ns/net') as namespace:
            libc = ctypes.CDLL(None, use_errno=True)
            if libc.setns(namespace.fileno(), CLONE_NEWNET):
                raise OSError(ctypes.get_errno(), 'setns')

    def kill_all(self) -> None:
        """End every process of this host at once; the namespace stays."""
        own = os.stat(f'/proc/{self._holder.pid}/ns/net').st_ino
        for entry in Path('/proc').glob('[0-9]*'):
            with contextlib.suppress(OSError):
                if (entry / 'ns/net').stat().st_ino == own:
                    number = int(entry.name)
                    if number not in (self._holder.pid, os.getpid()):
                        os.kill(number, signal.SIGKILL)

    def close(self) -> None:
        """Take the host down."""
        os.close(self.frames)
        self._holder.kill()
        self._holder.wait()


@dataclass
class Link:
    """What lies between two hosts.

    Attributes:
        loss: Which share of the frames is lost, in either direction.
        delay: How long a frame is under way, seconds.
        cut: Whether nothing passes.
        multicast: Whether what goes to many receivers passes, as on many radio links it does not.
        passed, lost: Frames so far.
    """

    loss: float = 0.0
    delay: float = 0.0
    cut: bool = False
    multicast: bool = True
    passed: int = 0
    lost: int = 0

    def loses(self, frame: bytes, chance: random.Random) -> bool:
        """Tell whether the next frame is lost, and count it."""
        lost = self.cut or chance.random() < self.loss
        lost = lost or (not self.multicast and frame.startswith(MULTICAST))
        self.lost += lost
        self.passed += not lost
        return lost


class Network:
    """Hosts and the links between each two of them.

    Args:
        count: How many hosts.
        seed: Of the losses.

    Attributes:
        hosts: These.
    """

    def __init__(self, count: int, seed: int = 1) -> None:
        self._chance = random.Random(seed)
        self.hosts = [Host(number + 1) for number in range(count)]
        self._links = {
            frozenset((one.frames, other.frames)): Link()
            for one, other in itertools.combinations(self.hosts, 2)
        }
        self._waker, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._pass_frames, daemon=True)
        self._thread.start()

    def link(self, one: Host, other: Host) -> Link:
        """Return what is between two hosts."""
        return self._links[frozenset((one.frames, other.frames))]

    def links_of(self, host: Host) -> list[Link]:
        """Return all that lead to a host."""
        return [link for ends, link in self._links.items() if host.frames in ends]

    def close(self) -> None:
        """Take everything down."""
        os.write(self._wake, b'.')
        self._thread.join()
        for host in self.hosts:
            host.close()
        for descriptor in (self._waker, self._wake):
            os.close(descriptor)

    def _pass_frames(self) -> None:
        ports = [host.frames for host in self.hosts]
        order = itertools.count()
        under_way: list[tuple[float, int, int, bytes]] = []
        learned: dict[bytes, int] = {}
        while True:
            pause = max(0.0, under_way[0][0] - time.monotonic()) if under_way else None
            ready = select.select([*ports, self._waker], [], [], pause)[0]
            if self._waker in ready:
                return
            now = time.monotonic()
            for port in ready:
                for frame in _frames(port):
                    learned[frame[6:12]] = port  # Ethernet: receiver, sender, six bytes each
                    known = learned.get(frame[:6])
                    for other in ports if known is None else (known,):
                        link = self._links.get(frozenset((port, other)))
                        if link is not None and not link.loses(frame, self._chance):
                            entry = (now + link.delay, next(order), other, frame)
                            heapq.heappush(under_way, entry)
            while under_way and under_way[0][0] <= now:
                _, _, port, frame = heapq.heappop(under_way)
                with contextlib.suppress(OSError):  # its queue is full
                    os.write(port, frame)


def _frames(port: int) -> Sequence[bytes]:
    frames = []
    with contextlib.suppress(BlockingIOError):
        while len(frames) < 100:
            frames.append(os.read(port, LONGEST_FRAME))
    return frames


def _run(*words: str) -> None:
    subprocess.run(words, check=True, capture_output=True)
