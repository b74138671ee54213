#!/usr/bin/env python3
"""Looks for known holes in what the set-up installs: in each lock file, and in the lower bounds.

    python3 .ci/audit.py

What is known stands in `.ci/advisories.json`, so that it needs no network. Where `pip-audit` is
installed and reaches its database it is asked as well; where it cannot, that is said, and is no
failure. The exit code is 1 where a package with a hole would be installed.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path[:0] = [
    str(CHECKOUT),
    str(CHECKOUT / 'libs' / 'strict_files'),
    str(CHECKOUT / 'surveillance_runtime'),
]

from launcher.environment import required_lists  # noqa: E402
from launcher.package_lock import FOLDER, LockFile, read_lock  # noqa: E402

ADVISORIES = Path(__file__).with_name('advisories.json')
Advisory = tuple[str, str, str, str, str]
"""Package, first version with the hole, first one without it, its number, what it does."""


def known_holes(path: Path = ADVISORIES) -> list[Advisory]:
    """Return the advisories that are known."""
    found: list[Advisory] = [
        tuple(each) for each in json.loads(path.read_text('utf-8'))['advisories']
    ]
    return found


def in_order(version: str) -> tuple[int, ...]:
    """Return a version so that later ones are greater; what follows its numbers does not count."""
    match = re.match(r'\d+(?:\.\d+)*', version)
    numbers = list(map(int, match[0].split('.'))) if match else []
    while numbers and not numbers[-1]:  # 12.2 is 12.2.0
        numbers.pop()
    return tuple(numbers)


def holes_of(name: str, version: str, advisories: list[Advisory]) -> list[str]:
    """Return a line for each hole of a version of a package."""
    at = in_order(version)
    return [
        f'{name} {version}: {number}, {what}: expected {fixed} or later'
        for package, begin, fixed, number, what in advisories
        if package == name and in_order(begin) <= at < in_order(fixed)
    ]


def holes_of_lock(lock: LockFile, advisories: list[Advisory]) -> list[str]:
    """Return a line for each hole of what a lock file has installed."""
    return [
        line for each in lock.packages for line in holes_of(each.name, each.version, advisories)
    ]


def holes_of_bounds(requirements: list[str], advisories: list[Advisory]) -> list[str]:
    """Return a line for each hole that the lowest version has which a requirement allows."""
    found = []
    for line in requirements:
        match = re.match(r'([A-Za-z0-9._-]+)(?:\[[^]]*\])?\s*(?:>=|==)\s*([0-9][^,;\s]*)', line)
        if match is not None:
            name = re.sub(r'[-_.]+', '-', match[1]).lower()
            found += holes_of(name, match[2], advisories)
    return found


def ask_pip_audit(lock: LockFile) -> str:
    """Return what pip-audit finds; empty: nothing, or it cannot be asked, which is printed."""
    program = shutil.which('pip-audit')
    if program is None:
        print('pip-audit is not installed: the list in .ci/advisories.json alone is looked at')
        return ''
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'locked.txt')
        path.write_text('\n'.join(each.requirement() for each in lock.packages) + '\n')
        words = [program, '--require-hashes', '--disable-pip', '--no-deps', '-r', str(path)]
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
        except subprocess.TimeoutExpired:
            print('pip-audit does not answer: is there a network?')
            return ''
    if done.returncode and 'vulnerab' not in done.stdout + done.stderr:
        last = [line for line in done.stderr.splitlines() if line.strip()][-1:]
        print(f'pip-audit could not look: {"".join(last)}')
        return ''
    return done.stdout if done.returncode else ''


def main() -> int:
    """Look, print what was found, and return the exit code."""
    advisories, found = known_holes(), []
    requirements = [line for each in required_lists(CHECKOUT).values() for line in each]
    found += [f'pyproject.toml allows {line}' for line in holes_of_bounds(requirements, advisories)]
    locks = {path.name: read_lock(path) for path in sorted((CHECKOUT / FOLDER).glob('*.txt'))}
    for name, lock in locks.items():
        found += [f'{name}: {line}' for line in holes_of_lock(lock, advisories)]
    for lock in list(locks.values())[:1]:
        found += ask_pip_audit(lock).splitlines()
    for line in found:
        print(f'audit: {line}')
    packages = len({each.name for lock in locks.values() for each in lock.packages})
    looked = f'{len(locks)} lock files, {packages} packages, {len(advisories)} advisories'
    print(f'audit: {looked}, {len(found)} found')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
