"""The parameters of `arm_controller`, declared and checked in one place."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import converted, parameter
from surveillance_runtime.robot_arm import Arm, Array

_PAN = {'left': math.pi / 2, 'home': 0.0, 'right': -math.pi / 2, 'back': math.pi}


@dataclass
class ArmSettings:
    """What an operator can set.

    Attributes:
        poses: Joint positions (n,) of the named poses, rad.
        dwell: Rest at each view of a scan, seconds; may change at any time.
    """

    poses: Mapping[str, Array]
    dwell: float = parameter(0.5, 'Rest at each view of a scan, seconds.', 0.0)
    pictures: int = parameter(
        4, 'Pictures that the marker detector must have looked at before a view is left.', 0
    )
    patience: float = parameter(1.5, 'Seconds after which a view is left without them.', 0.0)
    horizontal: float = converted(
        math.radians,
        60.0,
        "The camera's horizontal field of view, degrees.",
        minimum=5.0,
        maximum=150.0,
        name='horizontal_field_of_view',
        read_only=True,
    )
    vertical: float = converted(
        math.radians,
        46.8,
        "The camera's vertical field of view, degrees.",
        minimum=5.0,
        maximum=150.0,
        name='vertical_field_of_view',
        read_only=True,
    )


def arm_settings(node: PatrolNode, arm: Arm) -> ArmSettings:
    """Declare the parameters.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    poses = {name: _pose(node, arm, name, pan) for name, pan in _PAN.items()}
    return node.declare_live(ArmSettings(poses))


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
