"""Which picture is looked at next: the newest in which the marker detector has looked for markers.

A camera gives tens of pictures a second, of which one in two seconds is looked at. One of a camera
that stands is worth more than one that was taken in passing, and is waited for a little. Without a
detector, or where it says nothing for long, the newest one counts.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from indoor_watch.hung_markers import SeenMarker
from indoor_watch.lost_sight import NO_POSE, UNREAD
from indoor_watch.reference_views import Viewpoint, same_view
from surveillance_perception.observing.camera_tracker import CameraAt, CameraTracker

PICTURE_PERIOD = 2.0
"""Between two pictures that are looked at, seconds of real time."""
MOST_HELD, MOST_HELD_BYTES = 60, 64_000_000
"""So many pictures, and what the detector says of so many, wait for each other: it may be seconds
behind."""
DETECTOR_PATIENCE, STANDING_PATIENCE = 5.0, 1.0
"""So long what the detector says is waited for, and a picture of a camera that stands, seconds of
real time."""


@dataclass(frozen=True)
class HeldPicture:
    """A picture that waits for what the marker detector says of it.

    Attributes:
        data: The message as it came.
        stamp: What it says, seconds of the camera's clock.
        first, last: Between these times it was taken, seconds.
    """

    data: bytes
    stamp: float
    first: float
    last: float


@dataclass(frozen=True)
class ChosenPicture:
    """The picture that is looked at next.

    Attributes:
        data: The message as it came.
        taken: When, seconds.
        viewpoint: Where the camera stood; None: it moved, or nobody knows.
        bearing: Where it looked to, map frame, rad; None: nobody knows.
        camera: Where on the map it was; None: nobody knows.
        markers: What the detector has read in it; None: nobody looked for markers.
        causes: Why it is of little use, see `lost_sight`.
    """

    data: bytes
    taken: float
    viewpoint: Viewpoint | None
    bearing: float | None
    camera: CameraAt | None
    markers: tuple[SeenMarker, ...] | None
    causes: tuple[str, ...]


class PictureChooser:
    """Pictures that wait; owned by the executor's thread.

    Args:
        tracker: Where the camera was.
    """

    def __init__(self, tracker: CameraTracker) -> None:
        self._tracker = tracker
        self._pictures: deque[HeldPicture] = deque(maxlen=MOST_HELD)
        self._detected: deque[tuple[float, tuple[SeenMarker, ...]]] = deque(maxlen=MOST_HELD)
        self._before: tuple[float, bytes] = (math.nan, b'')
        self._shared_stamp = math.nan
        self._next = self._waits_since = 0.0
        self._looked_from: Viewpoint | None = None

    def take(self, picture: HeldPicture, now: float) -> None:
        """Take a picture.

        Args:
            picture: As it came.
            now: Steady time, seconds.
        """
        before, self._before = self._before, (picture.stamp, picture.data)
        if picture.stamp == before[0]:
            if picture.data == before[1]:
                return
            self._shared_stamp = picture.stamp
        if now < self._next and not self._is_new_view(picture.last):
            return
        if not self._pictures:
            self._waits_since = now
        self._pictures.append(picture)
        held = sum(len(each.data) for each in self._pictures)
        while held > MOST_HELD_BYTES and len(self._pictures) > 1:
            held -= len(self._pictures.popleft().data)

    def take_markers(self, stamp: float, found: tuple[SeenMarker, ...]) -> None:
        """Take what the detector has read in the picture of a stamp, seconds."""
        self._detected.append((stamp, found))

    def _is_new_view(self, taken: float) -> bool:
        """Tell whether the camera stands where no picture of this stand was looked at.

        In fast simulated time it may stand at a side for less than a `PICTURE_PERIOD`.
        """
        viewpoint = self._tracker.viewpoint(taken, taken)
        before = self._looked_from
        return viewpoint is not None and (before is None or not same_view(viewpoint, before))

    def next(self, now: float, *, is_detected: bool) -> ChosenPicture | None:
        """Return the picture to look at, of which nothing waits afterwards; None: not yet.

        Args:
            now: Steady time, seconds.
            is_detected: Whether somebody looks for markers in the pictures.
        """
        if not self._pictures:
            return None
        # A camera that gives all pictures one stamp does not tell which of them was looked at.
        told = {stamp: seen for stamp, seen in self._detected if stamp != self._shared_stamp}
        found = [each for each in self._pictures if each.stamp in told]
        waited = now - self._waits_since
        if not found and is_detected and waited < DETECTOR_PATIENCE:
            return None
        picture, viewpoint = self._best(found or list(self._pictures))
        if viewpoint is None and waited < STANDING_PATIENCE:
            return None
        causes = []
        if viewpoint is None and not self._tracker.is_told(picture.first, picture.last):
            causes.append(NO_POSE)
        if is_detected and not found:
            causes.append(UNREAD)
        camera = bearing = None
        if viewpoint is not None:
            self._looked_from = viewpoint
            camera = self._tracker.camera_at(viewpoint)
            bearing = self._tracker.bearing_of(viewpoint)
        self._pictures.clear()
        self._next = now + PICTURE_PERIOD
        return ChosenPicture(
            picture.data,
            picture.last,
            viewpoint,
            bearing,
            camera,
            told.get(picture.stamp),
            tuple(causes),
        )

    def _best(self, pictures: list[HeldPicture]) -> tuple[HeldPicture, Viewpoint | None]:
        """Return the newest picture of a camera that stood, else the newest one."""
        for each in reversed(pictures):
            viewpoint = self._tracker.viewpoint(each.first, each.last)
            if viewpoint is not None:
                return each, viewpoint
        return pictures[-1], None
