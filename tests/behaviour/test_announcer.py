"""What the robot says of itself on `mission_status`: news, as long as they are some."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import state_machines as fsm
from surveillance_behaviour.ros_adapters.peers import RosAnnouncer
from surveillance_interfaces.msg import MissionStatus
from surveillance_runtime.qos import STATE_QOS


def test_what_was_said_in_a_place_is_no_news_on_the_way_to_the_next_one(graph: Any) -> None:
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('WAIT', fsm.CBState(lambda _: 'done', outcomes=['done']))
    mission: Any = SimpleNamespace(
        battery=SimpleNamespace(level=80),
        machine='surveillance',
        place='C1',
        heading_to='C1',
        recovery=SimpleNamespace(avoided=lambda _now: ()),
        now=lambda: 0.0,
    )
    told = graph.listen(MissionStatus, 'mission_status', STATE_QOS)
    announcer = RosAnnouncer(graph.node)
    announcer.attach(mission, machine)

    def says(text: str, *, waits: bool = False) -> bool:
        graph.until(lambda: bool(told) and told[-1].text == text)
        return bool(told[-1].waiting_for_help) == waits

    announcer.say('arrived in C1')
    assert says('arrived in C1')
    mission.heading_to = 'R1'
    machine.execute(fsm.UserData())
    assert says('')
    announcer.say('trying another path')
    machine.execute(fsm.UserData())
    assert says('trying another path')
    announcer.waiting_for_help('no way to R1')
    mission.place, mission.heading_to = 'C1', 'C1'
    machine.execute(fsm.UserData())
    assert says('no way to R1', waits=True)
    announcer.waiting_for_help('')
    assert says('trying again')
    mission.place = mission.heading_to = 'R1'
    announcer.say('arrived in R1')
    assert says('arrived in R1')
