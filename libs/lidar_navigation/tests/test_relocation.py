"""A robot that does not know where it is moves until it does, or has tried all."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from floor_plans import Zones
from floor_plans.parameters import NO_ZONES
from floor_plans.zones import Zone
from lidar_navigation import Drive, DriveState, Navigator, Velocity
from lidar_navigation.driving.relocation import OdometryTrack, Relocation
from lidar_navigation.geometry import Pose, composed
from lidar_navigation.testing import Flat

STEP = 0.1


def moved(pose: Pose, velocity: Velocity) -> Pose:
    return composed(pose, (STEP * velocity.speed, 0.0, STEP * velocity.turn))


def searched(
    flat: Flat, relocation: Relocation, pose: Pose, seconds: float
) -> tuple[list[Pose], bool]:
    """Return the poses that a search leads through, and whether it is over."""
    poses = [pose]
    for number in range(round(seconds / STEP)):
        velocity = relocation.step(STEP * number, poses[-1], flat.scan(poses[-1]).points)
        if relocation.is_over:
            return poses, True
        poses.append(moved(poses[-1], velocity))
    return poses, False


def test_it_turns_and_then_drives_back_the_way_it_came(flat: Flat) -> None:
    track = OdometryTrack()
    for x in np.arange(0.8, 3.4, 0.05).tolist():
        track.add((x, 1.5, 0.0))

    poses, _ = searched(flat, Relocation(track), (3.4, 1.5, 0.0), 45.0)

    turned = sum(abs(math.remainder(b[2] - a[2], math.tau)) for a, b in itertools.pairwise(poses))
    assert turned > math.tau - 0.1
    nearest = min(poses, key=lambda pose: math.dist(pose[:2], (1.4, 1.5)))
    assert math.dist(nearest[:2], (1.4, 1.5)) < 0.2


def test_without_a_way_back_it_goes_where_there_is_room_and_touches_nothing(flat: Flat) -> None:
    poses, is_over = searched(flat, Relocation(OdometryTrack()), (0.6, 0.6, 2.0), 400.0)

    assert is_over
    assert max(math.dist(pose[:2], (0.6, 0.6)) for pose in poses) > 1.0
    assert all(flat.grid.at(flat.grid.free, *pose[:2]) for pose in poses)


def test_it_only_turns_where_the_map_forbids_to_drive_somewhere(flat: Flat) -> None:
    poses, is_over = searched(
        flat, Relocation(OdometryTrack(), may_drive=False), (1.0, 1.0, 0.0), 60.0
    )
    assert is_over
    assert {pose[:2] for pose in poses} == {(1.0, 1.0)}


class Blind:
    """A navigator whose robot was put where nothing fits, until it has gone back some way."""

    def __init__(self, flat: Flat, zones: Zones = NO_ZONES) -> None:
        self.flat = flat
        self.navigator = Navigator({'door': flat.DOOR}, zones=zones)
        self.navigator.set_positions(flat.POSITIONS)
        self.navigator.set_map(flat.grid)
        self.pose: Pose = (1.0, 1.0, 0.0)
        self.now = 0.0
        self.navigator.move(self.pose, self.now)

    def scan(self, fog: bool) -> Any:
        """Return what it sees; else a wall that is farther away than any of the map."""
        seen = self.flat.scan(self.pose)
        if fog:
            seen.ranges[:] = 7.0 + 0.5 * np.sin(3 * (seen.angles + self.pose[2]))
        return seen

    def run(self, seconds: float, *, fog: bool) -> None:
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            velocity = self.navigator.see(self.scan(fog), self.now) or Velocity()
            self.pose = moved(self.pose, velocity)
            self.navigator.move(self.pose, self.now)


def test_a_robot_without_a_task_finds_itself_when_it_is_to(flat: Flat) -> None:
    blind = Blind(flat)
    blind.run(1.0, fog=False)
    blind.run(3.0, fog=True)
    assert blind.navigator.lost
    stood = blind.pose
    blind.run(2.0, fog=True)
    assert blind.pose == stood, 'nobody wants it to move'

    blind.navigator.seeks = True
    blind.run(8.0, fog=True)
    assert blind.pose != stood
    blind.run(3.0, fog=False)
    assert blind.navigator.is_sure


def test_a_drive_that_is_lost_moves_about_and_fails_in_the_end(flat: Flat) -> None:
    blind = Blind(
        flat, Zones(keep_out={'stairs': Zone('stairs', ((5.0, 0.0), (6.0, 0.0), (6.0, 1.0)))})
    )
    blind.run(1.0, fog=False)
    blind.navigator.task = drive = Drive([[1.0, 1.0], [3.0, 1.0]])
    blind.run(3.0, fog=True)
    assert blind.navigator.lost
    blind.run(30.0, fog=True)

    assert drive.state is DriveState.FAILED
    assert 'does not know where it is' in drive.reason
