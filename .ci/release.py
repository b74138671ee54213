#!/usr/bin/env python3
"""Build what a release publishes, and check it: the release checklist as one script.

    python3 .ci/release.py [FOLDER]

Wheels and source archives of the robot and of each library go to FOLDER (build/release), with a
bill of materials (CycloneDX) of what they need and under which licences. It ends with what is left
for a person to do. Uploading is not among what it does.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
import venv
from importlib import metadata
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(CHECKOUT))

from launcher.environment import LIBRARIES, requirements  # noqa: E402

TOOLS = ['build>=1.2,<2', 'twine>=5,<7']
COPYLEFT = re.compile(r'\b(A?GPL|GNU (Affero )?General Public)', re.IGNORECASE)
WEAK_COPYLEFT = {'owlready2': 'LGPL-3.0: used as a library, unchanged'}
"""Needs whose licence asks something of who changes them, each with why that is no surprise."""
LEFT = """\
Left for a person:
  1. read CHANGELOG.md, give the section [Unreleased] its version and date
  2. replace the placeholders of [project.urls] (grep example.com)
  3. git tag -s v{version} && git push --tags
  4. twine upload {folder}/*.whl {folder}/*.tar.gz"""


def main(words: list[str]) -> int:
    """Build and check; return the exit code."""
    folder = Path(words[0] if words else CHECKOUT / 'build' / 'release').resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (version,) = versions() or {''}
    with_tools = folder / 'tools'
    venv.create(with_tools, with_pip=True)
    python = str(with_tools / 'bin' / 'python')
    run(python, '-m', 'pip', 'install', '-q', '--disable-pip-version-check', *TOOLS)
    for source in (CHECKOUT, *(CHECKOUT / 'libs' / name for name in LIBRARIES)):
        run(python, '-m', 'build', '-o', str(folder), str(clean_copy(source, folder / 'sources')))
    built = sorted(map(str, (*folder.glob('*.whl'), *folder.glob('*.tar.gz'))))
    run(python, '-m', 'twine', 'check', '--strict', *built)
    components = bill_of_materials()
    text = json.dumps(document(version, components), indent=1) + '\n'
    (folder / 'sbom.cdx.json').write_text(text, encoding='utf-8')
    surprises = copyleft(components)
    for line in surprises:
        print(f'release: {line}', file=sys.stderr)
    for left in ('tools', 'sources'):
        shutil.rmtree(folder / left)
    print(f'built in {folder}: {len(built)} files and sbom.cdx.json, version {version}')
    print(LEFT.format(version=version, folder=folder))
    return 1 if surprises else 0


def versions() -> set[str]:
    """Return the versions that the project's files name; there has to be one."""
    found = set()
    for path in (CHECKOUT / 'pyproject.toml', *CHECKOUT.glob('libs/*/pyproject.toml')):
        found.add(tomllib.loads(path.read_text())['project']['version'])
    for path in (*CHECKOUT.glob('*/package.xml'), *CHECKOUT.glob('libs/*/package.xml')):
        found |= set(re.findall(r'<version>(.*?)</version>', path.read_text()))
    for path in CHECKOUT.glob('surveillance_*/setup.py'):
        found |= set(re.findall(r"version='(.*?)'", path.read_text()))
    return found


def clean_copy(source: Path, folder: Path) -> Path:
    """Return a copy of what git knows of a folder: a build leaves folders beside the sources."""
    target = folder / source.name
    listing = ['git', 'ls-files', '-co', '--exclude-standard']
    names = subprocess.run(listing, cwd=source, capture_output=True, text=True, check=True)
    for name in names.stdout.splitlines():
        if (source / name).is_file() and not name.startswith('libs/'):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source / name, target / name)
    return target


def bill_of_materials() -> list[dict[str, str]]:
    """Return name, version and licence of all that the project needs, as it is installed here."""
    waiting = [name_of(line) for line in requirements(CHECKOUT, ())]
    found: dict[str, dict[str, str]] = {}
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        try:
            about = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue  # of another platform, or an extra
        found[name] = {'name': name, 'version': about.version, 'licence': licence_of(about)}
        waiting += [name_of(line) for line in about.requires or () if 'extra ==' not in line]
    return sorted(found.values(), key=lambda each: each['name'])


def name_of(line: str) -> str:
    """Return the name of a distribution in a line of requirements, as PEP 503 has it."""
    return re.sub(r'[-_.]+', '-', re.split(r'[\[<>=!~ ;(]', line)[0]).lower()


def licence_of(about: metadata.Distribution) -> str:
    """Return the licence that a distribution's metadata names; empty where it names none."""
    given = about.metadata
    if expression := given.get('License-Expression'):
        return str(expression)
    kinds = [each for each in given.get_all('Classifier') or () if each.startswith('License ::')]
    if kinds:
        return '; '.join(each.rpartition(' :: ')[2] for each in kinds)
    return (given.get('License') or '').strip().partition('\n')[0][:80]


def copyleft(components: list[dict[str, str]]) -> list[str]:
    """Return a line for each need whose licence would be a surprise."""
    return [
        f'{each["name"]} {each["version"]}: licence {each["licence"]!r}'
        for each in components
        if COPYLEFT.search(each['licence']) and each['name'] not in WEAK_COPYLEFT
    ]


def document(version: str, components: list[dict[str, str]]) -> dict[str, object]:
    """Return the bill of materials in CycloneDX 1.5."""
    return {
        'bomFormat': 'CycloneDX',
        'specVersion': '1.5',
        'version': 1,
        'metadata': {
            'component': {'type': 'application', 'name': 'surveillance', 'version': version}
        },
        'components': [
            {
                'type': 'library',
                'name': each['name'],
                'version': each['version'],
                'purl': f'pkg:pypi/{each["name"]}@{each["version"]}',
                'licenses': [{'license': {'name': each['licence'] or 'not named'}}],
            }
            for each in components
        ],
    }


def run(*words: str) -> None:
    """Run a command; end the program where it fails."""
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stdout + done.stderr, file=sys.stderr)
        sys.exit(f'failed: {" ".join(words)}')


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
