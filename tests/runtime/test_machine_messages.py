"""A transition as a message."""

from __future__ import annotations

import json

from builtin_interfaces.msg import Time

from state_machines.transitions import Transition
from surveillance_runtime.machine_messages import transition_message


def test_a_transition_is_told_whole():
    transition = Transition(
        3, 12.5, 'A/B', 'C', 'done', 'D', 'transition', 0.25, 2, {'x': [1, {'y': None}]}
    )
    message = transition_message(transition, ['A/B'], Time(sec=12, nanosec=500_000_000))
    for name in ('sequence', 'path', 'from_state', 'outcome', 'to_state', 'kind', 'duration'):
        assert getattr(message, name) == getattr(transition, name)
    assert (message.visits, message.active) == (2, ['A/B'])
    told = dict(zip(message.userdata_keys, message.userdata_values, strict=True))
    assert {key: json.loads(value) for key, value in told.items()} == transition.userdata
