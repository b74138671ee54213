"""Reads maps in the format of ``patrolling_sim``.

Numbers separated by white space: the number of vertices; width and height of the map in pixels;
its resolution in metres per pixel; the x and y of its origin in metres (older files have none);
and then for each vertex its id, x and y in pixels, its number of neighbours, and for each
neighbour the neighbour's id, the direction (N, NE, E, ...) and the cost of the edge in pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from patrol_policy.graph import GraphError, PatrolGraph


def read_patrolling_sim(
    path: str | Path, speed: float = 1.0, exploration_seconds: float = 0.0
) -> PatrolGraph:
    """Read a graph file.

    Args:
        path: The file.
        speed: Metres per second.
        exploration_seconds: Seconds spent in each place.

    Raises:
        GraphError: The file cannot be read or is not of the format; one line that names it and what
            was expected.
    """
    try:
        words = Path(path).read_text(encoding='utf-8').split()
    except (OSError, UnicodeDecodeError) as error:
        raise GraphError(f'{path}: cannot be read: {error}') from None
    try:
        legs = _legs(_Words(path, words), speed, origin=True)
    except GraphError as error:
        try:
            legs = _legs(_Words(path, words), speed, origin=False)
        except GraphError:
            raise error from None
    try:
        return PatrolGraph(legs, exploration_seconds)
    except GraphError as error:
        raise GraphError(f'{path}: {error}') from None


def _legs(numbers: _Words, speed: float, *, origin: bool) -> dict[str, dict[str, float]]:
    count = numbers.whole('the number of vertices', least=1)
    numbers.number('the width')
    numbers.number('the height')
    resolution = numbers.number('the resolution')
    if not resolution > 0.0:
        raise numbers.error(f'the resolution is {resolution:g}, expected more than 0')
    if origin:
        numbers.number("the origin's x")
        numbers.number("the origin's y")
    legs: dict[str, dict[str, float]] = {}
    for _ in range(count):
        place = str(numbers.whole('the id of a vertex'))
        if place in legs:
            raise numbers.error(f'vertex {place} stands twice')
        numbers.number(f'the x of vertex {place}')
        numbers.number(f'the y of vertex {place}')
        legs[place] = {}
        for _ in range(numbers.whole(f'the number of neighbours of vertex {place}')):
            other = str(numbers.whole(f'a neighbour of vertex {place}'))
            numbers.word(f'the direction from vertex {place} to {other}')
            cost = numbers.number(f'the cost from vertex {place} to {other}')
            legs[place][other] = cost * resolution / speed
    if left := list(numbers):
        raise numbers.error(f'{len(left)} words after the last vertex, expected none')
    return legs


class _Words:
    """The words of a file, taken one by one with what they should be."""

    def __init__(self, path: str | Path, words: list[str]) -> None:
        self._path = path
        self._words = iter(words)

    def __iter__(self) -> Iterator[str]:
        return self._words

    def error(self, problem: str) -> GraphError:
        return GraphError(f'{self._path}: {problem}')

    def word(self, what: str) -> str:
        word = next(self._words, None)
        if word is None:
            raise self.error(f'ends before {what}')
        return word

    def number(self, what: str) -> float:
        word = self.word(what)
        try:
            return float(word)
        except ValueError:
            raise self.error(f'expected {what}, a number, got {word[:40]!r}') from None

    def whole(self, what: str, least: int = 0) -> int:
        number = self.number(what)
        if number != int(number) or number < least:
            raise GraphError(
                f'{self._path}: expected {what}, a whole number of at least {least}, got {number:g}'
            )
        return int(number)
