"""The lock file: which file of which package the set-up installs, each by its hash.

There is one for each version of Python and kind of machine, `launcher/locks/cp311-linux-x86_64.txt`
and so on, in the form of pip's requirements (``pip install --require-hashes``), ROS among them. It
names no place that packages come from: a mirror serves the same files. `launch.py lock` writes it
anew, with the newest versions that `pyproject.toml` allows.

Behind each package stands who needs it, of which the set-up takes those lines that it wants::

    # requirements: 3f2a...
    numpy==2.4.6 --hash=sha256:...  # robot lint

The first line is a hash of the lists in `pyproject.toml` that it was made for. Of other lists, of
another Python or another machine it says nothing: then packages are taken by their ranges, and the
set-up says so.
"""

from __future__ import annotations

import hashlib
import json
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from strict_files.files import FileError, read_file, replace_text
from surveillance_runtime.launch_protocol import NotNowError

ROBOT = 'robot'
"""Who needs what is no optional dependency."""
LOCKED_EXTRAS = ('lint', 'mujoco', 'nav2', 'notify', 'test')
"""The groups of optional dependencies that are locked; benchmarks take their peers as they come."""
FOLDER = Path('launcher', 'locks')
LARGEST = 4_000_000
_HEAD = '# requirements: '
_LINE = re.compile(
    r'(?P<name>[a-z0-9][a-z0-9._-]*)==(?P<version>\S+)(?P<hashes>(?: --hash=sha256:[0-9a-f]{64})+)'
    r'  # (?P<groups>[a-z0-9 ]+)'
)


@dataclass(frozen=True)
class LockedPackage:
    """One line of a lock file.

    Attributes:
        name: As PyPI normalises it (PEP 503).
        version: Pinned.
        hashes: SHA-256 of each file that may be installed.
        groups: Who needs it: `ROBOT`, or an optional group.
    """

    name: str
    version: str
    hashes: tuple[str, ...]
    groups: frozenset[str]

    def requirement(self) -> str:
        """Return it as pip takes it."""
        return f'{self.name}=={self.version} ' + ' '.join(
            f'--hash=sha256:{each}' for each in self.hashes
        )


@dataclass(frozen=True)
class LockFile:
    """What a lock file holds.

    Attributes:
        requirements: Hash of the lists that it was made for, see `fingerprint`.
        packages: All of it.
    """

    requirements: str
    packages: tuple[LockedPackage, ...]

    def text(self) -> str:
        """Return it as the file holds it."""
        lines = [
            f'{each.requirement()}  # {" ".join(_sorted(each.groups))}' for each in self.packages
        ]
        return '\n'.join((_HEAD + self.requirements, *lines)) + '\n'

    def chosen(self, extras: Iterable[str]) -> list[str]:
        """Return what is to be installed for the robot and some extras, as pip takes it."""
        wanted = {ROBOT, *extras}
        return [each.requirement() for each in self.packages if wanted & each.groups]


def _sorted(groups: Iterable[str]) -> list[str]:
    return sorted(groups, key=lambda each: (each != ROBOT, each))


def tag() -> str:
    """Return which lock file fits this Python and this machine."""
    system, machine = platform.system().lower(), platform.machine()
    return f'cp{sys.version_info[0]}{sys.version_info[1]}-{system}-{machine}'


def lock_path(checkout: Path) -> Path:
    """Return where the lock file of this Python and machine is, or would be."""
    return checkout / FOLDER / f'{tag()}.txt'


def fingerprint(lists: Mapping[str, Sequence[str]]) -> str:
    """Return the hash of lists of requirements, by who needs them."""
    plain = {name: sorted(lists[name]) for name in sorted(lists)}
    return hashlib.sha256(json.dumps(plain).encode()).hexdigest()[:16]


def read_lock(path: Path) -> LockFile:
    """Read a lock file.

    Raises:
        FileError: One line with the file, and where it is not of its form.
    """
    lines = read_file(path, LARGEST).decode('utf-8', 'replace').splitlines()
    if not lines or not lines[0].startswith(_HEAD):
        raise FileError(f'{path}:1: expected {_HEAD!r} with a hash')
    found = []
    for number, line in enumerate(lines[1:], 2):
        match = _LINE.fullmatch(line)
        if match is None:
            raise FileError(f'{path}:{number}: expected NAME==VERSION --hash=sha256:...  # GROUPS')
        hashes = tuple(re.findall('[0-9a-f]{64}', match['hashes']))
        groups = frozenset(match['groups'].split())
        found.append(LockedPackage(match['name'], match['version'], hashes, groups))
    return LockFile(lines[0].removeprefix(_HEAD), tuple(found))


def locked(
    checkout: Path, lists: Mapping[str, Sequence[str]], extras: Iterable[str]
) -> tuple[list[str], str]:
    """Return what pip is to install, and why nothing is locked; one of them is empty.

    Args:
        checkout: The folder with the project.
        lists: What is required, by who needs it: `ROBOT` and `LOCKED_EXTRAS`.
        extras: Which optional groups are wanted.

    Raises:
        FileError: The lock file is damaged: nothing is installed by that.
    """
    path = lock_path(checkout)
    if not path.exists():
        known = ', '.join(sorted(each.stem for each in path.parent.glob('*.txt'))) or 'none'
        return [], f'no lock file for {tag()} (there are {known})'
    if left := sorted(set(extras).difference(LOCKED_EXTRAS)):
        return [], f'{", ".join(left)} is not in the lock file'
    found = read_lock(path)
    if found.requirements != fingerprint(lists):
        return [], f'{path.name} is of other requirements (launch.py lock writes it anew)'
    return found.chosen(extras), ''


# --- writing ---


def write_lock(
    python: Path, checkout: Path, lists: Mapping[str, Sequence[str]], environ: Mapping[str, str]
) -> Path:
    """Write the lock file of this Python and machine, with the newest versions that are allowed.

    Args:
        python: An interpreter with pip.
        checkout: The folder with the project.
        lists: See `locked`.
        environ: The environment in which pip runs.

    Raises:
        NotNowError: pip cannot find, or fetch, what is required.
        OSError: The file cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix='lock-') as folder:
        wanted, report = Path(folder, 'wanted.txt'), Path(folder, 'report.json')
        everything = dict.fromkeys(line for each in lists.values() for line in each)
        wanted.write_text('\n'.join(everything) + '\n', encoding='utf-8')
        words = ['install', '--quiet', '--dry-run', '--ignore-installed', '--no-input']
        words += ['--disable-pip-version-check', '--report', str(report), '-r', str(wanted)]
        done = subprocess.run(
            [str(python), '-m', 'pip', *words],
            env=dict(environ),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            last = [line for line in done.stderr.splitlines() if line.strip()][-1:]
            raise NotNowError(f'the lock file was not written: {"".join(last)}')
        found = from_report(json.loads(report.read_text(encoding='utf-8')), lists)
    path = lock_path(checkout)
    path.parent.mkdir(exist_ok=True)
    replace_text(path, found.text())
    return path


def from_report(report: Mapping[str, Any], lists: Mapping[str, Sequence[str]]) -> LockFile:
    """Return the lock file of what pip would install.

    Args:
        report: Of ``pip install --dry-run --report`` for all the lists together.
        lists: See `locked`.
    """
    from pip._vendor.packaging.requirements import Requirement

    needs: dict[str, list[tuple[str, frozenset[str], Any]]] = {}
    files: dict[str, tuple[str, tuple[str, ...]]] = {}
    for each in report['install']:
        name = _normal(each['metadata']['name'])
        hashes = each['download_info']['archive_info']['hashes']
        files[name] = each['metadata']['version'], (hashes['sha256'],)
        parsed = map(Requirement, each['metadata'].get('requires_dist', ()))
        needs[name] = [(_normal(r.name), frozenset(r.extras), r.marker) for r in parsed]
    environment = dict(report.get('environment', {}))

    def reached(lines: Sequence[str]) -> set[str]:
        seen: set[tuple[str, str]] = set()
        ahead = [
            (_normal(each.name), extra)
            for each in map(Requirement, lines)
            for extra in ('', *each.extras)
        ]
        while ahead:
            name, extra = ahead.pop()
            if (name, extra) in seen or name not in needs:
                continue
            seen.add((name, extra))
            for other, extras, marker in needs[name]:
                if marker is None or marker.evaluate({**environment, 'extra': extra}):
                    ahead += [(other, each) for each in ('', *extras)]
        return {name for name, _ in seen}

    groups = {group: reached(lines) for group, lines in lists.items()}
    packages = [
        LockedPackage(
            *(name, version, hashes),
            frozenset(group for group, names in groups.items() if name in names),
        )
        for name, (version, hashes) in sorted(files.items())
    ]
    return LockFile(fingerprint(lists), tuple(each for each in packages if each.groups))


def _normal(name: str) -> str:
    return re.sub(r'[-_.]+', '-', name).lower()
