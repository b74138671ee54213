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

from lidar_navigation import Footprint
from surveillance_runtime.profile.record import RobotProfile

Shape = tuple[dict[str, dict[str, str]], tuple[float, float, float]]
"""A form with its sizes, and where its middle is, metres."""
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
    base, wheels = profile.frames.base, profile.wheels
    robot = ElementTree.Element('robot', name=profile.name)
    _add_link(robot, base, *_body_shapes(profile))
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
        _add_link(robot, name, (round_shape, (0.0, 0.0, 0.0)))
        joint = _add_joint(robot, 'continuous', place)
        ElementTree.SubElement(joint, 'axis', xyz='0 0 1')
    _add_link(robot, profile.frames.camera)
    _add_joint(robot, 'floating', FixedFrame(base, profile.frames.camera))
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding='unicode') + '\n'


def _body_shapes(profile: RobotProfile) -> Iterator[Shape]:
    """Yield the body: a cylinder, or the boxes around its convex parts: URDF knows no prism."""
    body = profile.body
    if not body.footprint:
        round_shape = {'radius': f'{body.radius:g}', 'length': f'{body.height:g}'}
        yield {'cylinder': round_shape}, (0.0, 0.0, body.height / 2)
    else:
        for part in Footprint(body.radius, body.footprint).convex_parts:
            low, high = part.min(axis=0).tolist(), part.max(axis=0).tolist()
            size = f'{high[0] - low[0]:g} {high[1] - low[1]:g} {body.height:g}'
            x, y = (low[0] + high[0]) / 2, (low[1] + high[1]) / 2
            yield {'box': {'size': size}}, (x, y, body.height / 2)


def _add_link(robot: ElementTree.Element, name: str, *shapes: Shape) -> None:
    link = ElementTree.SubElement(robot, 'link', name=name)
    for shape, at in shapes:
        for kind in ('visual', 'collision'):
            part = ElementTree.SubElement(link, kind)
            ElementTree.SubElement(part, 'origin', xyz=_numbers(at), rpy='0 0 0')
            geometry = ElementTree.SubElement(part, 'geometry')
            for form, sizes in shape.items():
                ElementTree.SubElement(geometry, form, sizes)


def _add_joint(robot: ElementTree.Element, kind: str, frame: FixedFrame) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, 'joint', name=f'{frame.name}_joint', type=kind)
    ElementTree.SubElement(joint, 'parent', link=frame.parent)
    ElementTree.SubElement(joint, 'child', link=frame.name)
    ElementTree.SubElement(joint, 'origin', xyz=_numbers(frame.xyz), rpy=_numbers(frame.rpy))
    return joint


def _numbers(values: tuple[float, ...]) -> str:
    return ' '.join(f'{each:g}' for each in values)
