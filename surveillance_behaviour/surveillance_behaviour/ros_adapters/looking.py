"""What the node `observer` tells a robot that looks, and the driving and turning for a look.

`viewpoints` says from where each place is to be looked at, `checks` what the rules want to have
seen there, `doubts` which alerts wait for a second look, `pictures` which sides were in the
pictures that were looked at last, and `sees_around` whether it sees all around without a turn. The
first word of that says that the observer sees, which the first look of this process waits for.
Without an observer there are no viewpoints, and the robot looks nowhere.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from std_msgs.msg import Bool

from state_machines import Interrupt
from state_machines.ros import CallError, GoalCaller, ServiceCaller
from surveillance_behaviour.conversions import (
    checks_from,
    doubts_from,
    pictures_from,
    viewpoints_from,
)
from surveillance_behaviour.ports import Check, Doubt, Point
from surveillance_behaviour.ros_adapters.peers import Deadlines, MissionClock, run
from surveillance_interfaces.action import ComputePath, FollowPath
from surveillance_interfaces.msg import Doubts, PlaceChecks, ViewedPictures, Viewpoints
from surveillance_interfaces.srv import MarkerRoutine, PointCamera
from surveillance_runtime.conversions import (
    point_from,
    point_message,
    point_messages,
    pose_of_serialized,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.robot_arm import ARM
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.spin_in_place import spin_path
from surveillance_runtime.state_topics import StateSubscription

ARM_DEADLINE = 60.0
"""Within which the arm is at a pose, seconds of real time."""
SENDING = 0.5
"""Seconds of real time for which a pose that nobody waits for is sent."""
WATCHER_DEADLINE = 20.0
"""The first look waits so long for the observer, seconds of real time."""
POSES = (
    MarkerRoutine.Request.HOME,
    MarkerRoutine.Request.LEFT,
    MarkerRoutine.Request.BACK,
    MarkerRoutine.Request.RIGHT,
)
"""Of the arm, a quarter turn apart, anticlockwise."""
AT_POSE = 0.05
"""A bearing that differs by less from a pose's is that of the pose, rad."""
FAR = 20.0
"""The arm is pointed at something so far away, metres."""
MANY = 100
"""Pictures that stand for those of a robot that has no camera."""
SAME_SIDE = 0.35
"""A picture whose middle is so near to a bearing shows it, rad."""


class RosInspection:
    """The observer's topics, `compute_path`, `follow_path` and `move_arm`."""

    def __init__(self, node: PatrolNode, deadlines: Deadlines, clock: MissionClock) -> None:
        self._deadlines, self._clock = deadlines, clock
        self._planner = GoalCaller(node, ComputePath, 'compute_path')
        self._follower = GoalCaller(node, FollowPath, 'follow_path')
        self._arm = ServiceCaller(node, MarkerRoutine, 'move_arm')
        self._pointing = ServiceCaller(node, PointCamera, 'point_camera')
        self._node = node
        self._viewpoints: dict[str, list[Point]] = {}
        self._doubts: list[Doubt] = []
        self._checks: dict[str, list[Check]] = {}
        # Of each picture that was looked at when it was taken, seconds, and to which bearing, rad;
        # None: nobody looks at pictures.
        self._pictures: list[tuple[float, float | None]] | None = []
        self._camera_angle: float | None = None
        self._faced_at = 0.0
        self._position: Point | None = None
        self._heading = 0.0
        self._sees_around = False
        self._watches = Interrupt()
        self._resting = Interrupt()
        StateSubscription(node, Bool, 'sees_around', self._on_sees_around)
        StateSubscription(node, Viewpoints, 'viewpoints', self._on_viewpoints)
        StateSubscription(node, Doubts, 'doubts', self._on_doubts)
        StateSubscription(node, PlaceChecks, 'checks', self._on_checks)
        StateSubscription(node, ViewedPictures, 'pictures', self._on_pictures)
        StateSubscription(node, PoseWithCovarianceStamped, 'amcl_pose', self._on_pose, raw=True)

    def viewpoints(self, place: str) -> Sequence[Point]:
        """Return from where else a place is to be looked at."""
        return list(self._viewpoints.get(place, ()))

    def doubts(self, place: str) -> Sequence[Doubt]:
        """Return the alerts in a place that wait for a second look."""
        return [each for each in self._doubts if each.place == place]

    def checks(self, place: str) -> Sequence[Check]:
        """Return what is to be seen in a place before all else."""
        return list(self._checks.get(place, ()))

    def camera_angle(self) -> float | None:
        """Return how much of the horizon a picture shows, rad; None: nobody has said."""
        return self._camera_angle

    def saw(self, bearing: float) -> int:
        """Return how many pictures to a bearing were looked at, taken since the camera turned."""
        if self._pictures is None:
            return MANY
        return sum(
            taken >= self._faced_at
            and (where is None or abs(math.remainder(where - bearing, math.tau)) <= SAME_SIDE)
            for taken, where in self._pictures
        )

    def position(self) -> Point | None:
        """Return where the robot is."""
        return self._position

    def heading(self) -> float:
        """Return where the robot's front points, map frame, rad; 0 where nobody has said."""
        return self._heading

    def await_watcher(self, interrupt: Interrupt) -> None:
        """Wait until the observer sees; it may have been started together with this process."""
        if self._watches.is_set():
            return
        self._clock.wait_for_event()
        either = Interrupt()
        forget = self._watches.subscribe(either.set), interrupt.subscribe(either.set)
        either.wait(WATCHER_DEADLINE)
        for each in forget:
            each()
        if not interrupt.is_set():
            # Once: who is not there by then may never be.
            self._watches.set()

    def sees_around(self) -> bool:
        """Tell whether a turn shows nothing more, as the observer says."""
        return self._sees_around

    def has_arm(self) -> bool:
        """Tell whether an arm turns the camera."""
        return bool(self._node.count_services(self._node.resolve_service_name('move_arm')))

    def drive(self, point: Point, interrupt: Interrupt) -> None:
        """Drive to a point in the same place."""
        limits, start = self._deadlines, self._position or point
        request = ComputePath.Goal(start=point_message(start), goal=point_message(point))
        planned = run(self._planner, request, limits.answer, limits.plan, interrupt)
        path = [point_from(each) for each in planned.path]
        request = FollowPath.Goal(path=point_messages(path))
        run(self._follower, request, limits.answer, limits.move, interrupt)

    def face(self, bearing: float, interrupt: Interrupt) -> None:
        """Turn the camera to a bearing: the arm, or the base without one.

        An arm that can be pointed anywhere is; another one takes its nearest pose.
        """
        limits, here = self._deadlines, self._position
        if not self.has_arm():
            if here is None:
                raise CallError('amcl_pose: nobody tells where the robot is')
            turn = FollowPath.Goal(path=point_messages(spin_path(here, bearing)))
            run(self._follower, turn, limits.answer, limits.move, interrupt)
        else:
            self._resting.set()
            self._clock.wait_for_event()
            self._turn_arm(bearing - self._heading, interrupt)
        self._faced_at = self._clock.now()

    def _turn_arm(self, aside: float, interrupt: Interrupt) -> None:
        """Have the arm look aside, rad from the robot's front, anticlockwise."""
        limits = self._deadlines
        quarters = round(aside / (math.pi / 2))
        caller: ServiceCaller = self._arm
        request: Any = MarkerRoutine.Request(pos=POSES[quarters % len(POSES)])
        is_pose = abs(aside - quarters * math.pi / 2) < AT_POSE
        if not is_pose and self._pointing.is_ready():
            lens = ARM.camera_frame(ARM.home)[:3, 3]
            target = lens[0] + FAR * math.cos(aside), lens[1] + FAR * math.sin(aside), lens[2]
            caller = self._pointing
            request = PointCamera.Request(point=point_message(target), frame_id='base_link')
        seconds = limits.move or ARM_DEADLINE
        answer = caller.call(request, seconds, interrupt, discovery=limits.answer)
        if not answer.success:
            raise CallError(f'{caller.name}: {answer.message}')

    def rest_arm(self) -> None:
        """Have the arm look ahead; what points it elsewhere afterwards comes before it."""
        self._resting.set()
        self._resting = ended = Interrupt()
        is_known = self._arm.is_ready()
        forget = self._node.stopping.subscribe(ended.set) if not is_known else None

        def rest() -> None:
            # One that was killed may have left it turned aside: its server is found first.
            seconds = SENDING if is_known else self._deadlines.answer
            with contextlib.suppress(CallError):
                self._arm.call(
                    MarkerRoutine.Request(pos=MarkerRoutine.Request.HOME),
                    seconds,
                    ended,
                    discovery=seconds,
                )
            if forget is not None:
                forget()

        self._node.spawn(rest, 'arm')

    def _on_sees_around(self, message: Bool) -> None:
        self._sees_around = bool(message.data)
        self._watches.set()

    def _on_viewpoints(self, message: Viewpoints) -> None:
        with refusing(self._node, 'viewpoints'):
            self._viewpoints = viewpoints_from(message)

    def _on_doubts(self, message: Doubts) -> None:
        with refusing(self._node, 'doubts'):
            self._doubts = doubts_from(message)

    def _on_checks(self, message: PlaceChecks) -> None:
        with refusing(self._node, 'checks'):
            self._checks = checks_from(message)

    def _on_pictures(self, message: ViewedPictures) -> None:
        with refusing(self._node, 'pictures'):
            self._pictures, self._camera_angle = pictures_from(message)

    def _on_pose(self, serialized: bytes) -> None:
        x, y, yaw = pose_of_serialized(serialized)
        self._position, self._heading = (x, y, 0.0), yaw
