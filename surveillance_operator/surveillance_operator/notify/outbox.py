"""The outbox: news that wait on the disk until each sink has taken them.

A sink that cannot be reached is tried again after 1, 2, 4 ... seconds, at most every five minutes,
for a day. What waits outlives the process; what was handed in before is not handed in again.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from surveillance_operator.notify.news import News

FIRST_WAIT, LONGEST_WAIT = 1.0, 300.0
"""Between two tries, seconds; the wait doubles."""
GIVEN_UP_AFTER = 86400.0
"""News that no try could deliver for this long are dropped, seconds."""
MOST_WAITING = 1000
"""So many news wait for a sink; the oldest goes first."""
REMEMBERED = 2000
"""So many keys of news that were handed in are remembered."""

Deliver = Callable[[News], None]
"""Hands news to a sink; raises `DeliveryError` when it did not take them."""


class DeliveryError(Exception):
    """A sink did not take the news; one line without secrets.

    Args:
        problem: What was wrong.
        final: Whether another try cannot help.
    """

    def __init__(self, problem: str, *, final: bool = False) -> None:
        super().__init__(problem)
        self.final = final


@dataclass
class _Waiting:
    news: News
    path: Path
    tries: int = 0
    next_try: float = 0.0


class _Queue:
    """What waits for one sink, in the order it came."""

    def __init__(self, name: str, deliver: Deliver, folder: Path) -> None:
        self.name, self.deliver, self.folder = name, deliver, folder
        self.waiting: deque[_Waiting] = deque()
        self.failing = False


class Outbox:
    """Hands news to sinks, on a thread for each.

    Args:
        folder: Where what waits is kept; made when missing.
        sinks: By name.
        report: Takes a line about a sink that fails, and that works again.
        now: Seconds since 1970.

    Raises:
        OSError: The folder cannot be made or read.
    """

    def __init__(
        self,
        folder: Path,
        sinks: Mapping[str, Deliver],
        report: Callable[[str], object] = lambda _: None,
        now: Callable[[], float] = time.time,
    ) -> None:
        self._folder, self._report, self._now = folder, report, now
        self._changed = threading.Condition()
        self._ended = False
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._known = deque(_keys(folder / 'known.json'), maxlen=REMEMBERED)
        self._queues = [_Queue(name, sinks[name], folder / name) for name in sinks]
        self._number = 0
        for queue in self._queues:
            queue.folder.mkdir(exist_ok=True)
            self._read(queue)
        self._threads = [
            threading.Thread(target=self._work, args=(each,), name=each.name, daemon=True)
            for each in self._queues
        ]

    def start(self) -> None:
        """Begin to deliver."""
        for thread in self._threads:
            thread.start()

    def put(self, news: News) -> bool:
        """Take news for all sinks; return whether they are new. Never waits for a sink."""
        with self._changed:
            if news.key in self._known:
                return False
            self._known.append(news.key)
            for queue in self._queues:
                self._number += 1
                path = queue.folder / f'{self._now():017.6f}_{self._number:06d}.json'
                _write(path, news.kept(), self._report)
                queue.waiting.append(_Waiting(news, path))
                while len(queue.waiting) > MOST_WAITING:
                    oldest = queue.waiting.popleft()
                    oldest.path.unlink(missing_ok=True)
                    self._report(f'{queue.name}: more than {MOST_WAITING} wait, dropped the oldest')
            _write(self._folder / 'known.json', json.dumps(list(self._known)), self._report)
            self._changed.notify_all()
        return True

    def waiting(self) -> dict[str, int]:
        """Return how many news wait for each sink."""
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
                lambda: all(not each.waiting or each.failing for each in self._queues), patience
            )
            self._ended = True
            self._changed.notify_all()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(max(0.0, until - time.monotonic()))

    def deliver_due(self, name: str) -> float | None:
        """Hand over what is due for a sink; return when the next is due, None: nothing waits."""
        queue = next(each for each in self._queues if each.name == name)
        while True:
            with self._changed:
                if not queue.waiting:
                    return None
                first = queue.waiting[0]
                if first.next_try > self._now():
                    return first.next_try
            self._try(queue, first)

    def _try(self, queue: _Queue, first: _Waiting) -> None:
        problem: DeliveryError | None = None
        try:
            queue.deliver(first.news)
        except DeliveryError as error:
            problem = error
        except Exception as error:
            # A sink's fault must not end the others' thread, nor lose the news.
            problem = DeliveryError(type(error).__name__)
        with self._changed:
            if problem is None:
                if queue.failing:
                    self._report(f'{queue.name}: works again')
                queue.failing = False
                self._drop(queue, first)
            elif problem.final or self._now() - first.news.at > GIVEN_UP_AFTER:
                self._report(f'{queue.name}: {problem}; not told: {first.news.text}')
                self._drop(queue, first)
            else:
                if not queue.failing:
                    self._report(f'{queue.name}: {problem}; it is tried again')
                queue.failing = True
                wait = min(FIRST_WAIT * 2.0**first.tries, LONGEST_WAIT)
                first.tries += 1
                first.next_try = self._now() + wait
            self._changed.notify_all()

    def _drop(self, queue: _Queue, each: _Waiting) -> None:
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
            try:
                news = News.from_kept(path.read_text('utf-8'))
            except (OSError, ValueError, KeyError, TypeError):
                path.unlink(missing_ok=True)  # cut off by a crash
                continue
            queue.waiting.append(_Waiting(news, path))


def _keys(path: Path) -> list[str]:
    try:
        keys = json.loads(path.read_text('utf-8'))
    except (OSError, ValueError):
        return []
    return [str(each) for each in keys] if isinstance(keys, list) else []


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
