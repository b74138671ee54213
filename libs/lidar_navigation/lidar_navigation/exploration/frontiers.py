"""Where the known ends: the frontiers of a map, and from where the robot can look beyond them.

A frontier is a line of free cells beside unknown ones (Yamauchi, "A frontier-based approach for
autonomous exploration", CIRA 1997). What it is worth is how near and how long it is, as in
explore_lite (Hoerner, "Map-merging for multi-robot system", 2016).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skimage.graph import MCP_Geometric

from floor_plans import Grid
from lidar_navigation.geometry import Points, Pose, angle_between
from strict_files.settings import parameter

_ESCAPE = 0.6
"""A robot that stands where it does not fit leaves over at most this distance, metres."""


@dataclass(frozen=True)
class FrontierParameters:
    """What counts as a frontier, and which one comes first.

    Attributes:
        gain: A frontier may be so many metres further away for each metre that it is longer,
        most_gain: up to this length, metres.
        turning: A way that begins behind the robot counts as so much longer for each rad, metres.
        beside: The robot looks over a frontier from at most this far away, metres,
        middle: and over this part of it: along its ends the view often goes beside it.
        spent: A viewpoint that showed nothing makes those within this distance useless, metres.
    """

    least: float = parameter(0.4, 'Frontiers shorter than this are left, m.', 0.05, 10.0)
    gain: float = 0.3
    most_gain: float = 4.0
    turning: float = 0.4
    beside: float = 0.6
    middle: float = 0.6
    spent: float = 0.4


@dataclass(frozen=True, eq=False)
class Frontier:
    """A line of free cells beside unknown ones.

    Attributes:
        points: Centres of its cells, shape (n, 2), metres.
        length: Metres.
        viewpoint: From where the robot can look over it, shape (2,); None: it cannot get there.
        path_length: The length of the way there, longer where it is narrow, metres.
        worth: What counts when the next one is chosen; the least is the best, metres.
    """

    points: Points
    length: float
    viewpoint: Points | None
    path_length: float
    worth: float

    @property
    def middle(self) -> Points:
        """The point of the frontier that is nearest to its centre, shape (2,)."""
        away = np.hypot(*(self.points - self.points.mean(axis=0)).T)
        return np.asarray(self.points[int(away.argmin())])


def frontier_cells(grid: Grid) -> NDArray[np.bool_]:
    """Return the free cells beside unknown ones, shape of the map."""
    unknown = (grid.cells < 0).astype(np.uint8)
    # What lies off the map is unknown, too.
    beside = cv2.dilate(np.pad(unknown, 1, constant_values=1), np.ones((3, 3), np.uint8))[
        1:-1, 1:-1
    ]
    return np.asarray(grid.free & (beside > 0))


def find_frontiers(
    grid: Grid,
    cost: NDArray[np.float32],
    pose: Pose,
    parameters: FrontierParameters,
    spent: Points | None = None,
) -> list[Frontier]:
    """Return the frontiers of a map, the best first; those out of reach come last.

    Args:
        grid: The map.
        cost: What a planner's search works on: each cell's cost, -1 where the robot cannot be.
        pose: Where the robot is.
        parameters: What counts.
        spent: From places this near to these points, shape (n, 2), nothing more is to be seen.
    """
    p, side = parameters, grid.resolution
    edge = frontier_cells(grid)
    count, found_labels = cv2.connectedComponents(edge.astype(np.uint8), connectivity=8)
    if count < 2:
        return []
    labels = np.asarray(found_labels, np.int32)
    ways = travel_costs(grid, cost, pose)
    # For each cell the nearest cell of a frontier.
    away, nearest = cv2.distanceTransformWithLabels(
        (~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    cell_of = np.zeros((int(nearest.max()) + 1, 2), np.intp)
    rows, columns = np.nonzero(edge)
    cell_of[nearest[rows, columns]] = np.column_stack([rows, columns])
    near = np.isfinite(ways) & (away * side <= p.beside)
    standable = np.column_stack(np.nonzero(near))
    looks_at = cell_of[nearest[near]]
    usable = _in_sight(grid.occupied, standable, looks_at)
    if spent is not None and len(spent):
        usable &= cKDTree(spent).query(grid.centres_of(standable))[0] > p.spent
    standable, looks_at = standable[usable], looks_at[usable]
    at, whose = tuple(standable.T), labels[looks_at[:, 0], looks_at[:, 1]]
    # By a short way, and then near to it.
    dear = ways[at] + 2.0 * side * away[at]
    found = []
    for label, part in _parts(labels[rows, columns], np.column_stack([rows, columns])):
        extent = part.max(axis=0) - part.min(axis=0) + 1
        length = side * float(max(extent.max(), math.hypot(*(extent - 1))))
        if length < p.least:
            continue
        own = np.flatnonzero(whose == label)
        if not len(own):
            found.append(Frontier(grid.centres_of(part), length, None, math.inf, math.inf))
            continue
        off = np.hypot(*(looks_at[own] - part.mean(axis=0)).T) * side
        central = own[off <= max(0.5 * p.middle * length, float(off.min()) + side)]
        best = central[np.argmin(dear[central])]
        x, y = grid.centre_of(*standable[best].tolist())
        path_length = float(ways[at][best])
        turn = abs(angle_between(pose[2], math.atan2(y - pose[1], x - pose[0])))
        worth = (
            path_length
            + p.turning * turn * (path_length > p.spent)
            - p.gain * min(length, p.most_gain)
        )
        found.append(Frontier(grid.centres_of(part), length, np.array([x, y]), path_length, worth))
    return sorted(found, key=lambda each: each.worth)


def _parts(
    labels: NDArray[np.int32], cells: NDArray[np.intp]
) -> list[tuple[int, NDArray[np.intp]]]:
    """Return the cells of each label."""
    order = np.argsort(labels, kind='stable')
    begins = np.flatnonzero(np.diff(labels[order])) + 1
    parts = np.split(cells[order], begins)
    return [(int(labels[order][at]), part) for at, part in zip([0, *begins], parts, strict=True)]


def travel_costs(grid: Grid, cost: NDArray[np.float32], pose: Pose) -> NDArray[np.float64]:
    """Return what the way from the robot to each cell costs, infinite where there is none.

    The unit is a metre in the open.
    """
    row, column = grid.cell_of(*pose[:2])
    reach = math.ceil(_ESCAPE / grid.resolution)
    top, left = max(0, row - reach), max(0, column - reach)
    window = cost[top : row + reach + 1, left : column + reach + 1]
    rows, columns = np.nonzero(window > 0)
    if not len(rows):
        return np.full(cost.shape, np.inf)
    # A robot that stands too near to something begins where it can leave to.
    first = int(np.argmin((rows + top - row) ** 2 + (columns + left - column) ** 2))
    search = MCP_Geometric(cost)
    ways, _ = search.find_costs([(int(rows[first]) + top, int(columns[first]) + left)])
    return np.asarray(np.where(cost > 0, ways, np.inf) * grid.resolution)


def _in_sight(
    occupied: NDArray[np.bool_], cells: NDArray[np.intp], others: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Tell where nothing is on the straight line between two cells, all of shape (n, 2)."""
    if not len(cells):
        return np.zeros(0, np.bool_)
    steps = 2 * int(np.abs(others - cells).max()) + 2
    share = np.linspace(0.0, 1.0, steps)[:, None, None]
    path_length = np.rint((1 - share) * cells + share * others).astype(np.intp)
    return np.asarray(~occupied[path_length[..., 0], path_length[..., 1]].any(axis=0))
