"""What a simulated place looks like: the same in every run, with faces that hide and are lit.

A robot keeps pictures of its viewpoints over restarts and new versions: a place that looks
otherwise after one is a place in which all has changed. So the looks are held here, in few numbers.
"""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np
import pytest

from surveillance_simulation.camera.model import Array, Camera
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.camera.scene import Face, faces_of, thing_faces
from surveillance_simulation.world import textures
from surveillance_simulation.world.figures import person
from surveillance_simulation.world.simulated_place import SimulatedPlace
from surveillance_simulation.world.textures import Texture
from surveillance_simulation.world.things import Shape, barrel, box, chair

from .places import camera_pose, changed, two_rooms

DICTIONARY = 'DICT_5X5_100'


def looks(texture: Texture) -> tuple[list[float], list[float], list[float]]:
    """Return mean and deviation of each colour, and the means of the quarters, row by row."""
    assert texture.dtype == np.uint8
    rows, columns = texture.shape[0] // 2, texture.shape[1] // 2
    quarters = [
        texture[top : top + rows, left : left + columns].mean()
        for top in (0, rows)
        for left in (0, columns)
    ]
    return [*texture.mean((0, 1))], [*texture.std((0, 1))], quarters


@pytest.mark.parametrize(
    ('texture', 'size', 'means', 'deviations', 'quarters'),
    [
        (
            textures.plaster,
            (384, 384),
            (203.96, 200.90, 191.70),
            (3.82, 3.76, 3.59),
            (201.28, 199.30, 197.46, 197.37),
        ),
        (
            textures.floor,
            (384, 384),
            (145.30, 138.02, 127.81),
            (10.66, 10.13, 9.39),
            (134.82, 137.03, 137.70, 138.62),
        ),
        (
            textures.leaf,
            (384, 384),
            (146.63, 108.19, 72.77),
            (13.03, 11.27, 9.51),
            (109.66, 108.62, 109.63, 108.87),
        ),
        (
            textures.barrel,
            (96, 32),
            (229.5, 138.0, 80.0),
            (6.06, 58.89, 90.07),
            (149.17, 149.17, 149.17, 149.17),
        ),
        (
            textures.station,
            (192, 192),
            (95.09, 99.47, 59.98),
            (76.24, 67.19, 28.38),
            (86.21, 83.20, 86.64, 83.34),
        ),
        (
            lambda: textures.plain((120, 60, 30)),
            (64, 64),
            (119.54, 59.54, 29.54),
            (3.0, 3.0, 3.0),
            (69.41, 69.48, 69.63, 69.65),
        ),
    ],
)
def test_surfaces_look_as_they_always_did(
    texture: Any, size: tuple[int, int], means: Any, deviations: Any, quarters: Any
) -> None:
    drawn = texture()
    assert drawn.shape == (*size, 3)
    assert texture() is drawn or not hasattr(texture, 'cache_info'), 'drawn once'
    found = looks(drawn)
    for values, expected in zip(found, (means, deviations, quarters), strict=True):
        assert values == pytest.approx(expected, abs=0.02)


def test_what_repeats_has_no_seam_and_the_floor_has_joints_between_its_stones() -> None:
    for surface in (textures.plaster(), textures.floor()[48:-48, 48:-48]):
        steps = np.abs(np.diff(surface.astype(float), axis=0)).mean()
        if len(surface) == len(textures.plaster()):
            seam = np.abs(surface[0].astype(float) - surface[-1]).mean()
            assert seam < 1.5 * steps
    floor = textures.floor().astype(float).mean(axis=2)
    for lines in (floor.mean(axis=1), floor.mean(axis=0)):
        joints = [line for line in range(384) if lines[line] < lines.mean() - 20.0]
        assert joints == [0, 1, 96, 97, 192, 193, 288, 289]
        inside = np.delete(lines, joints)
        assert inside.mean() - lines[joints].mean() == pytest.approx(38 * 0.943, abs=2.0)


def test_a_leaf_has_a_handle_at_its_right_and_two_panels() -> None:
    leaf = textures.leaf().astype(int)
    assert leaf[195, 353].tolist() == [200, 200, 190]
    bright = np.argwhere(leaf[..., 2] == 190)
    assert (bright.min(axis=0).tolist(), bright.max(axis=0).tolist()) == ([186, 344], [204, 362])
    lines = np.argwhere((leaf == (96, 66, 40)).all(axis=2))
    assert lines[:, 1].min() == pytest.approx(0.14 * 384, abs=3)
    assert lines[:, 1].max() == pytest.approx(0.86 * 384, abs=3)
    for top, bottom in ((0.08, 0.45), (0.55, 0.93)):
        rows = lines[(lines[:, 0] > top * 384 - 4) & (lines[:, 0] < bottom * 384 + 4), 0]
        assert (rows.min(), rows.max()) == pytest.approx((top * 384, bottom * 384), abs=3)


@pytest.mark.parametrize('number', [0, 7, 99])
def test_a_panel_has_its_marker_in_ink_within_a_cell_and_a_half_of_paper(number: int) -> None:
    cells = 24
    panel = textures.marker_panel(DICTIONARY, number, 'whole')
    assert panel.shape == (10 * cells, 10 * cells, 3)
    assert set(np.unique(panel)) == {22, 228}
    assert textures.panel_share(DICTIONARY) == pytest.approx(10 / 7)
    grey, margin = panel[..., 0], 36
    rim = grey.copy()
    rim[margin:-margin, margin:-margin] = 228
    assert (rim == 228).all(), 'white all around'
    code = grey[margin:-margin, margin:-margin].reshape(7, cells, 7, cells)
    assert (code == code[:, :1, :, :1]).all(), 'each cell is of one colour'
    bits = code[1:6, 0, 1:6, 0] > 100
    frame = np.delete(
        code[:, 0, :, 0].ravel(), [7 * r + c for r in range(1, 6) for c in range(1, 6)]
    )
    assert (frame == 22).all()
    known = textures.aruco_dictionary(DICTIONARY).bytesList[number]
    expected = type(textures.aruco_dictionary(DICTIONARY)).getBitsFromByteList(known[None], 5)
    assert bits.tolist() == (expected > 0).tolist()
    broken = textures.marker_panel(DICTIONARY, number, 'broken')[..., 0]
    torn = broken == 160
    assert torn[0, :200].all()
    assert torn[:165, 0].all()
    assert not torn[170:].any()
    assert not torn[:, 206:].any()
    assert torn.sum() == pytest.approx(0.7 * 240 * 0.85 * 240 / 2, rel=0.02)
    assert (broken[~torn] == grey[~torn]).all()
    covered = textures.marker_panel(DICTIONARY, number, 'covered')[..., 0]
    assert set(np.unique(covered)) == {150, 176}
    assert (np.diag(covered) == 150).all()
    assert (covered == 150).mean() == pytest.approx(4 * math.sqrt(2) / 240, rel=0.3)


SHOE, TROUSERS, SHIRT, SKIN = (44, 38, 36), (58, 68, 104), (150, 62, 60), (214, 168, 138)
HAIR, EYE, LIP = (58, 42, 32), (46, 36, 32), (160, 92, 84)
OUTLINE = [
    # Height, how far it reaches back, ahead and to each side, what of it is seen there.
    (0.01, 0.285, 0.385, 0.158, {SHOE}),
    (0.06, 0.285, 0.385, 0.158, {SHOE, TROUSERS}),
    (0.16, 0.216, 0.216, 0.159, {TROUSERS}),
    (0.26, 0.205, 0.194, 0.167, {TROUSERS}),
    (0.36, 0.190, 0.174, 0.171, {TROUSERS}),
    (0.46, 0.157, 0.155, 0.166, {TROUSERS}),
    (0.56, 0.140, 0.140, 0.172, {TROUSERS}),
    (0.66, 0.130, 0.130, 0.176, {TROUSERS}),
    (0.76, 0.193, 0.288, 0.286, {TROUSERS, SKIN}),
    (0.86, 0.172, 0.248, 0.294, {TROUSERS, SKIN}),
    (0.91, 0.161, 0.219, 0.297, {TROUSERS, SKIN}),
    (0.96, 0.158, 0.206, 0.298, {SHIRT, SKIN}),
    (1.06, 0.144, 0.155, 0.298, {SHIRT, SKIN}),
    (1.16, 0.139, 0.121, 0.293, {SHIRT, SKIN}),
    (1.26, 0.111, 0.124, 0.281, {SHIRT}),
    (1.36, 0.105, 0.106, 0.263, {SHIRT}),
    (1.41, 0.085, 0.085, 0.249, {SHIRT}),
    (1.46, 0.065, 0.065, 0.120, {SHIRT, SKIN}),
    (1.51, 0.049, 0.088, 0.056, {SKIN}),
    (1.565, 0.094, 0.107, 0.067, {SKIN, HAIR, LIP}),
    (1.61, 0.100, 0.1245, 0.081, {SKIN, HAIR}),
    (1.64, 0.101, 0.108, 0.083, {SKIN, HAIR, EYE}),
    (1.66, 0.101, 0.108, 0.083, {SKIN, HAIR, EYE}),
    (1.70, 0.092, 0.101, 0.080, {SKIN, HAIR}),
    (1.74, 0.0575, 0.0585, 0.051, {HAIR}),
]


def test_a_person_has_the_outline_of_one_in_mid_step() -> None:
    parts = person('p', 0.0, 0.0, 0.0).parts
    assert min(each.bottom for each in parts) == 0.0
    assert max(each.top for each in parts) == pytest.approx(1.75)
    for height, back, ahead, side, colours in OUTLINE:
        there = [each for each in parts if each.bottom <= height < each.top]
        assert {each.colour for each in there} == colours, height
        assert -min(e.x - e.length / 2 for e in there) == pytest.approx(back, abs=4e-3), height
        assert max(e.x + e.length / 2 for e in there) == pytest.approx(ahead, abs=4e-3), height
        for reach in (
            -min(e.y - e.width / 2 for e in there),
            max(e.y + e.width / 2 for e in there),
        ):
            assert reach == pytest.approx(side, abs=4e-3), height
    face = [(e.y, e.width, e.bottom) for e in parts if e.shape == Shape.BOX and e.bottom > 1.5]
    assert sorted(face) == sorted((-y, *rest) for y, *rest in face), 'two like halves'
    # The left foot is ahead, and the right hand.
    left_shoe = next(each for each in parts if each.colour == SHOE and each.y > 0)
    assert (left_shoe.x, left_shoe.y) == (0.25, 0.11)
    hands = {each.y > 0: each.x for each in parts if each.colour == SKIN and each.bottom < 0.76}
    assert hands[False] > 0.2 > 0.0 > -0.1 > hands[True]


def test_a_person_is_made_of_slices_that_lie_on_each_other() -> None:
    parts = person('p', 0.0, 0.0, 0.0).parts
    slices = [each for each in parts if each.shape == Shape.ELLIPSE]
    assert len(slices) == 146
    stacks: dict[Any, list[Any]] = defaultdict(list)
    for each in slices:
        stacks[each.colour, np.sign(each.y)].append(each)
    for stack in stacks.values():
        for below in stack:
            assert 0.01 < below.top - below.bottom < 0.051
            top = max(each.top for each in stack)
            assert below.top > top - 0.2 or any(
                each.bottom <= below.top + 1e-9 < each.top for each in stack
            ), 'no gap'
    # What the lidar meets: two shanks, where it looks for legs.
    cut = [each for each in parts if each.is_cut]
    assert sorted((round(e.x, 2), round(e.y, 2)) for e in cut) == [(-0.16, -0.11), (0.16, 0.11)]
    assert all(0.09 < (each.length + each.width) / 2 < 0.12 for each in cut)


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
