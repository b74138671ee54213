"""The search in two steps beside the library's over every cell."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.graph import MCP_Geometric

from lidar_navigation.planning import grid_search
from lidar_navigation.planning.grid_search import GridSearch


@pytest.fixture(autouse=True)
def _small_grids_are_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grid_search, 'SMALL', 1000)
    monkeypatch.setattr(grid_search, 'COARSE_SIDE', 40)


def price(cost: np.ndarray, cells: np.ndarray) -> float:
    """Return what a way costs, by the definition."""
    steps = np.diff(cells, axis=0)
    assert np.abs(steps).max() == 1, 'from neighbour to neighbour'
    at = cost[cells[:, 0], cells[:, 1]]
    assert (at > 0).all()
    return float((np.hypot(*steps.T) * (at[1:] + at[:-1]) / 2).sum())


def reference(cost: np.ndarray, start: tuple[int, int], goal: tuple[int, int]) -> float:
    search = MCP_Geometric(cost)
    search.find_costs([start], [goal])
    return price(cost, np.asarray(search.traceback(goal)))


def cluttered(seed: int, side: int = 203) -> np.ndarray:
    """Cells of different cost, with discs in the way as an inflated map has them."""
    rng = np.random.default_rng(seed)
    rows, columns = np.indices((side, side - 40))
    cost = np.ones(rows.shape, np.float32)
    for row, column, radius in rng.uniform((0, 0, 4), (side, side - 40, 14), (40, 3)):
        away = np.hypot(rows - row, columns - column) - radius
        cost = np.maximum(cost, np.where(away < 10, 1 + 3 * (1 - away / 10) ** 2, 1))
        cost[away < 0] = np.inf
    cost[~np.isfinite(cost)] = -1
    cost[:3, :3] = cost[-3:, -3:] = 1
    return cost.astype(np.float32)


@pytest.mark.parametrize('seed', range(8))
def test_the_way_costs_what_the_cheapest_does(seed: int) -> None:
    cost = cluttered(seed)
    start, goal = (1, 1), (cost.shape[0] - 2, cost.shape[1] - 2)
    try:
        cheapest = reference(cost, start, goal)
    except ValueError:
        pytest.skip('the discs leave no way')
    way = GridSearch(cost).path(start, goal)
    assert tuple(way[0]) == start
    assert tuple(way[-1]) == goal
    assert price(cost, way) <= cheapest * 1.03


def test_a_gap_that_only_the_blocks_have_is_not_gone_through() -> None:
    cost = np.ones((120, 120), np.float32)
    cost[60] = -1  # One cell thick: every block of it has free cells.
    cost[60, 110:] = 1
    way = GridSearch(cost).path((10, 10), (110, 10))
    assert price(cost, way) == pytest.approx(reference(cost, (10, 10), (110, 10)))


def test_where_there_is_no_way_it_says_so() -> None:
    cost = np.ones((120, 120), np.float32)
    cost[60] = -1
    with pytest.raises(ValueError, match=r'.'):
        GridSearch(cost).path((10, 10), (110, 10))


def test_a_way_does_not_leave_the_map_on_one_side_and_enter_it_on_the_other() -> None:
    cost = np.ones((120, 120), np.float32)
    cost[:, 40:80] = -1
    with pytest.raises(ValueError, match=r'.'):
        GridSearch(cost).path((10, 10), (10, 110))


def test_costs_that_changed_are_searched_once_it_is_told() -> None:
    cost = np.ones((200, 200), np.float32)
    search = GridSearch(cost)
    straight = search.path((100, 5), (100, 195))
    cost[90:111, 80:121] = -1
    search.changed(90, 111, 80, 121)
    around = search.path((100, 5), (100, 195))
    assert (straight[:, 0] == 100).all()
    assert price(cost, around) == pytest.approx(reference(cost, (100, 5), (100, 195)), rel=0.01)


@pytest.mark.parametrize('shape', [(12, 9), (10, 10), (7, 4)])
@pytest.mark.parametrize('size', [2, 3])
def test_blocks_are_summed_also_where_the_last_ones_lack_cells(
    shape: tuple[int, int], size: int
) -> None:
    field = np.random.default_rng(1).uniform(0, 9, shape).astype(np.float32)
    found = grid_search._blocks(field, size)
    rows, columns = (-(-side // size) for side in shape)
    assert found.shape == (rows, columns)
    for row, column in np.ndindex(rows, columns):
        part = field[row * size : (row + 1) * size, column * size : (column + 1) * size]
        assert found[row, column] == pytest.approx(part.sum(), rel=1e-5)


def test_the_coarse_grid_is_the_mean_of_what_is_free_wherever_it_changed() -> None:
    cost = cluttered(2)
    search = GridSearch(cost)
    size = search._block
    assert size == 5  # 203 by 163 cells are as many as 182 by 182, and 40 blocks are wanted.
    draw = np.random.default_rng(5)
    for top, left in ((0, 0), (17, 33), (150, 101)):
        cost[top : top + 23, left : left + 31] = draw.uniform(-2, 5, (23, 31)).astype(np.float32)
        search.changed(top, top + 23, left, left + 31)
        for row, column in np.ndindex(search._coarse.shape):
            part = cost[row * size : (row + 1) * size, column * size : (column + 1) * size]
            free = part[part > 0]
            expected = free.mean() if len(free) else -1.0
            assert search._coarse[row, column] == pytest.approx(expected, rel=1e-4)


def test_steps_lead_to_the_eight_neighbours_and_not_over_the_edge_of_a_row() -> None:
    columns, cost = 5, np.random.default_rng(3).uniform(1, 4, (6, 5))
    cost[2, 1] = cost[4, 4] = -1
    flat = np.flatnonzero(cost.ravel() > 0)
    graph = grid_search._graph(flat, cost.ravel()[flat], columns).toarray()
    graph = graph + graph.T
    for i, first in enumerate(flat.tolist()):
        for j, second in enumerate(flat.tolist()):
            down = abs(first // columns - second // columns)
            right = abs(first % columns - second % columns)
            if max(down, right) == 1:
                mean = (cost.ravel()[first] + cost.ravel()[second]) / 2
                assert graph[i, j] == pytest.approx(np.hypot(down, right) * mean)
            else:
                assert graph[i, j] == 0.0
