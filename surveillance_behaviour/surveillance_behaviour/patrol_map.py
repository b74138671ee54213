"""The map that a robot decides on: the part that can be reached, with the times of its legs."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping

from floor_plans import Station
from patrol_policy.decision import DecisionSettings
from patrol_policy.graph import GraphError, PatrolGraph
from state_machines import Interrupt
from state_machines.exceptions import CallError
from surveillance_behaviour.learned_times import LegTimes
from surveillance_behaviour.ports import Places, Point, UnknownPlaceError
from surveillance_ontology.robot_ontology import Snapshot


class PatrolMap:
    """Keeps the map as the ontology has it, with the points of the places and the learned times.

    Owned by the thread that looks; what others read is replaced in one step.

    Args:
        places: Where the places are.
        settings: Of decisions, shared with whoever changes them.
        leg_times: What was learned of the legs.
        sweeps: Returns how long each place that is swept takes, seconds, as far as is known.

    Attributes:
        graph: The part that can be reached from where the robot is.
        places: All places of the map when it was last looked at, within reach or not.
    """

    def __init__(
        self,
        places: Places,
        settings: DecisionSettings,
        leg_times: LegTimes,
        sweeps: Callable[[], Mapping[str, float]] = dict,
    ) -> None:
        self.graph = PatrolGraph({})
        self._alike: PatrolGraph | Callable[[], PatrolGraph] = self.graph
        self.places: frozenset[str] = frozenset()
        self._points = places
        self._settings = settings
        self._leg_times = leg_times
        self._sweeps = sweeps
        self._positions: dict[str, Point] = {}
        self._key: object = None

    def ask_anew(self) -> None:
        """Ask for the places' points with the next look."""
        self._positions = {}

    def update(
        self, found: Snapshot, own_exploring: Mapping[str, float], interrupt: Interrupt
    ) -> PatrolGraph:
        """Return the map as a snapshot has it; the same object as long as nothing changes.

        Args:
            found: The snapshot.
            own_exploring: Seconds that the robot explores a place, where it differs.
            interrupt: Ends it.

        Raises:
            CallError: The map cannot be; the robot is not on it.
        """
        # A place that went may come back elsewhere.
        positions = {p: at for p, at in self._positions.items() if p in found.connections}
        self._positions = positions
        for place in found.connections:
            # One that was removed from the map a moment ago is unknown; the ontology will follow.
            with contextlib.suppress(UnknownPlaceError):
                if place not in positions:
                    positions[place] = self._points.position(place, interrupt)
        self.places = frozenset(positions)
        if found.place not in positions:
            raise CallError(f'ontology: the robot is in {found.place}, which is not on the map')
        times, speed = self._leg_times, self._settings.speed
        exploring = self._settings.exploration_seconds
        times.forget_fit(speed)
        swept = {p: max(s, own_exploring.get(p, exploring)) for p, s in self._sweeps().items()}
        own_exploring = {**own_exploring, **swept}

        def metres(start: str, goal: str) -> float:
            # Of the points that were asked for here: another place may be taken meanwhile.
            return math.dist(positions[start][:2], positions[goal][:2])

        ways = {
            place: [other for other in others if other in positions]
            for place, others in found.connections.items()
            if place in positions
        }
        legs = {
            a: {b: times.used(a, b, metres(a, b)) for b in others} for a, others in ways.items()
        }
        key = (legs, exploring, own_exploring, speed)
        if key == self._key and found.place in self.graph.index:
            return self.graph

        def alike() -> PatrolGraph:
            straight = {
                a: {b: max(0.1, round(metres(a, b) / speed, 1)) for b in others}
                for a, others in ways.items()
            }
            return PatrolGraph(straight, exploring, own_exploring).connected(found.place)

        try:
            graph = PatrolGraph(legs, exploring, own_exploring).connected(found.place)
        except GraphError as error:
            raise CallError(f'ontology: {error}') from None
        self.graph, self._alike, self._key = graph, alike, key
        return graph

    def with_straight_times(self) -> PatrolGraph:
        """Return the map with the times that all robots of a fleet compute with, whatever each has
        learned: the straight way at the configured speed."""
        if not isinstance(self._alike, PatrolGraph):
            self._alike = self._alike()
        return self._alike

    def metres(self, start: str, goal: str) -> float:
        """Return the metres between two places in a straight line; 0: one is not known."""
        positions = self._positions
        if start not in positions or goal not in positions:
            return 0.0
        return math.dist(positions[start][:2], positions[goal][:2])

    def approaches(self, stations: Mapping[str, Station]) -> dict[str, float]:
        """Return the seconds from the points of recharge rooms to their stations."""
        positions, speed = self._positions, self._settings.speed
        return {
            place: math.dist(positions[place][:2], station.pose[:2]) / speed
            for place, station in stations.items()
            if place in positions
        }

    def detour(self, start: str, goal: str) -> tuple[str, ...]:
        """Return the places of another way between two neighbours; empty when there is none."""
        try:
            return self.graph.without_leg(start, goal).route(start, goal)
        except (GraphError, KeyError):
            return ()
