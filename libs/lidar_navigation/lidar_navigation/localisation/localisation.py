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
from lidar_navigation.localisation.pose_search import found_poses
from lidar_navigation.localisation.scan_fit import Evidence, ScanFit


@dataclass(frozen=True)
class LocalisationParameters:
    """How the localiser works.

    Attributes:
        rays: Rays of a scan that are matched.
        cast_rays: Rays that are cast into the map to measure how well a pose explains a scan.
        update_distance: A scan is used after this way, metres,
        update_turn: or this turn, rad,
        update_period: or this time, seconds; and always while the robot doubts.
        doubt_below: The robot looks for a better pose when a smaller part of the rays agrees,
        doubt_drop: and less than is usual here by this much.
        usual_rise: By this part of the difference the usual agreement rises with a scan;
        usual_fall: by this part it falls.
        lost_below: It counts as lost when none is found and a smaller part than this agrees.
        better: A pose near the last one must explain this much more to be taken instead.
        far_better: A pose far away must explain this much more to become a rival: that somebody
            carried the robot there is unlikely.
        same_way: A pose that is turned by more than this looks elsewhere, rad.
        alike: A pose that explains less than the one taken, by at most this, is a rival.
        most_rivals: At most so many are kept.
        rival_wins: A rival that explained so much more, summed over scans, is taken instead,
        equal_wins: or this much more, if it was as likely as the present pose;
        rival_loses: one that explained so much less is forgotten.
        forgotten: This part of the sum with each scan that tells something.
        noise: Of two poses that explain a scan as well the one explains this much more by chance;
            no more than that counts for nothing.
        standing: Of a robot that stands this part of the difference counts,
        standing_from: if it is at least this large.
        nudge: A correction of more than this, metres or rad, may as well be that somebody put the
            robot into a place that looks alike.
        challenger: A challenger loses this much with each scan that the present pose explains.
        rounds: After so many searches without a winner the present pose is kept.
        doubt_time: How long scans are doubtful before it looks, seconds; one scan is enough when it
            would be lost.
        lost_pause: Time between two looks while it is lost, seconds.
        near: Radius of the first search around the last pose, metres.
        at_once: A better pose within this distance is taken at once, metres; a farther one is
            followed first.
    """

    rays: int = 90
    cast_rays: int = 60
    update_distance: float = 0.15
    update_turn: float = 0.15
    update_period: float = 0.3
    doubt_below: float = 0.85
    doubt_drop: float = 0.12
    usual_rise: float = 0.05
    usual_fall: float = 0.02
    lost_below: float = 0.55
    better: float = 0.1
    far_better: float = 0.2
    same_way: float = 0.8
    alike: float = 0.1
    most_rivals: int = 40
    rival_wins: float = 0.8
    equal_wins: float = 0.3
    rival_loses: float = 0.5
    forgotten: float = 0.1
    noise: float = 0.05
    standing: float = 0.7
    standing_from: float = 0.2
    nudge: float = 0.2
    challenger: float = 0.05
    rounds: int = 5
    doubt_time: float = 0.2
    lost_pause: float = 1.0
    near: float = 2.5
    at_once: float = 1.0


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
            if way > p.nudge or abs(turn) > p.nudge:
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
        moves = moved[0] >= p.update_distance / 2 or moved[1] >= p.update_turn / 2
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
                    rival.lead += more - p.forgotten * rival.lead
                if plausible and not rival.is_equal:
                    rival.lead -= p.challenger
            elif abs(more) >= p.standing_from:
                rival.lead += p.standing * more - p.forgotten * rival.lead
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
            or self._moved[0] >= p.update_distance
            or self._moved[1] >= p.update_turn
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
        return math.dist(pose[:2], self.pose[:2]) <= p.at_once and turned <= p.same_way

    def _needed(self, pose: Pose) -> float:
        """Return how much more a pose must explain to be followed."""
        p = self.parameters
        return p.better if math.dist(pose[:2], self.pose[:2]) <= p.near else p.far_better

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
        alike = [each for each in candidates if each[1].fit >= max(better) - p.alike / 2]
        known = [rival.pose for rival in self._rivals]
        for pose, explained in alike[: p.most_rivals]:
            if not any(self._same(pose, other) for other in known):
                known.append(pose)
                self._rivals.append(_Rival(pose, (explained.fit - agreement) / 3, is_equal=False))
        return True

    def _settle(self, pose: Pose, agreement: float) -> None:
        self.pose, self.agreement = pose, agreement
        self.lost = False
        self._look_at = None
        self._rounds = 0
        p = self.parameters
        rate = p.usual_rise if agreement > self._usual else p.usual_fall
        if self._tolerated < 1.0:
            # A search found nothing better: it is what the place is like.
            rate = 0.2
        self._usual += rate * (agreement - self._usual)

    def _alike(self, candidates: list[tuple[Pose, Evidence]]) -> list[_Rival]:
        """Return the candidates that explain about as much as the first."""
        p = self.parameters
        taken: list[Pose] = [candidates[0][0]]
        for pose, explained in candidates[1:]:
            good = explained.hit >= max(candidates[0][1].hit - p.alike, p.lost_below)
            if good and not any(self._same(pose, other) for other in taken):
                taken.append(pose)
        return [_Rival(pose) for pose in taken[1 : p.most_rivals + 1]]

    def search(self, scan: Scan) -> list[tuple[Pose, Evidence]]:
        """Return poses anywhere that explain a scan, and its evidence; the likeliest first."""
        return found_poses(self._fit, scan, self.pose)

    def explained(self, pose: Pose, scan: Scan) -> float:
        """Return how well a pose explains a scan, 0 to 1 (`Evidence.fit`)."""
        return self._fit.evidence(pose, scan).fit
