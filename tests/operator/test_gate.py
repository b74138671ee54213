"""Each request is let in as whoever sends it, and no further."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.operator.page_door import Door


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
