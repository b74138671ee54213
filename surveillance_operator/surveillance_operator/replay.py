"""Plays a recording on the page, at any speed, from any moment.

What the page showed is in the recording's time line, so that a jump reads little; what lidar and
camera saw comes from the recorded messages. A recording without a time line, by `ros2 bag record`
for example, gets one while it is shown.
"""

from __future__ import annotations

import bisect
import contextlib
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strict_files.files import FileError
from strict_files.suggestions import nearest
from surveillance_operator.desk.documents import DeskDocuments
from surveillance_operator.desk.event_index import EventIndex, read_run
from surveillance_operator.desk.questions import EventQuestions
from surveillance_operator.kept_pictures import kept_picture
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Action, Page
from surveillance_operator.recording.runs import Recording, find_recordings, run_parser
from surveillance_operator.recording.timeline import Timeline
from surveillance_operator.run_entries import marks_of
from surveillance_runtime.command_line import EXIT_BAD_INPUT, page_address
from surveillance_runtime.event_log import MARKS
from surveillance_runtime.run_files import TIMELINE

if TYPE_CHECKING:
    from surveillance_operator.recording.stored import RecordedSights


SPEEDS = 0.1, 100.0
PERIOD = 0.05
"""Seconds between two steps."""
LOOK_PERIOD = 0.2
"""Seconds between two looks at what lidar and camera saw."""
MOST_LINES = 400
"""Lines that one step applies; where more have passed, it jumps."""


@dataclass
class Track:
    """What is played of one robot.

    Attributes:
        line: What the page showed.
        sights: What lidar and camera saw; None for nothing.
        read: Returns how much of the recording is in the time line, 0 to 1.
        number: Of the line that is shown.
        marks: When what happened, seconds since 1970, as the log has it; empty: as the page showed.
    """

    line: Timeline
    sights: RecordedSights | None = None
    read: Callable[[], float] = lambda: 1.0
    number: int = -1
    marks: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def next_mark(self, kind: str, at: float) -> float | None:
        """Return when something of a kind happened next after a time; None: nothing did."""
        if not self.marks:
            return self.line.next_mark(kind, at)
        times = self.marks.get(kind, ())
        later = bisect.bisect_right(times, at + 1e-3)
        return times[later] if later < len(times) else None


class Player:
    """Where a replay is, and how fast it goes.

    Args:
        tracks: What is played, by the robots' names; a robot that was alone has none.
        broadcaster: Where it is shown.
        index: What happened in the runs; None: nothing is known of it.
    """

    def __init__(
        self,
        tracks: Mapping[str, Track],
        broadcaster: Broadcaster,
        index: EventIndex | None = None,
    ) -> None:
        self._tracks = dict(tracks)
        self._index = EventIndex() if index is None else index
        self._desk: object = None
        self._broadcaster = broadcaster
        self._lock = threading.Lock()
        self._begin = min(each.line.times[0] for each in self._tracks.values())
        self._time = self._begin
        self._speed = 1.0
        self._playing = True
        self._ended = threading.Event()
        self.seek(0.0)

    def run(self) -> None:
        """Play until `stop`."""
        before = time.monotonic()
        next_look, seen_at, grows = 0.0, -1.0, True
        while not self._ended.wait(PERIOD):
            now = time.monotonic()
            with self._lock:
                if self._playing:
                    self._forward((now - before) * self._speed)
                if grows and now >= next_look:
                    grows = self._read() < 1.0
                    for each in self._tracks.values():
                        each.line.extend()
                    self._tell()
                at = self._time
            if now >= next_look and at != seen_at:
                seen_at = at
                self.see()
            if now >= next_look:
                next_look = now + LOOK_PERIOD
            before = now

    @property
    def length(self) -> float:
        """Seconds of the recording that can be shown."""
        return self._end - self._begin

    @property
    def _end(self) -> float:
        return max(each.line.times[-1] for each in self._tracks.values())

    def _read(self) -> float:
        return min(each.read() for each in self._tracks.values())

    def see(self) -> None:
        """Show what the lidars saw at this moment of the recording."""
        self._show_desk(self._time)
        for robot, track in self._tracks.items():
            if track.sights is not None:
                seen = {'scan': track.sights.scan(self._time)}
                self._broadcaster.show_parts(seen, None, whole=False, robot=robot)

    @property
    def time(self) -> float:
        """The moment that is shown, seconds since 1970."""
        return self._time

    def _show_desk(self, at: float) -> None:
        """Show which alarms were open at a moment, and how far each was."""
        found = [each.to_json(at, later=True) for each in self._index.were_open_at(at)]
        if found != self._desk:
            self._desk = found
            part = {'at': round(at, 2), 'count': len(found), 'open': found, 'mutes': []}
            self._broadcaster.show_desk(part)

    def jpeg(self, robot: str) -> bytes | None:
        """Return what a robot's camera saw at this moment of the recording."""
        track = self._tracks.get(robot)
        return None if track is None or track.sights is None else track.sights.jpeg(self._time)

    def stop(self) -> None:
        """End `run`."""
        self._ended.set()

    def seek(self, to: float) -> str:
        """Go to a moment, seconds from the recording's start."""
        with self._lock:
            self._jump(self._begin + max(0.0, float(to)))
        return 'moved'

    def actions(self) -> dict[str, Action]:
        """Return what a viewer may do."""
        return {
            'seek': self.seek,
            'speed': self._set_speed,
            'play': lambda: self._set_playing(True),
            'pause': lambda: self._set_playing(False),
            'jump': self._jump_to_mark,
        }

    def _set_speed(self, speed: float) -> str:
        speed = float(speed)
        if not SPEEDS[0] <= speed <= SPEEDS[1]:
            raise ValueError(f'speed {speed:g}: expected {SPEEDS[0]} to {SPEEDS[1]:g}')
        with self._lock:
            self._speed = speed
            self._tell()
        return f'speed {speed:g}'

    def _set_playing(self, playing: bool) -> str:
        with self._lock:
            self._playing = playing
            self._tell()
        return 'playing' if playing else 'paused'

    def _jump_to_mark(self, kind: str) -> str:
        if kind not in MARKS:
            raise ValueError(f'{kind!r}: expected {nearest(kind, MARKS)}')
        with self._lock:
            marks = [each.next_mark(kind, self._time) for each in self._tracks.values()]
            at = min((mark for mark in marks if mark is not None), default=None)
            if at is None:
                raise ValueError(f'no {kind} after this moment')
            self._jump(at)
        return f'at the {kind}'

    def _jump(self, at: float) -> None:
        self._time = min(at, self._end)
        for robot, track in self._tracks.items():
            track.number, now, parts = track.line.at(self._time)
            self._broadcaster.show_parts(parts, now, whole=True, robot=robot)
        self._tell()

    def _forward(self, seconds: float) -> None:
        self._time = min(self._time + seconds, self._end)
        for robot, track in self._tracks.items():
            times, number = track.line.times, track.number
            changed: dict[str, Any] = {}
            now = None
            while number + 1 < len(times) and times[number + 1] <= self._time:
                number += 1
                if number - track.number > MOST_LINES:
                    self._jump(self._time)
                    return
                then, parts = track.line.line(number)
                now = now if then is None else then
                changed.update(parts)
            track.number = number
            self._broadcaster.show_parts(changed, now, whole=False, robot=robot)
        self._tell()

    def _tell(self) -> None:
        replay = {
            'at': round(self._time - self._begin, 1),
            'length': round(self.length, 1),
            'playing': self._playing,
            'speed': self._speed,
            'read': round(self._read(), 2),
            'time': round(self._time, 1),
        }
        (robot, *_) = self._tracks
        self._broadcaster.show_parts({'replay': replay}, None, whole=False, robot=robot)


def main(argv: Sequence[str] | None = None) -> int:
    """Show a recorded mission on a page until Ctrl-C; the exit code is 2 for bad input."""
    parser = run_parser('replay', 'Shows a recorded mission in a browser, with a slider.')
    parser.add_argument(
        '--web-address',
        default='127.0.0.1:8080',
        metavar='HOST:PORT',
        help='address of the page; others than 127.0.0.1 need the printed token (default: '
        '%(default)s)',
    )
    options = parser.parse_args(argv)
    try:
        host, port = page_address(options.web_address)
    except ValueError as error:
        parser.error(str(error))
    with contextlib.ExitStack() as stack:
        try:
            recordings = find_recordings(options.run, options.runs)
            broadcaster = Broadcaster()
            index = index_of(recordings)
            player = open_player(recordings, broadcaster, stack, index)
            runs = next(iter(recordings.values())).run.parent
            page = Page(
                broadcaster,
                questions=EventQuestions(index, time.time, lambda: player.time).all(),
                documents=DeskDocuments(index, runs, lambda: player.time).all(),
                evidence=partial(kept_picture, runs),
                actions=player.actions(),
                picture=player.jpeg,
                host=host,
                port=port,
                replay=True,
            )
        except (FileError, OSError) as error:
            print(f'replay: {error}', file=sys.stderr)
            return EXIT_BAD_INPUT
        thread = threading.Thread(target=player.run, name='replay', daemon=True)
        thread.start()
        shown = ', '.join(str(each.name) for each in recordings.values())
        print(f'{shown} is shown at {page.address} until Ctrl-C', flush=True)
        try:
            page.run()
        except KeyboardInterrupt:
            pass
        finally:
            player.stop()
            broadcaster.close()
            thread.join()
    return 0


def open_player(
    recordings: Mapping[str, Recording],
    broadcaster: Broadcaster,
    stack: contextlib.ExitStack,
    index: EventIndex | None = None,
) -> Player:
    """Return a player of the recordings of a run's robots; what it needs ends with the stack.

    One robot's recording that cannot be read costs a line, and the others are played.

    Raises:
        FileError: None can be read, or none holds anything of a mission.
    """
    tracks: dict[str, Track] = {}
    problems: list[FileError] = []
    for robot, each in recordings.items():
        try:
            tracks[robot] = _track(each, stack)
        except FileError as error:
            problems.append(error)
    if not tracks:
        raise problems[0]
    for problem in problems:
        print(f'replay: {problem}: it is left out', file=sys.stderr)
    return Player(tracks, broadcaster, index)


def index_of(recordings: Mapping[str, Recording]) -> EventIndex:
    """Return what happened in the runs of recordings; nothing of another program's."""
    index = EventIndex()
    for run in {each.run for each in recordings.values() if each.log is not None}:
        read_run(index, run)
    return index


def _track(recording: Recording, stack: contextlib.ExitStack) -> Track:
    path, read = recording.timeline, lambda: 1.0
    if not recording.is_whole:
        assert recording.messages is not None  # one of the two was found
        # Only here: a recording with a time line is replayed where no ROS is installed.
        from surveillance_operator.recording.stored import Conversion

        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix='replay-'))
        path = Path(folder) / TIMELINE
        conversion = Conversion(recording.messages, path, keep=recording.timeline)
        stack.callback(conversion.stop)
        conversion.start()
        read = conversion.progress
    line = Timeline(path, lambda problem: print(f'replay: {problem}', file=sys.stderr))
    stack.callback(line.close)
    marks = {} if recording.log is None else marks_of(recording.log)
    return Track(line, _sights(recording, stack), read, marks=marks)


def _sights(recording: Recording, stack: contextlib.ExitStack) -> RecordedSights | None:
    if recording.messages is None:
        return None
    try:
        from surveillance_operator.recording.stored import RecordedSights
    except ImportError:  # no ROS: lidar and camera stay dark
        return None
    sights = RecordedSights(recording.messages)
    stack.callback(sights.close)
    return sights


if __name__ == '__main__':
    sys.exit(main())
