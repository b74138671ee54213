"""What an exploration decides, thought by thought, over maps that a test draws."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from floor_plans import Grid
from lidar_navigation import Drive, DriveState, Exploration, Phase, Spin, Velocity
from lidar_navigation.geometry import Pose, Scan, composed

AROUND = np.linspace(-math.pi, math.pi, 180)
HOME = (1.0, 2.0, 0.0)


def hall(unknown_from: int = 120, *, shut: bool = False) -> Grid:
    """Return a hall of 6 m x 4 m of which the east is unknown from this column on."""
    cells = np.zeros((80, 120), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[:, unknown_from:] = -1
    if shut:
        cells[:, 60] = 100
    return Grid(cells, 0.05)


class Drawn:
    """What builds the map: it is as the test draws it, and the odometry is the pose."""

    def __init__(self, grid: Grid, start: Pose = HOME) -> None:
        self.start, self.drawn, self.due = start, grid, True
        self.kept: list[bool] = []

    def pose(self, odometry: Pose) -> Pose:
        return odometry

    def is_due(self, odometry: Pose) -> bool:
        return self.due

    def see(self, scan: Scan, odometry: Pose, *, keep: bool = False) -> bool:
        self.kept.append(keep)
        return self.due

    def grid(self) -> Grid:
        return self.drawn


def sees(exploration: Exploration, now: float, at: Pose = HOME, **more: Any) -> Velocity:
    """See nothing all around, from a pose."""
    return exploration.see(Scan(AROUND, np.full(180, np.inf), 8.0), at, now, **more)


def begun(grid: Grid) -> tuple[Exploration, Drawn]:
    """Return an exploration that has thought once."""
    builder = Drawn(grid)
    exploration = Exploration(builder)
    sees(exploration, 0.0)
    assert exploration.think()
    return exploration, builder


def test_it_waits_for_the_first_scan_and_then_drives_to_where_it_can_see_more() -> None:
    builder = Drawn(hall(80))
    exploration = Exploration(builder)
    assert exploration.phase is Phase.STARTING
    assert not exploration.think()
    assert exploration.grid is None
    assert exploration.correction is None
    assert exploration.pose((3.0, 3.0, 1.0)) == HOME
    assert sees(exploration, 0.0) == Velocity()
    assert exploration.think()
    assert exploration.phase is Phase.EXPLORING
    assert exploration.grid is builder.drawn
    assert exploration.pose((3.0, 3.0, 1.0)) == pytest.approx((3.0, 3.0, 1.0))
    assert exploration.goal is not None
    assert exploration.goal.viewpoint is not None
    assert exploration.goal.viewpoint[0] == pytest.approx(3.6, abs=0.2)
    assert sees(exploration, 0.1).speed == 0.0, 'no time has passed for the drive'
    assert sees(exploration, 0.3).speed > 0.0
    assert exploration.unreached == []
    assert builder.kept == [False]


def test_the_correction_is_where_the_odometry_s_frame_lies_on_the_map() -> None:
    builder = Drawn(hall(80))
    builder.pose = lambda odometry: (2.0, 1.0, math.pi / 2)  # type: ignore[method-assign]
    exploration = Exploration(builder)
    sees(exploration, 0.0, (5.0, 5.0, 0.5))
    exploration.think()
    assert exploration.pose((5.0, 5.0, 0.5)) == pytest.approx((2.0, 1.0, math.pi / 2))
    ahead = composed((5.0, 5.0, 0.5), (1.0, 0.0, 0.0))
    assert exploration.pose(ahead) == pytest.approx((2.0, 2.0, math.pi / 2))


@pytest.mark.parametrize(('sight', 'looks'), [(5.9, True), (6.1, False)])
def test_a_lidar_that_does_not_see_all_around_turns_once_first(sight: float, looks: bool) -> None:
    exploration = Exploration(Drawn(hall(80)))
    narrow = Scan(np.linspace(-sight / 2, sight / 2, 90), np.full(90, np.inf), 8.0)
    exploration.see(narrow, HOME, 0.0)
    exploration.think()
    assert exploration.phase is (Phase.LOOKING if looks else Phase.EXPLORING)
    if not looks:
        return
    turned = 0.0
    for step in range(1, 90):
        velocity = exploration.see(narrow, (1.0, 2.0, turned), 0.1 * step)
        assert velocity.speed == 0.0
        turned = math.remainder(turned + 0.1 * velocity.turn, math.tau)
        exploration.think()
        if exploration.phase is not Phase.LOOKING:
            break
    assert exploration.phase is Phase.EXPLORING
    assert step > 55
    assert isinstance(exploration._task, Drive)


def test_while_it_is_held_no_time_passes() -> None:
    exploration, _ = begun(hall(80))
    sees(exploration, 1.0)
    assert sees(exploration, 5.0, stands=True) == Velocity()
    sees(exploration, 6.0)
    assert exploration._now == pytest.approx(2.0)
    sees(exploration, 6.5, stands=True)
    assert exploration._now == pytest.approx(2.0)


def test_a_map_that_is_whole_brings_it_home_and_a_stop_ends_it() -> None:
    exploration, _ = begun(hall())
    assert exploration.phase is Phase.RETURNING
    assert exploration.goal is None
    drive = exploration._task
    assert isinstance(drive, Drive)
    drive.state = DriveState.ARRIVED
    assert sees(exploration, 0.1) == Velocity()
    exploration.think()
    assert (exploration.phase, exploration.reason) == (Phase.DONE, '')
    exploration.think()
    assert exploration.phase is Phase.DONE, 'it stays so'
    stopped, _ = begun(hall(80))
    stopped.stop()
    assert stopped.phase is Phase.DONE
    assert sees(stopped, 1.0) == Velocity()


@pytest.mark.parametrize(('x', 'reason'), [(1.29, ''), (1.31, 'it is stuck')])
def test_a_way_back_that_fails_does_not_matter_at_home(x: float, reason: str) -> None:
    exploration, builder = begun(hall())
    builder.due = False
    drive = exploration._task
    assert isinstance(drive, Drive)
    drive.state, drive.reason = DriveState.FAILED, 'it is stuck'
    sees(exploration, 0.1, (x, 2.0, 0.0))
    exploration.think()
    assert (exploration.phase, exploration.reason) == (Phase.DONE, reason)


def test_a_frontier_that_a_drive_does_not_reach_is_left_with_the_reason() -> None:
    exploration, builder = begun(hall(80))
    first = exploration.goal
    assert first is not None
    assert first.viewpoint is not None
    now, waited = 1.0, 0
    for _ in range(60):
        builder.due = False
        if exploration.phase is not Phase.EXPLORING:
            break
        drive = exploration._task
        if drive is None:
            # Who stood in the way may have gone on: it stands, and tries again.
            waited += 1
            now += 11.0
        else:
            assert isinstance(drive, Drive)
            drive.state, drive.reason = DriveState.FAILED, 'a box is in the way'
        sees(exploration, now)
        exploration.think()
    assert waited == 3
    assert exploration.phase is Phase.RETURNING
    spent = np.array([point for point, _ in exploration._spent])
    assert len(spent) > 2
    gaps = np.hypot(*(spent[:, None] - spent).transpose(2, 0, 1)) + 9.0 * np.eye(len(spent))
    assert gaps.min() > 0.4
    (left,) = exploration.unreached
    assert left.reason == 'a box is in the way'
    assert left.length == first.length
    assert left.point == pytest.approx(first.middle)


def test_what_was_seen_goes_into_the_map_before_it_goes_on() -> None:
    exploration, builder = begun(hall(80))
    goal, drive = exploration.goal, exploration._task
    assert goal is not None
    assert isinstance(drive, Drive)
    builder.due = False
    drive.state = DriveState.ARRIVED
    sees(exploration, 1.0)
    assert not exploration.think()
    assert exploration.goal is goal
    for now in (2.0, 8.9):
        sees(exploration, now)
        exploration.think()
        assert exploration.goal is goal, 'it waits for the map'
    assert builder.kept[-1], 'and has this scan kept'
    sees(exploration, 9.0)
    exploration.think()
    assert exploration._spent[-1][1] == 'what lies behind cannot be seen from beside it'
    assert exploration.goal is not goal


@pytest.mark.parametrize(('left', 'given_up'), [(25, True), (20, False)])
def test_a_frontier_of_which_most_was_seen_is_done(left: int, given_up: bool) -> None:
    exploration, builder = begun(hall(80))
    goal, drive = exploration.goal, exploration._task
    assert goal is not None
    assert isinstance(drive, Drive)
    cells = hall(118).cells.copy()
    # Of its 78 cells so many still lie beside the unknown.
    cells[1 : 1 + left, 80:] = -1
    builder.drawn = Grid(cells, 0.05)
    drive.state = DriveState.ARRIVED
    sees(exploration, 1.0)
    exploration.think()
    sees(exploration, 1.1)
    exploration.think()
    assert bool(exploration._spent) is given_up
    assert exploration._part_left(goal) == pytest.approx((left + 1) / 78, abs=0.02)


def test_a_drive_that_asks_gets_another_way_or_the_reason_why_there_is_none() -> None:
    exploration, builder = begun(hall(80))
    drive = exploration._task
    assert isinstance(drive, Drive)
    builder.due = False
    sees(exploration, 0.1)
    drive.state = DriveState.ASKING
    exploration.think()
    assert drive.state is DriveState.DRIVING
    assert exploration._task is drive
    # Boxes right across the hall, 2 m ahead.
    angles = np.linspace(-0.79, 0.79, 180)
    exploration.see(Scan(angles, 2.0 / np.cos(angles), 8.0), HOME, 0.2)
    drive.state = DriveState.ASKING
    exploration.think()
    assert drive.state is DriveState.WAITING
    assert exploration._task is drive
    assert exploration.reason == drive.reason
    assert 'an obstacle at (3.' in exploration.reason


def test_home_that_cannot_be_reached_ends_it_with_the_reason() -> None:
    builder = Drawn(hall(shut=True))
    exploration = Exploration(builder)
    sees(exploration, 0.0, (5.0, 2.0, 0.0))
    exploration.think()
    assert exploration.phase is Phase.DONE
    assert exploration.reason.startswith('no path from (5.00, 2.00) to (1.00, 2.00): ')


def test_near_what_it_goes_for_it_does_not_change_its_mind_for_little() -> None:
    exploration, _ = begun(hall(80))
    goal = exploration.goal
    assert goal is not None
    assert exploration._apart(goal, None) == math.inf
    assert exploration._apart(goal, goal) == 0.0
    sees(exploration, 0.5, (3.0, 0.6, 0.0))
    exploration.think()
    assert exploration.goal is not None
    assert exploration._apart(exploration.goal, goal) < 1.0
    assert isinstance(exploration._task, Drive)
    assert not isinstance(exploration._task, Spin)


def test_a_scan_of_which_nobody_knows_where_it_was_made_is_no_part_of_the_map() -> None:
    exploration, builder = begun(hall(80))
    kept = len(builder.kept)
    for step in range(1, 5):
        sees(exploration, 0.1 * step, maps=False)
        exploration.think()
    assert len(builder.kept) == kept
    assert sees(exploration, 0.6, maps=False).speed > 0.0, 'it is driven by'
    sees(exploration, 0.7)
    exploration.think()
    assert len(builder.kept) == kept + 1
