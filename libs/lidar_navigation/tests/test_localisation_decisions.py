"""What a localiser decides, scan by scan, where a test says how much each pose explains."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from floor_plans import Grid
from lidar_navigation import Localiser
from lidar_navigation.geometry import Pose, Scan
from lidar_navigation.localisation.belief import Belief, Rival
from lidar_navigation.localisation.pose_search import _apart, _overlap
from lidar_navigation.localisation.scan_fit import Evidence

HERE = (5.0, 5.0, 0.0)
CLOSE = (5.6, 5.0, 0.0)
"""Where a push may bring the robot."""
APART = (5.0, 7.0, 0.0)
"""Too far for a push, within the first search."""
FAR = (15.0, 15.0, 0.0)
SCAN = Scan(np.zeros(60), np.ones(60), 8.0)


class Told(Localiser):
    """A localiser whose scans explain and whose searches find what a test says."""

    def __init__(self, pose: Pose = HERE) -> None:
        self.worth: Callable[[Pose], float] = lambda pose: 1.0
        self.finds: list[tuple[Pose, float]] = []
        self.searches = self.warnings = 0
        super().__init__(Grid(np.zeros((40, 40), np.int8), 0.5, (0.0, 0.0)), pose, self._warn)
        self.refutes = True
        fit: Any = self._fit
        fit.matched = lambda pose, points, moved: pose
        fit.evidence = lambda pose, scan: self._told(self.worth(pose))

    def _warn(self) -> None:
        self.warnings += 1

    def search(self, scan: Scan) -> list[tuple[Pose, Any]]:
        """Return what the test says."""
        self.searches += 1
        return [(pose, self._told(share)) for pose, share in self.finds]

    def _told(self, share: float) -> Any:
        likelihood = -24.0 * (1.0 - share)
        return SimpleNamespace(
            fit=share,
            hit=share,
            refutes=self.refutes,
            log_likelihood=likelihood,
            blank_likelihood=likelihood,
        )

    def agrees(self, share: float, now: float) -> None:
        """See a scan of which every pose explains so much."""
        self.worth = lambda pose: share
        self.see(SCAN, now)

    @property
    def state(self) -> tuple[bool, bool, bool]:
        """Whether it is certain, plausible, lost."""
        return self.certain, self.plausible, self.lost


@pytest.mark.parametrize(
    ('share', 'state', 'searches'),
    [
        (1.0, (True, True, False), 0),
        (0.85, (True, True, False), 0),
        (0.849, (False, True, False), 0),
        (0.55, (False, True, False), 0),
        (0.549, (False, False, True), 1),
        (0.0, (False, False, True), 1),
    ],
)
def test_a_first_scan_is_believed_doubted_or_says_that_the_robot_is_lost(
    share: float, state: tuple[bool, bool, bool], searches: int
) -> None:
    localiser = Told()
    localiser.agrees(share, 0.0)
    assert localiser.state == state
    assert (localiser.searches, localiser.warnings) == (searches, searches)
    assert localiser.agreement == share
    assert localiser.pose == HERE
    assert localiser.jumps == 0


def test_what_is_usual_follows_what_is_seen_slowly_up_and_more_slowly_down() -> None:
    localiser = Told()
    assert localiser._enough == pytest.approx(0.85)
    localiser._usual = 0.9
    assert localiser._enough == pytest.approx(0.78)
    localiser.agrees(0.8, 0.0)
    assert localiser._usual == pytest.approx(0.9 - 0.02 * 0.1)
    localiser.agrees(0.998, 1.0)
    assert localiser._usual == pytest.approx(0.898 + 0.05 * 0.1)


def test_doubtful_scans_are_looked_into_after_a_while_and_what_is_no_better_is_borne() -> None:
    localiser = Told()
    localiser.finds = [(CLOSE, 0.71)]
    for now, searches in ((0.0, 0), (0.1, 0), (0.199, 0)):
        localiser.agrees(0.7, now)
        assert (localiser.searches, localiser.certain) == (searches, False)
    localiser.agrees(0.7, 0.2)
    assert localiser.searches == 1
    assert localiser.state == (True, True, False)
    assert localiser.pose == HERE
    # What a place is like is learnt faster: 1.0, and a fifth of the way to 0.7.
    assert localiser._usual == pytest.approx(0.94)
    for step, share in enumerate((0.7, 0.61)):
        localiser.agrees(share, 1.0 + step)
        assert localiser.certain
    localiser.agrees(0.59, 5.0)
    assert not localiser.certain
    localiser.agrees(0.9, 6.0)
    assert localiser.certain
    localiser.agrees(0.7, 7.0)
    assert not localiser.certain, 'a scan that fits ends what is borne'


def test_a_lost_robot_searches_once_a_second_and_is_found_where_much_fits() -> None:
    localiser = Told()
    localiser.finds = [(CLOSE, 0.3)]
    for now, searches in ((0.0, 1), (0.1, 1), (0.9, 1), (1.0, 2), (1.9, 2), (2.0, 3)):
        localiser.agrees(0.3, now)
        assert localiser.searches == searches
        assert localiser.lost
    localiser.worth = lambda pose: 0.96 if pose == CLOSE else 0.3
    localiser.finds = [(CLOSE, 0.96)]
    localiser.see(SCAN, 3.0)
    assert (localiser.pose, localiser.lost, localiser.jumps) == (CLOSE, False, 1)
    assert localiser.state == (True, True, False)
    assert localiser.ambiguous, 'one scan is not enough'
    localiser.see(SCAN, 3.5)
    assert (localiser.searches, localiser.ambiguous) == (4, False), 'it looked for others'


def test_a_lost_robot_that_fits_in_two_places_is_not_sure_until_one_is_ruled_out() -> None:
    localiser = Told()
    localiser.agrees(0.3, 0.0)
    assert localiser.lost
    localiser.worth = lambda pose: 0.9 if math.dist(pose[:2], HERE[:2]) > 1.0 else 0.3
    localiser.finds = [(FAR, 0.92), (APART, 0.9)]
    localiser.see(SCAN, 1.0)
    assert localiser.pose == FAR
    assert (localiser.lost, localiser.alike) == (False, [APART])
    for step in range(2, 12):
        moved(localiser, 0.0)
        localiser.see(SCAN, float(step))
        assert localiser.ambiguous, 'neither explains more'
    localiser.worth = lambda pose: 0.9 if pose[0] > 10.0 else 0.7
    localiser.finds = []
    for step in range(12, 20):
        moved(localiser, 0.2)
        localiser.see(SCAN, float(step))
    assert localiser.pose[0] > 10.0
    assert not localiser.ambiguous


def moved(localiser: Told, way: float, turn: float = 0.0) -> None:
    localiser.move((0.0, 0.0, 0.0))
    localiser.move((way, 0.0, turn))


def test_before_one_that_a_robot_was_carried_to_is_taken_the_robot_says_that_it_is_not_sure() -> (
    None
):
    localiser = Told()
    localiser.finds = [(FAR, 0.9)]
    localiser.worth = lambda pose: 0.9 if pose[0] > 10.0 else 0.7
    doubts = []
    for step in range(30):
        moved(localiser, 0.05)
        localiser.see(SCAN, 0.3 * step)
        if localiser.jumps:
            break
        doubts.append(localiser.ambiguous)
    assert localiser.jumps == 1
    assert not doubts[0]
    assert doubts[-1]


def test_a_robot_that_stands_is_told_little_by_seeing_the_same_again() -> None:
    standing, moving = Told(), Told()
    for localiser in (standing, moving):
        localiser._belief.rivals.append(Rival(FAR, -4.0))
        localiser.worth = lambda pose: 0.95 if pose[0] > 10.0 else 0.9
        for step in range(1, 5):
            moved(localiser, 0.0 if localiser is standing else 0.2)
            localiser.see(SCAN, 0.3 * step)
    assert standing._belief.rivals[0].odds < -3.0 < moving._belief.rivals[0].odds


def test_a_slip_is_mended_by_a_pose_close_by_that_explains_more() -> None:
    localiser = Told()
    # A quarter of a metre ahead, turned by 0.15, is best.
    best = (5.25, 5.0, 0.15)
    localiser.worth = lambda pose: 1.0 - min(1.0, 0.9 * math.dist(pose, best))
    localiser.see(SCAN, 0.0)
    assert localiser.pose == pytest.approx(best)
    assert localiser.certain
    assert localiser.jumps == 0
    assert localiser.searches == 1, 'moved so far, it may be in a place that looks alike'
    chance = Told()
    chance.worth = lambda pose: 0.81 if pose[2] == 0.15 else 0.8
    chance.see(SCAN, 0.0)
    assert chance.pose == HERE, 'so little more is chance'


def test_a_slip_is_not_mended_into_a_wall() -> None:
    localiser = Told((0.2, 5.0, 0.0))
    localiser.worth = lambda pose: 1.0 if pose[0] < 0.0 else 0.8
    localiser.see(SCAN, 0.0)
    assert localiser.pose == (0.2, 5.0, 0.0)


def test_a_scan_is_used_when_the_robot_has_gone_on_or_some_time_has_passed() -> None:
    localiser = Told()
    assert localiser.see(SCAN, 0.0)
    assert not localiser.see(SCAN, 0.29)
    assert localiser.see(SCAN, 0.3)
    localiser.move((0.0, 0.0, 0.0))
    localiser.move((0.1, 0.0, 0.0))
    assert not localiser.see(SCAN, 0.31)
    localiser.move((0.1, 0.051, 0.0))
    assert localiser.see(SCAN, 0.32), 'the way counts, not how far it is away'
    localiser.move((0.1, 0.051, 0.1))
    assert not localiser.see(SCAN, 0.33)
    localiser.move((0.1, 0.051, 0.04))
    assert localiser.see(SCAN, 0.34), 'turns to and fro count'
    localiser.believe(FAR)
    assert localiser.see(SCAN, 0.35)


def test_a_pose_that_is_told_ends_all_doubt() -> None:
    localiser = Told()
    localiser._belief.rivals.append(Rival(APART))
    localiser.agrees(0.3, 0.0)
    localiser.believe(FAR)
    assert localiser.pose == FAR
    assert not localiser.lost
    assert localiser._look_at is None
    assert localiser.alike == []
    localiser.agrees(0.9, 0.1)
    assert localiser.searches == 1, 'it does not look for places that look alike'


@pytest.mark.parametrize(
    ('shift', 'count', 'image', 'expected'),
    [
        (0, 5, 5, ((0, 5), (0, 5))),
        (2, 5, 5, ((0, 3), (2, 5))),
        (-2, 5, 5, ((2, 5), (0, 3))),
        (1, 5, 4, ((0, 3), (1, 4))),
        (7, 5, 5, ((0, 0), (7, 7))),
        (-7, 5, 5, ((7, 7), (0, 0))),
        (-1, 3, 9, ((1, 3), (0, 2))),
    ],
)
def test_what_a_shifted_image_covers(
    shift: int, count: int, image: int, expected: tuple[tuple[int, int], tuple[int, int]]
) -> None:
    cells, of_image = _overlap(shift, count, image)
    assert ((cells.start, cells.stop), (of_image.start, of_image.stop)) == expected


def test_poses_that_are_nearly_the_same_are_tried_once() -> None:
    poses = np.array(
        [
            (0, 0, 0),
            (0.3, 0.3, 0.3),
            (0.5, 0, 0),
            (0.51, 0, 0),
            (0, 0, 0.4),
            (0, 0, 0.41),
            (3, 0, 0),
        ]
    )
    taken = [(0, 0, 0), (0.51, 0, 0), (0, 0, 0.41)]
    assert _apart(poses, 3, 0.5) == taken
    assert _apart(poses, 9, 0.5) == [*taken, (3, 0, 0)]
    assert _apart(poses[:0], 3, 0.5) == []
    assert _apart(np.array([(0, 0, 3.1), (0, 0, -3.1)]), 3, 0.5) == [(0, 0, 3.1)]


@pytest.mark.parametrize('refutes', [False, True])
def test_a_pose_that_something_new_explains_is_kept_however_well_another_fits(
    refutes: bool,
) -> None:
    localiser = Told()
    localiser.refutes = refutes
    localiser.finds = [(FAR, 0.97)]
    localiser.worth = lambda pose: 0.97 if pose[0] > 10.0 else 0.6
    for step in range(20):
        localiser.move((0.1 * (step % 2), 0.0, 0.0))
        localiser.see(SCAN, 0.2 * step)
    assert (localiser.jumps > 0) is refutes


def test_people_all_around_move_nobody_to_a_pose_from_which_rays_go_through_walls() -> None:
    localiser: Any = Told()
    people, through_walls = Evidence(0.15, 0.75, 0.1), Evidence(0.4, 0.1, 0.5)
    localiser._fit.evidence = lambda pose, scan: through_walls if pose[0] > 10.0 else people
    localiser.search = lambda scan: [(FAR, through_walls)]
    for step in range(20):
        moved(localiser, 0.1)
        localiser.see(SCAN, 0.2 * step)
    assert localiser.jumps == 0
    assert localiser.lost


def test_a_rival_that_is_as_likely_as_the_pose_is_not_followed() -> None:
    belief = Belief(HERE)
    belief.add([(CLOSE, 0.0), (FAR, 0.0)])
    assert not belief.follow_best(0.0)
    assert belief.pose == HERE


@pytest.mark.parametrize(
    ('usual', 'here', 'there', 'odds', 'pose'),
    [
        (1.0, 0.93, 0.95, 0.3, FAR),
        (1.0, 0.6, 0.62, 1.0, HERE),
        (1.0, 0.6, 0.62, 3.1, FAR),
        (0.7, 0.6, 0.68, 1.0, HERE),
        (1.0, 0.1, 0.78, 0.1, FAR),
    ],
    ids=[
        'as usual',
        'among people',
        'among people, beyond doubt',
        'among people for long',
        'furnished, told by this scan',
    ],
)
def test_an_unsure_robot_goes_on_from_the_likeliest_pose_unless_people_hide_what_tells(
    usual: float, here: float, there: float, odds: float, pose: Pose
) -> None:
    localiser = Told()
    localiser._shaken = True
    localiser._usual = usual
    localiser._belief.rivals = [Rival(FAR, odds)]
    localiser.worth = lambda pose: {HERE: here, FAR: there}.get(pose, 0.0)
    localiser.see(SCAN, 0.0)
    assert localiser.pose == pose
    assert localiser.ambiguous
