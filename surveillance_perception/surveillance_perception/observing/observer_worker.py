"""The observer's work on one thread: what is noticed becomes events, a log, topics and facts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import Any

from floor_plans import Grid
from indoor_watch import ChangeMonitor, EventBook, Observation, WatchRule, same_map
from indoor_watch.answers import answered
from indoor_watch.day_book import DayBook
from indoor_watch.doors import Segment
from indoor_watch.inspection_plan import InspectionPlan
from indoor_watch.other_robots import OtherRobots
from indoor_watch.passages import Passages
from indoor_watch.privacy import blurred_at_rest
from lidar_navigation import PlaceLocator
from strict_files.files import KeptFile
from surveillance_perception.finding_teller import FindingTeller
from surveillance_perception.observing.event_facts_writer import EventFactsWriter
from surveillance_perception.observing.observer_settings import ObserverSettings
from surveillance_perception.observing.observer_topics import ObserverTopics
from surveillance_runtime.node import PatrolNode


class ObserverWorker:
    """Notices and tells; owned by the worker's thread, once it has begun.

    Args:
        node: Whose log, incidents and thread it uses.
        settings: The observer's parameters.
        robot: Whose observations they are.
        teller: Tells of events.
        topics: What is published.
        doors: The doors' openings by name, map frame, metres.
        points: The places' own points, map frame, metres.

    Raises:
        ParameterError: A file that the settings name says something else.

    Attributes:
        monitor: What notices.
        others: Where the other robots of a fleet are.
    """

    def __init__(
        self,
        node: PatrolNode,
        settings: ObserverSettings,
        robot: str,
        teller: FindingTeller,
        topics: ObserverTopics,
        doors: Mapping[str, Segment],
        points: Mapping[str, Any],
    ) -> None:
        self._complain = node.get_logger().warn
        self._read_rules = partial(settings.rules, tuple(points), tuple(doors))
        rules: Sequence[WatchRule] = self._read_rules()
        self._teller, self._topics = teller, topics
        self._book = EventBook(told=teller.changed)
        self._store = settings.store(self._complain)
        self._days = DayBook(datetime.fromtimestamp)
        self._rooms = PlaceLocator(doors.values())
        self._rooms.set_positions(points)
        self._grid: Grid | None = None
        self._plan = InspectionPlan(rules, self._rooms, points, doors, settings.radius)
        self.others = OtherRobots(settings.radius)
        self.monitor = ChangeMonitor(
            rules,
            self._book,
            local=datetime.fromtimestamp,
            tell=self._on_observation,
            alert=teller.alert,
            warn=teller.warn,
            robot=robot,
            doors=doors,
            markers=settings.known_markers(),
            rooms=self._rooms,
            passages_of=lambda grid: Passages(grid, settings.radius, doors, points),
            find_persons=settings.person_finder(self._complain),
            covered=topics.coverage,
            store=self._store,
            views=settings.views(),
            verify_seconds=settings.verify_seconds,
            others=self.others,
            blur=blurred_at_rest,
        )
        self._kept = KeptFile(settings.state_file, 'starting without it')
        self._say(self._kept.read(self._restore))
        for rule in rules:
            node.get_logger().info(f'watching: {rule.words()}')
        self._facts: EventFactsWriter | None = None
        if settings.facts:
            self._facts = EventFactsWriter(
                node, robot, settings.alert_threshold, settings.peer_timeout
            )
        self._tell_events()

    @property
    def has_map(self) -> bool:
        """Whether a map came."""
        return self._grid is not None

    def use_map(self, grid: Grid) -> None:
        """Take a map; on another one it is told anew from where to look."""
        self.monitor.use_map(grid)
        if self._grid is None or not same_map(self._grid, grid):
            self._grid = grid
            self._rooms.set_map(grid)
            self._topics.viewpoints(self._plan.use_map(grid))

    def assess(self, now: float) -> None:
        """Compare what was seen so far with what is normal, and tell what came of it.

        Args:
            now: Seconds since 1970.
        """
        self._topics.checks(self._plan.checks(self.monitor.spots()))
        self.monitor.assess(now)
        doubts = self.monitor.doubts(now)
        self._topics.doubts([(each, self._plan.again_from(each)) for each in doubts])
        self._tell_events()

    def answer(self, line: str) -> str:
        """Take what a person says of an event, and return what was done.

        Raises:
            ValueError: What was wrong, and what was expected.
        """
        if line.strip() == 'rules':
            # A person has changed the file; what is looked at for them is chosen at the start.
            self.monitor.follow(rules := self._read_rules())
            return f'{len(rules)} rules hold now'
        answer = answered(self._book, line, self.monitor.answer, self.monitor.movables)
        self._teller.answered(line, answer)
        self._tell_events()
        return answer

    def keep(self, now: float) -> None:
        """Write what must outlive this process."""
        self._teller.keep(self._book.current)
        if self._store is not None:
            self._store.forget_old(now)
        if self._kept:
            state = {**self.monitor.state(), 'days': self._days.state()}
            state['book'] = self._teller.kept(state['book'])
            self._say(self._kept.write(state))

    def _restore(self, kept: Mapping[str, Any]) -> None:
        days = DayBook(datetime.fromtimestamp)
        days.restore(kept['days'])
        self.monitor.restore({**kept, 'book': self._teller.restored(kept['book'])})
        self._days = days
        self._teller.take_up(kept['book'], self._book.find)

    def _say(self, problem: str) -> None:
        if problem:
            self._complain(problem)

    def _on_observation(self, seen: Observation) -> None:
        self._days.take(seen)
        self._topics.observation(seen)

    def _tell_events(self) -> None:
        events = self._book.events
        if self._topics.events(events) and self._facts is not None:
            self._facts.tell(events)
