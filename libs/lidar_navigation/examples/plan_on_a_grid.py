"""Plan paths on a grid map: two rooms, a door that closes, an obstacle that appears. No ROS.

python libs/lidar_navigation/examples/plan_on_a_grid.py
"""

from __future__ import annotations

import itertools

import numpy as np

from floor_plans import Grid
from floor_plans.occupancy_grid import OCCUPIED
from lidar_navigation import GridPlanner, NoPathError
from lidar_navigation.geometry import Points, length

PLAN = """
############################################################
#                            #                             #
#                            #                             #
#                            #                             #
#                            #                             #
#                                                          #
#                                                          #
#                                                          #
#                                                          #
#                                                          #
#                            #                             #
#                            #                             #
#                            #                             #
#                            #                             #
############################################################
"""
RESOLUTION = 0.2  # metres a cell
START, GOAL = (1.0, 2.2), (11.0, 0.6)
DOOR = {'D1': (5.9, 0.9, 5.9, 2.1)}  # the segment that a closed door fills: x, y, x, y


def grid_of(text: str) -> Grid:
    """Return the map of a drawing: # is a wall; the first line lies in the north."""
    rows = text.strip().splitlines()[::-1]
    cells = [[OCCUPIED if sign == '#' else 0 for sign in row] for row in rows]
    return Grid(np.array(cells, dtype=np.int8), RESOLUTION, (0.0, 0.0))


def show(grid: Grid, path: Points) -> None:
    """Print the map with the path as dots."""
    signs = np.where(grid.occupied, '#', ' ')
    fine = [np.linspace(first, last, 20) for first, last in itertools.pairwise(path)]
    for row, column in grid.cells_of(np.concatenate(fine)):
        signs[row, column] = '.'
    print('\n'.join(''.join(row) for row in signs[::-1]))


def main() -> None:
    """Plan three times."""
    grid = grid_of(PLAN)
    planner = GridPlanner(grid)
    path = planner.plan(START, GOAL)
    print(f'Open door: {length(path):.2f} m over {len(path)} points.')
    show(grid, path)
    planner.set_obstacles([(8.0, 1.4), (8.0, 1.2), (8.0, 1.0), (8.0, 0.8), (8.0, 0.6)])
    print(f'With an obstacle behind the door: {length(planner.plan(START, GOAL)):.2f} m.')
    planner.set_closed(DOOR)
    try:
        planner.plan(START, GOAL)
    except NoPathError as error:
        print(f'Closed door: {error}')


if __name__ == '__main__':
    main()
