"""Replaying a recording, over real HTTP and without ROS, and its report."""

from __future__ import annotations

import contextlib
import http.client
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from surveillance_operator import replay, report
from surveillance_operator.desk.questions import EventQuestions
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from surveillance_operator.recording import timeline
from surveillance_operator.recording.runs import find_recordings
from surveillance_operator.recording.timeline import Timeline
from surveillance_operator.replay import Player, Track, index_of, open_player
from tests.operator.test_event_index import Run
from tests.operator.test_timeline import record


@pytest.fixture
def page(run: Path) -> Iterator[Page]:
    broadcaster = Broadcaster()
    player = Player({'': Track(Timeline(run / 'timeline.jsonl'))}, broadcaster)
    page = Page(broadcaster, questions={}, actions=player.actions(), port=0, replay=True)
    page.player = player  # type: ignore[attr-defined]
    page.start()
    yield page
    page.stop()


def act(page: Page, name: str, **fields: Any) -> dict[str, Any]:
    connection = http.client.HTTPConnection('127.0.0.1', page.port, timeout=60.0)
    origin = {'Origin': f'http://127.0.0.1:{page.port}'}
    connection.request('POST', f'/act/{name}', json.dumps(fields), origin)
    answer: dict[str, Any] = json.loads(connection.getresponse().read())
    connection.close()
    return answer


def shown(page: Page) -> dict[str, Any]:
    connection = http.client.HTTPConnection('127.0.0.1', page.port, timeout=60.0)
    connection.request('GET', '/events')
    answer = connection.getresponse()
    while not (line := answer.readline()).startswith(b'data: '):
        assert line
    connection.close()
    parts: dict[str, Any] = json.loads(line[6:])['p']
    return parts


def test_a_viewer_moves_in_time(page: Page) -> None:
    assert shown(page)['pose'] == [0.0, 0.0, 0.0]
    assert act(page, 'seek', to=120)['ok']
    parts = shown(page)
    assert parts['pose'] == [12.0, 0.0, 0.0]
    assert parts['replay']['at'] == 120.0
    assert parts['replay']['length'] == 199.0
    assert parts['replay']['time'] == 1120.0
    assert len(parts['trail']) == 121
    assert act(page, 'jump', kind='decision')['ok']
    assert shown(page)['decision']['number'] == 4
    assert act(page, 'jump', kind='failure') == {
        'ok': False,
        'text': 'no failure after this moment',
    }
    assert act(page, 'speed', speed=1000)['ok'] is False
    assert act(page, 'seek')['ok'] is False


def test_it_plays_at_its_speed(page: Page) -> None:
    player: Player = page.player  # type: ignore[attr-defined]
    act(page, 'speed', speed=100)
    player._forward(50.0)
    assert shown(page)['pose'] == [5.0, 0.0, 0.0]
    act(page, 'pause')
    assert shown(page)['replay']['playing'] is False


def test_no_ros_is_started(run: Path) -> None:
    code = 'import sys, surveillance_operator.replay; sys.exit("rclpy" in sys.modules)'
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0


def test_the_commands_find_runs_and_say_what_is_wrong(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = str(run.parent)
    assert report.main(['last', '--runs', runs]) == 0
    assert str(run / 'report.html') in capsys.readouterr().out
    for main, name in ((report.main, 'report'), (replay.main, 'replay')):
        assert main(['nowhere', '--runs', runs]) == 2
        error = capsys.readouterr().err
        assert error.startswith(f'{name}: nowhere: expected the folder of a run')
        assert '20260101-000000' in error
        assert error.count('\n') == 1
        other = run.parent / 'notes.txt'
        other.touch()
        (run.parent / 'notes2.txt').touch()
        assert main([str(other), '--runs', runs]) == 2
        assert 'notes2' not in capsys.readouterr().err, 'a file beside it is no run'


def test_a_long_recording_is_ready_and_jumps_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / 'timeline.jsonl'
    with open(path, 'w') as file:
        for tick in range(10_000):
            head = f'{{"t":{1e9 + tick},"k":{int(tick % 60 == 0)},"e":"",'
            file.write(head + f'"now":{tick},"p":{{"pose":[{tick},0,0]}}}}\n')
    parsed = []
    parse = timeline.parse_json
    monkeypatch.setattr(timeline, 'parse_json', lambda text: parsed.append(text) or parse(text))
    line = Timeline(path)
    assert not parsed
    assert line.at(1e9 + 5_432)[2]['pose'] == [5_432, 0, 0]
    # From the last line that holds everything on, which comes once in sixty.
    assert len(parsed) == 5_432 % 60 + 1


class Lidar:
    """Says when it was asked what was seen."""

    def __init__(self) -> None:
        self.asked: list[float] = []

    def scan(self, time: float) -> list[Any]:
        self.asked.append(time)
        return [[1.0, time]]

    def jpeg(self, time: float) -> bytes:
        return b'picture of %d' % time


class Steps:
    """Passes a replay's time step by step, instead of its clock and its event.

    Args:
        player: Whose steps.
        before: Called one before each step; after the last the replay ends.
    """

    def __init__(self, player: Player, *before: Callable[[], object]) -> None:
        self._before = list(before)
        self._now = 0.0
        player._ended = self  # type: ignore[assignment]

    def monotonic(self) -> float:
        return self._now

    def wait(self, period: float) -> bool:
        self._now += period
        if not self._before:
            return True
        self._before.pop(0)()
        return False


def test_a_replay_goes_on_with_time_until_it_is_paused_or_over(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lidar, broadcaster, places = Lidar(), Broadcaster(), []
    track = Track(Timeline(run / 'timeline.jsonl'), lidar)  # type: ignore[arg-type]
    player = Player({'': track}, broadcaster)
    do = player.actions()

    def look() -> None:
        places.append(json.loads(broadcaster._of_all['replay'][1])['at'])

    monkeypatch.setattr(
        replay,
        'time',
        Steps(
            player,
            lambda: do['speed'](100),
            look,  # a step of 0.05 s
            look,
            lambda: do['pause'](),
            look,
            *[look] * 6,
            lambda: do['speed'](0.1),
            lambda: do['play'](),
            look,
            lambda: (do['seek'](198), do['speed'](100)),
            look,
            look,
        ),
    )
    player.run()
    assert places[:3] == [5.0, 10.0, 15.0]
    assert places[3:-3] == [15.0] * 6, 'paused'
    assert places[-3:] == [15.0, 199.0, 199.0], 'no farther than the end'
    assert lidar.asked == sorted(set(lidar.asked)), 'nothing is read again while it stands'
    assert 2 <= len(lidar.asked) <= 4, 'a look each 0.2 s'
    assert player.jpeg('') == b'picture of 1199'
    assert player.jpeg('nobody') is None
    assert [do['play'](), do['pause']()] == ['playing', 'paused']
    assert [do['seek'](-5), json.loads(broadcaster._of_all['replay'][1])['at']] == ['moved', 0.0]


@pytest.mark.parametrize('speed', [0.1, 100.0])
def test_the_slowest_and_the_fastest_speed_are_taken(run: Path, speed: float) -> None:
    player = Player({'': Track(Timeline(run / 'timeline.jsonl'))}, Broadcaster())
    assert player.actions()['speed'](speed) == f'speed {speed:g}'
    for wrong in (speed / 1.01, speed * 1.01):
        if not 0.1 <= wrong <= 100.0:
            with pytest.raises(ValueError, match=r'expected 0\.1 to 100'):
                player.actions()['speed'](wrong)


def test_a_replay_of_a_recording_that_grows_grows_with_it(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, broadcaster = run / 'timeline.jsonl', Broadcaster()
    read = [0.5]
    player = Player({'': Track(Timeline(path), read=lambda: read[0])}, broadcaster)

    def lengths() -> tuple[float, float]:
        shown = json.loads(broadcaster._of_all['replay'][1])
        return shown['length'], shown['read']

    def add(at: float) -> None:
        with open(path, 'a') as file:
            file.write(f'{{"t":{at},"k":0,"e":"recharge","now":1,"p":{{}}}}\n')

    seen = []
    monkeypatch.setattr(
        replay,
        'time',
        Steps(
            player,
            lambda: add(1300.0),
            *[lambda: None] * 4,
            lambda: seen.append(lengths()),
            lambda: (add(1400.0), read.insert(0, 1.0)),
            *[lambda: None] * 4,
            lambda: (seen.append(lengths()), add(1500.0)),
            *[lambda: None] * 9,
            lambda: seen.append(lengths()),
        ),
    )
    player.run()
    assert seen == [(300.0, 0.5), (400.0, 1.0), (400.0, 1.0)]
    assert player.actions()['jump']('recharge') == 'at the recharge'
    with pytest.raises(ValueError, match=r"'recharg': expected .*recharge"):
        player.actions()['jump']('recharg')


def test_a_replay_that_falls_far_behind_jumps(tmp_path: Path) -> None:
    """A page that was asleep for an hour does not get each line of it."""
    path = tmp_path / 'timeline.jsonl'
    with open(path, 'w') as file:
        for tick in range(1000):
            head = f'{{"t":{1e9 + tick},"k":{int(tick % 60 == 0)},"e":"",'
            whole = f'"battery":{{"level":{tick}}},' if tick % 60 == 0 else ''
            file.write(head + f'"now":{tick},"p":{{{whole}"pose":[{tick},0,0]}}}}\n')
    broadcaster, line = Broadcaster(), Timeline(path)
    player = Player({'': Track(line)}, broadcaster)
    read = []
    plain = line.line
    line.line = lambda number: read.append(number) or plain(number)  # type: ignore[method-assign]
    player._forward(400.0)
    assert read == list(range(1, 401))
    player._forward(500.0)
    # As many as a step takes, then those since the last whole one.
    assert len(read) == 400 + 400 + 1
    assert json.loads(broadcaster._robots[''].texts['pose'][1]) == [900, 0, 0]
    player._forward(1.0)
    assert read[-1] == 901


def test_a_replay_shows_the_alarms_as_they_were(tmp_path: Path) -> None:
    run = tmp_path / '20260101-000000'
    made = Run(run)
    record(run / 'timeline.jsonl')
    made.now = 1050.0
    made.incident('abc', 'begin')
    made.now = 1100.0
    made.say('acknowledge', 'abc')
    made.now = 1150.0
    made.incident('abc', 'end')
    shown: list[Any] = []
    broadcaster = Broadcaster()
    broadcaster.show_desk = lambda part: shown.append(  # type: ignore[method-assign]
        [each['state'] for each in part['open']]
    )
    with contextlib.ExitStack() as stack:
        recordings = find_recordings(str(run), tmp_path)
        index = index_of(recordings)
        player = open_player(recordings, broadcaster, stack, index)
        for at in (10, 60, 110, 160, 60):
            player.seek(at)
            player.see()
        asked = EventQuestions(index, time.time, lambda: player.time)
        player.seek(10)
        assert (asked.search()['count'], asked.search(whole='1')['count']) == (0, 1)
    assert shown == [[], ['unacknowledged'], ['acknowledged'], [], ['unacknowledged']]
