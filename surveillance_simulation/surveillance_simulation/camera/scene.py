"""A world as flat textured faces in space: what the camera can see of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from floor_plans import Door, shapes
from floor_plans.shapes import WALL_HEIGHT, WALL_THICKNESS
from surveillance_simulation.camera.model import Array
from surveillance_simulation.world import textures
from surveillance_simulation.world.simulated_place import (
    LEAF_THICKNESS,
    MarkerPanel,
    SimulatedPlace,
)
from surveillance_simulation.world.textures import TILE, Texture
from surveillance_simulation.world.things import Part, Shape, Thing

DOOR_HEIGHT = 2.05
STATION_SIDE = 0.6


@dataclass(frozen=True)
class Face:
    """A textured rectangle in space.

    Attributes:
        corner: Top left corner (3,), metres, world frame.
        across: Vector (3,) along the texture's rows from the corner to the top right corner.
        down: Vector (3,) along the texture's columns from the corner to the bottom left corner.
        texture: The picture on it.
        crop: Part of the texture shown: left, top, right and bottom as shares of its size.
        shade: Factor on the texture's brightness.
    """

    corner: Array
    across: Array
    down: Array
    texture: Texture
    crop: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    shade: float = 1.0

    @property
    def middle(self) -> Array:
        """Its middle (3,), metres, world frame."""
        return self.corner + (self.across + self.down) / 2


def faces_of(world: SimulatedPlace) -> list[Face]:
    """Return every face of a world, but for its people.

    Raises:
        PlaceError: A marker's dictionary or id does not exist.
    """
    plan = world.plan
    faces = list(_floor(plan.bounds))
    for start, end in plan.solid_lines():
        faces += _box(start, end, WALL_THICKNESS, 0.0, WALL_HEIGHT, None)
    for door in plan.doors.values():
        faces += _door(door, world.leaf(door.name), ajar=world.door_angle(door.name) > 0.0)
    for thing in world.things.values():
        if thing.kind != 'person':
            faces += thing_faces(thing)
    for panel in world.panels.values():
        if panel.state != 'gone':
            faces.append(_panel(panel, plan.marker_dictionary))
    for station in plan.stations.values():
        x, y, yaw = station.pose
        faces.append(_lying(x, y, 0.004, yaw, STATION_SIDE, textures.station()))
    if world.wall_brightness == 1.0:
        return faces
    return [
        replace(face, shade=face.shade * world.wall_brightness)
        if face.texture is textures.plaster()
        else face
        for face in faces
    ]


def _floor(bounds: tuple[float, float, float, float]) -> Iterator[Face]:
    west, south, east, north = bounds
    for x in np.arange(west, east, TILE):
        for y in np.arange(south, north, TILE):
            wide, high = min(TILE, east - x), min(TILE, north - y)
            crop = (0.0, 1.0 - high / TILE, wide / TILE, 1.0)
            yield Face(
                np.array([x, y + high, 0.0]),
                np.array([wide, 0.0, 0.0]),
                np.array([0.0, -high, 0.0]),
                textures.floor(),
                crop,
            )


def _upright(
    left: tuple[float, float],
    right: tuple[float, float],
    bottom: float,
    top: float,
    texture: Texture | None,
) -> Iterator[Face]:
    """Yield a standing rectangle, seen with `left` on the left; plaster is cut into tiles."""
    length = math.dist(left, right)
    direction = np.array([right[0] - left[0], right[1] - left[1], 0.0]) / length
    # Light falls in from one side, so that walls at an angle look different.
    shade = 0.86 + 0.1 * direction[0] + 0.04 * direction[1]
    down = np.array([0.0, 0.0, bottom - top])
    if texture is not None:
        corner = np.array([left[0], left[1], top])
        yield Face(corner, direction * length, down, texture, shade=shade)
        return
    for start in np.arange(0.0, length, TILE):
        wide = min(TILE, length - start)
        corner = np.array([left[0], left[1], top]) + direction * start
        crop = (0.0, 0.0, wide / TILE, min(1.0, (top - bottom) / TILE))
        yield Face(corner, direction * wide, down, textures.plaster(), crop, shade)


def _box(
    start: tuple[float, float],
    end: tuple[float, float],
    thickness: float,
    bottom: float,
    top: float,
    texture: Texture | None,
) -> Iterator[Face]:
    outline = shapes.corners(shapes.boxes_around([(start, end)], thickness))[0]
    for first, second in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        # Anticlockwise from above: seen from outside, the first corner is on the left.
        yield from _upright(
            (float(first[0]), float(first[1])),
            (float(second[0]), float(second[1])),
            bottom,
            top,
            texture if math.dist(first, second) > 2 * thickness else None,
        )


def _door(
    door: Door, leaf: tuple[tuple[float, float], tuple[float, float]] | None, *, ajar: bool
) -> Iterator[Face]:
    yield from _box(*door.ends, WALL_THICKNESS, DOOR_HEIGHT, WALL_HEIGHT, None)
    if leaf is not None:
        thickness = LEAF_THICKNESS if ajar else WALL_THICKNESS
        yield from _box(*leaf, thickness, 0.0, DOOR_HEIGHT, textures.leaf())
        if not ajar:
            return
    along = np.array([math.cos(door.yaw), math.sin(door.yaw), 0.0]) * door.width
    across = np.array([-math.sin(door.yaw), math.cos(door.yaw), 0.0]) * WALL_THICKNESS
    corner = np.array([door.x, door.y, DOOR_HEIGHT]) - along / 2 - across / 2
    crop = (0.0, 0.0, min(1.0, door.width / TILE), WALL_THICKNESS / TILE)
    yield Face(corner, along, across, textures.plaster(), crop, shade=0.7)


def thing_faces(thing: Thing) -> Iterator[Face]:
    """Yield the faces of a thing."""
    for part in thing.parts:
        x, y = thing.at(part)
        texture = textures.barrel() if thing.kind == 'barrel' else textures.plain(part.colour)
        outline = _outline(part, x, y, thing.yaw)
        for first, second in pairwise([*outline, outline[0]]):
            face = next(_upright(first, second, part.bottom, part.top, texture))
            if part.shape == Shape.ELLIPSE:
                # Round things are told from flat ones by how light falls off along them.
                length = math.dist(first, second)
                normal = (second[1] - first[1]) / length, (first[0] - second[0]) / length
                shade = 0.76 + 0.24 * (0.8 * normal[0] + 0.6 * normal[1])
                face = replace(face, shade=shade)
            yield face
        if part.shape == Shape.ELLIPSE:
            continue  # slices lie on each other
        # Of a cylinder the lid is the square inside it: the rim's height hides the rest.
        shrink = math.sqrt(0.5) if part.shape == Shape.CYLINDER else 1.0
        turn = thing.yaw + (math.pi / 4 if part.shape == Shape.CYLINDER else 0.0)
        ahead = np.array([math.cos(turn), math.sin(turn), 0.0]) * part.length * shrink
        left = np.array([-math.sin(turn), math.cos(turn), 0.0]) * part.width * shrink
        for height, across, shade in ((part.top, -left, 0.95), (part.bottom, left, 0.6)):
            corner = np.array([x, y, height]) - across / 2 - ahead / 2
            yield Face(corner + ahead, across, -ahead, textures.plain(part.colour), shade=shade)


def _outline(part: Part, x: float, y: float, yaw: float) -> list[tuple[float, float]]:
    """Return the corners of a part seen from above, anticlockwise, metres."""
    if part.shape == Shape.BOX:
        angles = [math.pi / 4 + math.pi / 2 * each for each in range(4)]
        points = [
            (
                math.copysign(part.length / 2, math.cos(a)),
                math.copysign(part.width / 2, math.sin(a)),
            )
            for a in angles
        ]
    else:
        ring = np.arange(12) * (2 * math.pi / 12)
        points = [
            (part.length / 2 * math.cos(a), part.width / 2 * math.sin(a)) for a in ring.tolist()
        ]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return [(x + cosine * a - sine * b, y + sine * a + cosine * b) for a, b in points]


def _panel(panel: MarkerPanel, dictionary: str) -> Face:
    marker = panel.marker
    texture = textures.marker_panel(dictionary, marker.id, panel.state)
    side = marker.size * textures.panel_share(dictionary)
    # Seen from the front, the panel's left is on the left of someone who looks against its normal.
    across = np.array([-math.sin(marker.yaw), math.cos(marker.yaw), 0.0]) * side
    down = np.array([0.0, 0.0, -side])
    centre = np.array([marker.x, marker.y, marker.z])
    return Face(centre - across / 2 - down / 2, across, down, texture)


def _lying(x: float, y: float, z: float, yaw: float, side: float, texture: Texture) -> Face:
    across = np.array([math.cos(yaw), math.sin(yaw), 0.0]) * side
    down = np.array([math.sin(yaw), -math.cos(yaw), 0.0]) * side
    return Face(np.array([x, y, z]) - across / 2 - down / 2, across, down, texture)
