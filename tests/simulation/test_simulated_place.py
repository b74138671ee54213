"""Places, their geometry and what may be wrong with it."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from benchmarks import regular_places
from floor_plans import Marker, PlaceError, occupancy_grid, writing
from strict_files.files import FileError
from surveillance_simulation.world.simulated_place import SimulatedPlace, read_simulated_place
from tests.places import CONFIG, changed, seven_rooms, two_rooms


@pytest.mark.parametrize('name', ['seven_rooms', 'patrol_world', 'office'])
def test_every_place_of_the_project_is_sound(name: str) -> None:
    world = read_simulated_place(CONFIG / f'{name}.yaml')
    for place, (x, y, _) in world.plan.place.positions.items():
        assert world.place_at(x, y) == place
        assert world.is_free(x, y, 0.3)


def test_office_file_is_what_its_generator_writes() -> None:
    written = writing.format_place(regular_places.office(), '')
    text = (CONFIG / 'office.yaml').read_text()
    assert text[text.index('/**:') :] == written[written.index('/**:') :]


@pytest.mark.parametrize(
    ('parameters', 'rooms', 'doors'),
    [
        (regular_places.grid(5, 4), 20, 31),
        (regular_places.ring(8), 8, 8),
        (regular_places.tree(5, 4, random.Random(3)), 20, 19),
    ],
)
def test_generated_places_are_sound(parameters: dict, rooms: int, doors: int) -> None:
    world = SimulatedPlace.from_parameters(parameters)
    assert (len(world.plan.place.rooms), len(world.plan.doors)) == (rooms, doors)


def test_a_doorway_is_divided_along_its_middle() -> None:
    world = two_rooms()
    assert world.place_at(2.96, 1.0) == 'A'
    assert world.place_at(3.04, 1.0) == 'B'
    assert world.place_at(-1.0, 1.0) is None
    assert world.place_at(100.0, 1.0) is None


def test_clearance_is_the_distance_to_the_surface() -> None:
    world = two_rooms()
    assert world.clearance(1.0, 1.0) == pytest.approx(0.95)
    assert world.clearance(1.0, 0.0) == 0.0
    # In the doorway the jambs are half a metre away.
    assert world.clearance(3.0, 1.0) == pytest.approx(0.5)


def test_a_closed_door_is_solid_until_it_opens() -> None:
    world = two_rooms()
    world.set_door('D', False)
    assert not world.is_open('D')
    assert world.clearance(3.0, 1.0) == 0.0
    world.set_door('D', True)
    assert world.clearance(3.0, 1.0) == pytest.approx(0.5)


def test_obstacles_come_move_and_go() -> None:
    world = two_rooms()
    world.place_obstacle('box', 1.0, 1.0, 0.3)
    assert world.clearance(1.5, 1.0) == pytest.approx(0.2)
    world.place_obstacle('box', 5.0, 1.0, 0.3)
    assert world.clearance(1.5, 1.0) == pytest.approx(0.95)
    world.remove_obstacle('box')
    assert not world.things


def test_every_change_counts_up_the_version() -> None:
    world = two_rooms()
    versions = [world.version]
    for change in (
        lambda: world.set_door('D', False),
        lambda: world.place_obstacle('box', 1.0, 1.0, 0.3),
        lambda: world.remove_obstacle('box'),
        lambda: world.set_marker('m1', 'broken'),
        lambda: world.hang_marker(Marker('m2', 4, 1.0, 1.0, 1.0, 0.0, 0.2)),
    ):
        change()
        versions.append(world.version)
    assert versions == sorted(set(versions))


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        (lambda w: w.set_door('X', True), "there is no door 'X': expected 'D'"),
        (lambda w: w.is_open('X'), "there is no door 'X': expected 'D'"),
        (lambda w: w.remove_obstacle('box'), "there is no obstacle 'box', nor any other"),
        (lambda w: w.place_obstacle('', 0.0, 0.0, 1.0), "obstacle '': expected a name"),
        (lambda w: w.place_obstacle('b', math.nan, 0.0, 1.0), "obstacle 'b' at (nan, 0)"),
        (lambda w: w.place_obstacle('b', 0.0, 0.0, 0.0), "obstacle 'b': radius 0 m"),
        (lambda w: w.set_marker('m9', 'broken'), "there is no marker 'm9': expected 'm1'"),
        (lambda w: w.set_marker('m1', 'lost'), "marker state 'lost': expected one of whole"),
        (lambda w: w.hang_marker(Marker('m', -1, 0, 0, 0, 0, 0.2)), "marker 'm': "),
    ],
)
def test_a_wrong_change_is_refused_in_one_line(change, message: str) -> None:
    with pytest.raises(PlaceError) as caught:
        change(two_rooms())
    assert str(caught.value).startswith(message)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        (changed(walls={}), 'walls: empty: expected NAME: [x1, y1, x2, y2] for each'),
        (changed(walls__south=[0, 0, 6]), 'walls.south: [0, 0, 6]: expected [x1, y1, x2, y2]'),
        (changed(walls__south=[0, 0, 6, 'a']), "walls.south: 'a': expected a number"),
        (changed(walls__south=[0, 0, 6, math.inf]), 'walls.south: inf: expected a number'),
        (changed(walls__dot=[1, 1, 1, 1]), 'walls.dot: length 0 m: expected at least'),
        (changed(doors__D=[3.0, 1.0, 0.0, 1.0]), 'doors.D: (3, 1) with width 1 m lies on no wall'),
        (changed(doors__D=[3.0, 1.0, 1.5707963, 0.1]), 'doors.D: width 0.1 m: expected 0.3 to'),
        (changed(doors__X=[1.0, 0.0, 0.0, 1.0]), 'doors.X: leads into no place'),
        (changed(doors={'X': [3.0, 1.0, 1.5707963, 1.0]}), "map.A: door 'D' has no position"),
        (changed(doors__D=[1.0, 0.0, 0.0, 1.0]), 'doors.D: stands between A and outside: expected'),
        (changed(room_positions__B=[2.0, 1.0]), "room_positions.B: 'B' and 'A' are one room"),
        (
            changed(room_positions__B=[3.0, 1.0]),
            'room_positions.B: (3, 1) lies in a wall or a door',
        ),
        (changed(room_positions__B=[9.0, 1.0]), 'room_positions.B: (9, 1) lies outside'),
        (changed(station=[5.0, 1.0, 0.0]), 'station: (5, 1) lies in B: expected a point in A'),
        (changed(station=[1.0]), 'station: [1.0]: expected [x, y, yaw]'),
        (changed(markers__m1=[1.5, 1.0, 1.0, 1.0, 0.0]), 'markers.m1: id 1.5: expected a whole'),
        (changed(markers__m1=[1.0, 1.0, 1.0, 9.0, 0.0]), 'markers.m1: height 9 m: expected 0 to'),
        (
            changed(walls__far=[0.0, 0.0, 0.0, 20000.0]),
            'walls.far: reaches to 20000 m: expected at most 1000 m',
        ),
        (
            changed(walls__far=[-900.0, 0.0, 0.0, 900.0]),
            'walls: the place is 906 m by 900 m: expected at most 100000 square metres',
        ),
        (changed(marker_size=0.0), 'marker_size: 0 m: expected more than 0'),
        (changed(map={'A': ['D'], 'B': ['X']}), "map.A: door 'D' is in only one place"),
    ],
)
def test_a_wrong_place_is_refused_in_one_line(parameters: dict, message: str) -> None:
    with pytest.raises(PlaceError) as caught:
        SimulatedPlace.from_parameters(parameters)
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


def test_an_error_in_a_file_names_file_and_line(tmp_path) -> None:
    text = (CONFIG / 'seven_rooms.yaml').read_text()
    path = tmp_path / 'broken.yaml'
    path.write_text(text.replace('D5: [12.5, 10.0,', 'D5: [12.5, 11.0,'))
    line = 1 + text[: text.index('D5: [12.5')].count('\n')
    with pytest.raises(FileError) as caught:
        read_simulated_place(path)
    assert str(caught.value).startswith(f'{path}:{line}: doors.D5: (12.5, 11)')


def test_the_map_shows_walls_as_occupied_and_doors_as_free() -> None:
    plan = two_rooms().plan
    grid = plan.grid()
    assert grid.cells[grid.cell_of(1.0, 1.0)] == occupancy_grid.FREE
    assert grid.cells[grid.cell_of(3.0, 1.0)] == occupancy_grid.FREE
    assert grid.cells[grid.cell_of(3.0, 0.2)] == occupancy_grid.OCCUPIED
    assert grid.cells[grid.cell_of(-0.3, 1.0)] == occupancy_grid.UNKNOWN


def test_free_cells_of_the_map_are_free_in_the_world() -> None:
    world = seven_rooms()
    grid = world.plan.grid()
    rows, columns = np.nonzero(grid.cells == occupancy_grid.FREE)
    for row, column in list(zip(rows, columns, strict=True))[::97]:
        assert world.clearance(*grid.centre_of(int(row), int(column))) >= grid.resolution / 2 - 1e-9


def test_a_generator_refuses_an_odd_ring() -> None:
    with pytest.raises(ValueError, match='ring of 5 rooms: expected an even number'):
        regular_places.ring(5)


def test_a_wrong_option_of_the_generator_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='2'):
        regular_places.main(['grid', '--colums', '3'])
    assert capsys.readouterr().err.splitlines() == [
        "regular_places: unknown option '--colums': expected '--columns' "
        '(see regular_places --help)'
    ]
