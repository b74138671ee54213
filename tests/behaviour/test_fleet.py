"""Robots that share a patrol: what they tell each other, and what each does with it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import pytest

from floor_plans import Station
from patrol_policy.decision import SHARE, WAIT, DecisionSettings
from patrol_policy.fleet import FleetRobot, FleetSettings, Intention, Layout, PartitionCell
from patrol_policy.rule_table import URGENT, Priorities
from patrol_policy.situation import Decision
from state_machines import Interrupt
from state_machines.exceptions import CallError, UnavailableError
from surveillance_behaviour.decision_maker import DecisionMaker
from surveillance_behaviour.fleet import FleetFacts, FleetKnowledge
from surveillance_behaviour.ros_adapters.fleet_topic import facts_of, message_of, without_future
from surveillance_behaviour.traffic import FleetTraffic, Traffic

from .scripted_world import POSITIONS, World

NOBODY = Interrupt()
WIDE = Layout.of(['R1', 'R2', 'R3', 'R4', 'C1', 'C2', 'E'], ())


@dataclass
class Air:
    """What robots hear of each other; a silent one neither speaks nor hears."""

    now: float = 0.0
    robots: dict[str, Robot] = field(default_factory=dict)
    silent: set[str] = field(default_factory=set)

    def say(self, facts: FleetFacts) -> None:
        # As it comes: through a message.
        facts = facts_of(message_of(facts))
        for name, robot in self.robots.items():
            if not {name, facts.robot.name} & self.silent:
                robot.fleet.hear(facts, self.now)

    def run(self, seconds: float, step: float = 1.0) -> None:
        end = self.now + seconds
        while self.now < end:
            for name, robot in self.robots.items():
                if name not in self.silent:
                    robot.fleet.repeat()
                    robot.step(self.now)
            self.now += step


class CutWorld(World):
    """A world whose ontology may be away."""

    away = False
    asked = 0

    def snapshot(self, *args: object, **named: object):  # type: ignore[no-untyped-def, override]
        self.asked += 1
        if self.away:
            raise UnavailableError('armor: away', lambda: not self.away)
        return super().snapshot(*args, **named)  # type: ignore[arg-type]


class Robot:
    """One robot: it decides, and drives each leg in its straight time."""

    def __init__(
        self,
        air: Air,
        name: str,
        start: str,
        rules: tuple[str, ...] = (),
        stations: Mapping[str, Station] = MappingProxyType({}),
        is_alone: bool = False,
    ) -> None:
        self.world = CutWorld(start_place=start)
        self.world.is_in = start
        if air.robots:  # One ontology.
            self.world.visited_at = next(iter(air.robots.values())).world.visited_at
        self.air = air
        self.decisions: list[Decision] = []
        self.visits: list[tuple[float, str]] = []
        self.fleet = FleetKnowledge(
            name, FleetSettings(silent_after=10.0), WIDE, air.say, lambda: air.now
        )
        settings = DecisionSettings(priorities=Priorities(rules), urgency_threshold=240)
        self.traffic = FleetTraffic(self.fleet, settings)
        self.said: list[str] = []
        self.model = DecisionMaker(
            settings,
            self.world,
            self.world,
            self.world.battery,
            warn=self.said.append,
            announce=self.decisions.append,
            tell=self.said.append,
            traffic=Traffic() if is_alone else self.traffic,
            stations=stations,
        )
        self.due = 0.0
        self.going = ''
        air.robots[name] = self

    def step(self, now: float) -> None:
        self.world.clock.time = now
        if now < self.due:
            return
        if self.going:
            self.world.is_in = self.going
            self.model.arrived(self.going, now)
            self.visits.append((now, self.going))
            self.going = ''
        decision = self.model.decide(now, NOBODY)
        if decision.stay:
            self.due = now + min(decision.stay, 5.0)
            return
        self.going = decision.place
        at, to = (self.world.positions[each] for each in (self.world.is_in, decision.place))
        self.due = now + math.dist(at, to) / 0.6 + 2.0


def patrol(count: int, rules: tuple[str, ...] = ()) -> tuple[Air, list[Robot]]:
    air = Air()
    starts = ('E', 'C1', 'R3', 'R4')
    return air, [Robot(air, f'robot{i + 1}', starts[i], rules) for i in range(count)]


def longest_wait(robots: list[Robot], begin: float, end: float) -> float:
    worst = 0.0
    for place in robots[0].world.rooms:
        times = sorted(at for robot in robots for at, where in robot.visits if where == place)
        times = [begin, *(at for at in times if begin <= at <= end), end]
        worst = max(worst, *(b - a for a, b in itertools.pairwise(times)))
    return worst


def test_facts_survive_the_message() -> None:
    facts = FleetFacts(
        FleetRobot(
            'robot2',
            'C1',
            since=5.5,
            cell=PartitionCell(('C1', 'R1'), 'R1'),
            charging_until=80.0,
            dock='E',
            charge_seconds=30.0,
        ),
        Intention('robot2', 'C1', 'R1', 4.0, is_moving=True),
        {'R1': 2.5},
    )
    assert facts_of(message_of(facts)) == facts
    wrong = message_of(facts)
    wrong.visited_at = [math.nan]
    with pytest.raises(ValueError, match='robot2 tells a time that is not finite'):
        facts_of(wrong)


def test_two_share_the_places_and_keep_them_in_half_the_time() -> None:
    _, alone = patrol(1)
    alone[0].air.run(900.0)
    air, both = patrol(2)
    air.run(900.0)
    one = longest_wait(alone, 300.0, 900.0)
    assert longest_wait(both, 300.0, 900.0) < 0.7 * one
    last = both[0].decisions[-1]
    assert last.policy == 'fleet'
    assert any('is mine' in each.reason for each in both[0].decisions)


def test_the_places_of_a_silent_robot_are_taken_over_and_given_back() -> None:
    air, (first, second) = patrol(2)
    air.run(400.0)
    air.silent.add('robot2')
    air.run(400.0)
    places = {where for at, where in first.visits if at > 430.0}
    assert places == set(first.world.rooms)
    reasons = [each.reason for each in first.decisions if each.time > 400.0]
    assert any('robot2 was last heard at' in each for each in reasons)
    air.silent.clear()
    air.run(400.0)
    assert longest_wait([first, second], 900.0, 1200.0) < 0.75 * longest_wait([first], 450.0, 800.0)


def test_the_rules_hold_for_each_robot() -> None:
    air, robots = patrol(2, ('URGENT', 'CORRIDOR', 'ROOM'))
    air.run(900.0)
    for robot in robots:
        for each in robot.decisions:
            assert each.rule in ('URGENT', 'CORRIDOR', 'ROOM', SHARE, WAIT)
    assert longest_wait(robots, 0.0, 900.0) < 400.0


def test_with_rules_four_keep_the_threshold_and_wait_in_no_room() -> None:
    _, robots = patrol(4, ('URGENT', 'CORRIDOR', 'ROOM'))
    robots[0].air.run(1500.0)
    # The threshold of 240 s, and one round of the corridors.
    assert longest_wait(robots, 0.0, 1500.0) < 310.0
    decisions = [each for robot in robots for each in robot.decisions]
    urgent = [(each.time, each.place) for each in decisions if each.rule == URGENT]
    assert len(urgent) > 15
    for each in decisions:
        assert not (each.rule == SHARE and each.stay and each.place.startswith('R'))
    # Each URGENT place is one robot's.
    for (at, place), (then, other) in itertools.pairwise(sorted(urgent)):
        assert place != other or then - at > 200.0 or then - at < 2.0


def test_without_the_ontology_each_patrols_on_and_nothing_is_lost() -> None:
    air, (first, second) = patrol(2)
    air.run(200.0)
    first.world.away = True
    air.silent.update(('robot1', 'robot2'))  # Cut off from each other, too.
    before = len(first.visits)
    for _ in range(120):
        air.now += 1.0
        first.step(air.now)
        second.step(air.now)
    assert len(first.visits) > before + 4
    assert [each for each in first.said if 'patrolling on by what was known' in each]
    first.world.away = False
    air.silent.clear()
    air.run(30.0)
    latest: dict[str, float] = {}
    for at, where in sorted(first.visits + second.visits):
        latest[where] = at
    outlook = first.model.look(air.now, NOBODY)
    for place, at in latest.items():
        assert outlook.visited_at[place] >= at - 1.0
        # The ontology counts whole seconds.
        assert first.world.visited_at[place] >= math.floor(at)


def test_an_ontology_that_does_not_answer_is_not_waited_for_again_at_each_decision() -> None:
    _air, (first, _second) = patrol(2)
    first.model.decide(0.0, NOBODY)
    world, asked = first.world, first.world.asked
    world.away = world.is_silent = True
    for now in (1.0, 2.0, 3.0):
        first.model.decide(now, NOBODY)
    assert world.asked == asked + 1, 'once, and then only looked for'
    world.away = world.is_silent = False
    first.model.decide(4.0, NOBODY)
    assert world.asked == asked + 2
    assert 'the ontology answers again' in first.said[-1]


def test_one_robot_alone_without_an_ontology_waits_as_ever() -> None:
    air = Air()
    robot = Robot(air, 'robot1', 'E', is_alone=True)
    robot.world.away = True
    with pytest.raises(CallError):
        robot.model.decide(0.0, NOBODY)


def test_of_two_at_a_narrow_door_one_waits_and_says_for_whom() -> None:
    _air, (first, second) = patrol(2)
    second.fleet.tell(
        place='R1', intention=Intention('robot2', 'R1', 'C1', -5.0, is_moving=True), now=0.0
    )
    first.world.is_in = 'C1'
    first.model.learned.requested = 'R1'
    decision = first.model.decide(1.0, NOBODY)
    assert (decision.rule, decision.place) == (WAIT, 'C1')
    assert decision.stay > 0.0
    assert 'robot2 is on the way C1 - R1' in decision.reason
    second.fleet.tell(intention=Intention('robot2', 'C1', '', -5.0), place='C1', now=2.0)
    assert first.model.decide(2.0, NOBODY).place == 'R1'


def test_who_charges_has_the_dock_and_the_other_waits() -> None:
    _air, (first, second) = patrol(2)
    second.fleet.tell(place='E', dock='E', charging_until=500.0, now=0.0)
    first.world.is_in = 'C1'
    first.model.begin(1.0, NOBODY)
    first.model.send_to_charge('the battery is low')
    first.world.battery.set_level(10.0)
    decision = first.model.decide(2.0, NOBODY)
    assert (decision.rule, decision.place) == (WAIT, 'C1')
    assert "the station in E is robot2's" in decision.reason
    second.fleet.tell(dock=None, charging_until=None)
    assert first.model.decide(3.0, NOBODY).place == 'E'


def test_a_robot_that_stands_on_its_way_is_told_of() -> None:
    air, (first, second) = patrol(2)
    second.fleet.tell(place='C1', intention=Intention('robot2', 'C1', 'R1', 0.0, is_moving=True))
    air.now = 50.0
    second.fleet.repeat()
    assert not first.fleet.standing(air.now)
    air.now = 70.0
    second.fleet.repeat()
    assert first.fleet.standing(air.now) == {
        'robot2': 'robot2 has been on its way from C1 to R1 for more than 60 s'
    }
    second.fleet.tell(intention=Intention('robot2', 'C1', 'R2', 75.0))
    assert not first.fleet.standing(air.now)
    air.now = 140.0
    second.fleet.repeat()
    assert first.fleet.standing(air.now) == {
        'robot2': 'robot2 has waited to go from C1 to R2 for more than 60 s'
    }
    air.now = 170.0
    assert first.fleet.standing(170.0) == {'robot2': 'robot2 has not been heard for more than 10 s'}


def test_a_robot_is_taken_out_and_put_back() -> None:
    air, (first, second) = patrol(2)
    air.run(100.0)
    assert second.traffic.take_out(True) == 'robot2 is taken out: the others have its places'
    begin = len(second.visits)
    air.run(300.0)
    # What it was on its way to it still reaches.
    assert len(second.visits) <= begin + 1
    assert second.decisions[-1].reason == 'no place is mine: robot2 is taken out'
    assert {where for at, where in first.visits if at > 130.0} == set(first.world.rooms)
    second.traffic.take_out(False)
    air.run(100.0)
    assert len(second.visits) > begin + 3


def test_who_waits_keeps_its_turn_when_it_wants_something_else() -> None:
    _air, (first, second) = patrol(2)
    way = Intention('robot2', 'R1', 'C1', 0.0, is_moving=True)
    second.fleet.tell(place='R1', intention=way, now=0.0)
    first.world.is_in = 'C1'
    first.model.learned.requested = 'R1'
    assert first.model.decide(1.0, NOBODY).rule == WAIT
    first.model.learned.requested = 'R2'
    assert first.model.decide(9.0, NOBODY).place == 'R2'
    assert first.fleet.own.intention.since == 1.0


def test_visits_that_no_clock_has_reached_are_not_believed() -> None:
    visits = {'R1': 90.0, 'R2': 86_500.0}
    facts = FleetFacts(FleetRobot('robot2', 'C1'), Intention('robot2', 'C1'), visits)
    assert without_future(facts, 102.0).visits == {'R1': 90.0}
    assert without_future(facts, 86_502.0) is facts


def test_a_charge_in_passing_keeps_the_share_and_has_its_time() -> None:
    air = Air()
    stations = {'E': Station((POSITIONS['E'][0] + 6.0, POSITIONS['E'][1], 0.0))}
    first, second = (
        Robot(air, name, at, stations=stations) for name, at in (('a', 'E'), ('b', 'C1'))
    )
    for robot in (first, second):
        robot.fleet.settings = FleetSettings(docks=('E',))
    air.run(40.0)
    model, now = first.model, air.now
    cell = first.fleet.own.robot.cell
    assert cell is not None
    tour = cell.tour
    for step in range(60):  # 0.1 % a second
        model.learned.draw.observe(now - 60.0 + step, 90.0 - step // 10)
    first.world.set_level(60.0)
    first.world.is_in = first.going = 'E'
    model.arrived('E', now)
    first.fleet.tell(cell=PartitionCell(tour, 'E'))
    model.decide(now, NOBODY)  # Now all know what its battery needs.
    first.fleet.tell(cell=PartitionCell(tour, 'E'))
    decision = model.decide(now + 1.0, NOBODY)
    assert (decision.rule, decision.place) == ('recharge', 'E')
    assert 'charging in passing at E' in decision.reason
    assert decision.slot is not None
    own = second.fleet.outlook(model.graph, now).robots[0]
    assert own.dock == 'E'
    ends = decision.slot.end + 6.0 / model.settings.speed  # it drives to its dock first
    assert own.charging_until == pytest.approx(ends, abs=1.5)
    assert own.runs_until is not None
    assert 15.0 < 60.0 - 0.1 * (own.runs_until - now) < 25.0, 'until it must charge'
    model.learn_draw(lambda: now + 1.0)
    first.world.set_level(61.0)
    own = second.fleet.outlook(model.graph, now).robots[0]
    assert own.charging_until == pytest.approx(ends, abs=1.5)
    assert own.cell == PartitionCell(tour, tour[(tour.index('E') + 1) % len(tour)])
    assert not model.charge_is_over(now + 2.0)
    assert model.why_charge()
    assert model.charge_is_over(decision.slot.end + 60.0)
    model.charged()
    assert model.why_charge() == ''
    assert second.fleet.outlook(model.graph, now).robots[0].cell == own.cell


def test_a_planned_charge_makes_good_what_a_round_has_cost() -> None:
    _air, (robot,) = patrol(1)
    for ratio, taken in ((0.0, 0.0), (0.004, 0.01), (0.07, 0.07), (0.125, 0.13)):
        robot.fleet.charges_at(ratio)
        assert robot.fleet.settings.charge_ratio == taken
