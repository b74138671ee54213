"""Hypothesis draws the same examples in each run, without deadlines."""

import hypothesis

hypothesis.settings.register_profile(
    'alone',
    deadline=None,
    derandomize=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
if hypothesis.settings.get_current_profile_name() == 'default':
    hypothesis.settings.load_profile('alone')
