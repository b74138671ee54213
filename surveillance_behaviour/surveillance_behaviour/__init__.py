"""Patrol policies, missions and the state machines of the robot.

What stands here needs no ROS: ``decide(world, battery, settings)`` chooses where a robot goes next,
and `why_not` says why not somewhere else. Maps are `PatrolGraph`; the module `policy.simulation`
patrols one in simulated time.
"""

from __future__ import annotations

from surveillance_behaviour.decision import (
    DecisionSettings,
    NowhereToGoError,
    Rules,
    WhyNot,
    decide,
    why_not,
)
from surveillance_behaviour.policy.battery_reserve import Battery, BatteryLimits
from surveillance_behaviour.policy.graph import GraphError, PatrolGraph, graph_of_places
from surveillance_behaviour.policy.world import Decision, World

__all__ = [
    'Battery',
    'BatteryLimits',
    'Decision',
    'DecisionSettings',
    'GraphError',
    'NowhereToGoError',
    'PatrolGraph',
    'Rules',
    'WhyNot',
    'World',
    'decide',
    'graph_of_places',
    'why_not',
]
