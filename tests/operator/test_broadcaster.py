""""""

from __future__ import annotations

import asyncio
import json
from typing import Any

from surveillance_operator.page.broadcaster import Broadcaster
from tests.operator.missions import FLEET


def test_a_viewer_gets_all_of_one_robot_and_a_glance_of_the_others() -> None:
    broadcaster = Broadcaster()
    for name, state in FLEET.items():
        broadcaster.show(state, name)

    async def look() -> tuple[Any, Any, Any]:
        first = broadcaster.stream('bert')
        usual = broadcaster.stream()
        read: list[Any] = []
        for stream in (first, usual):
            await anext(stream)
            read.append(json.loads((await anext(stream)).removeprefix('data: ')))
        broadcaster.show(FLEET['anna'].having(battery=79.0), 'anna')
        read.append(json.loads((await anext(first)).removeprefix('data: ')))
        return read[0], read[1], read[2]

    bert, usual, later = asyncio.run(look())
    assert (bert['robot'], usual['robot']) == ('bert', 'anna'), 'the first one, unless asked for'
    assert 'grid' in bert['p']
    assert bert['r'].keys() == {'', 'anna', 'carl'}
    assert bert['r']['anna']['pose'] == [1.0, 1.0, 0.0]
    assert 'grid' not in bert['r']['anna']
    assert ['anna begins' in each for each in bert['p']['events']].count(True) == 1
    assert [each[1:] for each in bert['p']['events']].count(['', 'door D closed']) == 1
    assert (later['p'], later['r']) == ({}, {'anna': {'brief': 'battery 79 %'}})


def test_a_viewer_of_a_robot_that_is_shown_no_longer_sees_another_one_whole() -> None:
    broadcaster = Broadcaster()
    for name, state in FLEET.items():
        broadcaster.show(state, name)

    async def look() -> list[Any]:
        stream = broadcaster.stream('bert')
        await anext(stream)
        read = []
        for leaves in ('nobody', 'bert', 'carl'):
            read.append(json.loads((await anext(stream)).removeprefix('data: ')))
            broadcaster.forget(leaves)
            if leaves == 'nobody':
                broadcaster.show(FLEET['anna'].having(battery=70.0), 'anna')
        return [*read, json.loads((await anext(stream)).removeprefix('data: '))]

    whole, same, other, last = asyncio.run(look())
    assert [(each['robot'], each['whole']) for each in (whole, same, other, last)] == [
        ('bert', 1),
        ('bert', 0),
        ('anna', 1),
        ('anna', 1),
    ], 'what is not told again is not known'
    assert 'grid' not in same['p']
    assert 'grid' in other['p']
    assert other['r'].keys() == {'', 'carl'}
    assert last['r'].keys() == {''}
    began = [each[1] for each in last['p']['events'] if each[2].endswith('begins')]
    assert began == ['anna'], 'nobody else is in the time line of all'
