"""What a node that decides has and offers: its `DecisionMaker`, `decision`, `why_not`, `go_to`."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from floor_plans import Station
from floor_plans.parameters import patrol_rules, stations_in
from patrol_policy.decision import DecisionSettings
from patrol_policy.idleness_bounds import IdlenessBound
from patrol_policy.situation import Decision
from state_machines import Interrupt
from state_machines.exceptions import CallError
from strict_files.settings import parameter
from surveillance_behaviour import conversions
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.decision_maker import DecisionMaker
from surveillance_behaviour.learned_times import LearnedTimes
from surveillance_behaviour.ports import Ontology, Places
from surveillance_behaviour.ros_adapters.fleet_topic import fleet_of
from surveillance_behaviour.traffic import FleetTraffic, Traffic
from surveillance_interfaces.msg import Decision as DecisionMessage
from surveillance_interfaces.srv import GoTo, WhyNot
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_changes import TOPIC, follow_place
from surveillance_runtime.place_parameters import described_patrol_rules, described_stations
from surveillance_runtime.state_topics import OwnedTopic
from surveillance_runtime.waiting import AwaitedWork

SETTLE = 0.15
"""How long a robot waits until the others have heard what it wants, seconds of real time."""


@dataclass(frozen=True)
class MemorySettings:
    """Parameters of a node that decides: its record and its random seed."""

    record: str = parameter(
        '',
        'File that the mission is recorded in, and beside which `FILE.experience.json` keeps what '
        'was learned (visits, leg times, battery); empty: none.',
    )
    random_seed: int = parameter(
        -1, 'Makes the policies that draw repeatable; -1 takes another course each time.', -1
    )


def decision_maker_of(
    node: PatrolNode,
    settings: DecisionSettings,
    memory: MemorySettings,
    ontology: Ontology,
    places: Places,
    battery: BatteryMonitor,
    elapsed: Callable[[], float],
    sweeps: Callable[[], Mapping[str, float]] = dict,
) -> DecisionMaker:
    """Return what a robot knows when it decides, with what it learned before.

    It learns how fast the battery falls. Its decisions are published and logged, numbered from 1.

    Args:
        node: The node that decides.
        settings: Shared with whoever changes them.
        memory: Where what was learned is, see `LearnedTimes.of_record`.
        ontology: The ontology.
        places: Where the places are.
        battery: The battery.
        elapsed: Seconds as they pass on the mission's clock, which no setting of the date changes.
        sweeps: Returns how long each place that is swept takes, seconds, as far as is known.
    """
    log = node.get_logger()
    stations = described_stations(node, settings.recharge_rooms)
    node.add_on_set_parameters_callback(partial(_stations_expected, stations))
    learned = LearnedTimes.of_record(memory.record)
    if learned.problem:
        log.warn(learned.problem)
    generator = random.Random(memory.random_seed if memory.random_seed >= 0 else None)
    topic = OwnedTopic(node, DecisionMessage, 'decision')
    bounds_topic = OwnedTopic(node, DiagnosticArray, 'idleness_bounds')
    rules = described_patrol_rules(node)
    hours = rules.calendar.in_words()
    count, logged = 0, ''

    def announce(decision: Decision) -> None:
        nonlocal count, logged
        count += 1
        stamp = node.get_clock().now().to_msg()
        topic.publish(conversions.decision_message(decision, count, stamp))
        # One that only stays is made again and again, with other numbers.
        said = re.sub(r'[\d.]+', '', f'{decision.place} {decision.reason}') if decision.stay else ''
        if said and said == logged:
            return
        logged = said
        log.info(
            f'decision {count}: {decision.from_place} -> {decision.place} '
            f'[{decision.rule}] {decision.reason}'
        )

    robot = str(node.get_parameter('robot_name').value)
    fleet = fleet_of(node, robot, settings.recharge_rooms)
    traffic = Traffic()
    if fleet is not None:
        traffic = FleetTraffic(fleet, settings, _settle)

    def publish_bounds(found: tuple[IdlenessBound, ...]) -> None:
        stamp = node.get_clock().now().to_msg()
        bounds_topic.publish(conversions.idleness_bounds_message(found, hours, stamp))

    decision_maker = DecisionMaker(
        settings,
        ontology,
        places,
        battery,
        learned,
        generator,
        lambda w: log.warn(w),
        announce,
        elapsed,
        rules,
        lambda sentence: log.info(sentence),
        stations,
        traffic,
        publish_bounds,
        sweeps,
    )
    decision_maker.learn_draw(elapsed)

    def take_place(described: Mapping[str, Any]) -> None:
        """Take the rules and the stations of a place that was changed."""
        nonlocal hours
        changed = patrol_rules(described)
        found = stations_in(described)
        hours = changed.calendar.in_words()
        decision_maker.take_rules(changed)
        stations.clear()
        stations.update(found)
        decision_maker.take_stations(found)
        rooms = [str(each) for each in described.get('recharge_rooms') or ()]
        # Of a fleet stations are read at the start, and a robot may have one of them alone.
        if fleet is None and rooms != list(settings.recharge_rooms):
            kind = Parameter.Type.STRING_ARRAY
            answer, *_ = node.set_parameters([Parameter('recharge_rooms', kind, rooms)])
            if not answer.successful:
                log.error(f'topic {TOPIC}: {answer.reason}')

    follow_place(node, take_place)
    return decision_maker


def _settle(interrupt: Interrupt) -> None:
    interrupt.wait(SETTLE)


def _stations_expected(
    stations: Mapping[str, Station], changed: Iterable[Parameter]
) -> SetParametersResult:
    """Refuse a recharge room without a station, where the place says where its stations are."""
    for each in changed:
        if each.name == 'recharge_rooms' and '' not in stations and stations:
            for room in each.value or ():
                if room not in stations:
                    reason = (
                        f'parameter recharge_rooms: room {room!r} has no station, expected some '
                        f'of [{", ".join(stations)}]'
                    )
                    return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


def offer_decision_services(
    node: PatrolNode,
    decision_maker: DecisionMaker,
    now: Callable[[], float],
    avoided: Callable[[], frozenset[str]],
) -> AwaitedWork:
    """Answer why a place is not chosen, and take where an operator wants the robot.

    Args:
        node: The node that decides.
        decision_maker: What decides.
        now: Seconds on the mission's clock.
        avoided: The places that could not be reached lately.

    Returns:
        The thread on which the ontology may be asked; it ends with the node.
    """
    work = AwaitedWork(node, 1)
    node.stopping.subscribe(work.stop)

    async def on_why_not(request: Any, response: Any) -> Any:
        def answer() -> None:
            try:
                told = decision_maker.why_not(request.place, now(), node.stopping, avoided())
            except (ValueError, CallError) as error:
                response.success, response.message = False, str(error)
                return
            response.success, response.message = True, told.sentence
            response.premises = list(told.premises)

        await work.run(answer)
        return response

    def on_go_to(request: Any, response: Any) -> Any:
        try:
            response.message = decision_maker.request(request.place)
            response.success = True
            node.get_logger().info(response.message)
        except ValueError as error:
            response.message = str(error)
        return response

    traffic = decision_maker.traffic
    if isinstance(traffic, FleetTraffic):

        def on_take_out(request: Any, response: Any) -> Any:
            response.message, response.success = traffic.take_out(request.data), True
            node.get_logger().info(response.message)
            return response

        node.create_service(SetBool, 'take_out', on_take_out)
    group = ReentrantCallbackGroup()
    node.create_service(WhyNot, 'why_not', on_why_not, callback_group=group)
    node.create_service(GoTo, 'go_to', on_go_to, callback_group=group)
    return work
