"""What can be staged in a simulated place: by lines, by a script, with the truth written down."""

from __future__ import annotations

import json
import math
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from surveillance_runtime.files import FileError
from surveillance_runtime.place import PlaceError
from surveillance_simulation.camera.model import Camera, covered
from surveillance_simulation.camera.mujoco_rendering import MujocoRenderer
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.robot.robot import PHYSICS_STEP, Robot
from surveillance_simulation.staging import Stage, Times, check_script, read_script

from .places import camera_pose, two_rooms

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
