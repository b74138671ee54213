"""What the robot knows of its surroundings: one snapshot of the ontology a choice, and memory.

The ontology says where the robot is, what it can reach, which classes each place has and when it
was visited; this module adds what the robot itself knows better: where the places are, when it
was where, and how long each leg takes. What it learned outlives its process in a small file.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from surveillance_behaviour.decision import DecisionSettings
from surveillance_behaviour.mission.mission_log import account_of, on_present_clock, read
from surveillance_behaviour.peers.ports import Ontology, Places, Point, UnknownPlaceError
from surveillance_behaviour.policy.battery_reserve import DrawEstimate
from surveillance_behaviour.policy.graph import GraphError, PatrolGraph
from surveillance_behaviour.policy.leg_times import LegTimes
from surveillance_behaviour.policy.world import PolicyMemory, World
from surveillance_fsm import Interrupt
from surveillance_fsm.exceptions import CallError
from surveillance_ontology.patrol_ontology import Snapshot
from surveillance_runtime.files import FileError, KeptFile

SIMULTANEOUS = 1.0
"""Seconds by which what several threads take for the present may differ."""


@dataclass
class Experience:
    """What the robot has learned, kept in a file beside the mission record.

    The file is ``<record>.experience.json``: `of_record` makes it from the parameter ``record``.
    Whoever decides reads it when it starts and writes it after each decision, so that a mission
    that goes on (``launch.py --resume``, or a node that was started again) knows the visits, the
    leg times and the battery's draw of before. To take them to another run, copy the file with
    the record.

    Attributes:
        file: Where it is kept.
        visits: When the robot was in each place last, seconds on the mission's clock.
        leg_times: How long the legs take.
        draw: How fast the battery falls.
        sent_to_charge: Why the robot was sent to charge and has not been charged since.
        requested: Where an operator wants the robot, and it has not been since; empty: nowhere.
        now: The last time that was told, seconds on the clock of the visits.
    """

    file: KeptFile = field(default_factory=KeptFile)
    visits: dict[str, float] = field(default_factory=dict)
    leg_times: LegTimes = field(default_factory=LegTimes)
    draw: DrawEstimate = field(default_factory=DrawEstimate)
    sent_to_charge: str = ''
    requested: str = ''
    now: float = 0.0
    problem: str = ''

    @classmethod
    def of_record(cls, record: str) -> Experience:
        """Return what was learned on the mission of a record; new for an empty name.

        The visits in the record itself count: they are on the clock of its end. A file that cannot
        be read counts as none; `problem` says what is wrong with it.
        """
        experience = cls(KeptFile.of_record(record, '.experience.json'))
        experience.problem = experience.file.read(experience._take)
        if record and Path(record).is_file():
            try:
                account = account_of(read(record))
            except FileError as error:
                experience.problem = str(error)
                return experience
            experience.visits.update(account.visits)
            experience.now = account.now or 0.0
        return experience

    def _take(self, kept: dict[str, Any]) -> None:
        leg_times, draw = LegTimes(), DrawEstimate()
        visits = {str(place): float(at) for place, at in kept['visits'].items()}
        leg_times.restore(kept['leg_times'])
        draw.restore(kept['draw'])
        sent_to_charge = str(kept['sent_to_charge'])
        self.visits, self.leg_times, self.draw = visits, leg_times, draw
        self.sent_to_charge, self.requested = sent_to_charge, str(kept.get('requested', ''))

    def save(self) -> None:
        """Write the file, if anything has changed."""
        self.file.write(
            {
                'visits': {place: round(at, 3) for place, at in self.visits.copy().items()},
                'leg_times': self.leg_times.to_json(),
                'draw': self.draw.to_json(),
                'sent_to_charge': self.sent_to_charge,
                'requested': self.requested,
            }
        )

    def saw(self, place: str, now: float) -> None:
        """Note that the robot was in ``place``."""
        self.tell_time(now)
        self.visits[place] = now

    def tell_time(self, now: float) -> None:
        """Take the visits with a clock that was set back, forget those of another simulation."""
        latest = max((self.now, *self.visits.values()))
        if now < latest - SIMULTANEOUS:
            self.visits = on_present_clock(self.visits, latest, now)
        self.now = now


class WorldModel:
    """Keeps the map and the visits in step with the ontology.

    Args:
        settings: Shared with whoever changes them.
        ontology: The ontology.
        places: Where the places are.
        experience: What the robot has learned; default: nothing yet.
        generator: Chance, for the policies that need it.
    """

    def __init__(
        self,
        settings: DecisionSettings,
        ontology: Ontology,
        places: Places,
        experience: Experience | None = None,
        generator: random.Random | None = None,
    ) -> None:
        self.settings = settings
        self.experience = experience or Experience()
        self.place = ''
        self.target: str | None = None
        self.world: World | None = None
        self.contradiction = ''
        self._ontology = ontology
        self._places = places
        self._memory = PolicyMemory(generator or random.Random())
        self._positions: dict[str, Point] = {}
        self.graph = PatrolGraph({})
        self._all: frozenset[str] = frozenset()
        self._graph_key: object = None
        self._since: float | None = None

    @property
    def places(self) -> frozenset[str]:
        """All places of the map when it was last looked at, within reach or not."""
        return self._all

    def straight(self, start: str, goal: str) -> float:
        """Return the metres between two places in a straight line; 0: one is not known."""
        if start not in self._positions or goal not in self._positions:
            return 0.0
        return _distance(self._positions[start], self._positions[goal])

    def refresh(
        self, now: float, interrupt: Interrupt, avoided: frozenset[str] = frozenset()
    ) -> World:
        """Take one snapshot of the ontology and bring the map up to date.

        The ontology is told in the same batch which visits it does not know: one that was built
        anew has them from here.

        Args:
            now: Seconds on the mission's clock.
            interrupt: Ends it.
            avoided: Places that could not be reached lately.

        Raises:
            CallError: The ontology or the positions cannot be had, or do not fit together.
        """
        self.experience.tell_time(now)
        self._since = now if self._since is None else min(self._since, now)
        threshold, classes = self.settings.urgency_threshold, self.settings.rules.classes
        visits = self.experience.visits
        found = self._ontology.snapshot(now, classes, visits, interrupt, threshold)
        graph = self._map_of(found, interrupt)
        visited_at = {}
        for place, seconds in found.visited_at.items():
            # The ontology counts whole seconds; another robot's visit may be later.
            own = visits.get(place, -1.0)
            visited_at[place] = own if own >= seconds else seconds
        self.place = found.place
        self.contradiction = found.contradiction
        self.world = World(
            place=found.place,
            now=now,
            reachable=tuple(place for place in found.reachable if place in graph.index),
            classes=found.classes,
            visited_at=visited_at,
            graph=graph,
            time_spread=self.experience.leg_times.spread,
            since=self._since,
            threshold=threshold,
            target=self.target,
            avoided=avoided,
            rules=classes,
            requested=self.experience.requested,
            memory=self._memory,
        )
        return self.world

    def _map_of(self, found: Snapshot, interrupt: Interrupt) -> PatrolGraph:
        positions = {}
        # A place that went may come back elsewhere.
        self._positions = {p: at for p, at in self._positions.items() if p in found.connections}
        for place in found.connections:
            try:
                positions[place] = self._position(place, interrupt)
            except UnknownPlaceError:
                continue  # It was removed from the map a moment ago; the ontology will follow.
        self._all = frozenset(positions)
        if found.place not in positions:
            raise CallError(f'ontology: the robot is in {found.place}, which is not on the map')
        times, dwell = self.experience.leg_times, self.settings.exploration_seconds
        times.forget_fit(self.settings.speed)
        legs = {
            place: {
                other: times.used(place, other, _distance(positions[place], positions[other]))
                for other in others
                if other in positions
            }
            for place, others in found.connections.items()
            if place in positions
        }
        key = (found.place in self.graph.index, legs, dwell)
        if key != self._graph_key:
            try:
                self.graph = PatrolGraph(legs, dwell).connected(found.place)
            except GraphError as error:
                raise CallError(f'ontology: {error}') from None
            self._graph_key = (True, *key[1:])
        return self.graph

    def _position(self, place: str, interrupt: Interrupt) -> Point:
        if place not in self._positions:
            self._positions[place] = self._places.position(place, interrupt)
        return self._positions[place]

    def stands(self, now: float, interrupt: Interrupt) -> None:
        """Note that the robot is now where it was heard of last, if anybody said so.

        Its visit is then told with the snapshot's own time, so that the ontology, and not only
        this process, knows until when the robot was there.
        """
        if here := self._ontology.await_place(self.place, 0.0, interrupt):
            self.saw(here, now)

    def saw(self, place: str, now: float) -> None:
        """Note that the robot was in ``place``; finer than the ontology's whole seconds."""
        self.place = place
        self.experience.saw(place, now)
        if place == self.target:
            self.target = None
        if place == self.experience.requested:
            self.experience.requested = ''


def _distance(start: Point, goal: Point) -> float:
    return math.dist(start[:2], goal[:2])
