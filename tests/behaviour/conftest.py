"""Fixtures of the behaviour's tests."""

from __future__ import annotations

import pytest

from surveillance_behaviour.machines import MACHINES


@pytest.fixture(params=list(MACHINES))
def machine(request: pytest.FixtureRequest) -> str:
    return str(request.param)
