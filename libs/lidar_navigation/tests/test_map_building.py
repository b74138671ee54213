"""When a scan is kept, how sure an odometry step is, and which loops are believed; a plain room."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from floor_plans import Grid
from lidar_navigation import MapBuilder, MappingParameters
from lidar_navigation.exploration import map_building
from lidar_navigation.geometry import Pose, Scan

ANGLES = (np.arange(180) + 0.5) * math.tau / 180 - math.pi
HOME = (2.0, 1.5, 0.0)
START = (2.025, 1.525, 0.0)
"""On a map on which the walls are in the middle of their cells."""
ROUND = (
    *((2.0, 1.5), (2.4, 1.5), (2.8, 1.5), (2.8, 1.9)),
    *((2.8, 2.3), (2.4, 2.3), (2.0, 2.3), (2.0, 1.9), (2.0, 1.5)),
)
"""3.2 m in eight steps, back to where it began."""


def room(pose: Pose) -> Scan:
    """Return what a lidar sees in a room of 6 by 4 metres with its south-west corner at 0, 0."""
    along, up = np.cos(ANGLES + pose[2]), np.sin(ANGLES + pose[2])
    x = np.where(along > 0, 6.0 - pose[0], -pose[0]) / along
    y = np.where(up > 0, 4.0 - pose[1], -pose[1]) / up
    return Scan(ANGLES, np.minimum(x, y), 8.0)


def driven(error: float, options: Mapping[str, Any]) -> MapBuilder:
    """Drive the round; the odometry is that much too far ahead in the end, and is believed."""
    parameters = replace(MappingParameters(around=0.5, loop_around=0.4, agreement=1.1), **options)
    builder = MapBuilder(start=START, parameters=parameters)
    for number, (x, y) in enumerate(ROUND):
        builder.see(room((x, y, 0.0)), (x + error * number / 8, y, 0.0), keep=True)
    return builder


@pytest.mark.parametrize(
    ('error', 'options'),
    [
        (0.25, {}),
        (0.4, {}),
        (0.25, {'loop_window': 0.16}),
        (0.28, {'loop_growth': 0.0}),
        (0.08, {'loop_window': 0.0}),
        (0.25, {'around': 1.5}),
        (0.25, {'loop_around': 1.0}),
        (0.25, {'loop_agreement': 0.9, 'loop_contradiction': 0.02}),
    ],
)
def test_a_loop_takes_the_error_out(error: float, options: dict[str, Any]) -> None:
    builder = driven(error, options)
    assert builder.loops >= 1
    assert builder.kept == 9
    x, y, yaw = builder.graph.poses[-1]
    assert math.dist((x, y), START[:2]) < 0.05
    assert abs(yaw) < 0.02


@pytest.mark.parametrize(
    ('error', 'options'),
    [
        (0.25, {'loop_agreement': 1.01}),
        (0.25, {'loop_contradiction': -0.01}),
        (0.12, {'loop_window': 0.0}),
        (0.4, {'loop_window': 0.1}),
        (0.4, {'loop_growth': 0.0}),
        (0.25, {'around': 1.7}),
        (0.25, {'loop_around': 1.2}),
    ],
    ids=['fits too little', 'seen through', 'far', 'too far', 'no growth', 'way', 'near'],
)
def test_a_loop_in_doubt_changes_nothing(error: float, options: dict[str, Any]) -> None:
    builder = driven(error, options)
    assert builder.loops == 0
    assert builder.graph.poses[-1] == pytest.approx((START[0] + error, START[1], 0.0))
    assert len(builder.graph.constraints) == 8


def test_what_was_drawn_before_the_loop_is_drawn_anew() -> None:
    corrected, right = (driven(error, {}).grid() for error in (0.25, 0.0))
    wrong = driven(0.25, {'loop_agreement': 1.01}).grid()

    def walls(grid: Grid) -> set[tuple[int, int]]:
        points = grid.centres_of(np.argwhere(grid.occupied))
        return {(round(x / 0.05 - 0.5), round(y / 0.05 - 0.5)) for x, y in points.tolist()}

    assert len(walls(right)) > 150
    assert len(walls(corrected) ^ walls(right)) < 0.3 * len(walls(wrong) ^ walls(right))


@pytest.mark.parametrize(
    ('odometry', 'due'),
    [
        ((2.31, 1.5, 0.0), True),
        ((2.29, 1.5, 0.0), False),
        ((2.0, 1.19, 0.0), True),
        ((2.22, 1.72, 0.0), True),
        ((2.2, 1.7, 0.0), False),
        ((2.0, 1.5, 0.27), True),
        ((2.0, 1.5, -0.27), True),
        ((2.0, 1.5, 0.25), False),
    ],
)
def test_a_scan_is_kept_after_some_way_or_turn(odometry: Pose, due: bool) -> None:
    builder = MapBuilder(start=(7.0, 7.0, 1.0))
    assert builder.is_due(HOME)
    assert builder.pose(HOME) == (7.0, 7.0, 1.0)
    assert builder.see(room(HOME), HOME)
    assert builder.is_due(odometry) is due
    assert builder.see(room(odometry), odometry) is due
    assert builder.kept == 1 + due


def test_between_two_kept_scans_the_odometry_counts() -> None:
    builder = MapBuilder(start=(7.0, 7.0, math.pi / 2))
    builder.see(room(HOME), HOME)
    assert builder.pose((2.1, 1.7, 0.1)) == pytest.approx((6.8, 7.1, math.pi / 2 + 0.1))


@pytest.mark.parametrize(
    ('step', 'counts'), [((9.9, 0.0, 0.2), True), ((0.0, -9.9, 0.2), True), ((10.1, 0, 0), False)]
)
def test_a_step_that_no_robot_drives_is_an_odometry_that_began_anew(
    step: Pose, counts: bool
) -> None:
    builder = MapBuilder(parameters=MappingParameters(agreement=1.1))
    builder.see(room(HOME), (0.0, 0.0, 0.0))
    builder.see(room(HOME), step)
    assert builder.graph.poses[1] == pytest.approx(step if counts else (0.0, 0.0, 0.0))
    assert builder.pose(step) == pytest.approx(step if counts else (0.0, 0.0, 0.0))


def test_an_odometry_step_is_the_less_sure_the_longer_it_is() -> None:
    parameters = MappingParameters(agreement=1.1, drift=0.1, turn_drift=0.05, bend=0.03)
    builder = MapBuilder(parameters=parameters)
    builder.see(room(HOME), (0.0, 0.0, 0.0))
    builder.see(room(HOME), (0.3, 0.4, -0.2))
    (edge,) = builder.graph.constraints
    assert (edge.first, edge.second, edge.may_be_wrong) == (0, 1, False)
    assert edge.step == pytest.approx((0.3, 0.4, -0.2))
    across = 1 / (0.01 * 0.5 + 1e-4)
    turned = 1 / (0.0025 * 0.2 + 0.0009 * 0.5 + 1e-5)
    assert edge.information == pytest.approx(np.diag([across, across, turned]))


def test_a_scan_that_fits_corrects_the_odometry_and_is_surer() -> None:
    builder = MapBuilder(start=HOME)
    builder.see(room(HOME), HOME)
    builder.see(room((2.4, 1.5, 0.0)), (2.5, 1.55, 0.05))
    assert builder.graph.poses[1] == pytest.approx((2.4, 1.5, 0.0), abs=0.01)
    assert builder.graph.constraints[0].information[0, 0] > 1 / (0.01 * 0.5 + 1e-4)


def test_beyond_the_reach_a_ray_shows_neither_walls_nor_floor() -> None:
    builder = MapBuilder(start=HOME, parameters=MappingParameters(reach=2.2))
    builder.see(room(HOME), HOME)
    grid = builder.grid()
    points = grid.centres_of(np.argwhere(grid.cells >= 0))
    assert 2.1 < np.hypot(*(points - HOME[:2]).T).max() < 2.3
    walls = grid.centres_of(np.argwhere(grid.occupied))
    # The walls in the south, 1.5 m away, and in the west, 2 m away; in the north 2.5 m, no more.
    assert (walls.min(axis=1) < 0.1).all()
    assert walls[:, 0].min() < 0.1
    assert walls[:, 1].min() < 0.1


def test_a_map_that_contradicts_itself_is_told_and_mended_where_a_loop_was_missed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The round is short: nine scans in all.
    monkeypatch.setattr(map_building, '_LEAST_WRONG', 2)
    builder = driven(0.5, {'loop_agreement': 1.01})
    assert builder.loops == 0
    assert builder.contradictions()
    assert builder.repair(), 'nothing mends it'

    builder.parameters = replace(builder.parameters, loop_agreement=0.6)
    assert builder.repair() == []
    assert builder.loops >= 1
    assert math.dist(builder.graph.poses[-1][:2], START[:2]) < 0.2, '0.5 before'


def test_a_map_that_is_sound_contradicts_nothing_though_a_wall_was_moved() -> None:
    builder = driven(0.02, {})
    loops = builder.loops
    assert builder.contradictions() == []
    moved = room((2.0, 1.5, 0.0))
    moved.ranges[:20] += 1.0
    builder.see(moved, (2.02, 1.5, 0.0), keep=True)
    assert builder.repair() == []
    assert builder.loops - loops <= 1
