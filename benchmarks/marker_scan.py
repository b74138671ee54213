#!/usr/bin/env python3
"""The first scan of the marker patrol under each light of the simulated camera, without ROS.

    python benchmarks/marker_scan.py [--quick] [--seeds 3]

The robot stands where the marker patrol begins; arm, camera, detector and scan are the nodes' own
cores. Time is simulated: the arm's trajectories and one picture each 0.1 s. Of the time that the
nodes take for messages nothing is counted.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.sizes import sized_parser
from marker_detection import MarkerStream, StreamSettings
from surveillance_behaviour.map_from_markers.assembly import PlaceNote, SurveyReport
from surveillance_behaviour.map_from_markers.initial_scan import InitialScan
from surveillance_perception.arm.scan import ScanPlan, aim_at, from_nearer_end
from surveillance_perception.arm.trajectory import ArmState, motion_to
from surveillance_perception.marker_registry import read_registry
from surveillance_runtime.robot_arm import ARM
from surveillance_simulation import Camera, Conditions, Renderer, read_simulated_place
from surveillance_simulation.camera.model import LIGHTINGS, expose

CONFIG = Path(__file__).resolve().parents[1] / 'config'
PICTURE_PERIOD, PICTURES = 0.1, 6
"""Seconds from picture to picture, and pictures that are looked at where the arm rests."""
PANS = (math.pi / 2, 0.0, -math.pi / 2, math.pi)
"""The arm's poses 1 to 4, rad."""


class ArmCamera:
    """A simulated arm and camera with the real detector.

    Attributes:
        now: Simulated time, seconds.
        found: Place of each marker that was confirmed, and when.
    """

    def __init__(self, conditions: Conditions, wall_brightness: float, seed: int) -> None:
        world = read_simulated_place(CONFIG / 'patrol_world.yaml')
        world.wall_brightness = wall_brightness
        self._conditions, self._rng = conditions, np.random.default_rng(seed)
        self._renderer = Renderer(world, Camera.from_field_of_view())
        self._stream = MarkerStream(StreamSettings())
        registry = read_registry(CONFIG / 'markers.yaml')
        self._rooms = {marker: place.room for marker, place in registry.items()}
        x, y, yaw = world.plan.start
        self._base = np.eye(4)
        self._base[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
        self._base[:2, 3] = x, y
        self._positions = np.array(ARM.home)
        self.now = 0.0
        self.found: dict[str, float] = {}

    def pose(self, number: int) -> None:
        """Take one of the arm's poses and look."""
        self._look(np.array([PANS[number - 1], *ARM.home[1:]]))

    def scan(self, overlap: float, reach: float, dwell: float, done: Callable[[], bool]) -> None:
        """Look all around, `reach` rad above and below the horizon."""
        vertical = 2.0 * math.atan(math.tan(math.radians(30.0)) * 480 / 640)
        plan = ScanPlan(math.radians(60.0), vertical, overlap, -reach, reach)
        for view in from_nearer_end(ARM, plan.views, self._positions):
            self._look(aim_at(ARM, view, self._positions))
            self.now += max(0.0, dwell - PICTURES * PICTURE_PERIOD)
            if done():
                return

    def home(self) -> None:
        """Fold the arm."""

    def report(self) -> SurveyReport:
        """Return which places are found and which are missing."""
        missing: dict[str, tuple[str, ...]] = {
            room: () for room in self._rooms.values() if room not in self.found
        }
        places = tuple(PlaceNote(room, (0.0, 0.0), {}) for room in self.found)
        return SurveyReport(places, 'E', missing, (), ())

    def _look(self, positions: np.ndarray) -> None:
        self.now += motion_to(ARM, ArmState.resting(self._positions), positions).duration
        self._positions = positions
        scene = self._renderer.ideal(self._base @ ARM.camera_frame(positions))
        for _ in range(PICTURES):
            self.now += PICTURE_PERIOD
            picture = expose(scene, self._conditions, self._rng)
            for marker in self._stream.look(picture[:, :, ::-1].copy(), None)[1]:
                self.found.setdefault(self._rooms[marker], self.now)


LIGHTS: dict[str, tuple[Conditions, float]] = {
    **{name: (Conditions(lighting=name), 1.0) for name in LIGHTINGS},
    'dark walls': (Conditions(), 0.2),
    'dim and noisy': (Conditions(light=0.3, noise=8.0), 1.0),
    'hard shadow, dark walls': (Conditions(lighting='hard shadow'), 0.2),
    'soft shadow, dim, noisy': (Conditions(light=0.3, noise=8.0, lighting='soft shadow'), 1.0),
}
"""Conditions of the camera and brightness of the walls."""


def main() -> int:
    """Print the table."""
    parser = sized_parser(__doc__, quick='one scan under each light')
    parser.add_argument('--seeds', type=int, default=3, help='scans under each light')
    options = parser.parse_args()
    longest = options.size.of(math.inf, math.inf, 3.0)
    print(
        f'{"light":<25} {"scans":>5} {"whole":>5} {"longest, s":>10}  {"latest place":<12} missed'
    )
    for name, (conditions, brightness) in list(LIGHTS.items())[: options.size.of(None, None, 1)]:
        cameras = [
            ArmCamera(conditions, brightness, seed)
            for seed in range(options.size.of(options.seeds, 1, 1))
        ]
        missed: set[str] = set()
        for camera in cameras:
            report = InitialScan().run(
                camera,
                camera.report,
                lambda camera=camera: camera.now,
                lambda words: None,
                lambda camera=camera: camera.now > longest,
            )
            missed |= report.missing.keys()
        slowest = max(cameras, key=lambda camera: camera.now)
        whole = sum(camera.report().complete for camera in cameras)
        latest = max(slowest.found, key=lambda room: slowest.found[room], default='-')
        print(
            f'{name:<25} {len(cameras):>5} {whole:>5} {slowest.now:>10.1f}  {latest:<12} '
            f'{", ".join(sorted(missed)) or "-"}',
            flush=True,
        )
    return 0


if __name__ == '__main__':
    sys.exit(main())
