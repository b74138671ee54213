"""What moves around the robot: seen by the lidar, told apart, and followed over time.

Points that the map does not explain are grouped into bodies. Each track is followed with a constant
velocity by an alpha-beta filter (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to
Tracking and Navigation", 6.5). A track that has moved, and moves, is a `Mover`; one that stands
becomes an obstacle like any other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidar_navigation.geometry import Points, Pose


@dataclass(frozen=True)
class Mover:
    """A track that moves: a round one of `radius` metres.

    Attributes:
        x: Its centre, metres, map frame.
        y: Likewise.
        vx: Its velocity, m/s, map frame.
        vy: Likewise.
        radius: Metres.
    """

    x: float
    y: float
    vx: float
    vy: float
    radius: float


@dataclass(frozen=True)
class TrackingParameters:
    """How bodies are told apart and followed.

    Attributes:
        reach: Points further away than this are not taken, metres.
        gap: Neighbouring points further apart than this belong to two bodies, metres.
        widest: What is wider than this is no track that walks, metres.
        thinnest: A track is taken to be no thinner than this, as a radius, metres.
        gate: How far from where it is expected a track is looked for, metres.
        position_gain: Part of the difference that corrects a position (alpha).
        velocity_gain: Part of the difference that corrects a velocity (beta).
        moving_from: A track this fast moves, m/s.
        moved: It must have moved this far since it was first seen, metres.
        settle: Younger than this, nobody knows yet whether a track moves, seconds.
        keep: A track that is not seen is followed for this long, seconds.
        standing: A track slower than `moving_from` for this long stands, seconds.
    """

    reach: float = 5.0
    gap: float = 0.3
    widest: float = 0.65
    thinnest: float = 0.2
    gate: float = 0.5
    position_gain: float = 0.5
    velocity_gain: float = 0.15
    moving_from: float = 0.3
    moved: float = 0.2
    settle: float = 0.5
    keep: float = 0.7
    standing: float = 1.0


@dataclass
class _TrackedBody:
    at: Points
    velocity: Points
    radius: float
    first_at: Points
    since: float
    seen: float
    fast_at: float = -math.inf


class Tracker:
    """Follows the bodies around the robot."""

    def __init__(self) -> None:
        self._parameters = TrackingParameters()
        self._tracks: list[_TrackedBody] = []
        self._now = -math.inf

    @property
    def movers(self) -> list[Mover]:
        """The bodies that move."""
        return [
            Mover(
                *(float(track.at[0]), float(track.at[1])),
                *(float(track.velocity[0]), float(track.velocity[1])),
                track.radius,
            )
            for track in self._tracks
            if self._moves(track)
        ]

    def may_move(self, points: Points) -> NDArray[np.bool_]:
        """Tell which points, shape (n, 2), map frame, belong to a track that is not known to stand.

        Returns:
            Shape (n,).
        """
        found = np.zeros(len(points), dtype=np.bool_)
        for track in self._tracks:
            if self._moves(track) or self._now - track.since < self._parameters.settle:
                gaps = np.hypot(points[:, 0] - track.at[0], points[:, 1] - track.at[1])
                found |= gaps <= track.radius + self._parameters.gap / 2
        return found

    def update(self, pose: Pose, points: Points, now: float) -> None:
        """Take what the map does not explain of a scan.

        Args:
            pose: Where the robot is, map frame.
            points: In the order of the rays, shape (n, 2), metres, map frame.
            now: The scan's time, seconds.
        """
        dt, self._now = now - self._now, now
        if dt > self._parameters.keep:
            self._tracks.clear()
        for track in self._tracks:
            track.at = track.at + track.velocity * dt
        seen = self._grouped(np.array(pose[:2]), points)
        self._associate(seen, dt, now)
        self._tracks = [b for b in self._tracks if now - b.seen <= self._parameters.keep]

    def _moves(self, track: _TrackedBody) -> bool:
        return self._now - track.fast_at <= self._parameters.standing

    def _grouped(self, robot: Points, points: Points) -> list[tuple[Points, float]]:
        """Return centre and radius of each track in sight."""
        p = self._parameters
        away = np.hypot(*(points - robot).T)
        points = points[away <= p.reach]
        if len(points) < 2:
            return []
        steps = np.hypot(*np.diff(points, axis=0, append=points[:1]).T)
        groups = np.split(points, np.flatnonzero(steps[:-1] > p.gap) + 1)
        if len(groups) > 1 and steps[-1] <= p.gap:
            # The first ray looks backwards: a track there is cut in two.
            groups[0] = np.concatenate([groups.pop(), groups[0]])
        found = []
        for group in groups:
            middle = group.mean(axis=0)
            sight = middle - robot
            sight = sight / max(float(np.hypot(*sight)), 1e-6)
            across = (group - middle) @ np.array([-sight[1], sight[0]])
            width = float(across.max() - across.min())
            if len(group) < 2 or width > p.widest:
                continue
            radius = max(width / 2, p.thinnest)
            # The mean of the near half of a circle lies pi/4 of its radius before its centre.
            found.append((middle + sight * (math.pi / 4 * radius), radius))
        return found

    def _associate(self, seen: Sequence[tuple[Points, float]], dt: float, now: float) -> None:
        """Give each track the nearest thing seen; what is left over is new."""
        p = self._parameters
        pairs = sorted(
            (float(math.dist(track.at, at)), index, which)
            for index, track in enumerate(self._tracks)
            for which, (at, _) in enumerate(seen)
        )
        free_tracks, left = set(range(len(self._tracks))), set(range(len(seen)))
        for gap, index, which in pairs:
            if gap > p.gate:
                break
            if index in free_tracks and which in left:
                free_tracks.remove(index)
                left.remove(which)
                self._correct(self._tracks[index], *seen[which], dt, now)
        for which in left:
            at, radius = seen[which]
            self._tracks.append(_TrackedBody(at, np.zeros(2), radius, at, now, now))

    def _correct(
        self, track: _TrackedBody, at: Points, radius: float, dt: float, now: float
    ) -> None:
        p = self._parameters
        off = at - track.at
        track.at = track.at + p.position_gain * off
        if dt > 0:
            track.velocity = track.velocity + p.velocity_gain / dt * off
        track.radius += 0.3 * (radius - track.radius)
        track.seen = now
        fast = float(np.hypot(*track.velocity)) >= p.moving_from
        if fast and math.dist(track.at, track.first_at) >= p.moved:
            track.fast_at = now
        elif not fast:
            track.first_at = track.at
