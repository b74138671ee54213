"""Hypothesis draws the same examples in each run, without deadlines; a flat with a lidar."""

import hypothesis
import pytest

from lidar_navigation.testing import Flat

hypothesis.settings.register_profile(
    'alone',
    deadline=None,
    derandomize=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
if hypothesis.settings.get_current_profile_name() == 'default':
    hypothesis.settings.load_profile('alone')


@pytest.fixture
def flat() -> Flat:
    """Two rooms and a lidar in them."""
    return Flat()
