"""How each viewpoint looks normally: pictures by where the camera was, that outlive a restart.

A door that stands otherwise changes the view, and is the door's own matter: each viewpoint has a
picture for each state in which the doors nearby were found.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from indoor_watch.evidence import private_folder, write_private
from indoor_watch.views import WIDTH, Picture

Box = tuple[int, int, int, int]
SAME_PART = 0.3
"""Parts that overlap so far, of what they cover together, are one."""
Viewpoint = tuple[float, ...]
"""x and y in metres, then yaw and the arm's joints in radians."""
SAME_VIEW = (0.15, 0.1)
"""Viewpoints are the same within this: x and y in metres, any angle in radians."""
MOST_VIEWS = 100
"""Bounds memory and disk: five viewpoints of a place, or its doors' states, of twenty places."""


@dataclass
class ReferenceView:
    """One viewpoint.

    Attributes:
        name: Names it in observations, `v1`, and its file.
        viewpoint: Where the camera was.
        picture: What it showed, at most `WIDTH` wide.
        stamp: When, seconds since 1970.
        doors: The states of the doors nearby.
        differed: The parts that differed in all pictures of a visit, for the last two: the
            number of the visit, and the boxes in the reference (left, top, width, height), pixels.
    """

    name: str
    viewpoint: Viewpoint
    picture: Picture
    stamp: float
    doors: Mapping[str, str] = field(default_factory=dict)
    differed: list[tuple[int, list[Box]]] = field(default_factory=list)

    def lasts(self, box: Box, visit: int) -> bool:
        """Tell whether a part differed throughout this visit so far, and the visit before it."""
        visits = dict(self.differed)
        earlier = [each for each in visits if each < visit]
        return all(
            any(_overlap(box, other) >= SAME_PART for other in visits.get(each, ()))
            for each in (visit, max(earlier, default=visit - 1))
        )

    def note(self, boxes: list[Box], doubtful: list[Box], visit: int) -> None:
        """Take which parts differ in a picture that could be compared.

        What some pictures of one visit show and others do not, is somebody who walks by: of each
        visit the parts are kept that differ in all its pictures.

        Args:
            boxes: The parts that show something else.
            doubtful: The parts that may differ by their light alone: a thing may be hidden there.
            visit: The number of the visit.
        """
        earlier = [each for each in self.differed if each[0] < visit][-1:]
        standing = dict(self.differed).get(visit)
        if standing is not None:
            now = [*boxes, *doubtful]
            boxes = [
                box for box in standing if any(_overlap(box, other) >= SAME_PART for other in now)
            ]
        self.differed = [*earlier, (visit, boxes)]


class ReferenceViews:
    """The views, of which the oldest goes when there are too many.

    Args:
        folder: Where their pictures are kept; None: they are lost with the process.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._views: list[ReferenceView] = []
        self._next = 1

    def at(
        self, viewpoint: Viewpoint, doors: Mapping[str, str] | None = None
    ) -> ReferenceView | None:
        """Return the view from a viewpoint with the doors in these states, if there is one.

        Args:
            viewpoint: Where the camera is.
            doors: The states of the doors nearby; one that either side does not know differs not.
        """
        states = doors or {}
        return next(
            (
                each
                for each in self._views
                if same_view(each.viewpoint, viewpoint)
                and all(states.get(name, state) == state for name, state in each.doors.items())
            ),
            None,
        )

    def awaits(self, viewpoint: Viewpoint, doors: Mapping[str, str]) -> bool:
        """Tell whether pictures from a viewpoint wait until a door's state is known.

        Args:
            viewpoint: Where the camera is.
            doors: The states of the doors nearby.
        """
        return any(
            same_view(each.viewpoint, viewpoint) and not each.doors.keys() <= doors.keys()
            for each in self._views
        )

    def add(
        self,
        viewpoint: Viewpoint,
        picture: Picture,
        stamp: float,
        doors: Mapping[str, str] | None = None,
    ) -> ReferenceView:
        """Take a picture as how this viewpoint looks normally."""
        factor = min(1.0, WIDTH / picture.shape[1])
        if factor < 1.0:
            size = WIDTH, max(1, round(picture.shape[0] * WIDTH / picture.shape[1]))
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
        view = ReferenceView(f'v{self._next}', viewpoint, picture, stamp)
        view.doors = dict(doors or {})
        self._next += 1
        for old in self._views[: len(self._views) + 1 - MOST_VIEWS]:
            self.forget(old.name)
        self._views.append(view)
        if self._folder is not None:
            good, data = cv2.imencode('.png', picture)
            try:
                private_folder(self._folder)
                path = self._path(self._folder, view.name)
                write_private(path, data.tobytes() if good else b'')
            except OSError:
                pass  # the disk is full: after a restart this viewpoint is seen anew
        return view

    def forget(self, name: str) -> None:
        """Drop a view: the next picture from there is how it looks normally."""
        self._views = [each for each in self._views if each.name != name]
        if self._folder is not None:
            # The disk may have become one to read from alone.
            with contextlib.suppress(OSError):
                self._path(self._folder, name).unlink(missing_ok=True)

    def state(self) -> dict[str, Any]:
        """Return all but the pictures as plain values, for `restore`."""
        views = [
            {
                'name': each.name,
                'viewpoint': list(each.viewpoint),
                'stamp': each.stamp,
                'doors': dict(each.doors),
            }
            for each in self._views
        ]
        return {'views': views, 'next': self._next}

    def restore(self, values: Mapping[str, Any]) -> None:
        """Take what `state` gave; a view whose picture is gone is left out.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        found = []
        for each in values['views']:
            name = str(each['name'])
            if not name.isalnum():
                raise ValueError(f'a view is called {name!r}')
            picture = self._read(name)
            if picture is not None:
                viewpoint = tuple(map(float, each['viewpoint']))
                view = ReferenceView(name, viewpoint, picture, float(each['stamp']))
                view.doors = {str(door): str(is_) for door, is_ in dict(each['doors']).items()}
                found.append(view)
        following = int(values['next'])
        self._views, self._next = found, following

    def _read(self, name: str) -> Picture | None:
        if self._folder is None or not (path := self._path(self._folder, name)).is_file():
            return None
        picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        return None if picture is None else np.asarray(picture, np.uint8)

    @staticmethod
    def _path(folder: Path, name: str) -> Path:
        return folder / f'{name}.png'


def same_view(one: Viewpoint, other: Viewpoint) -> bool:
    """Tell whether two viewpoints show the same, within `SAME_VIEW`."""
    if len(one) != len(other):
        return False
    near = math.dist(one[:2], other[:2]) <= SAME_VIEW[0]
    turned = (abs(math.remainder(a - b, math.tau)) for a, b in zip(one[2:], other[2:], strict=True))
    return near and all(each <= SAME_VIEW[1] for each in turned)


def _overlap(one: Box, other: Box) -> float:
    width = min(one[0] + one[2], other[0] + other[2]) - max(one[0], other[0])
    height = min(one[1] + one[3], other[1] + other[3]) - max(one[1], other[1])
    common = max(0, width) * max(0, height)
    return common / max(1, one[2] * one[3] + other[2] * other[3] - common)
