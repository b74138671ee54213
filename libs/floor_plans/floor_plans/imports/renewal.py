"""A newer map of a building that has a place: rooms that are still there keep all that was said.

The newer map is laid over the older one (`alignment`): what stands on it is turned by small steps,
for each of which the best shift is the peak of a cross-correlation with the distance field of the
older map; the nearest points then make it exact (ICP: Besl and McKay, 1992). Rooms are the same
where most of their floor is; doors where they join the same rooms at about the same point. All else
that the place's file says is carried over, turned and shifted with the map.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from floor_plans.description import described_in, read_place
from floor_plans.editor import PlaceChange, changes_between
from floor_plans.floor_plan import Door, FloorPlan
from floor_plans.map_rooms import Proposal
from floor_plans.occupancy_grid import Grid, distance_to
from floor_plans.occupancy_map import OccupancyMap
from floor_plans.room_map import RoomMap

Points = NDArray[np.float64]

LEAST_AGREEMENT = 0.6
"""Share of what stands on either map that stands on the other one, too, below which they are not
taken for maps of one building."""
MOST_TURNED = 15.0
"""How far the newer map may be turned, degrees."""
_SIDE = 0.1
_NEAR = 0.15
_MOST_POINTS = 40_000
_SAME_ROOM = 0.4
"""Overlap of two rooms, as a share of what both cover together, from which on they are one."""
_SAME_DOOR, _SAME_POINT = 1.0, 0.4
"""How far a door may have moved that joins the same rooms, and one that joins others, metres."""
_ROOM_TABLES = ('thresholds', 'exploration', 'hours', 'classes')
_AS_THEY_ARE = ('quiet_hours', 'time_zone', 'marker_size', 'marker_dictionary')


@dataclass(frozen=True)
class Alignment:
    """How a newer map lies on an older one.

    Attributes:
        yaw: Turn of the newer map into the older one's frame, rad.
        shift: What is added then, metres.
        agreement: Share of what stands on either map that stands on the other one, too, 0 to 1.
    """

    yaw: float
    shift: tuple[float, float]
    agreement: float

    def to_old(self, points: Any) -> Points:
        """Return points of the newer map in the older one's frame, shape (n, 2), metres."""
        return np.asarray(points, float).reshape(-1, 2) @ _turn(self.yaw).T + self.shift

    def to_new(self, points: Any) -> Points:
        """Return points of the older map in the newer one's frame, shape (n, 2), metres."""
        return (np.asarray(points, float).reshape(-1, 2) - self.shift) @ _turn(self.yaw)


@dataclass(frozen=True)
class Renewal:
    """A place for a newer map.

    Attributes:
        parameters: All of its file below `ros__parameters`, but for the map's file.
        lies: How the newer map lies on the older one.
        said: How it lies and which rooms are kept, a line each.
    """

    parameters: Mapping[str, Any]
    lies: Alignment
    said: tuple[str, ...]


def alignment(old: Grid, new: Grid) -> Alignment:
    """Return how a newer map lies on an older one, both with cells along their own axes.

    Raises:
        ValueError: They have too little in common.
    """
    there, here = _standing(old), _standing(new)
    if not len(there) or not len(here):
        raise ValueError('nothing stands on one of the maps: expected walls')
    field, origin = _field(there)
    coarse = np.radians(np.arange(-MOST_TURNED, MOST_TURNED + 0.5, 1.0))
    _, yaw, _ = max(_best_shift(field, origin, here, each) for each in coarse)
    fine = yaw + np.radians(np.arange(-0.75, 0.76, 0.25))
    _, yaw, shift = max(_best_shift(field, origin, here, each) for each in fine)
    yaw, shift = _nearest_points(there, here, yaw, shift)
    found = Alignment(yaw, shift, 0.0)
    agreement = min(_shared(found.to_old(here), there), _shared(there, found.to_old(here)))
    if agreement < LEAST_AGREEMENT:
        raise ValueError(
            f'the maps agree by {agreement:.0%}: expected {LEAST_AGREEMENT:.0%}, as of one '
            f'building, turned by at most {MOST_TURNED:g} degrees'
        )
    return Alignment(yaw, shift, agreement)


def changes_since(
    older: Path, newer: FloorPlan, radius: float, lies: Alignment | None = None
) -> tuple[PlaceChange, ...]:
    """Return what has changed since an older place of a building.

    Args:
        older: Its file.
        newer: The place as it is.
        radius: Of the robot, metres.
        lies: How the newer one lies on the older one; None: that is looked for.

    Raises:
        FileError: The file cannot be read, or is no sound place.
        ValueError: The places have too little in common.
    """
    plan = read_place(older, radius=radius).plan
    lies = lies or alignment(plan.grid(), newer.grid())
    return changes_between(plan, described_in(older)[1], newer, lies)


def _turn(yaw: float) -> NDArray[np.float64]:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin], [sin, cos]])


def _standing(grid: Grid) -> Points:
    """Return the cells in which something stands, at most so many, evenly chosen, metres."""
    points = grid.centres_of(np.argwhere(grid.occupied))
    return points[:: max(1, math.ceil(len(points) / _MOST_POINTS))]


def _field(points: Points) -> tuple[NDArray[np.float64], Points]:
    """Return how near each cell of 0.1 m is to points, 0 to 1, and the corner of those cells."""
    low, high = points.min(axis=0), points.max(axis=0)
    columns, rows = (np.ceil((high - low) / _SIDE).astype(int) + 1).tolist()
    solid = np.zeros((rows, columns), np.bool_)
    column, row = ((points - low) / _SIDE).astype(int).T
    solid[row, column] = True
    near: NDArray[np.float64] = np.exp(-((distance_to(solid, _SIDE) / (2 * _SIDE)) ** 2))
    return near.astype(np.float64), low


def _best_shift(
    field: NDArray[np.float64], origin: Points, points: Points, yaw: float
) -> tuple[float, float, tuple[float, float]]:
    """Return the score of a turn, the turn, and the best shift after it."""
    from scipy import fft

    turned = points @ _turn(yaw).T
    low = turned.min(axis=0)
    column, row = ((turned - low) / _SIDE).astype(int).T
    drawn = np.zeros((int(row.max()) + 1, int(column.max()) + 1))
    drawn[row, column] = 1.0
    size = [fft.next_fast_len(a + b) for a, b in zip(field.shape, drawn.shape, strict=True)]
    both = fft.irfft2(fft.rfft2(field, size) * np.conj(fft.rfft2(drawn, size)), size)
    up, right = divmod(int(np.argmax(both)), both.shape[1])
    # A shift to the south or west wraps round.
    rows = up - (size[0] if up >= field.shape[0] else 0)
    columns = right - (size[1] if right >= field.shape[1] else 0)
    x, y = origin + np.array([columns, rows]) * _SIDE - low
    return float(both.max() / drawn.sum()), yaw, (float(x), float(y))


def _nearest_points(
    there: Points, here: Points, yaw: float, shift: tuple[float, float]
) -> tuple[float, tuple[float, float]]:
    """Return turn and shift with which the nearest points lie on each other best."""
    from scipy.spatial import cKDTree

    tree = cKDTree(there)
    for reach in (0.4, 0.3, 0.2, 0.15, 0.15, 0.15):
        moved = here @ _turn(yaw).T + shift
        away, index = map(np.asarray, tree.query(moved, distance_upper_bound=reach))
        paired = np.isfinite(away)
        if paired.sum() < 10:
            break
        source, target = here[paired], there[index[paired]]
        a, b = source - source.mean(axis=0), target - target.mean(axis=0)
        yaw = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
        x, y = target.mean(axis=0) - source.mean(axis=0) @ _turn(yaw).T
        shift = (float(x), float(y))
    return yaw, shift


def _shared(points: Points, others: Points) -> float:
    """Return the share of points within the reach of others that have one of those nearby."""
    from scipy.spatial import cKDTree

    low, high = others.min(axis=0) - 1.0, others.max(axis=0) + 1.0
    within = points[((points > low) & (points < high)).all(axis=1)]
    if len(within) < len(points) / 4:
        return 0.0
    return float(np.mean(cKDTree(others).query(within)[0] <= _NEAR))


def renewed(
    plan: FloorPlan, described: Mapping[str, Any], building: OccupancyMap, proposal: Proposal
) -> Renewal:
    """Return the place of a newer map with what is known of the rooms that are still there.

    Args:
        plan: The place as it was.
        described: What its file says below `ros__parameters`.
        building: The newer map.
        proposal: What is proposed for it.

    Raises:
        ValueError: The maps have too little in common.
    """
    lies = alignment(plan.grid(), building.grid)
    same = _same_rooms(plan, lies, building, proposal)
    taken = {*plan.place.rooms, *plan.place.doors, *same.values()}
    names: dict[str, str] = {}
    for room in proposal.parameters['map']:
        names[room] = same.get(room) or (_free_name(room, taken) if room in taken else room)
        taken.add(names[room])
    doors = _same_doors(plan, lies, proposal, names, taken)
    parameters = _named_anew(proposal.parameters, names, doors)
    kept = set(same.values())
    _carry_over(parameters, described, lies, kept)
    return Renewal(parameters, lies, _in_words(plan, lies, same))


def _same_rooms(
    plan: FloorPlan, lies: Alignment, building: OccupancyMap, proposal: Proposal
) -> dict[str, str]:
    """Return the older name of each room of a proposal that was there before."""
    rooms, found = RoomMap(plan), proposal.segmentation
    labels, known = rooms.numbers()
    scale = building.cells.shape[1] * building.resolution / found.working.cells.shape[1]
    cells = np.argwhere(found.working_labels > 0)
    points = building.to_world((cells[:, ::-1] + 0.5) * scale)
    where = rooms.grid.cells_of(lies.to_old(points))
    inside = rooms.grid.contains(where)
    before = np.zeros(len(cells), np.intp)
    before[inside] = labels[where[inside, 0], where[inside, 1]]
    now = found.working_labels[cells[:, 0], cells[:, 1]]
    pairs, counts = np.unique(np.stack([now, before]), axis=1, return_counts=True)
    area_now = np.bincount(now)
    cell = (rooms.grid.resolution / scale) ** 2
    area_before = np.bincount(labels[rooms.grid.free & (labels > 0)]) * cell
    overlaps = []
    for new, old, count in zip(*pairs.tolist(), counts.tolist(), strict=True):
        if new in proposal.names and old in known and old < len(area_before):
            together = area_now[new] + area_before[old] - count
            overlaps.append((count / together, new, old))
    same: dict[str, str] = {}
    for share, new, old in sorted(overlaps, reverse=True):
        name = proposal.names[new]
        if share >= _SAME_ROOM and name not in same and known[old] not in same.values():
            same[name] = known[old]
    return same


def _same_doors(
    plan: FloorPlan,
    lies: Alignment,
    proposal: Proposal,
    names: Mapping[str, str],
    taken: set[str],
) -> dict[str, str]:
    """Return a name for each door of a proposal: the older one where it was there before."""
    joins: dict[str, set[str]] = {}
    for room, doors in proposal.parameters['map'].items():
        for door in doors:
            joins.setdefault(door, set()).add(names[room])
    free = dict(plan.doors)
    found: dict[str, str] = {}
    for door, (x, y, *_) in proposal.parameters.get('doors', {}).items():
        ((old_x, old_y),) = lies.to_old([(x, y)])

        def gap(each: Door, x: float = old_x, y: float = old_y) -> float:
            return math.dist((each.x, each.y), (x, y))

        # Of the same rooms, or at the same point where a room was cut or joined.
        like = [
            each
            for each in free.values()
            if gap(each) <= _SAME_POINT
            or (gap(each) <= _SAME_DOOR and set(plan.place.doors[each.name]) == joins[door])
        ]
        best = min(like, key=gap, default=None)
        if best is not None:
            found[door] = best.name
            del free[best.name]
    for door in joins:
        if door not in found:
            found[door] = _free_name(door, taken) if door in taken else door
            taken.add(found[door])
    return found


def _free_name(name: str, taken: set[str]) -> str:
    letter = name.rstrip('0123456789')
    number = 1
    while f'{letter}{number}' in taken:
        number += 1
    return f'{letter}{number}'


def _named_anew(
    parameters: Mapping[str, Any], names: Mapping[str, str], doors: Mapping[str, str]
) -> dict[str, Any]:
    found = dict(parameters)
    found['map'] = {
        names[room]: [doors[door] for door in listed] for room, listed in parameters['map'].items()
    }
    found['room_positions'] = {names[r]: at for r, at in parameters['room_positions'].items()}
    found['robot_room'] = names[parameters['robot_room']]
    found['recharge_rooms'] = [names[room] for room in parameters['recharge_rooms']]
    if 'doors' in parameters:
        found['doors'] = {doors[door]: row for door, row in parameters['doors'].items()}
    return found


def _carry_over(
    parameters: dict[str, Any], described: Mapping[str, Any], lies: Alignment, kept: set[str]
) -> None:
    """Put what the older file says of rooms that are still there into the newer parameters."""

    def moved(x: float, y: float, *yaw: float) -> list[float]:
        ((new_x, new_y),) = lies.to_new([(x, y)])
        turned = [each - lies.yaw for each in yaw]
        return [round(float(each), 3) for each in (new_x, new_y, *turned)]

    for table in _ROOM_TABLES:
        entries = {room: v for room, v in dict(described.get(table) or {}).items() if room in kept}
        if entries:
            parameters[table] = entries
    parameters |= {key: described[key] for key in _AS_THEY_ARE if key in described}
    for key in ('keep_out', 'sweep'):
        if listed := [room for room in described.get(key) or () if room in kept]:
            parameters[key] = listed
    for table in ('keep_out_zones', 'slow_zones'):
        zones = {}
        for name, row in dict(described.get(table) or {}).items():
            first = list(row[:1]) if table == 'slow_zones' else []
            corners = lies.to_new(row[len(first) :])
            zones[name] = [*first, *np.round(corners, 3).ravel().tolist()]
        if zones:
            parameters[table] = zones
    if markers := described.get('markers'):
        parameters['markers'] = {
            name: [number, *moved(x, y), z, round(yaw - lies.yaw, 4)]
            for name, (number, x, y, z, yaw) in dict(markers).items()
        }
    charging = [room for room in described.get('recharge_rooms') or () if room in kept]
    stations = {
        room: e for room, e in dict(described.get('stations') or {}).items() if room in kept
    }
    if charging and stations:
        parameters.pop('station', None)
        parameters['recharge_rooms'] = charging
        parameters['stations'] = {
            room: {**entry, 'pose': moved(*entry['pose'])} for room, entry in stations.items()
        }
    elif charging and described.get('station'):
        parameters['recharge_rooms'] = charging
        parameters['station'] = moved(*described['station'])
    if described.get('robot_room') in kept:
        parameters['robot_room'] = described['robot_room']


def _in_words(plan: FloorPlan, lies: Alignment, same: Mapping[str, str]) -> tuple[str, ...]:
    x, y = lies.shift
    kept = [room for room in plan.place.rooms if room in same.values()]
    return (
        f'the newer map lies on the older one by {lies.agreement:.0%}, turned by '
        f'{math.degrees(lies.yaw):.1f} degrees and shifted by ({x:.2f}, {y:.2f}) m',
        f'rooms kept: {", ".join(kept) or "none"}',
    )
