"""The parameters of `arm_controller`, declared and checked in one place."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Described, declare_fields
from surveillance_runtime.robot_arm import Arm, Array

_SCAN = {
    'dwell': Described('Rest at each view of a scan, seconds.', 0.0),
    'pictures': Described(
        'Pictures that the marker detector must have looked at before a view is left.', 0
    ),
    'patience': Described('Seconds after which a view is left without them.', 0.0),
}
_PAN = {'left': math.pi / 2, 'home': 0.0, 'right': -math.pi / 2, 'back': math.pi}


@dataclass
class ArmSettings:
    """What an operator can set.

    Attributes:
        poses: Joint positions (n,) of the named poses, rad.
        dwell: Rest at each view of a scan, seconds; may change at any time.
        pictures: Pictures that the marker detector must have looked at before a view is left.
        patience: Seconds after which a view is left without them.
        horizontal: The camera's horizontal field of view, rad.
        vertical: The vertical one, rad.
    """

    poses: Mapping[str, Array]
    dwell: float = 0.5
    pictures: int = 4
    patience: float = 1.5
    horizontal: float = math.radians(60.0)
    vertical: float = math.radians(46.8)


def arm_settings(node: PatrolNode, arm: Arm) -> ArmSettings:
    """Declare the parameters.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    settings = declare_fields(
        node,
        ArmSettings({name: _pose(node, arm, name, pan) for name, pan in _PAN.items()}),
        _SCAN,
        on_change=lambda *change: setattr(settings, *change),
    )
    for name in ('horizontal', 'vertical'):
        degrees = node.parameter(
            f'{name}_field_of_view',
            round(math.degrees(getattr(settings, name)), 3),
            f"The camera's {name} field of view, degrees.",
            minimum=5.0,
            maximum=150.0,
            read_only=True,
        )
        setattr(settings, name, math.radians(degrees))
    return settings


def _pose(node: PatrolNode, arm: Arm, name: str, pan: float) -> Array:
    def check(value: Sequence[float]) -> str | None:
        pose = np.array(value)
        if len(pose) == len(arm.names) and (arm.lower <= pose).all() and (pose <= arm.upper).all():
            return None
        return f'{len(arm.names)} joint positions within the limits of the arm'

    value = node.parameter(
        f'pose_{name}',
        [pan, *arm.home[1:]],
        f'Joint positions of the pose {name}, rad, in the order {", ".join(arm.names)}.',
        check=check,
        read_only=True,
    )
    return np.array(value)
