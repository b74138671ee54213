"""What the set-up installs is named by its hashes, for those who want just that."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import pytest

from launcher import package_lock
from launcher.environment import required_lists
from launcher.package_lock import FOLDER, ROBOT, fingerprint, from_report, locked, read_lock
from strict_files.files import FileError
from tests.launcher.conftest import ROOT

pytestmark = pytest.mark.unit

LISTS = {ROBOT: ['alpha[fast]>=1', 'beta'], 'test': ['gamma']}
A, B, C, D = (letter * 64 for letter in 'abcd')


def installed(name: str, digest: str, *needs: str) -> dict[str, Any]:
    return {
        'metadata': {'name': name, 'version': '1.2', 'requires_dist': list(needs)},
        'download_info': {
            'url': f'https://index.example.org/{name}.whl',
            'archive_info': {'hashes': {'sha256': digest}},
        },
    }


REPORT = {
    'environment': {'python_version': '3.11', 'sys_platform': 'linux'},
    'install': [
        installed('Alpha', A, 'delta_x; extra == "fast"', 'beta; python_version < "3"'),
        installed('beta', B),
        installed('gamma', C, 'beta>=1'),
        installed('Delta.X', D),
    ],
}


def test_each_package_is_pinned_by_its_hash_and_says_who_needs_it() -> None:
    lock = from_report(REPORT, LISTS)
    assert lock.text().splitlines()[1:] == [
        f'alpha==1.2 --hash=sha256:{A}  # robot',
        f'beta==1.2 --hash=sha256:{B}  # robot test',
        f'delta-x==1.2 --hash=sha256:{D}  # robot',
        f'gamma==1.2 --hash=sha256:{C}  # test',
    ]
    assert 'example.org' not in lock.text()
    assert [each.partition('=')[0] for each in lock.chosen([])] == ['alpha', 'beta', 'delta-x']
    assert len(lock.chosen(['test'])) == 4


def test_a_lock_of_other_lists_or_another_machine_is_not_used_and_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = package_lock.lock_path(tmp_path)
    path.parent.mkdir(parents=True)
    path.write_text(from_report(REPORT, LISTS).text())
    needed, why = locked(tmp_path, LISTS, ['test'])
    assert (len(needed), why) == (4, '')
    assert 'is of other requirements' in locked(tmp_path, {**LISTS, ROBOT: ['beta']}, [])[1]
    assert 'bench is not in the lock file' in locked(tmp_path, LISTS, ['bench'])[1]
    monkeypatch.setattr(package_lock, 'tag', lambda: 'cp399-plan9-vax')
    assert locked(tmp_path, LISTS, [])[1].startswith('no lock file for cp399-plan9-vax (there are ')


@pytest.mark.parametrize(
    ('line', 'number'),
    [
        ('numpy==1.0', 2),
        (f'numpy>=1.0 --hash=sha256:{A}  # robot', 2),
        (f'--extra-index-url x --hash=sha256:{A}  # robot', 2),
        (f'numpy==1.0 --hash=md5:{A}  # robot', 2),
    ],
)
def test_a_damaged_lock_installs_nothing(tmp_path: Path, line: str, number: int) -> None:
    path = package_lock.lock_path(tmp_path)
    path.parent.mkdir(parents=True)
    path.write_text(f'# requirements: {fingerprint(LISTS)}\n{line}\n')
    with pytest.raises(FileError, match=f'{path.name}:{number}: expected NAME==VERSION'):
        locked(tmp_path, LISTS, [])


LOCKS = sorted((ROOT / FOLDER).glob('*.txt'))


@pytest.mark.parametrize('path', LOCKS, ids=lambda each: each.stem)
def test_the_lock_files_are_of_pyproject_and_name_no_host(path: Path) -> None:
    lists = required_lists(ROOT)
    lock = read_lock(path)
    assert lock.requirements == fingerprint(lists), 'write it anew: launch.py lock'
    named = {each.name for each in lock.packages if ROBOT in each.groups}
    for line in lists[ROBOT]:
        assert re.sub(r'[-_.]+', '-', re.split(r'[\[<>=]', line)[0]).lower() in named
    assert '://' not in path.read_text()


def test_each_python_that_is_supported_has_a_lock() -> None:
    versions = re.findall(r'Python :: 3\.(\d+)"', (ROOT / 'pyproject.toml').read_text())
    wanted = {f'cp3{each}-linux-x86_64' for each in versions}
    assert wanted
    assert wanted <= {each.stem for each in LOCKS}


AUDIT = runpy.run_path(str(ROOT / '.ci' / 'audit.py'))


@pytest.mark.parametrize(
    ('version', 'count'), [('0.9', 0), ('1.0', 1), ('1.4.9', 1), ('1.5', 0), ('1.5.0.post1', 0)]
)
def test_a_hole_is_found_between_its_versions(version: str, count: int) -> None:
    advisories = [('alpha', '1.0', '1.5.0', 'CVE-0', 'reads on')]
    assert len(AUDIT['holes_of']('alpha', version, advisories)) == count
    bounds = AUDIT['holes_of_bounds']([f'alpha[x]>={version},<9', 'alpha', 'beta>=1'], advisories)
    assert len(bounds) == count


def test_nothing_with_a_known_hole_is_allowed(capsys: pytest.CaptureFixture[str]) -> None:
    advisories = AUDIT['known_holes']()
    lines = [line for each in required_lists(ROOT).values() for line in each]
    assert AUDIT['holes_of_bounds'](lines, advisories) == []
    for path in LOCKS:
        assert AUDIT['holes_of_lock'](read_lock(path), advisories) == []
