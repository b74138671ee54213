"""Believing a marker only after several pictures agree."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable


class Confirmation:
    """Counts in how many of the last pictures each id was seen.

    Args:
        known_frames: Pictures that must show an id of the known list.
        unknown_frames: Pictures that must show any other id.
        window: The pictures that count, as a multiple of those that must show the id: 2 means that
            half of them may miss it.
        confirmed: Ids that are believed from the start.
    """

    def __init__(
        self,
        known_frames: int,
        unknown_frames: int,
        window: int = 2,
        confirmed: Iterable[int] = (),
    ) -> None:
        self._needed = {True: known_frames, False: unknown_frames}
        self._window = window
        self._frame = 0
        self._seen: defaultdict[int, deque[int]] = defaultdict(deque)
        self._confirmed: set[int] = set(confirmed)

    @property
    def confirmed(self) -> frozenset[int]:
        """All ids confirmed so far."""
        return frozenset(self._confirmed)

    def picture(self, ids: Iterable[tuple[int, bool]]) -> list[int]:
        """Take note of one picture.

        Args:
            ids: Each id in the picture and whether it is known.

        Returns:
            The ids confirmed by this picture, for the first time.
        """
        self._frame += 1
        new = []
        for marker_id, known in dict(ids).items():
            needed = self._needed[known]
            frames = self._seen[marker_id]
            frames.append(self._frame)
            while frames[0] <= self._frame - needed * self._window:
                frames.popleft()
            if len(frames) >= needed and marker_id not in self._confirmed:
                self._confirmed.add(marker_id)
                new.append(marker_id)
        return new
