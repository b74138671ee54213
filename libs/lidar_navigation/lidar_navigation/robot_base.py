"""What the robot's base can do: the simulator obeys it, and who commands the base counts on it."""

from __future__ import annotations

from collections.abc import Sequence

from floor_plans import ROBOT_RADIUS
from strict_files.settings import parameter

ROBOT_DECELERATION = 2.5
"""With which the base brakes when it must, m/s^2: the default of `robot_deceleration`.

It is what Nav2's configurations give for a TurtleBot3. Ordinary drives brake gently, within their
own limits of acceleration and jerk.
"""


def robot_radius() -> float:
    """Return the field of a record that is the parameter `robot_radius`."""
    return parameter(ROBOT_RADIUS, 'Radius of the robot, m.', 0.01, 20.0, name='robot_radius')


def robot_deceleration() -> float:
    """Return the field of a record that is the parameter `robot_deceleration`."""
    text = 'With which the base brakes when it must, m/s^2.'
    return parameter(ROBOT_DECELERATION, text, 0.05, 20.0, name='robot_deceleration')


def footprint(values: Sequence[float]) -> str | None:
    """Ask for the corners of the robot, if for anything: a convex polygon around its centre."""
    if not values:
        return None
    corners = list(zip(values[::2], values[1::2], strict=False))
    expected = (
        'the corners x, y of a convex polygon around the centre of the robot, in order, '
        'at least 3, within 20 m'
    )
    if len(values) % 2 or len(corners) < 3 or max(map(abs, values)) > 20.0:
        return expected
    sides = list(zip(corners, [*corners[1:], corners[0]], strict=True))
    # Around the centre each side turns the same way.
    turns = [x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in sides]
    following = [*sides[1:], sides[0]]
    bends = [
        (b[0] - a[0]) * (d[1] - c[1]) - (b[1] - a[1]) * (d[0] - c[0])
        for (a, b), (c, d) in zip(sides, following, strict=True)
    ]
    around = all(turn > 1e-9 for turn in turns) or all(turn < -1e-9 for turn in turns)
    convex = all(bend >= -1e-9 for bend in bends) or all(bend <= 1e-9 for bend in bends)
    return None if around and convex else expected


def robot_footprint() -> tuple[float, ...]:
    """Return the field of a record that is the parameter `robot.footprint`."""
    return parameter(
        (),
        'Corners x, y of a robot that is not round, m; empty: round, of robot_radius.',
        name='robot.footprint',
        of=float,
        check=footprint,
    )
