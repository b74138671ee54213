"""A scan leaves no direction unseen."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_perception.arm.scan import ScanPlan, View

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
