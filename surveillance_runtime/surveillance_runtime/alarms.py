"""All kinds of incidents in one table: when each begins and is over, and what a person is to do.

A condition at its bound holds and does not hold in turn. Two bounds and two times keep it from
being told again and again, as ISA-18.2-2016 (clause 16.5, and its annex on alarm design) has them:
a deadband between the value where it begins and the one where it is over, an **on-delay** for which
it must hold before it is told, and an **off-delay** for which it must have been away before it has
returned to normal. `Incidents` keeps the delays of this table, for all nodes alike; the bounds are
those of whoever measures, who takes them from here where they are numbers of its own.

`docs/reference/alarms.md` is written from this table (``launch.py params --write``). A kind of a
node of your own, which is not in it, begins and ends at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum


class Severity(StrEnum):
    """How much an incident matters."""

    WARNING = 'warning'
    """A person should know; nobody is called."""
    ALARM = 'alarm'
    """A person is called."""


SILENT_AFTER = 8.0
"""Seconds of real time without a message of use after which a topic counts as silent; a node that
is started again is there before."""
CALM = 30.0
"""The off-delay of what may come and go by the second, seconds."""
SLOW = 60.0
"""The off-delay of what changes over minutes, seconds."""
DISK_LOW, DISK_WELL = 100e6, 200e6
"""Bytes that are free where a full disk is told, and where it is over."""
CLOCK_SET = 1.0
"""A machine's clock that differs by more from what the steady one says was set, seconds."""
CONNECTIONS_WELL = 0.75
"""The share of the page's connections below which their bound is no more reached."""


@dataclass(frozen=True)
class AlarmKind:
    """One kind of incident.

    Attributes:
        cause: Its kind, and its name in capitals where that is one of many: `door D1` is of `door
            NAME`.
        severity: How much it matters where whoever tells does not say otherwise.
        what: What it means.
        begins, ends: The bounds in words.
        action: What a person is to do; empty: nothing.
        on_delay: For how long it must hold before it is told, seconds; 0: whoever measures has
            waited already, or it counts at once.
        off_delay: For how long it must have been away before it is over, seconds; 0: it ends by
            another event than it began by.
    """

    cause: str
    severity: Severity
    what: str
    begins: str
    ends: str
    action: str = ''
    on_delay: float = 0.0
    off_delay: float = 0.0


_W, _A = Severity.WARNING, Severity.ALARM
ALARMS = (
    AlarmKind(
        *('robot help', _A, 'the robot waits for help, and no other cause is known'),
        'a step failed, also after what the robot tries by itself',
        'a step has worked',
        'read the text, put it right; the mission goes on by itself',
    ),
    AlarmKind(
        *('door NAME', _A, 'closed doors keep the robot from where it is to go'),
        'the robot waits for help and knows of closed doors',
        'a step has worked',
        'open the door, or say `door NAME open` where it is',
    ),
    AlarmKind(
        *('place NAME', _A, 'a place cannot be reached'),
        'the robot waits for help on the way there',
        'a step has worked',
        'clear the way, or remove the room',
    ),
    AlarmKind(
        *('station NAME', _A, 'the robot cannot charge there'),
        'a way to it, or docking, failed after all tries; or no `station` is given and the battery '
        'is low',
        'the robot is docked, or on its way',
        'clear the station, bring the robot there',
    ),
    AlarmKind(
        *('battery charge', _A, 'a robot that is held must charge'),
        'paused, stopped or waiting, and the charge is below what takes it home, for 5 s',
        'it goes on, charges, or the charge is enough, for 60 s',
        'release the robot, or bring it to its station',
        on_delay=5.0,
        off_delay=SLOW,
    ),
    AlarmKind(
        *('robot purpose', _A, 'the mission does nothing, and nothing explains it'),
        'no decision, motion, exploring, charging or word for 10 s longer than the state explains '
        '(exploring: its time; a drive: the 30 s of its own recovery; charging: '
        '`charge_stall_seconds`)',
        'something happens, and no such silence for 30 s',
        'read the log: its text names the step that it waits for',
        off_delay=CALM,
    ),
    AlarmKind(
        *('robot pose', _A, 'the robot does not know where it is'),
        'its pose is not sure for 10 s while it stands',
        'it is sure for 30 s',
        'drive it about, or set its pose',
        off_delay=CALM,
    ),
    AlarmKind(
        *('robot mount', _A, 'scans contradict the odometry'),
        'the mount or the wheels are measured wrong over several turns and ways',
        'they agree again',
        'correct the profile as the text says, start again',
        off_delay=SLOW,
    ),
    AlarmKind(
        *(
            'robot NAME',
            _W,
            'a robot of the fleet stands or is silent; a robot does not listen, is '
            'commanded by others, is started twice; an input is missing',
        ),
        'seen in two looks, some seconds apart',
        'not seen for 30 s',
        'read the text, which names the node and its host',
        off_delay=CALM,
    ),
    AlarmKind(
        *('topic NAME', _W, 'a topic is silent (an alarm), or has another publisher or type'),
        f'no message of use for {SILENT_AFTER:g} s; another publisher within the last 10 s',
        'messages come, or the other one has gone, for 30 s',
        'look after the sensor or the driver; end the other node',
        off_delay=CALM,
    ),
    AlarmKind(
        *('sight SOURCE CAUSE', _W, 'pictures or scans of the observer are of no use'),
        'most of the last ones are of no use',
        'they are of use for 60 s',
        'look after camera, light and pose',
        off_delay=SLOW,
    ),
    AlarmKind(
        *('node NAME', _A, 'a program dies again and again'),
        'five deaths in ten minutes',
        'none for ten minutes',
        'read its last lines in the log of the run',
    ),
    AlarmKind(
        *('sink NAME', _A, 'somebody cannot be told'),
        'it can never take something, or has not worked for five minutes',
        'it has taken something',
        'look after its address, password and network; `alarm test NAME`',
    ),
    AlarmKind(
        *('disk NAME', _A, 'the disk of the run is almost full: recording and record end'),
        f'less than {DISK_LOW / 1e6:g} MB are free for 5 s',
        f'more than {DISK_WELL / 1e6:g} MB are free for 60 s',
        'delete what is not needed, or start with a smaller --keep',
        on_delay=5.0,
        off_delay=SLOW,
    ),
    AlarmKind(
        *('clock NAME', _W, "the machine's clock was set: times of the log jump"),
        f'it differs by more than {CLOCK_SET:g} s from what the steady clock says',
        'it was not set for 10 min',
        'let chrony or ntpd slew it',
        off_delay=600.0,
    ),
    AlarmKind(
        *('page connections', _W, 'the page has as many connections as it may have'),
        'one had to make room for another',
        f'below {CONNECTIONS_WELL:.0%} of the bound for 60 s',
        'close pages that nobody looks at; see who connects',
        off_delay=SLOW,
    ),
    AlarmKind(
        *('person stop', _W, 'a person has stopped the robot'),
        'a stop is requested',
        'a person has released it',
        'release it when it may drive',
    ),
    AlarmKind(
        *('event NUMBER', _A, 'the observer has seen what a rule calls an alert'),
        'the rule of `watch.yaml`, seen twice or verified',
        'a look shows that it is over, or a person says so',
        'look at the pictures, acknowledge it',
    ),
)
"""Every kind. Of a cause its own line counts, else that of its kind."""
_OTHER = AlarmKind('', Severity.WARNING, '', '', '')
_BY_CAUSE = {each.cause: each for each in ALARMS}
_BY_KIND = {
    kind: each
    for each in reversed(ALARMS)
    for kind, _, name in [each.cause.partition(' ')]
    if name.isupper()
}


def alarm_kind(kind: str, name: str) -> AlarmKind:
    """Return what is known of a cause; one of a stranger begins and ends at once."""
    return _BY_CAUSE.get(f'{kind} {name}') or _BY_KIND.get(kind) or _OTHER


def is_known(kind: str) -> bool:
    """Tell whether the table has a kind of causes."""
    return any(each.cause.partition(' ')[0] == kind for each in ALARMS)


def page() -> str:
    """Return `docs/reference/alarms.md`."""
    return '\n'.join([*_HEAD, *_rows()]) + '\n'


_HEAD = """\
# Alarms

Every kind of incident, written by `python3 launch.py params --write` from
`surveillance_runtime/alarms.py`; a test compares. [Answer alarms](../how-to/answer_alarms.md) says
how they are acknowledged and shelved. An incident of severity `alarm` calls a person until somebody
acknowledges it. It returns to normal when it has been away for its off-delay (ISA-18.2).

| cause | severity | what | begins | is over | what to do |
|---|---|---|---|---|---|""".splitlines()


def _rows() -> Iterator[str]:
    for each in ALARMS:
        cells = (each.what, each.begins, each.ends, each.action or 'nothing')
        yield f'| `{each.cause}` | {each.severity} | {" | ".join(cells)} |'
