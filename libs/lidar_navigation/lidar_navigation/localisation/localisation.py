"""Where a robot is on a map, from its odometry and its lidar.

Between scans the estimate moves with the odometry. Each scan then corrects it: the pose is sought
at which the seen points lie on the edges of what the map has occupied, by Gauss-Newton on the
signed distance to those edges (a likelihood field; Thrun, Burgard, Fox, "Probabilistic Robotics",
6.4), with weights that let go of points the map cannot explain, and a pull towards the odometry
where the scan says nothing, as along a corridor.

How well a pose explains a scan is measured by casting the rays into the map: the part of them that
go as far as they should. How large that part usually is differs between places: all but one in
ten rays of a drawn map, fewer in a furnished one. When it drops below what is usual here, the robot
doubts (it may have been pushed, carried, or slipped; or there only are obstacles that the map does
not have) and looks for a better pose: near where it was, then everywhere, over a lattice of poses,
the best of which are refined by the same correction and compared by their rays. A pose nearby that
looks the same way and is clearly better is taken at once: the robot was pushed, or slipped. Any
other one is followed first: it becomes a rival.

Rivals are other poses at which the robot may be. They move with the odometry and are corrected by
the same scans, until they explain less, or one of them wins. Rooms look alike: so are poses that
explained about as much as the one that was taken. Only what tells them apart counts, and only
while the robot moves: a robot that stands sees the same again and again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to
from lidar_navigation.geometry import Points, Pose, Scan, angle_between, composed, in_map, relative
from lidar_navigation.localisation.odometry import is_jump


@dataclass(frozen=True)
class LocalisationParameters:
    """How the localiser works.

    Attributes:
        rays: Rays of a scan that are matched.
        cast_rays: Rays that are cast into the map to measure how well a pose explains a scan.
        update_distance: A scan is used after this way, metres,
        update_turn: or this turn, rad,
        update_period: or this time, seconds; and always while the robot doubts.
        hit: A ray agrees with the map when it is off by at most this, metres.
        spread: Points further than about this from any edge lose their weight, metres.
        doubt_below: The robot looks for a better pose when a smaller part of the rays agrees,
        doubt_drop: and less than is usual here by this much.
        usual_rise: By this part of the difference the usual agreement rises with a scan;
        usual_fall: by this part it falls.
        lost_below: It counts as lost when none is found and a smaller part than this agrees.
        sure_from: A pose near the last one that explains this part ends the search.
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
        lattice: Distance of the poses that a search tries, metres.
        headings: How many headings a search tries at each.
        body: Radius within which the robot cannot overlap anything, metres.
    """

    rays: int = 90
    cast_rays: int = 60
    update_distance: float = 0.15
    update_turn: float = 0.15
    update_period: float = 0.3
    hit: float = 0.15
    spread: float = 0.2
    doubt_below: float = 0.85
    doubt_drop: float = 0.12
    usual_rise: float = 0.05
    usual_fall: float = 0.02
    lost_below: float = 0.55
    sure_from: float = 0.93
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
    lattice: float = 0.25
    headings: int = 24
    body: float = 0.15


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
        self._odometry: Pose | None = None
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
        self.grid = grid
        half = np.float32(grid.resolution / 2)
        occupied = grid.occupied
        outside = distance_to(occupied, grid.resolution)
        inside = distance_to(~occupied, grid.resolution)
        signed = np.where(occupied, half - inside, outside - half)
        # With nothing or everything occupied nothing is to match: one finite value, no slope.
        self._edges: NDArray[np.float32] = np.clip(signed, -10.0, 10.0)
        # A slope needs two cells.
        short = [(0, max(0, 2 - count)) for count in signed.shape]
        self._edges = np.pad(self._edges, short, mode='edge')
        self._occupied = occupied
        self._standable = grid.free & (outside - half >= self.parameters.body)

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

    def move(self, odometry: Pose) -> None:
        """Take a new reading of the odometry, in the odometry's own frame."""
        if self._odometry is not None:
            dx, dy, turn = relative(self._odometry, odometry)
            step = math.hypot(dx, dy)
            if not is_jump(self._odometry, odometry):
                self.pose = composed(self.pose, (dx, dy, turn))
                for rival in self._rivals:
                    rival.pose = composed(rival.pose, (dx, dy, turn))
                self._moved = (self._moved[0] + step, self._moved[1] + abs(turn))
        self._odometry = odometry

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
        corrected = self._matched(self.pose, thin.points, moved)
        agreement = self.explained(corrected, thin.thinned(p.cast_rays))
        if agreement < self._enough:
            before = corrected
            corrected, agreement = self._nudged(corrected, agreement, thin, moved)
            way, turn = math.dist(before[:2], corrected[:2]), angle_between(before[2], corrected[2])
            if way > p.nudge or abs(turn) > p.nudge:
                # Somebody may have put it into another room that looks alike.
                self._shaken = True
        winner = self._weighed(corrected, agreement, thin, moved)
        if winner is not None:
            self.jumps += 1
            corrected, agreement = winner
            # Also where it does not explain enough to be sure of.
            self.pose = corrected
        self._judge(corrected, agreement, thin, now)
        return True

    def _nudged(
        self, pose: Pose, agreement: float, thin: Scan, moved: tuple[float, float]
    ) -> tuple[Pose, float]:
        """Return a pose close by that explains more, as after a slip; else the same pose."""
        rays = thin.thinned(self.parameters.cast_rays)
        best = pose, agreement
        for turn in (-0.3, -0.15, 0.0, 0.15, 0.3):
            for dx, dy in ((0.0, 0.0), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25)):
                start = composed(pose, (dx, dy, turn))
                tried = self._matched(start, thin.points, (moved[0] + 0.3, moved[1] + 0.3))
                explained = self.explained(tried, rays)
                if explained > best[1] + 0.02 and self._can_stand(tried):
                    best = tried, explained
        return best

    def _weighed(
        self, present: Pose, agreement: float, thin: Scan, moved: tuple[float, float]
    ) -> tuple[Pose, float] | None:
        """Correct the rivals by a scan; return the one that wins over the present pose, if any."""
        p = self.parameters
        best: tuple[_Rival, float] | None = None
        moves = moved[0] >= p.update_distance / 2 or moved[1] >= p.update_turn / 2
        plausible = agreement >= self._enough
        for rival in self._rivals:
            rival.pose = self._matched(rival.pose, thin.points, moved)
            explained = self.explained(rival.pose, thin.thinned(p.cast_rays))
            more = explained - agreement
            if moves:
                # What tells nothing makes nothing forgotten, either.
                if abs(more) > p.noise:
                    rival.lead += more - p.forgotten * rival.lead
                if plausible and not rival.is_equal:
                    rival.lead -= p.challenger
            elif abs(more) >= p.standing_from:
                rival.lead += p.standing * more - p.forgotten * rival.lead
            if not self._can_stand(rival.pose) or self._same(rival.pose, present):
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

    def _judge(self, corrected: Pose, agreement: float, thin: Scan, now: float) -> None:
        p = self.parameters
        enough = self._enough
        if agreement >= enough:
            self._tolerated = 1.0
        if agreement >= max(p.lost_below, min(enough, self._tolerated - p.better)):
            self._settle(corrected, agreement)
            if self._shaken and agreement >= enough:
                # What fits again may be another place that looks alike.
                self._shaken = False
                self._before_search()
                self._rivals = self._alike([(corrected, agreement), *self.search(thin)])
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
        found = candidates[0] if candidates else None
        if found is not None and self._is_near(found[0]) and self._is_better(found, agreement):
            self.jumps += 1
            self._settle(*found)
            self._shaken = False
            # Somebody may only have stood in the way: where it was until now stays likely.
            self._rivals = [_Rival(corrected, agreement - found[1]), *self._alike(candidates)]
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

    def _is_better(self, found: tuple[Pose, float], agreement: float) -> bool:
        p = self.parameters
        return found[1] >= max(p.lost_below, agreement + p.better)

    def _needed(self, pose: Pose) -> float:
        """Return how much more a pose must explain to be followed."""
        p = self.parameters
        return p.better if math.dist(pose[:2], self.pose[:2]) <= p.near else p.far_better

    @property
    def _follows_better(self) -> bool:
        """Whether a rival leads."""
        return any(rival.lead > 0.0 for rival in self._rivals)

    def _follow(self, candidates: list[tuple[Pose, float]], agreement: float) -> bool:
        """Follow poses far away, or turned, that explain much more; tell whether there are any."""
        p = self.parameters
        better = [
            explained
            for pose, explained in candidates
            if explained >= max(p.lost_below, agreement + self._needed(pose))
        ]
        if not better:
            return False
        # With it those that look alike, wherever they are.
        alike = [each for each in candidates if each[1] >= max(better) - p.alike / 2]
        known = [rival.pose for rival in self._rivals]
        for pose, explained in alike[: p.most_rivals]:
            if not any(self._same(pose, other) for other in known):
                known.append(pose)
                self._rivals.append(_Rival(pose, (explained - agreement) / 3, is_equal=False))
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

    def search(self, scan: Scan) -> list[tuple[Pose, float]]:
        """Look everywhere for poses that explain a scan.

        Returns:
            Poses and the part of the rays each explains, the likeliest first; empty when the scan
            shows too little. Of poses that explain as much, one near the last pose comes first.
        """
        p = self.parameters
        points = scan.thinned(40).points
        if len(points) < 8:
            return []
        places, scores = self._scored(points)
        within = np.hypot(*(places - self.pose[:2]).T) <= p.near
        found = self._refined(places[within], scores[:, within], 24, scan)
        near = max(found, key=lambda each: self._worth(*each), default=None)
        found += self._refined(places, scores, p.most_rivals, scan)
        found.sort(key=lambda each: -self._worth(*each))
        if near is not None and near[1] >= p.sure_from:
            # That somebody carried the robot far away is unlikely.
            found.remove(near)
            found.insert(0, near)
        return found

    def _alike(self, candidates: list[tuple[Pose, float]]) -> list[_Rival]:
        """Return the candidates that explain about as much as the first."""
        p = self.parameters
        taken: list[Pose] = [candidates[0][0]]
        for pose, explained in candidates[1:]:
            good = explained >= max(candidates[0][1] - p.alike, p.lost_below)
            if good and not any(self._same(pose, other) for other in taken):
                taken.append(pose)
        return [_Rival(pose) for pose in taken[1 : p.most_rivals + 1]]

    def _worth(self, pose: Pose, explained: float) -> float:
        # Among poses that explain a scan as well, the nearest one is the likeliest, and the one
        # that looks the same way: a robot that is pushed or slips seldom turns round.
        turned = abs(angle_between(self.pose[2], pose[2]))
        return explained - 0.003 * min(math.dist(pose[:2], self.pose[:2]), 20.0) - 0.02 * turned

    def explained(self, pose: Pose, scan: Scan) -> float:
        """Return the part of a scan's rays that go as far as they should from a pose, 0 to 1."""
        expected = self.cast(composed(pose, scan.mount), scan.angles, scan.range_max)
        off = np.abs(expected - np.minimum(scan.ranges, scan.range_max))
        off = off[~np.isnan(off)]
        slack = self.parameters.hit + self.grid.resolution / 2
        return float((off <= slack).mean()) if len(off) else 0.0

    def cast(self, pose: Pose, angles: Points, range_max: float) -> Points:
        """Return how far rays go in the map from a pose until they meet something occupied.

        Returns:
            Shape of `angles`, metres, at most `range_max`; to half a cell.
        """
        step = self.grid.resolution / 2
        # Nothing of the map is farther away than its diagonal is long.
        rows, columns = self._occupied.shape
        diagonal = math.hypot(rows, columns) * self.grid.resolution
        way = np.arange(0.0, min(range_max, diagonal) + step, step)
        heading = angles + pose[2]
        x = pose[0] + np.cos(heading)[:, None] * way
        y = pose[1] + np.sin(heading)[:, None] * way
        column = ((x - self.grid.origin[0]) * (1 / self.grid.resolution)).astype(np.int32)
        row = ((y - self.grid.origin[1]) * (1 / self.grid.resolution)).astype(np.int32)
        np.clip(column, 0, columns - 1, out=column)
        np.clip(row, 0, rows - 1, out=row)
        hit = self._occupied.ravel().take(row * columns + column)
        first = hit.argmax(axis=1)
        met = hit[np.arange(len(angles)), first]
        return np.where(met, np.minimum(way[first], range_max), range_max)

    def _matched(self, pose: Pose, points: Points, moved: tuple[float, float]) -> Pose:
        """Return the pose near `pose` at which points (robot's frame) lie on the map's edges."""
        if len(points) < 8:
            return pose
        estimate = np.array(pose)
        # Pull towards the odometry: a standard deviation per direction, beside 3 cm of a point.
        deviation = np.array([0.05 + 0.2 * moved[0]] * 2 + [0.04 + 0.1 * moved[0] + 0.2 * moved[1]])
        pull = (0.03 / deviation) ** 2
        for _ in range(8):
            cos, sin = math.cos(estimate[2]), math.sin(estimate[2])
            x = estimate[0] + cos * points[:, 0] - sin * points[:, 1]
            y = estimate[1] + sin * points[:, 0] + cos * points[:, 1]
            error, slope_x, slope_y = self._edge_at(x, y)
            weight = 1.0 / (1.0 + (error / self.parameters.spread) ** 2) ** 2
            slope_turn = slope_y * (x - estimate[0]) - slope_x * (y - estimate[1])
            jacobian = np.array([slope_x, slope_y, slope_turn])
            weighted = jacobian * weight
            back = estimate - pose
            back[2] = angle_between(pose[2], estimate[2])
            change = np.linalg.solve(
                weighted @ jacobian.T + np.diag(pull + 1e-9), -(weighted @ error + pull * back)
            )
            estimate += np.minimum(np.maximum(change, -0.15), 0.15)
            if np.abs(change).max() < 1e-4:
                break
        return float(estimate[0]), float(estimate[1]), math.remainder(estimate[2], math.tau)

    def _edge_at(self, x: Points, y: Points) -> tuple[Points, Points, Points]:
        """Signed distance to the nearest edge and its slope along x and y, bilinear."""
        column = (x - self.grid.origin[0]) / self.grid.resolution - 0.5
        row = (y - self.grid.origin[1]) / self.grid.resolution - 0.5
        rows, columns = self._edges.shape
        column = np.minimum(np.maximum(column, 0), columns - 1.001)
        row = np.minimum(np.maximum(row, 0), rows - 1.001)
        c, r = column.astype(np.intp), row.astype(np.intp)
        u, v = column - c, row - r
        flat = self._edges.ravel()
        base = r * columns + c
        sw, se, nw, ne = flat[base], flat[base + 1], flat[base + columns], flat[base + columns + 1]
        south, north = sw + (se - sw) * u, nw + (ne - nw) * u
        slope_x = ((se - sw) * (1 - v) + (ne - nw) * v) / self.grid.resolution
        slope_y = (north - south) / self.grid.resolution
        return south + (north - south) * v, slope_x, slope_y

    def _can_stand(self, pose: Pose) -> bool:
        return bool(self.grid.at(self._standable, *pose[:2]))

    @property
    def _headings(self) -> Points:
        """The headings that a search tries, shape (n,), rad."""
        count = self.parameters.headings
        return np.asarray(self.pose[2] + np.arange(count) * (math.tau / count), np.float64)

    def _scored(self, points: Points) -> tuple[Points, NDArray[np.float32]]:
        """Return how well points fit the edges from each place of a lattice with each heading.

        The lattice's places are cells, so that for one heading each point adds a shifted image of
        the map (Olson, "Real-time correlative scan matching", ICRA 2009).

        Args:
            points: What is seen, robot's frame, shape (n, 2), metres.

        Returns:
            The places on which the robot can stand, shape (m, 2), metres; the scores, shape
            (headings, m), the greater the better.
        """
        step = max(1, round(self.parameters.lattice / self.grid.resolution))
        fit = np.exp(-0.5 * (self._edges / np.float32(0.2)) ** 2)
        images = [
            [fit[up::step, right::step].copy() for right in range(step)] for up in range(step)
        ]
        can_stand = self._standable[::step, ::step]
        scores = []
        for yaw in self._headings.tolist():
            fits: NDArray[np.float32] = np.zeros(can_stand.shape, np.float32)
            turned = in_map((0.0, 0.0, yaw), points) / self.grid.resolution
            for right, up in np.rint(turned).astype(int).tolist():
                image = images[up % step][right % step]
                rows, image_rows = _overlap(up // step, len(fits), len(image))
                columns, image_columns = _overlap(right // step, fits.shape[1], image.shape[1])
                fits[rows, columns] += image[image_rows, image_columns]
            scores.append(fits[can_stand])
        return self.grid.centres_of(step * np.argwhere(can_stand)), np.array(scores)

    def _refined(
        self, places: Points, scores: NDArray[np.float32], count: int, scan: Scan
    ) -> list[tuple[Pose, float]]:
        """Refine a lattice's best poses; return them with the part of the rays each explains."""
        most = 60 * count
        # The best poses are at the best places.
        best = np.argsort(-scores.max(axis=0))[:most]
        heading, place = np.divmod(np.argsort(-scores[:, best], axis=None)[:most], len(best))
        poses = np.column_stack([places[best[place]], self._headings[heading]])
        tried = _apart(poses, count, 2 * self.parameters.lattice)
        refined = [self._matched(pose, scan.points, (1.0, 1.0)) for pose in tried]
        return [(pose, self.explained(pose, scan)) for pose in refined if self._can_stand(pose)]


def _overlap(shift: int, count: int, image: int) -> tuple[slice, slice]:
    """Return which of `count` cells lie on an image that is shifted back, and where on it."""
    first = max(0, -shift)
    end = max(first, min(count, image - shift))
    return slice(first, end), slice(first + shift, end + shift)


def _apart(poses: Points, count: int, distance: float) -> list[Pose]:
    """Return the first poses that are not all the same: some way or turn lies between any two."""
    taken: list[Pose] = []
    for x, y, yaw in poses.tolist():
        if all(
            math.hypot(x - other[0], y - other[1]) > distance
            or abs(angle_between(other[2], yaw)) > 0.4
            for other in taken
        ):
            taken.append((x, y, yaw))
            if len(taken) == count:
                break
    return taken
