"""The navigator's sense of place, what it remembers of obstacles, and the places of a map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from floor_plans.parameters import zones_from
from lidar_navigation import Drive, DriveState, Navigator, Velocity
from lidar_navigation.driving.obstacle_memory import ObstacleMemory
from lidar_navigation.geometry import Scan, composed
from lidar_navigation.localisation.belief import Rival
from lidar_navigation.localisation.place_locator import PlaceRegions

PERIOD = 0.6
"""Of a slow lidar, seconds: who is out of sight for longer is not followed."""


@pytest.fixture
def navigator(flat: Any) -> Navigator:
    navigator = Navigator({'D1': flat.DOOR})
    navigator.set_positions(flat.POSITIONS)
    navigator.set_map(flat.grid)
    return navigator


def test_a_navigator_says_what_it_waits_for(flat: Any) -> None:
    navigator = Navigator()
    scan = flat.scan((2, 1.5, 0))
    assert navigator.see(scan, 0.0) is None
    assert navigator.missing == 'map'
    navigator.set_map(flat.grid)
    assert navigator.missing == 'odom'
    navigator.move((2, 1.5, 0))
    assert navigator.missing == 'scan'
    navigator.see(scan, 0.1)
    assert navigator.missing is None
    assert navigator.pose == pytest.approx((2, 1.5, 0), abs=0.05)


def test_a_navigator_that_has_seen_nothing_knows_of_nothing() -> None:
    navigator = Navigator()
    assert navigator.awaits == ('map', 'odom', 'scan')
    assert navigator.obstacles.shape == (0, 2)
    assert navigator.obstacles_stay.shape == (0,)
    assert navigator.jumps == 0
    assert (navigator.pose, navigator.odometry, navigator.place) == (None, None, None)
    assert not navigator.lost
    assert not navigator.ambiguous
    assert not navigator.stands


def test_all_that_has_not_come_is_named(flat: Any) -> None:
    navigator = Navigator()
    navigator.move((2, 1.5, 0))
    assert navigator.awaits == ('map', 'scan')
    navigator.set_map(flat.grid)
    assert navigator.awaits == ('scan',)
    assert navigator.odometry == (2, 1.5, 0)
    navigator.see(flat.scan((2, 1.5, 0)), 0.1)
    assert navigator.awaits == ()
    assert navigator.obstacles.shape == (0, 2)


def test_a_drive_through_the_door_changes_the_place_once(flat: Any, navigator: Navigator) -> None:
    true = (2.0, 1.5, 0.0)
    navigator.move(true)
    navigator.task = Drive([[2.0, 1.5], [5.5, 1.5]])
    places: list[str | None] = []
    for step in range(300):
        velocity = navigator.see(flat.scan(true), 0.1 * step)
        assert velocity is not None
        if not places or places[-1] != navigator.place:
            places.append(navigator.place)
        if navigator.task.state.ended:
            break
        true = composed(true, (velocity.speed * 0.1, 0.0, velocity.turn * 0.1))
        navigator.move(true)
    assert navigator.task.state is DriveState.ARRIVED
    assert places == ['A', 'B']
    assert true[:2] == pytest.approx((5.5, 1.5), abs=0.12)


def test_a_pose_that_is_told_is_taken(flat: Any, navigator: Navigator) -> None:
    navigator.believe((5.5, 1.0, 1.0))
    navigator.move((0.0, 0.0, 0.0))
    navigator.see(flat.scan((5.5, 1.0, 1.0)), 0.0)
    assert navigator.pose == pytest.approx((5.5, 1.0, 1.0), abs=0.05)
    assert navigator.place == 'B'


def test_the_places_in_which_a_robot_may_be_are_named(flat: Any, navigator: Navigator) -> None:
    assert navigator.may_be_in == ()
    true = (5.5, 1.0, 1.0)
    navigator.believe(true)
    navigator.move(true)
    navigator.see(flat.scan(true), 0.0)
    assert navigator.may_be_in == ('B',)
    assert navigator._localiser is not None
    navigator._localiser._belief.rivals.append(Rival((2.0, 1.0, 0.0)))
    assert navigator.ambiguous
    assert navigator.may_be_in == ('A', 'B')


def test_a_robot_whose_odometry_begins_at_zero_is_taken_to_be_at_the_station(flat: Any) -> None:
    station = (5.5, 2.0, 2.0)
    navigator = Navigator(guesses=[station])
    navigator.set_map(flat.grid)
    navigator.move((0.0, 0.0, 0.0))
    navigator.see(flat.scan((5.45, 2.05, 1.9)), 0.0)
    assert navigator.pose == pytest.approx((5.45, 2.05, 1.9), abs=0.05)


def test_an_obstacle_on_the_path_makes_the_drive_ask(flat: Any, navigator: Navigator) -> None:
    true = (1.0, 1.5, 0.0)
    navigator.move(true)
    navigator.task = Drive([[1.0, 1.5], [3.5, 1.5]])
    navigator.see(flat.scan(true), 0.0)
    navigator.obstacles_changed = False
    # Whether it moves shows within half a second.
    for moment in (1.0, 1.3, 1.6):
        navigator.see(flat.scan(true, [(2.6, 1.5, 0.15)]), moment)
    assert navigator.obstacles_changed
    assert navigator.task.state is DriveState.ASKING
    gaps = np.hypot(*(navigator.obstacles - (2.6, 1.5)).T)
    assert len(gaps) > 3
    assert np.abs(gaps - 0.15).max() < 0.1


def test_who_walks_by_is_no_obstacle_until_they_stand(flat: Any, navigator: Navigator) -> None:
    true = (1.0, 1.5, 0.0)
    navigator.move(true)
    for step in range(20):
        navigator.see(flat.scan(true, [(2.6, 0.5 + 0.1 * step, 0.25)]), 0.1 * step)
    assert len(navigator.obstacles) == 0
    for step in range(20, 40):
        navigator.see(flat.scan(true, [(2.6, 2.5, 0.25)]), 0.1 * step)
    gaps = np.hypot(*(navigator.obstacles - (2.6, 2.5)).T)
    assert len(gaps) > 3
    assert np.abs(gaps - 0.25).max() < 0.1


@pytest.mark.parametrize('stamp', [1e6, -1e6], ids=['far ahead', 'far back'])
def test_one_wrong_stamp_of_a_scan_costs_nothing_that_is_known(
    flat: Any, navigator: Navigator, stamp: float
) -> None:
    true = (1.0, 1.5, 0.0)
    scan = flat.scan(true, [(2.6, 1.5, 0.15)])
    navigator.move(true)
    for step in range(65):
        navigator.see(scan, PERIOD * step)
    before = navigator.obstacles_stay.sum()
    assert before > 3
    navigator.see(scan, stamp)
    for step in range(65, 70):
        navigator.see(scan, PERIOD * step)
    assert navigator.obstacles_stay.sum() >= before


def test_a_clock_that_begins_anew_lets_obstacles_come_to_stay_and_drives_go_on(
    flat: Any, navigator: Navigator
) -> None:
    true = (1.0, 1.5, 0.0)
    scan = flat.scan(true, [(2.6, 1.5, 0.15)])
    navigator.move(true)
    navigator.task = Drive([[1.0, 1.5], [3.5, 1.5]])
    for step in range(8):
        navigator.see(scan, 1000.0 + PERIOD * step)
    assert len(navigator.obstacles) > 3
    assert not navigator.obstacles_stay.any()
    navigator.task.no_path('a box')
    assert navigator.task.state is DriveState.WAITING
    for step in range(53):
        navigator.see(scan, PERIOD * step)
    assert navigator.obstacles_stay.sum() > 3
    assert navigator.task.state is not DriveState.WAITING


def test_scans_of_a_second_lidar_that_come_late_do_not_hurry_time(
    flat: Any, navigator: Navigator
) -> None:
    true = (1.0, 1.5, 0.0)
    scan = flat.scan(true, [(2.6, 1.5, 0.15)])
    navigator.move(true)
    for step in range(42):
        navigator.see(scan, PERIOD * step)
        navigator.see(scan, PERIOD * step - 0.4)
    assert len(navigator.obstacles) > 3
    assert not navigator.obstacles_stay.any(), 'it has stood for 25 s'


def test_a_lost_robot_looks_on_when_time_begins_anew(flat: Any, navigator: Navigator) -> None:
    navigator.move((2.0, 1.5, 0.0))
    scan = flat.scan((2.0, 1.5, 0.0))
    nonsense = np.random.default_rng(2).uniform(0.3, 7.0, len(scan.angles))
    navigator.see(Scan(scan.angles, nonsense, scan.range_max), 1000.0)
    assert navigator.lost
    elsewhere = (3.5, 1.5, 1.0)
    for step in range(15):
        navigator.see(flat.scan(elsewhere), 0.1 * step)
    assert not navigator.lost
    assert navigator.pose == pytest.approx(elsewhere, abs=0.06)


def test_a_closed_door_is_no_obstacle_once_it_is_known(flat: Any, navigator: Navigator) -> None:
    true = (2.5, 1.5, 0.0)
    navigator.move(true)
    navigator.see(flat.scan(true, closed=True), 0.0)
    assert len(navigator.obstacles) > 3
    navigator.set_closed(['D1', 'unheard of'])
    assert len(navigator.obstacles) == 0
    navigator.see(flat.scan(true, closed=True), 1.0)
    assert len(navigator.obstacles) == 0


def test_without_a_task_nothing_is_commanded(flat: Any, navigator: Navigator) -> None:
    navigator.move((2, 1.5, 0))
    assert navigator.see(flat.scan((2, 1.5, 0)), 0.0) is None
    navigator.task = Drive([[2, 1.5]])
    assert navigator.see(flat.scan((2, 1.5, 0)), 0.1) == Velocity()


def test_obstacles_are_forgotten_when_rays_go_through_them(flat: Any) -> None:
    memory = ObstacleMemory(flat.grid)
    pose = (1.0, 1.5, 0.0)
    assert memory.update(pose, flat.scan(pose, [(2.5, 1.2, 0.15)]), 0.0)
    assert len(memory.points) > 3
    behind = flat.scan(pose, [(1.6, 1.34, 0.25)])
    memory.update(pose, behind, 1.0)
    near = np.hypot(*(memory.points - (2.5, 1.2)).T) < 0.3
    assert near.any(), 'what is hidden is not forgotten'
    blind = np.full(len(behind.angles), np.nan)
    memory.update(pose, Scan(behind.angles, blind, behind.range_max), 1.5)
    assert len(memory.points) > 3, 'rays that tell nothing go through nothing'
    memory.update(pose, flat.scan(pose), 2.0)
    assert len(memory.points) == 0


def test_what_stands_for_long_stays_and_whoever_comes_later_may_leave(flat: Any) -> None:
    memory = ObstacleMemory(flat.grid, settle=30.0, gap=5.0)
    pose = (1.0, 1.5, 0.0)
    scan = flat.scan(pose, [(2.5, 1.2, 0.15)])
    memory.update(pose, scan, 0.0)
    # Nobody knows who stood there in between.
    for moment in (40.0, 44.0, 48.0, 52.0, 56.0, 60.0, 64.0, 68.0):
        memory.update(pose, scan, moment)
        assert not memory.stay.any()
    assert memory.update(pose, scan, 71.0)
    assert memory.stay.all()
    memory.update(pose, scan, 120.0)
    assert memory.stay.all()


def test_what_stands_has_stood_as_long_on_the_side_that_is_seen_later(flat: Any) -> None:
    memory = ObstacleMemory(flat.grid, settle=30.0, gap=5.0)
    for moment in range(32):  # half way round a box; no side is in sight for 30 s
        angle = math.pi + 0.1 * moment
        pose = (2.5 + 0.9 * math.cos(angle), 1.5 + 0.9 * math.sin(angle), angle + math.pi)
        memory.update(pose, flat.scan(pose, [(2.5, 1.5, 0.2)]), 1.0 * moment)
    in_sight = memory.points[:, 0] > 2.6
    assert in_sight.sum() > 3
    assert memory.stay[in_sight].mean() > 0.8
    somebody = [(2.5, 1.5, 0.2), (3.2, 1.0, 0.2)]
    memory.update(pose, flat.scan(pose, somebody), 33.0)
    beside = np.hypot(*(memory.points - (3.2, 1.0)).T) < 0.3
    assert beside.sum() > 3
    assert not memory.stay[beside].any()


def test_who_stops_beside_what_stands_has_not_stood_there_as_long(flat: Any) -> None:
    memory = ObstacleMemory(flat.grid, settle=30.0, gap=5.0)
    pose = (1.0, 1.5, 0.0)
    box = (2.5, 1.0, 0.2)
    for moment in range(40):
        memory.update(pose, flat.scan(pose, [box]), 1.0 * moment)
    assert memory.stay.mean() > 0.5
    for moment in range(40, 60):  # walks slowly up to the box and away from it
        somebody = (2.5, 1.45 + 0.03 * abs(50 - moment), 0.2)
        memory.update(pose, flat.scan(pose, [box, somebody]), 1.0 * moment)
        theirs = memory.points[:, 1] > 1.3
        assert theirs.sum() > 3
        assert not memory.stay[theirs].any()
    assert memory.stay.any()


def test_obstacles_that_stay_unseen_are_forgotten_in_the_end(flat: Any) -> None:
    memory = ObstacleMemory(flat.grid, keep=10.0)
    pose = (1.0, 1.5, 0.0)
    memory.update(pose, flat.scan(pose, [(2.5, 1.2, 0.15)]), 0.0)
    memory.update((6.0, 2.5, 0.0), flat.scan((6.0, 2.5, 0.0)), 11.0)
    assert len(memory.points) == 0


def test_a_map_without_obstacles_shows_none(flat: Any) -> None:
    memory = ObstacleMemory(flat.grid)
    for pose in [(1.0, 1.5, 0.0), (3.7, 1.5, 2.0), (5.5, 2.5, -1.0)]:
        assert not memory.update(pose, flat.scan(pose), 0.0)


def test_regions_are_divided_by_the_door(flat: Any) -> None:
    regions = PlaceRegions(flat.grid, [flat.DOOR], flat.POSITIONS)
    assert regions.place_at((0.5, 2.8)) == 'A'
    assert regions.place_at((3.95, 1.5)) == 'A'
    assert regions.place_at((4.2, 1.5)) == 'B'
    assert regions.place_at((5.2, 3.15)) == 'B'
    assert regions.place_at((40, 1)) is None
    without_b = PlaceRegions(flat.grid, [flat.DOOR], {'A': flat.POSITIONS['A']})
    assert without_b.place_at((5.2, 1.5)) == 'A', 'the way out of a room that is on no map'
    assert PlaceRegions(flat.grid, [], {}).place_at((0.5, 2.8)) is None
    assert regions.place_at((math.nan, 1)) is None


def test_places_in_one_region_are_told_apart_by_their_points(flat: Any) -> None:
    regions = PlaceRegions(flat.grid, [], flat.POSITIONS)
    assert regions.place_at((3.0, 1.5)) == 'A'
    assert regions.place_at((4.5, 1.5)) == 'B'


def test_a_drive_obeys_zones(flat: Any) -> None:
    """The straight way is barred, and the way round leads through a slow zone."""
    zones = zones_from(
        {
            'keep_out_zones': {'Z': [2.2, 1.0, 2.6, 1.0, 2.6, 2.0, 2.2, 2.0]},
            'slow_zones': {'S': [0.15, 0.0, 0.0, 1.6, 0.0, 1.6, 3.0, 0.0, 3.0]},
        }
    )
    navigator = Navigator({'D1': flat.DOOR}, zones=zones)
    navigator.set_positions(flat.POSITIONS)
    navigator.set_map(flat.grid)
    true = (0.6, 1.5, 0.0)
    navigator.move(true)
    navigator.task = Drive([[0.6, 1.5], [5.5, 1.5]])
    fastest = 0.0
    for step in range(200):
        velocity = navigator.see(flat.scan(true), 0.1 * step)
        assert velocity is not None
        if true[0] < 1.55:
            assert velocity.speed <= 0.16
        fastest = max(fastest, velocity.speed)
        if navigator.task.state is not DriveState.DRIVING:
            break
        true = composed(true, (velocity.speed * 0.1, 0.0, velocity.turn * 0.1))
        navigator.move(true)
    assert fastest > 0.2, 'outside it drives on faster'
    assert navigator.task.state is DriveState.WAITING, 'the zone stands in the way'
    assert 2.2 - true[0] >= 0.22


def test_a_place_that_was_changed_divides_the_map_anew(flat: Any, navigator: Navigator) -> None:
    navigator.move((2.0, 1.5, 0.0))
    navigator.see(flat.scan((2.0, 1.5, 0.0)), 0.0)
    assert navigator.place == 'A'
    doors = {'D1': flat.DOOR, 'D2': (1.2, 0.0, 1.2, 3.1)}
    points = {**flat.POSITIONS, 'A': (0.6, 1.5), 'C': (2.0, 1.5)}
    navigator.take_place(doors, zones_from({}), points)
    for step in range(5):
        navigator.see(flat.scan((2.0, 1.5, 0.0)), 0.1 * (step + 1))
    assert navigator.place == 'C'
