"""A place as it is now: its floor plan, which doors are open, what stands in the way.

The world answers where the robot may be: how far the nearest solid surface is, and which place a
point belongs to. It knows nothing of time, sensors or the robot itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from surveillance_runtime.place import PlaceError, boxes, read_place_file
from surveillance_runtime.place.floor_plan import (
    WALL_THICKNESS,
    FloorPlan,
    Marker,
)
from surveillance_runtime.place.regions import Regions
from surveillance_runtime.suggestions import nearest
from surveillance_simulation.world.map_surface import MapSurface

MARKER_STATES = ('whole', 'broken', 'covered')


@dataclass(frozen=True)
class Obstacle:
    """An upright cylinder that stands in the way: centre and radius, metres."""

    name: str
    x: float
    y: float
    radius: float


@dataclass(frozen=True)
class Panel:
    """A marker as it is now.

    Attributes:
        marker: Where it hangs and what it shows.
        state: 'whole'; 'broken', a corner torn off so that its code is gone; 'covered' by a sheet.
    """

    marker: Marker
    state: str = 'whole'


class World:
    """A place whose doors, obstacles and markers change.

    Attributes:
        plan: The place's unchanging geometry.
        regions: Which room a point of it lies in.
        version: Counts the changes; whoever caches something drawn from the world compares it.
        wall_brightness: 1 is white plaster; to be set before anything is drawn.
    """

    wall_brightness = 1.0

    def __init__(self, plan: FloorPlan) -> None:
        """Start with every door open and no obstacles.

        Raises:
            PlaceError: The walls do not fit the map: two places are one room, a door does not touch
                the place it leads into, or a position lies in a wall.
        """
        self.plan = plan
        self.version = 0
        self._closed: set[str] = set()
        self._obstacles: dict[str, Obstacle] = {}
        self._people: boxes.Array = np.zeros((0, 3))
        self._panels = {name: Panel(marker) for name, marker in plan.markers.items()}
        self._walls = boxes.boxes_around(plan.wall_pieces(), WALL_THICKNESS)
        self._surface = None if plan.map is None else MapSurface(plan.map.grid)
        self.regions = Regions(plan)
        self._refresh()

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> World:
        """Return the world that a place's parameters describe.

        Args:
            parameters: The mapping below `ros__parameters` in the place's file.

        Raises:
            PlaceError: The parameters describe no sound place.
        """
        return cls(FloorPlan.from_parameters(parameters))

    @property
    def solid(self) -> boxes.Array:
        """Walls and closed doors as boxes (n, 6)."""
        return self._solid

    @property
    def surface(self) -> MapSurface | None:
        """What stands in the place by its map; None where it has none."""
        return self._surface

    @property
    def discs(self) -> boxes.Array:
        """Obstacles and people (n, 3): centre x, y and radius, metres."""
        return self._discs

    @property
    def obstacles(self) -> Mapping[str, Obstacle]:
        """Obstacles by name."""
        return self._obstacles

    @property
    def panels(self) -> Mapping[str, Panel]:
        """Markers by name, as they are now."""
        return self._panels

    @property
    def closed_doors(self) -> frozenset[str]:
        """Names of the doors that are closed."""
        return frozenset(self._closed)

    def is_open(self, door: str) -> bool:
        """Tell whether a door is open.

        Raises:
            PlaceError: There is no such door.
        """
        self._known(door, self.plan.doors, 'door')
        return door not in self._closed

    def set_door(self, door: str, is_open: bool) -> None:
        """Open or close a door.

        Raises:
            PlaceError: There is no such door.
        """
        self._known(door, self.plan.doors, 'door')
        if is_open:
            self._closed.discard(door)
        else:
            self._closed.add(door)
        self._refresh()

    def place_obstacle(self, name: str, x: float, y: float, radius: float) -> None:
        """Put a cylinder into the place, or move the one of this name.

        Raises:
            PlaceError: A number is not finite, or the radius is not between 1 cm and 5 m.
        """
        if not name:
            raise PlaceError((), "obstacle '': expected a name")
        if not (math.isfinite(x) and math.isfinite(y)):
            raise PlaceError(
                (), f"obstacle '{name}' at ({x:g}, {y:g}): expected two numbers in metres"
            )
        if not 0.01 <= radius <= 5.0:
            raise PlaceError((), f"obstacle '{name}': radius {radius:g} m: expected 0.01 to 5 m")
        self._obstacles[name] = Obstacle(name, x, y, radius)
        self._refresh()

    def remove_obstacle(self, name: str) -> None:
        """Take an obstacle away.

        Raises:
            PlaceError: There is no such obstacle.
        """
        self._known(name, self._obstacles, 'obstacle')
        del self._obstacles[name]
        self._refresh()

    def move_people(self, discs: boxes.Array) -> None:
        """Take where the people are now, shape (n, 3): centre x, y and radius, metres."""
        self._people = discs
        self._discs = np.concatenate([self._standing, discs])
        self.version += 1

    def set_marker(self, name: str, state: str) -> None:
        """Make a marker whole, break or cover it.

        Raises:
            PlaceError: There is no such marker or state.
        """
        self._known(name, self._panels, 'marker')
        if state not in MARKER_STATES:
            raise PlaceError(
                (), f"marker state '{state}': expected {nearest(state, MARKER_STATES)}"
            )
        self._panels[name] = replace(self._panels[name], state=state)
        self.version += 1

    def hang_marker(self, marker: Marker) -> None:
        """Hang a marker up, or move the one of this name; it is whole.

        Raises:
            PlaceError: A number is not finite, the id is negative or the size not positive.
        """
        numbers = (marker.x, marker.y, marker.z, marker.yaw, marker.size)
        if not all(map(math.isfinite, numbers)) or marker.size <= 0 or marker.id < 0:
            raise PlaceError(
                (),
                f"marker '{marker.name}': {marker}: expected finite numbers, id >= 0 and size > 0",
            )
        self._panels[marker.name] = Panel(marker)
        self.version += 1

    def clearance(self, x: float, y: float) -> float:
        """Return the distance from a point to the nearest solid surface, 0 inside one, metres."""
        nearest = float(boxes.distances(self._solid, x, y).min(initial=math.inf))
        if self._surface is not None:
            nearest = min(nearest, self._surface.clearance(x, y))
        if len(self._discs):
            centre = np.hypot(self._discs[:, 0] - x, self._discs[:, 1] - y)
            nearest = min(nearest, float((centre - self._discs[:, 2]).min()))
        return max(nearest, 0.0)

    def is_free(self, x: float, y: float, radius: float) -> bool:
        """Tell whether a disc touches nothing."""
        return self.clearance(x, y) > radius

    def place_at(self, x: float, y: float) -> str | None:
        """Return the place that a point (metres) lies in, None outside of every place."""
        return self.regions.room_at(x, y)

    def _refresh(self) -> None:
        panels = boxes.boxes_around(
            [self.plan.doors[name].ends for name in sorted(self._closed)], WALL_THICKNESS
        )
        self._solid = np.concatenate([self._walls, panels])
        self._standing = np.array(
            [(each.x, each.y, each.radius) for each in self._obstacles.values()], dtype=float
        ).reshape(-1, 3)
        self.move_people(self._people)

    @staticmethod
    def _known(name: str, names: Mapping[str, object], kind: str) -> None:
        if name not in names:
            known = f': expected {nearest(name, names)}' if names else ', nor any other'
            raise PlaceError((), f"there is no {kind} '{name}'{known}")


def read_world(path: str | Path) -> World:
    """Return the world that a place's file describes.

    Raises:
        FileError: The file cannot be read, or describes no sound place; one line.
    """
    return World(read_place_file(path).plan)
