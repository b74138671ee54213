"""Markers where they hang on the map: there, moved, gone, twice; else nothing is said."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from indoor_watch.hung_markers import AGREED, MOST, HungMarkers, SeenMarker

from .marked_walls import METRE, aside, bare, camera, hang, seen_at, wall

LEFT, TOP = 140, 100
HIDDEN = ((0, 320), (100, 200), (LEFT - 4, LEFT + 20), (0, LEFT + 12), (150, 320))
"""From which column to which one something stands before the wall."""


def told(markers: HungMarkers, picture, seen, look: int = 2, view=None, clear=True) -> list[str]:
    """Return what is settled after as many equal pictures as are needed."""
    found = []
    for _ in range(AGREED):
        view = view or camera()
        found = markers.take(picture, view, seen, look, lambda _: clear)
    return [each.state for each in found]


def learned(background) -> tuple[HungMarkers, np.ndarray, SeenMarker]:
    """Return what was seen of a wall with marker 14 on it."""
    markers, picture = HungMarkers(), background()
    seen = hang(picture, 14, LEFT, TOP)
    told(markers, picture, [seen], 1)
    return markers, picture, seen


@pytest.fixture(params=[wall, bare])
def hung(request) -> tuple[HungMarkers, np.ndarray, SeenMarker, np.ndarray]:
    """Return marker 14 on a wall, and the wall."""
    return (*learned(request.param), request.param())


def test_a_marker_is_where_the_camera_and_its_size_say(hung):
    markers, picture, seen, _ = hung
    assert told(markers, picture, [seen]) == ['here']
    x, y, z = markers.position_of(14)
    assert (x, y, z) == pytest.approx((2.0, -(LEFT + 11.5 - 159.5) / METRE, 1.05), abs=1e-2)
    # Half a metre to the left all lies to the right, and the marker where it was.
    shown = aside(picture, 80)
    moved = seen_at(14, LEFT + 80, TOP)
    assert told(markers, shown, [moved], view=camera(y=80 / METRE)) == ['here']


@pytest.mark.parametrize('light', [1.0, 0.7])
def test_a_marker_is_missing_where_its_spot_shows_the_wall(hung, light):
    markers, _, _, empty = hung
    found = []
    for _ in range(AGREED):
        found = markers.take(np.asarray(empty * light, np.uint8), camera(), [], 2)
    (missing,) = found
    assert missing.state == 'missing'
    assert missing.position == markers.position_of(14)


def test_a_marker_is_missing_also_where_the_pose_is_a_little_off(hung):
    markers, _, _, empty = hung
    assert told(markers, aside(empty, 6), [], view=camera(y=0.01, yaw=-0.01)) == ['missing']


def test_light_that_falls_from_one_side_takes_no_marker_away(hung):
    markers, _, _, empty = hung
    slope = np.linspace(0.75, 1.2, 320)[None, :, None]
    assert told(markers, np.asarray(np.clip(empty * slope, 0, 255), np.uint8), []) == ['missing']


@pytest.mark.parametrize('across', [-30, 0, 40])
def test_the_cone_of_a_lamp_that_is_lit_meanwhile_keeps_no_marker(hung, across):
    markers, _, _, empty = hung
    rows, columns = np.indices(empty.shape[:2])
    apart = np.hypot(columns - (LEFT + 12 + across), rows - (TOP + 12))
    cone = (0.6 + 0.5 * np.exp(-((apart / 85.0) ** 2)))[..., None]
    assert told(markers, np.asarray(np.clip(empty * cone, 0, 255), np.uint8), []) == ['missing']


def test_nothing_is_said_of_a_marker_that_was_not_read_or_that_something_stands_before(hung):
    markers, picture, _, empty = hung
    blurred = np.asarray(cv2.GaussianBlur(picture, (0, 0), 1.5), np.uint8)
    assert told(markers, blurred, []) == []
    for colour, left, right in (
        *(((60, 90, 150), *each) for each in HIDDEN),
        # Plain and grey as the wall: what hides all of it the lidar alone sees.
        *(((70, 70, 70), *each) for each in HIDDEN[1:]),
        *(((120, 120, 120), *each) for each in HIDDEN[1:]),
    ):
        for scene in (picture, empty):
            hidden = scene.copy()
            hidden[60:, left:right] = colour
            assert told(markers, hidden, []) == [], (colour, left, right)
    assert told(markers, empty, [], clear=False) == [], 'the lidar meets somebody there'


def test_nothing_is_said_of_a_spot_that_may_be_out_of_view(hung):
    markers, _, _, empty = hung
    assert told(markers, empty, [], view=camera(yaw=0.47)) == []
    assert told(markers, empty, [], view=camera(yaw=math.pi)) == []
    assert told(markers, empty, [], view=camera(deviation=5.0, turn=3.0)) == [], 'it is lost'


def test_a_marker_is_moved_from_0_3_m_on_and_double_where_both_are_read(hung):
    markers, picture, seen, empty = hung
    near, far = empty.copy(), empty.copy()
    assert told(markers, near, [hang(near, 14, LEFT + 24, TOP)]) == ['here']
    there = hang(far, 14, LEFT + 50, TOP)
    unsure = camera(deviation=0.3)
    assert told(markers, far, [there], view=unsure) == [], 'it may be the pose'
    assert told(markers, far, [there]) == ['moved']
    both = picture.copy()
    assert told(markers, both, [seen, hang(both, 14, LEFT - 60, 60)]) == ['double']


def test_a_marker_that_hangs_in_another_view_too_is_double_and_moved_where_the_first_is_gone():
    markers, picture, seen = learned(wall)
    other, behind = wall(2), camera(yaw=math.pi)
    copy = hang(other, 14, 60, 60)
    assert told(markers, other, [copy], 3, behind) == [], 'it may hang there instead or as well'
    assert told(markers, picture, [seen], 4) == ['double']
    assert told(markers, wall(2), [], 5, behind) == []
    assert told(markers, picture, [seen], 5) == ['here'], 'the copy is gone'
    assert told(markers, wall(), [], 6) == ['missing']
    assert told(markers, other, [copy], 7, behind) == ['moved']
    assert told(markers, picture, [seen], 8) == ['here'], 'it came back'


def test_where_a_file_says_that_it_hangs_one_reading_elsewhere_is_enough():
    markers, picture = HungMarkers({14: (-2.0, 0.0, 1.0)}), wall()
    assert told(markers, picture, [hang(picture, 14, LEFT, TOP)]) == ['moved']


def test_one_picture_alone_tells_nothing_and_a_marker_that_is_read_ends_the_row():
    markers, picture, seen = learned(wall)
    for _ in range(2):
        assert not markers.take(wall(), camera(), [], 2)
        assert not markers.take(wall(), camera(), [], 2)
        assert [each.state for each in markers.take(picture, camera(), [seen], 2)] == ['here']


def test_what_was_looked_at_and_not_read_is_open_until_it_is_settled():
    markers, picture, seen = learned(wall)

    def is_open(shown: np.ndarray, read: list[SeenMarker], clear: bool = True) -> bool:
        markers.take(shown, camera(), read, 2, lambda _: clear)
        (spot,) = markers.spots()
        return spot.is_open

    there = hang(moved := wall(), 14, LEFT + 60, TOP)
    assert not is_open(picture, [seen])
    assert is_open(wall(), [], clear=False), 'somebody stands before it'
    assert not is_open(picture, [seen])
    assert [is_open(wall(), []) for _ in range(AGREED)] == [True] * (AGREED - 1) + [False]
    assert not is_open(wall(), [], clear=False), 'it was told'
    assert not is_open(picture, [seen])
    assert [is_open(moved, [there]) for _ in range(2)] == [True, False]
    assert not is_open(picture, [seen]), 'it is back'
    assert is_open(wall(), [])
    markers.accept(14)
    assert not markers.spots()


def test_what_a_person_calls_normal_is_how_it_hangs():
    markers, _, _ = learned(wall)
    moved = wall()
    there = hang(moved, 14, LEFT + 60, TOP)
    assert told(markers, moved, [there]) == ['moved']
    markers.accept(14)
    assert told(markers, moved, [there]) == ['here']
    assert told(markers, wall(), []) == ['missing']
    markers.accept(14)
    assert told(markers, wall(), []) == []


def test_it_outlives_a_restart_and_refuses_what_is_none(hung):
    markers, picture, seen, empty = hung
    kept = json.loads(json.dumps(markers.state()))
    again = HungMarkers()
    again.restore(kept)
    assert told(again, picture, [seen]) == ['here']
    assert told(again, empty, []) == ['missing']
    kept['spots']['14']['position'] = [1.0, None, 2.0]
    with pytest.raises((ValueError, TypeError)):
        again.restore(kept)
    assert again.position_of(14) is not None
    for other in ({'14': kept['spots']['14']}, {'spots': {}}, {'spots': [], 'accepted': 3}):
        with pytest.raises((KeyError, TypeError)):
            again.restore(other)
    assert again.position_of(14) is not None


@pytest.mark.parametrize('at', [(0.0, 2.0, 1.0), (-2.0, 0.0, 1.0)])
def test_a_persons_word_about_a_marker_of_the_file_outlives_a_restart_until_the_file_is_changed(at):
    markers, picture = HungMarkers({14: (-2.0, 0.0, 1.0)}), wall()
    there = hang(picture, 14, LEFT, TOP)
    assert told(markers, picture, [there]) == ['moved']
    markers.accept(14)
    again = HungMarkers({14: at})
    again.restore(json.loads(json.dumps(markers.state())))
    is_as_before = at == (-2.0, 0.0, 1.0)
    assert told(again, picture, [there]) == ['here' if is_as_before else 'moved']


def test_a_panel_of_another_size_is_judged_by_its_own():
    markers, picture, seen = learned(wall)
    small = replace(seen, side=seen.side / 2)
    assert told(markers, picture, [small], 2) == ['here']
    assert [each.side for each in markers._spots.values()] == [small.side]
    assert all(np.isclose(e.camera[0], 0.0) for e in markers._spots[14].aspects)
    assert len(markers._spots[14].aspects) == 1, 'how the other one looked is of no use'


@pytest.mark.parametrize(
    'change',
    [
        {'deviation': math.nan},
        {'turn': math.inf},
        {'deviation': 1e200},
        {'y': math.nan},
        {'y': 1e200},
    ],
)
def test_a_camera_that_is_nowhere_tells_nothing_and_spoils_nothing(change):
    markers, picture, seen = learned(wall)
    before = markers.state()
    assert told(markers, picture, [seen], view=camera(**change)) == []
    assert markers.state() == before


@pytest.mark.parametrize(
    'change',
    [
        {'position': np.array([0.0, 0.0, 1e200])},
        {'side': 1e200},
        {'side': math.nan},
        {'covariance': np.eye(3) * 1e200},
    ],
)
def test_what_no_camera_measures_is_no_marker(change):
    markers, picture, seen = learned(wall)
    before = markers.state()
    assert told(markers, picture, [replace(seen, **change)]) == []
    assert markers.state() == before


def test_a_month_of_misreadings_leaves_room_for_a_marker():
    markers, picture = HungMarkers(), wall()
    seen = hang(picture, 14, LEFT, TOP)
    for number in range(100, 100 + 2 * MOST):
        markers.take(picture, camera(), [replace(seen, number=number)], 1)
    assert told(markers, picture, [seen], 2) == []
    assert told(markers, picture, [seen], 3) == ['here']
    assert len(markers.state()['spots']) == MOST


def test_one_picture_that_is_far_off_decides_nothing():
    markers, picture = HungMarkers(), wall()
    seen = hang(picture, 14, LEFT, TOP)
    markers.take(picture, camera(yaw=0.2), [seen], 1)  # the pose was wrong
    assert told(markers, picture, [seen], 1) == []
    assert told(markers, picture, [seen], 2) == ['here']
    assert markers.position_of(14) == pytest.approx((2.0, 0.05, 1.05), abs=0.02)


def test_a_marker_that_is_read_in_passing_tells_where_to_look_and_nothing_else():
    markers, picture = HungMarkers(), wall()
    seen = hang(picture, 14, LEFT, TOP)
    view = camera(y=1.0)
    markers.pass_by(view.pose, [seen, SeenMarker(15)])
    (spot,) = markers.spots()
    assert spot.number == 14
    assert spot.position == pytest.approx(
        (2.0, 1.0 - (LEFT + 11.5 - 159.5) / METRE, 1.05), abs=0.01
    )
    assert spot.facing is not None
    towards = math.atan2(1.0 - spot.position[1], -2.0)
    assert spot.facing == pytest.approx(towards), 'it faces the camera'
    assert markers.position_of(14) is None
    assert told(markers, wall(), [], view=view) == [], 'it is not known to hang there'
    assert told(markers, picture, [seen], 1, view) == []
    assert told(markers, picture, [seen], 1, view) == ['here']
    markers.pass_by(camera(y=-1.0).pose, [seen])
    assert markers.spots()[0].position == pytest.approx(markers.position_of(14))
    far = SeenMarker(16, 0.15, np.array([0.0, 0.0, 9.0]), np.diag([1.0, -1.0, -1.0]))
    markers.pass_by(view.pose, [far])
    assert [each.number for each in markers.spots()] == [14]
