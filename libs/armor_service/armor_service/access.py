"""What directives may do: limits of size and time, and which files they may read and write."""

from __future__ import annotations

import os
import re
import site
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from armor_service.protocol import DirectiveError
from armor_service.rendering import shown
from strict_files.settings import names_expected, parameter

CODE = Path(__file__).resolve().parent.parent
ONTOLOGY_ENDINGS = ('.nq', '.nt', '.omn', '.owl', '.owx', '.rdf', '.ttl', '.xml')
LOG_ENDINGS = ('.log', '.txt')
WORLD_ENDINGS = ('.sqlite3',)
MAX_PATH = 4096
_CONTROL = re.compile(r'[\x00-\x1f\x7f]')


def state_folder() -> Path:
    """Return where programs of this user keep what outlives them (XDG base directories)."""
    home = os.environ.get('XDG_STATE_HOME', '')
    # A relative path there is invalid and to be ignored, says the standard.
    base = Path(home) if home.startswith('/') else Path.home() / '.local' / 'state'
    return base / 'surveillance'


@dataclass(frozen=True)
class Settings:
    """Choices of an `ArmorService`.

    Attributes:
        ontologies_folder: The only place where SAVE and LOG write, made when it is needed; LOAD
            reads there too. A relative path of a directive stands for a file in it. Empty:
            ``ontologies`` in `state_folder`.
        read_only_directories: Likewise, of a program whose ontologies come with it.
        sparql_timeout: Longest time a SPARQL query may take, seconds, whatever it asks for.
        sparql_rows: Most rows of a SPARQL answer.
        max_file_bytes: Largest document that is loaded, and largest log of LOG FILE.
        max_arguments: Most arguments of one directive.
        max_characters: Most characters of all arguments of one directive together.
        max_batch: Most directives in a list.

    Raises:
        ValueError: ``ontologies_folder`` holds the program's code or lies in it.
    """

    ontologies_folder: str | Path = parameter(
        '',
        'The folder in which SAVE and LOG may write, and LOAD may read; empty: '
        '~/.local/state/surveillance/ontologies.',
    )
    directories: tuple[str | Path, ...] = parameter(
        ('.',), 'Directories in which LOAD may read as well.', check=names_expected
    )
    read_only_directories: tuple[str | Path, ...] = ()
    overwrite_loaded: bool = parameter(
        False, 'Let SAVE without a path write over the file that was loaded, as ARMOR 2.2 does.'
    )
    enforce_mount: bool = parameter(
        True, 'Refuse changes by others while a client is mounted; ARMOR 2.2 does not.'
    )
    strict: bool = parameter(
        False,
        'Refuse facts with a class or property that the ontology does not know, and properties '
        'used as another kind; else the answer names them.',
    )
    narrow_doubles: bool = parameter(
        False, 'Store values of type DOUBLE as xsd:float, as ARMOR 2.2 does.'
    )
    allow_web: bool = parameter(False, 'Let LOAD WEB fetch documents from the web.')
    sparql_derived: bool = parameter(
        True, 'Let SPARQL see derived facts; ARMOR 2.2 shows it the asserted ones only.'
    )
    sparql_timeout: float = parameter(
        30.0, 'Longest time a SPARQL query may take, seconds.', 0.01, 3600.0
    )
    reasoning_timeout: float = parameter(
        0.5,
        'Seconds of processor time that reasoning over a change may take, beside twenty times what '
        'the ontology took when it was new and 0.2 ms for each axiom; a change that takes longer '
        'is taken back.',
        0.01,
        86_400.0,
    )
    loading_timeout: float = parameter(
        600.0,
        'Seconds of processor time that reasoning over a document may take at LOAD.',
        0.01,
        86_400.0,
    )
    reasoning_memory: int = parameter(
        1024, 'MiB by which the process may grow while it reasons.', 1, 1_000_000
    )
    sparql_rows: int = 100_000
    max_file_bytes: int = 64 * 1024 * 1024
    max_arguments: int = 100_000
    max_characters: int = 16 * 1024 * 1024
    max_batch: int = 100_000

    def __post_init__(self) -> None:
        folder = self.writable
        if folder.is_relative_to(CODE) or any(code.is_relative_to(folder) for code in _code()):
            raise ValueError(f'ontologies_folder: {folder} is a folder of code, expected another')

    @property
    def writable(self) -> Path:
        """Where directives write, links resolved."""
        folder = self.ontologies_folder or state_folder() / 'ontologies'
        return Path(folder).expanduser().resolve()


def _code() -> list[Path]:
    """Folders in which Python looks for code."""
    # The current directory is on the path of some programs, and holds the runs' folders of others.
    named = [name for name in sys.path if name not in ('', '.')]
    found = [Path(name).resolve() for name in [*named, *site.getsitepackages()]]
    return [CODE, *(path for path in found if path.is_dir())]


class SafePaths:
    """Resolves paths from directives and refuses what lies outside the allowed directories.

    Symbolic links are resolved before the comparison, also those in the allowed directories. Files
    that are written end as ontologies or logs do, and no part of their path begins with a dot.

    Args:
        writable: Where files may be written, and read.
        readable: Where files may be read as well.
    """

    def __init__(self, writable: Path, readable: Iterable[str | Path] = ()) -> None:
        self._writable = writable
        self._readable = tuple(Path(d).expanduser().resolve() for d in readable)

    def to_read(self, text: str) -> Path:
        """Resolve the path of a file to read; a relative one in the first directory that has it.

        Raises:
            DirectiveError: Outside the allowed directories, or not a regular file.
        """
        allowed = (self._writable, *self._readable)
        candidates = [_resolved(base, text) for base in allowed]
        path = next((path for path in candidates if path.exists()), candidates[0])
        _check_inside(path, allowed, f'{_named(text)} may not be read')
        if not path.is_file():
            what = 'is not a file' if path.exists() else 'does not exist'
            raise DirectiveError(f'{_named(text)} {what}')
        return path

    def may_read(self, path: Path) -> bool:
        """Tell whether a file lies, links resolved, in the allowed directories."""
        return _is_inside(path.resolve(), (self._writable, *self._readable))

    def to_write(self, text: str, endings: tuple[str, ...]) -> Path:
        """Resolve the path of a file to write; its directory must exist.

        Args:
            text: The path as it came.
            endings: What its name may end in.

        Raises:
            DirectiveError: Outside the allowed directory, another ending, a name that begins with
                a dot, something else than a regular file there, or in no directory.
        """
        path = _resolved(self._writable, text)
        _check_inside(path, (self._writable,), f'{_named(text)} may not be written')
        if path.exists() and not path.is_file():
            kind = 'a directory' if path.is_dir() else 'a device or pipe'
            raise DirectiveError(f'{_named(text)} is {kind}, expected a file')
        if path.suffix.lower() not in endings:
            expected = ', '.join(endings)
            raise DirectiveError(
                f'{_named(text)} may not be written; expected a name that ends in {expected}'
            )
        if any(part.startswith('.') for part in path.relative_to(self._writable).parts):
            raise DirectiveError(
                f'{_named(text)} may not be written; expected no name that begins with a dot'
            )
        try:
            self._writable.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DirectiveError(f'{self._writable}: {error.strerror}') from None
        if not path.parent.is_dir():
            raise DirectiveError(f'{_named(text)}: directory {path.parent} does not exist')
        return path


def _named(text: str) -> str:
    """Return a path for a message; its last part says most, so it is cut only when very long."""
    return f'path {shown(text, limit=1000)}'


def _is_inside(path: Path, allowed: tuple[Path, ...]) -> bool:
    return any(path.is_relative_to(directory) for directory in allowed)


def _check_inside(path: Path, allowed: tuple[Path, ...], problem: str) -> None:
    if not _is_inside(path, allowed):
        raise DirectiveError(f'{problem}; allowed is {", ".join(map(str, allowed))}')


def _resolved(base: Path, text: str) -> Path:
    if not text:
        raise DirectiveError('path is empty, expected a file')
    if len(text) > MAX_PATH or _CONTROL.search(text):
        raise DirectiveError(f'{_named(text)} is not a path')
    try:
        path = (base / Path(text).expanduser()).resolve()
        path.exists()
    except OSError as error:
        raise DirectiveError(f'{_named(text)}: {error.strerror}') from None
    except (RuntimeError, ValueError) as error:
        raise DirectiveError(f'{_named(text)}: {error}') from None
    return path
