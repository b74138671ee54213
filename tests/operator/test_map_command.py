"""The command that checks a place and draws it."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from floor_plans.drawing import Canvas, blend, draw_place
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_operator import map_command
from surveillance_simulation.world.simulated_place import read_simulated_place
from tests.places import seven_rooms

pytestmark = pytest.mark.early

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.fixture
def record(tmp_path: Path) -> Path:
    path = tmp_path / 'run.jsonl'
    with MissionRecord(path) as mission:
        mission.write(
            'start',
            0.0,
            machine='surveillance',
            place='E',
            places=['R1', 'R2', 'R3', 'R4', 'E', 'C1', 'C2'],
        )
        mission.write('visit', 10.0, place='C1', distance=5.4)
        way = [[10, 8], [10, 6.5], [10, 5]]
        mission.write(
            'visit', 20.0, place='R1', distance=3.0, path=way, driven=[[10, 8], [10.1, 5]]
        )
        back = [[10, 5], [10, 6]]
        mission.write('failure', 30.0, what='moving', reason='the door is closed', driven=back)
        mission.write('failure', 40.0, what='reasoning', reason='nobody answers')
        mission.write('end', 60.0)
    return path


@pytest.mark.parametrize(
    ('place', 'facts'),
    [
        ('seven_rooms', '7 places · 7 doors · shortest tour 52.4 m'),
        ('patrol_world', '7 places · 7 doors · 7 markers · shortest tour 81.0 m'),
        ('office', '46 places · 46 doors · shortest tour 720.9 m'),
    ],
)
def test_it_draws_a_place_and_says_what_it_is(
    place: str, facts: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / 'place.png'
    file = CONFIG / f'{place}.yaml'
    assert map_command.main([str(file), '-o', str(output)]) == 0
    assert capsys.readouterr().out.splitlines() == [f'{file}: {facts}', f'drawn: {output}']
    with Image.open(output) as picture:
        assert min(picture.size) > 400
        assert len(picture.getcolors(picture.size[0] * picture.size[1]) or ()) > 20


def test_it_says_which_rooms_cannot_be_visited_in_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = [str(CONFIG / 'seven_rooms.yaml'), '-o', str(tmp_path / 'place.png')]
    assert map_command.main([*place, '--threshold', '60']) == 0
    first, *rest = capsys.readouterr().out.splitlines()[1:-1]
    assert re.fullmatch(r'\d of 7 places can be visited within their thresholds.*', first)
    assert re.search(r'R1.*: visited every \d+ s .* later than its threshold of 60 s', rest[-1])
    assert map_command.main([*place, '--threshold', '400', '--charge-lasts', '40']) == 0
    told = capsys.readouterr().out
    assert re.search(r'never visited, out takes \d+ s and home \d+ s', told)
    assert map_command.main([*place, '--charge-lasts', '40']) == 2


def test_a_run_is_drawn_with_its_waits(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record.rename(tmp_path / 'events.jsonl')
    output = tmp_path / 'run.png'
    place = CONFIG / 'seven_rooms.yaml'
    assert map_command.main([str(place), '--record', str(tmp_path), '-o', str(output)]) == 0
    line = f'{tmp_path}: 1 min 0 s of patrol · 2 visits · 8 m driven · 0 recharges · 2 failures'
    assert line in capsys.readouterr().out
    plain = draw_place(read_simulated_place(place).plan, 'x', 'y')
    with Image.open(output) as picture:
        assert picture.size[0] > plain.size[0]


def test_the_names_of_places_end_before_their_bars(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = {'R1': 'Kitchen', 'R2': 'The_store_beside_the_stairs_of_the_first_floor'}
    texts = {path: path.read_text() for path in (CONFIG / 'seven_rooms.yaml', record)}
    for path, renamed in texts.items():
        for name, new_name in names.items():
            renamed = re.sub(rf'\b{name}\b', new_name, renamed)
        (tmp_path / f'new_{path.name}').write_text(renamed)
    ends, begins = [], []
    write, fill = Canvas.text, Canvas.box

    def text(
        self: Canvas, at: tuple[float, float], words: str, size: float, *rest: str, **named: str
    ) -> None:
        if words[:3] in ('Kit', 'The') and named.get('anchor') == 'lm':
            ends.append(at[0] + self.text_width(words, size))
        write(self, at, words, size, *rest, **named)

    def box(self: Canvas, left: float, top: float, *rest: Any) -> None:
        begins.append(left)
        fill(self, left, top, *rest)

    monkeypatch.setattr(Canvas, 'text', text)
    monkeypatch.setattr(Canvas, 'box', box)
    new = [str(tmp_path / f'new_{path.name}') for path in texts]
    assert map_command.main([new[0], '--record', new[1], '-o', str(tmp_path / 'run.png')]) == 0
    bars = max(set(begins), key=begins.count)
    assert len(ends) == 2
    assert max(ends) < bars


def test_ways_and_failures_come_from_the_record(record: Path) -> None:
    from surveillance_runtime import event_log

    place = seven_rooms().plan.place
    run = map_command.run_of(event_log.read(record), place, 'run')
    assert run.planned == [
        [(5.0, 10.0), (10.0, 8.0)],
        [(10.0, 8.0), (10.0, 6.5), (10.0, 5.0)],
    ]
    assert run.driven == [[(10.0, 8.0), (10.1, 5.0)], [(10.0, 5.0), (10.0, 6.0)]]
    assert run.failures == [(10.0, 6.0), (10.0, 5.0)]
    assert run.waits['R2'] == 60.0
    assert run.visits['R1'] == 1
    assert run.threshold is None
    with record.open('a') as file:
        fields = {'place': 'E', 'rule': 'URGENT', 'reason': '', 'urgency_threshold': 90}
        file.write(json.dumps({'event': 'decision', 'time': 70.0, **fields}) + '\n')
    assert map_command.run_of(event_log.read(record), place, 'run').threshold == 90.0


def test_a_room_that_was_added_during_the_run_keeps_nothing_from_being_drawn(
    record: Path, tmp_path: Path
) -> None:
    from surveillance_runtime import event_log

    place = seven_rooms().plan.place
    with MissionRecord(record) as mission:
        mission.write('map', 61.0, places=[*place.rooms, 'New'])
        way = [[5, 10], [4, 10], [3, 10]]
        mission.write('visit', 62.0, place='New', distance=2.0, path=way)
        mission.write('visit', 64.0, place='E', distance=2.0)
        mission.write('end', 70.0)
    run = map_command.run_of(event_log.read(record), place, 'run')
    assert run.visits['New'] == 1
    assert run.planned[-2:] == [[(5, 10), (4, 10), (3, 10)], [(3, 10), (5, 10)]]
    picture = tmp_path / 'run.png'
    arguments = [f'{CONFIG}/seven_rooms.yaml', '--record', str(record), '-o', str(picture)]
    assert map_command.main(arguments) == 0
    assert picture.exists()


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['{named}'], "named.yaml: map.Robot1: 'Robot1' is the robot's name"),
        ([], 'the following arguments are required: FILE'),
        (['nowhere.yaml'], 'nowhere.yaml: No such file'),
        (['{config}/seven_rooms.yaml', '-o', 'picture.txt'], 'picture.txt: expected a picture'),
        (['{config}/seven_rooms.yaml', '-o', '{tmp}/no/such.png'], 'such.png: there is no folder'),
        (['{config}/seven_rooms.yaml', '--record', '{tmp}/none'], 'none: No such file'),
        (['{config}/office.yaml', '--record', '{record}'], "visits 'R1', which the place does not"),
        (['{broken}'], "broken.yaml:1: expected the top-level key '/**', got nothing"),
        (['{marker}'], 'marker id 400: DICT_5X5_100 holds ids 0 to 99'),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    record: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    broken, marker = tmp_path / 'broken.yaml', tmp_path / 'marker.yaml'
    broken.write_text('{}\n')
    text = (CONFIG / 'patrol_world.yaml').read_text()
    marker.write_text(text.replace('m11: [11.0', 'm11: [400.0'))
    named = tmp_path / 'named.yaml'
    text = (CONFIG / 'seven_rooms.yaml').read_text()
    named.write_text(text.replace('R1:', 'Robot1:'))
    names = {
        'named': named,
        'config': CONFIG,
        'tmp': tmp_path,
        'record': record,
        'broken': broken,
        'marker': marker,
    }
    with pytest.raises(SystemExit) as ended:
        sys.exit(map_command.main([each.format(**names) for each in arguments]))
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.startswith('map: ')
    assert error.count('\n') == 1


def test_a_canvas_puts_metres_where_they_belong() -> None:
    canvas = Canvas((0.0, 0.0, 4.0, 2.0), 50.0, (10, 20, 30, 40), '#ffffff')
    assert canvas.size == (240, 160)
    assert canvas.at((0.0, 2.0)) == (10.0, 20.0)
    canvas.polygon([(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)], '#ff0000')
    picture = np.asarray(canvas.finished())
    assert tuple(picture[95, 85]) == (255, 0, 0)
    assert tuple(picture[60, 85]) == (255, 255, 255)


def test_colours_blend() -> None:
    assert blend('#000000', '#ffffff', 0.5) == '#808080'
    assert blend('#000000', '#ffffff', 7.0) == '#ffffff'


def test_what_a_run_refuses_is_refused_here_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'place.yaml'
    text = Path(__file__).resolve().parents[2].joinpath('config', 'seven_rooms.yaml').read_text()
    path.write_text(f'{text}\nrobot_behavior:\n  ros__parameters:\n    nothing_known: 1\n')
    assert map_command.main([str(path), '-o', str(tmp_path / 'place.png')]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f'{path}:' in line
    assert 'nothing_known' in line
