"""The robot as one wheel: its packages, the launcher, its settings and the sources of its messages.

All else is in pyproject.toml. With ROS 2 installed, colcon builds the packages one by one instead.
"""

from __future__ import annotations

from pathlib import Path

from setuptools import find_packages, setup

PACKAGES = (
    'surveillance_runtime',
    'surveillance_ontology',
    'surveillance_behaviour',
    'surveillance_controllers',
    'surveillance_perception',
    'surveillance_simulation',
    'surveillance_operator',
)
SHARE = 'share/surveillance'


def sources() -> dict[str, str]:
    """Return where each package lies."""
    folders = {name: f'{name}/{name}' for name in PACKAGES}
    return {**folders, 'armor_api': 'surveillance_ontology/armor_api', 'launcher': 'launcher'}


def modules() -> list[str]:
    """Return the packages with those below them."""
    found = []
    for name, folder in sources().items():
        found += [name, *(f'{name}.{inner}' for inner in find_packages(folder))]
    return found


def data() -> list[tuple[str, list[str]]]:
    """Return the settings and the sources of the messages, folder by folder."""
    found: dict[str, list[str]] = {}
    for root in ('config', 'surveillance_interfaces'):
        for path in sorted(Path(root).rglob('*')):
            if path.is_file() and not {'build', '__pycache__'} & set(path.parts):
                found.setdefault(f'{SHARE}/{path.parent}', []).append(str(path))
    return list(found.items())


setup(packages=modules(), package_dir=sources(), data_files=data())
