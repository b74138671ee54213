"""What a node has found out on a mission, kept beside the record for whoever goes on with it."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from surveillance_runtime.files import FileError, read_json, replace_text

LARGEST = 100_000_000
"""Bytes that are read at most."""


class KeptFile:
    """A small JSON file beside the record of a mission.

    Args:
        record: The record; empty: nothing is kept.
        ending: Follows the record's name.
    """

    def __init__(self, record: str = '', ending: str = '') -> None:
        self._path = Path(record + ending) if record else None
        self._written = ''

    def read(self, take: Callable[[dict[str, Any]], None]) -> str:
        """Give what the file holds; return what is wrong with it, empty when it is right.

        Args:
            take: Takes it, or raises any of the errors of a dictionary that holds something else,
                and has taken nothing then.
        """
        if self._path is None:
            return ''
        try:
            kept = read_json(self._path, LARGEST)
            if kept is not None:
                take(kept)
        except FileError as error:
            return f'{error}; what was learned before is not used'
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            return f'{self._path}: what was learned before is not used: {error}'
        return ''

    def write(self, kept: Mapping[str, Any]) -> None:
        """Write the file in one piece if that changes it; a full disk does not stop the mission."""
        text = json.dumps(kept)
        if self._path is None or text == self._written:
            return
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_text(self._path, text)
            self._written = text
