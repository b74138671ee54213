"""Whether markers hang where a viewpoint's reference shows them: there, moved, gone, or twice.

The new picture is laid over the reference. A marker that is read there at its old spot is there;
read elsewhere, the side of the square tells how far away, in metres. One that is not read is gone
only if its spot was in view: what surrounds the spot has to look as it did, so that nobody stands
before it, and the spot itself has to look otherwise, so that the reading did not just fail. In any
other case nothing is known. What is found counts after several pictures in a row.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from surveillance_perception.observation.views import Floats, Grey, Picture, grey_of, registration

Array = npt.NDArray[np.float64]

MOVED = 0.22
"""A marker seen so far from where it hung hangs elsewhere, metres.

That is what was moved by 0.3 m, less what a view is off.
"""
NEAR = 0.5
"""And one seen nearer than so many of its sides is at its spot."""
LEAST_SIDE = 8.0
"""Smaller spots show too little to be judged, pixels."""
INNER, OUTER = 1.8, 2.8
"""What surrounds a spot lies between so many sides: outside of the sheet that the marker is on."""
SHIFT = 3
"""Things beside the wall that most of a picture shows are a few pixels off."""
LOOKS_ALIKE = 0.7
"""Share of what surrounds a spot that must be as it was."""
OF_LIGHT = (0.65, 1.5)
"""The surroundings may be so much lighter or darker than the picture as a whole."""
STILL_THERE = 0.55
"""Correlation with the marker's own picture from which it may hang there unread."""
MOST_TURNED = 0.1
"""A turn that is larger makes another view, rad."""
AROUND = 120
"""A marker that is not read is looked for by its picture so far around, pixels."""
AGREED = 3
"""So many pictures in a row must agree."""


@dataclass(frozen=True)
class SeenMarker:
    """A marker in a picture.

    Attributes:
        number: Its id.
        corners: (4, 2), column and row of its corners, pixels.
        side: Of its black square, metres; 0: not known.
        distance: From the camera, along its axis, metres; 0: not known.
    """

    number: int
    corners: Array
    side: float = 0.0
    distance: float = 0.0

    @property
    def middle(self) -> Array:
        """Return its middle, (2,), pixels."""
        return np.asarray(self.corners.mean(axis=0))

    @property
    def pixels(self) -> float:
        """Return the mean length of its sides, pixels."""
        steps = self.corners - np.roll(self.corners, 1, axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).mean())

    def scaled(self, factor: float) -> SeenMarker:
        """Return it in a picture of another size."""
        return replace(self, corners=self.corners * factor)

    def away_from(self, other: SeenMarker) -> float:
        """Return how far it is from another one on the same wall, metres; 0 within its spot.

        The other one's square tells how metres of the wall look, also from aside.
        """
        pixels = float(np.hypot(*(self.middle - other.middle)))
        side = other.side or self.side
        if pixels < NEAR * other.pixels or not side:
            return 0.0
        square = np.array([[0, 0], [side, 0], [side, side], [0, side]], np.float32)
        onto_wall = cv2.getPerspectiveTransform(other.corners.astype(np.float32), square)
        (where,) = cv2.perspectiveTransform(self.middle[None, None], onto_wall)[0]
        return float(np.hypot(*(where - side / 2)))

    def to_json(self) -> list[Any]:
        """Return it as plain values."""
        return [
            self.number,
            self.side,
            self.distance,
            *(round(float(each), 2) for each in self.corners.flat),
        ]

    @classmethod
    def from_json(cls, values: Sequence[float]) -> SeenMarker:
        """Return what `to_json` gave.

        Raises:
            ValueError, TypeError: It is something else.
        """
        number, side, distance, *corners = values
        where = np.asarray(corners, float).reshape(4, 2)
        return cls(int(number), where, float(side), float(distance))


@dataclass(frozen=True)
class MarkerFinding:
    """What one picture says of one marker.

    Attributes:
        number: Its id.
        state: here, moved, missing, double or new; new: the reference shows something else there.
        at: Where in the reference it is seen elsewhere; None where it is not.
    """

    number: int
    state: str
    at: SeenMarker | None = None


def compare_markers(
    reference: Picture,
    hung: Mapping[int, SeenMarker],
    picture: Picture,
    seen: Sequence[SeenMarker],
    turned: float = math.nan,
) -> list[MarkerFinding] | None:
    """Return what a picture says of the markers; those that it says nothing of are left out.

    Args:
        reference: The view as it is normally.
        hung: The markers in it, in its pixels.
        picture: The view now.
        seen: The markers in it, in its pixels.
        turned: How far the camera is turned to the left since, rad, where it stands where it stood;
            nan: not known.

    Returns:
        The findings; None where the pictures cannot be laid over each other.
    """
    factor = reference.shape[1] / picture.shape[1]
    if factor != 1.0:
        size = reference.shape[1], reference.shape[0]
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    # Not by the markers: on a bare wall one that was moved would be laid over its old spot.
    apart = (
        _apart_from(hung.values(), reference.shape),
        _apart_from((each.scaled(factor) for each in seen), picture.shape),
    )
    onto = registration(grey_of(reference), grey_of(picture), apart)
    if onto is None:
        onto = _turned_onto(hung, turned)
    if onto is None:
        return None
    laid = _Laid.of(reference, picture, onto)
    now: dict[int, list[SeenMarker]] = {}
    for each in seen:
        corners = cv2.perspectiveTransform((each.corners * factor)[None], onto)[0]
        now.setdefault(each.number, []).append(replace(each, corners=np.asarray(corners, float)))
    found = []
    for number, before in hung.items():
        state, at = _state(before, now.get(number, []), laid)
        if state:
            found.append(MarkerFinding(number, state, at))
    for number, some in now.items():
        if number not in hung:
            fresh = laid.is_new(some[0])
            found.append(MarkerFinding(number, 'new' if fresh else 'here', some[0]))
    return found


def _apart_from(markers: Iterable[SeenMarker], shape: tuple[int, ...]) -> Grey:
    """Return where a picture shows none of some markers, with their sheets."""
    mask = np.full(shape[:2], 255, np.uint8)
    for each in markers:
        cv2.fillConvexPoly(mask, np.round(_grown(each, INNER)).astype(np.int32), 0)
    return mask


def _turned_onto(hung: Mapping[int, SeenMarker], turned: float) -> npt.NDArray[Any] | None:
    """Return the shift that a turn of the camera makes; None where it is not known.

    For rooms of plain walls, in which features fail. A marker's side and distance tell the focal
    length, in pixels of the reference.
    """
    focal = [each.pixels * each.distance / each.side for each in hung.values() if each.side > 0]
    focal = [each for each in focal if each > 0]
    if not focal or not abs(turned) <= MOST_TURNED:
        return None
    # Turned to the left, all moves to the right.
    return np.array([[1.0, 0.0, -float(np.median(focal)) * turned], [0, 1, 0], [0, 0, 1]])


def _state(
    before: SeenMarker, now: Sequence[SeenMarker], laid: _Laid
) -> tuple[str, SeenMarker | None]:
    away = sorted((each.away_from(before), index) for index, each in enumerate(now))
    if not away:
        return ('missing' if laid.is_gone(before) else ''), None
    (nearest, _), (farthest, index) = away[0], away[-1]
    if nearest < MOVED <= farthest:
        return 'double', now[index]
    if nearest >= MOVED:
        return 'moved', now[index]
    return 'here', None


@dataclass(frozen=True)
class _Laid:
    """A reference and a picture that was laid over it, in as many channels as both have.

    Attributes:
        before, now: Both, (rows, columns, channels).
        covered: Where the picture shows something, (rows, columns).
        gain: How much lighter it is as a whole.
    """

    before: Floats
    now: Floats
    covered: npt.NDArray[np.bool_]
    gain: float

    @classmethod
    def of(cls, reference: Picture, picture: Picture, onto: npt.NDArray[Any]) -> _Laid:
        if reference.ndim != picture.ndim:
            reference, picture = grey_of(reference), grey_of(picture)
        size = reference.shape[1], reference.shape[0]
        laid = cv2.warpPerspective(picture, onto, size, flags=cv2.INTER_LINEAR)
        white = np.full(picture.shape[:2], 255, np.uint8)
        covered = cv2.warpPerspective(white, onto, size) == 255
        before, now = (
            np.asarray(cv2.blur(each, (3, 3)), np.float32).reshape(*each.shape[:2], -1)
            for each in (reference, np.asarray(laid, np.uint8))
        )
        gain = 1.0
        if covered.any():
            gain = float(np.median((now[covered] + 4.0) / (before[covered] + 4.0)))
        return cls(before, now, np.asarray(covered, np.bool_), max(gain, 1e-3))

    def is_gone(self, spot: SeenMarker) -> bool:
        """Tell whether a marker's spot is in view and shows something else."""
        if spot.pixels < LEAST_SIDE:
            return False
        whole = self._between(spot, 0.0, OUTER)
        # All of it has to be in both pictures.
        if not _is_inside(spot, OUTER, self.covered.shape) or not self.covered[whole].all():
            return False
        # On each of its sides: somebody may stand before it who is narrower than what surrounds it.
        sides = self._sides(spot)
        return all(map(self._looks_as_before, sides)) and not self._shows_nearby(spot)

    def is_new(self, seen: SeenMarker) -> bool:
        """Tell whether the reference shows something else where a marker is read now."""
        if seen.pixels < LEAST_SIDE or not _is_inside(seen, 1.0, self.covered.shape):
            return False
        return self._correlation(seen) < STILL_THERE

    def _shows_nearby(self, spot: SeenMarker) -> bool:
        """Tell whether the marker's own picture is to be found around its spot, read or not."""
        low, high = _grown(spot, 1.2).min(axis=0), _grown(spot, 1.2).max(axis=0)
        (left, top), (right, bottom) = np.maximum(low, 0).astype(int), np.ceil(high).astype(int)
        shown = self.before[top:bottom, left:right].mean(axis=2)
        around = self.now[
            max(0, top - AROUND) : bottom + AROUND, max(0, left - AROUND) : right + AROUND
        ].mean(axis=2)
        alike = cv2.matchTemplate(around, shown, cv2.TM_CCOEFF_NORMED)
        return float(alike.max()) >= STILL_THERE

    def _between(self, spot: SeenMarker, inner: float, outer: float) -> npt.NDArray[np.bool_]:
        mask = np.zeros(self.covered.shape, np.uint8)
        for times, value in ((outer, 1), (inner, 0)):
            if times:
                corners = np.round(_grown(spot, times)).astype(np.int32)
                cv2.fillConvexPoly(mask, corners, value)
        return np.asarray(mask == 1, np.bool_)

    def _sides(self, spot: SeenMarker) -> list[npt.NDArray[np.bool_]]:
        """Return what lies above, below and beside a spot, (rows, columns) each."""
        inner, outer = _grown(spot, INNER), _grown(spot, OUTER)
        sides = []
        for first, second in ((0, 1), (1, 2), (2, 3), (3, 0)):
            mask = np.zeros(self.covered.shape, np.uint8)
            around = np.array([inner[first], inner[second], outer[second], outer[first]])
            cv2.fillConvexPoly(mask, np.round(around).astype(np.int32), 1)
            sides.append(np.asarray(mask == 1, np.bool_))
        return sides

    def _looks_as_before(self, ring: npt.NDArray[np.bool_]) -> bool:
        rows, columns = np.nonzero(ring)
        before = self.before[rows, columns]
        best = 0.0
        for down, across in _shifts():
            r = np.clip(rows + down, 0, ring.shape[0] - 1)
            c = np.clip(columns + across, 0, ring.shape[1] - 1)
            now = self.now[r, c] / self.gain
            light = float(np.median((now + 4.0) / (before + 4.0)))
            if not OF_LIGHT[0] <= light <= OF_LIGHT[1]:
                continue
            alike = np.abs(now / light - before) <= 10.0 + 0.12 * before
            best = max(best, float(alike.all(axis=1).mean()))
        return best >= LOOKS_ALIKE

    def _correlation(self, spot: SeenMarker) -> float:
        """Return the best correlation of both within a spot, -1 to 1."""
        rows, columns = np.nonzero(self._between(spot, 0.0, 1.2))
        before = self.before[rows, columns].mean(axis=1)
        best = -1.0
        for down, across in _shifts():
            r = np.clip(rows + down, 0, self.covered.shape[0] - 1)
            c = np.clip(columns + across, 0, self.covered.shape[1] - 1)
            now = self.now[r, c].mean(axis=1)
            scale = float(before.std() * now.std())
            if scale > 1.0:
                covariance = float(((before - before.mean()) * (now - now.mean())).mean())
                best = max(best, covariance / scale)
        return best


def _grown(spot: SeenMarker, times: float) -> Array:
    return np.asarray(spot.middle + times * (spot.corners - spot.middle))


def _is_inside(spot: SeenMarker, times: float, shape: tuple[int, ...]) -> bool:
    corners = _grown(spot, times)
    return bool((corners >= 0).all() and (corners < (shape[1], shape[0])).all())


def _shifts() -> Iterator[tuple[int, int]]:
    reach = range(-SHIFT, SHIFT + 1)
    return ((down, across) for down in reach for across in reach)


@dataclass
class MarkerMemory:
    """What the last pictures said, over all viewpoints.

    Attributes:
        in_a_row: In how many pictures of a viewpoint in a row a marker was found so, by the
            viewpoint's name and the id.
        at_spot: In which look an id was read last where it hangs.
        elsewhere: The viewpoint that shows an id where it did not hang.
        gone: The viewpoint that shows that it is gone.
    """

    in_a_row: dict[tuple[str, int], tuple[str, int]] = field(default_factory=dict)
    at_spot: dict[int, int] = field(default_factory=dict)
    elsewhere: dict[int, str] = field(default_factory=dict)
    gone: dict[int, str] = field(default_factory=dict)

    def keep(self, views: Container[str]) -> None:
        """Forget what other viewpoints showed than these: they are looked from no more."""
        self.in_a_row = {key: each for key, each in self.in_a_row.items() if key[0] in views}
        self.elsewhere = {key: each for key, each in self.elsewhere.items() if each in views}
        self.gone = {key: each for key, each in self.gone.items() if each in views}

    def take(
        self, view: str, findings: Iterable[MarkerFinding], hung: Iterable[int], look: int
    ) -> list[MarkerFinding]:
        """Take what a picture of a viewpoint says, and return what is settled by it.

        Args:
            view: The viewpoint's name.
            findings: Of `compare_markers`.
            hung: The ids that the viewpoint's reference shows.
            look: The number of the stay at a place.

        Returns:
            Each with the state here, moved, missing or double; new: nothing shows yet whether the
            marker hangs there instead or as well.
        """
        by_id = {each.number: each for each in findings}
        settled = []
        for number in {*hung, *by_id, *(n for v, n in self.in_a_row if v == view)}:
            finding = by_id.get(number)
            if finding is None:
                # Elsewhere it was read, here it is not any more, or nothing is known.
                before = self.in_a_row.pop((view, number), None)
                if before is not None and before[0] == 'new':
                    self.elsewhere.pop(number, None)
                continue
            state, count = self.in_a_row.get((view, number), ('', 0))
            count = count + 1 if state == finding.state else 1
            self.in_a_row[view, number] = finding.state, count
            if finding.state == 'here':
                self.at_spot[number] = look
                came_back = self.gone.pop(number, None) is not None
                if came_back or (self.elsewhere.get(number) == view and count >= AGREED):
                    self.elsewhere.pop(number, None)
            if finding.state in ('moved', 'double', 'new') and count >= AGREED:
                self.elsewhere[number] = view
            if finding.state in ('missing', 'moved') and count >= AGREED:
                self.gone[number] = view
            if count >= AGREED or finding.state == 'here':
                settled.append(
                    MarkerFinding(number, self._verdict(finding, view, look), finding.at)
                )
        return settled

    def _verdict(self, finding: MarkerFinding, view: str, look: int) -> str:
        number, state = finding.number, finding.state
        other = self.elsewhere.get(number)
        if state == 'here' and other is not None and other != view:
            # Read at its spot after it was read in another view.
            return 'double'
        if state == 'new':
            if number in self.gone:
                return 'moved'
            return 'double' if self.at_spot.get(number) == look else 'new'
        if state == 'missing' and other is not None:
            return 'moved'
        return state
