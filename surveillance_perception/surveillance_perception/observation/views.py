"""What differs between two pictures of the same view, whatever the light.

The new picture is first laid over the reference: features of both (ORB, Rublee and others 2011) are
matched, and a homography is fitted that most of them obey (RANSAC). Without enough of them nothing
is said: another view is not a change. Then both are compared window by window by their normalised
cross correlation, which neither brightness nor contrast of the light changes. Windows that are
plain in both have no correlation to speak of, and are left alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Grey = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]

WIDTH = 480
"""Pictures are compared at this width, pixels."""
LEAST_INLIERS = 20
LEAST_INLIER_SHARE = 0.25
WINDOW = 15
"""Side of a compared window, pixels."""
CORRELATED = 0.45
"""Windows that correlate less show something else."""
PLAIN = 5.0
"""Standard deviation of a window's grey below which it is plain."""
LEAST_AREA = 0.004
"""Of the picture, below which a difference is not told."""
DARK = 18.0
"""Mean grey below which no picture can be compared."""
BLIND = 2.5
"""Standard deviation of the whole picture below which there is nothing to see."""


class Sight(StrEnum):
    """Whether a camera sees anything."""

    CLEAR = 'clear'
    DARK = 'dark'
    BLOCKED = 'blocked'


@dataclass(frozen=True)
class ViewChange:
    """A part of the view that shows something else.

    Attributes:
        box: Left, top, width, height in the reference, pixels.
        area: Its part of the picture, 0 to 1.
        confidence: 0 to 1, from how little it correlates.
    """

    box: tuple[int, int, int, int]
    area: float
    confidence: float


def sight_of(picture: Grey) -> Sight:
    """Return whether a picture shows anything: the light may be off, or the lens covered.

    A covered lens lets some light through: the picture is plain everywhere, without any edge. In
    the dark a camera's picture is dark, with noise.
    """
    small = _scaled(picture)
    mean = float(small.mean())
    smooth = cv2.GaussianBlur(small, (0, 0), 3.0)
    if mean < DARK and float(np.percentile(smooth, 99.0)) < 2.5 * DARK:
        return Sight.DARK
    # A gradient over the whole picture is no edge: what light does behind a hand or a cloth.
    edges = np.abs(cv2.Laplacian(cv2.GaussianBlur(small, (0, 0), 1.5), cv2.CV_32F))
    if float(np.percentile(edges, 99.0)) < BLIND:
        return Sight.BLOCKED
    return Sight.CLEAR


def view_changes(reference: Grey, picture: Grey) -> list[ViewChange] | None:
    """Return what differs, the largest first; None where the views cannot be laid over each other.

    Args:
        reference: The view as it is normally, (rows, columns) of bytes.
        picture: The view now, of any size.
    """
    before, now = _scaled(reference), _scaled(picture)
    if Sight.CLEAR not in (sight_of(before),) or sight_of(now) != Sight.CLEAR:
        return None
    onto = _registration(before, now)
    if onto is None:
        return None
    size = (before.shape[1], before.shape[0])
    laid = cv2.warpPerspective(now, onto, size, flags=cv2.INTER_LINEAR)
    covered = cv2.warpPerspective(np.full(now.shape, 255, np.uint8), onto, size) == 255
    # Not the rim: there a view that was shaken a little shows what the other one does not.
    rim = np.ones((2 * WINDOW, 2 * WINDOW), np.uint8)
    covered = cv2.erode(covered.astype(np.uint8), rim, borderValue=0) > 0
    differs, strength = _differences(before.astype(np.float32), np.asarray(laid, np.float32))
    mask: npt.NDArray[Any] = (differs & covered).astype(np.uint8)
    # Thin differences stand along edges that are a pixel off.
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((WINDOW // 2, WINDOW // 2)))
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((WINDOW, WINDOW)))
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(np.asarray(mask, np.uint8))
    scale = reference.shape[1] / before.shape[1]
    found = []
    for number in range(1, count):
        left, top, width, height, cells = (int(each) for each in boxes[number])
        area = cells / mask.size
        if area < LEAST_AREA:
            continue
        sure = float(strength[labels == number].mean())
        box = (round(left * scale), round(top * scale), round(width * scale), round(height * scale))
        found.append(ViewChange(box, area, sure))
    return sorted(found, key=lambda each: -each.area)


def _scaled(picture: Grey) -> Grey:
    if picture.shape[1] <= WIDTH:
        return picture
    size = (WIDTH, max(1, round(picture.shape[0] * WIDTH / picture.shape[1])))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _registration(before: Grey, now: Grey) -> npt.NDArray[Any] | None:
    """Return the homography that lays the new picture over the old one; None without one."""
    # Evened out, so that a dim picture has features, too.
    even = cv2.createCLAHE(3.0, (8, 8))
    finder = cv2.ORB.create(1500, fastThreshold=7)
    points, seen = finder.detectAndCompute(even.apply(before), None)
    others, found = finder.detectAndCompute(even.apply(now), None)
    if seen is None or found is None:
        return None
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(found, seen)
    if len(matches) < LEAST_INLIERS:
        return None
    start = np.array([others[each.queryIdx].pt for each in matches], np.float32)
    end = np.array([points[each.trainIdx].pt for each in matches], np.float32)
    cv2.setRNGSeed(1)  # the same pictures give the same answer
    matrix, inside = cv2.findHomography(start, end, cv2.RANSAC, 3.0, maxIters=2000)
    if matrix is None or inside is None:
        return None
    inliers = int(inside.sum())
    if inliers < LEAST_INLIERS or inliers < LEAST_INLIER_SHARE * len(matches):
        return None
    # The same viewpoint: nothing is mirrored, turned over or much larger.
    scale = float(np.linalg.det(matrix[:2, :2]))
    return matrix if 0.5 < scale < 2.0 else None


def _differences(before: Floats, now: Floats) -> tuple[npt.NDArray[np.bool_], Floats]:
    """Return where two pictures differ, and how much, 0 to 1; both (rows, columns)."""
    side = (WINDOW, WINDOW)

    def mean(values: npt.NDArray[Any]) -> Floats:
        return np.asarray(cv2.blur(values, side), np.float32)

    first, second = mean(before), mean(now)
    deviation = np.sqrt(np.maximum(mean(before * before) - first * first, 0.0))
    other = np.sqrt(np.maximum(mean(now * now) - second * second, 0.0))
    together = mean(before * now) - first * second
    # A plain window's noise is no texture: what has none correlates with what has none.
    floor = PLAIN * PLAIN
    correlation = (together + floor / 2) / (deviation * other + floor / 2)
    # A pixel off along an edge costs correlation; the best of the neighbours is what counts.
    best = cv2.dilate(correlation.astype(np.float32), np.ones((5, 5)))
    textured = np.maximum(deviation, other) > 2 * PLAIN
    strength = np.clip(1.0 - np.asarray(best, np.float32), 0.0, 1.0)
    # What is white or black through and through in one of them has lost what was there.
    exposed = (np.minimum(first, second) > 8.0) & (np.maximum(first, second) < 247.0)
    return np.asarray(textured & exposed & (best < CORRELATED)), strength
