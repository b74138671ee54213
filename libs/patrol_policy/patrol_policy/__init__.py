"""Where a patrol robot goes next: rules, policies within them, the battery, and why.

Begin with ``python -m patrol_policy.demo``, then `decide` in `decision`, the one function that
decides; it is asked with what is known (`situation`), the `battery` and settings. Which class of
places comes first is in `rule_table`, which of its places in `policies`; the others follow from
these.

Public modules: `battery`, `decision`, `fleet`, `graph`, `hours`, `lower_bounds`, `patrolling_sim`,
`plan`, `policies`, `idleness_bounds`, `rule_table`, `simulation`, `tour`, `situation`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from patrol_policy.battery import Battery as Battery
    from patrol_policy.battery import BatteryLimits as BatteryLimits
    from patrol_policy.decision import DecisionSettings as DecisionSettings
    from patrol_policy.decision import NowhereToGoError as NowhereToGoError
    from patrol_policy.decision import WhyNot as WhyNot
    from patrol_policy.decision import decide as decide
    from patrol_policy.decision import why_not as why_not
    from patrol_policy.graph import GraphError as GraphError
    from patrol_policy.graph import PatrolGraph as PatrolGraph
    from patrol_policy.graph import graph_of_places as graph_of_places
    from patrol_policy.rule_table import Priorities as Priorities
    from patrol_policy.situation import Decision as Decision
    from patrol_policy.situation import Situation as Situation

_HOME = {
    'Battery': 'patrol_policy.battery',
    'BatteryLimits': 'patrol_policy.battery',
    'Decision': 'patrol_policy.situation',
    'DecisionSettings': 'patrol_policy.decision',
    'GraphError': 'patrol_policy.graph',
    'NowhereToGoError': 'patrol_policy.decision',
    'PatrolGraph': 'patrol_policy.graph',
    'Priorities': 'patrol_policy.rule_table',
    'WhyNot': 'patrol_policy.decision',
    'Situation': 'patrol_policy.situation',
    'decide': 'patrol_policy.decision',
    'graph_of_places': 'patrol_policy.graph',
    'why_not': 'patrol_policy.decision',
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    # Late, so that who only reads hours and thresholds does not load the policies.
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    found = globals()[name] = getattr(import_module(_HOME[name]), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
