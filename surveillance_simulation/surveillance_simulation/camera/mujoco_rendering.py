"""The same pictures from MuJoCo, with its light and shadows; an extra that needs `mujoco`.

Without a display MuJoCo renders through EGL, on a CPU too. Takes the place of `rendering.Renderer`
wherever a picture is wanted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from floor_plans import Door, shapes
from floor_plans.shapes import WALL_HEIGHT, WALL_THICKNESS
from surveillance_simulation.camera.lamps import LampLight
from surveillance_simulation.camera.model import Array, Camera
from surveillance_simulation.camera.scene import DOOR_HEIGHT, STATION_SIDE
from surveillance_simulation.mujoco_bodies import about_z, add_thing
from surveillance_simulation.optional_mujoco import mujoco
from surveillance_simulation.world import textures
from surveillance_simulation.world.simulated_place import (
    LEAF_THICKNESS,
    MarkerPanel,
    SimulatedPlace,
)
from surveillance_simulation.world.textures import Texture
from surveillance_simulation.world.things import Part, Thing

_PANEL_THICKNESS = 0.004
_FURTHEST = 500.0
"""What the depth of a pixel is less than, metres, unless it shows the ceiling."""


class MujocoRenderer:
    """Takes pictures of one world with one camera. All pictures must be taken in one thread."""

    def __init__(self, world: SimulatedPlace, camera: Camera, robot: str = '') -> None:
        """Prepare pictures.

        Args:
            world: What is seen.
            camera: What sees.
            robot: The robot that carries it, which is not in its own pictures.

        Raises:
            ImportError: MuJoCo is not installed.
            PlaceError: A marker's dictionary or id does not exist.
        """
        if mujoco is None:
            raise ImportError("renderer 'mujoco': expected the package mujoco (pip install mujoco)")
        self._world = world
        self._camera = camera
        self._robot = robot
        self._version = -1
        self._model: Any = None
        self._renderer: Any = None
        self._drawn: Any = None
        self._movers: tuple[Thing, ...] = ()
        self._lamps: LampLight | None = None
        self.refresh()

    def refresh(self) -> None:
        """Take over what has changed in the world since the last time."""
        movers = self._world.movers(self._robot)
        # Who stands still stands otherwise than who walks: all are placed anew for each picture.
        if self._version != self._world.drawn_version or len(movers) != len(self._movers):
            self._model = _model(self._world, self._camera, movers)
            self._version = self._world.drawn_version
        self._movers = movers
        self._lamps = LampLight.of(self._world, self._lamps)

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
        for body, each in enumerate(self._movers, start=1):  # body 0 is the world
            self._model.body_pos[body] = each.x, each.y, 0.0
            self._model.body_quat[body] = about_z(each.yaw)
        data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, data)
        self._renderer.update_scene(data, camera=0)
        picture = np.asarray(self._renderer.render(), dtype=np.float32)
        if self._lamps is None:
            return picture
        self._renderer.enable_depth_rendering()
        depth = np.asarray(self._renderer.render(), np.float32)
        self._renderer.disable_depth_rendering()
        nearness = np.where(depth < _FURTHEST, 1.0 / np.maximum(depth, 1e-3), 0.0)
        return self._lamps.shine(picture, nearness.astype(np.float32), self._camera, camera_pose)


def _model(world: SimulatedPlace, camera: Camera, movers: Sequence[Thing]) -> Any:
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
    for start, end in world.plan.solid_lines():
        _box(spec, start, end, 0.0, WALL_HEIGHT, 'plaster')
    for door in world.plan.doors.values():
        _door(spec, door, world)
    for thing in world.things.values():
        if thing.kind != 'person':
            add_thing(spec.worldbody, thing, _painted)
    for each in movers:
        add_thing(spec.worldbody.add_body(), each.moved(0.0, 0.0, 0.0), _painted)
    for name, panel in world.panels.items():
        if panel.state != 'gone':
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
    thickness: float = WALL_THICKNESS,
) -> None:
    x, y, cos, sin, along, across = shapes.boxes_around([(start, end)], thickness)[0]
    centre = (float(x), float(y), (bottom + top) / 2)
    size = (float(along), float(across), (top - bottom) / 2)
    _add_box(spec, centre, math.atan2(sin, cos), size, material)


def _door(spec: Any, door: Door, world: SimulatedPlace) -> None:
    _box(spec, *door.ends, DOOR_HEIGHT, WALL_HEIGHT, 'plaster')
    if (leaf := world.leaf(door.name)) is not None:
        thickness = LEAF_THICKNESS if world.door_angle(door.name) else WALL_THICKNESS
        _box(spec, *leaf, 0.0, DOOR_HEIGHT, 'leaf', thickness)


def _painted(part: Part) -> dict[str, Any]:
    return {'rgba': [*(each / 255 for each in part.colour), 1.0]}


def _panel(spec: Any, name: str, panel: MarkerPanel, dictionary: str) -> None:
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
        quat=about_z(yaw),
        material=material,
    )
