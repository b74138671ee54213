"""What a node is told of the robot by its parameters; the profile gives them their values."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from strict_files.settings import parameter
from surveillance_runtime import parameter_checks
from surveillance_runtime.profile.record import (
    COMMAND_TYPES,
    Frames,
    Lidars,
    Topics,
    topic_names,
)

if TYPE_CHECKING:
    from surveillance_runtime.node import PatrolNode


def declared_frames(node: PatrolNode, *names: str) -> Frames:
    """Declare and return the frames that a node names, `robot.frames.NAME`."""
    without = {each.name for each in fields(Frames)} - set(names)
    return node.declare_fields(Frames(), prefix='robot.frames.', without=without)


@dataclass(frozen=True)
class LidarSettings:
    """Which lidars the robot has, and where."""

    scans: tuple[str, ...] = parameter(
        Topics.scans,
        "The topics of the robot's lidars, sensor_msgs/LaserScan.",
        name='robot.scans',
        check=topic_names,
    )
    mounts: tuple[float, ...] = parameter(
        Lidars.mounts,
        'Where each lidar sits on the robot: x, y in metres, yaw and roll in radians (roll 3.1416: '
        "upside down); empty: as tf_static says of a scan's frame.",
        name='lidar_mounts',
        of=float,
        check=parameter_checks.lidar_mounts,
    )
    sweep: float = parameter(
        Lidars.sweep,
        'Time of one turn of a lidar whose scans do not say it, s; 0: all rays at once.',
        0.0,
        2.0,
        name='robot.sweep',
    )

    def __post_init__(self) -> None:
        if self.mounts and len(self.mounts) != 4 * len(self.scans):
            raise ValueError(
                f'lidar_mounts: {len(self.mounts)} numbers for {len(self.scans)} lidars: '
                'expected four for each: x, y, yaw, roll'
            )


@dataclass(frozen=True)
class CommandSettings:
    """What the commands are published as."""

    command_type: str = parameter(
        'Twist',
        'Type of the velocity that is published: Twist, or TwistStamped.',
        choices=COMMAND_TYPES,
        name='robot.command_type',
    )
