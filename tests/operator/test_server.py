"""Who may see the page and who may act, over real HTTP."""

from __future__ import annotations

import http.client
import json
import socket
from collections.abc import Iterator

import pytest

from surveillance_operator.mission_state import MissionState
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page

done: list[object] = []
told: list[str] = []


def door(door: object) -> str:
    done.append(door)
    return 'door D1 is closed'


def facts(place: object) -> object:
    return {'ok': True, 'facts': [place]}


def broken(place: object) -> object:
    raise KeyError(place)


def refuse() -> str:
    raise ValueError('no such door')


@pytest.fixture
def page() -> Iterator[Page]:
    done.clear()
    told.clear()
    page = Page(
        Broadcaster(),
        questions={'facts': facts, 'broken': broken},
        actions={'door': door, 'refused': refuse},
        port=0,
        token='secret',
        report=told.append,
    )
    page.start()
    yield page
    page.stop()


def ask(page: Page, method: str, path: str, body: str = '', **headers: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection('127.0.0.1', page.port, timeout=60.0)
    named = {name.replace('_', '-'): value for name, value in headers.items()}
    connection.request(method, path, body, named)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


def own(page: Page) -> dict[str, str]:
    return {
        'Origin': f'http://127.0.0.1:{page.port}',
        'Cookie': f'mission_{page.port}=secret',
    }


def test_whoever_is_on_this_machine_may_look(page: Page) -> None:
    status, text = ask(page, 'GET', '/')
    assert status == 200
    assert 'data-kind="live" data-control="0"' in text
    assert ask(page, 'GET', '/static/main.js')[0] == 200
    assert ask(page, 'GET', '/ask/facts?place=R1') == (200, '{"ok":true,"facts":["R1"]}')
    assert ask(page, 'GET', '/camera.jpg')[0] == 204
    assert ask(page, 'GET', '/static/../server.py')[0] == 404


def test_the_token_becomes_a_cookie(page: Page) -> None:
    connection = http.client.HTTPConnection('127.0.0.1', page.port, timeout=60.0)
    connection.request('GET', '/?token=secret')
    answer = connection.getresponse()
    cookie = answer.headers['set-cookie']
    assert answer.status == 303
    assert 'HttpOnly' in cookie
    assert 'samesite=strict' in cookie.lower()
    connection.close()
    assert ask(page, 'GET', '/?token=wrong')[0] == 403
    assert 'data-control="1"' in ask(page, 'GET', '/', **own(page))[1]


def test_an_action_needs_token_and_origin(page: Page) -> None:
    good = own(page)
    cookie, origin = {'Cookie': good['Cookie']}, {'Origin': good['Origin']}
    foreign = {**good, 'Origin': 'http://evil.example'}
    wrong = {**good, 'Cookie': f'mission_{page.port}=wrong'}
    for headers in ({}, cookie, origin, foreign, wrong):
        status, text = ask(page, 'POST', '/act/door', '{}', **headers)
        assert status == 403
        assert 'refused' in text
    assert ask(page, 'GET', '/act/door', **good)[0] == 405
    assert done == []
    status, text = ask(page, 'POST', '/act/door', '{"door": "D1"}', **good)
    assert (status, json.loads(text)) == (200, {'ok': True, 'text': 'door D1 is closed'})
    assert done == ['D1']


@pytest.mark.parametrize(
    ('path', 'body', 'status'),
    [
        ('/act/door', '[', 400),
        ('/act/door', '[' * 65_000, 400),
        ('/act/door', '[]', 400),
        ('/act/door', ' ' * 70_000, 413),
        ('/act/refused', '{}', 422),
        ('/act/door', '{}', 422),
        ('/act/door', '{"doors": "D1"}', 422),
        ('/act/unknown', '{}', 404),
    ],
)
def test_what_cannot_be_done_is_said(page: Page, path: str, body: str, status: int) -> None:
    found, text = ask(page, 'POST', path, body, **own(page))
    assert found == status
    assert json.loads(text)['ok'] is False
    assert 'Traceback' not in text


def test_another_name_for_this_machine_is_refused(page: Page) -> None:
    assert ask(page, 'GET', '/', Host='evil.example')[0] == 403
    assert ask(page, 'GET', '/', Host=f'localhost:{page.port}')[0] == 200


@pytest.mark.parametrize('host', ['[', '[::1', ']', '[zz]:1', ''])
def test_a_host_that_is_none_costs_nothing(page: Page, host: str) -> None:
    assert ask(page, 'GET', '/', Host=host)[0] in (400, 403)
    assert told == []


def test_a_request_that_fails_costs_one_line_and_one_answer(page: Page) -> None:
    status, text = ask(page, 'GET', '/ask/broken?place=R1')
    assert status == 500
    assert 'Traceback' not in text
    with socket.create_connection(('127.0.0.1', page.port), timeout=60) as raw:
        raw.sendall(b'\x16\x03\x01 no HTTP at all\r\n\r\n')
        assert raw.recv(100).startswith(b'HTTP/1.1 400')
    assert len(told) == 2
    assert not any('\n' in line for line in told)


def test_who_comes_by_another_address_is_told_which_option_it_takes(page: Page) -> None:
    foreign = {**own(page), 'Origin': 'https://robot.example.org'}
    status, text = ask(page, 'POST', '/act/door', '{}', **foreign)
    assert status == 403
    assert '--web-origin https://robot.example.org' in text


def test_an_origin_that_is_none_is_refused() -> None:
    for text in ('robot.example.org', 'ftp://x', 'https://', 'https://x/path', 'https://[x'):
        with pytest.raises(ValueError, match=r'expected an origin like https'):
            Page(Broadcaster(), questions={}, actions={}, port=0, origin=text)


def test_beyond_this_machine_even_looking_needs_the_token() -> None:
    page = Page(Broadcaster(), questions={}, actions={}, host='0.0.0.0', port=0, token='secret')
    page.start()
    try:
        assert page.address.endswith('?token=secret')
        for path in ('/', '/events', '/static/main.js', '/camera.jpg'):
            assert ask(page, 'GET', path)[0] == 403
        assert ask(page, 'GET', '/', Cookie=f'mission_{page.port}=secret')[0] == 200
    finally:
        page.stop()


def test_no_other_site_may_be_loaded_or_embed_the_page(page: Page) -> None:
    connection = http.client.HTTPConnection('127.0.0.1', page.port, timeout=60.0)
    connection.request('GET', '/')
    policy = connection.getresponse().headers['content-security-policy']
    connection.close()
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert 'unsafe' not in policy


def test_a_viewer_gets_everything_and_then_what_changed(page: Page) -> None:
    page._broadcaster.show(MissionState().having(battery=50.0, now=1.0))
    connection = http.client.HTTPConnection('127.0.0.1', page.port, timeout=60.0)
    connection.request('GET', '/events')
    answer = connection.getresponse()

    def event() -> dict[str, object]:
        while not (line := answer.readline()).startswith(b'data: '):
            assert line
        found: dict[str, object] = json.loads(line[6:])
        return found

    first = event()
    assert first['whole'] == 1
    assert first['p']['brief'] == 'battery 50 %'  # type: ignore[index]
    page._broadcaster.show(MissionState().having(battery=49.0, now=2.0))
    second = event()
    figures = [['battery', 'battery', '49 %', False, 0.49]]
    changed = {'figures': figures, 'brief': 'battery 49 %'}
    assert second == {'now': 2.0, 'whole': 0, 'robot': '', 'p': changed, 'r': {}}
    connection.close()


def test_an_address_that_is_taken_is_one_line(page: Page) -> None:
    with pytest.raises(OSError, match=f'127.0.0.1:{page.port}: Address already in use'):
        Page(Broadcaster(), questions={}, actions={}, port=page.port)


def test_pictures_are_for_whoever_may_look_and_beyond_this_machine_blurred() -> None:
    asked: list[tuple[str, str, str, bool]] = []

    def picture(name: str, robot: str, run: str, leaves: bool) -> bytes | None:
        asked.append((name, robot, run, leaves))
        return b'jpeg' if name == 'a.jpg' else None

    here = Page(Broadcaster(), questions={}, actions={}, evidence=picture, port=0)
    away = Page(Broadcaster(), questions={}, actions={}, evidence=picture, host='0.0.0.0', port=0)
    for each in (here, away):
        each.start()
    try:
        assert ask(here, 'GET', '/evidence/a.jpg') == (200, 'jpeg')
        assert ask(here, 'GET', '/evidence/b.jpg?robot=anna&run=old')[0] == 404
        assert ask(away, 'GET', '/evidence/a.jpg')[0] == 403
        assert ask(away, 'GET', f'/evidence/a.jpg?token={away.token}') == (200, 'jpeg')
    finally:
        for each in (here, away):
            each.stop()
    assert asked == [
        ('a.jpg', '', '', False),
        ('b.jpg', 'anna', 'old', False),
        ('a.jpg', '', '', True),
    ]
