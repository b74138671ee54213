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
from lidar_navigation.localisation import localisation
from lidar_navigation.localisation.localisation import _Rival
from lidar_navigation.localisation.pose_search import _apart, _overlap

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
        return SimpleNamespace(fit=share, hit=share, refutes=self.refutes)

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
    localiser.finds = [(CLOSE, 0.79)]
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


def test_a_better_pose_that_a_push_explains_is_taken_at_once() -> None:
    localiser = Told()
    localiser.finds = [(CLOSE, 0.8), (FAR, 0.75), (APART, 0.69), ((5.7, 5.1, 0.1), 0.8)]
    localiser.agrees(0.7, 0.0)
    localiser.agrees(0.7, 0.2)
    assert localiser.pose == CLOSE
    assert (localiser.jumps, localiser.agreement) == (1, 0.8)
    assert localiser.certain
    # Where it was, and what explains about as much and is not the same place.
    assert [(each.pose, each.is_equal) for each in localiser._rivals] == [(HERE, True), (FAR, True)]
    assert [each.lead for each in localiser._rivals] == pytest.approx([-0.1, 0.0])
    assert localiser.alike == [HERE, FAR]
    assert localiser.ambiguous


@pytest.mark.parametrize(
    ('pose', 'explained', 'taken'),
    [
        ((5.99, 5.0, 0.79), 0.81, True),
        ((5.0, 3.99, 0.0), 0.95, False),
        ((5.5, 5.0, 0.81), 0.95, False),
        ((5.5, 5.0, 0.0), 0.79, False),
    ],
)
def test_what_counts_as_a_push(pose: Pose, explained: float, taken: bool) -> None:
    localiser = Told()
    localiser.finds = [(pose, explained)]
    localiser.agrees(0.7, 0.0)
    localiser.agrees(0.7, 0.2)
    assert (localiser.pose == pose) is taken
    assert localiser.jumps == int(taken)


@pytest.mark.parametrize(
    ('pose', 'explained', 'followed'),
    [
        (APART, 0.81, True),
        (APART, 0.79, False),
        ((5.0, 7.49, 0.0), 0.81, True),
        ((5.0, 7.51, 0.0), 0.81, False),
        (FAR, 0.91, True),
        (FAR, 0.89, False),
    ],
)
def test_a_pose_farther_away_is_followed_when_it_explains_much_more(
    pose: Pose, explained: float, followed: bool
) -> None:
    localiser = Told()
    localiser.finds = [(pose, explained)]
    localiser.agrees(0.7, 0.0)
    localiser.agrees(0.7, 0.2)
    assert localiser.pose == HERE
    assert localiser.certain is not followed
    rivals = [(each.pose, each.is_equal) for each in localiser._rivals]
    assert rivals == ([(pose, False)] if followed else [])
    if followed:
        assert localiser._rivals[0].lead == pytest.approx((explained - 0.7) / 3)


def test_with_a_pose_that_is_followed_go_those_that_look_alike_but_no_more_than_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    localiser = Told()
    others = [((2.0 * number + 1.0, 19.0, 0.0), 0.91) for number in range(9)]
    localiser.finds = [
        (FAR, 0.95),
        ((15.3, 15.0, 0.3), 0.95),
        *others,
        ((1.0, 17.0, 0.0), 0.89),
    ]
    localiser.agrees(0.7, 0.0)
    localiser.agrees(0.7, 0.2)
    assert [each.pose for each in localiser._rivals] == [FAR, *(pose for pose, _ in others)]
    monkeypatch.setattr(localisation, 'MOST', 3)
    few = Told()
    few.finds = list(localiser.finds)
    few.agrees(0.7, 0.0)
    few.agrees(0.7, 0.2)
    assert [each.pose for each in few._rivals] == [FAR, others[0][0]]


def test_after_some_searches_without_a_winner_the_pose_is_kept() -> None:
    localiser = Told()
    localiser.finds = [(FAR, 0.95)]
    localiser.worth = lambda pose: 0.7
    now, rounds = 0.0, 0
    localiser.see(SCAN, now)
    while not localiser.certain:
        now += 0.2
        localiser._rivals.clear()
        localiser.see(SCAN, now)
        rounds += 1
        assert rounds < 20
    assert rounds == localiser.parameters.rounds + 1
    assert localiser.searches == rounds
    assert (localiser.pose, localiser.jumps) == (HERE, 0)


def test_while_a_rival_leads_nothing_is_searched_for_some_scans() -> None:
    localiser = Told()
    localiser._rivals.append(_Rival(FAR, 0.3, is_equal=False))
    localiser.worth = lambda pose: 0.7
    for step in range(7):
        localiser.see(SCAN, 0.2 * step)
    assert localiser.searches == 1
    localiser = Told()
    localiser._rivals.append(_Rival(FAR, 0.0, is_equal=False))
    localiser.worth = lambda pose: 0.7
    localiser.see(SCAN, 0.0)
    localiser.see(SCAN, 0.2)
    assert localiser.searches == 1, 'one that does not lead holds up nothing'


def test_a_lost_robot_searches_once_a_second_and_is_found_where_much_fits() -> None:
    localiser = Told()
    localiser.finds = [(CLOSE, 0.5)]
    for now, searches in ((0.0, 1), (0.1, 1), (0.9, 1), (1.0, 2), (1.9, 2), (2.0, 3)):
        localiser.agrees(0.3, now)
        assert localiser.searches == searches
        assert localiser.lost
    localiser.finds = [(CLOSE, 0.56)]
    localiser.agrees(0.3, 3.0)
    assert (localiser.pose, localiser.lost, localiser.jumps) == (CLOSE, False, 1)
    assert localiser.state == (True, True, False)


def test_a_robot_that_fits_again_after_nothing_fitted_looks_whether_places_look_alike() -> None:
    localiser = Told()
    localiser.agrees(0.3, 0.0)
    assert localiser.lost
    localiser.finds = [(CLOSE, 0.9), (FAR, 0.86), ((1.0, 1.0, 0.0), 0.79)]
    localiser.agrees(0.9, 0.1)
    assert not localiser.lost
    assert localiser.searches == localiser.warnings == 2
    assert localiser.alike == [CLOSE, FAR]
    localiser.agrees(0.9, 1.0)
    assert localiser.searches == 2, 'once'


def moved(localiser: Told, way: float, turn: float = 0.0) -> None:
    localiser.move((0.0, 0.0, 0.0))
    localiser.move((way, 0.0, turn))


@pytest.mark.parametrize(
    ('way', 'turn', 'present', 'rival', 'equal', 'lead'),
    [
        # It moves: the difference counts, and a tenth of the sum is forgotten.
        (0.08, 0.0, 0.9, 1.0, True, 0.2 - 0.02 + 0.1),
        (0.0, 0.08, 0.9, 1.0, True, 0.2 - 0.02 + 0.1),
        (0.08, 0.0, 1.0, 0.9, True, 0.2 - 0.02 - 0.1),
        # What may be chance changes nothing.
        (0.08, 0.0, 0.9, 0.949, True, 0.2),
        # A challenger pays with each scan that the present pose explains.
        (0.08, 0.0, 0.9, 1.0, False, 0.2 - 0.02 + 0.1 - 0.05),
        (0.08, 0.0, 0.8, 0.9, False, 0.2 - 0.02 + 0.1),
        # It stands: only much counts, and less.
        (0.07, 0.07, 0.9, 1.0, True, 0.2),
        (0.0, 0.0, 0.75, 1.0, False, 0.2 - 0.02 + 0.7 * 0.25),
        (0.0, 0.0, 1.0, 0.75, True, 0.2 - 0.02 - 0.7 * 0.25),
    ],
)
def test_what_a_scan_says_of_a_rival_is_summed(
    way: float, turn: float, present: float, rival: float, equal: bool, lead: float
) -> None:
    localiser = Told()
    localiser._rivals.append(_Rival(FAR, 0.2, is_equal=equal))
    localiser.worth = lambda pose: rival if pose[0] > 10.0 else present
    moved(localiser, way, turn)
    localiser.see(SCAN, 0.0)
    assert [each.lead for each in localiser._rivals] == pytest.approx([lead])
    assert localiser._rivals[0].pose == pytest.approx((15.0 + way, 15.0, turn))
    assert localiser.pose == pytest.approx((5.0 + way, 5.0, turn))


def test_the_rival_that_leads_most_wins_and_the_present_pose_becomes_a_rival() -> None:
    localiser = Told()
    second = (2.0, 18.0, 0.0)
    localiser._rivals += [_Rival(FAR, 0.31), _Rival(second, 0.35), _Rival((18.0, 2.0, 0.0), -0.2)]
    localiser.worth = lambda pose: 0.9
    localiser.see(SCAN, 0.0)
    assert (localiser.pose, localiser.jumps) == (second, 1)
    assert [each.pose for each in localiser._rivals] == [FAR, (18.0, 2.0, 0.0), HERE]
    assert [each.lead for each in localiser._rivals] == pytest.approx([-0.04, -0.2, 0.0])
    assert all(each.is_equal for each in localiser._rivals)


@pytest.mark.parametrize(
    ('lead', 'equal', 'present', 'wins'),
    [
        (0.301, True, 0.9, True),
        (0.29, True, 0.9, False),
        (0.8, False, 0.7, True),
        (0.79, False, 0.7, False),
        (0.9, False, 0.9, False),
    ],
)
def test_a_rival_wins_with_a_lead_that_depends_on_how_likely_it_was(
    lead: float, equal: bool, present: float, wins: bool
) -> None:
    localiser = Told()
    localiser._rivals.append(_Rival(FAR, lead, is_equal=equal))
    localiser.worth = lambda pose: present
    localiser.see(SCAN, 0.0)
    assert localiser.jumps == int(wins)
    assert localiser.pose == (FAR if wins else HERE)
    assert [each.pose for each in localiser._rivals] == [HERE if wins else FAR]
    assert localiser.certain is (present >= 0.85)


def test_rivals_end_that_lose_or_stand_in_a_wall_or_where_the_robot_is() -> None:
    localiser = Told()
    outside, same, beside = (25.0, 5.0, 0.0), (5.4, 5.0, 0.4), (5.4, 5.0, 0.6)
    farther = (5.0, 5.6, 0.0)
    ends = [(outside, 0.2), (same, 0.2), (beside, 0.2), (farther, 0.2), (FAR, -0.5)]
    stays = (2.0, 18.0, 0.0), -0.49
    localiser._rivals += [_Rival(pose, lead) for pose, lead in (*ends, stays)]
    localiser.worth = lambda pose: 0.9
    localiser.see(SCAN, 0.0)
    assert [each.pose for each in localiser._rivals] == [beside, farther, stays[0]]
    assert localiser.alike == [beside, farther]
    localiser._rivals = [_Rival(FAR, -0.24), _Rival(stays[0], -0.26)]
    assert localiser.alike == [FAR]


def test_a_slip_is_mended_by_a_pose_close_by_that_explains_more() -> None:
    localiser = Told()
    # A quarter of a metre ahead, turned by 0.15, is best; less turned it is nearly as good.
    best = (5.25, 5.0, 0.15)
    localiser.worth = lambda pose: 1.0 - min(1.0, 0.9 * math.dist(pose, best))
    localiser.see(SCAN, 0.0)
    assert localiser.pose == pytest.approx(best)
    assert localiser.certain
    assert localiser.jumps == 0
    assert localiser.searches == 1, 'moved so far, it may be in a place that looks alike'
    little = Told()
    little.worth = lambda pose: 0.95 if pose[2] == 0.15 else 0.8
    little.see(SCAN, 0.0)
    assert little.pose == (5.0, 5.0, 0.15)
    assert little.searches == 0
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
    localiser._rivals.append(_Rival(APART))
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
