"""Markers that hang no longer where they hung, and markers that no file knows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from indoor_watch.agreement import Agreement
from indoor_watch.events import Event
from indoor_watch.hung_markers import CameraView, HungMarkers
from indoor_watch.observations import Kind, Observation
from indoor_watch.persons import Picture
from indoor_watch.view_monitor import SEEN_TWICE
from indoor_watch.views import Grey
from indoor_watch.visit import CameraShot, Pictured, Visit

Points = NDArray[np.float64]

BESIDE = 0.3
"""A point so far before a marker is in the place that the wall it hangs on belongs to, metres."""
BEFORE_MARKER, ASIDE = 0.4, 0.25
"""What the lidar meets so far before a marker and so near to the line of sight hides it, metres."""
MOST_HELD = 8
"""So many pictures wait until it is known whether the lens is covered."""


class MarkerMonitor:
    """Notices markers; owned by whoever calls it, one thread.

    Args:
        known: The ids that hang here, and where, map frame, metres; None: that is learned. Empty:
            all that is seen is known.
        may_see_robot: Tells whether another robot may be in a picture from a point, at a stamp.
    """

    def __init__(
        self,
        known: Mapping[int, tuple[float, float, float] | None],
        may_see_robot: Callable[[tuple[float, float], float], bool] = lambda _at, _stamp: False,
    ) -> None:
        self._known = frozenset(known)
        self._may_see_robot = may_see_robot
        self._strange: dict[int, Agreement[bool]] = {}
        self.hung = HungMarkers(
            {number: where for number, where in known.items() if where is not None}
        )

    def hold(self, shot: CameraShot, visit: Visit) -> None:
        """Keep a picture of a bare wall, or a covered lens: the rest of the visit tells which."""
        if shot.camera is not None and shot.markers is not None and visit.saw_clearly:
            visit.held = [*visit.held, shot][-MOST_HELD:]

    def held(self, shot: CameraShot, visit: Visit) -> list[CameraShot]:
        """Return the pictures whose markers can be judged now that one shows something."""
        held, visit.held = visit.held, []
        is_judged = shot.camera is not None and shot.markers is not None
        return [*held, *([shot] if is_judged else [])]

    def strange(
        self, shot: CameraShot, grey: Grey, visit: Visit, current: Sequence[Event]
    ) -> list[Pictured]:
        """Return the markers that no file knows, once several pictures in a row show them."""
        if not self._known:
            return []
        numbers = {each.number for each in shot.markers or ()} - self._known
        # One that has moved is that, and no longer merely unknown.
        numbers -= {int(each) for each in misplaced(current)}
        self._strange = {number: self._strange.get(number, Agreement[bool]()) for number in numbers}
        found = []
        for number, pictures in self._strange.items():
            if pictures.take(True, visit.number, shot.stamp):
                seen = Observation(
                    Kind.MARKER, 'unknown', visit.place, str(number), visit.at, 0.9, shot.stamp
                )
                if visit.is_due(seen):
                    found.append(Pictured(seen, grey))
        return found

    def take(
        self,
        shot: CameraShot,
        visit: Visit,
        current: Sequence[Event],
        before: Picture | None = None,
    ) -> list[Pictured]:
        """Return the markers that hang no longer where they hung, or hang there again.

        Args:
            shot: A picture of which markers and camera are known.
            visit: Who is about, and what the lidar met.
            current: The events that go on.
            before: How it looks normally from there; None: that is not known.
        """
        camera, stamp = shot.camera, shot.stamp
        assert camera is not None
        assert shot.markers is not None
        at = float(camera.at[0]), float(camera.at[1])
        hidden = bool(visit.people.count) or self._may_see_robot(at, stamp)
        met = np.zeros((0, 2)) if visit.sweep is None else visit.sweep.points

        def is_clear(point: Points) -> bool:
            return not hidden and not stands_before(camera, point, met)

        found, is_out = [], misplaced(current)
        for each in self.hung.take(shot.picture, camera, shot.markers, visit.number, is_clear):
            if each.state == 'here' and str(each.number) not in is_out:
                continue
            x, y, _ = each.position
            # It hangs on a wall, which belongs to the place before it.
            away = math.dist((x, y), camera.at[:2])
            part = min(1.0, BESIDE / max(away, 1e-9))
            front = x + part * (camera.at[0] - x), y + part * (camera.at[1] - y)
            if visit.rooms is not None and visit.rooms.place_at(front) is None:
                continue  # nothing hangs off the map: it was measured wrongly
            seen = Observation(
                Kind.MARKER,
                each.state,
                visit.place_of(front),
                str(each.number),
                (x, y),
                SEEN_TWICE,
                stamp,
            )
            if visit.is_due(seen):
                found.append(Pictured(seen, shot.picture, before))
        return found


def misplaced(current: Sequence[Event]) -> set[str]:
    """Return the markers that hang otherwise than they did, as the events that go on say."""
    return {each.subject for each in current if each.kind == Kind.MARKER and each.seen != 'unknown'}


def stands_before(camera: CameraView, point: Points, met: Points) -> bool:
    """Tell whether the lidar met something between a camera and a marker.

    Args:
        camera: From where the picture was taken.
        point: The marker, (3,), map frame, metres.
        met: Where beams of the lidar ended, (n, 2), map frame, metres.
    """
    if not len(met):
        return False
    start = camera.at[:2]
    sight = point[:2] - start
    length = float(np.hypot(*sight))
    ahead = sight / max(length, 1e-9)
    along = (met - start) @ ahead
    aside = np.abs((met - start) @ np.array([-ahead[1], ahead[0]]))
    return bool(((along > 0.0) & (along < length - BEFORE_MARKER) & (aside < ASIDE)).any())
