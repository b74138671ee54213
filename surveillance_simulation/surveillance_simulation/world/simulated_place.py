"""A place as it is now: its floor plan, how far each door is open, what stands in it, the lamps.

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

from floor_plans import FloorPlan, Marker, PlaceError, RoomMap, read_place, shapes
from floor_plans.shapes import WALL_THICKNESS, Point
from strict_files.suggestions import nearest
from surveillance_simulation.world.figures import person
from surveillance_simulation.world.map_surface import MapSurface
from surveillance_simulation.world.things import Thing, barrel, boxes_of, discs_of
from surveillance_simulation.world.things import robot as robot_thing

MARKER_STATES = ('whole', 'broken', 'covered', 'gone')
LEAF_THICKNESS = 0.04
"""Of a door that is ajar, metres."""
PASSABLE = 60.0
"""A door lets a robot through from this angle on, degrees."""
_BODY = 0.2
"""Radius of a person who stands, metres."""


@dataclass(frozen=True)
class MarkerPanel:
    """A marker as it is now.

    Attributes:
        marker: Where it hangs and what it shows.
        state: 'whole'; 'broken', a corner torn off so that its code is gone; 'covered' by a sheet;
            'gone', taken off the wall.
    """

    marker: Marker
    state: str = 'whole'


class SimulatedPlace:
    """A place whose doors, things, people, markers and lamps change.

    Attributes:
        plan: The place's unchanging geometry.
        regions: Which room a point of it lies in.
        version: Counts all changes.
        drawn_version: Counts the changes of what a picture shows, but for people and lamps; whoever
            caches something drawn from the world compares it.
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
        self.version = self.drawn_version = 0
        self._angles: dict[str, float] = {}
        self._things: dict[str, Thing] = {}
        self._lamps: dict[str, float] = {}
        self._people: shapes.Array = np.zeros((0, 4))
        self._robots: dict[str, tuple[float, float, float]] = {}
        self._moves: dict[str, int] = {}
        self._panels = {name: MarkerPanel(marker) for name, marker in plan.markers.items()}
        self._walls = shapes.boxes_around(plan.wall_pieces(), WALL_THICKNESS)
        self._surface = None if plan.map is None else MapSurface(plan.map.grid)
        self.regions = RoomMap(plan)
        self._refresh()

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> SimulatedPlace:
        """Return the world that a place's parameters describe.

        Args:
            parameters: The mapping below `ros__parameters` in the place's file.

        Raises:
            PlaceError: The parameters describe no sound place.
        """
        return cls(FloorPlan.from_parameters(parameters))

    @property
    def solid(self) -> shapes.Array:
        """Walls, leaves of doors and what is square at the lidar's height, as boxes (n, 6)."""
        return self._solid

    @property
    def surface(self) -> MapSurface | None:
        """What stands in the place by its map; None where it has none."""
        return self._surface

    @property
    def discs(self) -> shapes.Array:
        """What is round at the lidar's height (n, 3): centre x, y and radius, metres."""
        return self._discs

    @property
    def things(self) -> Mapping[str, Thing]:
        """What stands in the place, by name."""
        return self._things

    @property
    def people(self) -> tuple[Thing, ...]:
        """The people who stand or walk in the place, as the camera sees them."""
        standing = (each for each in self._things.values() if each.kind == 'person')
        walking = (
            person(f'walker {number}', x, y, yaw)
            for number, (x, y, _, yaw) in enumerate(self._people.tolist())
        )
        return (*standing, *walking)

    def movers(self, robot: str = '') -> tuple[Thing, ...]:
        """Return the people and the other robots, as the camera of a robot sees them."""
        others = sorted((name, body) for name, body in self._robots.items() if name != robot)
        return (*self.people, *(robot_thing(name, *body) for name, body in others))

    @property
    def bodies(self) -> shapes.Array:
        """The people as upright cylinders (n, 3): centre x, y and radius, metres."""
        standing = [(e.x, e.y, _BODY) for e in self._things.values() if e.kind == 'person']
        return np.concatenate([np.reshape(standing, (-1, 3)), self._people[:, :3]])

    @property
    def lamps(self) -> Mapping[str, float]:
        """Brightness of the places whose lamp was turned, 1: as bright as by day."""
        return self._lamps

    @property
    def panels(self) -> Mapping[str, MarkerPanel]:
        """Markers by name, as they are now."""
        return self._panels

    @property
    def closed_doors(self) -> frozenset[str]:
        """Names of the doors through which no robot comes."""
        return frozenset(name for name, angle in self._angles.items() if angle < PASSABLE)

    def is_open(self, door: str) -> bool:
        """Tell whether a robot may come through a door.

        Raises:
            PlaceError: There is no such door.
        """
        return self.door_angle(door) >= PASSABLE

    def door_angle(self, door: str) -> float:
        """Return how far a door is open, degrees; inf: the leaf is folded away.

        Raises:
            PlaceError: There is no such door.
        """
        self._known(door, self.plan.doors, 'door')
        return self._angles.get(door, math.inf)

    def leaf(self, door: str) -> tuple[Point, Point] | None:
        """Return from where to where the leaf of a door reaches, metres; None: folded away."""
        angle = self.door_angle(door)
        if math.isinf(angle):
            return None
        (x, y), end = self.plan.doors[door].ends
        turn = self.plan.doors[door].yaw + math.radians(angle)
        width = math.dist((x, y), end)
        return (x, y), (x + width * math.cos(turn), y + width * math.sin(turn))

    def set_door(self, door: str, is_open: bool) -> None:
        """Open a door so far that its leaf is out of the way, or close it.

        Raises:
            PlaceError: There is no such door.
        """
        self._known(door, self.plan.doors, 'door')
        if is_open:
            self._angles.pop(door, None)
        else:
            self._angles[door] = 0.0
        self._refresh()

    def turn_door(self, door: str, angle: float) -> None:
        """Turn the leaf of a door about its first jamb, anticlockwise from above.

        Args:
            door: Which one.
            angle: From the closed position, degrees.

        Raises:
            PlaceError: There is no such door, or the angle is not from 0 to 120.
        """
        self._known(door, self.plan.doors, 'door')
        if not 0.0 <= angle <= 120.0:
            raise PlaceError((), f"door '{door}': angle {angle:g}: expected 0 to 120 degrees")
        self._angles[door] = angle
        self._refresh()

    def put(self, thing: Thing) -> None:
        """Put a thing into the place, or move the one of this name."""
        before = self._things.get(thing.name)
        self._things[thing.name] = thing
        if thing.kind == 'person' and (before is None or before.kind == 'person'):
            self._stand()  # people's steps leave the rest of a picture as it is
        else:
            self._refresh()

    def place_obstacle(self, name: str, x: float, y: float, radius: float) -> None:
        """Put a barrel into the place, or move the one of this name.

        Raises:
            PlaceError: A number is not finite, or the radius is not between 1 cm and 5 m.
        """
        self.put(barrel(name, x, y, radius))

    def remove_obstacle(self, name: str) -> None:
        """Take a thing away.

        Raises:
            PlaceError: There is no such thing.
        """
        self._known(name, self._things, 'obstacle')
        del self._things[name]
        self._refresh()

    def move_people(self, people: shapes.Array) -> None:
        """Take where the people who walk about are now.

        Args:
            people: (n, 3): centre x, y and radius, metres; or (n, 4), with their direction, rad.
        """
        turned = people.shape[1] == 4
        self._people = people if turned else np.pad(people, ((0, 0), (0, 1)))
        self._discs = np.concatenate([self._standing, people[:, :3]])
        self.version += 1

    def move_robot(self, robot: str, x: float, y: float, radius: float) -> None:
        """Take where a robot's body is now: centre and radius, metres."""
        body = (x, y, radius)
        if self._robots.get(robot) != body:
            self._robots[robot] = body
            self._moves[robot] = self._moves.get(robot, 0) + 1

    def discs_around(self, robot: str) -> shapes.Array:
        """Return what a robot meets of things, people and other robots, shape as `discs`."""
        others = [body for name, body in self._robots.items() if name != robot]
        return np.concatenate([self._discs, others]) if others else self._discs

    def changes_around(self, robot: str) -> int:
        """Count the changes of all that a robot can meet."""
        return self.version + sum(n for name, n in self._moves.items() if name != robot)

    def set_lamp(self, place: str, brightness: float) -> None:
        """Turn the lamp of a place.

        Raises:
            PlaceError: There is no such place, or the brightness is not from 0 to 2.
        """
        self._known(place, self.plan.place.positions, 'place')
        if not 0.0 <= brightness <= 2.0:
            raise PlaceError((), f"lamp of '{place}': {brightness:g}: expected 0 to 2, 1 is day")
        if brightness == 1.0:
            self._lamps.pop(place, None)
        else:
            self._lamps[place] = brightness
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
        self._count()

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
        self._panels[marker.name] = MarkerPanel(marker)
        self._count()

    def _count(self) -> None:
        self.version += 1
        self.drawn_version += 1

    def clearance(self, x: float, y: float, robot: str = '') -> float:
        """Return the distance from a point to the nearest solid surface, 0 inside one, metres.

        Args:
            x: Metres.
            y: Metres.
            robot: Whose own body is not met.
        """
        nearest = float(shapes.distances(self._solid, x, y).min(initial=math.inf))
        if self._surface is not None:
            nearest = min(nearest, self._surface.clearance(x, y))
        discs = self.discs_around(robot)
        if len(discs):
            centre = np.hypot(discs[:, 0] - x, discs[:, 1] - y)
            nearest = min(nearest, float((centre - discs[:, 2]).min()))
        return max(nearest, 0.0)

    def wall_clearance(self, x: float, y: float) -> float:
        """Return the distance from a point to the nearest wall or leaf, whatever stands about."""
        closed = shapes.distances(self._enclosing, x, y).min(initial=math.inf)
        surface = math.inf if self._surface is None else self._surface.clearance(x, y)
        return float(min(closed, surface))

    def is_free(self, x: float, y: float, radius: float, robot: str = '') -> bool:
        """Tell whether a disc touches nothing; the body of `robot` is not met."""
        return self.clearance(x, y, robot) > radius

    def place_at(self, x: float, y: float) -> str | None:
        """Return the place that a point (metres) lies in, None outside of every place."""
        return self.regions.room_at(x, y)

    def _refresh(self) -> None:
        self.drawn_version += 1
        closed: list[tuple[Point, Point]] = []
        turned: list[tuple[Point, Point]] = []
        for name in sorted(self._angles):
            if (leaf := self.leaf(name)) is not None:
                (turned if self._angles[name] else closed).append(leaf)
        self._enclosing = np.concatenate(
            [
                self._walls,
                shapes.boxes_around(closed, WALL_THICKNESS),
                shapes.boxes_around(turned, LEAF_THICKNESS),
            ]
        )
        self._solid = np.concatenate([self._enclosing, boxes_of(self._things.values())])
        self._stand()

    def _stand(self) -> None:
        self._standing = discs_of(self._things.values())
        self.move_people(self._people)

    @staticmethod
    def _known(name: str, names: Mapping[str, object], kind: str) -> None:
        if name not in names:
            known = f': expected {nearest(name, names)}' if names else ', nor any other'
            raise PlaceError((), f"there is no {kind} '{name}'{known}")


def read_simulated_place(path: str | Path) -> SimulatedPlace:
    """Return the world that a place's file describes.

    Raises:
        FileError: The file cannot be read, or describes no sound place; one line.
    """
    return SimulatedPlace(read_place(path).plan)
