"""Poses in the plane and what was measured between them, made to agree by least squares.

Each edge says where one pose is as seen from another, and how sure that is (its information
matrix). The poses are sought that make all edges agree best: Gauss-Newton on sparse normal
equations (Grisetti, Kuemmerle, Stachniss, Burgard, "A tutorial on graph-based SLAM", 2010). An
edge that disagrees much, as a wrong loop would, loses its weight (dynamic covariance scaling;
Agarwal et al., "Robust map optimization using dynamic covariance scaling", ICRA 2013).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from lidar_navigation.geometry import Pose

Matrix = NDArray[np.float64]

_LOOSE = 12.0
"""From this squared error on, in standard deviations, an edge that may be wrong loses weight; the
parameter phi of dynamic covariance scaling."""
_TRUSTING = 3
"""In the first rounds no edge does: a loop is closed over an error that has grown all along it."""
_ROUNDS = 15
_SMALL = 1e-5
"""A change of less than this ends the search, metres and rad."""


@dataclass(frozen=True, eq=False)
class Constraint:
    """What was measured between two poses.

    Attributes:
        first: Number of the pose from which it was measured.
        second: Number of the other pose.
        step: Where the second is in the first one's frame.
        information: Inverse of the covariance of `step`, shape (3, 3).
        may_be_wrong: Whether it is a loop, which may join places that only look alike.
    """

    first: int
    second: int
    step: Pose
    information: Matrix
    may_be_wrong: bool = False


@dataclass
class PoseGraph:
    """Poses, and edges between them; the first pose stays where it is.

    Attributes:
        poses: x, y in metres and yaw in rad.
        constraints: What was measured between them (edges of the graph).
    """

    poses: list[Pose] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)

    def neighbours(self) -> dict[int, list[tuple[int, float]]]:
        """Return the poses to which each one has an edge, and the length of that, metres."""
        found: dict[int, list[tuple[int, float]]] = {i: [] for i in range(len(self.poses))}
        for edge in self.constraints:
            length = math.hypot(*edge.step[:2])
            found[edge.first].append((edge.second, length))
            found[edge.second].append((edge.first, length))
        return found

    def optimise(self) -> float:
        """Move the poses to where the edges agree best; return the greatest move, metres."""
        if len(self.poses) < 2 or not self.constraints:
            return 0.0
        first = np.array([edge.first for edge in self.constraints])
        second = np.array([edge.second for edge in self.constraints])
        measured = np.array([edge.step for edge in self.constraints])
        information = np.array([edge.information for edge in self.constraints])
        loops = np.array([edge.may_be_wrong for edge in self.constraints])
        poses = np.array(self.poses)
        before = poses.copy()
        for number in range(_ROUNDS):
            error, at_first, at_second = _linearised(poses[first], poses[second], measured)
            squared = np.einsum('ni,nij,nj->n', error, information, error)
            doubted = loops & (number >= _TRUSTING)
            scale = np.where(doubted, np.minimum(1.0, 2.0 * _LOOSE / (_LOOSE + squared)), 1.0)
            weighted = information * (scale**2)[:, None, None]
            change = _solved(len(poses), first, second, error, at_first, at_second, weighted)
            poses += change
            if number > _TRUSTING and np.abs(change).max() < _SMALL:
                break
        poses[:, 2] = np.remainder(poses[:, 2] + math.pi, math.tau) - math.pi
        self.poses = [(x, y, yaw) for x, y, yaw in poses.tolist()]
        return float(np.hypot(*(poses - before)[:, :2].T).max())


def _linearised(first: Matrix, second: Matrix, measured: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return the errors of edges, shape (n, 3), and their slopes along both poses (n, 3, 3)."""
    cos, sin = np.cos(first[:, 2]), np.sin(first[:, 2])
    dx, dy = second[:, 0] - first[:, 0], second[:, 1] - first[:, 1]
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    turn = second[:, 2] - first[:, 2] - measured[:, 2]
    turn = np.remainder(turn + math.pi, math.tau) - math.pi
    error = np.stack([x - measured[:, 0], y - measured[:, 1], turn], axis=1)
    at_first, at_second = np.zeros((2, len(first), 3, 3))
    at_first[:, 0, 0], at_first[:, 0, 1], at_first[:, 0, 2] = -cos, -sin, y
    at_first[:, 1, 0], at_first[:, 1, 1], at_first[:, 1, 2] = sin, -cos, -x
    at_first[:, 2, 2] = -1.0
    at_second[:, 0, 0], at_second[:, 0, 1] = cos, sin
    at_second[:, 1, 0], at_second[:, 1, 1] = -sin, cos
    at_second[:, 2, 2] = 1.0
    return error, at_first, at_second


def _solved(
    count: int,
    first: NDArray[np.intp],
    second: NDArray[np.intp],
    error: Matrix,
    at_first: Matrix,
    at_second: Matrix,
    information: Matrix,
) -> Matrix:
    """Return the changes of the poses, shape (count, 3), by the normal equations."""
    rows, columns, values = [], [], []
    right = np.zeros((count, 3))
    axes = np.arange(3)
    for one, slope in ((first, at_first), (second, at_second)):
        weighted = np.einsum('nki,nkl->nil', slope, information)
        np.add.at(right, one, -np.einsum('nil,nl->ni', weighted, error))
        for other, other_slope in ((first, at_first), (second, at_second)):
            block = np.einsum('nil,nlj->nij', weighted, other_slope)
            shape = block.shape
            rows.append(np.broadcast_to((3 * one[:, None] + axes)[:, :, None], shape).ravel())
            columns.append(np.broadcast_to((3 * other[:, None] + axes)[:, None, :], shape).ravel())
            values.append(block.ravel())
    # The first pose is held where it is.
    rows.append(axes)
    columns.append(axes)
    values.append(np.full(3, 1e12))
    place = np.concatenate(rows), np.concatenate(columns)
    matrix = csc_array((np.concatenate(values), place), (3 * count, 3 * count))
    return np.asarray(splu(matrix).solve(right.ravel()).reshape(count, 3))
