"""What a robot's drivers are awaited to say and to hear, compared with what is there.

`awaited` lists it from a profile, `findings` compares one topic with the endpoints and messages
that were seen, in words that name what is missing and the nearest that is there. No ROS in here:
who looks at the graph hands over plain values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from strict_files.suggestions import like
from surveillance_runtime.profile.record import RobotProfile

NAMELESS = 'a node whose name is not known yet'
"""The graph knows an endpoint before, and sometimes after, it knows whose it is."""
MOST_AGE = 2.0
"""A stamp that is older or younger than this beside this machine's clock is told, seconds."""
BASE_FRAMES = ('base_link', 'base_footprint', '')
"""Frames at the robot's centre, beside the one that the profile names."""
OWN_NODES = frozenset(('motion_controller', 'collision_monitor'))
"""They listen to commands as well, and are no base."""


@dataclass(frozen=True)
class ExpectedTopic:
    """One topic between the drivers and the patrol.

    Attributes:
        key: The profile's key that names it.
        topic: Its name, with the namespace.
        type: Its type, `package/Name`.
        heard: Whether the patrol hears it; else the robot does.
        is_needed: Whether nothing drives without it.
        is_latched: Whether the last message is awaited by who comes late.
        frame: The frame that its messages are awaited in; empty: any.
        purpose: What for.
    """

    key: str
    topic: str
    type: str
    heard: bool
    purpose: str
    is_needed: bool = True
    is_latched: bool = False
    frame: str = ''


@dataclass(frozen=True)
class Endpoint:
    """A publisher or a subscriber of a topic."""

    node: str
    type: str
    reliable: bool = True
    latched: bool = False

    @property
    def quality(self) -> str:
        """Its quality of service, in words."""
        reliability = 'reliable' if self.reliable else 'best effort'
        return f'{reliability}, {"latched" if self.latched else "volatile"}'


@dataclass(frozen=True)
class TopicSample:
    """What came on a topic while somebody listened.

    Attributes:
        count: How many messages.
        rate: Messages a second; 0 where there were not two.
        frame: Of the last; empty: it has none.
        age: How old their stamps were when they came, the median, seconds; None: they have none.
        values: What else they say, for `truth_check`.
    """

    count: int = 0
    rate: float = 0.0
    frame: str = ''
    age: float | None = None
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class GraphSample:
    """What is there.

    Attributes:
        publishers: By topic.
        subscribers: By topic.
        heard: By topic.
        parents: On `tf_static`: of each frame the one that it is fixed to.
        moving: On `tf`: of each frame the one that it is below.
        places: Of each fixed frame x, y, yaw on the robot, and whether it is upside down.
        doubled: Which frames two tell of, in words.
        states: Of each lifecycle node of Nav2 its state.
        clashes: Which names have two types, in words.
        footprint: That of Nav2's local costmap, as a list of corners; empty: not known.
        has_clock: Whether a simulation tells the time.
    """

    publishers: Mapping[str, Sequence[Endpoint]] = field(default_factory=dict)
    subscribers: Mapping[str, Sequence[Endpoint]] = field(default_factory=dict)
    heard: Mapping[str, TopicSample] = field(default_factory=dict)
    parents: Mapping[str, str] = field(default_factory=dict)
    moving: Mapping[str, str] = field(default_factory=dict)
    places: Mapping[str, tuple[float, float, float, bool]] = field(default_factory=dict)
    doubled: Sequence[str] = ()
    states: Mapping[str, str] = field(default_factory=dict)
    clashes: Sequence[str] = ()
    footprint: Sequence[Sequence[float]] = ()
    has_clock: bool = False


def named(topic: str, namespace: str = '') -> str:
    """Return the full name of a topic."""
    parts = [namespace.strip('/'), topic] if not topic.startswith('/') else [topic.strip('/')]
    return '/' + '/'.join(part for part in parts if part)


def awaited(profile: RobotProfile, namespace: str = '') -> tuple[ExpectedTopic, ...]:
    """Return what a mission awaits of a robot, what it needs most first.

    Args:
        profile: The robot.
        namespace: That its names are in.
    """
    topics, frames = profile.topics, profile.frames

    def name(topic: str) -> str:
        return named(topic, namespace)

    own = profile.dock.navigator == 'own'
    wanted = [
        ExpectedTopic(
            'topics.map',
            name(topics.map),
            'nav_msgs/OccupancyGrid',
            True,
            'where walls are: a map server or SLAM',
            is_latched=True,
            frame=frames.map,
        ),
        ExpectedTopic(
            'topics.odom',
            name(topics.odom),
            'nav_msgs/Odometry',
            True,
            'how the base moves',
            is_needed=own,
            frame=frames.odom,
        ),
    ]
    has_frames = 'frames.scans' in profile.origins and len(frames.scans) == len(topics.scans)
    for number, scan in enumerate(topics.scans):
        wanted.append(
            ExpectedTopic(
                'topics.scans',
                name(scan),
                'sensor_msgs/LaserScan',
                True,
                'what stands around the robot',
                is_needed=own,
                frame=frames.scans[number] if has_frames else '',
            )
        )
    if own:
        wanted.append(
            ExpectedTopic(
                'topics.command',
                name(topics.command),
                f'geometry_msgs/{profile.types.command}',
                False,
                'the base drives by it',
            )
        )
    if profile.battery.source == 'topic':
        wanted.append(
            ExpectedTopic(
                'topics.battery',
                name(topics.battery),
                'sensor_msgs/BatteryState',
                True,
                'when to charge',
                is_needed=False,
            )
        )
    return tuple(wanted)


def looked_at(profile: RobotProfile, namespace: str = '') -> tuple[ExpectedTopic, ...]:
    """Return what is listened to beside what is awaited: a camera, which not each robot has."""
    camera = (
        ('topics.image', profile.topics.image, 'Image'),
        ('topics.camera_info', profile.topics.camera_info, 'CameraInfo'),
    )
    return tuple(
        ExpectedTopic(key, named(topic, namespace), f'sensor_msgs/{kind}', True, '', False)
        for key, topic, kind in camera
    )


def findings(wanted: ExpectedTopic, seen: GraphSample, seconds: float) -> Iterator[str]:
    """Yield what keeps a topic from being as awaited, one line each; nothing where it is.

    Args:
        wanted: The topic.
        seen: What is there.
        seconds: For how long was listened.
    """
    ends = (seen.publishers if wanted.heard else seen.subscribers).get(wanted.topic, ())
    others = [end for end in ends if wanted.heard or _is_foreign(end)]
    right = [end for end in others if end.type == wanted.type]
    for end in others:
        if end.type != wanted.type:
            yield _wrong_type(wanted, end)
    if not others:
        verb = 'nobody publishes it' if wanted.heard else 'nobody subscribes to it'
        yield f'{wanted.topic}: {verb} ({wanted.type}, {wanted.purpose}){_nearest(wanted, seen)}'
    if not right or not wanted.heard:
        return
    heard = seen.heard.get(wanted.topic, TopicSample())
    if not heard.count:
        latched = wanted.is_latched and not any(end.latched for end in right)
        why = (
            '; its publisher is volatile, and who comes late hears nothing until it speaks again'
            if latched
            else ''
        )
        nodes = ', '.join(end.node for end in right)
        yield f'{wanted.topic}: {nodes} publishes it, but nothing came for {seconds:g} s{why}'
        return
    if wanted.frame and heard.frame and heard.frame.removeprefix('/') != wanted.frame:
        part = wanted.key.partition('.')[2]
        key = 'frames.scans' if part == 'scans' else f'frames.{part}'
        yield (
            f'{wanted.topic}: its frame is {heard.frame!r}, the profile says {key}: '
            f'{wanted.frame!r}'
        )
    if heard.age is not None and abs(heard.age) > MOST_AGE and not wanted.is_latched:
        when = 'behind' if heard.age > 0 else 'ahead of'
        yield (
            f'{wanted.topic}: its stamps are {abs(heard.age):.1f} s {when} the clock: are the '
            'clocks of the robot and of this machine the same?'
        )


def unplaced(profile: RobotProfile, seen: GraphSample, namespace: str = '') -> Iterator[str]:
    """Yield which lidars nobody says the place of, one line each.

    Args:
        profile: The robot.
        seen: What is there.
        namespace: That its names are in.
    """
    if profile.lidars.mounts:
        return
    for scan in profile.topics.scans:
        topic = named(scan, namespace)
        if topic not in seen.heard:
            continue
        frame = at = seen.heard[topic].frame.removeprefix('/')
        passed = 0
        while at != profile.frames.base and at.rpartition('/')[2] not in BASE_FRAMES:
            if at not in seen.parents or passed > len(seen.parents):
                yield (
                    f'{topic}: where its frame {frame!r} is on the robot is not known: expected it '
                    f'on tf_static below {profile.frames.base}, or lidars.mounts in the robot '
                    "profile; it is taken for the robot's centre"
                )
                break
            at, passed = seen.parents[at], passed + 1


def _wrong_type(wanted: ExpectedTopic, end: Endpoint) -> str:
    role = 'publisher' if wanted.heard else 'subscriber'
    fitting = ''
    if wanted.key == 'topics.command' and end.type.startswith('geometry_msgs/Twist'):
        fitting = f'; types.command: {end.type.partition("/")[2]} in the robot profile fits it'
    return (
        f'{wanted.topic} has a {role} of {end.type} ({end.node}), the profile says '
        f'{wanted.type}{fitting}'
    )


def _nearest(wanted: ExpectedTopic, seen: GraphSample) -> str:
    """Return the topic that may be meant: of the same type, the most like one first."""
    table = seen.publishers if wanted.heard else seen.subscribers
    alike = [
        topic
        for topic, ends in table.items()
        if any(end.type == wanted.type and _is_foreign(end) for end in ends)
        and topic != wanted.topic
    ]
    if not wanted.heard:
        alike += [
            topic
            for topic, ends in table.items()
            if any(end.type.startswith('geometry_msgs/Twist') and _is_foreign(end) for end in ends)
            and topic not in (*alike, wanted.topic)
        ]
    if not alike:
        close = like(wanted.topic, table)
        return f'; the nearest name is {close}' if close and close != wanted.topic else ''
    best = like(wanted.topic, alike) or sorted(alike)[0]
    kinds = {end.type for end in table[best]}
    return f'; the nearest that is there is {best} ({", ".join(sorted(kinds))}): {wanted.key}'


def _is_foreign(end: Endpoint) -> bool:
    return end.node.rpartition('/')[2] not in OWN_NODES


def table(wanted: Sequence[ExpectedTopic], seen: GraphSample, seconds: float) -> list[str]:
    """Return a report: a line for each topic, then what is not as awaited."""
    lines = []
    width = max(len(each.topic) for each in wanted)
    problems = []
    for each in wanted:
        ends = (seen.publishers if each.heard else seen.subscribers).get(each.topic, ())
        ends = [end for end in ends if each.heard or _is_foreign(end)]
        found = list(findings(each, seen, seconds))
        heard = seen.heard.get(each.topic, TopicSample())
        said = [', '.join(sorted({end.node for end in ends})) or '-']
        said += sorted({end.quality for end in ends})
        if each.heard and heard.count:
            said.append(f'{heard.rate:.1f} Hz' if heard.rate else f'{heard.count} message(s)')
            if heard.frame:
                said.append(f'frame {heard.frame}')
            if heard.age is not None:
                said.append(f'{heard.age:.2f} s old')
        mark = 'ok' if not found else ('MISSING' if each.is_needed else 'missing')
        way = 'heard' if each.heard else 'told'
        lines.append(f'{mark:<8}{each.topic:<{width}}  {way:<6}{each.type}: {"; ".join(said)}')
        problems += found
    return [*lines, *([''] if problems else []), *problems]
