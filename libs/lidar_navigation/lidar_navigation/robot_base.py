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
    """Ask for the corners of the robot, if for anything: a polygon around its centre, which need
    not be convex.
    """
    if not values:
        return None
    expected = (
        'the corners x, y of a polygon around the centre of the robot, in order, at least 3, '
        'within 20 m, whose sides do not cross'
    )
    if len(values) % 2 or len(values) < 6 or not max(map(abs, values)) <= 20.0:
        return expected
    corners = list(zip(values[::2], values[1::2], strict=True))
    sides = list(zip(corners, [*corners[1:], corners[0]], strict=True))
    count = len(sides)
    if len(set(corners)) < count:
        return expected
    for i, one in enumerate(sides):
        beside = (i, (i + 1) % count, (i - 1) % count)
        if any(_cross(*one, *sides[k]) for k in range(count) if k not in beside):
            return expected
    # A ray from the centre along x crosses its edge an odd number of times.
    crossed = 0
    for (x1, y1), (x2, y2) in sides:
        if (y1 > 0.0) != (y2 > 0.0):
            crossed += x1 - y1 * (x2 - x1) / (y2 - y1) > 1e-9
    return None if crossed % 2 else expected


def _cross(
    a: tuple[float, float],
    b: tuple[float, float],
    c: tuple[float, float],
    d: tuple[float, float],
) -> bool:
    """Tell whether two sides have a point in common."""

    def bend(p: tuple[float, float], q: tuple[float, float], r: tuple[float, float]) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return (
        bend(a, b, c) * bend(a, b, d) <= 0.0
        and bend(c, d, a) * bend(c, d, b) <= 0.0
        and max(min(a[0], b[0]), min(c[0], d[0])) <= min(max(a[0], b[0]), max(c[0], d[0]))
        and max(min(a[1], b[1]), min(c[1], d[1])) <= min(max(a[1], b[1]), max(c[1], d[1]))
    )


def robot_footprint() -> tuple[float, ...]:
    """Return the field of a record that is the parameter `robot.footprint`."""
    return parameter(
        (),
        'Corners x, y of a robot that is not round, m; empty: round, of robot_radius.',
        name='robot.footprint',
        of=float,
        check=footprint,
    )
