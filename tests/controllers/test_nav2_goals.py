"""Goals to servers of Nav2 that are not active, reject, or fail at once."""

from __future__ import annotations

from typing import Any

import pytest

from state_machines.ros import GoalEnd
from surveillance_controllers.motion import nav2_goals
from surveillance_controllers.motion.arrival import MotionFailedError
from tests.controllers.nav2_servers import PATH, Run, Servers, nav2, result


def test_a_server_that_is_not_active_is_waited_for_by_name(
    graph: Any, servers: Servers, run: Run
) -> None:
    servers.ends['navigate_through_poses'] = [
        GoalEnd('rejected', None),
        GoalEnd('succeeded', None),
    ]
    servers.states = {
        'bt_navigator': ['active'],
        'controller_server': ['inactive'] * 5 + ['active'],
    }
    motion = nav2(graph)
    incidents = motion._node.incidents
    said: list[str] = []
    sleep = run.sleep

    def asleep(seconds: float) -> bool:
        said.extend(each.text for each in incidents.updates())
        return sleep(seconds)

    run.sleep = asleep  # type: ignore[method-assign]
    motion.follow(PATH, run, lambda _at: None)
    assert servers.names == ['navigate_through_poses'] * 2
    assert said[0] == "Nav2's controller_server is inactive: the patrol waits for it"
    assert run.pauses[:5] == list(nav2_goals.PAUSES[:5])
    assert not incidents.updates()


def test_goals_that_fail_at_once_are_sent_with_growing_pauses(
    graph: Any, servers: Servers, run: Run
) -> None:
    servers.ends['navigate_through_poses'] = GoalEnd('rejected', None)
    motion = nav2(graph)
    while run.time < 60.0:
        with pytest.raises(MotionFailedError, match='Nav2 rejected the goal 5 times'):
            motion.follow(PATH, run, lambda _at: None)
    assert len(servers.asked) <= 15
    servers.ends['navigate_through_poses'] = GoalEnd('aborted', result('NavigateThroughPoses'))
    began = run.time
    for _ in range(6):
        with pytest.raises(MotionFailedError, match='Nav2 aborted the goal'):
            motion.follow(PATH, run, lambda _at: None)
    assert run.time - began > 30.0
