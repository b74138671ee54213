"""A marker is moved, another one goes, between the visits of a robot that looks; no clock runs.

All that decides is the product's: from where a spot is to be seen, when the robot goes there, what
it makes of the pictures. Driving and time are scripted, and the pictures are rendered.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from floor_plans import Marker
from indoor_watch import ChangeMonitor, Event, EventBook, Kind, rule_from
from indoor_watch.hung_markers import CameraView, SeenMarker
from indoor_watch.marker_checks import MarkerChecks
from indoor_watch.viewpoints import Viewpoints
from lidar_navigation.localisation.place_locator import PlaceRegions
from marker_detection.camera_model import CameraModel
from marker_detection.detector import DetectorSettings, MarkerDetector
from marker_detection.pose import pose_of
from state_machines import Interrupt
from surveillance_behaviour.mission.looking import RoomInspection
from surveillance_behaviour.mission.mission_log import InspectionLog
from surveillance_behaviour.ports import Check, Doubt, Point
from surveillance_simulation.camera.model import Camera, Conditions, expose
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.staging import Stage
from surveillance_simulation.world.simulated_place import read_simulated_place

pytestmark = pytest.mark.early

PLACE = Path(__file__).parents[2] / 'config' / 'patrol_world.yaml'
HEIGHT, SIDE = 0.9, 0.2
SPEED, TURN = 0.5, 2.0
"""Metres a second, and seconds for which the arm moves."""
FIRST_PICTURE, PERIOD = 0.6, 2.0
"""After a turn, and between two pictures, seconds."""
POSE_ERROR, DOUBT = (0.02, math.radians(0.7)), (0.03, 0.02)


def camera_pose(x: float, y: float, yaw: float, height: float) -> np.ndarray:
    """Return the pose (4, 4) of a camera that looks along the floor."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[sine, 0.0, cosine], [-cosine, 0.0, sine], [0.0, -1.0, 0.0]])
    pose[:3, 3] = x, y, height
    return pose


class Patrol:
    """A robot with an arm that stands in one corridor for a while, again and again."""

    def __init__(self, stay: float) -> None:
        self.rng = np.random.default_rng(5)
        world = read_simulated_place(PLACE)
        self.stage, plan = Stage(Robot(world)), world.plan
        world.hang_marker(Marker('m21', 21, -3.93, -1.5, 1.0, 0.0, SIDE))
        grid, self.points = plan.grid(0.05), plan.place.positions
        doors = [each.segment for each in plan.doors.values()]
        regions = PlaceRegions(grid, doors, self.points)
        rooms = SimpleNamespace(
            cells_of=regions.cells_of, place_at=lambda at: world.place_at(*map(float, at[:2]))
        )
        rules = [rule_from({'marker': 'all', 'severity': 'alert'})]
        self.alerts: list[Event] = []
        self.watcher = ChangeMonitor(
            rules,
            EventBook(),
            local=lambda stamp: datetime.fromtimestamp(stamp, UTC),
            alert=self.alerts.append,
            robot='Robot1',
            rooms=rooms,
        )
        self.watcher.use_map(grid)
        self.checks_of = MarkerChecks(rules, rooms, self.points)
        self.checks_of.use(Viewpoints(grid, 0.22))
        self.camera = Camera.from_field_of_view(640, 480)
        self.lens = CameraModel(640, 480, self.camera.matrix)
        self.renderer = Renderer(world, self.camera)
        self.detector = MarkerDetector(DetectorSettings(dictionary=plan.marker_dictionary))
        self.now, self.stay, self.visits, self.pictures = 0.0, stay, 0, 0
        self.at, self.bearing, self.ahead = (0.0, 0.0), 0.0, 0.0
        self.next_picture, self.seen_since = math.inf, 0
        settings = SimpleNamespace(choice=SimpleNamespace(recharge_rooms=('E',), speed=SPEED))
        self.mission: Any = SimpleNamespace(
            clock=self,
            place='C1',
            explored=0.0,
            settings=settings,
            looked=InspectionLog(),
            ports=SimpleNamespace(looking=self, sweeping=None),
            note=lambda *_, **__: None,
            say=lambda *_, **__: None,
        )
        self.looks = RoomInspection(cast('Any', self.mission))

    def visit(self, ahead: float) -> None:
        """Come from another place, look about, and leave.

        Args:
            ahead: Where the robot's front points then, rad.
        """
        self.visits += 1
        self.now += 60.0
        x, y = self.points['C1'][:2]
        self.at, self.bearing, self.ahead = (float(x), float(y)), ahead, ahead
        self.watcher.arrive('C1', self.now)
        self.next_picture = self.now + FIRST_PICTURE
        self.mission.explored = 0.0
        self.looks.explore(self.stay, Interrupt())
        self.watcher.doubts(self.now)
        self.watcher.arrive('C2', self.now)

    def pass_by(self) -> None:
        """Read what hangs ahead on the way through the door."""
        pose = camera_pose(-1.2, 4.4, math.radians(-112.0), HEIGHT)
        self.watcher.pass_by(pose, self._read(self._picture(pose)))

    # --- the clock ---

    def elapsed(self) -> float:
        return self.now

    def sleep(self, seconds: float, _interrupt: Interrupt) -> bool:
        end = self.now + seconds
        while self.next_picture <= end:
            self.now = self.next_picture
            self.next_picture += PERIOD
            self._look()
        self.now = end
        return True

    # --- the port ---

    def await_watcher(self, _interrupt: Interrupt) -> None: ...

    def viewpoints(self, _place: str) -> Sequence[Point]:
        return []

    def doubts(self, _place: str) -> Sequence[Doubt]:
        return []

    def checks(self, place: str) -> Sequence[Check]:
        return [
            Check(
                each.name,
                (*each.at, 0.0),
                None if each.look_from is None else (*each.look_from, 0.0),
                each.is_open,
            )
            for each in self.checks_of.of(self.watcher.spots())
            if each.place == place
        ]

    def camera_angle(self) -> float:
        return math.radians(60.0)

    def saw(self, _bearing: float) -> int:
        return self.seen_since

    def sees_around(self) -> bool:
        return False

    def has_arm(self) -> bool:
        return True

    def position(self) -> Point:
        return (*self.at, 0.0)

    def heading(self) -> float:
        return self.ahead

    def drive(self, point: Point, _interrupt: Interrupt) -> None:
        self.now += math.dist(self.at, point[:2]) / SPEED
        # In passing: nobody knows from where it was taken, but what it shows is no covered lens.
        passing = self._picture(camera_pose(*self.at, self.ahead, HEIGHT))
        self.watcher.picture(passing, None, self.now, None)
        self.at = point[0], point[1]

    def face(self, bearing: float, _interrupt: Interrupt) -> None:
        self.now += TURN
        self.bearing, self.seen_since = bearing, 0
        self.next_picture = self.now + FIRST_PICTURE

    def rest_arm(self) -> None: ...

    # --- the camera ---

    def _picture(self, pose: np.ndarray) -> np.ndarray:
        self.pictures += 1
        self.renderer.refresh()
        shown = expose(self.renderer.ideal(pose), Conditions(), self.rng)
        return np.ascontiguousarray(shown[..., ::-1])

    def _read(self, picture: np.ndarray) -> list[SeenMarker]:
        found = []
        for each in self.detector.detect(picture):
            pose = pose_of(each.corners, SIDE, self.lens)
            if pose is not None:
                covariance = pose.covariance[:3, :3]
                found.append(
                    SeenMarker(each.marker_id, SIDE, pose.position, pose.rotation, covariance)
                )
        return found

    def _look(self) -> None:
        x, y = self.at + self.rng.normal(0.0, POSE_ERROR[0], 2)
        turned = self.bearing + float(self.rng.normal(0.0, POSE_ERROR[1]))
        picture = self._picture(camera_pose(x, y, turned, HEIGHT))
        told = camera_pose(*self.at, self.bearing, HEIGHT)
        view = CameraView(told, self.camera.matrix, *DOUBT)
        viewpoint = (*self.at, self.bearing)
        self.watcher.picture(picture, viewpoint, self.now, self._read(picture), view)
        self.seen_since += 1


@pytest.mark.parametrize(
    ('what', 'state', 'stay'),
    [
        ('marker m21 moved -3.93 -0.6 1.0 0', 'moved', 14.0),
        ('marker m21 gone', 'missing', 30.0),
    ],
)
def test_a_marker_of_a_corridor_is_told_in_the_second_visit_after_it_was_touched(
    what: str, state: str, stay: float
):
    patrol = Patrol(stay)
    patrol.pass_by()
    patrol.visit(0.0)
    assert not patrol.alerts
    patrol.stage.do(what, patrol.now)
    before = patrol.visits
    while not patrol.alerts and patrol.visits < before + 3:
        patrol.visit(-math.pi / 2)
    assert [(each.kind, each.subject, each.seen) for each in patrol.alerts] == [
        (Kind.MARKER, '21', state)
    ]
    assert patrol.visits - before <= 2
