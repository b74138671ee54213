"""What differs between two pictures of the same view, whatever the light.

The new picture is first laid over the reference: features of both (ORB, Rublee and others 2011) are
matched, and a homography is fitted that most of them obey (RANSAC). Without enough of them nothing
is said: another view is not a change. A homography fits one plane. What stands nearer or farther
than that plane is seen beside its old spot once the camera stands a few centimetres elsewhere; a
dense flow (DIS, Kroeger and others 2016) takes that out. Flow follows the edge of a shadow, too:
so both layings are compared, and a change is what differs in both.

Light multiplies a picture. One that is dim as a whole is freed of noise, as is the reference, and
brightened; one that is too dim for that is not compared. The logarithm of the ratio of both
pictures, smoothed by a median, which keeps steps, is the change of light with the edges of its
shadows; the new picture is divided by it. Then two things tell of a change. Texture: windows whose
normalised cross correlation is low. Windows that are plain in both have none to speak of, and are
left alone. Colour: the ratios of the channels, which no shadow changes, less what is common to all
pixels of the same colour: that is the camera or its lamp. So a plain thing before a plain wall is
seen by its colour alone, and in a grey picture not at all.

What differs before the light is taken out, and not afterwards, is a thing of little texture or the
edge of a shadow; nothing in two pictures tells which. It is told as such.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Grey = npt.NDArray[np.uint8]
"""(rows, columns) of bytes."""
Picture = npt.NDArray[np.uint8]
"""(rows, columns) of grey, or (rows, columns, 3) of BGR."""
Floats = npt.NDArray[np.float32]

WIDTH = 480
"""Pictures are compared at this width, pixels."""
LEAST_INLIERS = 20
"""Points that fit one homography, without which pictures are not compared: it takes four, and by
chance a few more."""
LEAST_INLIER_SHARE = 0.25
"""And their part of all matches: what moved or repeats has the others."""
WINDOW = 15
"""Side of a compared window, pixels."""
CORRELATED = 0.35
"""Windows that correlate less show something else."""
PLAIN = 5.0
"""Standard deviation of the camera's noise, and of what it is taken for, grey levels."""
TEXTURED = 7.0
"""Standard deviation of a window's grey from which it has texture."""
LIT_CORRELATED, LIT_TEXTURED = 0.45, 10.0
"""The same where the light is not taken out."""
LIGHT = 21
"""Side of the median that smooths the change of light, pixels: half of it is kept as texture."""
OFFSET = 8.0
"""Added before a logarithm, grey levels: noise in the dark is no ratio."""
COLOURED = 0.22
"""Change of a ratio of channels, as a logarithm, from which a colour is another one."""
COLOUR_DARK = 25.0
"""Grey below which a pixel has no colour."""
DIMMED = 0.25
"""A shadow darker than this, as part of the light around it, leaves nothing to compare."""
DIM, DIMMEST = 0.33, 0.12
"""Median brightness, as part of the reference's, below which the picture is freed of noise and
brightened first; and below which its noise hides too much for that."""
DENOISED = 1.2
"""Standard deviation of the blur that frees a dim picture of noise, pixels: a quarter is left."""
FARTHEST = 30.0
"""Flow beyond this is no parallax, pixels."""
RIM = 22
"""What lies so near to the end of what both show is not compared, across."""
THIN = 7
"""Differences narrower than this stand along edges that are a pixel off."""
LEAST_AREA = 0.004
"""Of the picture, below which a difference is not told."""
DARK = 18.0
"""Mean grey below which no picture can be compared."""
MOSTLY = 0.7
"""A room of which so much of a picture is dark has no light: a doorway shows so much of another
room only from a metre before it."""
BLIND = 0.0013
"""Where the strongest edges of a smoothed picture are weaker, as a part of its mean grey, there is
nothing to see: a covered lens in a lit room has up to 0.0009 at a noise of four grey levels, the
plainest view of the simulated rooms 0.0017 under any light, photographs 0.003 and more."""


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
        may_be_light: Whether the edge of a shadow would look like it.
    """

    box: tuple[int, int, int, int]
    area: float
    confidence: float
    may_be_light: bool = False


def sight_of(picture: Picture) -> Sight:
    """Return whether a picture shows anything: the light may be off, or the lens covered.

    A covered lens lets some light through: the picture is plain everywhere, without any edge. In
    the dark a camera's picture is dark, with noise.
    """
    small = _scaled(grey_of(picture))
    mean = float(small.mean())
    smooth = cv2.GaussianBlur(small, (0, 0), 3.0)
    if mean < DARK and float(np.percentile(smooth, 99.0)) < 2.5 * DARK:
        return Sight.DARK
    # A gradient over the whole picture is no edge: what light does behind a hand or a cloth. Noise
    # is smoothed away first, and an edge is as strong as the light is.
    smooth = cv2.GaussianBlur(small.astype(np.float32), (0, 0), 5.0)
    edges = np.abs(cv2.Laplacian(smooth, cv2.CV_32F))
    if float(np.percentile(edges, 99.0)) < BLIND * mean:
        return Sight.BLOCKED
    return Sight.CLEAR


def light_of(picture: Picture, sight: Sight) -> str:
    """Return whether the light of the room is 'on' or 'off'; empty: the picture does not tell.

    Through open doors a dark room shows lit ones, and a lit room dark ones: its own light is on
    only where half of the picture is not dark, and off where nearly all of it is.

    Args:
        picture: The view.
        sight: What `sight_of` says of it.
    """
    if sight == Sight.DARK:
        return 'off'
    if sight != Sight.CLEAR:
        return ''
    is_dark = float((_scaled(grey_of(picture)) <= DARK).mean())
    return 'on' if is_dark < 0.5 else 'off' if is_dark >= MOSTLY else ''


def view_changes(reference: Picture, picture: Picture) -> list[ViewChange] | None:
    """Return what differs; None where the views cannot be laid over each other.

    What may be light comes last; of each kind the largest comes first.

    Args:
        reference: The view as it is normally. Colours are compared where both pictures have some.
        picture: The view now, of any size.
    """
    before, now = _scaled(reference), _scaled(picture)
    if before.ndim != now.ndim:
        before, now = grey_of(before), grey_of(now)
    if sight_of(before) != Sight.CLEAR or sight_of(now) != Sight.CLEAR:
        return None
    gain = _gain(before, now)
    if gain is None:
        return None
    if gain > 1.0:
        before = np.asarray(cv2.GaussianBlur(before, (0, 0), DENOISED), np.uint8)
        quiet = cv2.GaussianBlur(now, (0, 0), DENOISED)
        now = np.asarray(cv2.convertScaleAbs(quiet, alpha=gain), np.uint8)
    onto = registration(grey_of(before), grey_of(now))
    if onto is None:
        return None
    size = (before.shape[1], before.shape[0])
    laid = np.asarray(cv2.warpPerspective(now, onto, size, flags=cv2.INTER_LINEAR), np.uint8)
    covered = cv2.warpPerspective(np.full(now.shape[:2], 255, np.uint8), onto, size) == 255
    first = _differences(before, laid, covered)
    columns, rows = _parallax(grey_of(before), grey_of(laid))
    moved = np.asarray(cv2.remap(laid, columns, rows, cv2.INTER_LINEAR), np.uint8)
    there = cv2.remap(covered.astype(np.uint8), columns, rows, cv2.INTER_NEAREST) > 0
    second = _differences(before, moved, there)
    # Not the rim: there a view that was shaken a little shows what the other one does not.
    rim = np.ones((RIM, RIM), np.uint8)
    judged = cv2.erode(covered.astype(np.uint8), rim, borderValue=0) > 0
    whole, judged = judged, judged & first.judged & second.judged
    correlation = np.maximum(first.correlation, second.correlation)
    colour = np.minimum(first.colour, second.colour)
    # Each alone, so that a thin remainder of one does not hold up one of the other.
    texture, tint = (
        cv2.morphologyEx((found & judged).astype(np.uint8), cv2.MORPH_OPEN, np.ones((THIN, THIN)))
        for found in (correlation < CORRELATED, colour > COLOURED)
    )
    strength = np.clip(np.maximum(1.0 - correlation, colour / (2 * COLOURED)), 0.0, 1.0)
    scale = reference.shape[1] / before.shape[1]
    changed = np.asarray(np.maximum(texture, tint), np.uint8)
    found = _regions(changed, strength, scale)
    wide = _correlation(
        grey_of(before).astype(np.float32), grey_of(laid).astype(np.float32), WINDOW
    )
    edges = (wide.best < LIT_CORRELATED) & (wide.deviation > LIT_TEXTURED) & wide.exposed & whole
    kept = cv2.morphologyEx(edges.astype(np.uint8), cv2.MORPH_OPEN, np.ones((THIN, THIN)))
    either = np.asarray(np.maximum(kept, changed), np.uint8)
    doubtful = _regions(either, 1.0 - wide.best, scale)
    doubtful = [each for each in doubtful if not any(_touch(each.box, e.box) for e in found)]
    return found + [replace(each, may_be_light=True) for each in doubtful]


def _gain(before: Picture, now: Picture) -> float | None:
    """Return by what a dim picture is brightened, 1 where it is not dim; None: it is too dim."""
    share = (float(np.median(grey_of(now))) + 1.0) / (float(np.median(grey_of(before))) + 1.0)
    if share < DIMMEST:
        return None
    return 1.0 if share >= DIM else 1.0 / share


def _touch(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> bool:
    return all(
        one[each] < other[each] + other[each + 2] and other[each] < one[each] + one[each + 2]
        for each in (0, 1)
    )


def _regions(mask: Grey, strength: Floats, scale: float) -> list[ViewChange]:
    """Return the connected parts of a mask that are large enough, the largest first."""
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((WINDOW, WINDOW)))
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(np.asarray(closed, np.uint8))
    found = []
    for number in range(1, count):
        left, top, width, height, cells = (int(each) for each in boxes[number])
        area = cells / mask.size
        if area < LEAST_AREA:
            continue
        sure = float(np.clip(strength[labels == number].mean(), 0.0, 1.0))
        box = (round(left * scale), round(top * scale), round(width * scale), round(height * scale))
        found.append(ViewChange(box, area, sure))
    return sorted(found, key=lambda each: -each.area)


def grey_of(picture: Picture) -> Grey:
    """Return a picture in grey."""
    if picture.ndim == 2:
        return picture
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)


def _scaled(picture: Picture) -> Picture:
    if picture.shape[1] <= WIDTH:
        return picture
    size = (WIDTH, max(1, round(picture.shape[0] * WIDTH / picture.shape[1])))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def registration(
    before: Grey, now: Grey, judged: tuple[Grey | None, Grey | None] = (None, None)
) -> npt.NDArray[Any] | None:
    """Return the homography that lays the new picture over the old one; None without one.

    Args:
        before: The old picture.
        now: The new one.
        judged: Of each, where features count, as bytes that are not 0; None: everywhere.
    """
    # Evened out, so that a dim picture has features, too.
    even = cv2.createCLAHE(3.0, (8, 8))
    finder = cv2.ORB.create(1500, fastThreshold=7)
    points, seen = finder.detectAndCompute(even.apply(before), judged[0])
    others, found = finder.detectAndCompute(even.apply(now), judged[1])
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


def _parallax(before: Grey, now: Grey) -> tuple[Floats, Floats]:
    """Return the column and row in the new picture of each pixel of the old one, by dense flow."""
    finder = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    flow = finder.calc(_evened(before), _evened(now), np.zeros((*before.shape, 2), np.float32))
    across, down = (cv2.medianBlur(np.ascontiguousarray(flow[..., each]), 5) for each in (0, 1))
    far = np.hypot(across, down) > FARTHEST
    rows, columns = np.indices(before.shape, np.float32)
    moved = (columns + np.where(far, 0.0, across), rows + np.where(far, 0.0, down))
    return np.asarray(moved[0], np.float32), np.asarray(moved[1], np.float32)


def _evened(picture: Grey) -> Grey:
    """Return a picture with the same brightness and contrast everywhere."""
    values = picture.astype(np.float32)
    values -= cv2.GaussianBlur(values, (0, 0), 8.0)
    deviation = np.sqrt(cv2.GaussianBlur(values * values, (0, 0), 8.0))
    return np.clip(128.0 + 40.0 * values / (deviation + 6.0), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class _Correlation:
    """How two pictures correlate window by window, each (rows, columns).

    Attributes:
        best: The best correlation of the windows around, -1 to 1.
        deviation: The larger of the windows' standard deviations, grey levels.
        exposed: Where neither is white or black through and through.
    """

    best: Floats
    deviation: Floats
    exposed: npt.NDArray[np.bool_]


def _correlation(first: Floats, second: Floats, window: int) -> _Correlation:
    def mean(values: npt.NDArray[Any]) -> Floats:
        return np.asarray(cv2.blur(values, (window, window)), np.float32)

    one, other = mean(first), mean(second)
    deviation = np.sqrt(np.maximum(mean(first * first) - one * one, 0.0))
    deviation_now = np.sqrt(np.maximum(mean(second * second) - other * other, 0.0))
    together = mean(first * second) - one * other
    floor = PLAIN * PLAIN / 2
    correlation = (together + floor) / (deviation * deviation_now + floor)
    # A pixel off along an edge costs correlation; the best of the neighbours is what counts.
    best = np.asarray(cv2.dilate(correlation.astype(np.float32), np.ones((5, 5))), np.float32)
    exposed = (np.minimum(one, other) > 8.0) & (np.maximum(one, other) < 247.0)
    return _Correlation(best, np.maximum(deviation, deviation_now), np.asarray(exposed, np.bool_))


@dataclass(frozen=True)
class _Differences:
    """How two pictures that are laid over each other differ, each (rows, columns).

    Attributes:
        correlation: The best of the windows around, -1 to 1; 1 where both are plain.
        colour: How far the ratios of the channels are apart, as logarithms; 0 in grey.
        judged: Where both show enough for that.
    """

    correlation: Floats
    colour: Floats
    judged: npt.NDArray[np.bool_]


def _differences(before: Picture, laid: Picture, covered: npt.NDArray[np.bool_]) -> _Differences:
    first = grey_of(before).astype(np.float32)
    second = grey_of(laid).astype(np.float32)
    light = np.log(second + OFFSET) - np.log(first + OFFSET)
    common = float(np.median(light[covered])) if covered.any() else 0.0
    # In steps of 1.2 %, as the median of a wide window takes bytes.
    steps = np.clip((light - common + 1.5) * 85.0, 0, 255).astype(np.uint8)
    smooth = cv2.medianBlur(steps, LIGHT).astype(np.float32) / 85.0 - 1.5 + common
    even = (second + OFFSET) * np.exp(-smooth) - OFFSET

    texture = _correlation(first, even, WINDOW)
    best = np.where(texture.deviation > TEXTURED, texture.best, 1.0).astype(np.float32)
    # What is white or black through and through in one of them has lost what was there.
    judged = _correlation(first, second, WINDOW).exposed & covered & (np.exp(smooth) > DIMMED)
    colour = np.zeros_like(best)
    if before.ndim == 3:
        colour = _colour_change(before, laid, first, second, covered)
    return _Differences(best, colour, np.asarray(judged, np.bool_))


def _colour_change(
    before: Picture, laid: Picture, first: Floats, second: Floats, covered: npt.NDArray[np.bool_]
) -> Floats:
    """Return how far the ratios of the channels are apart, without what the camera did to all."""
    ratios = []
    for picture in (before, laid):
        soft = cv2.blur(picture.astype(np.float32), (7, 7)) + 6.0
        ratios.append(np.log(soft[..., ::2] / soft[..., 1:2]))
    change = ratios[1] - ratios[0]
    dark = np.minimum(first, second) < COLOUR_DARK
    counted = covered & ~dark
    # A new thing stands where the old colour is that of much else; where one has gone, the new one.
    apart = [
        np.hypot(*np.moveaxis(change - _common(change, _classes(each, grey), counted), 2, 0))
        for each, grey in zip(ratios, (first, second), strict=True)
    ]
    return np.where(dark, 0.0, np.maximum(*apart)).astype(np.float32)


def _classes(ratios: Floats, grey: Floats) -> npt.NDArray[np.int32]:
    """Return to which of 1,024 colours each pixel belongs."""
    steps = np.clip(np.round((ratios + 1.2) / 0.15), 0, 15).astype(np.int32)
    brightness = np.clip(grey // 64, 0, 3).astype(np.int32)
    return np.asarray((steps[..., 0] * 16 + steps[..., 1]) * 4 + brightness, np.int32)


def _common(
    change: Floats, classes: npt.NDArray[np.int32], counted: npt.NDArray[np.bool_]
) -> Floats:
    """Return the median change of each pixel's class, (rows, columns, 2).

    Of a class some 400 to 800 pixels count, of few all.
    """
    pixels = np.flatnonzero(counted)[::3]
    names = classes.ravel()[pixels].astype(np.int16)  # numpy sorts these in linear time
    order = np.argsort(names, kind='stable')
    names, values = names[order], change.reshape(-1, 2)[pixels][order]
    starts = np.flatnonzero(np.diff(names, prepend=-1))
    sizes, present = np.diff(starts, append=len(names)), names[starts]
    steps = np.maximum(1, sizes // 400)
    taken = (np.arange(len(names)) - np.repeat(starts, sizes)) % np.repeat(steps, sizes) == 0
    names, values = names[taken], values[taken]
    sizes = -(-sizes // steps)
    starts = np.cumsum(sizes) - sizes
    lower, upper = starts + (sizes - 1) // 2, starts + sizes // 2
    medians = np.zeros((1024, 2), np.float32)
    # in double precision: single has steps of 0.008 at the last classes
    apart = 64.0 * names.astype(float)
    for axis in (0, 1):
        # All classes at once: logarithms of ratios of bytes lie far less than 32 from 0.
        ordered = np.sort(apart + values[:, axis])
        medians[present, axis] = (ordered[lower] + ordered[upper]) / 2 - 64.0 * present
    return np.take(medians, classes, axis=0)
