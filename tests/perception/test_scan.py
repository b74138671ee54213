"""A scan leaves no direction unseen."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_perception.arm.kinematics import ArmMotionError, direction_of
from surveillance_perception.arm.scan import (
    ScanPlan,
    View,
    _reach,
    _seen,
    aim_at,
    from_nearer_end,
    scan,
)
from surveillance_runtime.robot_arm import ARM

WHOLE = (-math.pi / 2, math.pi / 2)


@settings(max_examples=40)
@given(
    horizontal=st.floats(0.5, 2.0),
    vertical=st.floats(0.4, 1.6),
    overlap=st.floats(0.0, 0.5),
    band=st.tuples(st.floats(*WHOLE), st.floats(*WHOLE)).map(sorted),
)
def test_every_direction_of_the_band_is_in_a_picture(horizontal, vertical, overlap, band):
    lowest, highest = band
    views = ScanPlan(horizontal, vertical, overlap, lowest, highest).views
    keep = 1.0 - overlap
    kept = ScanPlan(horizontal * keep, vertical * keep, 0.0, lowest, highest)
    assert kept.covered(views) == 1.0


def test_views_are_not_many_more_than_the_sphere_needs():
    horizontal, vertical = math.radians(60), math.radians(46.8)
    views = ScanPlan(horizontal, vertical, 0.0, *WHOLE).views
    # solid angle of a rectangular pyramid
    one = 4 * math.asin(math.sin(horizontal / 2) * math.sin(vertical / 2))
    assert len(views) < 1.8 * 4 * math.pi / one


def test_one_view_covers_little():
    assert ScanPlan(1.0, 0.8, 0.0, *WHOLE).covered([View(0.0, 0.0)]) < 0.1


def test_views_follow_each_other_closely():
    views = ScanPlan(1.0, 0.8, 0.2, -0.5, 0.5).views
    for first, second in pairwise(views):
        assert abs(first.azimuth - second.azimuth) < 1.1


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        ((0.0, 0.8, 0.2, *WHOLE), 'fields of view'),
        ((1.0, 4.0, 0.2, *WHOLE), 'fields of view'),
        ((1.0, 0.8, 0.9, *WHOLE), 'overlap must be'),
        ((1.0, 0.8, 0.2, 0.5, -0.5), 'elevations must run upwards'),
        ((1.0, 0.8, 0.2, -2.0, 0.5), 'elevations must run upwards'),
    ],
)
def test_scan_that_cannot_be_is_refused(arguments, reason):
    with pytest.raises(ValueError, match=reason):
        ScanPlan(*arguments)


def in_image(view: View, azimuth: float, elevation: float, horizontal: float, vertical: float):
    """Tell whether a pinhole camera that looks along a view has a direction in its image."""
    forward = direction_of(view.azimuth, view.elevation)
    right = direction_of(view.azimuth - math.pi / 2, 0.0)
    up = np.cross(right, forward)
    x, y, z = (float(direction_of(azimuth, elevation) @ each) for each in (right, up, forward))
    return (
        z > 0
        and abs(x) <= z * math.tan(horizontal / 2) + 1e-9
        and abs(y) <= z * math.tan(vertical / 2) + 1e-9
    )


@pytest.mark.parametrize('elevation', [-1.2, -0.3, 0.0, 0.8, math.pi / 2])
def test_what_a_view_shows_is_what_a_pinhole_has_in_its_image(elevation):
    draw = np.random.default_rng(2)
    offset, height = draw.uniform(-3, 3, 400), draw.uniform(-1.5, 1.5, 400)
    seen = _seen(offset, height, elevation, 0.6, 0.4)
    view = View(0.0, elevation)
    expected = [in_image(view, a, e, 1.2, 0.8) for a, e in zip(offset, height, strict=True)]
    assert seen.tolist() == expected
    assert 0 < seen.sum() < 400


@pytest.mark.parametrize(('bottom', 'top', 'elevation'), [(-0.2, 0.2, 0.0), (0.3, 0.7, 0.5)])
def test_a_view_reaches_as_far_as_all_of_its_band_is_in_its_image(bottom, top, elevation):
    reach = _reach(bottom, top, elevation, 0.6, 0.4)
    band = np.linspace(bottom, top, 25)
    view = View(0.0, elevation)
    assert all(in_image(view, reach, each, 1.2, 0.8) for each in band)
    beyond = reach + math.radians(0.5)
    assert not all(in_image(view, beyond, each, 1.2, 0.8) for each in band)
    assert _reach(-0.5, 0.5, 0.0, 0.6, 0.4) == 0.0, 'higher than the image'
    assert _reach(1.3, math.pi / 2, math.pi / 2, 0.6, 0.4) == math.pi, 'around the pole'


def test_a_band_of_one_row_is_looked_at_to_and_fro():
    plan = ScanPlan(1.2, 0.8, 0.0, -0.1, 0.1)
    reach = _reach(-0.1, 0.1, 0.0, 0.6, 0.4)
    count = math.ceil(math.pi / reach - 1e-9)
    azimuths = [-math.pi + (k + 0.5) * math.tau / count for k in range(count)]
    assert [each.azimuth for each in plan.views] == pytest.approx(azimuths)
    assert {each.elevation for each in plan.views} == {0.0}
    rows = ScanPlan(1.2, 0.8, 0.0, -0.5, 0.5)
    heights = [each.elevation for each in rows.views]
    assert heights == sorted(heights)
    by_row = {
        height: [v.azimuth for v in rows.views if v.elevation == height] for height in heights
    }
    for index, row in enumerate(by_row.values()):
        assert row == sorted(row, reverse=index % 2 == 1)
    overlapping = ScanPlan(1.2, 0.8, 0.5, -0.1, 0.1)
    assert len(overlapping.views) > len(plan.views)
    assert len(rows.views) <= len(ScanPlan(1.2, 0.8, 0.1, -0.5, 0.5).views)


def test_the_share_that_is_covered_is_that_of_directions_spread_evenly():
    plan = ScanPlan(1.2, 0.8, 0.1, -0.4, 0.9)
    assert plan.covered(plan.views) == 1.0
    assert plan.covered([]) == 0.0
    view = View(0.7, 0.2)
    heights, azimuths = np.meshgrid(np.linspace(-0.4, 0.9, 65), np.linspace(-math.pi, math.pi, 120))
    inside = [
        in_image(view, a, e, 1.2, 0.8)
        for a, e in zip(azimuths.ravel(), heights.ravel(), strict=True)
    ]
    # Directions near the pole stand for less.
    weights = np.cos(heights.ravel())
    assert plan.covered([view]) == pytest.approx(float(weights @ inside / weights.sum()), abs=0.008)
    assert plan.covered([view, View(0.7 + math.pi, 0.2)]) == pytest.approx(
        2 * plan.covered([view]), abs=0.003
    )


class Stage:
    """An arm that goes wherever it is sent, unless it is told otherwise."""

    def __init__(self, fails_at: int | None = None) -> None:
        self.arm, self.posture = ARM, np.array(ARM.home)
        self.moves = 0
        self._fails_at = fails_at

    def move(self, positions, ended) -> None:
        self.moves += 1
        if self.moves == self._fails_at:
            raise ArmMotionError('it is stuck')
        self.posture = positions


@pytest.mark.parametrize(
    ('fails_at', 'dwells', 'rested', 'failure'),
    [(None, 99, 'all', ''), (3, 99, 2, 'view 3 of '), (None, 4, 3, '')],
)
def test_a_scan_tells_each_view_and_what_came_of_it(fails_at, dwells, rested, failure):
    plan = ScanPlan(1.2, 0.8, 0.1, -0.2, 0.2)
    stage: Any = Stage(fails_at)
    told: list[Any] = []
    left = [dwells]

    def dwell() -> bool:
        left[0] -= 1
        return left[0] > 0

    outcome = scan(stage, plan, dwell, lambda *each: told.append(each), lambda: False)
    views = list(from_nearer_end(ARM, plan.views, np.array(ARM.home)))
    reached = len(views) - outcome.unreachable
    assert outcome.rested == (reached if rested == 'all' else rested)
    assert outcome.failure.startswith(failure)
    assert outcome.failure.endswith('it is stuck' if failure else '')
    set_out = [view for _, view, rests in told if not rests]
    assert [view for _, view, rests in told if rests] == set_out[: outcome.rested + (dwells < 99)]
    assert all(views[index] == view for index, view, _ in told)
    assert outcome.covered == plan.covered(set_out[: outcome.rested])


def test_an_arm_begins_with_the_end_that_it_is_nearer_to():
    views = (View(-1.0, 0.0), View(0.0, 0.0), View(1.0, 0.0))
    near_first, near_last = (aim_at(ARM, views[end], np.array(ARM.home)) for end in (0, -1))
    assert from_nearer_end(ARM, views, near_first) == views
    assert from_nearer_end(ARM, views, near_last) == views[::-1]
    assert from_nearer_end(ARM, views[1:2], near_last) == views[1:2]
