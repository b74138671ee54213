"""How a request that waits for the operator is shown."""

from __future__ import annotations

from collections.abc import Iterable

from surveillance_controllers.geometry import polyline
from surveillance_controllers.geometry.polyline import Points

MOST_POINTS = 12
"""Of a longer path only the first and last points are shown."""


def point(coordinates: Iterable[float]) -> str:
    """A point in metres: `(10, 5, 0)`."""
    return '(' + ', '.join(f'{c:.4g}' for c in coordinates) + ')'


def path_request(what: str, start: Points, goal: Points) -> str:
    """The text for a path that the operator shall give."""
    return (
        f'New request: {what}\n'
        f'  start {point(start)}, goal {point(goal)}, '
        f'{polyline.length([start, goal]):.2f} m apart\n'
        '  Answer with: plan set [[x,y,z],...]   (the points between start and goal)'
    )


def move_request(what: str, path: Points) -> str:
    """The text for a motion that the operator shall carry out."""
    shown = [point(p) for p in path]
    if len(shown) > MOST_POINTS:
        half = MOST_POINTS // 2
        shown = [*shown[:half], f'... {len(path) - 2 * half} more ...', *shown[-half:]]
    return (
        f'New request: {what}\n'
        f'  start {point(path[0])}, goal {point(path[-1])}, '
        f'{polyline.length(path):.2f} m along {len(path)} point{"s" * (len(path) > 1)}\n'
        f'  path {" ".join(shown)}\n'
        '  Answer with: move TIME DELTA   (seconds, metres)'
    )
