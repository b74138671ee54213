"""Where on the map a scan may have been made: all poses of a lattice, the best of them refined.

The lattice's places are cells, so that for one heading each point adds a shifted image of the map
(Olson, "Real-time correlative scan matching", ICRA 2009). The best poses are corrected as a pose is
that is tracked, and compared by their rays.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lidar_navigation.geometry import Points, Pose, Scan, angle_between, in_map
from lidar_navigation.localisation.scan_fit import Evidence, ScanFit

LATTICE = 0.25
"""Distance of the poses that a search tries, metres."""
HEADINGS = 24
"""How many headings a search tries at each place."""
NEAR = 2.5
"""Radius around the last pose in which a search looks more closely, metres."""
SURE = 0.93
"""A pose near the last one that explains this part of the rays ends the search."""
MOST = 40
"""So many poses are refined; as many may be rivals."""
_POINTS = 40
"""Points of a scan that are laid over the map, and the fewest that tell anything."""
_FEWEST = 8


def found_poses(fit: ScanFit, scan: Scan, last: Pose) -> list[tuple[Pose, Evidence]]:
    """Look everywhere for poses that explain a scan.

    Args:
        fit: The map.
        scan: The scan.
        last: Where the robot was believed to be.

    Returns:
        Poses and what the scan says of each, the likeliest first; empty when it shows too little.
        Of poses that explain as much, one near the last pose comes first.
    """
    points = scan.thinned(_POINTS).points
    if len(points) < _FEWEST:
        return []
    headings: Points = np.asarray(last[2] + np.arange(HEADINGS) * (math.tau / HEADINGS), np.float64)
    places, scores = _scored(fit, points, headings)
    within = np.hypot(*(places - last[:2]).T) <= NEAR
    # That somebody carried it far away is unlikely: near its last pose more is tried.
    found = _refined(fit, places[within], scores[:, within], headings, 24, scan)
    near = max(found, key=lambda each: _worth(each, last), default=None)
    found += _refined(fit, places, scores, headings, MOST, scan)
    found.sort(key=lambda each: -_worth(each, last))
    if near is not None and near[1].hit >= SURE:
        found.remove(near)
        found.insert(0, near)
    return found


def _worth(found: tuple[Pose, Evidence], last: Pose) -> float:
    pose, explained = found
    # Among poses that explain a scan as well, the nearest one is the likeliest, and the one
    # that looks the same way: a robot that is pushed or slips seldom turns round.
    turned = abs(angle_between(last[2], pose[2]))
    # None of them was believed before: a wall where the map has a door tells them apart.
    return explained.hit - 0.003 * min(math.dist(pose[:2], last[:2]), 20.0) - 0.02 * turned


def _scored(fit: ScanFit, points: Points, headings: Points) -> tuple[Points, NDArray[np.float32]]:
    """Return how well points fit the edges from each place of a lattice with each heading.

    The lattice's places are cells, so that for one heading each point adds a shifted image of
    the map (Olson, "Real-time correlative scan matching", ICRA 2009).

    Args:
        fit: The map.
        points: What is seen, robot's frame, shape (n, 2), metres.
        headings: What is tried, rad.

    Returns:
        The places on which the robot can stand, shape (m, 2), metres; the scores, shape
        (headings, m), the greater the better.
    """
    step = max(1, round(LATTICE / fit.grid.resolution))
    near = np.exp(-0.5 * (fit.edges / np.float32(0.2)) ** 2)
    images = [[near[up::step, right::step].copy() for right in range(step)] for up in range(step)]
    can_stand = fit.standable[::step, ::step]
    scores = []
    for yaw in headings.tolist():
        fits: NDArray[np.float32] = np.zeros(can_stand.shape, np.float32)
        turned = in_map((0.0, 0.0, yaw), points) / fit.grid.resolution
        for right, up in np.rint(turned).astype(int).tolist():
            image = images[up % step][right % step]
            rows, image_rows = _overlap(up // step, len(fits), len(image))
            columns, image_columns = _overlap(right // step, fits.shape[1], image.shape[1])
            fits[rows, columns] += image[image_rows, image_columns]
        scores.append(fits[can_stand])
    return fit.grid.centres_of(step * np.argwhere(can_stand)), np.array(scores)


def _refined(
    fit: ScanFit,
    places: Points,
    scores: NDArray[np.float32],
    headings: Points,
    count: int,
    scan: Scan,
) -> list[tuple[Pose, Evidence]]:
    """Refine a lattice's best poses; return them with what the scan says of each."""
    most = 60 * count
    # The best poses are at the best places.
    best = np.argsort(-scores.max(axis=0))[:most]
    heading, place = np.divmod(np.argsort(-scores[:, best], axis=None)[:most], len(best))
    poses = np.column_stack([places[best[place]], headings[heading]])
    tried = _apart(poses, count, 2 * LATTICE)
    refined = [fit.matched(pose, scan.points, (1.0, 1.0)) for pose in tried]
    return [(pose, fit.evidence(pose, scan)) for pose in refined if fit.can_stand(pose)]


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
