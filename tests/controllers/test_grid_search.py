"""The search in two steps beside the library's over every cell."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.graph import MCP_Geometric

from surveillance_controllers.planning import grid_search
from surveillance_controllers.planning.grid_search import GridSearch


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
    way = GridSearch(cost).way(start, goal)
    assert tuple(way[0]) == start
    assert tuple(way[-1]) == goal
    assert price(cost, way) <= cheapest * 1.03


def test_a_gap_that_only_the_blocks_have_is_not_gone_through() -> None:
    cost = np.ones((120, 120), np.float32)
    cost[60] = -1  # One cell thick: every block of it has free cells.
    cost[60, 110:] = 1
    way = GridSearch(cost).way((10, 10), (110, 10))
    assert price(cost, way) == pytest.approx(reference(cost, (10, 10), (110, 10)))


def test_where_there_is_no_way_it_says_so() -> None:
    cost = np.ones((120, 120), np.float32)
    cost[60] = -1
    with pytest.raises(ValueError, match=r'.'):
        GridSearch(cost).way((10, 10), (110, 10))


def test_a_way_does_not_leave_the_map_on_one_side_and_enter_it_on_the_other() -> None:
    cost = np.ones((120, 120), np.float32)
    cost[:, 40:80] = -1
    with pytest.raises(ValueError, match=r'.'):
        GridSearch(cost).way((10, 10), (10, 110))


def test_costs_that_changed_are_searched_once_it_is_told() -> None:
    cost = np.ones((200, 200), np.float32)
    search = GridSearch(cost)
    straight = search.way((100, 5), (100, 195))
    cost[90:111, 80:121] = -1
    search.changed(90, 111, 80, 121)
    around = search.way((100, 5), (100, 195))
    assert (straight[:, 0] == 100).all()
    assert price(cost, around) == pytest.approx(reference(cost, (100, 5), (100, 195)), rel=0.01)
