"""The same pictures from MuJoCo, with its light and shadows; an extra that needs `mujoco`.

Without a display MuJoCo renders through EGL, on a CPU too. Takes the place of `rendering.Renderer`
wherever a picture is wanted.
"""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
import numpy.typing as npt

from surveillance_runtime.place import boxes
from surveillance_runtime.place.floor_plan import WALL_HEIGHT, WALL_THICKNESS, Door
from surveillance_runtime.place.plan_grid import solid_lines
from surveillance_simulation.camera.model import Array, Camera
from surveillance_simulation.camera.scene import DOOR_HEIGHT, OBSTACLE_HEIGHT, STATION_SIDE
from surveillance_simulation.world import textures
from surveillance_simulation.world.textures import Texture
from surveillance_simulation.world.world import Panel, World

if not os.environ.get('DISPLAY'):
    # Read when mujoco is imported.
    os.environ.setdefault('MUJOCO_GL', 'egl')
try:
    import mujoco
except ImportError:
    mujoco = None

_PANEL_THICKNESS = 0.004


class MujocoRenderer:
    """Takes pictures of one world with one camera. All pictures must be taken in one thread."""

    def __init__(self, world: World, camera: Camera) -> None:
        """Prepare pictures.

        Raises:
            ImportError: MuJoCo is not installed.
            PlaceError: A marker's dictionary or id does not exist.
        """
        if mujoco is None:
            raise ImportError("renderer 'mujoco': expected the package mujoco (pip install mujoco)")
        self._world = world
        self._camera = camera
        self._version = -1
        self._model: Any = None
        self._renderer: Any = None
        self._drawn: Any = None
        self.refresh()

    def refresh(self) -> None:
        """Take over what has changed in the world since the last time."""
        if self._version != self._world.version:
            self._model = _model(self._world, self._camera)
            self._version = self._world.version

    def close(self) -> None:
        """Free the graphics context; in the thread that took the pictures."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = self._drawn = None

    def ideal(self, camera_pose: Array) -> npt.NDArray[np.float32]:
        """Return the picture of the world as `rendering.Renderer.ideal` does."""
        if self._drawn is not self._model:
            # A graphics context belongs to a thread: it is made in the one that draws.
            self.close()
            size = (self._camera.height, self._camera.width)
            self._renderer = mujoco.Renderer(self._model, *size)
            self._drawn = self._model
        # MuJoCo's camera looks along -z with y up.
        turn = camera_pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, turn.ravel())
        self._model.cam_pos[0] = camera_pose[:3, 3]
        self._model.cam_quat[0] = quaternion
        data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, data)
        self._renderer.update_scene(data, camera=0)
        return np.asarray(self._renderer.render(), dtype=np.float32)


def _model(world: World, camera: Camera) -> Any:
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = camera.width, camera.height
    spec.visual.headlight.ambient = [0.6, 0.6, 0.6]
    spec.visual.headlight.diffuse = [0.25, 0.25, 0.25]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
    spec.visual.map.znear = 0.002
    spec.worldbody.add_camera(fovy=math.degrees(2 * math.atan(camera.height / 2 / camera.focal)))
    west, south, east, north = world.plan.bounds
    spec.worldbody.add_light(
        pos=[(west + east) / 2, (south + north) / 2, 12.0],
        dir=[0.15, 0.1, -1.0],
        diffuse=[0.55, 0.55, 0.55],
        specular=[0.0, 0.0, 0.0],
    )
    spec.add_texture(
        name='ceiling',
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=[0.77, 0.78, 0.79],
        width=16,
        height=16,
    )
    _floor(spec, (west, south, east, north))
    plaster = (textures.plaster() * world.wall_brightness).astype(np.uint8)
    _material(spec, 'plaster', plaster, mujoco.mjtTexture.mjTEXTURE_CUBE)
    _material(spec, 'leaf', textures.leaf(), mujoco.mjtTexture.mjTEXTURE_CUBE)
    for start, end in solid_lines(world.plan):
        _box(spec, start, end, 0.0, WALL_HEIGHT, 'plaster')
    for door in world.plan.doors.values():
        _door(spec, door, is_open=world.is_open(door.name))
    for obstacle in world.obstacles.values():
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[obstacle.radius, OBSTACLE_HEIGHT / 2, 0.0],
            pos=[obstacle.x, obstacle.y, OBSTACLE_HEIGHT / 2],
            rgba=[0.88, 0.41, 0.11, 1.0],
        )
    for name, panel in world.panels.items():
        _panel(spec, name, panel, world.plan.marker_dictionary)
    _material(spec, 'station', textures.station(), mujoco.mjtTexture.mjTEXTURE_CUBE)
    for station in world.plan.stations.values():
        x, y, yaw = station.pose
        _add_box(spec, (x, y, 0.002), yaw, (STATION_SIDE / 2, STATION_SIDE / 2, 0.002), 'station')
    return spec.compile()


def _floor(spec: Any, bounds: tuple[float, float, float, float]) -> None:
    west, south, east, north = bounds
    _material(spec, 'floor', textures.floor(), mujoco.mjtTexture.mjTEXTURE_2D)
    material = spec.material('floor')
    material.texrepeat = [1.0 / textures.TILE, 1.0 / textures.TILE]
    material.texuniform = True
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[(east - west) / 2, (north - south) / 2, 1.0],
        pos=[(west + east) / 2, (south + north) / 2, 0.0],
        material='floor',
    )


def _material(spec: Any, name: str, picture: Texture, kind: Any) -> None:
    """Add a material that shows a square picture upright on each side of a box, or repeats it."""
    rows = picture
    if kind == mujoco.mjtTexture.mjTEXTURE_CUBE:
        # In the order +x, -x, +y, -y, +z, -z, each turned so that it stands upright when z is up.
        rows = np.concatenate([np.rot90(picture, turns) for turns in (1, -1, 2, 0, 0, 0)])
    texture = spec.add_texture(
        name=name, type=kind, width=rows.shape[1], height=rows.shape[0], nchannel=3
    )
    texture.data = np.ascontiguousarray(rows).tobytes()
    material = spec.add_material(name=name, specular=0.0, shininess=0.0)
    names = list(material.textures)
    names[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    material.textures = names


def _box(
    spec: Any,
    start: tuple[float, float],
    end: tuple[float, float],
    bottom: float,
    top: float,
    material: str,
) -> None:
    x, y, cos, sin, along, across = boxes.boxes_around([(start, end)], WALL_THICKNESS)[0]
    centre = (float(x), float(y), (bottom + top) / 2)
    size = (float(along), float(across), (top - bottom) / 2)
    _add_box(spec, centre, math.atan2(sin, cos), size, material)


def _door(spec: Any, door: Door, *, is_open: bool) -> None:
    _box(spec, *door.ends, DOOR_HEIGHT, WALL_HEIGHT, 'plaster')
    if not is_open:
        _box(spec, *door.ends, 0.0, DOOR_HEIGHT, 'leaf')


def _panel(spec: Any, name: str, panel: Panel, dictionary: str) -> None:
    marker = panel.marker
    picture = textures.marker_panel(dictionary, marker.id, panel.state)
    _material(spec, f'marker {name}', picture, mujoco.mjtTexture.mjTEXTURE_CUBE)
    half = marker.size * textures.panel_share(dictionary) / 2
    size = (_PANEL_THICKNESS / 2, half, half)
    _add_box(spec, (marker.x, marker.y, marker.z), marker.yaw, size, f'marker {name}')


def _add_box(
    spec: Any,
    centre: tuple[float, float, float],
    yaw: float,
    size: tuple[float, float, float],
    material: str,
) -> None:
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=list(size),
        pos=list(centre),
        quat=[math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)],
        material=material,
    )
