"""The topic `incidents` tells whoever comes late what goes on."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest

from surveillance_runtime.incident_topic import DEPTH, hear_incidents
from surveillance_runtime.incidents import Cause, IncidentUpdate, SeenThing, Severity
from surveillance_runtime.node import PatrolNode

DOOR = ('door', 'D1')


@pytest.mark.usefixtures('incidents_at_once')
def test_a_late_listener_is_told_what_goes_on_however_much_was_told(graph: Any) -> None:
    robot = graph.add(partial(PatrolNode, 'observer'))
    seen = SeenThing(3, 'door', 'ajar', 'D1', (1.0, 2.0), 0.5, 'D1 is shut')
    robot.incidents.begin(DOOR, 'D1 is\nclosed', Severity.ALARM, place='C1', finding=seen)
    for number in range(3 * DEPTH):
        robot.incidents.begin(('topic', str(number)), 'two publishers')
        robot.incidents.end(('topic', str(number)))
    heard: dict[Cause, IncidentUpdate] = {}
    late = graph.add(partial(PatrolNode, 'late'))
    hear_incidents(late, lambda told, _: heard.update({told.cause: told}))
    graph.until(lambda: Cause(*DOOR) in heard)
    told = heard[Cause(*DOOR)]
    assert (told.owner, told.place, told.finding) == ('observer', 'C1', seen)
    assert told.text == r'D1 is\nclosed'
