"""The files that the page makes when somebody asks: the hand-over, a film of an event."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from strict_files.suggestions import nearest
from surveillance_operator.desk.clips import clip_of
from surveillance_operator.desk.event_index import EventIndex
from surveillance_operator.desk.hand_over import as_csv, as_html, shift_of
from surveillance_operator.desk.questions import moment
from surveillance_operator.page.server import Action, Document

FORMS = ('html', 'csv')
KINDS = ('shift', 'day', 'week')


class DeskDocuments:
    """Makes files of what the runs have left.

    Args:
        index: Their events.
        runs: The folder of the runs.
        wall: Returns the seconds since 1970.
    """

    def __init__(
        self, index: EventIndex, runs: Path, wall: Callable[[], float] = time.time
    ) -> None:
        self._index, self._runs, self._wall = index, runs, wall

    def all(self) -> dict[str, Action]:
        """Return them by name."""
        return {'report': self.report, 'clip': self.clip}

    def report(
        self, begin: str = '', end: str = '', of: str = 'shift', form: str = 'html'
    ) -> Document:
        """Write the hand-over of a shift, or the report of a day or week; html or csv."""
        for value, known in ((of, KINDS), (form, FORMS)):
            if value not in known:
                raise ValueError(f'{value[:40]!r}: expected {nearest(value[:40], known)}')
        until = moment(end) or self._wall()
        since = moment(begin)
        since = until - 8 * 3600.0 if since is None else since
        runs = sorted({each.run for each in self._index.between(since, until)})
        folders = {self._runs / name for name in runs} | set(_changed_since(self._runs, since))
        shift = shift_of(self._index, sorted(folders), since, until)
        if form == 'csv':
            name = f'alarms_{time.strftime("%Y-%m-%d", time.localtime(since))}.csv'
            return Document(as_csv(shift).encode(), 'text/csv; charset=utf-8', name)
        return Document(as_html(shift, of).encode(), 'text/html; charset=utf-8')

    def clip(self, key: str, leaves: bool = True) -> Document:
        """Make a film of an event: ten seconds before and after it began."""
        event = self._index.find(key)
        if event is None:
            raise ValueError(f'no event {key[:80]!r}')
        film = clip_of(
            self._runs / event.run, event.robot, event.began, event.position, blur=leaves
        )
        return Document(film, 'image/webp')


def _changed_since(runs: Path, at: float) -> list[Path]:
    """Return the runs in which something was written since a time, seconds since 1970."""
    try:
        return [each for each in runs.iterdir() if each.is_dir() and each.stat().st_mtime >= at]
    except OSError:
        return []
