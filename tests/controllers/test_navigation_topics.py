"""What navigation reads and commands: unsound messages are refused, who sees nothing stands."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion, TransformStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from lidar_navigation import Drive, Localiser, Navigator, Spin, Velocity
from lidar_navigation.driving import driving
from lidar_navigation.geometry import Mount, Scan, composed
from state_machines import Interrupt
from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.motion.arrival import MotionFailedError
from surveillance_controllers.motion.navigation_motion import NavigationMotion
from surveillance_controllers.motion.pose_reports import POSE, UNSURE_FOR
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing.transforms import ScanReader
from surveillance_runtime.spin_in_place import spin_path


class Steersman:
    """Stands in for the navigator: drives as long as it sees."""

    def __init__(self) -> None:
        self.task: Drive | Spin | None = None
        self.seen: list[Scan] = []
        self.times: list[float] = []
        self.pose = self.odometry = self.place = self.missing = None
        self.lost, self.jumps, self.obstacles_changed = False, 0, False
        self.ambiguous = False
        self.awaits = ()
        self.may_be_in: tuple[str, ...] = ()
        self.trusted = None

    @property
    def is_sure(self) -> bool:
        return not (self.lost or self.ambiguous)

    def see(self, scan: Scan, now: float, _lidar: str = '') -> Velocity:
        self.seen.append(scan)
        self.times.append(now)
        return Velocity(0.6, 0.0)

    def move(self, _odometry: Any, _stamp: Any = None) -> None:
        pass

    def told_pose(self, _stamp: float) -> None:
        pass

    def set_closed(self, _doors: Any) -> None:
        pass

    def set_positions(self, _positions: Any) -> None:
        pass

    def place_at(self, _point: Any) -> None:
        pass


@pytest.fixture
def steersman() -> Steersman:
    return Steersman()


def motion_of(
    node: Any,
    navigator: Any,
    on_place: Callable[[str | None], object] = lambda _place: None,
) -> NavigationMotion:
    """Return a motion that a navigator steers, in a place that nobody describes."""
    knowledge: Any = SimpleNamespace(assume=lambda _: None, follow_places=lambda _: None)
    recorder: Any = SimpleNamespace(tell=lambda place, _stamp=None: on_place(place))
    return NavigationMotion(node, knowledge, recorder, MotionSettings(), navigator)


def scan(**fields: Any) -> LaserScan:
    return LaserScan(
        angle_min=-1.0, angle_increment=0.1, range_max=8.0, ranges=[1.0] * 20, **fields
    )


@pytest.mark.parametrize(('yaw', 'fails'), [(0.0, True), (1.5, False)])
def test_a_turn_that_the_robot_has_no_room_for_is_no_turn(
    graph: Any, steersman: Steersman, monkeypatch: pytest.MonkeyPatch, yaw: float, fails: bool
) -> None:
    monkeypatch.setattr(driving, 'SPIN_PATIENCE', 0.1)
    navigator: Any = steersman

    def see(_scan: Scan, now: float, _lidar: str = '') -> Velocity:
        navigator.pose = (0.0, 0.0, yaw)
        spin: Any = navigator.task
        return Velocity() if spin is None else spin.step(yaw, now)

    monkeypatch.setattr(navigator, 'see', see)
    motion = motion_of(graph.node, navigator)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    run: Any = SimpleNamespace(interrupt=Interrupt())
    path = np.array(spin_path((0.0, 0.0), 1.5))
    with ThreadPoolExecutor() as threads:
        turned = threads.submit(motion.follow, path, run, lambda _: None)

        def ends() -> bool:
            scans.publish(scan())
            return turned.done()

        graph.until(ends)
        if fails:
            with pytest.raises(MotionFailedError, match='cannot turn: 86 degrees are left'):
                turned.result()
        else:
            assert turned.result()[:2] == pytest.approx([0.0, 0.0])


def test_without_scans_or_odometry_the_robot_is_told_to_stand(
    graph: Any, steersman: Steersman
) -> None:
    said = graph.said()
    navigator: Any = steersman
    motion_of(graph.node, navigator)
    steersman.task = Spin()
    told = graph.listen(Twist, 'cmd_vel', 1)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    odometry = graph.node.create_publisher(Odometry, 'odom', SENSOR_QOS)

    def drives(*publishers: Any) -> bool:
        for publisher, message in publishers:
            publisher.publish(message)
        return bool(told and told[-1].linear.x > 0.0)

    both = (scans, scan()), (odometry, Odometry())
    graph.until(lambda: drives(*both))
    graph.until(lambda: told[-1].linear.x == 0.0)
    graph.until(lambda: drives(*both))
    graph.until(lambda: not drives((scans, scan())), timeout=60.0)
    graph.until(lambda: any('nothing on the topic' in line for line in said))


def test_a_drive_begins_and_ends_with_a_command_whether_a_scan_comes_or_not(
    graph: Any, steersman: Steersman
) -> None:
    navigator: Any = steersman
    node = graph.add(PatrolNode, {'sensor_timeout': 60.0}, name='moving')
    motion = motion_of(node, navigator)
    told = graph.listen(Twist, 'cmd_vel', 10)
    interrupt = Interrupt()
    run: Any = SimpleNamespace(interrupt=interrupt)
    driving = threading.Thread(target=lambda: motion.look_around(run))
    driving.start()
    graph.until(lambda: told)  # which a simulator in lockstep waits for
    interrupt.set()
    driving.join(60.0)
    graph.until(lambda: len(told) == 2)
    assert [message.linear.x for message in told] == [0.0, 0.0]


@pytest.mark.parametrize('doubt', ['ambiguous', 'lost'])
def test_a_robot_that_does_not_know_where_it_is_tells_no_place(
    graph: Any, steersman: Steersman, doubt: str
) -> None:
    navigator: Any = steersman
    told: list[str | None] = []
    motion = motion_of(graph.node, navigator, told.append)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    navigator.see = lambda *_: setattr(navigator, 'place', 'R1')

    def last(place: str | None) -> bool:
        scans.publish(scan())
        return told[-1:] == [place]

    graph.until(lambda: last('R1'))
    # It finds out with the next scan: the simulated navigator changes its mind there.
    navigator.see = lambda *_: setattr(navigator, doubt, True)
    graph.until(lambda: last(None))
    with pytest.raises(MotionFailedError, match='does not know in which'):
        motion.place_reached(np.zeros(3), np.zeros(3))
    navigator.place = 'R2'
    navigator.see = lambda *_: setattr(navigator, doubt, False)
    graph.until(lambda: last('R2'))
    assert told == ['R1', None, 'R2']


@pytest.mark.parametrize(
    ('doubt', 'words'),
    [
        ('ambiguous', 'it may be in R1, R2 or R3, at poses that look alike'),
        ('lost', 'what it sees is nowhere on the map'),
    ],
)
def test_a_robot_that_stands_and_does_not_know_where_it_is_calls_somebody(
    graph: Any, steersman: Steersman, doubt: str, words: str
) -> None:
    said = graph.said()
    navigator: Any = steersman
    motion = motion_of(graph.node, navigator)
    navigator.pose, navigator.may_be_in = (0.0, 0.0, 0.0), ('R1', 'R2', 'R3')
    setattr(navigator, doubt, True)

    def see() -> None:
        motion._see(Scan(np.zeros(9), np.ones(9), 8.0), Time(sec=1))

    see()
    assert motion._reports._unsure_since is not None
    assert not graph.node.incidents.open()
    motion._reports._unsure_since -= UNSURE_FOR
    navigator.task = Spin()  # who drives may yet find out
    see()
    assert not graph.node.incidents.open()
    navigator.task = None
    see()
    graph.until(lambda: any(words in line for line in said))
    assert POSE in graph.node.incidents.open()
    setattr(navigator, doubt, False)
    see()
    assert POSE not in graph.node.incidents.open()


def test_a_pose_that_somebody_tells_makes_the_place_known(graph: Any, steersman: Steersman) -> None:
    said = graph.said()
    navigator: Any = steersman
    told: list[str | None] = []
    motion = motion_of(graph.node, navigator, told.append)
    navigator.place, navigator.ambiguous = 'R1', True
    navigator.believe = lambda _pose: setattr(navigator, 'ambiguous', False)
    motion._see(Scan(np.zeros(9), np.ones(9), 8.0), Time(sec=1))
    assert told == []
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'initialpose', 1)

    def published_in(frame: str) -> None:
        message = PoseWithCovarianceStamped()
        message.header.frame_id = frame
        poses.publish(message)

    def is_refused() -> bool:
        published_in('odom')
        return any("in the frame 'odom': expected 'map'" in line for line in said)

    graph.until(is_refused)
    assert navigator.ambiguous
    graph.until(lambda: published_in('map') or not navigator.ambiguous)
    motion._see(Scan(np.zeros(9), np.ones(9), 8.0), Time(sec=2))
    assert told == ['R1']


def test_messages_that_are_not_sound_end_nothing(graph: Any, steersman: Steersman) -> None:
    said = graph.said()
    navigator: Any = steersman
    motion_of(graph.node, navigator)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'initialpose', 1)
    bad = PoseWithCovarianceStamped()
    bad.pose.pose.position.x = math.nan

    def seen() -> bool:
        poses.publish(bad)
        scans.publish(LaserScan(angle_min=math.nan, ranges=[1.0]))
        scans.publish(scan())
        return bool(steersman.seen)

    def told(text: str) -> bool:
        return any(text in line for line in said)

    graph.until(lambda: seen() and told('initialpose: a pose with a coordinate'))
    graph.until(lambda: seen() and told('scan: a scan of 1 rays from nan rad'))


def test_a_lidar_s_mount_comes_from_the_static_transforms(graph: Any, capfd: Any) -> None:
    frames = ScanReader(graph.add(PatrolNode, {'lidar_mounts': []}, name='reading'), 0.2)
    transforms = []
    for parent, child, x in (('base_link', 'mast', 0.1), ('mast', 'laser', 0.2), ('b', 'a', 1.0)):
        step = TransformStamped(child_frame_id=child)
        step.header.frame_id = parent
        step.transform.translation.x = x
        transforms.append(step)
    transforms.append(TransformStamped(child_frame_id='b'))
    transforms[-1].header.frame_id = 'a'
    frames.frames.hear_fixed(SimpleNamespace(transforms=transforms))
    assert frames.mount_of('laser').pose == pytest.approx((0.3, 0.0, 0.0))
    assert frames.mount_of('/laser') == frames.mount_of('laser')
    assert frames.mount_of('robot2/base_link') == Mount()
    for unknown in ('lidar', 'a', 'lidar'):
        assert frames.mount_of(unknown) == Mount()
    logged = capfd.readouterr().err
    assert logged.count("its frame 'lidar' is on the robot is not known") == 1
    assert "its frame 'a' is" in logged


def test_a_lidar_below_tilted_frames_is_looked_up_in_space(graph: Any, capfd: Any) -> None:
    frames = ScanReader(graph.add(PatrolNode, {'lidar_mounts': []}, name='reading'), 0.2)
    over, forward = Quaternion(x=1.0, w=0.0), Quaternion(y=0.5, w=0.75**0.5)
    transforms = []
    for parent, child, x, turn in (
        ('/base_link', 'plate', 0.3, over),
        ('plate', 'hanging', 0.1, Quaternion(z=0.5**0.5, w=0.5**0.5)),
        ('plate', 'upright', 0.1, over),
        ('base_link', 'nodding', 0.2, forward),
    ):
        step = TransformStamped(child_frame_id=child)
        step.header.frame_id = parent
        step.transform.translation.x, step.transform.rotation = x, turn
        transforms.append(step)
    frames.frames.hear_fixed(SimpleNamespace(transforms=transforms))
    pose, upside_down = frames.mount_of('hanging')
    assert pose == pytest.approx((0.4, 0.0, -math.pi / 2))
    assert upside_down
    pose, upside_down = frames.mount_of('upright')
    assert pose == pytest.approx((0.4, 0.0, 0.0))
    assert not upside_down
    assert frames.mount_of('nodding').pose == pytest.approx((0.2, 0.0, 0.0))
    assert "'nodding' is tilted by 60 degrees" in capfd.readouterr().err


@pytest.mark.parametrize(
    ('given', 'mount'),
    [
        ([], Mount()),
        ([0.1, 0.0, 1.0, 0.0], Mount((0.1, 0.0, 1.0))),
        ([0.1, 0.0, 1.0, 3.1416], Mount((0.1, 0.0, 1.0), True)),
        ([0.1, 0.0, 1.0, -math.pi], Mount((0.1, 0.0, 1.0), True)),
        ([0.1, 0.0], ParameterError),
        ([0.1, 0.0, 1.0, 1.57], ParameterError),
        ([0.1, 0.0, 1.0, 180.0], ParameterError),
    ],
)
def test_a_lidar_s_mount_may_be_given_upside_down_too(graph: Any, given: Any, mount: Any) -> None:
    node = graph.add(PatrolNode, {'lidar_mounts': given}, name='mounted')
    if mount is ParameterError:
        with pytest.raises(ParameterError, match=r'lidar_mounts.*hangs upside down'):
            ScanReader(node, 0.2)
    else:
        assert ScanReader(node, 0.2).mount_of('laser') == mount


def test_scans_without_a_stamp_count_from_when_they_came(graph: Any, steersman: Any) -> None:
    motion_of(graph.node, steersman)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    unstamped = scan()
    unstamped.header.stamp = Time()

    def seen() -> bool:
        scans.publish(unstamped)
        return len(steersman.times) >= 2

    graph.until(seen)
    assert 0.0 < steersman.times[0] < steersman.times[1]


def test_a_robot_that_drives_stands_while_it_looks_for_itself(
    graph: Any, flat: Any, monkeypatch: Any
) -> None:
    navigator = Navigator()
    navigator.set_map(flat.grid)
    motion = motion_of(graph.node, navigator)
    true = (2.0, 1.5, 0.0)
    navigator.move(true)
    navigator.task = Drive([[2.0, 1.5], [5.5, 1.5]])
    for step in range(10):
        motion._see(flat.scan(true), Time(sec=1, nanosec=step * 10**8))
    assert motion._base.wanted.speed > 0.2
    during = []
    monkeypatch.setattr(
        Localiser, 'search', lambda _self, _scan: during.append(motion._base.wanted) or []
    )
    nonsense = np.random.default_rng(2).uniform(0.3, 7.0, len(flat.scan(true).angles))
    motion._see(Scan(flat.scan(true).angles, nonsense, 8.0), Time(sec=3))
    assert during == [Velocity()]
    assert motion._base.wanted == Velocity()


@pytest.mark.parametrize('mount', [(0.3, -0.2, 0.0), (0.1, 0.0, math.pi), (-0.25, 0.1, 2.0)])
def test_a_lidar_off_centre_or_turned_localises_as_well(
    flat: Any, mount: tuple[float, float, float]
) -> None:
    pose = (1.2, 1.0, 0.4)
    seen = flat.scan(composed(pose, mount))
    mounted = Scan(seen.angles, seen.ranges, seen.range_max, mount)
    localiser = Localiser(flat.grid, (1.3, 0.95, 0.45))
    localiser.believe((1.3, 0.95, 0.45))
    for step in range(5):
        localiser.see(mounted, 0.1 * step)
    assert localiser.pose == pytest.approx(pose, abs=0.04)
    assert np.isfinite(mounted.points).all()
