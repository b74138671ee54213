"""A fleet before a person: its robots on one page and in one time line, told one by one or all.

The page of a robot that is alone is that of a fleet of one; `test_page_states.py` has it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from builtin_interfaces.msg import Time

from strict_files.files import FileError
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_operator.mission_markers_node import markers_of
from surveillance_operator.mission_state import (
    FleetReport,
    Notice,
)
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from surveillance_operator.recording.runs import find_recordings
from surveillance_operator.recording.timeline import TimelineWriter
from surveillance_operator.replay import open_player
from surveillance_operator.report import draw_picture, write_report
from surveillance_runtime.rviz_layout import fleet_layout
from tests.launcher.conftest import ROOT
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer
from tests.operator.missions import FLEET


@pytest.fixture
def fleet_run(tmp_path: Path) -> Path:
    """Return what a run of two robots left, of which one began later."""
    folder = tmp_path / '20260101-000000'
    folder.mkdir()
    (folder / 'place.yaml').write_text((ROOT / 'config' / 'seven_rooms.yaml').read_text())
    for name, begin, place in (('anna', 0.0, 'R1'), ('bert', 50.0, 'R2')):
        own = folder / name
        own.mkdir()
        writer = TimelineWriter(own / 'timeline.jsonl')
        for second in range(30):
            at = 1000.0 + begin + second
            state = FLEET[name].having(
                now=at, pose=(float(second), 1.0, 0.0), decision_number=second
            )
            writer.add(state, at)
        writer.close()
        with MissionRecord(own / 'events.jsonl') as record:
            places = ['C1', 'R1', 'R2']
            record.write('start', begin, machine='surveillance', places=places, place='C1')
            for n in range(3):
                reason = f'{place} is for {name}'
                at = begin + 20.0 * n
                record.write('decision', at, place=place, rule='URGENT', reason=reason)
                record.write('visit', begin + 20.0 * n + 5.0, place=place, distance=3.0)
    return folder


def test_the_report_of_a_fleet_has_all_robots_and_leads_to_each(fleet_run: Path) -> None:
    text = write_report(fleet_run).read_text()
    assert 'href="anna/report.html"' in text
    assert (fleet_run / 'bert' / 'report.html').is_file()
    assert 'bert 3' in text
    assert text.count('<img class="map"') == 1
    assert draw_picture(fleet_run) == fleet_run / 'report.png'
    lines = text[text.index('What happened') :]
    assert lines.index('R2 is for bert') > lines.index('R1 is for anna')
    found = find_recordings(str(fleet_run), fleet_run.parent)
    assert list(found) == ['anna', 'bert']
    assert list(find_recordings('last', fleet_run.parent)) == ['anna', 'bert']


def test_a_fleet_is_replayed_in_one_time(fleet_run: Path) -> None:
    broadcaster = Broadcaster()
    with contextlib.ExitStack() as stack:
        player = open_player(find_recordings(str(fleet_run), fleet_run.parent), broadcaster, stack)
        assert player.length == 79.0, 'from the first one that begins to the last one that ends'
        player.seek(60.0)

        async def look() -> Any:
            stream = broadcaster.stream('bert')
            await anext(stream)
            return json.loads((await anext(stream)).removeprefix('data: '))

        seen = asyncio.run(look())
        assert seen['p']['pose'] == [10.0, 1.0, 0.0]
        assert seen['r']['anna']['pose'] == [29.0, 1.0, 0.0]
        assert seen['p']['replay']['at'] == 60.0
        assert ['anna', 'anna begins'] in [each[1:] for each in seen['p']['events']]


def test_one_damaged_recording_costs_a_line_and_the_others_are_played(
    fleet_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (fleet_run / 'bert' / 'timeline.jsonl').write_text('garbage\n')
    found = find_recordings(str(fleet_run), fleet_run.parent)
    with contextlib.ExitStack() as stack:
        assert open_player(found, Broadcaster(), stack).length == 29.0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith('bert/timeline.jsonl: holds nothing to replay: it is left out')
    (fleet_run / 'anna' / 'timeline.jsonl').write_text('')
    with contextlib.ExitStack() as stack, pytest.raises(FileError, match='anna/timeline'):
        open_player(found, Broadcaster(), stack)


def test_a_robot_that_left_nothing_is_named_in_the_report(fleet_run: Path) -> None:
    bert = fleet_run / 'bert'
    (bert / 'place.yaml').write_text((fleet_run / 'place.yaml').read_text())
    for name in ('events.jsonl', 'timeline.jsonl'):
        (bert / name).unlink()
    text = write_report(fleet_run).read_text()
    assert '2 robots' in text
    assert '<p class="late">bert: cannot read the mission record' in text
    assert list(find_recordings(str(fleet_run), fleet_run.parent)) == ['anna']
    shutil.rmtree(bert)
    assert ', 1 robot</h1>' in write_report(fleet_run).read_text()


def test_rviz_shows_each_robot_in_a_group_of_its_own() -> None:
    text = (ROOT / 'config' / 'mission.rviz').read_text()
    layout = yaml.safe_load(fleet_layout(text, ['bert', 'anna'], 'house'))
    displays = layout['Visualization Manager']['Displays']
    assert displays[0]['Topic']['Value'] == '/house/map'
    assert [each['Name'] for each in displays[1:]] == ['anna', 'bert']
    planned = {
        group['Name']: next(each for each in group['Displays'] if each['Name'] == 'Planned')
        for group in displays[1:]
    }
    assert planned['anna']['Topic']['Value'] == '/house/anna/plan'
    assert planned['anna']['Color'] != planned['bert']['Color']
    hidden = [
        [each.get('Namespaces') for each in group['Displays'] if each['Class'].endswith('Array')]
        for group in displays[1:]
    ]
    off = {'places': False, 'names': False, 'doors': False}
    assert off not in hidden[0], 'the first one shows the place, once'
    assert hidden[1] == [off] * len(hidden[0]) != []
    (name,) = [each for each in markers_of(FLEET['anna'], Time()).markers if each.ns == 'robots']
    assert name.text == 'anna'


@pytest.fixture(scope='module')
def told() -> list[tuple[str, str]]:
    return []


@pytest.fixture(scope='module')
def broadcaster() -> Broadcaster:
    return Broadcaster()


@pytest.fixture(scope='module')
def viewer(broadcaster: Broadcaster, told: list[tuple[str, str]]) -> Iterator[Viewer]:
    if not (CHROMIUM and DRIVER):
        pytest.skip(MISSING)

    def fleet(word: str, robot: str) -> str:
        told.append((word, robot))
        return f'{word} {robot}'

    def stop(on: bool, robot: str = '') -> str:
        return fleet('stop' if on else 'release', robot)

    page = Page(broadcaster, questions={}, actions={'fleet': fleet, 'stop': stop}, port=0)
    page.start()
    for name, state in FLEET.items():
        broadcaster.show(state, name)
    viewer = Viewer(page.address)
    yield viewer
    viewer.close()
    page.stop()


def test_the_page_shows_all_robots_and_one_of_them_whole(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    viewer.until(lambda: viewer.count('[data-row]') == 4)
    assert viewer.text('#title').startswith('anna')
    assert viewer.text('[data-row=bert] .doing') == (
        'A · on its way to B · battery 80 % · shares A, B, next B'
    )
    assert 'B is for carl' in viewer.text('[data-row=carl] .note')
    assert viewer.count('#map [data-robot]') == 3
    looks = 'return [...document.querySelectorAll("#map [data-robot] path")].map('
    looks += '(each) => getComputedStyle(each).fill)'
    assert len(set(viewer.js(looks))) == 3, 'each has a colour of its own'
    assert viewer.count('#map .plan.other[d^=M]') == 2
    assert viewer.js('return document.getElementById("stop").textContent') == 'STOP anna'
    viewer.click('[data-choose=bert]')
    viewer.until(lambda: viewer.text('#title').startswith('bert'))
    assert viewer.text('#reason') == 'B is for bert'
    assert viewer.attribute('[data-choose=bert]', 'aria-pressed') == 'true'
    assert 'robot=bert' in viewer.driver.current_url
    broadcaster.show(FLEET['carl'].having(pose=(4.0, 1.0, 0.0)), 'carl')
    viewer.until(lambda: '4px' in viewer.attribute('#map [data-robot=carl]', 'style'))


def test_alarms_name_the_robot_and_one_time_line_has_the_events_of_all(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    status = FLEET['carl'].task.status
    assert status is not None
    help_needed = replace(status, waiting_for_help=True, text='shut in')
    events = (*FLEET['carl'].notices, Notice('battery low', at=1e9 + 9.0))
    broadcaster.show(FLEET['carl'].having(status=help_needed, notices=events), 'carl')
    viewer.until(lambda: viewer.text('#alarms') == 'carl: waits for help: shut in')
    viewer.until(lambda: 'battery low' in viewer.text('#events li'))
    assert viewer.text('#events li b') == 'carl'
    assert viewer.text('#events').count('door D closed') == 1
    broadcaster.show(FLEET['carl'], 'carl')
    viewer.until(lambda: viewer.js('return document.getElementById("alarms").hidden'))


def test_one_robot_or_all_are_told(
    broadcaster: Broadcaster, viewer: Viewer, told: list[tuple[str, str]]
) -> None:
    viewer.until(lambda: viewer.count('[data-row]') == 4)
    for selector in (
        '[data-row=carl] [data-word=out]',
        '[data-row=bert] [data-word=pause]',
        '[data-all=go]',
        '#stop-all',
        '[data-row=anna] [data-word=stop]',
    ):
        count = len(told)
        viewer.click(selector)
        viewer.until(lambda count=count: len(told) > count)
    assert viewer.text('#stop-answer') == '✓ stop all', 'said where STOP ALL was pressed'
    assert told[-5:] == [
        ('out', 'carl'),
        ('pause', 'bert'),
        ('go', 'all'),
        ('stop', 'all'),
        ('stop', 'anna'),
    ]
    viewer.until(lambda: viewer.text('#fleet-answer') == '✓ stop anna')
    out = FleetReport(taken_out=True)
    broadcaster.show(FLEET['anna'].having(stopped=True, fleet_report=out), 'anna')
    words = 'return [...document.querySelectorAll("[data-row=anna] [data-word]")]'
    words += '.filter((each) => !each.hidden).map((each) => each.dataset.word)'
    viewer.until(lambda: viewer.js(words) == ['pause', 'release', 'in'])
    broadcaster.show(FLEET['anna'], 'anna')
    viewer.click('[data-choose=anna]')
    viewer.until(lambda: viewer.text('#title').startswith('anna'))
    viewer.click('#stop')
    viewer.until(lambda: told[-1] == ('stop', 'anna'))


def test_a_fleet_is_readable_everywhere(viewer: Viewer) -> None:
    for size, dark in ((PHONE, True), (DESK, False)):
        viewer.size(*size, dark=dark)
        assert viewer.js('return document.documentElement.scrollWidth') <= size[0]
        assert viewer.axe() == []
    severe = [each for each in viewer.driver.get_log('browser') if each['level'] == 'SEVERE']
    assert severe == []
