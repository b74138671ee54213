"""The layout of RViz for a fleet: that for one robot, with a group of displays for each robot."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import yaml

from surveillance_runtime.node_table import name_for

COLOURS = (
    *('255; 213; 74', '74; 163; 255', '242; 120; 159', '63; 191; 127'),
    *('180; 140; 255', '255; 157; 77', '70; 200; 214', '179; 186; 195'),
)
"""Of the robots, in the order of their names; as on the page."""
NEEDS_FRAMES = ('rviz_default_plugins/LaserScan', 'rviz_default_plugins/RobotModel')
"""Displays that need `tf`, which each robot has for itself."""
OF_PLACE = ('places', 'names', 'doors')
"""Namespaces of the markers that are the same for all robots."""


def fleet_layout(text: str, robots: Sequence[str], namespace: str | None = None) -> str:
    """Return the layout of a fleet.

    Lidar and model are switched off: RViz hears one `tf` at a time. Whoever wants to see those of
    a robot starts it with `--ros-args -r tf:=/robot1/tf -r tf_static:=/robot1/tf_static`.

    Args:
        text: The layout for one robot.
        robots: Their names.
        namespace: The one that they are in; None: none.
    """
    layout = yaml.safe_load(text)
    manager = layout['Visualization Manager']
    prefix = f'/{(namespace or "").strip("/")}'.rstrip('/')
    usual: list[dict[str, Any]] = manager['Displays']
    shared = [each for each in usual if _is_shared(each)]
    groups = [
        {
            'Class': 'rviz_common/Group',
            'Name': robot,
            'Enabled': True,
            'Displays': [
                _of_robot(each, f'{prefix}/{robot}', COLOURS[number % len(COLOURS)], number == 0)
                for each in usual
                if each not in shared
            ],
        }
        for number, robot in enumerate(sorted(robots))
    ]
    manager['Displays'] = [*(_moved(each, prefix) for each in shared), *groups]
    return yaml.safe_dump(layout, sort_keys=False)


def _topic(display: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = display.get('Description Topic') or display['Topic']
    return found


def _is_shared(display: dict[str, Any]) -> bool:
    name = str(_topic(display)['Value']).strip('/')
    return name_for('robot', name) == name


def _moved(display: dict[str, Any], prefix: str) -> dict[str, Any]:
    """Return a display whose topic is in a namespace."""
    moved = copy.deepcopy(display)
    topic = _topic(moved)
    topic['Value'] = f'{prefix}/{topic["Value"].strip("/")}'
    return moved


def _of_robot(display: dict[str, Any], prefix: str, colour: str, is_first: bool) -> dict[str, Any]:
    """Return a display of one robot, in its colour."""
    moved = _moved(display, prefix)
    if 'Color' in moved or moved['Class'].endswith('PoseWithCovariance'):
        moved['Color'] = colour
    if moved['Class'] in NEEDS_FRAMES:
        moved['Enabled'] = False
    if moved['Class'].endswith('MarkerArray') and not is_first:
        moved['Namespaces'] = dict.fromkeys(OF_PLACE, False)
    return moved
