"""Whether what a robot's drivers say can be true: what was heard, held against each other and
against the profile. `check_up` asks whether messages come; this one doubts them.

Each doubt names its cause, and where one fits the line of the profile to change. No ROS in here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from surveillance_runtime.profile.check_up import (
    NAMELESS,
    OWN_NODES,
    Endpoint,
    GraphSample,
    TopicSample,
    named,
)
from surveillance_runtime.profile.record import RobotProfile

MOST_LATE = 0.4
"""Scans and odometry that are older than this when they come are late, seconds."""
LEAST_RATE = 3.0
"""A scan or odometry that comes more seldom is of little use for driving, 1/s."""
FULL, FLAT_CELL, FULL_CELL = 0.95, 3.3, 4.25
"""A battery that is said to be at least so full, and whose cells have less than so many volts, is
not: lithium cells have 3.3 V when they are nearly empty (iron phosphate when full) and never more
than 4.25 V; a lead battery of 12 V is flat below 10.5 V, which is 3.5 V a cell of three."""
NAV2_NODES = frozenset(
    (
        'controller_server',
        'behavior_server',
        'velocity_smoother',
        'collision_monitor',
        'docking_server',
    )
)
"""They publish commands where Nav2 drives."""


@dataclass(frozen=True)
class RobotDoubt:
    """Something that cannot be as it is said.

    Attributes:
        text: What, and what to do, in one line.
        key: Of the profile, whose change helps; empty: none does.
        value: What to write there, as JSON.
    """

    text: str
    key: str = ''
    value: str = ''

    @property
    def topic(self) -> str:
        """The topic that it is about, with which its text begins."""
        return self.text.partition(': ')[0]

    @property
    def line(self) -> str:
        """The line of the profile; empty: none helps."""
        part, _, name = self.key.rpartition('.')
        if not self.key:
            return ''
        return f'{part}: {{{name}: {self.value}}}' if part else f'{name}: {self.value}'


def battery_doubt(
    percentage: float,
    full: float,
    *,
    most: float = 0.0,
    voltage: float = math.nan,
    cells: int = 0,
) -> str:
    """Return why a driver's percentage is not believed; empty: nothing speaks against it.

    Args:
        percentage: As the driver tells it.
        full: What it tells when full, by the profile.
        most: The greatest that it has told.
        voltage: Of the battery, V; not a number or 0: it is not told.
        cells: How many it has in series; 0: not known.
    """
    if full == 1.0 and 0.0 < percentage <= 1.2 < most:
        return (
            f'percentage {percentage:g} is from a driver that has told {most:g} as well: it tells '
            'percent'
        )
    known = math.isfinite(voltage) and voltage > 1.0
    number = cells or (math.ceil(voltage / FULL_CELL) if known else 0)
    if number and percentage / full >= FULL and voltage / number < FLAT_CELL:
        hint = ': is it 1 percent?' if percentage == full == 1.0 else ''
        return (
            f'percentage {percentage:g} says full, and {voltage:.1f} V say nearly empty '
            f'({voltage / number:.2f} V a cell of {number}){hint}'
        )
    return ''


def doubts(profile: RobotProfile, seen: GraphSample, namespace: str = '') -> Iterator[RobotDoubt]:
    """Yield what cannot be true of what was heard from a robot that stands.

    Args:
        profile: The robot.
        seen: What is there.
        namespace: That its names are in.
    """
    yield from _of_rivals(profile, seen, namespace)
    yield from _of_stamps(profile, seen, namespace)
    yield from _of_odometry(profile, seen, namespace)
    yield from _of_scans(profile, seen, namespace)
    yield from _of_frames(profile, seen, namespace)
    yield from _of_battery(profile, seen, namespace)
    yield from _of_camera(profile, seen, namespace)
    for node, state in seen.states.items():
        if state != 'active':
            yield RobotDoubt(
                f"Nav2's {node} is {state}: it rejects each goal; have its lifecycle manager "
                'activate it'
            )
    yield from (RobotDoubt(text) for text in seen.clashes)
    corners = list(zip(profile.body.footprint[::2], profile.body.footprint[1::2], strict=True))
    if seen.footprint and not _same_corners(corners, seen.footprint):
        theirs = ', '.join(f'[{x:g}, {y:g}]' for x, y in seen.footprint)
        yield RobotDoubt(
            f"Nav2's local_costmap has the footprint [{theirs}], the profile another: one of them "
            'is not of this robot',
            'body.footprint',
            f'[{theirs}]',
        )


def _same_corners(one: Sequence[Sequence[float]], other: Sequence[Sequence[float]]) -> bool:
    """Tell whether each corner of two footprints is one of the other."""
    both = ((one, other), (other, one))
    return all(any(math.dist(a, b) < 0.01 for b in there) for here, there in both for a in here)


def _of_rivals(profile: RobotProfile, seen: GraphSample, namespace: str) -> Iterator[RobotDoubt]:
    topics = profile.topics
    command = named(topics.command, namespace)
    allowed = OWN_NODES if profile.dock.navigator == 'own' else NAV2_NODES
    rivals = sorted({end.node for end in _publishers(seen, command)} - _full(allowed, seen))
    rivals = [each for each in rivals if each.rpartition('/')[2] not in allowed]
    if rivals:
        yield RobotDoubt(
            f'{command}: {", ".join(rivals)} commands the base as well: it does now what one says, '
            'now what the other; stop it, or let it publish to a multiplexer before the base'
        )
    streams = [topics.odom, topics.map, *topics.scans]
    streams += [topics.battery] if profile.battery.source == 'topic' else []
    for topic in (named(each, namespace) for each in streams):
        nodes = sorted({end.node for end in _publishers(seen, topic)} - {NAMELESS})
        if len(nodes) > 1:
            yield RobotDoubt(
                f'{topic}: published by {" and ".join(nodes)}: expected one; what both say is '
                'taken for one sensor'
            )


def _full(names: frozenset[str], seen: GraphSample) -> set[str]:
    ends = [end.node for ends in seen.publishers.values() for end in ends]
    return {node for node in ends if node.rpartition('/')[2] in names}


def _publishers(seen: GraphSample, topic: str) -> Sequence[Endpoint]:
    return seen.publishers.get(topic, ())


def _heard(seen: GraphSample, topic: str, namespace: str) -> tuple[str, TopicSample | None]:
    name = named(topic, namespace)
    return name, seen.heard.get(name)


def _of_stamps(profile: RobotProfile, seen: GraphSample, namespace: str) -> Iterator[RobotDoubt]:
    for topic in (*profile.topics.scans, profile.topics.odom):
        name, heard = _heard(seen, topic, namespace)
        if heard is None or not heard.count:
            continue
        if heard.values.get('unstamped'):
            yield RobotDoubt(
                f'{name}: its stamps are 0: its driver does not fill header.stamp, so that nobody '
                'knows when it measured; it is taken for the present'
            )
        elif heard.age is not None and MOST_LATE < heard.age <= 2.0:
            yield RobotDoubt(
                f'{name}: its messages are {heard.age:.1f} s old when they come: the driver or the '
                'network is late, or its clock is behind'
            )
        elif heard.age is not None and heard.age > 2.0 and seen.has_clock:
            yield RobotDoubt(
                f'{name}: its stamps are of the topic /clock: a simulation; start the patrol with '
                '-p use_sim_time:=true'
            )
        if 0.0 < heard.rate < LEAST_RATE:
            yield RobotDoubt(
                f'{name}: {heard.rate:.1f} messages a second: expected {LEAST_RATE:g} or more; the '
                'robot would drive blindly between two'
            )


def _of_odometry(profile: RobotProfile, seen: GraphSample, namespace: str) -> Iterator[RobotDoubt]:
    name, heard = _heard(seen, profile.topics.odom, namespace)
    frames = profile.frames
    if heard is None or not heard.count:
        found = [child for child, parent in seen.moving.items() if parent == frames.odom]
        if found and not _publishers(seen, name):
            yield RobotDoubt(
                f'{name}: nobody publishes it, and {frames.odom} -> {found[0]} is on tf: odometry '
                'comes by tf alone, and is read there'
            )
        return
    child = str(heard.values.get('child', '')).removeprefix('/')
    if child and child != frames.base:
        yield RobotDoubt(
            f'{name}: its child_frame_id is {child!r}, the profile says frames.base: '
            f'{frames.base!r}',
            'frames.base',
            child,
        )
    elif not child:
        yield RobotDoubt(f'{name}: its child_frame_id is empty: expected {frames.base!r}')
    if heard.values.get('jumps'):
        yield RobotDoubt(
            f'{name}: it jumps by {heard.values["jumps"]:.1f} m while the robot stands: two '
            'drivers, or a driver that begins anew'
        )


def _of_scans(profile: RobotProfile, seen: GraphSample, namespace: str) -> Iterator[RobotDoubt]:
    for topic in profile.topics.scans:
        name, heard = _heard(seen, topic, namespace)
        if heard is None or not heard.count:
            continue
        told = heard.values.get('told')
        if told is not None and told < 0.1:
            yield RobotDoubt(
                f'{name}: {told:.0%} of its rays tell a distance: the lidar is covered, or '
                'does not turn'
            )
        near = heard.values.get('near', 0.0)
        if near > 0.15:
            yield RobotDoubt(
                f'{name}: {near:.0%} of its rays end within the robot: it sees its own body; the '
                'mount in the profile is wrong, or posts stand in its view'
            )
        if heard.values.get('frozen'):
            yield RobotDoubt(
                f'{name}: the same scan comes again and again: its driver repeats the last one'
            )


def _of_frames(profile: RobotProfile, seen: GraphSample, namespace: str) -> Iterator[RobotDoubt]:
    frames = profile.frames
    yield from (RobotDoubt(f'tf: {text}') for text in seen.doubled)
    if profile.dock.navigator == 'own' and seen.moving.get(frames.odom) == frames.map:
        yield RobotDoubt(
            f'tf: another program tells {frames.map} -> {frames.odom} (amcl, slam_toolbox), and '
            'the patrol would as well: end it, or let Nav2 drive (dock.navigator: nav2)'
        )
    rows = zip(*[iter(profile.lidars.mounts)] * 4, strict=True)
    for topic, row in zip(profile.topics.scans, rows, strict=False):
        heard = seen.heard.get(named(topic, namespace))
        at = None if heard is None else seen.places.get(heard.frame.removeprefix('/'))
        if at is None:
            continue
        turned = abs(math.remainder(at[2] - row[2], math.tau))
        if at[3] != (math.cos(row[3]) < 0.0):
            turned = math.pi
        if math.dist(at[:2], row[:2]) > 0.03 or turned > 0.1:
            found = [*(round(each, 3) for each in at[:3]), math.pi if at[3] else 0.0]
            said = [f'[{", ".join(f"{each:.4g}" for each in found)}]']
            yield RobotDoubt(
                f'{named(topic, namespace)}: tf_static has its frame at {said[0]}, the profile at '
                f'[{", ".join(f"{each:.4g}" for each in row)}]: one of them is wrong',
                'lidars.mounts' if len(profile.topics.scans) == 1 else '',
                f'[{said[0]}]',
            )


def _of_battery(profile: RobotProfile, seen: GraphSample, namespace: str) -> Iterator[RobotDoubt]:
    if profile.battery.source != 'topic' or profile.battery.voltages:
        return
    name, heard = _heard(seen, profile.topics.battery, namespace)
    told = [] if heard is None else [float(each) for each in heard.values.get('percentages', ())]
    if not told:
        return
    assert heard is not None
    full, last = profile.battery.full, told[-1]
    if not math.isfinite(last):
        yield RobotDoubt(
            f'{name}: percentage is not a number, as of a driver that measures the voltage alone: '
            'write battery.voltages, pairs of a voltage and its percent'
        )
    elif full == 1.0 and 1.2 < last <= 120.0:
        text = f'{name}: percentage {last:g} where 1 is full: the driver tells percent'
        yield RobotDoubt(text, 'battery.full', '100')
    elif full == 100.0 and 0.0 < last <= 1.0:
        text = f'{name}: percentage {last:g} where 100 is full: expected a share from 0 to 1 then'
        yield RobotDoubt(text, 'battery.full', '1')
    elif why := battery_doubt(
        last,
        full,
        most=max(told),
        voltage=float(heard.values.get('voltage', math.nan)),
        cells=int(heard.values.get('cells', 0)),
    ):
        yield RobotDoubt(f'{name}: {why}', 'battery.full', '100' if full == 1.0 else '1')


def _of_camera(profile: RobotProfile, seen: GraphSample, namespace: str) -> Iterator[RobotDoubt]:
    image, info = (
        named(each, namespace) for each in (profile.topics.image, profile.topics.camera_info)
    )
    if not _publishers(seen, image):
        return
    nodes = ', '.join(end.node for end in _publishers(seen, image))
    if not _publishers(seen, info):
        others = sorted(
            topic
            for topic, ends in seen.publishers.items()
            if any(end.type == 'sensor_msgs/CameraInfo' for end in ends)
        )
        near = others[0].removeprefix(named('', namespace).rstrip('/') + '/') if others else ''
        yield RobotDoubt(
            f'{info}: nobody publishes it, and {nodes} publishes pictures: without it nothing has '
            'a place in them' + (f'; there is {others[0]}' if others else ''),
            'topics.camera_info' if near else '',
            near,
        )
        return
    told = seen.heard.get(info)
    if told is not None and told.count and not told.values.get('focal'):
        yield RobotDoubt(
            f'{info}: its matrix K is 0: the camera is not calibrated, and nothing has a place in '
            'its pictures'
        )
    sizes = [seen.heard[each].values.get('size') for each in (image, info) if each in seen.heard]
    if len(sizes) == 2 and None not in sizes and sizes[0] != sizes[1]:
        yield RobotDoubt(
            f'{info}: it is of pictures of {sizes[1]}, those on {image} are {sizes[0]}: it is of '
            'another resolution'
        )


def amended(text: str, key: str, value: str) -> str:
    """Return the text of a profile with another value; all else of it, comments too, stays.

    Args:
        text: The file's.
        key: As in a `RobotDoubt`.
        value: As JSON or a plain word.
    """
    part, _, name = key.rpartition('.')
    lines = text.splitlines()
    head = next(
        (i for i, line in enumerate(lines) if line.split('#')[0].rstrip() == f'{part}:'), -1
    )
    inline = next((i for i, line in enumerate(lines) if line.startswith(f'{part}: {{')), -1)
    if inline >= 0:
        # A part in one line becomes a block.
        body = lines[inline].partition('{')[2].rpartition('}')[0]
        lines[inline : inline + 1] = [f'{part}:', *(f'  {each}' for each in _entries(body))]
        head = inline
    if head < 0:
        return '\n'.join([*lines, f'{part}:', f'  {name}: {value}']) + '\n'
    at = head + 1
    while at < len(lines) and (not lines[at].strip() or lines[at].startswith((' ', '#'))):
        if lines[at].strip().startswith(f'{name}:'):
            indent = lines[at][: len(lines[at]) - len(lines[at].lstrip())]
            last = at + 1
            while (
                last < len(lines) and lines[last].startswith(f'{indent} ') and lines[last].strip()
            ):
                last += 1
            lines[at:last] = [f'{indent}{name}: {value}']
            return '\n'.join(lines) + '\n'
        at += 1
    lines.insert(head + 1, f'  {name}: {value}')
    return '\n'.join(lines) + '\n'


def _entries(body: str) -> list[str]:
    """Cut `a: 1, b: [1, 2]` at the commas that stand outside of brackets."""
    found, depth, begin = [], 0, 0
    for i, sign in enumerate(body):
        depth += (sign in '[{') - (sign in ']}')
        if sign == ',' and not depth:
            found.append(body[begin:i].strip())
            begin = i + 1
    return [each for each in (*found, body[begin:].strip()) if each]
