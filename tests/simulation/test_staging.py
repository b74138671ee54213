"""What can be staged in a simulated place: by lines, by a script, with the truth written down."""

from __future__ import annotations

import json
import math
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from floor_plans import PlaceError
from strict_files.files import FileError
from surveillance_simulation.camera.model import Camera, covered
from surveillance_simulation.camera.mujoco_rendering import MujocoRenderer
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.robot.robot import PHYSICS_STEP, Robot
from surveillance_simulation.staging import Happening, Stage, Times, check_script, read_script
from tests.places import camera_pose, two_rooms

CAMERA = Camera.from_field_of_view(160, 120)
EASTWARD = camera_pose(0.4, 1.0, 0.9, 0.0, -0.2)


def staged(*lines: str) -> Robot:
    robot = Robot(two_rooms())
    stage = Stage(robot)
    for line in lines:
        stage.do(line, 0.0)
    return robot


def distance_ahead(robot: Robot, yaw: float = 0.0) -> float:
    robot.base.pose = (1.0, 1.0, yaw)
    return float(robot.scan()[180])


@pytest.mark.parametrize(
    ('line', 'expected'),
    [
        ('barrel b 2.0 1.0 0.3', 0.7),
        ('box b 2.0 1.0 0.4 0.3', 0.8),
        ('box low 2.0 1.0 0.4 0.1', 4.95),
        ('door D closed', 1.95),
        ('person p 2.0 1.1 0', 0.79),
        ('chair c 2.0 1.19 0', 0.785),
    ],
)
def test_the_lidar_meets_what_is_staged(line: str, expected: float) -> None:
    assert distance_ahead(staged(line)) == pytest.approx(expected, abs=0.03)


def test_a_door_that_is_ajar_has_a_turned_leaf_and_lets_no_robot_through() -> None:
    robot = staged('door D ajar 30')
    (x, y), (tip_x, tip_y) = robot.world.leaf('D')  # type: ignore[misc]
    assert (x, y) == pytest.approx((3.0, 0.5), abs=1e-6)
    assert math.hypot(tip_x - 3.0, tip_y - 0.5) == pytest.approx(1.0, abs=1e-6)
    assert not robot.world.is_open('D')
    assert robot.world.wall_clearance((x + tip_x) / 2, (y + tip_y) / 2) < 0.01
    Stage(robot).do('door D open', 0.0)
    assert robot.world.is_open('D')
    assert robot.world.wall_clearance((x + tip_x) / 2, (y + tip_y) / 2) > 0.2


def renderers() -> list[type]:
    return [Renderer, MujocoRenderer]


@pytest.mark.parametrize('take', renderers())
@pytest.mark.parametrize(
    ('line', 'least'),
    [
        ('barrel b 1.8 1.0 0.2', 0.01),
        ('box b 1.8 1.0', 0.005),
        ('chair c 1.8 1.0', 0.01),
        ('person p 2.0 1.0', 0.03),
        ('door D closed', 0.03),
        ('door D ajar', 0.02),
        ('lamp all off', 0.9),
    ],
)
def test_both_renderers_show_what_is_staged(take: type, line: str, least: float) -> None:
    if take is MujocoRenderer:
        pytest.importorskip('mujoco')
    robot = Robot(two_rooms())
    renderer = take(robot.world, CAMERA)
    before = renderer.ideal(EASTWARD)
    Stage(robot).do(line, 0.0)
    renderer.refresh()
    after = renderer.ideal(EASTWARD)
    renderer.close()
    changed = (np.abs(after - before).max(axis=2) > 20).mean()
    assert changed > least


def test_a_lamp_lights_its_own_room() -> None:
    robot = staged('door D closed', 'lamp A off')
    renderer = Renderer(robot.world, CAMERA)
    dark = renderer.ideal(EASTWARD)
    bright = renderer.ideal(camera_pose(3.4, 1.0, 0.9, 0.0, -0.2))
    assert dark.mean() < 8.0
    assert bright.mean() > 100.0


def test_markers_are_taken_off_moved_and_doubled() -> None:
    robot = Robot(two_rooms())
    stage = Stage(robot)
    stage.do('marker m1 copy 5.94 1.0 1.0 180', 0.0)
    stage.do('marker m1 moved 0.06 1.5 1.0 0', 0.0)
    panels = {name: (each.marker.id, each.marker.x) for name, each in robot.world.panels.items()}
    assert panels == {'m1': (1, 0.06), 'm1 copy': (1, 5.94)}
    stage.do('marker m1 gone', 0.0)
    assert robot.world.panels['m1'].state == 'gone'


def test_a_covered_lens_shows_no_edge() -> None:
    scene = np.random.default_rng(0).uniform(0, 255, (8, 8, 3)).astype(np.float32)
    assert covered(scene).std() < 1e-3


def test_who_walks_goes_there_and_back_and_stops_before_the_robot() -> None:
    robot = staged('walk thief 3.5 1.0 5.5 1.0')
    seen = []
    for _ in range(100):
        robot.advance(0.1)
        (thief,) = robot.world.people
        seen.append(thief.x)
    assert max(seen) == pytest.approx(5.5, abs=0.1)
    assert seen[-1] == pytest.approx(5.5, abs=0.3)  # 10 m: there, back and there again
    assert min(seen[20:]) == pytest.approx(3.5, abs=0.1)
    robot.base.pose = (4.5, 1.0, 0.0)
    for _ in range(30):
        robot.advance(0.1)
    assert abs(robot.world.people[0].x - 4.5) >= 0.7


def test_a_way_may_pass_its_last_point_before_its_end() -> None:
    """Who was sent to and fro stood still for ever where the way ends."""
    robot = staged('walk p 3.5 1.0 4.5 1.0 4.5 1.5 4.5 1.0')
    robot.advance(0.25)
    seen = []
    for _ in range(8):
        (person,) = robot.world.people
        seen.append((round(person.x, 3), round(person.y, 3), round(math.degrees(person.yaw)) % 360))
        robot.advance(0.5)  # half a metre
    assert seen == [
        (3.75, 1.0, 0),
        (4.25, 1.0, 0),
        (4.5, 1.25, 90),
        (4.5, 1.25, 270),
        (4.5, 1.25, 90),  # back, as it came
        (4.5, 1.25, 270),
        (4.25, 1.0, 180),
        (3.75, 1.0, 180),
    ]


def test_a_weekday_is_the_next_one_of_that_name_and_again_a_week_later() -> None:
    times, monday = Times.parse('wed 21:30'), at(2, 8)
    assert times.first(monday) == at(4, 21, 30)
    assert times.after(at(4, 21, 30), monday) == at(11, 21, 30)
    assert times.before(at(4, 21, 29), monday) is None
    assert times.before(at(6, 0), monday) == at(4, 21, 30)
    daily = Times.parse('daily 21:30')
    assert daily.first(monday) == at(2, 21, 30)
    assert daily.after(at(2, 21, 30), monday) == at(3, 21, 30)
    assert daily.before(at(2, 21, 29), monday) is None
    third = Times.parse('day 3 21:30')
    assert third.first(monday) == at(4, 21, 30)
    assert third.after(at(4, 21, 30), monday) == math.inf
    assert third.before(at(9, 8), monday) == at(4, 21, 30)
    assert third.before(at(3, 8), monday) is None
    soon = Times.parse('90 s')
    assert (soon.first(monday), soon.before(monday + 89.0, monday)) == (monday + 90.0, None)
    assert soon.before(monday + 90.0, monday) == monday + 90.0
    assert soon.after(monday + 90.0, monday) == math.inf
    for text, seconds in (('0.5 h', 1800.0), ('2 min', 120.0), ('1 d', 86400.0)):
        assert Times.parse(text).first(monday) == monday + seconds
    for wrong in ('wed 24:00', 'wed 21:60', 'someday 21:30', ''):
        with pytest.raises(ValueError, match='expected such as'):
            Times.parse(wrong)
    assert Times.parse('sun 23:59').first(monday) == at(8, 23, 59)


def test_no_step_of_time_is_so_long_that_something_is_driven_through(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = Robot(two_rooms())
    steps: list[float] = []
    monkeypatch.setattr(robot.base, 'step', steps.append)
    for seconds, count in ((PHYSICS_STEP, 1), (0.3, round(0.3 / PHYSICS_STEP)), (0.001, 1)):
        steps.clear()
        robot.advance(seconds)
        assert (len(steps), sum(steps)) == (count, pytest.approx(seconds))
        assert max(steps) <= PHYSICS_STEP + 1e-9
    assert robot.time == pytest.approx(PHYSICS_STEP + 0.301)


@pytest.mark.parametrize(
    ('line', 'message'),
    [
        ('dor D open', "stage: got 'dor', expected 'door'"),
        ('door D1 open', "there is no door 'D1': expected 'D'"),
        ('door D wide', "door D: got 'wide', expected door NAME open|closed|ajar"),
        ('door D ajar 200', "door 'D': angle 200: expected 0 to 120 degrees"),
        ('box b 1.0 nan', "stage: got 'nan' for a number, expected box NAME X Y"),
        ('box b 100 1.0', 'box b: expected a point in the place'),
        ('box b', 'stage: got 1 words, expected box NAME X Y'),
        ('remove b', "there is no obstacle 'b', nor any other"),
        ('walk p 1.0 0.5 5.0 0.1', "person 'p': a wall or a leaf is in the way at"),
        ('marker m2 moved 1 1 1 0', "there is no marker 'm2': expected 'm1'"),
        ('lamp C on', "there is no place 'C': expected one of A, B"),
        ('lens dirty', "lens: got 'dirty', expected clear or covered"),
    ],
)
def test_a_wrong_line_does_nothing_and_says_why(line: str, message: str) -> None:
    robot = Robot(two_rooms())
    before = robot.world.version
    with pytest.raises(PlaceError) as caught:
        Stage(robot).do(line, 0.0)
    assert message in str(caught.value)
    assert robot.world.version == before


SCRIPT = """
stage:
  the cleaner forgets the door:
    at: daily 21:30
    do: door D ajar 40
    for: 45 min
    then: door D closed
  a parcel comes:
    at: day 3 10:00
    do: [box parcel 1.5 0.5, lamp B off]
  early: {at: 90 s, do: lens covered}
"""


def at(day: int, hour: int, minute: int = 0) -> float:
    return datetime(2026, 3, day, hour, minute).timestamp()


def test_a_script_is_carried_out_at_its_times_and_the_truth_is_told(tmp_path: Path) -> None:
    (tmp_path / 'stage.yaml').write_text(SCRIPT)
    script = read_script(tmp_path / 'stage.yaml')
    robot, truth = Robot(two_rooms()), []
    assert check_script(Robot(two_rooms()), script) == ''
    stage = Stage(robot, truth.append, script, at(2, 8))
    stage.advance(at(2, 21, 31))
    assert robot.world.door_angle('D') == 40.0
    stage.advance(at(2, 23))
    assert robot.world.door_angle('D') == 0.0
    for hour in range(24 * 6):
        stage.advance(at(3, 0) + 3600.0 * hour)
    told = [json.loads(line) for line in truth]
    when = [(each['at'], each['kind'], each['state']) for each in told]
    assert (at(2, 8) + 90.0, 'view', 'covered') in when
    assert (at(4, 10), 'box', 'appeared') in when
    assert sum(state == 'ajar' for _, _, state in when) == 7
    assert [each['position'] for each in told if each['kind'] == 'box'] == [[1.5, 0.5]]


def test_what_was_staged_outlives_the_process(tmp_path: Path) -> None:
    (tmp_path / 'stage.yaml').write_text(SCRIPT)
    script = read_script(tmp_path / 'stage.yaml')
    first = Stage(Robot(two_rooms()), script=script, start=at(2, 8))
    first.advance(at(2, 21, 31))
    first.do('walk thief 0.5 1.0 2.0 1.0', at(2, 21, 32))
    robot, truth = Robot(two_rooms()), []
    later = Stage(robot, truth.append, script, at(2, 22))
    later.restore(first.state(), at(2, 22))
    assert robot.world.door_angle('D') == 40.0
    assert robot.lens_covered
    assert len(robot.walks) == 1
    later.advance(at(2, 22, 20))  # it ends as the script has it
    assert robot.world.door_angle('D') == 0.0


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('stages: {}', "1: stages: unknown key, expected 'stage'"),
        ('stage:\n  a: {at: noon, do: lens clear}', "2: stage.a: at: got 'noon', expected such as"),
        ('stage:\n  a: {at: 5 s, do: lense clear}', "stage.a: do: got 'lense', expected 'lens'"),
        ('stage:\n  a: {at: 5 s, for: 3 s, do: lens clear}', "expected 'for' and 'then' together"),
        ('stage:\n  a: {at: 5 s}', "stage.a: expected 'do'"),
        ('stage:\n  a: {at: 5 s, do: lens clear, til: 3}', 'stage.a.til: unknown key, expected'),
    ],
)
def test_a_mistake_in_a_script_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / 'stage.yaml').write_text(text)
    with pytest.raises(FileError) as caught:
        read_script(tmp_path / 'stage.yaml')
    assert message in str(caught.value)


def test_a_script_for_another_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'stage.yaml').write_text('stage:\n  a: {at: 5 s, do: door D9 closed}')
    problem = check_script(Robot(two_rooms()), read_script(tmp_path / 'stage.yaml'))
    assert problem == "stage.a: door D9 closed: there is no door 'D9': expected 'D'"


@pytest.mark.parametrize(
    ('line', 'told'),
    [
        (
            'door D ajar',
            ('door', 'D', 'ajar', [3.0, 1.0], 'door D is ajar by 30 degrees'),
        ),
        ('door D ajar 12.5', ('door', 'D', 'ajar', [3.0, 1.0], 'door D is ajar by 12.5 degrees')),
        ('door D closed', ('door', 'D', 'closed', [3.0, 1.0], 'door D is closed')),
        ('door D open', ('door', 'D', 'open', [3.0, 1.0], 'door D is open')),
        (
            'barrel b 4.1239 0.5',
            ('barrel', 'b', 'appeared', [4.124, 0.5], 'barrel b stands at (4.12, 0.50)'),
        ),
        ('box b 4 0.5', ('box', 'b', 'appeared', [4.0, 0.5], 'box b stands at (4.00, 0.50)')),
        ('chair c 4 0.5', ('chair', 'c', 'appeared', [4.0, 0.5], 'chair c stands at (4.00, 0.50)')),
        (
            'person p 4 0.5 90',
            ('person', 'p', 'appeared', [4.0, 0.5], 'person p stands at (4.00, 0.50)'),
        ),
        (
            'walk p 4 0.5 5 0.5 5 1.5',
            ('person', 'p', 'walks', [4.0, 0.5], 'person p walks about'),
        ),
        ('remove there', ('barrel', 'there', 'removed', [1.0, 0.5], 'barrel there is gone')),
        (
            'barrel there 1.2 0.6 0.1',
            ('barrel', 'there', 'moved', [1.2, 0.6], 'barrel there stands at (1.20, 0.60)'),
        ),
        ('marker m1 gone', ('marker', '1', 'gone', [0.06, 1.0], 'marker m1 is gone')),
        ('marker m1 broken', ('marker', '1', 'broken', [0.06, 1.0], 'marker m1 is broken')),
        (
            'marker m1 moved 5.94 1.5 1.1 180',
            ('marker', '1', 'moved', [5.94, 1.5], 'marker m1 hangs at (5.94, 1.50)'),
        ),
        (
            'marker m1 copy 5.94 1.5 1.1 180',
            ('marker', '1', 'double', [5.94, 1.5], 'marker m1 hangs a second time at (5.94, 1.50)'),
        ),
        ('lamp A off', ('light', 'A', 'off', None, 'the lamp of A is off')),
        ('lamp all on', ('light', 'all', 'on', None, 'the lamp of all is on')),
        ('lamp B 0.25', ('light', 'B', '0.25', None, 'the lamp of B is 0.25')),
        ('lens covered', ('view', 'lens', 'covered', None, 'the lens is covered')),
        ('lens clear', ('view', 'lens', 'clear', None, 'the lens is clear')),
    ],
)
def test_the_truth_says_of_each_line_what_was_done(line: str, told: tuple) -> None:
    robot, truth = Robot(two_rooms()), list[str]()
    robot.world.place_obstacle('there', 1.0, 0.5, 0.2)
    kind, subject, state, where, text = told
    assert Stage(robot, truth.append).do(line, 12.34567) == text
    (written,) = map(json.loads, truth)
    assert written.pop('position', None) == where
    assert written == {
        'at': 12.346,
        'line': line,
        'kind': kind,
        'subject': subject,
        'state': state,
        'text': text,
    }


def test_what_is_staged_has_the_size_and_the_place_that_the_line_says() -> None:
    world = staged(
        'barrel b 4 0.5',
        'barrel thick 4.5 0.5 0.35',
        'box c 1 0.5',
        'box flat 1.5 0.5 0.6',
        'box high 2 0.5 0.4 1.1',
        'chair d 5 1.5 90',
        'person p 5 0.5 -90',
        'person q 5 0.5',
        'chair e 4 1.5',
        'lamp A 0.25',
        'lamp B off',
    ).world
    sizes = {
        name: (part.length, part.width, part.top)
        for name, thing in world.things.items()
        for part in thing.parts[:1]
        if thing.kind in ('barrel', 'box')
    }
    assert sizes == {
        'b': (0.4, 0.4, 0.8),
        'thick': (0.7, 0.7, 0.8),
        'c': (0.3, 0.3, 0.3),
        'flat': (0.6, 0.6, 0.3),
        'high': (0.4, 0.4, 1.1),
    }
    yaws = {name: math.degrees(each.yaw) for name, each in world.things.items()}
    assert yaws == {name: {'d': 90.0, 'p': -90.0}.get(name, 0.0) for name in yaws}
    assert world.lamps == {'A': 0.25, 'B': 0.0}
    stage = Stage(Robot(world))
    stage.do('lamp all on', 0.0)
    assert world.lamps == {}
    stage.do('lamp all 0.5', 0.0)
    assert world.lamps == {'A': 0.5, 'B': 0.5}
    stage.do('marker m1 copy 5.94 1.5 1.1 90', 0.0)
    copied = world.panels['m1 copy'].marker
    assert (copied.x, copied.y, copied.z, copied.yaw) == (5.94, 1.5, 1.1, math.pi / 2)
    assert copied.size == world.panels['m1'].marker.size


@pytest.mark.parametrize(
    ('line', 'words'),
    [
        ('', "stage: got '', expected "),
        ('door D', 'stage: got 1 words, expected door NAME open|closed|ajar [DEGREES]'),
        ('door D open 30', "door D: got 'open 30', expected door NAME"),
        ('door D ajar 30 40', "door D: got 'ajar 30 40', expected door NAME"),
        ('barrel b 1 1 0.2 0.3', 'stage: got 5 words, expected barrel NAME X Y [RADIUS]'),
        ('box b 1 1 0.2 0.3 0.4', 'stage: got 6 words, expected box NAME X Y [SIDE [HEIGHT]]'),
        ('box b 1', 'stage: got 2 words, expected box NAME'),
        ('box b 10001 1', "got '10001' for a number, expected box NAME"),
        ('box b -1e5 1', "got '-1e5' for a number, expected box NAME"),
        ('box b 10000 1', 'box b: expected a point in the place'),
        ('walk p 1 1 2', 'stage: got 4 words, expected walk NAME X Y X Y'),
        ('walk p 1 1 2 1 3', 'walk p: got 5 numbers, expected walk NAME X Y X Y'),
        ('remove a b', 'stage: got 2 words, expected remove NAME'),
        ('marker m1', 'stage: got 1 words, expected marker NAME'),
        ('marker m1 whole 3', 'stage: got 3 words, expected marker NAME'),
        ('marker m1 moved 1 1 1', 'stage: got 3 words, expected marker NAME'),
        ('marker m1 moved 1 1 1 0 0', 'stage: got 5 words, expected marker NAME'),
        ('lamp A', 'stage: got 1 words, expected lamp PLACE|all on|off|BRIGHTNESS'),
        ('lamp A dim', "got 'dim' for a number, expected lamp PLACE"),
        ('lamp A 2.01', "lamp of 'A': 2.01: expected 0 to 2, 1 is day"),
        ('lens', 'stage: got 0 words, expected lens clear|covered'),
    ],
)
def test_a_line_with_a_word_too_many_or_too_few_says_how_it_is_written(
    line: str, words: str
) -> None:
    robot, truth = Robot(two_rooms()), list[str]()
    stage = Stage(robot, truth.append)
    with pytest.raises(PlaceError) as caught:
        stage.do(line, 0.0)
    assert words in str(caught.value)
    assert truth == []
    assert json.loads(stage.state())['lines'] == []


def test_of_each_subject_the_last_line_is_kept_until_it_is_taken_away() -> None:
    robot = Robot(two_rooms())
    stage = Stage(robot)

    def kept(*lines: str) -> list[str]:
        for line in lines:
            stage.do(line, 0.0)
        return json.loads(stage.state())['lines']

    assert kept('door D closed', 'barrel b 4 0.5', 'door D ajar') == [
        'barrel b 4 0.5',
        'door D ajar',
    ]
    assert kept('box b 4 0.7') == ['door D ajar', 'box b 4 0.7'], 'a thing of this name'
    assert kept('remove b', 'lamp A off', 'lamp B off') == [
        'door D ajar',
        'lamp A off',
        'lamp B off',
    ]
    assert kept('lamp all 0.5', 'lamp B on') == ['door D ajar', 'lamp all 0.5', 'lamp B on']
    assert kept('lens covered', 'lens clear', 'lamp all on') == [
        'door D ajar',
        'lens clear',
        'lamp all on',
    ]
    hung = ['marker m1 copy 5.94 1.5 1 180', 'marker m1 moved 0.06 1.5 1 0']
    assert kept(*hung, hung[0])[-2:] == [hung[1], hung[0]]
    stage.do('walk p 4 0.5 5 0.5', 0.0)
    assert len(robot.walks) == 1
    stage.forget('thing', 'p')
    stage.forget('door', 'D')
    stage.forget('door', 'D')
    assert len(robot.walks) == 0
    assert kept() == ['lens clear', 'lamp all on', hung[1], hung[0]]
    stage.do('walk p 4 0.5 5 0.5', 0.0)
    stage.do('person p 4 0.5', 0.0)
    assert len(robot.walks) == 0, 'who stands walks no more'
    stage.do('walk p 4 0.5 5 0.5', 0.0)
    stage.do('remove p', 0.0)
    assert len(robot.walks) == 0


@pytest.mark.parametrize('kept', ['{}', '[]', '{"start": 1.0}', '{"start": "x", "lines": []}'])
def test_a_stage_that_was_kept_otherwise_is_refused(kept: str) -> None:
    with pytest.raises((ValueError, KeyError, TypeError)):
        Stage(Robot(two_rooms())).restore(kept, 0.0)
    with pytest.raises(ValueError, match='expected when it began'):
        Stage(Robot(two_rooms())).restore('{"start": Infinity, "lines": []}', 0.0)
    stage = Stage(Robot(two_rooms()))
    stage.restore('{"start": 5.0, "lines": ["door D9 closed", "door D closed"]}', 9.0)
    assert stage.start == 5.0
    assert json.loads(stage.state())['lines'] == ['door D closed'], 'the other one is elsewhere'


def test_what_a_script_cannot_do_is_said_and_the_rest_goes_on() -> None:
    robot, truth = Robot(two_rooms()), list[str]()
    script = [
        Happening('first', Times(10.0), ('remove b', 'door D closed'), 5.0, ('door D open',)),
        Happening('second', Times(12.0), ('lens covered',)),
    ]
    stage = Stage(robot, truth.append, script, 100.0)
    assert stage.advance(109.999) == []
    assert stage.advance(110.0) == [
        "stage: remove b: there is no obstacle 'b', nor any other",
        'door D is closed',
    ]
    assert stage.advance(114.9) == ['the lens is covered']
    assert stage.advance(115.0) == ['door D is open']
    assert stage.advance(1e6) == []
    told = [json.loads(each) for each in truth]
    assert [each['at'] for each in told] == [110.0, 110.0, 112.0, 115.0]
    assert told[0] == {
        'at': 110.0,
        'line': 'remove b',
        'refused': "there is no obstacle 'b', nor any other",
    }
    # Restored while it lasts, it ends in time; restored later, it is over.
    for now, lines in ((113.0, ['door D is open']), (115.0, []), (200.0, [])):
        later = Stage(Robot(two_rooms()), script=script, start=now)
        later.restore(json.dumps({'start': 100.0, 'lines': []}), now)
        assert later.advance(1e6) == lines


EVERY = ['daily 00:00', 'daily 09:07', 'mon 00:30', 'sun 23:59', 'day 1 10:00', 'day 3 00:00']
EVERY += ['day 12 18:45', '0 s', '95 min', '2.5 d', 'fri 12:00']


@pytest.mark.parametrize('text', EVERY)
@pytest.mark.parametrize('start', [datetime(2026, 3, 2, 9, 7), datetime(2026, 3, 6, 23, 59, 30)])
def test_times_are_those_that_a_calendar_has(text: str, start: datetime) -> None:
    """Beside a list of all minutes of four weeks that the words hold of."""
    times, begun = Times.parse(text), start.timestamp()
    words = text.split()
    if words[1] in ('s', 'min', 'd'):
        span = float(words[0]) * {'s': 1, 'min': 60, 'd': 86400}[words[1]]
        moments = [begun + span]
    else:
        first = start.replace(hour=0, minute=0, second=0)
        days = [first + timedelta(days=each) for each in range(-8, 29)]
        hour, minute = map(int, words[-1].split(':'))
        moments = [
            day.replace(hour=hour, minute=minute).timestamp()
            for number, day in enumerate(days, start=-7)
            if (
                words[0] == 'daily'
                or (words[0] == 'day' and number == int(words[1]))
                or words[0] == day.strftime('%a').lower()
            )
        ]
    assert times.first(begun) == min((at for at in moments if at >= begun), default=math.inf)
    rng = np.random.default_rng(1)
    stamps = [begun + each for each in rng.uniform(0.0, 15 * 86400.0, 40).tolist()]
    stamps += [at + each for at in moments[7:16] for each in (-0.5, 0.0, 0.5) if at + each >= begun]
    for stamp in stamps:
        expected = min((at for at in moments if at > stamp), default=math.inf)
        assert times.after(stamp, begun) == expected
        past = [at for at in moments if begun <= at <= stamp]
        assert times.before(stamp, begun) == max(past, default=None)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('a: {at: 5 s, do: 3}', 'do: expected a line or a list of lines'),
        ('a: {at: 5 s, do: [lens clear, 3]}', 'do: expected a line or a list of lines'),
        ("a: {at: 5 s, do: ''}", "do: got '', expected "),
        ('a: {at: 5 s, do: lens clear, then: lens covered}', "'for' and 'then' together"),
        (
            'a: {at: 5 s, do: lens clear, for: soon, then: lens covered}',
            "for: got 'soon', expected",
        ),
        ('a: {at: 5 s, do: lens clear, for: 3 s, then: dark}', "then: got 'dark', expected"),
        ('a: {do: lens clear}', "expected 'at'"),
    ],
)
def test_each_key_of_a_script_is_checked(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / 'stage.yaml').write_text(f'stage:\n  {text}\n')
    with pytest.raises(FileError) as caught:
        read_script(tmp_path / 'stage.yaml')
    assert words in str(caught.value)
    (tmp_path / 'stage.yaml').write_text(
        'stage: {a: {at: 5 s, do: lens clear, for: 1.5 min, then: [lens covered, door D open]}}'
    )
    assert read_script(tmp_path / 'stage.yaml') == [
        Happening('a', Times(5.0), ('lens clear',), 90.0, ('lens covered', 'door D open'))
    ]
    (tmp_path / 'stage.yaml').write_text('stage: {a: {at: 5 s, do: [lens clear]}}')
    assert read_script(tmp_path / 'stage.yaml') == [Happening('a', Times(5.0), ('lens clear',))]


def test_a_script_is_tried_as_it_will_be_carried_out() -> None:
    def problem(*lines: str, then: tuple[str, ...] = ()) -> str:
        return check_script(Robot(two_rooms()), [Happening('a', Times(1.0), lines, 1.0, then)])

    assert problem('remove what another entry puts there', 'lens covered') == ''
    assert problem('door D closed', 'walk p 1.0 1.0 5.0 1.0') == '', 'the door may be open then'
    assert problem('lens covered', then=('lamp C on',)) == (
        "stage.a: lamp C on: there is no place 'C': expected one of A, B"
    )
