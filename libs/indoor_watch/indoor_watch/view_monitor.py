"""What pictures say of a place as a whole: its light, a covered lens, a view that has changed.

A picture is compared with the first one of the same viewpoint, for each state of the doors nearby.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from indoor_watch.agreement import Agreement
from indoor_watch.events import Event
from indoor_watch.observations import Kind, Observation
from indoor_watch.reference_views import ReferenceViews, Viewpoint
from indoor_watch.views import Grey, Sight, light_of, sight_of, view_changes
from indoor_watch.visit import CameraShot, Pictured, Visit

MOST_LIT = 500
"""Of so many places it is kept how light they were."""
ONE_LOOK, SEEN_TWICE = 0.5, 0.95
"""Confidence in a changed view after one visit, at most, and after two, at least: a third is not
waited for."""


class LightMonitor:
    """Notices the light, and a lens that is covered; owned by whoever calls it, one thread."""

    def __init__(self) -> None:
        self._sights: Agreement[Sight] = Agreement()
        self._lights: dict[str, Agreement[str]] = {}

    def take(self, grey: Grey, stamp: float, visit: Visit) -> tuple[list[Pictured], Sight, str]:
        """Return what is noticed, what kind of view it is, and the light: on, off or not known."""
        sight = sight_of(grey)
        settled = self._sights.take(sight, visit.number, stamp)
        light = light_of(grey, sight)
        found = []
        if light and self._is_settled(light, visit, stamp) and light != visit.light:
            visit.light = light
            found.append(Pictured(Observation(Kind.LIGHT, light, visit.place, stamp=stamp), grey))
        if settled and sight != visit.sight:
            visit.sight = sight
            if sight != Sight.DARK:
                state = 'blocked' if sight == Sight.BLOCKED else 'clear'
                found.append(
                    Pictured(Observation(Kind.VIEW, state, visit.place, stamp=stamp), grey)
                )
        visit.saw_clearly |= sight == Sight.CLEAR
        return found, sight, light

    def _is_settled(self, light: str, visit: Visit, stamp: float) -> bool:
        """Take how light a picture of a place is; tell whether the last ones of it agree.

        A short visit has one or two pictures: those of earlier visits count, too.
        """
        lights = self._lights.pop(visit.place, None) or Agreement()
        self._lights[visit.place] = lights
        for oldest in list(self._lights)[:-MOST_LIT]:
            del self._lights[oldest]
        return lights.take(light, visit.number, stamp)


class ViewMonitor:
    """Compares views with how they look normally; owned by whoever calls it, one thread.

    Args:
        views: How each viewpoint looks normally.
        doors_near: Returns the states of the doors near a point, as a visit saw them.
    """

    def __init__(
        self,
        views: ReferenceViews,
        doors_near: Callable[[tuple[float, float], Visit], Mapping[str, str]],
    ) -> None:
        self.views = views
        self._doors_near = doors_near

    def take(self, shot: CameraShot, visit: Visit, current: Iterable[Event]) -> list[Pictured]:
        """Return what a picture that shows something tells of its view.

        Args:
            shot: The picture.
            visit: Who walks about in it changes views.
            current: The events that go on.
        """
        viewpoint, picture, stamp = shot.viewpoint, shot.picture, shot.stamp
        if viewpoint is None:
            return []
        doors = self._doors_near((viewpoint[0], viewpoint[1]), visit)
        if self.views.awaits(viewpoint, doors):
            return []  # how a door stood in an earlier visit does not tell how it stands now
        known = self.views.at(viewpoint, doors)
        if known is None:
            # Who walks about here is no part of how it looks normally.
            if not visit.people.count:
                self.views.add(viewpoint, picture, stamp, doors)
            return []
        if visit.people.count:
            return []  # it is they who change the view
        differences = view_changes(known.picture, picture)
        things = [each for each in differences or () if not each.may_be_light]
        if differences is not None:
            doubtful = [each.box for each in differences if each.may_be_light]
            known.note([each.box for each in things], doubtful, visit.number)
        again = [each for each in things if known.lasts(each.box, visit.number)]
        if differences == []:
            if (Kind.VIEW, known.name) in {(each.kind, each.subject) for each in current}:
                seen = Observation(Kind.VIEW, 'clear', visit.place, known.name, stamp=stamp)
                return [Pictured(seen)]
            return []
        for change in (again or differences or [])[:1]:
            # Shadows wander and people leave: one visit alone is no reason to call anybody.
            sure = change.confidence if again else min(change.confidence, ONE_LOOK)
            seen = Observation(
                Kind.VIEW,
                'changed',
                visit.place,
                known.name,
                (viewpoint[0], viewpoint[1]),
                confidence=max(sure, SEEN_TWICE) if again else sure,
                stamp=stamp,
                compared_with=f'{known.stamp:.0f}',
            )
            if visit.is_due(seen):
                return [Pictured(seen, picture, known.picture)]
        return []

    def normal_from(self, viewpoint: Viewpoint | None) -> Any:
        """Return how it looks normally from a viewpoint, whatever the doors; None: not known."""
        known = None if viewpoint is None else self.views.at(viewpoint)
        return None if known is None else known.picture
