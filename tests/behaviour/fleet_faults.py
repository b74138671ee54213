"""A fleet whose links and programs fail, in this process: what comes of its visits.

Each robot is a host of its own, and the ontology is another one. Deciding, sharing and right of way
are the real ones (`DecisionMaker`, `FleetKnowledge`, the messages of `fleet_robots`, `LearnedTimes`
with its file and the mission's record); driving is a straight way in its time. A link is cut, or
loses and delays what passes; the programs of a robot are killed and start again from their files;
the ontology's host goes down with what it knew on its disk.
"""

from __future__ import annotations

import heapq
import itertools
import math
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from patrol_policy.decision import DecisionSettings
from patrol_policy.fleet import FleetSettings, Layout
from patrol_policy.rule_table import URGENT, Priorities
from patrol_policy.situation import Decision
from state_machines import Interrupt
from state_machines.exceptions import CallError, UnavailableError
from surveillance_behaviour.decision_maker import DecisionMaker
from surveillance_behaviour.fleet import FleetFacts, FleetKnowledge
from surveillance_behaviour.learned_times import LearnedTimes
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_behaviour.ros_adapters.fleet_topic import facts_of, message_of
from surveillance_behaviour.traffic import FleetTraffic

from .scripted_world import POSITIONS, World

WIDE = Layout.of(POSITIONS, ())
NOBODY = Interrupt()
ONTOLOGY = 'ontology'
THRESHOLD = 240.0
SPEED, EXPLORING = 0.6, 2.0
HEARD_WITHIN = 20.0
"""After so long without a fault all know of all, seconds."""
LEFT_BEHIND = 35.0
"""A robot that has decided nothing for so long while nothing fails is left behind, seconds."""


@dataclass
class Network:
    """Links between hosts.

    Attributes:
        down: Hosts that are cut off from every other one.
        loss: Which share of what is sent is lost.
        delay: Seconds under way.
    """

    chance: random.Random
    down: set[str] = field(default_factory=set)
    loss: float = 0.0
    delay: float = 0.0
    _under_way: list[tuple[float, int, Callable[[float], None]]] = field(default_factory=list)
    _count: itertools.count[int] = field(default_factory=itertools.count)

    def passes(self, sender: str, receiver: str) -> bool:
        """Return whether one message arrives."""
        if sender != receiver and {sender, receiver} & self.down:
            return False
        return self.chance.random() >= self.loss

    def send(self, sender: str, receiver: str, now: float, take: Callable[[float], None]) -> None:
        """Deliver a message, or not."""
        if self.passes(sender, receiver):
            heapq.heappush(self._under_way, (now + self.delay, next(self._count), take))

    def deliver(self, now: float) -> None:
        """Deliver what is due."""
        while self._under_way and self._under_way[0][0] <= now:
            heapq.heappop(self._under_way)[2](now)


class RemoteWorld(World):
    """A robot's world whose ontology is on another host."""

    fleet: Fleet
    name: str

    def snapshot(self, *args: object, **named: object):  # type: ignore[no-untyped-def, override]
        network = self.fleet.network
        # A request and its answer.
        if not (network.passes(self.name, ONTOLOGY) and network.passes(ONTOLOGY, self.name)):
            raise UnavailableError('armor: no answer', lambda: True)
        return super().snapshot(*args, **named)  # type: ignore[arg-type]


class Robot:
    """One robot: its body, its programs, its files.

    Attributes:
        runs: Whether its programs run.
        decisions: Of all its lives.
        visits: The truth: when it entered which place, and when it left it (or was seen there
            last).
    """

    def __init__(self, fleet: Fleet, name: str, start: str, folder: Path) -> None:
        self.fleet, self.name = fleet, name
        self.record = folder / name / 'events.jsonl'
        self.world = RemoteWorld(start_place=start)
        self.world.fleet, self.world.name = fleet, name
        self.world.visited_at = fleet.visited_at
        self.visits: list[tuple[float, float, str]] = [(fleet.now, fleet.now, start)]
        self.decisions: list[tuple[float, Decision]] = []
        self.entered = 0
        self.runs = False
        self.going, self.due = '', 0.0
        self.begin()

    def begin(self) -> None:
        """Start its programs; what they know is what their files say."""
        self.runs = True
        self.going = ''
        self.due = self.fleet.now
        self.knowledge = FleetKnowledge(
            self.name,
            FleetSettings(silent_after=10.0),
            WIDE,
            self._say,
            lambda: self.fleet.now,
        )
        self.written = MissionRecord(self.record)
        settings = DecisionSettings(
            priorities=Priorities(('URGENT', 'CORRIDOR', 'ROOM')), urgency_threshold=int(THRESHOLD)
        )
        self.model = DecisionMaker(
            settings,
            self.world,
            self.world,
            self.world.battery,
            LearnedTimes.of_record(str(self.record)),
            traffic=FleetTraffic(self.knowledge, settings),
        )

    def kill(self) -> None:
        """End its programs at once; it stands where it is, or goes back to where it came from."""
        self.runs = False
        self.written.close()
        self.going = ''

    def _say(self, facts: FleetFacts) -> None:
        fleet = self.fleet
        facts = facts_of(message_of(facts))  # as it comes, through a message
        for other in fleet.robots.values():
            if other is not self:

                def take(now: float, other: Robot = other) -> None:
                    if other.runs:
                        other.knowledge.hear(facts, now)

                fleet.network.send(self.name, other.name, fleet.now, take)

    def step(self, now: float) -> None:
        """Do what is due; a robot that stands is in its place all the time."""
        self.world.clock.time = now
        if not self.going:
            begin, _, place = self.visits[-1]
            self.visits[-1] = begin, now, place
        if not self.runs:
            return
        self.knowledge.repeat()
        if now < self.due:
            return
        if self.going:
            place, self.going = self.going, ''
            self.world.is_in = place
            self.visits.append((now, now, place))
            self.entered += 1
            self.model.arrived(place, now)
            self.written.write('visit', now, place=place, distance=1.0)
        try:
            decision = self.model.decide(now, NOBODY)
        except CallError:
            self.due = now + 1.0  # it has just started, and knows no map yet
            return
        self.decisions.append((now, decision))
        if decision.stay:
            self.due = now + min(decision.stay, 5.0)
            return
        self.going = decision.place
        at, to = (self.world.positions[each] for each in (self.world.is_in, decision.place))
        self.due = now + math.dist(at, to) / SPEED + EXPLORING


class Fleet:
    """Robots, the ontology's host, and what is between them.

    Attributes:
        visited_at: What the ontology says.
        faults: How many of each kind were made.
        lost, invented, twice, behind: What went wrong, in words.
    """

    def __init__(self, count: int, folder: Path, seed: int = 1) -> None:
        self.chance = random.Random(seed)
        self.network = Network(self.chance)
        self.now = 0.0
        self.quiet_since = 0.0
        self.visited_at = dict.fromkeys(POSITIONS, 0.0)
        self.robots: dict[str, Robot] = {}
        for number in range(count):
            name, start = f'robot{number + 1}', ('E', 'C1', 'R3', 'R4')[number % 4]
            self.robots[name] = Robot(self, name, start, folder)
        self.faults: Counter[str] = Counter()
        self.lost: list[str] = []
        self.invented: list[str] = []
        self.twice: list[str] = []
        self.behind: list[str] = []

    def run(self, seconds: float, step: float = 1.0) -> None:
        """Let time pass."""
        end = self.now + seconds
        while self.now < end:
            self.network.deliver(self.now)
            for robot in self.robots.values():
                robot.step(self.now)
            self.now += step

    def cut(self, hosts: set[str], seconds: float) -> None:
        """Cut hosts off from all others for a time."""
        self.faults[f'cut {seconds:.0f} s'] += 1
        self.network.down |= hosts
        self.run(seconds)
        self.network.down -= hosts
        self.quiet_since = self.now

    def lose(self, share: float, delay: float, seconds: float) -> None:
        """Have every link lose and delay messages for a time."""
        self.faults[f'loss {share:.0%}, {1000 * delay:.0f} ms'] += 1
        self.network.loss, self.network.delay = share, delay
        self.run(seconds)
        self.network.loss = self.network.delay = 0.0
        self.quiet_since = self.now

    def kill(self, name: str, seconds: float, *, cut: bool = False) -> None:
        """Kill a robot's programs, with its link where its whole host goes down; start them again.

        Those of a host that comes back have no link for another 10 s.
        """
        self.faults['host killed' if cut else 'robot killed'] += 1
        self.robots[name].kill()
        if cut:
            self.network.down.add(name)
        self.run(seconds)
        self.robots[name].begin()
        if cut:
            self.run(10.0)
            self.network.down.discard(name)
        self.quiet_since = self.now

    def fail(self) -> None:
        """Make one fault by chance."""
        chance, names = self.chance, sorted(self.robots)
        one = chance.choice(names)
        seconds = chance.choice((5.0, 5.0, 5.0, 30.0, 30.0, 120.0))
        kind = chance.randrange(7)
        if kind == 0:
            self.cut({one}, seconds)
        elif kind == 1:
            self.cut({ONTOLOGY}, seconds)
        elif kind == 2:
            self.cut({ONTOLOGY, *names}, seconds)
        elif kind == 3:
            self.lose(0.2, 0.2, seconds)
        elif kind == 4:
            self.kill(one, seconds)
        elif kind == 5:
            self.kill(one, seconds, cut=True)
        else:
            # What it did meanwhile only its files know.
            self.network.down.add(one)
            self.run(seconds)
            self.kill(one, 5.0, cut=True)

    def settle(self, seconds: float = 40.0) -> None:
        """Let all hear of all again, then compare with the truth."""
        self.run(seconds)
        self.check()

    def check(self) -> None:
        """Compare what the ontology says with where the robots were."""
        for place, said in self.visited_at.items():
            stays = [
                (begin, end, robot.name)
                for robot in self.robots.values()
                for begin, end, where in robot.visits
                if where == place
            ]
            # The ontology counts whole seconds. Who has entered now is about to tell.
            told = [stay for stay in stays if stay[0] < self.now - HEARD_WITHIN]
            if told and said < math.floor(max(told)[0]):
                begin, _, name = max(told)
                self.lost.append(
                    f'{self.now:.0f} s: {name} entered {place} at {begin:.0f} s, and the ontology '
                    f'says {said:.0f} s'
                )
            if said and not any(begin - 1.0 <= said <= end + 1.0 for begin, end, _ in stays):
                self.invented.append(f'{self.now:.0f} s: {place} at {said:.0f} s')
        for robot in self.robots.values():
            last = robot.decisions[-1][0] if robot.decisions else -math.inf
            if self.now - last > LEFT_BEHIND:
                self.behind.append(f'{self.now:.0f} s: {robot.name} has decided nothing')

    def forget(self, seconds: float) -> None:
        """Forget decisions that are so old, and all older visits of a place but its last one."""
        latest = {
            place: max(
                begin
                for r in self.robots.values()
                for begin, _, where in r.visits
                if where == place
            )
            for place in {where for r in self.robots.values() for *_, where in r.visits}
        }
        for robot in self.robots.values():
            limit = self.now - seconds
            robot.decisions = [each for each in robot.decisions if each[0] > limit][-100:]
            robot.visits = [
                each
                for each in robot.visits
                if each[1] > limit or each[0] == latest[each[2]] or each is robot.visits[-1]
            ]

    def look_for_doubles(self) -> None:
        """Find places that were URGENT to a robot although another one had just been there, after
        all had had the time to hear of it.
        """
        for robot in self.robots.values():
            for at, decision in robot.decisions:
                if decision.rule != URGENT or at < self.quiet_since + HEARD_WITHIN:
                    continue
                for other in self.robots.values():
                    for begin, _, place in other.visits:
                        since = at - begin
                        if place == decision.place and HEARD_WITHIN < since < THRESHOLD - 5.0:
                            self.twice.append(
                                f'{at:.0f} s: {robot.name} to {place}, where {other.name} was '
                                f'{since:.0f} s before'
                            )
