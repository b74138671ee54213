"""Where a robot is on a map, from its odometry and its lidar.

Between scans the estimate moves with the odometry. Each scan then corrects it: the pose is sought
at which the seen points lie on the edges of what the map has occupied, with weights that let go of
points the map cannot explain, and a pull towards the odometry where the scan says nothing, as along
a corridor.

How well a pose explains a scan is measured by casting the rays into the map (`scan_fit`). How large
the part that fits usually is differs between places: all but one in ten rays of a drawn map, fewer
in a furnished one. When it drops below what is usual here, the robot doubts: it may have been
pushed, carried, or slipped; or there only are obstacles that the map does not have. What is new
refutes no pose, and a pose that nothing refutes is kept. A refuted one is looked for: near where it
was, then everywhere (`pose_search`). A pose nearby that looks the same way and is clearly better is
taken at once: the robot was pushed, or slipped. Any other one is followed first, as a rival.

Rivals are other poses at which the robot may be. They move with the odometry and are corrected by
the same scans, until they explain less, or one of them wins. Rooms look alike: so are poses that
explained about as much as the one that was taken. Only what tells them apart counts, and only
while the robot moves: a robot that stands sees the same again and again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from floor_plans import Grid
from lidar_navigation.geometry import Pose, Scan, angle_between, composed
from lidar_navigation.localisation.odometry import ContinuousOdometry
from lidar_navigation.localisation.pose_search import MOST, NEAR, found_poses
from lidar_navigation.localisation.scan_fit import Evidence, ScanFit


@dataclass(frozen=True)
class LocalisationParameters:
    """How the localiser works.

    What a pose explains is a part of the rays, 0 to 1, and two poses are compared by its
    difference. One difference counts, `better`; what else is compared with is a multiple of it.

    Attributes:
        rays: Rays of a scan that are matched; of those two of three are cast into the map.
        update_step: A scan is used after this way or turn, metres or rad,
        update_period: or this time, seconds; and always while the robot doubts.
        doubt_below: The robot looks for a better pose when a smaller part of the rays agrees,
        doubt_drop: and less than is usual here by this much.
        doubt_time: How long scans are doubtful before it looks, seconds; one scan is enough when it
            would be lost.
        lost_below: It counts as lost when none is found and a smaller part than this agrees.
        lost_pause: Time between two looks while it is lost, seconds.
        better: A pose must explain this much more to be taken instead of another one.
        slip: So far wheels slip, or somebody pushes the robot, metres or rad: a better pose within
            that is taken at once; a farther one is followed first.
        rounds: After so many searches without a winner the present pose is kept.
    """

    rays: int = 90
    update_step: float = 0.15
    update_period: float = 0.3
    doubt_below: float = 0.85
    doubt_drop: float = 0.12
    doubt_time: float = 0.2
    lost_below: float = 0.55
    lost_pause: float = 1.0
    better: float = 0.1
    slip: float = 1.0
    rounds: int = 5

    @property
    def cast_rays(self) -> int:
        """Rays that are cast into the map to measure how well a pose explains a scan."""
        return 2 * self.rays // 3

    @property
    def far_better(self) -> float:
        """How much more a pose far away must explain: that somebody carried the robot is unlikely.
        Likewise what a robot that stands must see of a rival, for it sees the same again and again.
        """
        return 2 * self.better

    @property
    def noise(self) -> float:
        """Of two poses that explain a scan as well the one explains this much more by chance.

        A challenger loses as much with each scan that the present pose explains, too.
        """
        return self.better / 2

    @property
    def rival_wins(self) -> float:
        """A rival that explained so much more, summed over scans, is taken instead,"""
        return 8 * self.better

    @property
    def equal_wins(self) -> float:
        """or this much more, if it was as likely as the present pose."""
        return 3 * self.better

    @property
    def rival_loses(self) -> float:
        """A rival that explained so much less is forgotten."""
        return 5 * self.better


_FORGOTTEN = 0.1
"""This part of the sum of a rival is forgotten with each scan that tells something."""
_STANDING = 0.7
"""Of a robot that stands this part of a difference counts."""
_USUAL_RISE, _USUAL_FALL = 0.05, 0.02
"""By these parts of a difference the usual agreement rises and falls with a scan."""
_NUDGE = 0.2
"""A correction of more than this, metres or rad, may as well be that somebody put the robot into a
place that looks alike."""


@dataclass
class _Rival:
    """Another pose at which the robot may be.

    Attributes:
        pose: The pose.
        lead: By how much it explained more, summed over scans that are slowly forgotten.
        is_equal: Whether it was as likely as the present pose when that was taken; else it
            challenges a pose that was followed all the time.
    """

    pose: Pose
    lead: float = 0.0
    is_equal: bool = True


class Localiser:
    """Keeps the estimate of a robot's pose on one map.

    Args:
        grid: The map.
        pose: Where the robot is believed to be at first.
        before_search: Called before a search everywhere, which takes up to a second.

    Attributes:
        pose: The estimate: x, y in metres, yaw in rad, map frame.
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
        self.pose = pose
        self.agreement = 1.0
        self.lost = False
        self.jumps = 0
        self._odometry = ContinuousOdometry()
        self._look_at: float | None = None
        self._tolerated = 1.0
        self._usual = 1.0
        self._shaken = False
        self._rounds = 0
        self._rivals: list[_Rival] = []
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
    def plausible(self) -> bool:
        """Whether the estimate is good enough to say which place the robot is in."""
        return not self.lost and self.agreement >= self.parameters.lost_below

    @property
    def certain(self) -> bool:
        """Whether the last scan fitted, so that the estimate is to be trusted."""
        return not self.lost and self._look_at is None

    @property
    def ambiguous(self) -> bool:
        """Whether the robot may as well be elsewhere: a rival explains about as much."""
        return bool(self.alike)

    @property
    def alike(self) -> list[Pose]:
        """The other poses that explain about as much as the estimate."""
        least = -self.parameters.rival_loses / 2
        return [rival.pose for rival in self._rivals if rival.lead > least]

    def believe(self, pose: Pose) -> None:
        """Take a pose that somebody gave as the estimate."""
        self.pose = pose
        self.lost = False
        self._look_at = None
        self._tolerated = 1.0
        self._shaken = False
        self._rounds = 0
        self._used_at = None
        self._rivals.clear()

    def move(self, odometry: Pose, stamp: float | None = None) -> None:
        """Take a new reading of the odometry.

        Args:
            odometry: In the odometry's own frame.
            stamp: Its time, seconds; None: not known.
        """
        step, missed = self._odometry.step(odometry, stamp)
        self.pose = composed(self.pose, step)
        for rival in self._rivals:
            rival.pose = composed(rival.pose, step)
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
        self._used_at = now
        thin = scan.thinned(p.rays)
        moved, self._moved = self._moved, (0.0, 0.0)
        slack = self.grid.resolution + 0.2 * moved[0] + moved[1]
        corrected = self._fit.matched(
            self.pose, self._fit.mapped(self.pose, thin, slack).points, moved
        )
        rays = thin.thinned(p.cast_rays)
        evidence = self._fit.evidence(corrected, rays)
        agreement = evidence.fit
        if agreement < self._enough:
            before = corrected
            corrected, evidence = self._nudged(corrected, evidence, thin, moved)
            agreement = evidence.fit
            way, turn = math.dist(before[:2], corrected[:2]), angle_between(before[2], corrected[2])
            if way > _NUDGE or abs(turn) > _NUDGE:
                # Somebody may have put it into another room that looks alike.
                self._shaken = True
        winner = self._weighed(corrected, evidence, thin, moved)
        if winner is not None:
            self.jumps += 1
            corrected, evidence = winner
            # Also where it does not explain enough to be sure of.
            self.pose = corrected
        self._judge(corrected, evidence, thin, now)
        return True

    def _nudged(
        self, pose: Pose, evidence: Evidence, thin: Scan, moved: tuple[float, float]
    ) -> tuple[Pose, Evidence]:
        """Return a pose close by that explains more, as after a slip; else the same pose."""
        rays = thin.thinned(self.parameters.cast_rays)
        best, more = (pose, evidence), self.parameters.better
        for turn in (-0.3, -0.15, 0.0, 0.15, 0.3):
            for dx, dy in ((0.0, 0.0), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25)):
                start = composed(pose, (dx, dy, turn))
                tried = self._fit.matched(start, thin.points, (moved[0] + 0.3, moved[1] + 0.3))
                explained = self._fit.evidence(tried, rays)
                if explained.fit > best[1].fit + more and self._fit.can_stand(tried):
                    best, more = (tried, explained), 0.0
        return best

    def _weighed(
        self, present: Pose, evidence: Evidence, thin: Scan, moved: tuple[float, float]
    ) -> tuple[Pose, Evidence] | None:
        """Correct the rivals by a scan; return the one that wins over the present pose, if any."""
        p = self.parameters
        best: tuple[_Rival, Evidence] | None = None
        moves = moved[0] >= p.update_step / 2 or moved[1] >= p.update_step / 2
        # What is new may explain all that speaks against it.
        plausible = evidence.fit >= self._enough or not evidence.refutes
        for rival in self._rivals:
            rival.pose = self._fit.matched(rival.pose, thin.points, moved)
            explained = self._fit.evidence(rival.pose, thin.thinned(p.cast_rays))
            more = explained.fit - evidence.fit
            if rival.is_equal:
                # Neither was believed before: a wall where the map has a door tells them apart.
                more = explained.hit - evidence.hit
            if moves:
                # What tells nothing makes nothing forgotten, either.
                if abs(more) > p.noise:
                    rival.lead += more - _FORGOTTEN * rival.lead
                if plausible and not rival.is_equal:
                    rival.lead -= p.noise
            elif abs(more) >= p.far_better:
                rival.lead += _STANDING * more - _FORGOTTEN * rival.lead
            if not self._fit.can_stand(rival.pose) or self._same(rival.pose, present):
                rival.lead = -math.inf
            elif (
                (rival.is_equal or not plausible)
                and rival.lead >= (p.equal_wins if rival.is_equal else p.rival_wins)
                and (best is None or rival.lead > best[0].lead)
            ):
                best = rival, explained
        self._rivals = [each for each in self._rivals if each.lead > -p.rival_loses]
        if best is None:
            return None
        winner, explained = best
        # Those that were found before it lose its lead. Those found since, and the pose that is
        # left, stay as likely as they were: where rooms look alike, that is quicker (of 60 carried
        # robots 55 were found within 90 s, 52 where all lost it, half of them twice as late).
        place = self._rivals.index(winner)
        for rival in self._rivals[:place]:
            rival.lead -= winner.lead
        self._rivals[place:] = [*self._rivals[place + 1 :], _Rival(present, 0.0)]
        return winner.pose, explained

    @staticmethod
    def _same(first: Pose, second: Pose) -> bool:
        turned = abs(angle_between(first[2], second[2]))
        return math.dist(first[:2], second[:2]) < 0.5 and turned < 0.5

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

    def _judge(self, corrected: Pose, evidence: Evidence, thin: Scan, now: float) -> None:
        p, agreement = self.parameters, evidence.fit
        enough = self._enough
        if agreement >= enough:
            self._tolerated = 1.0
        if agreement >= max(p.lost_below, min(enough, self._tolerated - p.better)):
            self._settle(corrected, agreement)
            if self._shaken and agreement >= enough:
                # What fits again may be another place that looks alike.
                self._shaken = False
                self._before_search()
                self._rivals = self._alike([(corrected, evidence), *self.search(thin)])
            return
        self.agreement = agreement
        if self._look_at is None:
            self._look_at = now + p.doubt_time
        if agreement < p.lost_below and not self.lost:
            # Next to nothing fits: that is no passer-by.
            self._shaken = True
            self._look_at = min(self._look_at, now)
        if now < self._look_at - 1e-9:
            return
        if self._follows_better and self._rounds < p.rounds:
            # The next scans decide.
            self._rounds += 1
            return
        self._before_search()
        candidates = self.search(thin)
        # A pose that something new explains is kept, however well another one fits.
        found = candidates[0] if candidates and evidence.refutes else None
        if (
            found is not None
            and self._is_near(found[0])
            and found[1].fit >= max(p.lost_below, agreement + p.better)
        ):
            self.jumps += 1
            self._settle(found[0], found[1].fit)
            self._shaken = False
            # Somebody may only have stood in the way: where it was until now stays likely.
            self._rivals = [_Rival(corrected, agreement - found[1].fit), *self._alike(candidates)]
        elif found is not None and self._follow(candidates, agreement) and self._rounds < p.rounds:
            self._rounds += 1
        elif agreement >= p.lost_below:
            # Nothing explains the scan better: what is seen is not on the map.
            self._tolerated = agreement
            self._settle(corrected, agreement)
        else:
            self.lost = True
            self._look_at = now + p.lost_pause

    @property
    def _enough(self) -> float:
        """The part of the rays from which on the estimate is not doubted here."""
        return min(self.parameters.doubt_below, self._usual - self.parameters.doubt_drop)

    def _is_near(self, pose: Pose) -> bool:
        """Tell whether a push or a slip may have brought the robot there."""
        p = self.parameters
        turned = abs(angle_between(self.pose[2], pose[2]))
        return math.dist(pose[:2], self.pose[:2]) <= p.slip and turned <= 0.8 * p.slip

    def _needed(self, pose: Pose) -> float:
        """Return how much more a pose must explain to be followed."""
        p = self.parameters
        return p.better if math.dist(pose[:2], self.pose[:2]) <= NEAR else p.far_better

    @property
    def _follows_better(self) -> bool:
        """Whether a rival leads."""
        return any(rival.lead > 0.0 for rival in self._rivals)

    def _follow(self, candidates: list[tuple[Pose, Evidence]], agreement: float) -> bool:
        """Follow poses far away, or turned, that explain much more; tell whether there are any."""
        p = self.parameters
        better = [
            explained.fit
            for pose, explained in candidates
            if explained.fit >= max(p.lost_below, agreement + self._needed(pose))
        ]
        if not better:
            return False
        # With it those that look alike, wherever they are.
        alike = [each for each in candidates if each[1].fit >= max(better) - p.better / 2]
        known = [rival.pose for rival in self._rivals]
        for pose, explained in alike[:MOST]:
            if not any(self._same(pose, other) for other in known):
                known.append(pose)
                self._rivals.append(_Rival(pose, (explained.fit - agreement) / 3, is_equal=False))
        return True

    def _settle(self, pose: Pose, agreement: float) -> None:
        self.pose, self.agreement = pose, agreement
        self.lost = False
        self._look_at = None
        self._rounds = 0
        rate = _USUAL_RISE if agreement > self._usual else _USUAL_FALL
        if self._tolerated < 1.0:
            # A search found nothing better: it is what the place is like.
            rate = 0.2
        self._usual += rate * (agreement - self._usual)

    def _alike(self, candidates: list[tuple[Pose, Evidence]]) -> list[_Rival]:
        """Return the candidates that explain about as much as the first."""
        p = self.parameters
        taken: list[Pose] = [candidates[0][0]]
        for pose, explained in candidates[1:]:
            good = explained.hit >= max(candidates[0][1].hit - p.better, p.lost_below)
            if good and not any(self._same(pose, other) for other in taken):
                taken.append(pose)
        return [_Rival(pose) for pose in taken[1 : MOST + 1]]

    def search(self, scan: Scan) -> list[tuple[Pose, Evidence]]:
        """Return poses anywhere that explain a scan, and its evidence; the likeliest first."""
        return found_poses(self._fit, scan, self.pose)

    def explained(self, pose: Pose, scan: Scan) -> float:
        """Return how well a pose explains a scan, 0 to 1 (`Evidence.fit`)."""
        return self._fit.evidence(pose, scan).fit
