"""The map of a building, from odometry and scans (graph SLAM).

A scan that was made some way or turn after the last one that was kept is kept, too (as Karto and
slam_toolbox do). It is matched against what the scans next to it in the graph of kept scans have
seen; that gives an edge of the graph. Where the robot comes to a part that it has seen long ago,
the scan is matched against that, too: a loop. A loop is accepted if most of the scan fits, if its
rays go through nothing that was seen before, and if it lies within the error that may have grown
since. Then all poses are made to agree, and scans whose poses were corrected are drawn anew.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, field, replace

import numpy as np

from floor_plans import Grid
from lidar_navigation.exploration.evidence_grid import EvidenceGrid
from lidar_navigation.exploration.pose_graph import Constraint, PoseGraph
from lidar_navigation.exploration.scan_matching import (
    Matcher,
    MatchingParameters,
    Surface,
    joined,
    surface_of,
)
from lidar_navigation.geometry import Pose, Scan, angle_between, composed, relative
from strict_files.settings import parameter

_LONGEST_STEP = 10.0
"""No robot drives so far between two scans that are kept, metres: the odometry began anew."""

_CONTRADICTS, _CHECK_THROUGH, _CHECK_AROUND = 0.12, 0.2, 3.0
"""A scan contradicts the map if its rays go through a greater part of what is in view, by more than
this, metres; of what was seen from so near by, metres."""
_LEAST_WRONG = 4
"""So many scans must, so that the map counts as bent."""
_REPAIRS = 3
"""So often missed loops are looked for."""


@dataclass(frozen=True)
class MappingParameters:
    """How the map is built.

    Attributes:
        drift: Standard deviation of the odometry after a metre, metres;
        turn_drift: after a radian, rad;
        bend: of its heading after a metre, rad.
        around: A scan is matched against scans that are as far away in the graph, metres,
        most_around: and at most so many.
        window: It is looked for this far from where the odometry has it, metres,
        window_turn: and this turn, rad.
        loop_around: Scans at most as far away as this, metres, and further in the graph, may close
            a loop.
        loop_growth: What the error of a loop may be for each metre of it, metres.
        loop_window: It is looked for at most this far away, metres.
        loop_agreement: So much of the scan must fit,
        loop_contradiction: and at most so much may be seen through.
        agreement: An odometry step counts alone when less of the scan fits.
        redraw: A scan whose pose was corrected by more than this is drawn anew, metres,
        redraw_turn: or rad.
    """

    resolution: float = parameter(0.05, 'Side of a cell of the map, m.', 0.01, 0.5)
    keep_distance: float = parameter(0.3, 'A scan is kept after this way, m.', 0.05, 5.0)
    keep_turn: float = parameter(0.26, 'A scan is kept after this turn, rad.', 0.05, 3.0)
    reach: float = parameter(12.0, 'Rays count up to this length in the map, m.', 1.0, 100.0)
    drift: float = 0.1
    turn_drift: float = 0.05
    bend: float = 0.03
    around: float = 5.0
    most_around: int = 14
    window: float = 0.25
    window_turn: float = 0.2
    loop_around: float = 3.0
    loop_growth: float = 0.03
    loop_window: float = 2.0
    loop_agreement: float = 0.6
    loop_contradiction: float = 0.1
    agreement: float = 0.3
    redraw: float = 0.02
    redraw_turn: float = 0.01


@dataclass(eq=False)
class _Kept:
    """A scan that was kept.

    Attributes:
        scan: The scan.
        surface: Its lines, robot's frame.
        drawn: The pose with which the map has it.
    """

    scan: Scan
    surface: Surface
    drawn: Pose


@dataclass
class MapBuilder:
    """Builds a map while the robot drives.

    Args:
        start: Where the robot is at first, map frame.
        parameters: How.
        matching: How scans are matched.

    Attributes:
        graph: The poses of the kept scans, and what was measured between them.
        loops: How many loops were closed.
    """

    start: Pose = (0.0, 0.0, 0.0)
    parameters: MappingParameters = field(default_factory=MappingParameters)
    matching: MatchingParameters = field(default_factory=MatchingParameters)
    graph: PoseGraph = field(default_factory=PoseGraph, init=False)
    loops: int = field(default=0, init=False)
    _kept: list[_Kept] = field(default_factory=list, init=False)
    _odometry: Pose = field(default=(0.0, 0.0, 0.0), init=False)
    _looped_at: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._evidence = EvidenceGrid(self.parameters.resolution)

    @property
    def kept(self) -> int:
        """How many scans were kept."""
        return len(self._kept)

    def pose(self, odometry: Pose) -> Pose:
        """Return where the robot is on the map while its odometry says this."""
        if not self._kept:
            return self.start
        return composed(self.graph.poses[-1], relative(self._odometry, odometry))

    def is_due(self, odometry: Pose) -> bool:
        """Tell whether a scan made here would be kept."""
        if not self._kept:
            return True
        dx, dy, turn = relative(self._odometry, odometry)
        p = self.parameters
        return math.hypot(dx, dy) >= p.keep_distance or abs(turn) >= p.keep_turn

    def grid(self) -> Grid:
        """Return the map as it is now."""
        return self._evidence.grid()

    def see(self, scan: Scan, odometry: Pose, *, keep: bool = False) -> bool:
        """Take a scan; tell whether it was kept, and so changed the map.

        Args:
            scan: As seen from where the robot was when the odometry said this.
            odometry: Where the odometry had the robot, in its own frame.
            keep: Whether it is kept even if it was made near the last one.
        """
        if not keep and not self.is_due(odometry):
            return False
        scan = _within(scan, self.parameters.reach)
        surface = surface_of(scan)
        if not self._kept:
            self.graph.poses.append(self.start)
        else:
            step = relative(self._odometry, odometry)
            if math.hypot(*step[:2]) > _LONGEST_STEP:
                step = (0.0, 0.0, 0.0)
            self._append(scan, surface, step)
        pose = self.graph.poses[-1]
        self._kept.append(_Kept(scan, surface, pose))
        self._odometry = odometry
        self._evidence.add(pose, scan)
        if self._close_loops():
            self._redraw()
        return True

    def _append(self, scan: Scan, surface: Surface, step: Pose) -> None:
        """Add the pose of a scan that was made a step of the odometry after the last one."""
        p, last = self.parameters, len(self._kept) - 1
        guess = composed(self.graph.poses[-1], step)
        way, turn = math.hypot(*step[:2]), abs(step[2])
        sure = np.diag(
            [
                1.0 / (p.drift**2 * way + 1e-4),
                1.0 / (p.drift**2 * way + 1e-4),
                1.0 / (p.turn_drift**2 * turn + p.bend**2 * way + 1e-5),
            ]
        )
        found = None
        around = self._near_in_graph(last)
        matcher = self._matcher(around)
        if matcher is not None:
            found = matcher.match(scan, surface, guess, (p.window, p.window_turn), sure)
        if found is None or found.agreement < p.agreement:
            pose, information = guess, sure
        else:
            pose, information = found.pose, found.information
        self.graph.poses.append(pose)
        self.graph.constraints.append(
            Constraint(last, last + 1, relative(self.graph.poses[last], pose), information)
        )

    def _near_in_graph(self, number: int) -> list[int]:
        """Return the kept scans next to one in the graph, itself first."""
        p = self.parameters
        found = self._ways(number, p.around)
        return sorted(found, key=lambda each: found[each])[: p.most_around]

    def _ways(self, number: int, most: float) -> dict[int, float]:
        """Return how far kept scans are from one along the graph, metres, up to a limit."""
        neighbours = self._neighbours
        found: dict[int, float] = {}
        queue = [(0.0, number)]
        while queue:
            way, at = heapq.heappop(queue)
            if at in found:
                continue
            found[at] = way
            for other, length in neighbours.get(at, ()):
                if other not in found and way + length <= most:
                    heapq.heappush(queue, (way + length, other))
        return found

    @property
    def _neighbours(self) -> dict[int, list[tuple[int, float]]]:
        return self.graph.neighbours()

    def _matcher(
        self, numbers: list[int], matching: MatchingParameters | None = None
    ) -> Matcher | None:
        if not numbers:
            return None
        surfaces = [
            self._kept[number].surface.moved(self.graph.poses[number]) for number in numbers
        ]
        seen = joined(surfaces)
        return Matcher(seen, matching or self.matching) if len(seen.points) else None

    def contradictions(self) -> list[int]:
        """Return the kept scans that contradict what others saw from near by, as the poses are.

        Rays go through what others have seen. A door that moved is a small part of what is in view;
        in a map that is bent walls stand twice.
        """
        p = self.parameters
        places = np.array(self.graph.poses).reshape(-1, 3)
        matching = replace(self.matching, through=_CHECK_THROUGH)
        found = []
        for number, kept in enumerate(self._kept):
            away = np.hypot(*(places[:, :2] - places[number, :2]).T)
            near = np.flatnonzero(away <= _CHECK_AROUND)
            # Also those that were seen long before or after.
            near = near[np.linspace(0, len(near) - 1, min(len(near), p.most_around)).astype(int)]
            matcher = self._matcher([each for each in near.tolist() if each != number], matching)
            pose = self.graph.poses[number]
            if matcher is not None and matcher.contradiction(kept.scan, pose) > _CONTRADICTS:
                found.append(number)
        return found

    def repair(self) -> list[Pose]:
        """Look for loops that were missed, where the map contradicts itself.

        Returns:
            From where scans were made that contradict it all the same; empty: it is sound.
        """
        wrong = self.contradictions()
        for _ in range(_REPAIRS):
            closed = [number for number in wrong if self._close_loops(number)]
            if not closed:
                break
            self._redraw()
            wrong = self.contradictions()
        # One alone is a door that was moved, or somebody who stood before the lidar.
        if len(wrong) < max(_LEAST_WRONG, 0.01 * len(self._kept)):
            return []
        return [self.graph.poses[number] for number in wrong]

    def _close_loops(self, number: int = -1) -> bool:
        """Look for loops that a scan closes, or the last one; tell whether one was found."""
        p, last = self.parameters, number % len(self._kept)
        pose = self.graph.poses[last]
        places = np.array(self.graph.poses)
        away = np.hypot(*(places[:, :2] - pose[:2]).T)
        ways = self._ways(last, math.inf)
        # Where the error may have grown most, the search has to reach furthest.
        able = [
            number
            for number in np.argsort(away).tolist()
            if away[number] <= p.loop_around + min(p.loop_window, p.loop_growth * ways[number])
            and ways[number] > max(2 * p.around, 3 * p.loop_around)
        ]
        if not able:
            return False
        # The scans next to the nearest one, which saw the same part.
        nearest = able[0]
        group = [each for each in self._near_in_graph(nearest) if ways[each] > p.around]
        matcher = self._matcher(group)
        if matcher is None:
            return False
        window = min(p.loop_window, 0.2 + p.loop_growth * ways[nearest])
        turn = min(0.5, 0.1 + 0.01 * ways[nearest])
        kept = self._kept[last]
        found = matcher.match(kept.scan, kept.surface, pose, (window, turn))
        if (
            found is None
            or found.agreement < p.loop_agreement
            or found.contradiction > p.loop_contradiction
            or math.dist(found.pose[:2], pose[:2]) > window + 0.1
        ):
            return False
        self.graph.constraints.append(
            Constraint(
                nearest,
                last,
                relative(self.graph.poses[nearest], found.pose),
                found.information,
                may_be_wrong=True,
            )
        )
        self.loops += 1
        self.graph.optimise()
        return True

    def _redraw(self) -> None:
        """Draw the scans anew whose poses were corrected."""
        p = self.parameters
        for kept, pose in zip(self._kept, self.graph.poses, strict=True):
            moved = math.dist(kept.drawn[:2], pose[:2])
            if moved > p.redraw or abs(angle_between(kept.drawn[2], pose[2])) > p.redraw_turn:
                self._evidence.remove(kept.drawn, kept.scan)
                self._evidence.add(pose, kept.scan)
                kept.drawn = pose


def _within(scan: Scan, reach: float) -> Scan:
    """Return a scan whose rays count up to a length; a longer one passed up to there."""
    if scan.range_max <= reach:
        return scan
    ranges = np.where(scan.ranges >= reach, np.inf, scan.ranges)
    return Scan(scan.angles, ranges, reach, scan.mount, scan.times)
