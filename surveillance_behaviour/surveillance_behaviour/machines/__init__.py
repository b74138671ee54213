"""The machines by name, as the node, the checker and the drawings find them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import state_machines as fsm
from surveillance_behaviour.machines.patrol_machine import patrol_machine
from surveillance_behaviour.machines.surveillance_machine import surveillance_machine
from surveillance_behaviour.mission.mission import Mission

MACHINES: Mapping[str, Callable[[Mission], fsm.StateMachine]] = {
    'surveillance': surveillance_machine,
    'patrol': patrol_machine,
}
