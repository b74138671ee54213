"""Who may do what on the page: roles, links that can be taken back, and what is kept of them."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from surveillance_operator.page.access import Links, Person, least_role
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Document, Page


class Door:
    """A page with every role, and who has pressed what."""

    def __init__(self, folder: Path) -> None:
        self.pressed: list[tuple[str, str, str]] = []
        self.links = Links(folder / 'links.json')
        self.page = Page(
            Broadcaster(),
            questions={'search': lambda text='': {'ok': True, 'text': text}},
            actions={
                'stop': lambda on=True: 'stopped',
                'alarm': self.alarm,
                'go': lambda place: f'to {place}',
            },
            documents={'metrics': lambda: Document(b'up 1\n', 'text/plain; version=0.0.4')},
            port=0,
            links=self.links,
            pressed=lambda who, name, _fields, said: self.pressed.append((who.name, name, said)),
        )
        self.page.start()

    def alarm(self, verb: str, key: str, note: str = '', by: str = '') -> str:
        """Answer an alarm."""
        return f'{verb} by {by}'

    def send(self, path: str, token: str = '', **fields: Any) -> tuple[int, Any]:
        request = urllib.request.Request(f'http://127.0.0.1:{self.page.port}{path}')
        if token:
            request.add_header('Authorization', f'Bearer {token}')
        if path.startswith('/act/'):
            request.data = json.dumps(fields).encode()
            request.add_header('Origin', f'http://127.0.0.1:{self.page.port}')
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                text = answer.read().decode()
                return answer.status, json.loads(text) if text.startswith('{') else text
        except urllib.error.HTTPError as error:
            text = error.read().decode()
            return error.code, json.loads(text) if text.startswith('{') else text


@pytest.fixture
def door(tmp_path: Path) -> Iterator[Door]:
    door = Door(tmp_path)
    yield door
    door.page.stop()


def test_each_role_may_what_it_may(door: Door) -> None:
    tokens = {role: door.links.make(role.title(), role) for role in ('viewer', 'guard')}
    tokens['operator'] = door.page.token
    may = {
        role: [
            door.send('/act/stop', token)[0],
            door.send('/act/alarm', token, verb='acknowledge', key='a')[0],
            door.send('/act/go', token, place='R1')[0],
            door.send('/act/make_link', token, name='X', role='guard')[0],
        ]
        for role, token in tokens.items()
    }
    assert may['viewer'] == [403, 403, 403, 403]
    assert may['guard'] == [200, 200, 403, 403]
    assert may['operator'] == [200, 200, 200, 200]
    assert door.send('/act/stop')[0] == 403
    assert door.send('/act/stop', 'wrong')[0] == 403


def test_who_pressed_is_told_by_the_server_and_not_by_the_request(door: Door) -> None:
    token = door.links.make('Anna', 'guard')
    _, answer = door.send('/act/alarm', token, verb='acknowledge', key='a', by='the boss')
    assert answer['text'] == 'acknowledge by Anna'
    door.page.stop()
    assert door.pressed == [('Anna', 'alarm', 'acknowledge by Anna')]


def test_a_link_is_taken_back(door: Door) -> None:
    _, made = door.send('/act/make_link', door.page.token, name='Ben', role='guard')
    token = made['link'].partition('?token=')[2]
    assert door.send('/act/stop', token)[0] == 200
    assert door.send('/act/revoke_link', door.page.token, name='Ben')[0] == 200
    assert door.send('/act/stop', token)[0] == 403
    status, answer = door.send('/act/revoke_link', door.page.token, name='Ben')
    assert (status, answer['ok']) == (422, False)


def test_the_file_has_no_token_and_is_its_owners_alone(door: Door, tmp_path: Path) -> None:
    token = door.links.make('Anna', 'guard')
    path = tmp_path / 'links.json'
    assert token not in path.read_text()
    assert path.stat().st_mode & 0o777 == 0o600
    other = Links(path)
    assert other.person(token) == Person('Anna', 'guard')
    other.revoke('Anna')
    assert door.links.person(token) is None
    path.write_text('[{"name": 1}]')
    assert door.links.person(token) is None


@pytest.mark.parametrize(
    ('name', 'role', 'expected'),
    [('', 'guard', 'a name'), ('operator', 'guard', 'a name'), ('Anna', 'gard', "'guard'")],
)
def test_a_link_that_cannot_be_made_says_why(name: str, role: str, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        Links().make(name, role)


def test_a_guard_stops_one_robot_or_all_and_lets_none_go_on() -> None:
    assert least_role('fleet', {'word': 'stop'}) == least_role('stop', {}) == 'guard'
    assert least_role('fleet', {'word': 'go'}) == least_role('machine', {}) == 'operator'


def test_metrics_and_the_description_of_the_interface_are_served(door: Door) -> None:
    assert door.send('/metrics') == (200, 'up 1\n')
    _, described = door.send('/openapi.json')
    assert described['openapi'].startswith('3.1')
    act = described['paths']['/act/alarm']['post']
    schema = act['requestBody']['content']['application/json']['schema']
    assert schema['required'] == ['verb', 'key']
    assert 'by' not in schema['properties']
    assert act['summary'] == 'Answer an alarm.'
    assert {'/ask/search', '/get/metrics', '/events', '/act/go'} <= described['paths'].keys()
