"""Where markers hang on the map, and whether each hangs there still: there, moved, gone, or twice.

A marker's size is known, so one picture tells where it is before the camera (perspective-n-point),
and the camera's pose tells where that is on the map. The first pictures that agree decide where it
hangs. Read elsewhere, by more than the errors of both, it has moved.

One that is not read is gone only where its spot was in view: the map tells where in the picture
that is. Its surroundings have to look as they did when it was read last, as far as the camera's
pose is unsure, so that nobody stands before it; and its own picture is to be found nowhere about,
so that the reading did not just fail. In any other case nothing is known. What is found counts
after several pictures in a row.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from indoor_watch.views import Picture, grey_of

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

# --- what is decided by, and why it is so much ---

SURE = 3.0
"""What counts is so many standard deviations: 1 error of 370 is larger, along one axis."""
MOVED = 0.2
"""A marker read so far from where it hung hangs elsewhere, metres, if that is `SURE`, too: so much
are three deviations of this project's localisation (.03 m, .02 rad) at 3 m, from where a check is
looked at (`viewpoints.CHECK_RANGE`)."""
AGREED, READ = 3, 2
"""So many pictures in a row must agree that it is gone, and so many that it is read elsewhere. A
reading is a code that was checked; that nothing is read has many causes. In a mission one picture
alone had put two of eight markers .3 m off."""
MOSTLY = 0.6
"""Where so much of a spot's side, from its middle on, is in view, a marker that is read elsewhere
does not hang there. Without a reading elsewhere all of the spot has to be in view."""

LEAST_SIDE = 9.0
"""Smaller spots are not judged, pixels: 1.5 for each of the six cells of a code of 4 by 4."""
STEEPEST = 1.2
"""Nor those so far from straight ahead, rad: a marker is a third as wide there as it is high."""
LEVEL = (0.01, 0.007)
"""Standard deviations of a camera's height, metres, and of its pitch, rad: a floor indoors is even,
and the pose on it is what a robot does not know."""

SCALE = 16
"""Surroundings are compared at so many pixels to the side of a marker: so large is one of .2 m at 7
m in a picture of 640 pixels and 60 degrees, and nearer ones have no less detail."""
SHEET = 1.8
"""A printed marker's sheet is up to so large, sides of the marker: .4 of white to each side."""
AROUND = SHEET + 1.0
"""What surrounds a spot lies outside of its sheet, and within half a side around that."""
MARGIN = 0.1
"""With so much of its white, sides, a marker's own picture is looked for: so it has an outline."""
FARTHEST = 1.5
"""Where the camera's pose leaves more open than this, nothing is called gone, sides: for a marker
of .2 m that is .3 m, three deviations of this project's localisation at 4.8 m, and at less where it
is not known as well where the marker hung."""
SEARCHED = 1.0
"""So much farther around a marker is looked for by its picture, sides: one that slipped, or that
the pose is further off than it says, is there and not gone."""
ALIKE = 0.5
"""Normalised correlation from which pictures show the same: what they have in common is as strong
as what they have not. Then a marker that was not read hangs there still, and surroundings are laid
by their features."""
SAME_ASPECT, SAME_DISTANCE = 0.35, 1.6
"""Surroundings are compared with those seen from nearly the same side, rad, and distance, times:
what stands half a side before the wall shifts against it by a fifth of a side at this angle."""
ASPECTS = math.ceil(STEEPEST / SAME_ASPECT)
"""Of each marker the surroundings are kept from so many sides: all those from which it is
judged."""
FOREIGN = 0.3
"""What looks otherwise around a spot may have so much area, square sides of the marker: an arm
before the spot, as long as a side, has as much. Lines of less than 3 pixels of `SCALE` do not
count, as texture is laid a pixel off."""
OF_LIGHT = (0.6, 1.6)
"""The surroundings may be so much lighter or darker than the picture as a whole. A wall keeps about
its part of the light in a room; what is beyond is another surface, plain as it may be."""

COMMON = 0.01
"""Standard deviation that no number of pictures takes away, metres: all share the size that the
marker is said to have, and the camera's place on the robot."""
GLANCED = 8.0
"""From so near a marker that is read in passing tells where to look for it, metres: beyond, one of
.2 m has 14 pixels of 640 over 60 degrees, and its place is off by half a metre."""
ENOUGH = 20
"""So many pictures decide where a marker hangs; later ones do not let it wander."""
SAME_SIZE = 0.1
"""A marker whose side differs by this part or more is another panel."""

# --- bounds of what is taken at all ---

MOST = 100
"""So many markers are kept; of those that are no more than a misreading one makes way."""
REACH, LARGEST = 100.0, 10.0
"""No marker is read farther away, nor larger, metres: that is no measurement. Nor does anybody know
where a camera is that is off by a standard deviation of more than `REACH`."""
LARGEST_MAP = 1e8
"""No map has a place farther from its origin, metres."""


@dataclass(frozen=True)
class CameraView:
    """From where a picture was taken.

    Attributes:
        pose: (4, 4), from the camera's optical frame to the map, metres.
        matrix: (3, 3), from the optical frame to pixels of the picture.
        deviation: Standard deviation of the position, metres.
        turn: And of the direction, rad.
    """

    pose: Array
    matrix: Array
    deviation: float
    turn: float

    @property
    def at(self) -> Array:
        """Return where the camera is, (3,), metres."""
        return np.asarray(self.pose[:3, 3])

    @property
    def is_known(self) -> bool:
        """Whether that is anything: on a map, and not doubted altogether."""
        is_on_map = float(np.abs(self.pose).max()) <= LARGEST_MAP
        return is_on_map and self.deviation <= REACH and self.turn <= REACH

    def doubt(self, point: Array) -> float:
        """Return the standard deviation of a point's place across the line of sight, metres."""
        return math.hypot(self.deviation, self.turn * float(np.linalg.norm(point - self.at)))

    def onto_wall(self, position: Array, rotation: Array) -> Array:
        """Return the homography (3, 3) from metres on a marker's plane to pixels."""
        turn = self.pose[:3, :3].T
        plane = np.column_stack(
            [turn @ rotation[:, 0], turn @ rotation[:, 1], turn @ (position - self.at)]
        )
        return np.asarray(self.matrix @ plane)

    def pixels(self, points: Array) -> Array:
        """Return where points (n, 3) of the map are in the picture, (n, 2); nan: behind it."""
        seen = (points - self.at) @ self.pose[:3, :3]
        ahead = np.where(seen[:, 2:] > 0.05, seen[:, 2:], np.nan)
        return np.asarray(seen @ self.matrix.T)[:, :2] / ahead


@dataclass(frozen=True)
class SeenMarker:
    """A marker in a picture.

    Attributes:
        number: Its id.
        side: Of its black square, metres; 0: not known.
        position: (3,) of its middle in the camera's optical frame, metres; None: not measured.
        rotation: (3, 3) from its own frame, x right, y up, z out of it, to the optical one.
        covariance: (3, 3) of the position, square metres.
    """

    number: int
    side: float = 0.0
    position: Array | None = None
    rotation: Array = field(default_factory=lambda: np.eye(3))
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def is_placed(self) -> bool:
        """Whether it was measured where it is."""
        return (
            self.position is not None
            and float(np.abs(self.position).max()) <= REACH
            and 0.0 < self.side <= LARGEST
            and float(np.abs(self.covariance).max()) <= REACH**2
        )


@dataclass(frozen=True)
class MarkerFinding:
    """What pictures say of one marker.

    Attributes:
        number: Its id.
        state: here, moved, missing or double.
        position: Where that is, map frame, metres.
    """

    number: int
    state: str
    position: tuple[float, float, float]


@dataclass(frozen=True)
class HungSpot:
    """Where a marker hangs.

    Attributes:
        number: Its id.
        position: Map frame, metres.
        facing: Where it looks to, map frame, rad; of one that was read in passing, from where
            that was. None: it was never read.
        side: Of its black square, metres; 0: not known.
        is_open: Whether it was not read when its spot was in view last, and what that means is not
            settled.
    """

    number: int
    position: tuple[float, float, float]
    facing: float | None
    side: float
    is_open: bool = False


@dataclass(frozen=True)
class _Aspect:
    """How a marker and what surrounds it look from one side.

    Attributes:
        camera: From where, map frame, (3,), metres.
        position, rotation: Of the marker, as measured in that picture, map frame.
        picture: Its plane from ahead, `SCALE` pixels a side of the marker.
        shown: Which of these the picture showed.
        light: Median of the whole picture, grey levels.
    """

    camera: Array
    position: Array
    rotation: Array
    picture: Picture
    shown: Mask
    light: float

    def to_json(self) -> dict[str, Any]:
        """Return it as plain values."""
        good, data = cv2.imencode('.jpg', self.picture, [cv2.IMWRITE_JPEG_QUALITY, 92])
        return {
            'camera': self.camera.tolist(),
            'position': self.position.tolist(),
            'rotation': self.rotation.tolist(),
            'picture': base64.b64encode(data.tobytes() if good else b'').decode(),
            'shown': base64.b64encode(np.packbits(self.shown).tobytes()).decode(),
            'light': self.light,
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> _Aspect:
        """Return what `to_json` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        data = np.frombuffer(base64.b64decode(values['picture']), np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
        size = 2 * round((AROUND / 2 + FARTHEST) * SCALE)
        if picture is None or picture.shape[:2] != (size, size):
            raise ValueError(f"a marker's surroundings: expected {size} by {size} pixels")
        bits = np.frombuffer(base64.b64decode(values['shown']), np.uint8)
        shown = np.unpackbits(bits, count=size * size).reshape(size, size).astype(np.bool_)
        return cls(
            _array(values['camera'], 3),
            _array(values['position'], 3),
            _array(values['rotation'], 3, 3),
            np.asarray(picture, np.uint8),
            shown,
            float(values['light']),
        )


@dataclass
class _Spot:
    """Where a marker hangs.

    Attributes:
        side: Of its black square, metres.
        position: (3,), map frame, metres.
        covariance: (3, 3), square metres.
        pictures: How many decided that.
        is_given: Whether that is known from elsewhere.
        aspects: How it looked, the newest last.
    """

    side: float
    position: Array
    covariance: Array
    pictures: int = 1
    is_given: bool = False
    aspects: list[_Aspect] = field(default_factory=list)


@dataclass
class _Away:
    """Where else a marker was read.

    Attributes:
        position: (3,), map frame, metres.
        rotation: (3, 3), from its own frame to the map.
        side: Of its black square, metres.
        read: In how many pictures it was read there.
        unread: In how many in a row it was in view there and not read.
    """

    position: Array
    rotation: Array
    side: float
    read: int = 1
    unread: int = 0


class HungMarkers:
    """Where each marker hangs, and what the last pictures said of it.

    Args:
        given: Where markers hang by their file, map frame, metres, and their sides are not known.
    """

    def __init__(self, given: Mapping[int, tuple[float, float, float]] | None = None) -> None:
        exact = np.eye(3) * 1e-4
        self._given = {number: np.asarray(where, float) for number, where in (given or {}).items()}
        self._spots = {
            number: _Spot(0.0, where, exact, is_given=True) for number, where in self._given.items()
        }
        # Those that hang otherwise than their file says, by a person's word.
        self._accepted: set[int] = set()
        # In how many pictures in a row each was found so.
        self._in_a_row: dict[int, tuple[str, int]] = {}
        self._away: dict[int, _Away] = {}
        self._gone: set[int] = set()
        # Those that were not read where they hang, and nobody knows why as yet.
        self._open: set[int] = set()
        self._glanced: dict[int, HungSpot] = {}
        self._read_at: dict[int, int] = {}

    def position_of(self, number: int) -> tuple[float, float, float] | None:
        """Return where a marker hangs, map frame, metres; None: it was never read."""
        spot = self._spots.get(number)
        return None if spot is None else _plain(spot.position)

    def pass_by(self, pose: Array, seen: Sequence[SeenMarker]) -> None:
        """Take markers that were read in passing: where to look for them, and no more.

        Args:
            pose: (4, 4), roughly, from the camera's optical frame to the map, metres.
            seen: The markers.
        """
        for each in seen:
            if each.position is None or each.number in self._spots:
                continue
            position = pose[:3, :3] @ each.position + pose[:3, 3]
            if float(np.linalg.norm(each.position)) > GLANCED:
                continue
            if each.number in self._glanced or len(self._glanced) < MOST:
                # Far away its tilt is guesswork: it faces where it is read, more or less.
                dx, dy, _ = pose[:3, 3] - position
                facing = math.atan2(float(dy), float(dx))
                spot = HungSpot(each.number, _plain(position), facing, each.side)
                self._glanced[each.number] = spot

    def spots(self) -> list[HungSpot]:
        """Return where markers hang, as far as that is known, also those read in passing."""
        found = {
            number: HungSpot(
                number,
                _plain(spot.position),
                None if not spot.aspects else _facing(spot.aspects[-1].rotation),
                spot.side,
                number in self._open,
            )
            for number, spot in self._spots.items()
        }
        return [each for _, each in sorted({**self._glanced, **found}.items())]

    def accept(self, number: int) -> None:
        """Take that a marker hangs rightly where it was read last, or nowhere."""
        away = self._away.pop(number, None)
        spot = self._spots.pop(number, None)
        self._gone.discard(number)
        self._open.discard(number)
        self._in_a_row.pop(number, None)
        if number in self._given:
            self._accepted.add(number)
        if away is not None and spot is not None:
            covariance = spot.covariance + np.eye(3) * 1e-3
            self._spots[number] = _Spot(away.side, away.position, covariance, away.read)

    def take(
        self,
        picture: Picture,
        view: CameraView,
        seen: Sequence[SeenMarker],
        visit: int,
        is_clear: Callable[[Array], bool] = lambda _: True,
    ) -> list[MarkerFinding]:
        """Take what a picture shows of the markers, and return what is settled by it.

        Args:
            picture: The picture.
            view: From where it was taken.
            seen: The markers in it.
            visit: The number of the visit.
            is_clear: Tells of a point of the map, (3,), whether nothing is known to stand before.

        Returns:
            Of each marker that is settled what is the case.
        """
        if not view.is_known:
            return []
        shown = _Shown(picture, view)
        by_id: dict[int, list[SeenMarker]] = {}
        for each in seen:
            by_id.setdefault(each.number, []).append(each)
        settled = []
        for number in sorted({*by_id, *self._spots}):
            some = [each for each in by_id.get(number, ()) if each.is_placed]
            if number in by_id and not some:
                continue  # it is read, and nobody knows where
            found = self._judge(number, some, shown, visit, is_clear)
            if found is not None:
                settled.append(found)
        return settled

    def _judge(
        self,
        number: int,
        some: Sequence[SeenMarker],
        shown: _Shown,
        visit: int,
        is_clear: Callable[[Array], bool],
    ) -> MarkerFinding | None:
        spot = self._spots.get(number)
        if spot is None or not (spot.is_given or spot.pictures >= AGREED):
            self._begin(number, spot, some, shown, visit)
            return None
        here, away = self._sorted(spot, some, shown)
        if here is not None:
            self._learn(spot, here, shown)
        self._note_away(number, away, shown)
        if here is not None:
            state = 'double' if away is not None else 'here'
        elif away is not None:
            state = 'moved' if shown.shows(spot, 0.0, MOSTLY) else 'elsewhere'
        elif some or not shown.shows(spot):
            return None  # it is read too far away to tell, or not in view: as before
        elif is_clear(spot.position) and (number in self._away or shown.is_gone(spot)):
            state = 'moved' if number in self._away else 'missing'
        else:
            if self._in_a_row.get(number, ('', 0))[0] == 'missing':
                del self._in_a_row[number]
            self._note_open(number, number not in self._gone)
            return None
        before, count = self._in_a_row.get(number, ('', 0))
        count = count + 1 if before == state else 1
        self._in_a_row[number] = state, count
        if state == 'missing':
            agreed = count >= AGREED
        else:
            known = self._away.get(number)
            agreed = count >= READ and (known is None or known.read >= READ)
        found = self._settled(number, spot, state, agreed, visit)
        self._note_open(number, here is None and found is None and number not in self._gone)
        return found

    def _note_open(self, number: int, is_open: bool) -> None:
        if is_open:
            self._open.add(number)
        else:
            self._open.discard(number)

    def _begin(
        self, number: int, spot: _Spot | None, some: Sequence[SeenMarker], shown: _Shown, visit: int
    ) -> None:
        """Learn where a marker hangs; one picture alone may be off by far."""
        if len(some) != 1 or (spot is None and not self._makes_way()):
            return
        if spot is not None:
            here, _ = self._sorted(spot, some, shown)
            if here is not None:
                self._learn(spot, here, shown)
                self._read_at[number] = visit
                return
        position, covariance = shown.placed(some[0])
        self._spots[number] = _Spot(some[0].side, position, covariance)
        self._spots[number].aspects.append(shown.aspect(some[0]))

    def _makes_way(self) -> bool:
        """Have one that may be a misreading make way; tell whether there is room."""
        if len(self._spots) < MOST:
            return True
        known = self._spots.items()
        unsure = (n for n, each in known if not each.is_given and each.pictures < AGREED)
        if (oldest := next(unsure, None)) is not None:
            del self._spots[oldest]
        return oldest is not None

    def _sorted(
        self, spot: _Spot, some: Sequence[SeenMarker], shown: _Shown
    ) -> tuple[SeenMarker | None, SeenMarker | None]:
        """Return the one that hangs at its spot, and one that does not."""
        here: SeenMarker | None = None
        away: SeenMarker | None = None
        for each in some:
            position, covariance = shown.placed(each)
            apart = position - spot.position
            distance = float(np.linalg.norm(apart))
            errors = math.sqrt(apart @ np.linalg.solve(covariance + spot.covariance, apart))
            if distance < MOVED:
                here = each
            elif errors >= SURE:
                away = each
        return here, away

    def _learn(self, spot: _Spot, seen: SeenMarker, shown: _Shown) -> None:
        position, covariance = shown.placed(seen)
        if spot.pictures < ENOUGH and not spot.is_given:
            spot.pictures += 1
            # Nearer pictures count for more (Kalman's update of a thing that stands).
            gain = spot.covariance @ np.linalg.inv(spot.covariance + covariance)
            spot.position = spot.position + gain @ (position - spot.position)
            spot.covariance = (np.eye(3) - gain) @ spot.covariance + np.eye(3) * COMMON**2
        if abs(seen.side - spot.side) > SAME_SIZE * spot.side:
            # It was given by a file, or another panel hangs there now.
            spot.side, spot.aspects = seen.side, []
        fresh = shown.aspect(seen)
        others = [each for each in spot.aspects if not _is_seen_alike(each, fresh.camera, 0.5)]
        spot.aspects = [*others, fresh][-ASPECTS:]

    def _note_away(self, number: int, away: SeenMarker | None, shown: _Shown) -> None:
        known = self._away.get(number)
        if away is not None:
            position, _ = shown.placed(away)
            near = known is not None and np.linalg.norm(position - known.position) < MOVED
            read = known.read + 1 if known is not None and near else 1
            rotation = shown.view.pose[:3, :3] @ away.rotation
            self._away[number] = _Away(position, rotation, away.side, read)
        elif known is not None:
            there = shown.shows_at(known.position, known.rotation, known.side)
            known.unread = known.unread + 1 if there else 0
            if known.unread >= AGREED:
                del self._away[number]

    def _settled(
        self, number: int, spot: _Spot, state: str, agreed: bool, visit: int
    ) -> MarkerFinding | None:
        away = self._away.get(number)
        at = spot.position if away is None else away.position
        if state == 'here':
            self._read_at[number] = visit
            if number in self._gone:
                # It was gone, and has come back.
                self._gone.discard(number)
                away = self._away.pop(number, None)
            elif away is not None:
                # Read at its spot after it was read elsewhere, and nothing shows that it left.
                return MarkerFinding(number, 'double', _plain(at)) if agreed else None
            return MarkerFinding(number, 'here', _plain(spot.position))
        if not agreed:
            return None
        if state in ('moved', 'missing'):
            self._gone.add(number)
        elif state == 'elsewhere':
            if number in self._gone or (spot.is_given and number not in self._read_at):
                state = 'moved'
            elif self._read_at.get(number) == visit:
                state = 'double'
            else:
                return None  # nothing shows whether it hangs there instead or as well
        return MarkerFinding(number, state, _plain(at))

    def state(self) -> dict[str, Any]:
        """Return where they hang and how that looks as plain values, for `restore`."""
        spots = {
            str(number): {
                'side': spot.side,
                'position': spot.position.tolist(),
                'covariance': spot.covariance.tolist(),
                'pictures': spot.pictures,
                'aspects': [each.to_json() for each in spot.aspects],
            }
            for number, spot in self._spots.items()
            if not spot.is_given
        }
        accepted = {str(number): self._given[number].tolist() for number in sorted(self._accepted)}
        return {'spots': spots, 'accepted': accepted}

    def restore(self, values: Mapping[str, Any]) -> None:
        """Take what `state` gave.

        Where a marker hangs by its file stays, unless a person accepted otherwise since the file
        says so.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        found, accepted = {}, set()
        for number, where in dict(values['accepted']).items():
            given = self._given.get(int(number))
            if given is not None and np.allclose(given, _array(where, 3)):
                accepted.add(int(number))
        for number, each in dict(values['spots']).items():
            found[int(number)] = _Spot(
                float(each['side']),
                _array(each['position'], 3),
                _array(each['covariance'], 3, 3),
                int(each['pictures']),
                aspects=[_Aspect.from_json(some) for some in each['aspects']],
            )
        given_still = {n: spot for n, spot in self._spots.items() if n not in accepted}
        self._spots, self._accepted = {**found, **given_still}, accepted


class _Shown:
    """A picture with its camera's pose."""

    def __init__(self, picture: Picture, view: CameraView) -> None:
        self.view = view
        self._picture = picture
        self._light = float(np.median(grey_of(picture)[::4, ::4]))

    def placed(self, seen: SeenMarker) -> tuple[Array, Array]:
        """Return where a marker is on the map, (3,), metres, and its covariance, (3, 3)."""
        assert seen.position is not None
        turn = self.view.pose[:3, :3]
        position = np.asarray(turn @ seen.position + self.view.at)
        doubt = np.eye(3) * self.view.doubt(position) ** 2
        return position, np.asarray(turn @ seen.covariance @ turn.T + doubt)

    def aspect(self, seen: SeenMarker) -> _Aspect:
        """Return how a marker that is read, and what surrounds it, look."""
        position, _ = self.placed(seen)
        rotation = np.asarray(self.view.pose[:3, :3] @ seen.rotation)
        plain, shown = self._flat(position, rotation, seen.side, AROUND / 2 + FARTHEST)
        return _Aspect(self.view.at, position, rotation, plain, shown, self._light)

    def shows(self, spot: _Spot, doubted: float = SURE, part: float = 1.0) -> bool:
        """Tell whether a spot is in the picture and large enough.

        Args:
            spot: The spot.
            doubted: Also if the pose is off by so many standard deviations.
            part: So much of it, of its side from its middle on.
        """
        aspect = self._aspect_of(spot)
        if aspect is None:
            return False
        return self.shows_at(spot.position, aspect.rotation, spot.side, doubted, part)

    def shows_at(
        self,
        position: Array,
        rotation: Array,
        side: float,
        doubted: float = SURE,
        part: float = 1.0,
    ) -> bool:
        """Tell that of a place on the map, (3,), and how a marker is turned there, (3, 3)."""
        sight = self.view.at - position
        distance = float(np.linalg.norm(sight))
        if side <= 0.0 or rotation[:, 2] @ sight < distance * math.cos(STEEPEST):
            return False
        corners = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]]) * side
        edges = np.linalg.norm(
            np.diff(self._on_wall(position, rotation, corners), axis=0, append=np.nan)[:3], axis=1
        )
        if not edges.min() >= LEAST_SIDE:
            return False
        # The pose is off on the floor by much, and in height by little.
        across = np.cross([0.0, 0.0, 1.0], sight)
        across *= self.view.doubt(position) / max(float(np.linalg.norm(across)), 1e-9)
        upwards = np.array([0.0, 0.0, math.hypot(LEVEL[0], LEVEL[1] * distance)])
        panel = position + part * corners @ rotation[:, :2].T
        found = np.concatenate(
            [
                self.view.pixels(panel + doubted * (right * across + up * upwards))
                for right in (-1, 1)
                for up in (-1, 1)
            ]
        )
        rows, columns = self._picture.shape[:2]
        return bool(((found >= 0) & (found < (columns, rows))).all())

    def _on_wall(self, position: Array, rotation: Array, points: Array) -> Array:
        """Return where points (n, 2) of a marker's plane, metres, are in the picture, (n, 2)."""
        return self.view.pixels(position + points @ rotation[:, :2].T)

    def is_gone(self, spot: _Spot) -> bool:
        """Tell whether a spot that is in view shows something else than its marker."""
        aspect = self._aspect_of(spot)
        if aspect is None:
            return False
        doubt = SURE * math.hypot(
            self.view.doubt(spot.position), math.sqrt(float(np.trace(spot.covariance)) / 3)
        )
        open_ = doubt / spot.side
        if open_ > FARTHEST:
            return False
        half = AROUND / 2 + open_
        before, there = _cut(aspect.picture, half), _cut(aspect.shown, half)
        now, covered = self._flat(
            spot.position, aspect.rotation, spot.side, half + open_ + SEARCHED
        )
        if _is_found(_cut(aspect.picture, 0.5 + MARGIN), now):
            return False
        reach = half + open_
        now, covered = _cut(now, reach), _cut(covered, reach)
        judged = there & ~_box(len(before), SHEET / 2)
        row, column = _laid(before, judged, now)
        place = slice(row, row + len(before)), slice(column, column + len(before))
        judged &= covered[place]
        near = judged & _box(len(before), AROUND / 2)
        if near.sum() < 0.5 * SCALE**2 * (AROUND**2 - SHEET**2):
            return False
        gain = (self._light + 4.0) / (aspect.light + 4.0)
        foreign = _foreign(before, now[place], judged, gain)
        return foreign <= FOREIGN * SCALE**2

    def _aspect_of(self, spot: _Spot) -> _Aspect | None:
        """Return how a spot looked from nearly here; None: it was never seen from here."""
        here = self.view.at
        near = (each for each in reversed(spot.aspects) if _is_seen_alike(each, here, 1.0))
        return next(near, None)

    def _flat(
        self, position: Array, rotation: Array, side: float, half: float
    ) -> tuple[Picture, Mask]:
        """Return a marker's plane from ahead, so many sides to each side, and what is shown."""
        onto = self.view.onto_wall(position, rotation)
        corners = self._on_wall(position, rotation, np.array([[0.0, 0.0], [side, 0.0]]))
        finer = float(np.linalg.norm(corners[1] - corners[0])) / SCALE
        times = int(np.clip(math.ceil(finer), 1, 6)) if math.isfinite(finer) else 1
        count = 2 * round(half * SCALE)
        metres = side / (SCALE * times)
        middle = (count * times - 1) / 2
        from_pixels = np.array(
            [[metres, 0, -metres * middle], [0, -metres, metres * middle], [0, 0, 1]]
        )
        size = count * times, count * times
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        matrix = onto @ from_pixels
        plain = cv2.warpPerspective(self._picture, matrix, size, flags=flags)
        white = np.full(self._picture.shape[:2], 255, np.uint8)
        shown = cv2.warpPerspective(white, matrix, size, flags=flags)
        if times > 1:
            plain, shown = (
                cv2.resize(each, (count, count), interpolation=cv2.INTER_AREA)
                for each in (plain, shown)
            )
        return np.asarray(plain, np.uint8), np.asarray(shown == 255, np.bool_)


def _cut(values: Any, half: float) -> Any:
    """Return the middle of a square picture, so many sides of the marker to each side."""
    middle, reach = len(values) // 2, round(half * SCALE)
    return values[middle - reach : middle + reach, middle - reach : middle + reach]


def _box(size: int, half: float) -> Mask:
    """Return the middle of a square of pixels."""
    mask = np.zeros((size, size), np.bool_)
    _cut(mask, half)[:] = True
    return mask


def _is_found(marker: Picture, now: Picture) -> bool:
    """Tell whether the marker's own picture is to be found, read or not."""
    alike = cv2.matchTemplate(grey_of(now), grey_of(marker), cv2.TM_CCOEFF_NORMED)
    return float(np.nan_to_num(alike, posinf=0.0).max()) >= ALIKE


def _laid(before: Picture, judged: Mask, now: Picture) -> tuple[int, int]:
    """Return row and column at which the surroundings lie in a larger picture.

    Where they have no features, in the middle.
    """
    spare = len(now) - len(before)
    if spare <= 0:
        return 0, 0
    mask = judged.astype(np.float32)
    first, second = (grey_of(each).astype(np.float32) for each in (before, now))
    alike = np.nan_to_num(
        cv2.matchTemplate(second, first, cv2.TM_CCOEFF_NORMED, mask=mask), posinf=0.0, neginf=0.0
    )
    row, column = np.unravel_index(int(alike.argmax()), alike.shape)
    if alike[row, column] < ALIKE:
        return spare // 2, spare // 2
    return int(row), int(column)


def _foreign(before: Picture, now: Picture, judged: Mask, gain: float) -> float:
    """Return how many pixels of the surroundings look otherwise than before.

    Args:
        before, now: The surroundings, laid over each other.
        judged: Which of their pixels count.
        gain: How much lighter the whole picture is now.
    """
    first, second = (
        cv2.blur(each, (3, 3)).astype(np.float32).reshape(*each.shape[:2], -1)
        for each in (before, now)
    )
    before_, now_ = first + 4.0, second / gain + 4.0
    # The light changes smoothly over so little of a wall, and in all colours alike. The rim of a
    # lamp's cone bends: a plane leaves .2 there.
    rows, columns = np.indices(judged.shape) / len(judged) - 0.5
    terms = np.stack(
        [np.ones_like(rows), rows, columns, rows * rows, rows * columns, columns * columns], axis=2
    )
    light = np.log(now_ / before_).mean(axis=2)
    alike = judged
    smooth = np.zeros_like(light)
    for allowed in (0.5, 0.2, 0.08):
        some = alike[::2, ::2]
        if some.sum() < 50:
            return float(judged.sum())
        fitted, *_ = np.linalg.lstsq(terms[::2, ::2][some], light[::2, ::2][some], rcond=None)
        smooth = terms @ fitted
        alike = judged & (np.abs(light - smooth) <= allowed)
    factor = np.exp(smooth)[..., None]
    dark = (factor[..., 0] < OF_LIGHT[0]) | (factor[..., 0] > OF_LIGHT[1])
    # Texture is a pixel or two off.
    around = np.ones((5, 5), np.uint8)
    lowest, highest = (
        each(before_, around).reshape(before_.shape) for each in (cv2.erode, cv2.dilate)
    )
    even, spare = now_ / factor, 6.0 + 0.05 * before_
    apart = ((even < lowest - spare) | (even > highest + spare)).any(axis=2)
    foreign = ((apart | dark) & judged).astype(np.uint8)
    return float(cv2.morphologyEx(foreign, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)).sum())


def _is_seen_alike(aspect: _Aspect, camera: Array, share: float) -> bool:
    """Tell whether a marker is seen from nearly the same side and distance."""
    one, other = aspect.camera - aspect.position, camera - aspect.position
    lengths = float(np.linalg.norm(one)), float(np.linalg.norm(other))
    cosine = float(one @ other) / max(lengths[0] * lengths[1], 1e-9)
    times = max(lengths) / max(min(lengths), 1e-9)
    return cosine >= math.cos(SAME_ASPECT * share) and times <= SAME_DISTANCE**share


def _facing(rotation: Array) -> float:
    return math.atan2(float(rotation[1, 2]), float(rotation[0, 2]))


def _plain(position: Array) -> tuple[float, float, float]:
    x, y, z = position.tolist()
    return float(x), float(y), float(z)


def _array(values: Any, *shape: int) -> Array:
    found = np.asarray(values, float)
    if found.shape != shape or not np.isfinite(found).all():
        raise ValueError(f'expected {shape} finite numbers')
    return found
