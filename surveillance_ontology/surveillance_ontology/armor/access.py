"""What directives may do: limits of size and time, and which files they may read and write."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from surveillance_ontology.armor.protocol import DirectiveError
from surveillance_ontology.armor.rendering import shown

DATA = Path(__file__).parent.parent / 'data'
"""The ontologies that come with this package."""
_CONTROL = re.compile(r'[\x00-\x1f\x7f]')
MAX_PATH = 4096


@dataclass(frozen=True)
class Settings:
    """Choices of an `ArmorService`.

    Attributes:
        directories: Where LOAD, SAVE and LOG may read and write.
        read_only_directories: Where LOAD may read as well.
        enforce_mount: Refuse changes by other clients while one is mounted; ARMOR does not.
        narrow_doubles: Store DOUBLE as xsd:float, as ARMOR does.
        allow_web: Let LOAD WEB fetch documents.
        sparql_derived: SPARQL sees derived facts too; ARMOR shows it the asserted ones only.
        sparql_timeout: Longest time a SPARQL query may take, seconds, whatever it asks for.
        sparql_rows: Most rows of a SPARQL answer.
        max_file_bytes: Largest document that is loaded.
        max_arguments: Most arguments of one directive.
        max_characters: Most characters of all arguments of one directive together.
        max_batch: Most directives in a list.
    """

    directories: tuple[str | Path, ...] = ('.',)
    read_only_directories: tuple[str | Path, ...] = field(default=(DATA,))
    enforce_mount: bool = True
    narrow_doubles: bool = False
    allow_web: bool = False
    sparql_derived: bool = True
    sparql_timeout: float = 30.0
    sparql_rows: int = 100_000
    max_file_bytes: int = 64 * 1024 * 1024
    max_arguments: int = 100_000
    max_characters: int = 16 * 1024 * 1024
    max_batch: int = 100_000


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
