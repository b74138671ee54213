"""Whether a turn of the base or the arm would show nothing more: then nobody need turn."""

from __future__ import annotations

CAMERA_PATIENCE = 10.0
"""The first picture is waited for so long after the first sweep, seconds of steady time."""


class SeesAround:
    """Settles once all is there that a look needs; owned by whoever calls it, one thread."""

    def __init__(self) -> None:
        self._since: float | None = None
        self._is_settled = False
        self._is_pictured = False

    def scanned(self, now: float) -> None:
        """Take that a sweep came; steady time, seconds."""
        if self._since is None:
            self._since = now

    def pictured(self) -> None:
        """Take that a picture came."""
        self._is_pictured = True

    def judged(
        self, now: float, *, has_camera: bool, has_map: bool, all_around: bool
    ) -> bool | None:
        """Return whether all is seen without a turn; None: that is not known yet.

        Args:
            now: Steady time, seconds.
            has_camera: Whether somebody sends pictures.
            has_map: Whether there is a map.
            all_around: Whether the lidars measure in each direction.
        """
        if not self._is_settled:
            if self._since is None or not has_map:
                return None
            is_late = now - self._since > CAMERA_PATIENCE
            if has_camera and not self._is_pictured and not is_late:
                return None
            self._is_settled = True
        return not has_camera and all_around
