"""Publishes what the camera sees, on a thread of its own, only while somebody looks."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from sensor_msgs.msg import CameraInfo, Image

from strict_files.settings import parameter
from surveillance_runtime.node import PatrolNode
from surveillance_simulation import conversions
from surveillance_simulation.camera.model import Camera, Conditions, covered, expose
from surveillance_simulation.camera.mujoco_rendering import MujocoRenderer
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.feeds.sensor_feed import SENSOR_DEPTH, topic_of
from surveillance_simulation.robot.robot import Robot


@dataclass(frozen=True)
class CameraOptions:
    """The camera that does not change; units as declared."""

    width: int = parameter(640, 'Columns of a picture.', 16, 4096)
    height: int = parameter(480, 'Rows of a picture.', 16, 4096)
    field_of_view: float = parameter(60.0, 'Horizontal field of view, degrees.', 5.0, 150.0)
    renderer: str = parameter(
        'opencv',
        'What draws the pictures; mujoco adds shadows and needs the package mujoco.',
        choices=('opencv', 'mujoco'),
    )
    rate: float = parameter(10.0, 'Pictures per second at most.', 0.1, 100.0)
    wall_brightness: float = parameter(
        1.0, 'Brightness of the walls: 1 white plaster, 0.2 dark paint.', 0.0, 1.0
    )


class CameraSetup:
    """What a node's parameters say of the cameras of its robots, which are all alike.

    Attributes:
        conditions: Light, noise and blur of the next pictures.
        frame: The name of the camera's frame.
        options: What does not change.
        period: Simulated seconds from picture to picture.
    """

    def __init__(self, node: PatrolNode, frame: str) -> None:
        """Declare the parameters on a node; `frame` is the camera's."""
        self.conditions = node.declare_fields(
            Conditions(), prefix='camera.', on_change=self._take_conditions
        )
        self.frame = frame
        self.options = node.declare_fields(CameraOptions(), prefix='camera.')
        self.period = 1.0 / self.options.rate

    def _take_conditions(self, conditions: Conditions) -> None:
        self.conditions = conditions


class CameraFeed:
    """The topics `camera/rgb/image_raw` and `camera/rgb/camera_info` of a simulated robot."""

    def __init__(
        self,
        node: PatrolNode,
        robot: Robot,
        setup: CameraSetup,
        seed: int,
        changing: Any,
        stamp: Callable[[], Time],
    ) -> None:
        """Create the topics and the thread.

        Args:
            node: The node that publishes.
            robot: The robot that carries the camera.
            setup: What the parameters say of it.
            seed: Seed of the noise.
            changing: Lock that is held while robot or world change.
            stamp: Returns the present time for the pictures.

        Raises:
            PlaceError: A marker's dictionary or id does not exist.
            ImportError: MuJoCo is to render and is not installed.
        """
        self._setup = setup
        self._robot = robot
        options = setup.options
        self._camera = Camera.from_field_of_view(
            options.width, options.height, math.radians(options.field_of_view)
        )
        robot.world.wall_brightness = options.wall_brightness
        take = MujocoRenderer if options.renderer == 'mujoco' else Renderer
        self._renderer: Renderer | MujocoRenderer = take(robot.world, self._camera, robot.name)
        self._next = 0.0
        self._rng = np.random.default_rng(seed)
        self._changing = changing
        self._stamp = stamp
        self._wanted = threading.Semaphore(0)
        self._images = node.create_publisher(
            Image, topic_of(robot, 'camera/rgb/image_raw'), SENSOR_DEPTH
        )
        self._infos = node.create_publisher(
            CameraInfo, topic_of(robot, 'camera/rgb/camera_info'), SENSOR_DEPTH
        )
        self._stopping = node.stopping
        node.stopping.subscribe(self._wanted.release)
        node.spawn(self._work, topic_of(robot, 'camera'))

    @property
    def is_watched(self) -> bool:
        """Whether somebody subscribes to the pictures."""
        return bool(self._images.get_subscription_count())

    def tick(self) -> None:
        """Ask for a picture when it is time for one and somebody looks; never blocks."""
        now = self._robot.time
        if now + 1e-9 < self._next:
            return
        self._next = now + self._setup.period
        self.ask()

    def ask(self) -> None:
        """Ask for a picture if somebody looks; never blocks."""
        if self.is_watched or self._infos.get_subscription_count():
            self._wanted.release()

    def _work(self) -> None:
        while True:
            self._wanted.acquire()
            # Pictures that were asked for while one was drawn are out of date.
            while self._wanted.acquire(blocking=False):
                pass
            if self._stopping.is_set():
                self._renderer.close()
                return
            with self._changing:
                self._renderer.refresh()
                pose = self._robot.camera_pose()
                is_covered = self._robot.lens_covered
                stamp = self._stamp()
            self._infos.publish(
                conversions.camera_info_to_ros(self._camera, self._setup.frame, stamp)
            )
            if self.is_watched:
                scene = self._renderer.ideal(pose)
                if is_covered:
                    scene = covered(scene)
                picture = expose(scene, self._setup.conditions, self._rng)
                self._images.publish(conversions.image_to_ros(picture, self._setup.frame, stamp))
