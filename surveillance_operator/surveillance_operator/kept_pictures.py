"""The observer's pictures, for whoever may look; beyond this machine people in them are blurred."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

EVIDENCE = 'evidence'
_PICTURE = re.compile(r'\d_\d{13}_[A-Za-z0-9-]{1,60}\.jpg\Z')
_FOLDER = re.compile(r'[A-Za-z0-9_][A-Za-z0-9_.-]{0,199}')


def kept_picture(runs: Path, name: str, robot: str, run: str, leaves: bool) -> bytes | None:
    """Return a picture as JPEG; None where there is none of that name.

    Args:
        runs: The folder of the runs.
        name: As an event has it.
        robot: Whose event it is; one that was alone has no name.
        run: Its run.
        leaves: Whether it leaves this machine: then people in it are blurred.
    """
    is_sound = _FOLDER.fullmatch(run) and (not robot or _FOLDER.fullmatch(robot))
    if not is_sound or not _PICTURE.match(name):
        return None
    try:
        # Each robot of a fleet has a folder of its own in that of the run.
        return _shown(runs / run / robot / EVIDENCE / name, blur=leaves)
    except OSError:
        return None


@lru_cache(64)
def _shown(path: Path, *, blur: bool) -> bytes:
    if not blur:
        return path.read_bytes()
    # It takes its time, and a page on this machine needs none of it.
    from indoor_watch.privacy import PictureError, shareable

    try:
        return shareable(path)
    except PictureError as error:
        raise OSError(str(error)) from None
