"""The robot's description as a URDF, and its frames that do not move, both from its profile.

The frames are those of REP-105: below the profile's base frame, which the odometry moves, lie the
other one of `base_link` and `base_footprint`, the lidars, and the camera. An arm moves the camera:
its joint floats, and whoever knows the arm tells where it is on `tf`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree

from surveillance_runtime.profile.record import RobotProfile

BASES = ('base_footprint', 'base_link')


@dataclass(frozen=True)
class FixedFrame:
    """A frame that does not move against its parent.

    Attributes:
        parent: The frame that it is on.
        name: Its own name.
        xyz: Where it is, metres.
        rpy: How it is turned: roll, pitch, yaw, radians.
    """

    parent: str
    name: str
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


def fixed_frames(profile: RobotProfile) -> tuple[FixedFrame, ...]:
    """Return the frames of a robot that do not move, each with one parent.

    Lidars whose mounts the profile does not give are left out: the robot's own description has
    them.
    """
    base = profile.frames.base
    frames = [FixedFrame(base, name) for name in BASES if name != base]
    mounts, names = profile.lidars.mounts, profile.frames.scans
    for index in range(len(mounts) // 4):
        x, y, yaw, roll = mounts[4 * index : 4 * index + 4]
        name = names[index] if index < len(names) else f'{profile.topics.scans[index]}_frame'
        frames.append(FixedFrame(base, name, (x, y, profile.lidars.height), (roll, 0.0, yaw)))
    return tuple(frames)


def description(profile: RobotProfile) -> str:
    """Return the URDF of a robot: body, wheels, lidars and camera as simple shapes."""
    base, body, wheels = profile.frames.base, profile.body, profile.wheels
    robot = ElementTree.Element('robot', name=profile.name)
    _add_link(robot, base, _body_shape(profile), (*_middle(profile), body.height / 2))
    for frame in fixed_frames(profile):
        _add_link(robot, frame.name)
        _add_joint(robot, 'fixed', frame)
    for side, name in ((1.0, 'left_wheel'), (-1.0, 'right_wheel')):
        place = FixedFrame(
            base,
            name,
            (0.0, side * wheels.separation / 2, wheels.radius),
            (-math.pi / 2, 0.0, 0.0),
        )
        round_shape = {'cylinder': {'radius': f'{wheels.radius:g}', 'length': '0.02'}}
        _add_link(robot, name, round_shape)
        joint = _add_joint(robot, 'continuous', place)
        ElementTree.SubElement(joint, 'axis', xyz='0 0 1')
    _add_link(robot, profile.frames.camera)
    _add_joint(robot, 'floating', FixedFrame(base, profile.frames.camera))
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding='unicode') + '\n'


def _corners(profile: RobotProfile) -> Iterator[tuple[float, float]]:
    values = profile.body.footprint
    yield from zip(values[::2], values[1::2], strict=True)


def _middle(profile: RobotProfile) -> tuple[float, float]:
    corners = list(_corners(profile))
    if not corners:
        return 0.0, 0.0
    x, y = zip(*corners, strict=True)
    return (min(x) + max(x)) / 2, (min(y) + max(y)) / 2


def _body_shape(profile: RobotProfile) -> dict[str, dict[str, str]]:
    """Return the body as a cylinder, or the box around its footprint: URDF knows no prism."""
    body, corners = profile.body, list(_corners(profile))
    if not corners:
        return {'cylinder': {'radius': f'{body.radius:g}', 'length': f'{body.height:g}'}}
    x, y = zip(*corners, strict=True)
    size = f'{max(x) - min(x):g} {max(y) - min(y):g} {body.height:g}'
    return {'box': {'size': size}}


def _add_link(
    robot: ElementTree.Element,
    name: str,
    shape: dict[str, dict[str, str]] | None = None,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    link = ElementTree.SubElement(robot, 'link', name=name)
    for kind in ('visual', 'collision') if shape else ():
        part = ElementTree.SubElement(link, kind)
        ElementTree.SubElement(part, 'origin', xyz=_numbers(at), rpy='0 0 0')
        geometry = ElementTree.SubElement(part, 'geometry')
        for form, sizes in (shape or {}).items():
            ElementTree.SubElement(geometry, form, sizes)


def _add_joint(robot: ElementTree.Element, kind: str, frame: FixedFrame) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, 'joint', name=f'{frame.name}_joint', type=kind)
    ElementTree.SubElement(joint, 'parent', link=frame.parent)
    ElementTree.SubElement(joint, 'child', link=frame.name)
    ElementTree.SubElement(joint, 'origin', xyz=_numbers(frame.xyz), rpy=_numbers(frame.rpy))
    return joint


def _numbers(values: tuple[float, ...]) -> str:
    return ' '.join(f'{each:g}' for each in values)
