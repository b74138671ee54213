"""Pictures: what is where, what hides what, and that markers can be read."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest

from floor_plans import Marker, PlaceError
from marker_detection import CameraModel, FusedPositions, MarkerDetector, pose_of
from surveillance_simulation.camera.model import LIGHTINGS, Camera, Conditions, expose, lit
from surveillance_simulation.camera.mujoco_rendering import MujocoRenderer
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.camera.scene import thing_faces
from surveillance_simulation.world import textures
from surveillance_simulation.world.simulated_place import SimulatedPlace, read_simulated_place
from surveillance_simulation.world.things import barrel, box
from tests.places import CONFIG, camera_pose, changed, two_rooms

CLEAN = Conditions(noise=0.0, blur=0.0)
CAMERA = Camera.from_field_of_view(640, 480, math.radians(60))
LENS = CameraModel.from_field_of_view(640, 480, math.radians(60))


def ids_in(picture: np.ndarray) -> set[int]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    found = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)[1]
    return set() if found is None else {int(each) for each in np.ravel(found)}


def look(world: SimulatedPlace, *pose: float, conditions: Conditions = CLEAN) -> np.ndarray:
    ideal = Renderer(world, CAMERA).ideal(camera_pose(*pose))
    return expose(ideal, conditions, np.random.default_rng(0))


def facing_west(distance: float = 1.5) -> tuple[SimulatedPlace, tuple[float, ...]]:
    """Return the two rooms with marker 7 on the western wall, and a camera in front of it."""
    world = two_rooms()
    world.hang_marker(Marker('m1', 7, 0.06, 1.0, 1.0, 0.0, 0.2))
    return world, (0.06 + distance, 1.0, 1.0, math.pi)


def test_every_marker_of_the_patrol_world_can_be_read_from_the_start() -> None:
    world = read_simulated_place(CONFIG / 'patrol_world.yaml')
    renderer = Renderer(world, CAMERA)
    x, y, _ = world.plan.start
    seen = set()
    for yaw in np.arange(0, 2 * math.pi, math.radians(40)):
        pose = camera_pose(x, y, 0.8, float(yaw))
        seen |= ids_in(expose(renderer.ideal(pose), Conditions(), np.random.default_rng(1)))
    assert seen == {marker.id for marker in world.plan.markers.values()}


def test_corners_appear_where_the_pinhole_projects_them() -> None:
    world, pose = facing_west()
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    corners = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(look(world, *pose))[0]
    half = 0.1 * CAMERA.focal / 1.5
    centre = np.array([(CAMERA.width - 1) / 2, (CAMERA.height - 1) / 2])
    expected = centre + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    assert np.asarray(corners[0]).reshape(4, 2) == pytest.approx(expected, abs=0.3)


def test_a_camera_that_rolls_turns_the_picture() -> None:
    world, pose = facing_west()
    upright, rolled = look(world, *pose), look(world, *pose, 0.0, math.pi / 2)
    side = 200
    middle = slice(320 - side // 2, 320 + side // 2)
    rows = slice(240 - side // 2, 240 + side // 2)
    turned = np.rot90(upright[rows, middle])
    difference = cv2.absdiff(np.ascontiguousarray(turned), rolled[rows, middle])
    assert float(difference.mean()) < 3.0


@pytest.mark.parametrize('state', ['broken', 'covered'])
def test_a_spoilt_marker_cannot_be_read_until_it_is_mended(state: str) -> None:
    world, pose = facing_west()
    assert ids_in(look(world, *pose)) == {7}
    world.set_marker('m1', state)
    assert ids_in(look(world, *pose)) == set()
    world.set_marker('m1', 'whole')
    assert ids_in(look(world, *pose)) == {7}


def test_what_stands_in_front_hides_what_is_behind() -> None:
    world, pose = facing_west()
    world.place_obstacle('barrel', 0.7, 1.0, 0.25)
    assert ids_in(look(world, *pose[:2], 0.5, math.pi, 0.3)) == set()
    world.remove_obstacle('barrel')
    assert ids_in(look(world, *pose[:2], 0.5, math.pi, 0.3)) == {7}


def test_a_closed_door_hides_the_next_room() -> None:
    world = two_rooms()
    world.hang_marker(Marker('m1', 7, 5.94, 1.0, 1.0, math.pi, 0.2))
    assert ids_in(look(world, 2.0, 1.0, 1.0, 0.0)) == {7}
    world.set_door('D', False)
    assert ids_in(look(world, 2.0, 1.0, 1.0, 0.0)) == set()


def test_a_marker_is_not_seen_from_behind() -> None:
    world = two_rooms()
    world.hang_marker(Marker('m1', 7, 1.5, 1.0, 1.0, 0.0, 0.2))
    assert ids_in(look(world, 2.5, 1.0, 1.0, math.pi)) == {7}
    assert ids_in(look(world, 0.5, 1.0, 1.0, 0.0)) == set()


def test_a_kept_renderer_shows_changes_after_refresh() -> None:
    world, pose = facing_west()
    renderer = Renderer(world, CAMERA)
    rng = np.random.default_rng(0)
    world.set_marker('m1', 'covered')
    assert ids_in(expose(renderer.ideal(camera_pose(*pose)), CLEAN, rng)) == {7}
    renderer.refresh()
    assert ids_in(expose(renderer.ideal(camera_pose(*pose)), CLEAN, rng)) == set()


def test_a_camera_inside_a_wall_still_gives_a_picture() -> None:
    assert look(two_rooms(), 3.0, 0.2, 1.0, 0.5).shape == (480, 640, 3)


def test_light_noise_blur_and_motion_do_what_they_say() -> None:
    scene = np.full((64, 64, 3), 100.0, np.float32)
    scene[:, 32:] = 200.0
    rng = np.random.default_rng(0)
    dark = expose(scene, Conditions(light=0.5, noise=0.0, blur=0.0), rng)
    assert dark[0, 0, 0] == 50
    noisy = expose(scene, Conditions(noise=5.0, blur=0.0), rng)
    assert 4.5 < float(noisy[:, :32].astype(float).std()) < 5.5
    edge = slice(24, 40)
    for conditions in (
        Conditions(noise=0.0, blur=2.0),
        Conditions(noise=0.0, blur=0.0, motion=9.0),
    ):
        levels = expose(scene, conditions, rng)[32, edge, 0].astype(int)
        assert (np.diff(levels) >= 0).all()
        assert len(set(levels)) > 4
    across = Conditions(noise=0.0, blur=0.0, motion=9.0, motion_angle=math.pi / 2)
    assert set(expose(scene, across, rng)[32, edge, 0]) == {100, 200}


def test_the_same_seed_takes_the_same_picture() -> None:
    world, pose = facing_west()
    first = look(world, *pose, conditions=Conditions())
    assert (first == look(world, *pose, conditions=Conditions())).all()


@pytest.mark.parametrize(
    ('dictionary', 'marker_id', 'message'),
    [
        ('DICT_5X5_100', 100, 'marker id 100: DICT_5X5_100 holds ids 0 to 99'),
        ('DICT_9X9', 1, "marker dictionary 'DICT_9X9': expected one of OpenCV's"),
        ('detectMarkers', 1, "marker dictionary 'detectMarkers': expected one of OpenCV's"),
    ],
)
def test_a_marker_that_does_not_exist_is_refused(
    dictionary: str, marker_id: int, message: str
) -> None:
    with pytest.raises(PlaceError) as caught:
        textures.marker_panel(dictionary, marker_id, 'whole')
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ((0, 480, 1.0), 'a picture of 0x480'),
        ((640, 0, 1.0), 'a picture of 640x0'),
        ((640, -1, 1.0), 'a picture of 640x-1'),
        ((640, 480, 4.0), 'field of view 4 rad'),
        ((640, 480, 0.0), 'field of view 0 rad'),
    ],
)
def test_a_camera_that_cannot_be_is_refused(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Camera.from_field_of_view(*arguments)
    assert Camera.from_field_of_view(1, 1, math.pi / 2).focal == pytest.approx(0.5)


@pytest.mark.parametrize('yaw', [0.0, 0.7])
def test_lids_lie_flat_on_what_they_close_and_faces_stand_upright(yaw: float) -> None:
    """Seen from above a box ends at its sides, and what is round does not reach beyond."""
    for thing, reach in (
        (box('b', 1.0, 2.0, yaw, 0.6, 0.4, 0.3), math.hypot(0.3, 0.2)),
        (barrel('b', 1.0, 2.0, 0.3), 0.3),
    ):
        top = thing.parts[0].top
        lids = sides = 0
        for face in thing_faces(thing):
            corners = np.array(
                [
                    face.corner + a * face.across + d * face.down
                    for a in (0.0, 1.0)
                    for d in (0.0, 1.0)
                ]
            )
            heights = np.unique(np.round(corners[:, 2], 9))
            away = np.hypot(corners[:, 0] - 1.0, corners[:, 1] - 2.0)
            if len(heights) == 1:
                lids += 1
                assert heights[0] in (0.0, top)
                assert np.allclose(corners[:, :2].mean(axis=0), (1.0, 2.0))
                assert away == pytest.approx([reach] * 4, rel=0.01)
            else:
                sides += 1
                assert heights == pytest.approx([0.0, top])
                assert np.all(away <= reach * 1.1)
        assert lids == 2
        assert sides >= 4


def test_lighting_changes_the_brightness_as_its_name_says() -> None:
    scene = np.full((240, 320, 3), 150.0, np.float32)
    rng = np.random.default_rng(0)
    assert (lit(scene, 'even', rng) == scene).all()
    for name in ('hard shadow', 'soft shadow', 'vignette'):
        darker = lit(scene, name, rng)
        assert darker.max() <= 150.0
        assert darker.min() < 75.0
    assert lit(scene, 'glare', rng).max() > 350.0
    hard, soft = (lit(scene, name, rng) for name in ('hard shadow', 'soft shadow'))
    assert np.abs(np.diff(hard, axis=1)).max() > 2 * np.abs(np.diff(soft, axis=1)).max()


@pytest.mark.parametrize('lighting', LIGHTINGS)
def test_pictures_under_every_lighting_go_through_the_exposure(lighting: str) -> None:
    world, pose = facing_west()
    taken = look(world, *pose, conditions=Conditions(lighting=lighting))
    assert taken.shape == (480, 640, 3)
    assert taken.std() > 5.0


def test_dark_walls_leave_the_panels_white() -> None:
    world, pose = facing_west()
    light = look(world, *pose)
    world.wall_brightness, world.drawn_version = 0.2, world.drawn_version + 1
    dark = look(world, *pose)
    assert np.median(dark) < 0.6 * np.median(light)
    assert np.percentile(dark, 99) > 0.9 * np.percentile(light, 99)


def test_two_panels_with_one_id_can_be_staged_and_are_found_as_such() -> None:
    world = SimulatedPlace.from_parameters(
        changed(markers={'m1': [7, 0.06, 0.5, 1.0, 0.0], 'm2': [7, 0.06, 1.5, 1.0, 0.0]})
    )
    renderer, fused = Renderer(world, CAMERA), FusedPositions()
    detector = MarkerDetector()
    for y in (0.9, 1.0, 1.1):
        pose = camera_pose(1.6, y, 1.0, math.pi)
        picture = expose(renderer.ideal(pose), CLEAN, np.random.default_rng(0))
        fused.next_image()
        for found in detector.detect(picture):
            seen = pose_of(found.corners, 0.2, LENS)
            assert seen is not None
            covariance = seen.covariance[:3, :3]
            fused.add(found.marker_id, pose, seen.position, covariance, seen.ambiguity)
    both = fused.two_places(7)
    assert both is not None
    places = sorted((each.position for each in both), key=lambda place: float(place[1]))
    assert np.allclose(places, [[0.06, 0.5, 1.0], [0.06, 1.5, 1.0]], atol=0.05)


@pytest.mark.parametrize('renderer', [Renderer, MujocoRenderer])
def test_a_robots_camera_shows_the_other_robots_and_not_itself(renderer: Any) -> None:
    if renderer is MujocoRenderer:
        pytest.importorskip('mujoco')
    world = two_rooms()
    x, y, _ = world.plan.start
    pose = camera_pose(x, y, 0.6, 0.0)

    def pictures() -> dict[str, np.ndarray]:
        found = {}
        for robot in ('robot1', 'robot2'):
            camera = renderer(world, CAMERA, robot)
            found[robot] = expose(camera.ideal(pose), CLEAN, np.random.default_rng(0))
            camera.close()
        return found

    before = pictures()
    world.move_robot('robot2', x + 1.2, y, 0.25)
    after = pictures()
    changed_part = (np.abs(after['robot1'].astype(int) - before['robot1']).max(axis=2) > 20).mean()
    assert 0.02 < changed_part < 0.4
    # Its own body is where its camera is.
    assert np.array_equal(after['robot2'], before['robot2'])
    world.move_robot('robot2', x - 1.2, y, 0.25)
    assert np.array_equal(pictures()['robot1'], before['robot1'])
