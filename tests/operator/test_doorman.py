"""Who asks for nothing waits at the door; who asks is led to where it belongs."""

from __future__ import annotations

import queue
import socket
from collections.abc import Callable, Iterator

import pytest

from surveillance_operator.page.doorman import Doorman

MOST = 5


class Door:
    """A doorman, and whom it let in."""

    def __init__(self, patience: float) -> None:
        self._socket = socket.socket()
        self._socket.bind(('127.0.0.1', 0))
        self.port = self._socket.getsockname()[1]
        self.came: queue.Queue[tuple[socket.socket, bool]] = queue.Queue()
        self.crowds: list[bool] = []
        self._doorman = Doorman(
            self._socket,
            lambda begun: begun.startswith(b'STOP'),
            lambda peer, urgent: self.came.put((peer, urgent)),
            MOST,
            patience,
            self.crowds.append,
        )
        self._doorman.start()

    def connect(self, words: bytes = b'') -> socket.socket:
        peer = socket.create_connection(('127.0.0.1', self.port), timeout=60.0)
        peer.sendall(words)
        return peer

    def close(self) -> None:
        self._doorman.stop()


@pytest.fixture
def door() -> Iterator[Callable[[float], Door]]:
    doors: list[Door] = []

    def make(patience: float = 600.0) -> Door:
        doors.append(Door(patience))
        return doors[-1]

    yield make
    for each in doors:
        each.close()


def test_a_connection_is_led_by_its_first_bytes_which_stay_in_it(
    door: Callable[..., Door],
) -> None:
    place = door()
    for words, urgent in ((b'STOP now', True), (b'LOOK', False)):
        with place.connect(words):
            peer, was_urgent = place.came.get(timeout=60.0)
            assert was_urgent == urgent
            peer.setblocking(True)
            assert peer.recv(100) == words
            peer.close()


def test_those_that_ask_for_nothing_make_room_for_one_that_does(door: Callable[..., Door]) -> None:
    place = door()
    silent = [place.connect() for _ in range(4 * MOST)]
    with place.connect(b'STOP'):
        assert place.came.get(timeout=60.0)[1]
    assert silent[0].recv(1) == b''
    assert place.crowds
    for each in silent:
        each.close()


def test_one_that_asks_for_nothing_is_ended_after_a_while(door: Callable[..., Door]) -> None:
    with door(0.01).connect() as silent:
        assert silent.recv(1) == b''


def test_one_that_leaves_is_forgotten_and_an_end_ends_all(door: Callable[..., Door]) -> None:
    place = door()
    place.connect().close()
    silent = place.connect()
    with place.connect(b'LOOK'):
        place.came.get(timeout=60.0)[0].close()
    place.close()
    assert silent.recv(1) == b''
    silent.close()


def test_a_page_that_is_stopped_while_it_starts_accepts_nobody_and_says_nothing() -> None:
    doors: list[Doorman] = []

    class Stopping(socket.socket):
        """A listening socket, in the middle of whose start the page is stopped."""

        def setblocking(self, flag: bool) -> None:
            super().setblocking(flag)
            doors[0].stop()

    listening = Stopping(socket.AF_INET, socket.SOCK_STREAM)
    listening.bind(('127.0.0.1', 0))
    doors.append(Doorman(listening, lambda _begun: False, lambda *_: None, 5, 5.0))
    doors[0].start()
    assert listening.fileno() == -1
