"""Images of marker panels with known truth, for measuring a detector against one's own camera.

A panel (a white sheet with an ArUco marker in its middle) is warped by its exact homography into
a supersampled patch, averaged down to pixels, and put in front of a backdrop. What a lens and a
sensor do to it (`Degradation`) comes last. Every random number comes from the caller's generator.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from marker_detection.camera_model import Array, CameraModel
from marker_detection.testing.image_effects import glare, shadow, streak, vignette

ImageArray = npt.NDArray[np.uint8]

_SUPERSAMPLING = 8
_STRIPS = 24
_WHITE, _BLACK = 225.0, 25.0


@dataclass(frozen=True)
class Panel:
    """A marker on a white sheet, seen from a camera.

    Attributes:
        marker_id: Id within the dictionary.
        distance: Metres from the camera to the marker's centre.
        turn: Angle in radians between the panel's normal and the line of sight.
        size: Side of the marker's black square in metres.
        axis: Direction in the image of the axis it is turned about (pi/2: vertical).
        roll: Rotation about the line of sight, radians.
        offset: Pixel of the marker's centre, from the image's centre.
        margin: White border in cells of the marker.
        curl: Angle in radians over which the sheet's width is bent about its vertical middle line,
            as paper that comes off a wall.
    """

    marker_id: int
    distance: float
    turn: float = 0.0
    size: float = 0.2
    axis: float = math.pi / 2
    roll: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    margin: float = 1.5
    curl: float = 0.0


@dataclass(frozen=True)
class Shadow:
    """A straight shadow edge: one side of it is darker.

    Attributes:
        through: Pixel (x, y) that the edge runs through.
        direction: Angle in radians of the normal that points to the dark side.
        brightness: Factor on the dark side.
        softness: Standard deviation in pixels of the edge's width; 0 is hard.
    """

    through: tuple[float, float]
    direction: float
    brightness: float = 0.5
    softness: float = 0.0


@dataclass(frozen=True)
class Glare:
    """A reflection that adds light in a round spot.

    Attributes:
        centre: Pixel (x, y) of its middle.
        deviation: Standard deviation in pixels.
        strength: Grey levels added in the middle.
    """

    centre: tuple[float, float]
    deviation: float
    strength: float = 255.0


@dataclass(frozen=True)
class Degradation:
    """What happens between the scene and the pixel values.

    Attributes:
        blur: Standard deviation of the lens blur in pixels.
        motion: Length in pixels of a motion streak, and `direction` its angle in radians.
        light: Factor on the brightness before the sensor (0.1: a dark room, 3: overexposed).
        slope: Brightness falls from 1 + slope on the left to 1 - slope on the right.
        noise: Standard deviation of the sensor's noise in grey levels.
        shadows: Shadow edges across the image.
        glares: Reflections.
        vignette: Share of the brightness that the corners lack.
        shutter: Pixels by which the lowest row is shifted against the top one, because a rolling
            shutter reads it later in a pan.
        jpeg: Quality of a JPEG compression, 1 to 100; 0 for none.
    """

    blur: float = 0.5
    motion: float = 0.0
    direction: float = 0.0
    light: float = 1.0
    slope: float = 0.0
    noise: float = 2.0
    shadows: tuple[Shadow, ...] = ()
    glares: tuple[Glare, ...] = ()
    vignette: float = 0.0
    shutter: float = 0.0
    jpeg: int = 0


def corners_in_camera(panel: Panel, camera: CameraModel) -> Array:
    """Marker corners (4, 3) in metres in the optical frame, clockwise from the top left one."""
    return _panel_points(panel, camera, panel.size / 2.0)


def corners_in_image(panel: Panel, camera: CameraModel) -> Array:
    """Marker corners (4, 2) in pixels, clockwise from the marker's own top left one."""
    return camera.project(corners_in_camera(panel, camera))


def image_of(
    panels: list[Panel],
    camera: CameraModel,
    dictionary: cv2.aruco.Dictionary,
    backdrop: npt.NDArray[np.float32],
    degradation: Degradation,
    generator: np.random.Generator,
) -> ImageArray:
    """Return a grey image (height, width) of the panels in front of a backdrop."""
    scene = backdrop.copy()
    for panel in sorted(panels, key=lambda each: -each.distance):
        _paste(scene, panel, camera, dictionary)
    return degrade(scene, degradation, generator)


def degrade(
    scene: npt.NDArray[np.float32], degradation: Degradation, generator: np.random.Generator
) -> ImageArray:
    """Light, lens, motion and sensor applied to a scene of grey levels."""
    result = _lit(scene, degradation)
    if degradation.shutter:
        rows = scene.shape[0]
        lean = np.array([[1.0, degradation.shutter / rows, -degradation.shutter / 2], [0, 1, 0]])
        size = (scene.shape[1], rows)
        leant = cv2.warpAffine(result, lean, size, borderMode=cv2.BORDER_REPLICATE)
        result = np.asarray(leant, np.float32)
    if degradation.blur > 0:
        result = np.asarray(cv2.GaussianBlur(result, (0, 0), degradation.blur), np.float32)
    if degradation.motion > 1:
        path = streak(degradation.motion, degradation.direction)
        result = np.asarray(cv2.filter2D(result, -1, path), np.float32)
    if degradation.slope:
        ramp = np.linspace(1 + degradation.slope, 1 - degradation.slope, scene.shape[1])
        result = result * ramp.astype(np.float32)
    result = result * degradation.light
    if degradation.noise > 0:
        grain = generator.standard_normal(result.shape, dtype=np.float32)
        result = result + np.float32(degradation.noise) * grain
    pixels = np.asarray(np.clip(np.rint(result), 0, 255), dtype=np.uint8)
    if degradation.jpeg:
        quality = (cv2.IMWRITE_JPEG_QUALITY, degradation.jpeg)
        packed = cv2.imencode('.jpg', pixels, quality)[1]
        pixels = np.asarray(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
    return pixels


def _lit(scene: npt.NDArray[np.float32], degradation: Degradation) -> npt.NDArray[np.float32]:
    shape = scene.shape[0], scene.shape[1]
    for each in degradation.shadows:
        scene = scene * shadow(shape, each.through, each.direction, each.brightness, each.softness)
    if degradation.vignette:
        scene = scene * vignette(shape, degradation.vignette)
    for spot in degradation.glares:
        scene = scene + glare(shape, spot.centre, spot.deviation, spot.strength)
    return scene


def _panel_points(panel: Panel, camera: CameraModel, half: float) -> Array:
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float) * half
    return _in_camera(panel, camera, square)


def _in_camera(panel: Panel, camera: CameraModel, points: Array) -> Array:
    """Return points (n, 3) of the panel, x right, y down, in the optical frame, metres."""
    axis = np.array([math.cos(panel.axis), math.sin(panel.axis), 0.0]) * panel.turn
    turned = cv2.Rodrigues(axis)[0] @ cv2.Rodrigues(np.array([0.0, 0.0, panel.roll]))[0]
    principal = np.array([camera.matrix[0, 2], camera.matrix[1, 2]])
    pixel = np.array([*(principal + panel.offset), 1.0])
    sight = np.linalg.inv(camera.matrix) @ pixel
    sight /= np.linalg.norm(sight)
    # the panel faces the camera along the line of sight, so `turn` means the same everywhere
    right = np.cross([0.0, 1.0, 0.0], sight)
    right /= np.linalg.norm(right)
    facing = np.column_stack([right, np.cross(sight, right), sight])
    bent = _curled(points, panel.curl, panel.size)
    return np.asarray(bent @ (facing @ turned).T + sight * panel.distance)


def _curled(points: Array, curl: float, size: float) -> Array:
    """Return points of a sheet bent about its vertical middle line: `curl` radians over the
    marker.
    """
    if not curl:
        return points
    radius = size / curl
    angle = points[:, 0] / radius
    return np.column_stack(
        [radius * np.sin(angle), points[:, 1], points[:, 2] + radius * (1.0 - np.cos(angle))]
    )


def _paste(
    scene: npt.NDArray[np.float32],
    panel: Panel,
    camera: CameraModel,
    dictionary: cv2.aruco.Dictionary,
) -> None:
    cells = dictionary.markerSize + 2
    half = panel.size * (1.0 + 2.0 * panel.margin / cells) / 2.0
    strips = 1 if not panel.curl else _STRIPS
    edges = np.linspace(-half, half, strips + 1)
    outlines = []
    for left, right in itertools.pairwise(edges):
        flat = np.array([[left, -half, 0], [right, -half, 0], [right, half, 0], [left, half, 0]])
        outlines.append(camera.project(_in_camera(panel, camera, flat)))
    points = np.concatenate(outlines)
    low = np.maximum(np.floor(points.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(points.max(axis=0)).astype(int) + 2, [scene.shape[1], scene.shape[0]])
    width, height = (high - low).tolist()
    if width <= 0 or height <= 0:
        return
    extent = float(np.ptp(points, axis=0).max())
    factor = _SUPERSAMPLING if extent < 120 else 3
    texture = _sheet(panel, dictionary, min(64, max(4, round(extent * factor / cells))))
    size = texture.shape[0]
    shape = (width * factor, height * factor)
    fine = np.zeros(shape[::-1], np.float32)
    cover = np.zeros_like(fine)
    for index, outline in enumerate(outlines):
        start, end = size * index / strips, size * (index + 1) / strips
        source = np.array([[start, 0], [end, 0], [end, size], [start, size]], np.float32) - 0.5
        target = ((outline - low + 0.5) * factor - 0.5).astype(np.float32)
        homography = cv2.getPerspectiveTransform(source, target)
        seen = cv2.warpPerspective(texture, homography, shape, flags=cv2.INTER_LINEAR)
        if strips == 1:
            share = cv2.warpPerspective(np.ones_like(texture), homography, shape)
        else:
            share = np.zeros_like(fine)
            cv2.fillConvexPoly(share, np.rint(target).astype(np.int32), 1.0)
            seen = seen * share
        fine = np.where(share > 0, seen, fine) if strips > 1 else seen
        cover = np.maximum(cover, share)
    grey = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
    share = cv2.resize(cover, (width, height), interpolation=cv2.INTER_AREA)
    part = scene[low[1] : high[1], low[0] : high[0]]
    part[:] = part * (1.0 - share) + grey


def _sheet(panel: Panel, dictionary: cv2.aruco.Dictionary, cell: int) -> npt.NDArray[np.float32]:
    cells = dictionary.markerSize + 2
    margin = round(panel.margin * cell)
    sheet = np.full((cells * cell + 2 * margin,) * 2, _WHITE, np.float32)
    marker = cv2.aruco.generateImageMarker(dictionary, panel.marker_id, cells * cell)
    inner = slice(margin, margin + cells * cell)
    sheet[inner, inner] = np.where(marker > 127, _WHITE, _BLACK)
    return sheet
