"""The outbox: notifications that wait on the disk until each sink has taken them.

A sink that cannot be reached is tried again after 1, 2, 4 ... seconds, at most every five minutes,
for a day from when this process has it, by a clock that nobody sets. What one sink can never take,
as its text cannot be written in a mail, is put aside and told of; what it does not take now lets
the next one pass. What waits outlives the process, a file that cannot be read is put aside; what
was handed in before is not handed in again. What waits in the outbox of a run that has ended is
taken over by the next one: an all-clear that is still due is sent.
"""

from __future__ import annotations

import fcntl
import json
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Container, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from strict_files.files import keep_aside, read_json
from surveillance_operator.notify.notification import Notification
from surveillance_runtime.event_log import steady_now

FIRST_WAIT, LONGEST_WAIT = 1.0, 300.0
"""Between two tries, seconds; the wait doubles."""
GIVEN_UP_AFTER = 86400.0
"""Notification that no try could deliver for this long is dropped, seconds."""
TROUBLE_AFTER = 300.0
"""A sink that has not worked for so long is told of on the others, seconds."""
MOST_WAITING = 1000
"""So many notifications wait for a sink; the oldest goes first."""
REMEMBERED = 2000
"""So many keys of notifications that were handed in are remembered."""

KNOWN = 'known.json'
LARGEST = 1_000_000
"""Bytes that are read of a file."""

Deliver = Callable[[Notification], None]
"""Hands a notification to a sink; raises `DeliveryError` when it did not take it."""


class DeliveryError(Exception):
    """A sink did not take a notification; one line without secrets.

    Args:
        problem: What was wrong.
        final: Whether another try cannot help.
    """

    def __init__(self, problem: str, *, final: bool = False) -> None:
        super().__init__(problem)
        self.final = final


@dataclass
class _Pending:
    notification: Notification
    path: Path
    since: float
    tries: int = 0
    next_try: float = 0.0


class _Queue:
    """What waits for one sink, in the order it came."""

    def __init__(self, name: str, deliver: Deliver, folder: Path) -> None:
        self.name, self.deliver, self.folder = name, deliver, folder
        self.waiting: deque[_Pending] = deque()
        # Since when it does not work, by how many tries in a row, and until when it is left alone.
        self.failing_since: float | None = None
        self.failures = 0
        self.rests_until = 0.0
        self.is_told = False

    def is_done(self) -> bool:
        """Tell whether another moment's wait would help none."""
        return not self.waiting or self.failing_since is not None

    def due(self, now: float) -> _Pending | None:
        """Return what is to be tried now; None: nothing is."""
        if now < self.rests_until:
            return None
        return next((each for each in self.waiting if each.next_try <= now), None)

    def next_due(self) -> float | None:
        """Return when something is to be tried; None: nothing waits."""
        first = min((each.next_try for each in self.waiting), default=None)
        return None if first is None else max(first, self.rests_until)


class Outbox:
    """Hands notifications to sinks, on a thread for each.

    Args:
        folder: Where what waits is kept; made when missing.
        sinks: By name.
        report: Takes a line about a sink that fails, and that works again.
        now: Seconds on a clock that nobody sets.
        trouble: Takes the name of a sink that a person should look at, and why; empty: it works.

    Raises:
        OSError: The folder cannot be made or read.
    """

    def __init__(
        self,
        folder: Path,
        sinks: Mapping[str, Deliver],
        report: Callable[[str], object] = lambda _: None,
        now: Callable[[], float] = steady_now,
        trouble: Callable[[str, str], object] = lambda _sink, _text: None,
    ) -> None:
        self._folder, self._report, self._now = folder, report, now
        self._trouble = trouble
        self._changed = threading.Condition()
        self._ended = False
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        # Held for life: nobody else takes over what waits here.
        self._lock = _locked(folder)
        self._known = deque(self._keys(folder / KNOWN), maxlen=REMEMBERED)
        self._queues = [_Queue(name, sinks[name], folder / name) for name in sinks]
        self._number = 0
        for queue in self._queues:
            queue.folder.mkdir(exist_ok=True)
            self._read(queue)
        self._threads = [
            threading.Thread(target=self._work, args=(each,), name=each.name, daemon=True)
            for each in self._queues
        ]

    def take_over(self, folder: Path, since: float) -> None:
        """Take what waits in the outbox of another run, unless that goes on; before `start`.

        Args:
            folder: That outbox.
            since: What is older is of no use any more, seconds since 1970.
        """
        lock = _locked(folder) if folder != self._folder else None
        if lock is None:
            return
        for queue in self._queues:
            for path in sorted((folder / queue.name).glob('*.json')):
                with suppress(OSError, ValueError, KeyError, TypeError):
                    notification = Notification.from_kept(read_json(path, LARGEST))
                    if notification.at >= since:
                        self._number += 1
                        own = queue.folder / f'{self._number:012d}.json'
                        _write(own, notification.kept(), self._report)
                        queue.waiting.append(_Pending(notification, own, self._now()))
                    path.unlink()
        os.close(lock)

    def start(self) -> None:
        """Begin to deliver."""
        for thread in self._threads:
            thread.start()

    def put(self, notification: Notification, only: Container[str] | None = None) -> bool:
        """Take one; return whether it is new. Never waits for a sink.

        Args:
            notification: The notification.
            only: The names of the sinks that it is for; None: all.
        """
        with self._changed:
            if notification.key in self._known:
                return False
            self._known.append(notification.key)
            for queue in self._queues:
                if only is not None and queue.name not in only:
                    continue
                self._number += 1
                path = queue.folder / f'{self._number:012d}.json'
                _write(path, notification.kept(), self._report)
                queue.waiting.append(_Pending(notification, path, self._now()))
                while len(queue.waiting) > MOST_WAITING:
                    oldest = queue.waiting.popleft()
                    oldest.path.unlink(missing_ok=True)
                    self._report(f'{queue.name}: more than {MOST_WAITING} wait, dropped the oldest')
            _write(self._folder / KNOWN, json.dumps(list(self._known)), self._report)
            self._changed.notify_all()
        return True

    def waiting(self) -> dict[str, int]:
        """Return how many wait for each sink."""
        with self._changed:
            return {each.name: len(each.waiting) for each in self._queues}

    def close(self, patience: float = 3.0) -> None:
        """Try once more for what has not failed yet, then end; what is left stays on the disk.

        Args:
            patience: How long to wait for sinks, seconds.
        """
        until = time.monotonic() + patience
        with self._changed:
            self._changed.wait_for(
                lambda: all(not q.waiting or q.failing_since is not None for q in self._queues),
                patience,
            )
            self._ended = True
            self._changed.notify_all()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(max(0.0, until - time.monotonic()))
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def deliver_due(self, name: str) -> float | None:
        """Hand over what is due for a sink; return when the next is due, None: nothing waits."""
        queue = next(each for each in self._queues if each.name == name)
        while True:
            with self._changed:
                each = queue.due(self._now())
                if each is None:
                    return queue.next_due()
            self._try(queue, each)

    def _try(self, queue: _Queue, each: _Pending) -> None:
        problem: DeliveryError | None = None
        try:
            queue.deliver(each.notification)
        except DeliveryError as error:
            problem = error
        except (ValueError, TypeError) as error:
            # What it holds cannot be written in the sink's form, today or tomorrow.
            problem = DeliveryError(f'{type(error).__name__}: {error!s:.100}', final=True)
        except Exception as error:
            # A sink's fault must not end the others' thread, nor lose what waits.
            problem = DeliveryError(type(error).__name__)
        trouble: str | None = None
        with self._changed:
            if problem is None:
                trouble = self._taken(queue, each)
            elif problem.final or self._now() - each.since > GIVEN_UP_AFTER:
                trouble = f'{problem}; not told: {each.notification.text}'
                self._report(f'{queue.name}: {trouble}')
                queue.is_told = True
                self._drop(queue, each)
            else:
                trouble = self._failed(queue, each, problem)
            self._changed.notify_all()
        if trouble is not None:
            self._trouble(queue.name, trouble)

    def _taken(self, queue: _Queue, each: _Pending) -> str | None:
        """Note that a sink works; return the end of its trouble, None: it had none."""
        if queue.failing_since is not None:
            self._report(f'{queue.name}: works again')
        queue.failing_since, queue.failures, queue.rests_until = None, 0, 0.0
        self._drop(queue, each)
        was_told, queue.is_told = queue.is_told, False
        return '' if was_told else None

    def _failed(self, queue: _Queue, each: _Pending, problem: DeliveryError) -> str | None:
        """Note that a sink took one not now; return its trouble when that is to be told."""
        now = self._now()
        if queue.failing_since is None:
            queue.failing_since = now
            self._report(f'{queue.name}: {problem}; it is tried again')
        wait = min(FIRST_WAIT * 2.0**each.tries, LONGEST_WAIT)
        each.tries += 1
        each.next_try = now + wait
        queue.failures += 1
        if queue.failures > 1:
            # It was not that one's: the others wait, too.
            rest = min(FIRST_WAIT * 2.0 ** (queue.failures - 2), LONGEST_WAIT)
            queue.rests_until = now + rest
        if now - queue.failing_since < TROUBLE_AFTER or queue.is_told:
            return None
        queue.is_told = True
        return f'{problem} for {now - queue.failing_since:.0f} s; {len(queue.waiting)} wait'

    def _drop(self, queue: _Queue, each: _Pending) -> None:
        if each in queue.waiting:
            queue.waiting.remove(each)
        each.path.unlink(missing_ok=True)

    def _work(self, queue: _Queue) -> None:
        while True:
            due = self.deliver_due(queue.name)
            with self._changed:
                if self._ended:
                    return
                if due is None and queue.waiting:
                    continue
                wait = None if due is None else max(0.01, min(due - self._now(), LONGEST_WAIT))
                self._changed.wait(wait)
                if self._ended:
                    return

    def _read(self, queue: _Queue) -> None:
        for path in sorted(queue.folder.glob('*.json')):
            if path.stem.isdecimal():
                self._number = max(self._number, int(path.stem))
            try:
                notification = Notification.from_kept(read_json(path, LARGEST))
            except (ValueError, KeyError, TypeError) as error:
                self._put_aside(path, error)
                continue
            queue.waiting.append(_Pending(notification, path, self._now()))

    def _keys(self, path: Path) -> list[str]:
        try:
            keys = read_json(path, LARGEST)
            if not isinstance(keys, list | None):
                raise ValueError('expected a list')
        except ValueError as error:
            self._put_aside(path, error)
            keys = None
        return [str(each) for each in keys or ()]

    def _put_aside(self, path: Path, error: Exception) -> None:
        problem = str(error).removeprefix(f'{path}: ')
        self._report(f'{path}: damaged: {problem:.100}; it is put aside, the others are told')
        with suppress(OSError):
            keep_aside(path)


def _locked(folder: Path) -> int | None:
    """Return the locked descriptor of an outbox; None: somebody else has it, or it is none."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def _write(path: Path, text: str, report: Callable[[str], object]) -> None:
    """Write a file whole or not at all."""
    part = path.with_suffix('.part')
    try:
        with open(part, 'w', encoding='utf-8') as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        report(f'{path.parent.name}: cannot be kept on the disk: {error.strerror}')
