"""What is seen of a simulated place: faces that hide and are lit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from surveillance_simulation.camera.model import Array, Camera
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.camera.scene import Face, faces_of, thing_faces
from surveillance_simulation.world import textures
from surveillance_simulation.world.figures import person
from surveillance_simulation.world.simulated_place import SimulatedPlace
from surveillance_simulation.world.things import Shape, barrel, box, chair
from tests.places import camera_pose, changed, two_rooms

Key = tuple[str, float, float, float]


def seen_faces(faces: list[Face]) -> dict[Key, tuple[float, float, float]]:
    """Return area and least and greatest shade by what is shown and the direction it faces."""
    names = {
        id(textures.plaster()): 'plaster',
        id(textures.floor()): 'floor',
        id(textures.leaf()): 'leaf',
        id(textures.station()): 'station',
        id(textures.barrel()): 'barrel',
    }
    found: dict[Key, tuple[float, float, float]] = {}
    for face in faces:
        out = np.cross(face.down, face.across)
        area = float(np.linalg.norm(out))
        x, y, z = (np.round(out / area, 3) + 0.0).tolist()
        key = (names.get(id(face.texture), 'panel'), x, y, z)
        before, least, most = found.get(key, (0.0, math.inf, 0.0))
        found[key] = before + area, min(least, face.shade), max(most, face.shade)
    return found


WALLS = {
    # 2.5 m high, the doorway of 1 by 2.05 m left out; the light comes from one side.
    ('plaster', 1.0, 0.0, 0.0): (13.45, 0.9, 0.9),
    ('plaster', -1.0, 0.0, 0.0): (13.45, 0.82, 0.82),
    ('floor', 0.0, 0.0, 1.0): (12.0, 1.0, 1.0),
    ('station', 0.0, 0.0, 1.0): (0.36, 1.0, 1.0),
    ('panel', 1.0, 0.0, 0.0): (0.2**2 * 100 / 49, 1.0, 1.0),
}
OPEN = {
    # The ends of the walls stand in the doorway, with a lintel above.
    ('plaster', 0.0, 1.0, 0.0): (31.045, 0.76, 0.76),
    ('plaster', 0.0, -1.0, 0.0): (31.045, 0.96, 0.96),
    ('plaster', 0.0, 0.0, -1.0): (0.1, 0.7, 0.7),
}


def test_a_place_is_seen_from_within_with_its_doors_as_they_are() -> None:
    world = SimulatedPlace.from_parameters(changed(markers={'m1': [1.0, 0.06, 1.0, 1.0, 0.0]}))
    assert seen_faces(faces_of(world)) == {
        key: pytest.approx(each, abs=1e-6) for key, each in {**WALLS, **OPEN}.items()
    }
    world.set_door('D', is_open=False)
    closed = {
        ('leaf', 1.0, 0.0, 0.0): (2.05, 0.9, 0.9),
        ('leaf', -1.0, 0.0, 0.0): (2.05, 0.82, 0.82),
        ('plaster', 0.0, 1.0, 0.0): (31.25, 0.76, 0.76),
        ('plaster', 0.0, -1.0, 0.0): (31.25, 0.96, 0.96),
    }
    assert seen_faces(faces_of(world)) == {
        key: pytest.approx(each, abs=1e-6) for key, each in {**WALLS, **closed}.items()
    }
    world.turn_door('D', 30.0)
    leaf = {
        ('leaf', 0.866, 0.5, 0.0): (2.05, 0.8446, 0.8446),
        ('leaf', -0.866, -0.5, 0.0): (2.05, 0.8754, 0.8754),
        ('plaster', -0.5, 0.866, 0.0): (0.04 * 2.05, 0.7534, 0.7534),
        ('plaster', 0.5, -0.866, 0.0): (0.04 * 2.05, 0.9666, 0.9666),
    }
    assert seen_faces(faces_of(world)) == {
        key: pytest.approx(each, abs=1e-4) for key, each in {**WALLS, **OPEN, **leaf}.items()
    }
    world.set_marker('m1', 'gone')
    assert not any(key[0] == 'panel' for key in seen_faces(faces_of(world)))


def test_each_face_of_a_place_shows_as_much_of_its_texture_as_it_is_large() -> None:
    tile = textures.TILE
    world = two_rooms()
    floor: list[tuple[float, float, float, float]] = []
    for face in faces_of(world):
        wide, high = (float(np.linalg.norm(each)) for each in (face.across, face.down))
        left, top, right, bottom = face.crop
        assert 0.0 <= left < right <= 1.0
        assert 0.0 <= top < bottom <= 1.0
        if face.texture is textures.plaster():
            assert wide / (right - left) == pytest.approx(tile)
            # A wall higher than a tile is stretched, so that it has no line half way up.
            assert bottom - top == pytest.approx(min(1.0, high / tile))
        elif face.texture is textures.floor():
            assert wide / (right - left) == pytest.approx(tile)
            assert high / (bottom - top) == pytest.approx(tile)
            x, y = (face.corner + face.down)[:2].tolist()
            floor.append((x, y, wide, high))
        else:
            assert face.crop == (0.0, 0.0, 1.0, 1.0)
    assert sorted(floor) == [(0.0, 0.0, 2.0, 2.0), (2.0, 0.0, 2.0, 2.0), (4.0, 0.0, 2.0, 2.0)]


def cast(faces: list[Face], pose: Array, rays: Array) -> Array:
    """Return the colours (n, 3) that rays (n, 3) from a camera meet: no projection, no buffer."""
    start, directions = pose[:3, 3], rays @ pose[:3, :3].T
    corner, across, down = (
        np.array([getattr(face, name) for face in faces]) for name in ('corner', 'across', 'down')
    )
    out = np.cross(down, across)
    with np.errstate(divide='ignore', invalid='ignore'):
        away = ((out * (corner - start)).sum(axis=1)) / (directions @ out.T)
        at = start + away[..., None] * directions[:, None] - corner
        a = (at * across).sum(axis=-1) / (across * across).sum(axis=1)
        d = (at * down).sum(axis=-1) / (down * down).sum(axis=1)
    # Of a face only the front is seen.
    meets = (directions @ out.T < -1e-12) & (away > 0.05)
    meets &= (a >= 0.0) & (a <= 1.0) & (d >= 0.0) & (d <= 1.0)
    nearest = np.where(meets, away, np.inf).argmin(axis=1)
    colours = np.full((len(rays), 3), (196.0, 198.0, 200.0))
    for ray, index in enumerate(nearest.tolist()):
        if meets[ray, index]:
            face = faces[index]
            left, top, right, bottom = face.crop
            rows, columns = face.texture.shape[:2]
            row = min(int((top + d[ray, index] * (bottom - top)) * rows), rows - 1)
            column = min(int((left + a[ray, index] * (right - left)) * columns), columns - 1)
            colours[ray] = face.texture[row, column] * face.shade
    return colours


@pytest.mark.parametrize(
    ('x', 'y', 'z', 'turn', 'pitch'),
    [
        (1.0, 1.0, 0.9, 0.0, -0.2),
        (2.2, 0.6, 1.4, 2.6, -0.5),
        (4.6, 1.5, 0.4, -2.9, 0.1),
        (0.3, 1.7, 2.2, -0.6, -0.7),
        (3.02, 1.02, 0.5, 1.2, 0.3),
    ],
)
def test_a_picture_shows_what_rays_meet(
    x: float, y: float, z: float, turn: float, pitch: float
) -> None:
    world = two_rooms()
    world.turn_door('D', 50.0)
    for thing in (barrel('b', 1.9, 1.3, 0.2), box('c', 2.4, 0.5, 0.4, 0.4, 0.3, 0.5)):
        world.put(thing)
    world.put(chair('d', 4.0, 0.6, 1.0))
    camera = Camera.from_field_of_view(48, 36, math.radians(70))
    pose = camera_pose(x, y, z, turn, pitch)
    picture = Renderer(world, camera).ideal(pose)
    faces = faces_of(world)
    rng = np.random.default_rng(1)
    columns, rows = rng.integers(0, (48, 36), (150, 2)).T
    offsets = np.array([(right, down) for right in (-0.4, 0.0, 0.4) for down in (-0.4, 0.0, 0.4)])
    points = np.stack([columns, rows], axis=1)[:, None] + offsets
    rays = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2).reshape(-1, 3)
    seen = cast(faces, pose, rays @ np.linalg.inv(camera.matrix).T).reshape(150, 9, 3)
    plain = np.ptp(seen, axis=1).max(axis=1) < 45.0  # no edge runs through the pixel
    differences = np.abs(seen.mean(axis=1) - picture[rows, columns]).max(axis=1)[plain]
    assert len(differences) > 60
    assert np.median(differences) < 3.0
    assert np.percentile(differences, 95) < 10.0
    assert differences.max() < 30.0


def test_the_parts_of_a_thing_are_closed_and_lit_from_one_side() -> None:
    for thing in (box('b', 1.0, 2.0, 0.5, 0.6, 0.4, 0.3), barrel('b', 1.0, 2.0, 0.3)):
        flat = np.zeros(3)
        for face in thing_faces(thing):
            out = np.cross(face.down, face.across)
            middle = np.array([1.0, 2.0, thing.parts[0].top / 2])
            assert out @ (face.middle - middle) > 0.0, 'it faces outwards'
            if abs(out[2]) < 1e-9:
                flat += out
                direction = face.across / np.linalg.norm(face.across)
                assert face.shade == pytest.approx(0.86 + 0.1 * direction[0] + 0.04 * direction[1])
            else:
                assert face.shade == (0.95 if out[2] > 0.0 else 0.6)
        assert flat == pytest.approx(np.zeros(3), abs=1e-9), 'all around'
    (slice_,) = [e for e in person('p', 0.0, 0.0, 0.0).parts if e.top == pytest.approx(1.75)]
    shades = {}
    for face in thing_faces(person('p', 0.0, 0.0, 0.7)):
        if face.corner[2] == pytest.approx(slice_.top) and slice_.shape == Shape.ELLIPSE:
            out = np.cross(face.down, face.across)
            x, y, _ = out / np.linalg.norm(out)
            shades[round(math.atan2(y, x), 6)] = face.shade
            assert face.shade == pytest.approx(0.76 + 0.24 * (0.8 * x + 0.6 * y))
    assert len(shades) == 12
    assert max(shades.values()) == pytest.approx(1.0, abs=0.02)
    assert min(shades.values()) == pytest.approx(0.52, abs=0.02)


def test_where_a_box_a_panel_and_a_station_lie() -> None:
    world = SimulatedPlace.from_parameters(
        changed(markers={'m1': [7.0, 5.94, 1.3, 1.1, math.pi]}, station=[1.0, 1.2, math.pi / 2])
    )
    (panel,) = (each for each in faces_of(world) if each.texture.shape == (240, 240, 3))
    half = 0.2 * 10 / 7 / 2
    # Who looks at it from the west has the north at the left hand.
    assert panel.corner == pytest.approx([5.94, 1.3 + half, 1.1 + half])
    assert panel.corner + panel.across == pytest.approx([5.94, 1.3 - half, 1.1 + half])
    assert panel.corner + panel.down == pytest.approx([5.94, 1.3 + half, 1.1 - half])
    (station,) = (each for each in faces_of(world) if each.texture is textures.station())
    assert station.middle == pytest.approx([1.0, 1.2, 0.004])
    assert station.across == pytest.approx([0.0, 0.6, 0.0])
    assert station.down == pytest.approx([0.6, 0.0, 0.0])
    corners = sorted(
        tuple(np.round((face.corner + face.down)[:2], 6).tolist())
        for face in thing_faces(box('b', 1.0, 2.0, math.pi / 2, 0.6, 0.4, 0.3))
        if abs(face.across[2]) + abs(face.down[0]) + abs(face.down[1]) < 1e-9
    )
    assert corners == [(0.8, 1.7), (0.8, 2.3), (1.2, 1.7), (1.2, 2.3)]


def test_walls_that_are_dark_leave_what_hangs_on_them_as_it_is() -> None:
    world = two_rooms()
    before = seen_faces(faces_of(world))
    world.wall_brightness = 0.5
    after = seen_faces(faces_of(world))
    for key, (area, least, most) in before.items():
        factor = 0.5 if key[0] == 'plaster' else 1.0
        assert after[key] == pytest.approx((area, factor * least, factor * most))
