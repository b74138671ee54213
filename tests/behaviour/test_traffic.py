"""Who goes first, who has a dock, and what a robot that is alone makes of it: nothing."""

from __future__ import annotations

from dataclasses import replace

from patrol_policy.battery import Battery
from patrol_policy.decision import RECHARGE, SHARE, WAIT, DecisionSettings
from patrol_policy.fleet import DockSlot, FleetRobot, FleetSettings, Intention, Layout
from patrol_policy.graph import PatrolGraph
from patrol_policy.situation import Decision, Situation
from state_machines import Interrupt
from surveillance_behaviour.fleet import FleetFacts, FleetKnowledge
from surveillance_behaviour.traffic import FleetTraffic, Traffic

GRAPH = PatrolGraph({'A': {'B': 5.0}, 'B': {'A': 5.0, 'C': 5.0}, 'C': {'B': 5.0}})
NOBODY = Interrupt()


def robot(said: list[FleetFacts]) -> FleetTraffic:
    layout = Layout(frozenset(), frozenset())
    knowledge = FleetKnowledge('robot1', FleetSettings(), layout, said.append, lambda: 0.0)
    return FleetTraffic(knowledge, DecisionSettings())


def known(traffic: Traffic) -> Situation:
    fleet = traffic.outlook(lambda: GRAPH, 10.0)
    return Situation('A', 10.0, ('B',), {}, {}, GRAPH, fleet=fleet)


def to(place: str, rule: str = SHARE) -> Decision:
    return Decision(10.0, 'A', place, place, rule, 'fleet', 'because')


def test_nobody_is_in_the_way_of_a_robot_that_is_alone() -> None:
    alone = Traffic()
    decision = to('B')
    assert alone.enter(decision, known(alone), Battery(), {}, NOBODY) is decision
    assert alone.outlook(lambda: GRAPH, 10.0) is None
    assert alone.others_visits is None
    assert not alone.passing_charge_is_over(1e9)


def test_a_robot_says_where_it_goes_and_waits_for_one_that_is_on_the_way() -> None:
    said: list[FleetFacts] = []
    traffic = robot(said)
    assert traffic.enter(to('B'), known(traffic), Battery(), {'A': 9.0}, NOBODY).place == 'B'
    assert said[-1].intention == Intention('robot1', 'A', 'B', 10.0, is_moving=True)
    assert said[-1].visits == {'A': 9.0}
    traffic.stands('A')
    assert said[-1].intention.heading_to == ''
    other = Intention('robot2', 'B', 'A', 0.0, is_moving=True)
    traffic.fleet.hear(FleetFacts(FleetRobot('robot2', 'B'), other), 10.0)
    decision = traffic.enter(to('B'), known(traffic), Battery(), {}, NOBODY)
    assert (decision.rule, decision.place) == (WAIT, 'A')
    assert 'robot2' in decision.reason


def test_a_dock_is_the_robots_that_stands_in_it() -> None:
    traffic = robot([])
    at_dock = FleetRobot('robot2', 'A', dock='A', charging_until=99.0)
    traffic.fleet.hear(FleetFacts(at_dock, Intention('robot2', 'A', '')), 10.0)
    assert traffic.who_is_at('A', known(traffic)) == 'robot2'
    decision = traffic.enter(to('A', RECHARGE), known(traffic), Battery(), {}, NOBODY)
    assert (decision.rule, decision.reason) == (WAIT, "because; the station in A is robot2's")


def test_a_charge_in_passing_has_its_time() -> None:
    traffic = robot([])
    charge = replace(to('A', RECHARGE), slot=DockSlot('robot1', 'A', 10.0, 40.0))
    traffic.begin_charge(charge, '', 2.0)
    assert [traffic.passing_charge_is_over(now) for now in (41.0, 42.0)] == [False, True]
    traffic.begin_charge(charge, 'the battery is low', 2.0)
    assert not traffic.passing_charge_is_over(1e9)
