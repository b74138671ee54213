"""What a finished set-up was made for, so that the next start sees whether it still fits."""

from __future__ import annotations

import hashlib
import json
import sys
import tomllib
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from surveillance_fsm.files import parse_json
from surveillance_runtime.files import replace_text

JOURNAL = 'surveillance-setup.json'
INTERFACES = 'surveillance_interfaces'


@dataclass
class Journal:
    """How far the set-up of one environment came, and what it was made for.

    Attributes:
        python: version and home of the interpreter that the environment stands on.
        checkout: the folder whose packages the environment imports.
        extras: groups of optional dependencies that are installed.
        packages: hash of the dependency lists that were installed completely.
        interfaces: hash of the interface sources that were installed completely.
        working: the step under way, empty when none was cut off.
    """

    python: str = ''
    checkout: str = ''
    extras: list[str] = field(default_factory=list)
    packages: str = ''
    interfaces: str = ''
    working: str = ''

    @classmethod
    def read(cls, venv: Path) -> Journal:
        """Return the journal in `venv`; an empty one where none is, or where it cannot be read."""
        try:
            stored = parse_json((venv / JOURNAL).read_text(encoding='utf-8'))
            return cls(**stored)
        except (OSError, ValueError, TypeError):
            return cls()

    def write(self, venv: Path) -> None:
        replace_text(venv / JOURNAL, json.dumps(asdict(self), indent=1) + '\n')


def requirements(checkout: Path, extras: Iterable[str]) -> list[str]:
    """Return the project's dependencies with those of the named extras, as pip takes them."""
    project = tomllib.loads((checkout / 'pyproject.toml').read_text(encoding='utf-8'))['project']
    wanted = list(project['dependencies'])
    for extra in extras:
        wanted += project['optional-dependencies'][extra]
    return wanted


def complete(checkout: Path, extras: Iterable[str]) -> Journal:
    """Return the journal of a set-up that fits this checkout and this interpreter."""
    return Journal(
        python=f'{sys.version_info.major}.{sys.version_info.minor} {sys.base_prefix}',
        checkout=str(checkout),
        extras=sorted(extras),
        packages=_hash(line.encode() for line in requirements(checkout, extras)),
        interfaces=_hash(_sources(checkout / INTERFACES)),
    )


def _sources(folder: Path) -> Iterable[bytes]:
    for path in sorted(folder.rglob('*')):
        if path.is_file() and not {'build', '__pycache__'} & set(path.relative_to(folder).parts):
            yield path.relative_to(folder).as_posix().encode()
            yield path.read_bytes()


def _hash(pieces: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for piece in pieces:
        digest.update(len(piece).to_bytes(8, 'little') + piece)
    return digest.hexdigest()
