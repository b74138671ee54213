"""The robot as URDF: its base, its lidar, and the arm with the camera."""

from __future__ import annotations

import math

from surveillance_runtime.robot_arm import ARM, Arm

RADIUS, HEIGHT = 0.2, 0.25
"""Of the base, metres."""


def urdf(arm: Arm = ARM) -> str:
    """Return the robot's description; the arm's joints are those of joint_states."""
    parts = [
        _link('base_link', f'<cylinder radius="{RADIUS}" length="{HEIGHT}"/>', HEIGHT / 2),
        _link('base_scan', '<cylinder radius="0.05" length="0.05"/>', 0.0),
        _fixed('lidar', 'base_link', 'base_scan', (0.0, 0.0, HEIGHT)),
    ]
    parent = 'base_link'
    offsets = [*(joint.offset for joint in arm.joints[1:]), arm.camera_offset]
    for joint, after in zip(arm.joints, offsets, strict=True):
        link = f'{joint.name}_link'
        length = max(0.02, math.hypot(*after))
        parts.append(_link(link, f'<cylinder radius="0.025" length="{length:.3f}"/>', length / 2))
        parts.append(
            f'<joint name="{joint.name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{link}"/><origin xyz="{_xyz(joint.offset)}"/>'
            f'<axis xyz="{_xyz(joint.axis)}"/><limit lower="{joint.lower:.4f}" '
            f'upper="{joint.upper:.4f}" velocity="{joint.speed:.3f}" effort="10"/></joint>'
        )
        parent = link
    parts.append(_link('camera_link', '<box size="0.03 0.06 0.04"/>', 0.0))
    parts.append(_fixed('camera', parent, 'camera_link', arm.camera_offset))
    return f'<?xml version="1.0"?><robot name="surveillance">{"".join(parts)}</robot>'


def _link(name: str, shape: str, z: float) -> str:
    return (
        f'<link name="{name}"><visual><origin xyz="0 0 {z:.3f}"/>'
        f'<geometry>{shape}</geometry></visual></link>'
    )


def _fixed(name: str, parent: str, child: str, offset: tuple[float, float, float]) -> str:
    return (
        f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_xyz(offset)}"/></joint>'
    )


def _xyz(values: tuple[float, float, float]) -> str:
    return ' '.join(f'{value:g}' for value in values)
