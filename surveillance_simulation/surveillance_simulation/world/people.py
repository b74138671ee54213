"""People who walk from room to room in a place, polite or pushy towards the robot.

A person walks down the way to a room, rests there for a while, and goes on to another one. Who is
polite keeps 0.6 m from the robot and steps aside early; who is pushy keeps to the way and stops or
sidesteps only 5 cm before the robot. Nobody walks into the robot, so that a contact is always the
robot's own doing. People do not hinder each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from floor_plans import FloorPlan, occupancy_grid, shapes
from floor_plans.shapes import WALL_THICKNESS, Point
from strict_files.settings import parameter

MANNERS = ('polite', 'pushy')
_KEPT_GAP = {'polite': 0.6, 'pushy': 0.05}
"""Distance that a person keeps between their body and the robot's, metres."""
_PATIENCE = {'polite': 2.0, 'pushy': 6.0}
"""A person who cannot go on for this long turns to another room, seconds."""
_SIDESTEPS = (0.0, -0.5, 0.5, -1.0, 1.0, -1.5, 1.5)
"""Directions tried beside the way, rad; people pass on the right first."""
_CELL = 0.1
"""Side of a cell of the grid that people find their way on, metres."""
_WALL_GAP = 0.05
"""Room that people leave between themselves and a wall, metres."""


@dataclass(frozen=True)
class PeopleModel:
    """Who walks about."""

    count: int = parameter(0, 'People who walk about.', 0, 100)
    speed: float = parameter(1.2, 'How fast they walk, m/s.', 0.1, 3.0)
    manner: str = parameter(
        'polite', 'polite: they keep 0.6 m from the robot; pushy: 5 cm.', choices=MANNERS
    )
    radius: float = parameter(0.25, 'Radius of a person, metres.', 0.05, 1.0)
    shortest_rest: float = parameter(2.0, 'Least time a person stays in a room, s.', 0.0, 86400.0)
    longest_rest: float = parameter(
        20.0, 'Greatest time a person stays in a room, s.', 0.0, 86400.0
    )


class People:
    """The people in a place.

    Args:
        plan: The place.
        model: Who walks about.
        rng: Source of their starts, goals and rests.
    """

    def __init__(self, plan: FloorPlan, model: PeopleModel, rng: np.random.Generator) -> None:
        self._model = model
        self._rng = rng
        self._paths = _WalkingPaths(plan, model.radius + _WALL_GAP)
        self._goals = list(plan.place.positions)
        self._people = [self._new(plan.start[:2]) for _ in range(model.count)]

    @property
    def discs(self) -> shapes.Array:
        """Where they are, shape (n, 3): centre x, y and radius, metres."""
        return np.array(
            [(*person.at, self._model.radius) for person in self._people], dtype=float
        ).reshape(-1, 3)

    @property
    def poses(self) -> shapes.Array:
        """Where they are, shape (n, 4): centre x, y and radius in metres, direction in rad."""
        return np.array(
            [(*person.at, self._model.radius, person.ahead) for person in self._people],
            dtype=float,
        ).reshape(-1, 4)

    def step(self, dt: float, robots: Sequence[Point], robot_radius: float) -> None:
        """Let everybody walk on for `dt` seconds (at most 0.1) around robots."""
        for person in self._people:
            person.rest -= dt
            if person.rest > 0:
                continue
            self._walk(person, dt, robots, robot_radius)
            left = self._paths.left(person.goal, person.at)
            person.held_up = 0.0 if left < person.nearest else person.held_up + dt
            person.nearest = min(person.nearest, left)
            if left < person.stop_before:
                person.rest = self._rng.uniform(self._model.shortest_rest, self._model.longest_rest)
                self._turn(person)
            elif person.held_up >= _PATIENCE[self._model.manner]:
                self._turn(person)

    def _walk(
        self, person: _Person, dt: float, robots: Sequence[Point], robot_radius: float
    ) -> None:
        """Take one step, if there is room for it."""
        model = self._model
        ahead = self._paths.direction(person.goal, person.at)
        reach = model.radius + robot_radius + _KEPT_GAP[model.manner]
        before = [math.dist(person.at, robot) for robot in robots]
        for turn in _SIDESTEPS:
            x = person.at[0] + model.speed * dt * math.cos(ahead + turn)
            y = person.at[1] + model.speed * dt * math.sin(ahead + turn)
            if any(
                math.dist((x, y), robot) < min(reach, was)
                for robot, was in zip(robots, before, strict=True)
            ):
                continue
            if self._paths.is_free((x, y)):
                person.at, person.ahead = (x, y), ahead + turn
                return

    def _turn(self, person: _Person) -> None:
        """Choose another room to go to."""
        others = [goal for goal in self._goals if goal != person.goal]
        person.goal = others[int(self._rng.integers(len(others)))] if others else person.goal
        person.stop_before = self._rng.uniform(0.3, 1.5)
        person.nearest, person.held_up = math.inf, 0.0

    def _new(self, robot: Point) -> _Person:
        starts = [goal for goal in self._goals if math.dist(self._paths.point(goal), robot) > 1.5]
        start = starts[int(self._rng.integers(len(starts)))]
        person = _Person(self._paths.point(start), start)
        self._turn(person)
        return person


@dataclass
class _Person:
    """Where a person is and wants to go.

    Attributes:
        at: Metres.
        goal: The room to go to.
        stop_before: So much of the way is not walked, metres.
        rest: Time for which the person still stays, seconds.
        nearest: The least way that was left, metres.
        held_up: Time since the way that is left became less, seconds.
        ahead: Direction of the last step, rad.
    """

    at: Point
    goal: str
    stop_before: float = 0.0
    rest: float = 0.0
    nearest: float = math.inf
    held_up: float = 0.0
    ahead: float = 0.0


@dataclass(frozen=True, eq=False)
class _Route:
    """The shortest way to a room from everywhere.

    Attributes:
        left: How much of it is left, shape (rows, columns), cells.
        ahead: For each cell (flat) the one five steps further on.
    """

    left: npt.NDArray[np.float32]
    ahead: npt.NDArray[np.intp]


class _WalkingPaths:
    """The shortest ways to each room."""

    def __init__(self, plan: FloorPlan, reach: float) -> None:
        self._points = {name: (x, y) for name, (x, y, _) in plan.place.positions.items()}
        grid = self._grid = plan.grid(_CELL)
        self._cell = grid.resolution  # that of a map is the map's own
        rows, columns = np.indices(grid.cells.shape)
        x = (columns + 0.5) * self._cell + grid.origin[0]
        y = (rows + 0.5) * self._cell + grid.origin[1]
        clearance = np.full(grid.cells.shape, np.inf)
        if plan.map is not None:
            away = occupancy_grid.distance_to(grid.occupied, self._cell)
            clearance = away.astype(np.float64) - self._cell / 2
        for box in shapes.boxes_around(plan.wall_pieces(), WALL_THICKNESS):
            np.minimum(clearance, shapes.distances(box[None], x, y)[..., 0], out=clearance)
        self._free = (clearance >= reach) & (grid.cells == occupancy_grid.FREE)
        # Walking near a wall is up to three times as dear, so that the middle is preferred.
        crowded = np.clip(1.0 - (clearance - reach) / 0.5, 0.0, 1.0)
        self._cost = np.where(self._free, 1.0 + 2.0 * crowded, -1.0)
        self._to_goal: dict[str, _Route] = {}

    def point(self, goal: str) -> Point:
        """Return the point of a room, metres."""
        return self._points[goal]

    def is_free(self, at: Point) -> bool:
        """Tell whether a person can be at a point."""
        return bool(self._grid.at(self._free, *at))

    def left(self, goal: str, at: Point) -> float:
        """Return how much of the way to a room is left, metres; a way near walls counts more."""
        row, column = self._grid.cell_of(*at)
        return self._cell * float(self._to(goal).left[row, column])

    def direction(self, goal: str, at: Point) -> float:
        """Return the direction of the way from a point to a room, rad."""
        row, column = self._grid.cell_of(*at)
        columns = self._cost.shape[1]
        here = row * columns + column
        ahead = int(self._to(goal).ahead[here])
        x, y = self._grid.centre_of(*divmod(ahead, columns))
        if ahead == here:
            x, y = self._points[goal]
        return math.atan2(y - at[1], x - at[0])

    def _to(self, goal: str) -> _Route:
        if goal not in self._to_goal:
            self._to_goal[goal] = self._way_to(self._points[goal])
        return self._to_goal[goal]

    def _way_to(self, goal: Point) -> _Route:
        from skimage.graph import MCP_Geometric  # takes its time, and most runs have no people

        left, _ = MCP_Geometric(self._cost).find_costs([self._grid.cell_of(*goal)])
        rows, columns = left.shape
        cells = np.arange(left.size).reshape(left.shape)
        best, ahead = left.copy(), cells.copy()
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                to = np.s_[
                    max(0, -down) : rows - max(0, down), max(0, -right) : columns - max(0, right)
                ]
                of = np.s_[
                    max(0, down) : rows + min(0, down), max(0, right) : columns + min(0, right)
                ]
                nearer = left[of] < best[to]
                best[to][nearer] = left[of][nearer]
                ahead[to][nearer] = cells[of][nearer]
        one = ahead.ravel()
        two = one[one]
        return _Route(left.astype(np.float32), one[two[two]])
