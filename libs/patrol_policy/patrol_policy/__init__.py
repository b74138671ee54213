"""Where a patrol robot goes next: rules, policies within them, the battery, and why.

- `graph`: a map as places and legs in seconds; `tour`: its shortest tour;
- `decision`: `decide(world, battery, settings)`, the one function that decides; `why_not`;
- `policies`, `plan`, `rollout`, `rounds`: which of the allowed places;
- `battery`: when to go charging; `simulation`: a patrol in simulated time.
"""

from __future__ import annotations

from patrol_policy.battery import Battery, BatteryLimits
from patrol_policy.decision import (
    DecisionSettings,
    NowhereToGoError,
    Rules,
    WhyNot,
    decide,
    why_not,
)
from patrol_policy.graph import GraphError, PatrolGraph, graph_of_places
from patrol_policy.world import Decision, World

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
