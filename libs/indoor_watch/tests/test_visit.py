"""The parts that decide by numbers: agreement, spots, sight, a visit, and what is kept."""

from __future__ import annotations

import base64
import zlib
from dataclasses import replace

import numpy as np
import pytest

from floor_plans import Grid
from indoor_watch import MOST_CELLS, Kind, Observation, same_map
from indoor_watch.agreement import Agreement
from indoor_watch.floor import FloorView
from indoor_watch.floor_layers import check, packed, unpacked
from indoor_watch.floor_monitor import FloorMonitor, is_free
from indoor_watch.marker_monitor import stands_before
from indoor_watch.visit import LidarSweep, Visit

from .marked_walls import camera


def hall() -> Grid:
    """Return a floor of 6 by 4 metres between walls, its south-west corner at (-1, 2)."""
    cells = np.zeros((40, 60), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    return Grid(cells, 0.1, (-1.0, 2.0))


@pytest.mark.parametrize(
    ('pictures', 'settled'),
    [
        ([('dark', 1, 0.0)], False),
        ([('dark', 1, 0.0), ('dark', 1, 3.9)], False),
        ([('dark', 1, 0.0), ('dark', 1, 4.0)], True),
        ([('dark', 1, 0.0), ('dark', 2, 9.0)], False),
        ([('dark', 1, 0.0), ('lit', 1, 2.0), ('dark', 1, 9.0)], False),
        ([('lit', 1, 0.0), ('dark', 1, 2.0), ('dark', 1, 6.0)], True),
        ([('dark', 1, 0.0), ('dark', 2, 1.0), ('dark', 3, 2.0)], True),
        ([('dark', 1, 0.0), ('lit', 2, 1.0), ('dark', 3, 2.0)], False),
        ([('lit', 1, 0.0), ('dark', 2, 1.0), ('dark', 3, 1.1), ('dark', 3, 1.2)], True),
        ([('dark', 1, 0.0), ('dark', 1, 1.0), ('lit', 1, 9.0)], False),
    ],
)
def test_pictures_agree_three_in_a_row_or_two_of_one_stay_some_time_apart(
    pictures: list[tuple[str, int, float]], settled: bool
) -> None:
    agreement: Agreement[str] = Agreement()
    told = [agreement.take(*each) for each in pictures]
    assert told[-1] is settled


def test_a_map_is_the_same_one_when_all_of_it_is() -> None:
    one = hall()
    assert same_map(one, hall())
    cells = one.cells.copy()
    cells[5, 5] = 100
    assert not same_map(one, Grid(cells, 0.1, (-1.0, 2.0)))
    assert not same_map(one, Grid(one.cells, 0.11, (-1.0, 2.0)))
    assert not same_map(one, Grid(one.cells, 0.1, (-1.0, 2.1)))


def view(seed: int = 1) -> FloorView:
    draw = np.random.default_rng(seed)
    occupied, free = draw.random((40, 60)) < 0.1, draw.random((40, 60)) < 0.6
    return FloorView(hall(), occupied, free & ~occupied, draw.random((40, 60)) < 0.1)


def test_what_is_normal_is_packed_and_unpacked_on_its_own_map_alone() -> None:
    before = view()
    kept = packed(before)
    after = unpacked(kept, hall())
    assert after is not None
    assert (after.occupied == before.occupied).all()
    assert (after.free == before.free).all()
    assert not after.moving.any()
    assert len(kept['occupied']) < 600, 'bits, compressed'
    for other in (
        Grid(hall().cells[:-1], 0.1, (-1.0, 2.0)),
        Grid(hall().cells, 0.2, (-1.0, 2.0)),
        Grid(hall().cells, 0.1, (-1.0, 2.5)),
    ):
        assert unpacked(kept, other) is None


def test_a_damaged_layer_is_refused_in_one_line() -> None:
    kept = packed(view())
    check(kept)
    broken = base64.b64encode(b'nothing').decode()
    with pytest.raises(ValueError, match=r'^a layer of the map: '):
        check({**kept, 'free': broken})
    for length in (299, 301):
        short = base64.b64encode(zlib.compress(bytes(length))).decode()
        with pytest.raises(
            ValueError, match=rf'^a layer of the map of {length} bytes, not 40 by 60$'
        ):
            check({**kept, 'occupied': short})
    for shape in ([10**9, 10**6], [-40, -60]):
        with pytest.raises(ValueError, match=r'^a layer of the map of 300 bytes, not '):
            check({**kept, 'shape': shape})
    huge = zlib.compress(bytes(MOST_CELLS // 4))
    for wrong in (kept['occupied'][:40], base64.b64encode(huge).decode()):
        with pytest.raises(ValueError, match=r'^a layer of the map: cut off, or of more than 25'):
            check({**kept, 'occupied': wrong})
    whole = base64.b64encode(zlib.compress(bytes(300))).decode()
    empty = unpacked({**kept, 'free': whole}, hall())
    assert empty is not None
    assert not empty.free.any()


@pytest.mark.parametrize(
    ('taken', 'free'),
    [
        # A spot is 3 by 3 cells of 0.1 m: four fifths of it are enough.
        ([], True),
        ([(20, 30)], True),
        ([(19, 29)], True),
        ([(20, 30), (21, 31)], False),
    ],
)
def test_a_spot_is_free_where_beams_passed_through_nearly_all_of_it(
    taken: list[tuple[int, int]], free: bool
) -> None:
    passed = np.ones((40, 60), np.bool_)
    for cell in taken:
        passed[cell] = False
    passed[18], passed[22], passed[:, 28], passed[:, 32] = False, False, False, False
    now = FloorView(hall(), ~passed & False, passed, ~passed & False)
    at = hall().centre_of(20, 30)
    assert is_free(now, at) is free
    assert not is_free(now, (50.0, 50.0)), 'of another map'
    assert is_free(replace(now, free=passed | True), hall().centre_of(0, 59))


@pytest.mark.parametrize(('column', 'anew'), [(30, True), (33, True), (35, False), (25, False)])
def test_something_stands_anew_near_a_spot(column: int, anew: bool) -> None:
    nothing = np.zeros((40, 60), np.bool_)
    met = nothing.copy()
    met[20, column] = True
    now = FloorView(hall(), met, ~met, nothing)
    found = FloorMonitor(lambda _: False)
    found.normal = FloorView(hall(), nothing, ~nothing, nothing)
    # Nearer than 0.4 m, from middle to middle; what is met in a cell leaves the spot free enough.
    assert found.is_as_before(hall().centre_of(20, 30), now) is not anew
    found.normal = replace(found.normal, occupied=met)
    assert found.is_as_before(hall().centre_of(20, 30), now), 'it always stood there'


@pytest.mark.parametrize(
    ('met', 'hidden'),
    [
        ((1.0, 0.0), True),
        ((1.0, 0.24), True),
        ((1.0, -0.26), False),
        ((1.59, 0.0), True),
        ((1.61, 0.0), False),
        ((-0.1, 0.0), False),
    ],
)
def test_what_the_lidar_meets_on_the_line_of_sight_hides_a_marker(
    met: tuple[float, float], hidden: bool
) -> None:
    marker = np.array([2.0, 0.0, 1.0])
    assert not stands_before(camera(), marker, np.zeros((0, 2)))
    assert stands_before(camera(), marker, np.array([[9.0, 9.0], met])) is hidden


def seen(state: str, stamp: float, at: tuple[float, float] | None = None) -> Observation:
    return Observation(Kind.OBJECT, state, 'R1', '', at, 0.9, stamp)


def sweep_at(x: float, y: float) -> LidarSweep:
    return LidarSweep((x, y), np.zeros((0, 2)), np.zeros(0, np.bool_), 100.0)


def test_a_thing_is_told_again_after_some_time_or_from_elsewhere_or_otherwise() -> None:
    found = Visit()
    found.sweep = sweep_at(1.0, 3.0)
    assert found.is_due(seen('appeared', 100.0, (2.0, 4.0)))
    assert not found.is_due(seen('appeared', 109.9, (2.0, 4.0)))
    assert not found.is_due(seen('appeared', 90.1, (2.2, 4.3))), 'the same square metre'
    assert found.is_due(seen('appeared', 100.0, (3.0, 4.0)))
    assert found.is_due(seen('removed', 100.0, (2.0, 4.0)))
    assert found.is_due(seen('appeared', 100.0))
    assert found.is_due(seen('appeared', 100.0, (2.0, 4.0)), 'both')
    assert found.is_due(seen('appeared', 110.0, (2.0, 4.0)))
    assert not found.is_due(seen('appeared', 111.0, (2.0, 4.0)))
    found.sweep = sweep_at(1.0, 30.0)
    assert found.is_due(seen('appeared', 111.0, (2.0, 4.0)))
