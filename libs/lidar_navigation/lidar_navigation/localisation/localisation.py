"""Where a robot is on a map, from its odometry and its lidar.

Between scans the estimate moves with the odometry. Each scan then corrects it: the pose is sought
at which the seen points lie on the edges of what the map has occupied, with weights that let go of
points the map cannot explain, and a pull towards the odometry where the scan says nothing, as along
a corridor.

How well a pose explains a scan is measured by casting the rays into the map (`scan_fit`). How large
the part that fits usually is differs between places: all but one in ten rays of a drawn map, fewer
in a furnished one. When it drops below what is usual here, the robot doubts: it may have been
pushed, carried, or slipped; or there only are obstacles that the map does not have. Then it looks
everywhere (`pose_search`), and follows what it finds beside its own pose (`belief`). What is
new refutes no pose, and a pose that nothing refutes is kept. Another one is taken once the odds say
so; until then, and until all that looks alike is ruled out, the robot says that it is not sure.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from floor_plans import Grid
from lidar_navigation.geometry import Pose, Scan, angle_between, composed
from lidar_navigation.localisation.belief import SURE, Belief, told
from lidar_navigation.localisation.odometry import ContinuousOdometry
from lidar_navigation.localisation.pose_search import found_poses
from lidar_navigation.localisation.scan_fit import Evidence, ScanFit


@dataclass(frozen=True)
class LocalisationParameters:
    """How the localiser works.

    What a pose explains is a part of the rays, 0 to 1.

    Attributes:
        rays: Rays of a scan that are matched; of those two of three are cast into the map.
        update_step: A scan is used after this way or turn, metres or rad,
        update_period: or this time, seconds; and always while the robot doubts.
        doubt_below: The robot looks for a better pose when a smaller part of the rays agrees,
        doubt_drop: and less than is usual here by this much.
        doubt_time: How long scans are doubtful before it looks, seconds; one scan is enough when it
            would be lost.
        lost_below: It counts as lost when none is found and a smaller part than this agrees.
        search_pause: Time between two looks while it is lost or in doubt, seconds.
    """

    rays: int = 90
    update_step: float = 0.15
    update_period: float = 0.3
    doubt_below: float = 0.85
    doubt_drop: float = 0.12
    doubt_time: float = 0.2
    lost_below: float = 0.55
    search_pause: float = 1.0

    @property
    def cast_rays(self) -> int:
        """Rays that are cast into the map to measure how well a pose explains a scan."""
        return 2 * self.rays // 3


_USUAL_RISE, _USUAL_FALL = 0.05, 0.02
"""By these parts of a difference the usual agreement rises and falls with a scan."""
_WORSE = 0.1
"""So much less than what is tolerated begins another doubt."""
_NUDGE = 0.2
"""A correction of more than this, metres or rad, may as well be that somebody put the robot into a
place that looks alike."""
_SAME_VIEW = 0.1
"""So much of a scan is new, for each `update_period`, where the robot stands."""
_NEW_VIEW = 0.4
"""Of a robot that goes so far, metres, all that it sees is seen anew."""


class Localiser:
    """Keeps the estimate of a robot's pose on one map.

    Args:
        grid: The map.
        pose: Where the robot is believed to be at first.
        before_search: Called before a search everywhere, which takes up to a second.

    Attributes:
        agreement: The part of the last scan's rays that the estimate explains, 0 to 1.
        lost: Whether the estimate is known to be wrong and no better one is found yet.
        jumps: How often the robot was found somewhere else.
    """

    def __init__(
        self,
        grid: Grid,
        pose: Pose,
        before_search: Callable[[], None] = lambda: None,
    ) -> None:
        self.parameters = LocalisationParameters()
        self._before_search = before_search
        self._belief = Belief(pose)
        self.agreement = 1.0
        self.lost = False
        self.jumps = 0
        self._odometry = ContinuousOdometry()
        self._look_at: float | None = None
        self._tolerated = 1.0
        self._usual = 1.0
        self._shaken = False
        self._verify_at = -math.inf
        self._moved = (0.0, 0.0)
        self._used_at: float | None = None
        self.set_map(grid)

    def set_map(self, grid: Grid) -> None:
        """Replace the map; the estimate stays."""
        self._fit = ScanFit(grid)

    @property
    def grid(self) -> Grid:
        """The map."""
        return self._fit.grid

    @property
    def pose(self) -> Pose:
        """The estimate: x, y in metres, yaw in rad, map frame."""
        return self._belief.pose

    @property
    def plausible(self) -> bool:
        """Whether the estimate is good enough to say which place the robot is in."""
        return not self.lost and self.agreement >= self.parameters.lost_below

    @property
    def certain(self) -> bool:
        """Whether the last scan fitted, so that the estimate is to be trusted."""
        return not self.lost and self._look_at is None

    @property
    def ambiguous(self) -> bool:
        """Whether the robot may as well be elsewhere: nothing rules out a rival, or nobody has
        looked yet whether there is one.
        """
        return self._shaken or bool(self.alike)

    @property
    def alike(self) -> list[Pose]:
        """The other poses that explain about as much as the estimate."""
        return self._belief.alike

    def believe(self, pose: Pose) -> None:
        """Take a pose that somebody gave as the estimate."""
        self._belief.believe(pose)
        self.lost = False
        self._look_at = None
        self._tolerated = 1.0
        self._shaken = False
        self._used_at = None

    def move(self, odometry: Pose, stamp: float | None = None) -> None:
        """Take a new reading of the odometry.

        Args:
            odometry: In the odometry's own frame.
            stamp: Its time, seconds; None: not known.
        """
        step, missed = self._odometry.step(odometry, stamp)
        self._belief.move(step)
        # What was missed counts as driven: the next scan is sought so much farther away.
        way = math.hypot(*step[:2]) + missed[0]
        self._moved = (self._moved[0] + way, self._moved[1] + abs(step[2]) + missed[1])

    def see(self, scan: Scan, now: float) -> bool:
        """Take a scan made where the robot is now: correct the estimate, or look for it.

        Args:
            scan: The scan.
            now: Its time, seconds; never less than that of the scan before.

        Returns:
            Whether the scan was used; one that would tell little new is not.
        """
        p = self.parameters
        if not self._is_due(now):
            return False
        thin = scan.thinned(p.rays)
        information = self._information(thin, now)
        self._used_at = now
        moved, self._moved = self._moved, (0.0, 0.0)
        corrected, evidence = self._corrected(self.pose, thin, moved)
        if evidence.fit < self._enough and evidence.refutes:
            corrected, evidence = self._nudged(corrected, evidence, thin, moved)
        if _is_pushed(self.pose, corrected, moved):
            # Somebody may have put it into another room that looks alike.
            self._shaken = True
        self._belief.pose = corrected
        self._belief.weigh(
            self._likelihood(evidence),
            lambda pose: self._weighed(pose, thin, moved),
            information,
        )
        evidence = self._followed(evidence, thin)
        self._judge(evidence, thin, now)
        return True

    def _information(self, scan: Scan, now: float) -> float:
        """Return how much of a scan is new, 0 to 1.

        A lidar that sees all around sees the same again where its robot turns on the spot.
        """
        if self._used_at is None:
            return 1.0
        unseen = max(0.0, 1.0 - float(np.ptp(scan.angles)) / math.tau) if len(scan.angles) else 0.0
        standing = _SAME_VIEW * (now - self._used_at) / self.parameters.update_period
        way, turn = self._moved
        return min(1.0, max(standing, way / _NEW_VIEW + unseen * turn))

    def _corrected(
        self, pose: Pose, thin: Scan, moved: tuple[float, float]
    ) -> tuple[Pose, Evidence]:
        """Return a pose corrected by a scan, and what that says of it."""
        slack = self.grid.resolution + 0.2 * moved[0] + moved[1]
        pose = self._fit.matched(pose, self._fit.mapped(pose, thin, slack).points, moved)
        return pose, self._fit.evidence(pose, thin.thinned(self.parameters.cast_rays))

    def _weighed(self, pose: Pose, thin: Scan, moved: tuple[float, float]) -> tuple[Pose, float]:
        pose, evidence = self._corrected(pose, thin, moved)
        return pose, self._likelihood(evidence) if self._fit.can_stand(pose) else -math.inf

    def _likelihood(self, evidence: Evidence) -> float:
        """Return how likely a scan is, nats.

        Where no pose was believed before, a wall where the map has a door tells as much as a door
        where it has a wall.
        """
        return evidence.blank_likelihood if self._shaken else evidence.log_likelihood

    def _nudged(
        self, pose: Pose, evidence: Evidence, thin: Scan, moved: tuple[float, float]
    ) -> tuple[Pose, Evidence]:
        """Return a pose close by that is likelier, as after a slip; else the same pose."""
        rays = thin.thinned(self.parameters.cast_rays)
        best, most = (pose, evidence), evidence.log_likelihood
        for turn in (-0.3, -0.15, 0.0, 0.15, 0.3):
            for dx, dy in ((0.0, 0.0), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25)):
                start = composed(pose, (dx, dy, turn))
                tried = self._fit.matched(start, thin.points, (moved[0] + 0.3, moved[1] + 0.3))
                explained = self._fit.evidence(tried, rays)
                likely = explained.log_likelihood + self._belief.prior(tried)
                if likely > most and self._fit.can_stand(tried):
                    best, most = (tried, explained), likely
        return best

    def _followed(self, evidence: Evidence, thin: Scan) -> Evidence:
        """Follow another pose if the odds say so; return what the scan says of the one followed.

        A pose that something new explains is kept, however well another one fits. So is one that
        this scan contradicts less than the other: people all around hide what tells them apart.
        """
        if not (self._shaken or evidence.refutes) or not self._belief.rivals:
            return evidence
        likeliest = self._belief.rivals[0].pose
        there = self._fit.evidence(likeliest, thin.thinned(self.parameters.cast_rays))
        if there.log_likelihood < evidence.log_likelihood:
            return evidence
        # A robot that is unsure goes on from the likeliest pose, unless much is hidden there, as by
        # people all around, and this scan alone does not tell the two poses apart.
        is_told = told(there.log_likelihood - evidence.log_likelihood) >= SURE
        is_plain = is_told or there.fit >= self.parameters.doubt_below
        if not self._belief.follow_best(0.0 if self._shaken and is_plain else SURE):
            return evidence
        self.jumps += 1
        return there

    def _is_due(self, now: float) -> bool:
        p = self.parameters
        return (
            self._used_at is None
            or self.lost
            or self._look_at is not None
            or self._moved[0] >= p.update_step
            or self._moved[1] >= p.update_step
            or now - self._used_at >= p.update_period
        )

    def _judge(self, evidence: Evidence, thin: Scan, now: float) -> None:
        p, enough = self.parameters, self._enough
        self.agreement = agreement = evidence.fit
        if agreement >= enough:
            self._tolerated = 1.0
        if agreement >= max(p.lost_below, min(enough, self._tolerated - _WORSE)):
            self._settle()
            if self._shaken and not self.alike and now >= self._verify_at:
                # What fits again, or is left, may be a place like others that nobody looked at.
                self._verify_at = now + p.search_pause
                self._look(evidence, thin, is_lost=True)
                self._shaken = bool(self.alike)
            return
        if self._look_at is None:
            self._look_at = now + p.doubt_time
        if agreement < p.lost_below and not self.lost:
            # Next to nothing fits: that is no passer-by.
            self._shaken = True
            self._look_at = min(self._look_at, now)
        if now < self._look_at - 1e-9:
            return
        self._look(evidence, thin, is_lost=self.lost)
        before = self.jumps
        evidence = self._followed(evidence, thin)
        self.agreement = evidence.fit
        if self.jumps > before and evidence.fit >= p.lost_below:
            self._settle()
        elif evidence.fit < p.lost_below:
            self.lost = True
            self._look_at = now + p.search_pause
        elif evidence.refutes and self.ambiguous:
            # The next scans decide.
            self._look_at = now + p.search_pause
        else:
            # Nothing explains the scan better: what is seen is not on the map.
            self._tolerated = evidence.fit
            self._settle()

    def _look(self, evidence: Evidence, thin: Scan, *, is_lost: bool) -> None:
        """Look for other poses everywhere.

        Args:
            evidence: What the scan says of the estimate.
            thin: The scan.
            is_lost: Nobody knows where the robot was before.
        """
        self._before_search()
        found = []
        for pose, explained in self.search(thin):
            odds = told(self._likelihood(explained) - self._likelihood(evidence))
            found.append((pose, odds if is_lost else odds + self._belief.prior(pose)))
        self._belief.add(found)

    @property
    def _enough(self) -> float:
        """The part of the rays from which on the estimate is not doubted here."""
        return min(self.parameters.doubt_below, self._usual - self.parameters.doubt_drop)

    def _settle(self) -> None:
        self.lost = False
        self._look_at = None
        rate = _USUAL_RISE if self.agreement > self._usual else _USUAL_FALL
        if self._tolerated < 1.0:
            # A search found nothing better: it is what the place is like.
            rate = 0.2
        self._usual += rate * (self.agreement - self._usual)

    def search(self, scan: Scan) -> list[tuple[Pose, Evidence]]:
        """Return poses anywhere that explain a scan, and its evidence; the likeliest first."""
        return found_poses(self._fit, scan, self.pose)

    def explained(self, pose: Pose, scan: Scan) -> float:
        """Return how well a pose explains a scan, 0 to 1 (`Evidence.fit`)."""
        return self._fit.evidence(pose, scan).fit


def _is_pushed(before: Pose, after: Pose, moved: tuple[float, float]) -> bool:
    """Tell whether more lies between two poses than odometry is wrong over a way and a turn."""
    turned = abs(angle_between(before[2], after[2]))
    way = math.dist(before[:2], after[:2])
    return way > _NUDGE + moved[0] / 2 or turned > _NUDGE + moved[1] / 2
