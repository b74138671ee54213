"""The benchmark of the policies patrols a map with each of them."""

from __future__ import annotations

import pytest

from benchmarks.patrol import Map, patrol
from libs.patrol_policy.tests.worlds import seven_rooms


@pytest.mark.parametrize('policy', ['tour', 'oldest', 'random'])
def test_each_policy_patrols(policy: str) -> None:
    run = patrol(Map('seven rooms', seven_rooms(), 'E'), policy, hours=0.2)
    assert run.moves > 10
