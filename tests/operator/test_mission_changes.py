"""What changed between two moments of a mission, in words."""

from __future__ import annotations

import numpy as np

from surveillance_operator.mission_changes import changes
from surveillance_operator.mission_state import (
    MissionState,
)
from tests.operator.missions import whole


def test_a_node_that_is_started_again_is_told_though_the_killed_one_still_seems_there():
    before = whole()
    again = before.having(nodes={'robot_behavior': frozenset({'1', '2'})})
    told = [change.text for change in changes(before, again)]
    assert told == ['robot_behavior was started again']
    assert list(changes(again, again.having(nodes={'robot_behavior': frozenset({'2'})}))) == []


def test_each_change_is_told_once_in_one_line():
    before, after = MissionState(), whole()
    first = {change.text: change.detail for change in changes(before, after)}
    assert first['decision 3: A → B [URGENT]'] == 'B waits longest'
    assert {'door D closed', 'B is URGENT', 'arrived in A', 'battery at 80 %'} <= first.keys()
    assert 'something stands at (2.0, 3.5)' in first
    assert list(changes(after, after)) == []
    later = after.having(
        doors={'D': True},
        obstacles=np.empty((0, 2)),
        battery=70.0,
        nodes={},
        ended=frozenset({'robot_behavior'}),
    )
    assert [change.text for change in changes(after, later)] == [
        'battery at 70 %',
        'door D opened',
        'nothing stands about any more',
        'every node has ended: waiting for the next mission',
    ]
