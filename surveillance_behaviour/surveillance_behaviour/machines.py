"""The machines by name, as the node, the checker and the drawings find them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from surveillance_behaviour import fsm
from surveillance_behaviour.mission import Mission
from surveillance_behaviour.patrol_machine import patrol_machine
from surveillance_behaviour.surveillance_machine import surveillance_machine

MACHINES: Mapping[str, Callable[[Mission], fsm.StateMachine]] = {
    'surveillance': surveillance_machine,
    'patrol': patrol_machine,
}
