"""Which files directives may read and write: those inside the directories that were allowed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from surveillance_ontology.armor.protocol import DirectiveError
from surveillance_ontology.armor.rendering import shown

_CONTROL = re.compile(r'[\x00-\x1f\x7f]')
MAX_PATH = 4096


class SafePaths:
    """Resolves paths from directives and refuses what lies outside the allowed directories.

    Symbolic links are resolved before the comparison, also those in the allowed directories.

    Args:
        directories: Where files may be read and written; a relative path of a directive stands for
            a file in the first of them.
        read_only: Where files may be read as well.
    """

    def __init__(
        self, directories: Iterable[str | Path], read_only: Iterable[str | Path] = ()
    ) -> None:
        self._writable = tuple(Path(d).expanduser().resolve() for d in directories)
        self._read_only = tuple(Path(d).expanduser().resolve() for d in read_only)

    def to_read(self, text: str) -> Path:
        """Resolve the path of a file to read.

        Raises:
            DirectiveError: Outside the allowed directories, or not a file.
        """
        path = self._resolved(text, (*self._writable, *self._read_only), 'read')
        if not path.is_file():
            what = 'is not a file' if path.exists() else 'does not exist'
            raise DirectiveError(f'path {shown(text)} {what}')
        return path

    def to_write(self, text: str) -> Path:
        """Resolve the path of a file to write; its directory must exist.

        Raises:
            DirectiveError: Outside the allowed directories, a directory, or in no directory.
        """
        path = self._resolved(text, self._writable, 'written')
        if path.is_dir():
            raise DirectiveError(f'path {shown(text)} is a directory, expected a file')
        if not path.parent.is_dir():
            raise DirectiveError(f'path {shown(text)}: directory {path.parent} does not exist')
        return path

    def _resolved(self, text: str, allowed: tuple[Path, ...], verb: str) -> Path:
        if not text:
            raise DirectiveError('path is empty, expected a file')
        if len(text) > MAX_PATH or _CONTROL.search(text):
            raise DirectiveError(f'path {shown(text)} is not a path')
        base = self._writable[0] if self._writable else Path.cwd()
        try:
            path = (base / Path(text).expanduser()).resolve()
            path.exists()
        except OSError as error:
            raise DirectiveError(f'path {shown(text)}: {error.strerror}') from None
        except (RuntimeError, ValueError) as error:
            raise DirectiveError(f'path {shown(text)}: {error}') from None
        if not any(path.is_relative_to(directory) for directory in allowed):
            where = ', '.join(map(str, allowed)) or 'no directory'
            raise DirectiveError(f'path {shown(text)} may not be {verb}; allowed is {where}')
        return path
