"""The node `collision_monitor`: lets no command through that the lidar does not allow, or a person.

It stands between whoever commands `cmd_vel` (`motion_controller`, a joystick, any other program)
and the base, which listens to `cmd_vel_monitored`. A command is slowed down so that the robot can
brake before the nearest thing on its arc. Without a fresh scan the robot slows down by the age of
the last one until it stands; without a fresh command it stands at once. What a person commands by
hand (`cmd_vel_manual`, of the page) comes before `cmd_vel` while it lasts, and is limited alike. As
a process of its own the monitor also stops a robot whose controller hangs.

Keep-out zones stand in the way as walls do, and in slow zones the speed is theirs, as long as
somebody tells where the robot is (`amcl_pose`).

A person stops the robot with the service `stop` or the topic `stop_requested`: from then on it
stands, whoever commands it, until a person releases it by the service. The topic `stopped` tells of
it. The stop is kept in a file over every restart, whatever starts the robot next; what cannot be
kept is said.

A command is limited to what the base can do before it is thought about: what one costs does not
depend on what it says. Whoever else publishes to the base is named in an incident.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from floor_plans import Zones
from floor_plans.parameters import zones_from
from lidar_navigation import Footprint, Velocity
from lidar_navigation.driving.path_following import (
    as_forwards,
    room_ahead,
    safe_turn,
    speed_to_stop,
)
from lidar_navigation.geometry import Points, Pose, Scan, composed
from lidar_navigation.robot_base import robot_deceleration, robot_footprint, robot_radius
from strict_files.settings import parameter
from surveillance_controllers.motion.command_publisher import (
    LATENCY,
    LONGEST_SILENCE,
    STANDSTILL,
    WALKING,
    CommandPublisher,
    blind_time,
)
from surveillance_controllers.motion.holding import COMMAND, STOPPED
from surveillance_interfaces.msg import StopRequest as StopRequestMessage
from surveillance_runtime.conversions import pose_of_serialized, stamp_of_serialized
from surveillance_runtime.graph_check import endpoints_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_changes import follow_place
from surveillance_runtime.place_parameters import place_zones
from surveillance_runtime.process import run_node
from surveillance_runtime.profile.check_up import ExpectedTopic, findings
from surveillance_runtime.profile.parameters import declared_frames
from surveillance_runtime.profile.record import COMMAND_TYPES
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.sensing.transforms import ScanReader
from surveillance_runtime.state_topics import (
    NAMELESS,
    OwnedTopic,
    StateSubscription,
    publishers_of,
)
from surveillance_runtime.stop_keeper import StopKeeper
from surveillance_runtime.stop_request import OWN, TOPIC, StopFile, StopRequest, own_stop

STOP_CAUSE = ('person', 'stop')
MANUAL, MANUAL_SECONDS = 'cmd_vel_manual', 0.5
"""Topic of commands by hand, and for how long one keeps others out, seconds of real time."""
BASE_CAUSE = ('robot', 'base')
DRIVERS = ('motion_controller', 'explorer')
"""Nodes of a robot that drive it."""
SECOND_CAUSE = ('robot', 'second command')
MOST_TURN = 20.0
"""No base turns faster, rad/s: the bound of every parameter of a turn."""
LOOK_PERIOD = 1.0
"""Seconds of real time between two looks at who commands the base."""
UNGUARDED_AFTER = 4.0
"""A base that does not listen is told of after this time, seconds."""
LONGEST_GUESS = 0.5
"""A pose is carried on by the velocity for at most this time, seconds."""
TURN_DECELERATION = 3.0
"""With which the base stops turning, rad/s^2."""


@dataclass(frozen=True)
class MonitorSettings:
    """What the monitor allows."""

    radius: float = robot_radius()
    footprint: tuple[float, ...] = robot_footprint()
    margin: float = parameter(0.02, 'Kept free beside the robot, m.', 0.0, 20.0)
    deceleration: float = robot_deceleration()
    longest_silence: float = parameter(
        LONGEST_SILENCE,
        'The robot stands when scan is overdue by this, sooner where something is near or cmd_vel '
        'is overdue alone, and brakes before, s of ROS time.',
        0.05,
        10.0,
    )

    wanted_type: str = parameter(
        'Twist',
        'Type of the velocity on cmd_vel: Twist, or TwistStamped where Nav2 drives.',
        choices=COMMAND_TYPES,
        name='robot.wanted_type',
    )
    state_file: str = parameter(
        OWN,
        'File that keeps over every restart that the robot is stopped; auto: one of this robot in '
        "the user's state folder, by ROS domain and namespace; empty: none.",
        read_only=True,
    )

    @cached_property
    def body(self) -> Footprint:
        """The robot's shape."""
        return Footprint(self.radius, self.footprint)

    @property
    def reach(self) -> float:
        """Nothing farther from the robot's centre than this comes near a robot that stands, m."""
        return self.body.circumscribed + self.margin

    def way_to_stand(self, velocity: Velocity) -> float:
        """Return how far the robot goes until it stands and turns no more, metres."""
        speed = abs(velocity.speed)
        way = speed * LATENCY + speed**2 / (2.0 * self.deceleration)
        if self.body.is_round:
            return way
        return max(way, speed * (LATENCY + abs(velocity.turn) / (2.0 * TURN_DECELERATION)))


def within_limit(wanted: Velocity, pose: Pose, zones: Zones, settings: MonitorSettings) -> Velocity:
    """Return a velocity on the same arc with the speed that slow zones allow at a pose."""
    x, y, yaw = pose
    ahead = yaw if wanted.speed >= 0.0 else yaw + math.pi
    return wanted.slowed_to(zones.speed_limit((x, y, ahead), settings.deceleration / 2))


def allowed(wanted: Velocity, seen: Points, settings: MonitorSettings) -> Velocity:
    """Return the velocity nearest to a wanted one, on the same arc, from which the robot can still
    brake.

    Args:
        wanted: What is commanded.
        seen: What the lidar saw, robot's frame, shape (n, 2), metres.
        settings: The robot.
    """
    body, margin = settings.body, settings.margin
    if wanted.speed == 0.0:
        top = safe_turn(wanted.turn, seen, body, margin, TURN_DECELERATION, LATENCY)
        return Velocity(0.0, math.copysign(top, wanted.turn)) if top else Velocity()
    way = settings.way_to_stand(wanted)
    room = room_ahead(*as_forwards(wanted.speed, wanted.turn, seen, body), margin, way)
    if room >= way:
        return wanted
    speed = speed_to_stop(room, settings.deceleration, LATENCY)
    share = min(1.0, speed / abs(wanted.speed))
    return Velocity(wanted.speed * share, wanted.turn * share)


class CollisionMonitor(PatrolNode):
    """Passes commands on to the base as far as they are safe."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('collision_monitor', **node_options)
        self._settings = self.declare_fields(MonitorSettings())
        frames = declared_frames(self, 'base')
        self._zones = place_zones(self)
        self._pose: tuple[Pose, float] | None = None
        follow_place(self, self._take_place)
        self._lidar = ScanReader(self, self._settings.radius, frames.base)
        self._wanted = Velocity()
        self._seen: dict[str, Scan] = {}
        self._lidars: dict[str, list[str]] = {}
        self._is_held_back = False
        self._manual_until = -math.inf
        files = self._kept_in(self._settings.state_file)
        self._keeper = StopKeeper(self, *files)
        self._stop = next(filter(None, (each.read() for each in files)), None)
        self._stopped_topic = OwnedTopic(self, Bool, STOPPED)
        self._base = CommandPublisher(
            self,
            COMMAND,
            (*self._lidar.settings.scans, 'cmd_vel'),
            self._settings.deceleration,
            self._warn_of_silence,
            min(STANDSTILL, self._settings.longest_silence),
            frames.base,
            self._patience,
            'cmd_vel',
        )
        if self._settings.wanted_type == 'TwistStamped':
            self.create_subscription(TwistStamped, 'cmd_vel', self._on_stamped_command, 1)
        else:
            self.create_subscription(Twist, 'cmd_vel', self._on_command, 1)
        self.create_subscription(Twist, MANUAL, self._on_manual, 1)
        self._lidar.subscribe(self._on_scan)
        StateSubscription(
            self,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_pose,
            raw=True,
            stamp=stamp_of_serialized,
        )
        # While one waits for the disk, commands, scans and the next press are handled.
        aside = ReentrantCallbackGroup()
        self.create_service(SetBool, 'stop', self._on_stop, callback_group=aside)
        self.create_subscription(
            StopRequestMessage, TOPIC, self._on_request, 10, callback_group=aside
        )
        self._tell_stop()
        self.create_timer(UNGUARDED_AFTER, self._look_for_base)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._look_for_others, clock=steady)

    def _kept_in(self, name: str) -> list[StopFile]:
        """Return where a stop is kept, and where whoever drives has kept it (`Hold`)."""
        own = own_stop(self.context.get_domain_id(), self.get_namespace(), os.environ)
        if name == OWN:
            return [own]
        return [StopFile(Path(name).expanduser()), own] if name else [StopFile(None)]

    def _on_manual(self, message: Twist) -> None:
        self._manual_until = time.monotonic() + MANUAL_SECONDS
        self._take_command(message)

    def _on_stamped_command(self, message: TwistStamped) -> None:
        self._on_command(message.twist)

    def _on_command(self, message: Twist) -> None:
        if time.monotonic() >= self._manual_until:
            self._take_command(message)

    def _take_command(self, message: Twist) -> None:
        speed, turn = message.linear.x, message.angular.z
        if not (math.isfinite(speed) and math.isfinite(turn)):
            self.get_logger().error(f'cmd_vel: {speed} m/s, {turn} rad/s: expected finite numbers')
            speed = turn = 0.0
        self._wanted = self._base.sustained(_within_turn(Velocity(speed, turn)))
        self._base.hear('cmd_vel')
        self._base.command(self._allowed())

    def _take_place(self, described: Mapping[str, Any]) -> None:
        self._zones = zones_from(described)

    def _on_pose(self, serialized: bytes) -> None:
        with refusing(self, 'amcl_pose'):
            self._pose = pose_of_serialized(serialized), self._ros_time()

    def _ros_time(self) -> float:
        return float(self.get_clock().now().nanoseconds) / 1e9

    def _pose_now(self) -> Pose | None:
        """Return where the robot is, as far as it went since its pose was told."""
        if self._pose is None:
            return None
        pose, told = self._pose
        passed = min(max(self._ros_time() - told, 0.0), LONGEST_GUESS)
        going = self._base.wanted
        half = going.turn * passed / 2
        way = going.speed * passed
        return composed(pose, (way * math.cos(half), way * math.sin(half), 2 * half))

    def _on_scan(self, topic: str, scan: Scan, message: LaserScan) -> None:
        self._seen[topic] = scan
        self._note_lidar(topic, message.header.frame_id)
        self._base.hear(topic)
        now, before = self._allowed(), self._base.wanted
        # Only what cannot wait for the next command.
        if abs(now.speed) < abs(before.speed) or abs(now.turn) < abs(before.turn):
            self._base.command(now)

    def _note_lidar(self, topic: str, frame: str) -> None:
        """Warn once of a second lidar on a topic: a scan takes the place of the one before."""
        frames = self._lidars.setdefault(topic, [])
        if len(frames) < 2 and frame not in frames:
            frames.append(frame)
            if len(frames) == 2:
                self.get_logger().warn(
                    f'{topic}: lidars with the frames {" and ".join(map(repr, frames))} '
                    'share the topic and hide each other: expected one; give each its own topic '
                    'and name both in topics.scans of the robot profile'
                )

    async def _on_request(self, message: StopRequestMessage) -> None:
        request = StopRequest.heard(message.owner, message.reason)
        # Who it is may be told after the service has stopped the robot.
        if self._stop is None or (request.owner and not self._stop.owner):
            await self._begin_stop(request)

    async def _on_stop(self, request: Any, response: Any) -> Any:
        response.success = True
        if request.data:
            problem = await self._begin_stop(self._stop or StopRequest.heard('', ''))
            response.message = 'the robot is stopped'
            if problem:
                response.message += f', but {problem}'
        elif self._stop is None:
            response.message = 'it is not stopped'
        else:
            self._stop = None
            self._tell_stop()
            response.message = 'the robot may move again'
            self.get_logger().warn(f'{response.message}: a person wants it so')
            if problem := await self._keeper.forget():
                response.message += f'; the next start finds it stopped: {problem}'
        return response

    async def _begin_stop(self, request: StopRequest) -> str:
        """Have the robot stand; return why that cannot be kept over a restart, or ''."""
        self._stop = request
        self._base.command(Velocity())
        self._tell_stop()
        return await self._keeper.keep(request)

    def _tell_stop(self) -> None:
        self._stopped_topic.publish(Bool(data=self._stop is not None))
        if self._stop is not None:
            words = f'the robot is {self._stop.words()}, until a person releases it'
            self.incidents.begin(STOP_CAUSE, words)
        else:
            self.incidents.end(STOP_CAUSE, 'a person has released the robot')

    def _allowed(self) -> Velocity:
        if self._stop is not None:
            return Velocity()
        # While nothing was seen the publisher lets nothing through.
        velocity = self._wanted
        far = self._settings.reach + self._settings.way_to_stand(velocity)
        pose = self._pose_now() if self._zones.keep_out or self._zones.slow else None
        if pose is not None:
            velocity = within_limit(velocity, pose, self._zones, self._settings)
        near = self._near(far, pose)
        if len(near):
            velocity = allowed(velocity, near, self._settings)
        before = self._wanted
        held_back = abs(velocity.speed) < 0.5 * abs(before.speed) or (
            before.speed == 0.0 and abs(velocity.turn) < 0.5 * abs(before.turn)
        )
        if held_back and not self._is_held_back:
            self.get_logger().warn('an obstacle is in the way: the robot is slowed down or stopped')
        self._is_held_back = held_back
        return velocity

    def _near(self, far: float, pose: Pose | None) -> Points:
        """Return what was seen, and edges of keep-out zones, where something of it is within some
        metres of the robot; shape (n, 2), robot's frame.
        """
        # Most of the time nothing is so near that the arc must be looked at.
        near = [scan.points for scan in self._seen.values() if _nearest(scan) <= far]
        if pose is not None and len(edges := self._zones.edges_near(pose, far)):
            near.append(edges)
        return np.concatenate(near) if near else np.empty((0, 2))

    def _patience(self, velocity: Velocity) -> float:
        """Return how long the robot may take to stand when its scans are overdue, seconds."""
        longest = self._settings.longest_silence
        far = self._settings.reach + (abs(velocity.speed) + WALKING) * (longest + LATENCY)
        near = self._near(far, self._pose_now())
        return blind_time(velocity, near, self._settings.body, self._settings.margin, longest)

    def _warn_of_silence(self, topic: str) -> None:
        # Commands may end at any time.
        if topic != 'cmd_vel':
            self.get_logger().warn(f'nothing on the topic {topic}: the robot stands')

    def _look_for_others(self) -> None:
        """Tell who else commands the base: nothing that this node stops holds back such a one."""
        space = self.get_namespace().rstrip('/')
        # Whoever drives tells it to stand, and nothing else (`Hold`).
        own = {f'{space}/{name}' for name in (self.get_name(), *DRIVERS)}
        others = sorted(
            {
                'a nameless node' if NAMELESS in name else name
                for name in publishers_of(self, self._base.topic).values()
            }
            - own
        )
        if others:
            self.incidents.begin(
                SECOND_CAUSE,
                f'{", ".join(others)} commands the base, too, past the collision monitor, also a '
                f'robot that is stopped: let it publish on cmd_vel in place of {self._base.topic}',
            )
        else:
            self.incidents.end(SECOND_CAUSE, 'nobody else commands the base')

    def _look_for_base(self) -> None:
        """Tell when the base does not listen, or expects another type."""
        kind = self._base.type_name
        types = {
            info.topic_type.replace('/msg/', '/')
            for info in self.get_subscriptions_info_by_topic(COMMAND)
        }
        if types == {kind} or (not types and self._wanted == Velocity()):
            self.incidents.end(BASE_CAUSE, 'the base listens')
            return
        command = ExpectedTopic(
            'topics.command', self._base.topic, kind, False, 'the base drives by it'
        )
        lines = '; '.join(findings(command, endpoints_of(self), UNGUARDED_AFTER))
        if not types:
            lines += (
                f'; the base is not protected: let it take its commands from {self._base.topic}, '
                'instead of from those that are not looked at'
            )
        if not lines:
            return  # discovery has not told all yet
        self.incidents.begin(BASE_CAUSE, lines)


def _within_turn(wanted: Velocity) -> Velocity:
    """Return the velocity on the same arc that turns no faster than any base."""
    if abs(wanted.turn) <= MOST_TURN:
        return wanted
    share = MOST_TURN / abs(wanted.turn)
    return Velocity(wanted.speed * share, math.copysign(MOST_TURN, wanted.turn))


def _nearest(scan: Scan) -> float:
    """Return a distance from the robot's centre within which a scan shows nothing, metres."""
    return float(np.fmin.reduce(scan.ranges)) - math.hypot(*scan.mount[:2])


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(CollisionMonitor, args)
