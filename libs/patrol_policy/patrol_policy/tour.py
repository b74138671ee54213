"""Shortest closed tours through all places of a map, and how short a tour can be at best.

A single robot cannot do better than the shortest closed tour: whatever it does, some place's
two successive visits enclose a visit to every other place, so that place waits at least one tour
(Chevaleyre 2004, "Theoretical analysis of the multi-agent patrolling problem"). The length of
the tour is therefore the bound that every patrol is measured by.

All functions take a matrix of distances, shape (n, n), that obeys the triangle inequality
(shortest ways between all places do); it may be asymmetric. Large maps get a tour that is good for
the mean of both directions, in its shorter sense. All functions are deterministic.
"""

from __future__ import annotations

import heapq
import math
import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

EXACT_UP_TO = 12
"""The largest number of places for which the exact tour is computed, by dynamic programming."""
DENSE_UP_TO = 128
"""Up to so many places the shortest ways are computed without scipy, whose import takes longer."""
NEIGHBOURS = 12
"""How many nearest places each place is tried beside when a tour is improved."""
ASCENT_STEPS = 150
"""Steps of the subgradient ascent that raises the lower bound."""
DENSE_BLOCK_UP_TO = 1500
"""The largest block of a map, in places, for which all distances are kept."""
LOCAL_REACH = 120
"""Over how many places a way is searched when the tour of a larger block is improved."""
LARGE_STEPS = 60_000
"""How many places are looked at when the tour of a larger block is improved."""
KICKS = 600_000
"""How often a good tour is disturbed and improved again, times its places; at most `MOST_KICKS`."""
MOST_KICKS = 4000


@dataclass(frozen=True)
class Tour:
    """A closed tour and what is known of the best one.

    Attributes:
        order: Indices of all places, each once; from the last one it goes back to the first.
        length: Length of the tour, in the unit of the distances.
        find_bound: Finds a length that no closed tour falls below; None: the tour is exact.
    """

    order: tuple[int, ...]
    length: float
    find_bound: Callable[[], float] | None = None

    @cached_property
    def bound(self) -> float:
        """No closed tour is shorter than this; found when it is first asked for."""
        return self.length if self.find_bound is None else min(self.length, self.find_bound())

    @property
    def exact(self) -> bool:
        """Whether the tour is known to be the shortest."""
        return self.length <= self.bound * (1.0 + 1e-6) + 1e-9


def shortest_tour(distances: Matrix) -> Tour:
    """Return the exact tour of a small map, a good tour and a lower bound of a large one."""
    count = len(distances)
    if count <= EXACT_UP_TO:
        order = _exact_order(distances) if count > 2 else tuple(range(count))
        length = tour_length(distances, order)
        return Tour(order, length)
    order = _good_order((distances + distances.T) / 2.0)
    # The search knows the mean of both directions (2-opt turns parts round); only the result is
    # measured one way.
    order = min(order, order[::-1], key=lambda way: tour_length(distances, way))
    length = tour_length(distances, order)
    # The bound takes longer than the tour and is for benchmarks: found when it is asked for.
    return Tour(order, length, lambda: _one_tree_bound(np.minimum(distances, distances.T), length))


def tour_over_blocks(edges: Sequence[Mapping[int, float]], blocks: Iterable[Sequence[int]]) -> Tour:
    """Return the tour of a map from the tours of its biconnected blocks.

    A closed walk through the whole map passes from block to block only at the places they share,
    so it splits there into one closed walk for each block: the shortest tours add up. A shortest
    way between two places of a block does not leave it, so each block is looked at alone.

    Args:
        edges: For each place, the seconds to each neighbour.
        blocks: The biconnected components of the map, as indices.
    """
    rings: list[list[int]] = []
    at: dict[int, list[int]] = {}
    tours = []
    for members in blocks:
        tour = _tour_of_block(edges, members)
        tours.append(tour)
        for place in members:
            at.setdefault(place, []).append(len(rings))
        rings.append([members[position] for position in tour.order])
    order = tuple(_joined(rings, at))
    length = sum(tour.length for tour in tours)
    if all(tour.find_bound is None for tour in tours):
        return Tour(order, length)
    return Tour(order, length, lambda: sum(tour.bound for tour in tours))


def _tour_of_block(edges: Sequence[Mapping[int, float]], members: Sequence[int]) -> Tour:
    """Return the tour of one block; its order counts from 0."""
    if len(members) == 2:
        first, second = members
        return Tour((0, 1), edges[first][second] + edges[second][first])
    row_of = {place: row for row, place in enumerate(members)}
    inner = [
        {row_of[other]: seconds for other, seconds in edges[place].items() if other in row_of}
        for place in members
    ]
    if len(members) > DENSE_BLOCK_UP_TO:
        return _tour_of_large_block(inner)
    legs = np.full((len(members), len(members)), np.inf)
    for row, others in enumerate(inner):
        legs[row, list(others)] = list(others.values())
    np.fill_diagonal(legs, 0.0)
    if len(members) <= DENSE_UP_TO:
        # Floyd and Warshall: faster than a start of SciPy for so few.
        for middle in range(len(members)):
            np.minimum(legs, legs[:, middle, None] + legs[middle], out=legs)
        return shortest_tour(legs)
    from scipy.sparse.csgraph import csgraph_from_dense, dijkstra

    return shortest_tour(dijkstra(csgraph_from_dense(legs, null_value=np.inf)))


class _LocalDistances(dict[int, float]):
    """Distances from one place of a large block, each found when it is first asked for.

    A place that is not near is taken to be infinitely far: no change of a tour that would lead
    there is looked at, and memory grows with the places times their surroundings.
    """

    def __init__(self, rows: list[_LocalDistances], edges: list[dict[int, float]], place: int):
        self._rows, self._edges, self._place = rows, edges, place

    def __missing__(self, goal: int) -> float:
        return self.find(goal, LOCAL_REACH)

    def find(self, goal: int, reach: float) -> float:
        """Search a way over at most so many places, and keep what that found."""
        nearest = _nearest_first(self._edges, self._place, reach)
        seconds = next((found for place, found in nearest if place == goal), math.inf)
        self[goal] = self._rows[goal][self._place] = seconds
        return seconds


def _nearest_first(
    edges: Sequence[Mapping[int, float]], start: int, reach: float
) -> Iterator[tuple[int, float]]:
    """Yield places by rising distance from one, at most ``reach`` of them (Dijkstra)."""
    pending, done = [(0.0, start)], set[int]()
    while pending and len(done) < reach:
        seconds, place = heapq.heappop(pending)
        if place in done:
            continue
        done.add(place)
        yield place, seconds
        for other, leg in edges[place].items():
            if other not in done:
                heapq.heappush(pending, (seconds + leg, other))


def _tour_of_large_block(edges: list[dict[int, float]]) -> Tour:
    """Return a good tour of a block for which all distances would not fit into memory.

    It begins with the order in which a depth-first walk meets the places of the minimum spanning
    tree, at most twice as long as the shortest tour, and is improved as on smaller maps. The bound
    is the length of that tree.
    """
    import networkx

    count = len(edges)
    mean = [
        {other: (seconds + edges[other][place]) / 2.0 for other, seconds in others.items()}
        for place, others in enumerate(edges)
    ]
    network: networkx.Graph[int] = networkx.Graph()
    network.add_weighted_edges_from(
        (a, b, s) for a, others in enumerate(mean) for b, s in others.items()
    )
    tree = networkx.minimum_spanning_tree(network)
    order = list(networkx.dfs_preorder_nodes(tree, 0))
    rows: list[_LocalDistances] = []
    rows += (_LocalDistances(rows, mean, place) for place in range(count))
    near = []
    for place in range(count):
        found = list(_nearest_first(mean, place, NEIGHBOURS + 1))[1:]
        rows[place].update(found)
        near.append([other for other, _ in found])
    for place, after in zip(order, (*order[1:], order[0]), strict=True):
        if not math.isfinite(rows[place][after]):
            rows[place].find(after, math.inf)
    tour = _Improvement(rows, near, order)
    tour.improve(list(order), LARGE_STEPS)
    length = sum(
        rows[place][after]
        for place, after in zip(tour.order, (*tour.order[1:], tour.order[0]), strict=True)
    )
    least = tree.size(weight='weight')
    return Tour(tuple(tour.order), length, lambda: float(least))


def _joined(rings: list[list[int]], at: dict[int, list[int]]) -> Iterator[int]:
    """Yield all places in the order in which one walk through all rings first meets them."""
    used: set[int] = set()
    pending: list[Iterator[int]] = [iter([0])]
    while pending:
        place = next(pending[-1], None)
        if place is None:
            pending.pop()
            continue
        yield place
        for number in at.get(place, ()):
            if number not in used:
                used.add(number)
                start = rings[number].index(place)
                pending.append(iter(rings[number][start + 1 :] + rings[number][:start]))


def tour_length(distances: Matrix, order: tuple[int, ...]) -> float:
    """Return the length of the closed tour that visits the places in this order."""
    indices = np.asarray(order, dtype=np.intp)
    return float(distances[indices, np.roll(indices, -1)].sum())


def _exact_order(distances: Matrix) -> tuple[int, ...]:
    """Held and Karp's dynamic programme over sets of visited places."""
    count = len(distances)
    others = count - 1
    size = 1 << others
    cost = np.full((size, others), np.inf)
    came_from = np.zeros((size, others), dtype=np.intp)
    for last in range(others):
        cost[1 << last, last] = distances[others, last]
    # In the order of the numbers, each set comes after all of its subsets.
    for visited in range(1, size):
        for last in range(others):
            if not visited >> last & 1 or visited == 1 << last:
                continue
            before = cost[visited ^ (1 << last)] + distances[:others, last]
            best = int(np.argmin(before))
            cost[visited, last] = before[best]
            came_from[visited, last] = best
    last = int(np.argmin(cost[size - 1] + distances[:others, others]))
    order, visited = [others], size - 1
    while visited:
        order.append(last)
        visited, last = visited ^ (1 << last), int(came_from[visited, last])
    return tuple(reversed(order))


def _good_order(distances: Matrix) -> tuple[int, ...]:
    """Return a tour that begins with the nearest places, improved by iterated local search."""
    # The place itself, which is the nearest one, is left out.
    near = np.argpartition(distances, NEIGHBOURS, axis=1)[:, : NEIGHBOURS + 1]
    order = np.argsort(np.take_along_axis(distances, near, axis=1), axis=1, kind='stable')
    ranked = np.take_along_axis(near, order, axis=1)[:, 1:].tolist()
    tour = _Improvement(distances.tolist(), ranked, _nearest(distances))
    tour.improve(list(tour.order))
    tour.kick(min(MOST_KICKS, KICKS // len(distances)), random.Random(0))
    return tuple(tour.order)


def _nearest(distances: Matrix) -> list[int]:
    """Go on to the nearest place not visited yet."""
    order = [0]
    left = np.ones(len(distances), dtype=bool)
    left[0] = False
    while left.any():
        row = np.where(left, distances[order[-1]], np.inf)
        order.append(int(np.argmin(row)))
        left[order[-1]] = False
    return order


def _spanning_tree(distances: Matrix) -> list[int]:
    """Prim's algorithm; the parent of each place, -1 for the first."""
    count = len(distances)
    best = distances[0].copy()
    parents = np.zeros(count, dtype=np.intp)
    parents[0] = -1
    done = np.zeros(count, dtype=bool)
    done[0] = True
    for _ in range(count - 1):
        place = int(np.argmin(np.where(done, np.inf, best)))
        done[place] = True
        closer = (distances[place] < best) & ~done
        best[closer] = distances[place][closer]
        parents[closer] = place
    return [int(parent) for parent in parents]


class _Improvement:
    """2-opt with neighbour lists: takes changes until none shortens the tour.

    Places whose surroundings did not change since they were last looked at are skipped
    (Bentley's don't-look bits), which makes it near linear in the number of places.
    """

    def __init__(
        self,
        rows: Sequence[Sequence[float] | Mapping[int, float]],
        near: list[list[int]],
        order: list[int],
    ) -> None:
        self._rows = rows
        self._near = near
        self.order = order
        self._at = [0] * len(order)
        self._note(0, len(order))

    def _note(self, first: int, end: int) -> None:
        for position in range(first, end):
            self._at[self.order[position]] = position

    def improve(self, waiting: list[int], steps: float = math.inf) -> float:
        """Improve around the given places, looking at so many at most; return what that saved."""
        listed = set(waiting)
        saved = 0.0
        while waiting and steps > 0:
            steps -= 1
            place = waiting.pop()
            listed.discard(place)
            gain, touched = self._two_opt(place)
            saved += gain
            for other in touched:
                if other not in listed:
                    listed.add(other)
                    waiting.append(other)
        return saved

    def kick(self, times: int, generator: random.Random) -> None:
        """Exchange two short neighbouring stretches at random, improve, keep what is shorter."""
        count, rows = len(self.order), self._rows
        reach = min(30, (count - 2) // 2)
        for _ in range(times):
            first = generator.randrange(count - 2)
            middle = min(count - 2, first + generator.randint(1, reach))
            last = min(count - 1, middle + generator.randint(1, reach))
            if not first < middle < last:
                continue
            order, at = self.order, self._at
            self.order, self._at = order.copy(), at.copy()
            ends = [order[first], order[first + 1], order[middle]]
            ends += [order[middle + 1], order[last], order[(last + 1) % count]]
            a, b, c, d, e, f = ends
            lost = rows[a][d] + rows[e][b] + rows[c][f] - rows[a][b] - rows[c][d] - rows[e][f]
            turned = order[middle + 1 : last + 1] + order[first + 1 : middle + 1]
            self.order[first + 1 : last + 1] = turned
            self._note(first + 1, last + 1)
            if self.improve(ends) < lost:
                self.order, self._at = order, at

    def _two_opt(self, place: int) -> tuple[float, tuple[int, ...]]:
        """Exchange two edges, one of them at ``place``; return the gain and the changed edges'
        ends.
        """
        order, rows, count = self.order, self._rows, len(self.order)
        for step in (1, -1):
            position = self._at[place]
            follower = order[(position + step) % count]
            edge = rows[place][follower]
            for near in self._near[place]:
                gain = edge - rows[place][near]
                if gain <= 1e-9:
                    break
                beyond = order[(self._at[near] + step) % count]
                gain += rows[near][beyond] - rows[follower][beyond]
                if gain > 1e-9 and near != follower:
                    if step == 1:
                        self._reverse(position + 1, self._at[near])
                    else:
                        self._reverse(self._at[near], position - 1)
                    return gain, (place, follower, near, beyond)
        return 0.0, ()

    def _reverse(self, first: int, last: int) -> None:
        """Turn round the stretch from ``first`` to ``last``, or what is outside of it."""
        order, count = self.order, len(self.order)
        first, last = first % count, last % count
        if first <= last and 2 * (last - first + 1) <= count + 2:
            order[first : last + 1] = order[first : last + 1][::-1]
            self._note(first, last + 1)
            return
        length = (last - first) % count + 1
        if 2 * length > count:
            first, last, length = last + 1, first - 1, count - length
        for offset in range(length // 2):
            low, high = (first + offset) % count, (last - offset) % count
            order[low], order[high] = order[high], order[low]
            self._at[order[low]], self._at[order[high]] = low, high


def _one_tree_bound(distances: Matrix, upper: float) -> float:
    """Held and Karp's lower bound: the dearest minimum 1-tree under node prices.

    Args:
        distances: Shape (n, n).
        upper: Length of a known tour, which scales the steps.
    """
    count = len(distances)
    prices = np.zeros(count)
    best, pace, stale = 0.0, 2.0, 0
    for _ in range(ASCENT_STEPS):
        priced = distances + prices[:, None] + prices[None, :]
        value, degrees = _one_tree(priced)
        value -= 2.0 * float(prices.sum())
        if value > best + 1e-9:
            best, stale = value, 0
        else:
            stale += 1
            if stale >= 5:
                pace, stale = pace / 2.0, 0
        slope = degrees - 2.0
        steepness = float(slope @ slope)
        if steepness == 0.0 or best >= upper * (1.0 - 1e-7):
            break
        prices += pace * max(upper - value, 1e-9) / steepness * slope
    return best


def _one_tree(priced: Matrix) -> tuple[float, NDArray[np.float64]]:
    """Cost and degrees of a minimum spanning tree of all but the last place, plus that one's
    two cheapest edges."""
    inner = priced[:-1, :-1]
    parents = np.asarray(_spanning_tree(inner))
    children = np.arange(1, len(inner))
    cost = float(inner[children, parents[1:]].sum())
    degrees = np.bincount(parents[1:], minlength=len(priced)).astype(float)
    degrees[children] += 1.0
    two = np.argpartition(priced[-1, :-1], 1)[:2]
    degrees[two] += 1.0
    degrees[-1] = 2.0
    return cost + float(priced[-1, two].sum()), degrees
