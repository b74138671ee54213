"""A world by its map: it stops the robot and the lidar's rays where the same walls would."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import shapes
from floor_plans.occupancy_map import write_map
from strict_files.yaml_file import read_yaml_file
from surveillance_simulation.robot.base import Base, BaseModel
from surveillance_simulation.robot.lidar import LidarModel, scan
from surveillance_simulation.world.people import People, PeopleModel
from surveillance_simulation.world.simulated_place import SimulatedPlace
from tests.places import CONFIG, seven_rooms

CELL = 0.05


@pytest.fixture(scope='module')
def worlds(tmp_path_factory: pytest.TempPathFactory) -> tuple[SimulatedPlace, SimulatedPlace]:
    """Return the seven rooms by their walls, and by a map that was drawn of them."""
    folder = tmp_path_factory.mktemp('map')
    by_walls = seven_rooms()
    grid = by_walls.plan.grid(CELL)
    write_map(folder / 'rooms.yaml', grid.cells[::-1], CELL, (*grid.origin, 0.0))
    given = dict(read_yaml_file(CONFIG / 'seven_rooms.yaml').values['/**']['ros__parameters'])
    del given['walls']
    return by_walls, SimulatedPlace.from_parameters(
        {**given, 'map_file': str(folder / 'rooms.yaml')}
    )


def test_rays_end_where_the_walls_are(worlds: tuple[SimulatedPlace, SimulatedPlace]) -> None:
    by_walls, by_map = worlds
    model = LidarModel(noise=0.0)
    for x, y, _ in by_walls.plan.place.positions.values():
        expected = scan(by_walls, (x + 0.13, y - 0.21, 0.3), model)
        found = scan(by_map, (x + 0.13, y - 0.21, 0.3), model)
        seen = np.isfinite(expected) & np.isfinite(found)
        gap = np.abs(expected[seen] - found[seen])
        # A ray that grazes a jamb goes on in one of the two.
        assert np.median(gap) < 0.03
        assert np.mean(gap < 0.1) > 0.97


def test_clearance_is_that_of_the_cells(worlds: tuple[SimulatedPlace, SimulatedPlace]) -> None:
    by_walls, by_map = worlds
    rng = np.random.default_rng(4)
    west, south, east, north = by_walls.plan.bounds
    points = rng.uniform((west, south), (east, north), (300, 2))
    gaps = [by_walls.clearance(x, y) - by_map.clearance(x, y) for x, y in points]
    assert max(map(abs, gaps)) < 1.5 * CELL


def test_the_robot_stops_at_the_map(worlds: tuple[SimulatedPlace, SimulatedPlace]) -> None:
    _, by_map = worlds
    x, y, _ = by_map.plan.place.positions['R1']
    base = Base(by_map, (x, y, math.pi / 2), BaseModel())
    for _ in range(400):
        base.command(0.5, 0.0)
        base.step(0.05)
    assert base.collisions == 1
    assert by_map.clearance(*base.pose[:2]) == pytest.approx(base.model.radius, abs=0.01)


def test_a_door_of_a_map_can_be_closed(worlds: tuple[SimulatedPlace, SimulatedPlace]) -> None:
    _, by_map = worlds
    door = by_map.plan.doors['D1']
    assert by_map.is_free(door.x, door.y, 0.3)
    by_map.set_door('D1', False)
    assert not by_map.is_free(door.x, door.y, 0.3)
    by_map.set_door('D1', True)


def test_rooms_are_the_same(worlds: tuple[SimulatedPlace, SimulatedPlace]) -> None:
    by_walls, by_map = worlds
    rng = np.random.default_rng(5)
    for room, (x, y, _) in by_walls.plan.place.positions.items():
        for dx, dy in rng.uniform(-0.5, 0.5, (20, 2)):
            assert by_map.place_at(x + dx, y + dy) == room


def test_people_walk_in_a_map(worlds: tuple[SimulatedPlace, SimulatedPlace]) -> None:
    _, by_map = worlds
    rng = np.random.default_rng(6)
    people = People(by_map.plan, PeopleModel(count=3), rng)
    before = people.discs.copy()
    for _ in range(200):
        people.step(0.1, [(-50.0, 0.0)], 0.2)
    assert (np.hypot(*(people.discs - before)[:, :2].T) > 0.5).any()
    for x, y, radius in people.discs:
        assert by_map.clearance(x, y) > radius - CELL


def test_a_place_without_walls_and_map_is_an_open_floor(
    worlds: tuple[SimulatedPlace, SimulatedPlace],
) -> None:
    by_walls, _ = worlds
    given = dict(read_yaml_file(CONFIG / 'seven_rooms.yaml').values['/**']['ros__parameters'])
    del given['walls']
    world = SimulatedPlace.from_parameters(given)
    assert world.is_free(*by_walls.plan.start[:2], 0.5)
    assert np.isinf(scan(world, by_walls.plan.start, LidarModel(noise=0.0))).all()
    assert shapes.distances(world.solid, 0.0, 0.0).shape == (0,)
