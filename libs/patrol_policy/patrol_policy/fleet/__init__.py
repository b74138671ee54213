"""Several robots on one map without a leader: each computes the same shares from the same facts.

- `partition`: groups of places and how many robots each has, a function of the map and the number;
- `assignment`: `choose(graph, robots, name, now)`, what one robot does next, and why;
- `traffic`: `right_of_way`, who goes first through what is too narrow for two;
- `docks`: slots at the docks that do not overlap;
- `simulation`: a fleet in simulated time; `ruled`: how it decides where rules hold;
- `charging_bound`: what robots that charge cannot beat.
"""

from __future__ import annotations

from patrol_policy.fleet.assignment import (
    Assignment,
    FleetChoice,
    FleetError,
    FleetOutlook,
    FleetRobot,
    FleetSettings,
    PartitionCell,
    assign,
    choose,
)
from patrol_policy.fleet.docks import ChargeNeed, DockSlot, dock_slots
from patrol_policy.fleet.partition import FleetPlan, Group, exact_wait, fleet_plan
from patrol_policy.fleet.traffic import (
    Intention,
    Layout,
    RightOfWay,
    may_be_contested,
    right_of_way,
)

__all__ = [
    'Assignment',
    'ChargeNeed',
    'DockSlot',
    'FleetChoice',
    'FleetError',
    'FleetOutlook',
    'FleetPlan',
    'FleetRobot',
    'FleetSettings',
    'Group',
    'Intention',
    'Layout',
    'PartitionCell',
    'RightOfWay',
    'assign',
    'choose',
    'dock_slots',
    'exact_wait',
    'fleet_plan',
    'may_be_contested',
    'right_of_way',
]
