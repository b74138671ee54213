"""Whatever others do with their connections, a person's request is answered."""

from __future__ import annotations

import selectors
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from surveillance_operator.mission_state import MissionState
from surveillance_operator.page import connections, server
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page

from .test_server import ask, own

MOST = 12


def stop(on: object) -> str:
    return f'stop: {on}'


class Slow:
    """An action that takes until it is let go."""

    def __init__(self) -> None:
        self.may_end = threading.Event()
        self.begun = threading.Semaphore(0)

    def __call__(self) -> str:
        self.begun.release()
        self.may_end.wait(60.0)
        return 'done'


@pytest.fixture
def slow() -> Slow:
    return Slow()


@pytest.fixture
def crowds() -> list[bool]:
    return []


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch, slow: Slow, crowds: list[bool]) -> Iterator[Page]:
    monkeypatch.setattr(server, 'most_connections', lambda: MOST)
    broadcaster = Broadcaster()
    actions: dict[str, Any] = {'stop': stop, 'slow': slow}
    page = Page(
        *(broadcaster,),
        questions={},
        actions=actions,
        port=0,
        token='secret',
        crowded=crowds.append,
    )
    broadcaster.show(MissionState())
    page.start()
    yield page
    slow.may_end.set()
    page.stop()


def connect(page: Page, words: bytes) -> socket.socket:
    peer = socket.create_connection(('127.0.0.1', page.port), timeout=60.0)
    peer.sendall(words)
    return peer


def press(page: Page) -> tuple[int, str]:
    return ask(page, 'POST', '/act/stop', '{"on": true}', **own(page))


def ended(peer: socket.socket) -> bool:
    """Wait for the end of a connection."""
    try:
        while peer.recv(65_536):
            pass
    except ConnectionError:
        pass
    return True


def one_ended(peers: list[socket.socket]) -> bool:
    """Wait for the end of one of several connections: which come first is not certain."""
    with selectors.DefaultSelector() as selector:
        for peer in peers:
            selector.register(peer, selectors.EVENT_READ, peer)
        while True:
            for key, _ in selector.select(60.0):
                try:
                    if not key.data.recv(65_536):
                        return True
                except ConnectionError:
                    return True


def test_more_half_requests_than_connections_leave_room_for_the_stop(page: Page) -> None:
    with ExitStack() as peers:
        half = [peers.enter_context(connect(page, b'GET / HTT')) for _ in range(5 * MOST)]
        assert press(page) == (200, '{"ok":true,"text":"stop: True"}')
        assert one_ended(half)


def test_more_viewers_than_connections_leave_room_for_the_stop(
    page: Page, crowds: list[bool]
) -> None:
    words = f'GET /events HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n\r\n'.encode()
    with ExitStack() as peers:
        viewers = [peers.enter_context(connect(page, words)) for _ in range(3 * MOST)]
        assert press(page)[0] == 200
        assert one_ended(viewers)
        assert crowds[0], 'somebody is told'


def test_half_a_request_ends_after_a_while(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, 'HEADER_TIME', 0.05)
    monkeypatch.setattr(connections, 'BODY_SILENCE', 0.05)
    head = f'POST /act/stop HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n'
    for name, value in own(page).items():
        head += f'{name}: {value}\r\n'
    assert ended(connect(page, b'GET / HTT'))
    assert ended(connect(page, f'{head}Content-Length: 100\r\n\r\n{{'.encode()))


def test_a_viewer_that_reads_nothing_is_cut_off(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, 'UNREAD_TIME', 0.05)
    cut = threading.Event()
    lost = connections.BoundedConnection.connection_lost

    def note(self: Any, exc: Exception | None) -> None:
        cut.set()
        lost(self, exc)

    monkeypatch.setattr(connections.BoundedConnection, 'connection_lost', note)
    peer = socket.socket()
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    peer.connect(('127.0.0.1', page.port))
    peer.sendall(f'GET /events HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n\r\n'.encode())
    number = 0
    while not cut.wait(0.02):
        number += 1
        page._broadcaster.show_parts({'why': f'{number}' * 100_000}, 1.0, whole=False)
    peer.close()


def test_what_takes_long_keeps_nobody_from_the_stop(
    page: Page, slow: Slow, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = f'POST /act/slow HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n'
    for name, value in own(page).items():
        words += f'{name}: {value}\r\n'
    monkeypatch.setattr(server, 'most_connections', lambda: 100)
    many = Page(Broadcaster(), questions={}, actions=page._actions, port=0, token='secret')
    many.start()
    with ExitStack() as peers:
        for _ in range(45):
            sent = words.replace(str(page.port), str(many.port)) + 'Content-Length: 0\r\n\r\n'
            peers.enter_context(connect(many, sent.encode()))
        for _ in range(40):
            assert slow.begun.acquire(timeout=60.0)
        assert press(many)[0] == 200
        slow.may_end.set()
    many.stop()


def test_an_endless_body_is_not_read_on(page: Page) -> None:
    head = f'POST /act/stop HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n'
    for name, value in own(page).items():
        head += f'{name}: {value}\r\n'
    peer = connect(page, f'{head}Transfer-Encoding: chunked\r\n\r\n'.encode())
    chunk = b'4000\r\n' + b' ' * 0x4000 + b'\r\n'

    def send_on() -> None:
        while True:
            peer.sendall(chunk)

    with pytest.raises(ConnectionError):
        send_on()


def test_what_the_page_does_not_do_is_named(page: Page) -> None:
    status, text = ask(page, 'POST', '/act/stopp', '{}', **own(page))
    assert status == 404
    assert "no action 'stopp', expected 'stop'" in text
    upgrade = {'Connection': 'Upgrade', 'Upgrade': 'websocket'}
    assert ask(page, 'GET', '/', **upgrade)[0] == 426


def test_each_answer_ends_its_connection(page: Page) -> None:
    whole = f'GET /static/none HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n\r\n'.encode()
    with connect(page, whole) as peer:
        assert ended(peer)


def test_a_loop_that_is_busy_with_viewers_does_not_delay_the_stop(page: Page) -> None:
    assert ask(page, 'GET', '/static/main.js', **own(page))[0] == 200
    loop, may_end = page._loops[False]._loop, threading.Event()
    assert loop is not None
    loop.call_soon_threadsafe(may_end.wait)
    try:
        assert press(page)[0] == 200
    finally:
        may_end.set()
