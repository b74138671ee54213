"""Perspective pictures of a world: each face warped by its homography into one depth buffer.

The picture is drawn at a multiple of its size and averaged down. Textures are shrunk to about the
size they appear in before they are warped, so that distant ones do not flicker (a mipmap). Which
face is in front is decided pixel by pixel from the inverse depth, which is linear in the picture.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from surveillance_simulation.camera.lamps import LampLight
from surveillance_simulation.camera.model import Array, Camera, Picture
from surveillance_simulation.camera.scene import Face, faces_of, thing_faces
from surveillance_simulation.world.simulated_place import SimulatedPlace
from surveillance_simulation.world.textures import Texture

_NEAR = 0.03
"""What is nearer to the lens than this is not seen, metres."""
_FINER = 2
"""A picture is drawn at this multiple of its resolution."""

_CEILING = (196.0, 198.0, 200.0)


class Renderer:
    """Takes pictures of one world with one camera, keeping what does not change between them."""

    def __init__(self, world: SimulatedPlace, camera: Camera, robot: str = '') -> None:
        """Prepare pictures.

        Args:
            world: What is seen.
            camera: What sees.
            robot: The robot that carries it, which is not in its own pictures.

        Raises:
            PlaceError: A marker's dictionary or id does not exist.
        """
        self._world = world
        self._camera = camera
        self._robot = robot
        matrix = camera.matrix
        matrix[:2] *= _FINER
        # The centre of pixel 0 stays the centre of the block of fine pixels that it is made of.
        matrix[:2, 2] += (_FINER - 1) / 2
        self._matrix = matrix
        self._inverse = np.linalg.inv(matrix)
        self._size = (camera.width * _FINER, camera.height * _FINER)
        self._standing: list[Face] = []
        self._faces: list[Face] = []
        self._version = -1
        self._lamps: LampLight | None = None
        self._shrunk: dict[tuple[int, int, int], Texture] = {}
        self.refresh()

    def refresh(self) -> None:
        """Take over what has changed in the world since the last time.

        Raises:
            PlaceError: A marker's dictionary or id does not exist.
        """
        if self._version != self._world.drawn_version:
            self._standing = faces_of(self._world)
            self._version = self._world.drawn_version
            self._shrunk.clear()
        movers = self._world.movers(self._robot)
        self._faces = self._standing + [face for each in movers for face in thing_faces(each)]
        self._lamps = LampLight.of(self._world, self._lamps)

    def close(self) -> None:
        """Free what the pictures needed: nothing but memory."""

    def ideal(self, camera_pose: Array) -> npt.NDArray[np.float32]:
        """Return the picture of the world as it was at `refresh`, before light, noise and blur.

        Args:
            camera_pose: Transform (4, 4) from the camera's optical frame to the world, metres.

        Returns:
            (rows, columns, 3) in RGB; `expose` makes of it what a camera takes.
        """
        width, height = self._size
        colours = np.empty((height, width, 3), np.uint8)
        colours[:] = _CEILING
        nearness = np.zeros((height, width), np.float32)
        to_camera: Array = np.linalg.inv(camera_pose).astype(np.float64)
        # What is near is drawn first: most of what it hides is then never warped.
        faces = self._facing(camera_pose)
        middles = np.array([face.middle for face in faces]).reshape(-1, 3) - camera_pose[:3, 3]
        for index in np.argsort(np.linalg.norm(middles, axis=1)):
            self._draw(faces[index], to_camera, colours, nearness)
        small = cv2.resize(
            colours,
            (self._camera.width, self._camera.height),
            interpolation=cv2.INTER_AREA,
        )
        picture = np.asarray(small, dtype=np.float32)
        if self._lamps is None:
            return picture
        return self._lamps.shine(picture, nearness[::_FINER, ::_FINER], self._camera, camera_pose)

    def _facing(self, camera_pose: Array) -> list[Face]:
        """Return the faces that turn their front to a camera and lie ahead of it, as a whole."""
        corners, across, down = (
            np.array([getattr(face, side) for face in self._faces]).reshape(-1, 3)
            for side in ('corner', 'across', 'down')
        )
        offsets = corners - camera_pose[:3, 3]
        fronts = np.einsum('ni,ni->n', np.cross(down, across), offsets) < 0.0
        depth, wide, high = (each @ camera_pose[:3, 2] for each in (offsets, across, down))
        deepest = depth + np.maximum(wide, 0.0) + np.maximum(high, 0.0)
        return [self._faces[index] for index in np.flatnonzero(fronts & (deepest > _NEAR))]

    def _draw(
        self, face: Face, to_camera: Array, colours: Picture, nearness: npt.NDArray[np.float32]
    ) -> None:
        turn = to_camera[:3, :3]
        corner = turn @ face.corner + to_camera[:3, 3]
        across, down = turn @ face.across, turn @ face.down
        normal = np.cross(down, across)
        distance = float(normal @ corner)
        if distance >= 0:
            return
        outline = _in_front(
            np.array([corner, corner + across, corner + across + down, corner + down])
        )
        if len(outline) < 3:
            return
        seen = outline @ self._matrix.T
        seen = seen[:, :2] / seen[:, 2:]
        low = np.maximum(np.floor(seen.min(axis=0)), 0).astype(int)
        high = np.minimum(np.ceil(seen.max(axis=0)) + 1, self._size).astype(int)
        if (high <= low).any():
            return
        part = (slice(low[1], high[1]), slice(low[0], high[0]))
        size = (int(high[0] - low[0]), int(high[1] - low[1]))
        mask = np.zeros((size[1], size[0]), np.uint8)
        # Four bits after the point: edges are placed to a sixteenth of a fine pixel.
        polygon = np.rint((seen - low) * 16).clip(-(2**20), 2**20).astype(np.int32)
        cv2.fillConvexPoly(mask, polygon, 255, shift=4)
        plane = (normal @ self._inverse) / distance
        columns = (plane[0] * np.arange(low[0], high[0]) + plane[2]).astype(np.float32)
        rows = (plane[1] * np.arange(low[1], high[1])).astype(np.float32)
        inverse_depth = rows[:, None] + columns
        before = nearness[part]
        cv2.bitwise_and(mask, cv2.compare(inverse_depth, before, cv2.CMP_GT), mask)
        if not cv2.countNonZero(mask):
            return
        texture = self._texture(face, seen)
        rows_of_texture, columns_of_texture = texture.shape[:2]
        left, top, right, bottom = face.crop
        # From the texture's pixels to metres on the face, then to the picture.
        scale_x = 1.0 / ((right - left) * columns_of_texture)
        scale_y = 1.0 / ((bottom - top) * rows_of_texture)
        origin = (
            corner
            + across * ((0.5 - left * columns_of_texture) * scale_x)
            + down * ((0.5 - top * rows_of_texture) * scale_y)
        )
        homography = self._matrix @ np.column_stack([across * scale_x, down * scale_y, origin])
        homography[:2] -= low[:, None] * homography[2]
        drawn = cv2.warpPerspective(
            texture, homography, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        if face.shade != 1.0:
            drawn = cv2.convertScaleAbs(drawn, alpha=face.shade)
        cv2.copyTo(drawn, mask, colours[part])
        cv2.copyTo(inverse_depth, mask, before)

    def _texture(self, face: Face, seen: Array) -> Texture:
        """Return the face's texture, shrunk to about the size at which it is seen."""
        texture = face.texture
        rows, columns = texture.shape[:2]
        left, top, right, bottom = face.crop
        if len(seen) == 4:
            edges = np.linalg.norm(np.roll(seen, -1, axis=0) - seen, axis=1)
            wide, high = max(edges[0], edges[2]), max(edges[1], edges[3])
            halvings_x = _halvings((right - left) * columns, wide)
            halvings_y = _halvings((bottom - top) * rows, high)
        else:
            # Cut off by the lens: it is near, at least partly.
            halvings_x = halvings_y = 0
        if not halvings_x and not halvings_y:
            return texture
        key = (id(texture), halvings_x, halvings_y)
        if key not in self._shrunk:
            size = (max(1, columns >> halvings_x), max(1, rows >> halvings_y))
            shrunk = cv2.resize(texture, size, interpolation=cv2.INTER_AREA)
            self._shrunk[key] = np.asarray(shrunk, np.uint8)
        return self._shrunk[key]


def _halvings(texels: float, pixels: float) -> int:
    """Return how often a side can be halved and still has a texel for each pixel."""
    count = 0
    while texels >= 2.0 * pixels and texels >= 4.0:
        texels /= 2.0
        count += 1
    return count


def _in_front(outline: Array) -> Array:
    """Return the part of a convex polygon (n, 3) in front of the lens (Sutherland-Hodgman)."""
    depths = outline[:, 2] - _NEAR
    if (depths > 0).all():
        return outline
    kept = []
    for index in range(len(outline)):
        here, there = outline[index - 1], outline[index]
        before, after = depths[index - 1], depths[index]
        if (before > 0) != (after > 0):
            kept.append(here + (there - here) * (before / (before - after)))
        if after > 0:
            kept.append(there)
    return np.array(kept).reshape(-1, 3)
