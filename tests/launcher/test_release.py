"""What a release publishes fits together: versions, needs, licences, placeholders."""

from __future__ import annotations

import importlib.util
import re
import tomllib

import pytest

from launcher.environment import LIBRARIES, requirements
from tests.launcher.conftest import ROOT

ROSDEP = {
    'numpy': 'python3-numpy',
    'scipy': 'python3-scipy',
    'networkx': 'python3-networkx',
    'opencv-python-headless': 'python3-opencv',
    'pyyaml': 'python3-yaml',
    'pillow': 'python3-pil',
    'ruamel-yaml': 'python3-ruamel.yaml',
    'scikit-image': 'python3-skimage',
}
"""Keys of rosdep; the page on dependencies names what it lacks, with the line for pip."""


def release():
    spec = importlib.util.spec_from_file_location('release', ROOT / '.ci' / 'release.py')
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_one_version_stands_in_all_files():
    assert release().versions() == {'0.1.0'}


def test_no_need_has_a_licence_that_would_be_a_surprise():
    found = release()
    components = found.bill_of_materials()
    names = {each['name'] for each in components}
    assert {found.name_of(line) for line in requirements(ROOT, ())} <= names
    assert found.copyleft(components) == []
    assert found.copyleft([{'name': 'x', 'version': '1', 'licence': 'GPL-3.0-only'}])


@pytest.mark.parametrize('name', ['.', *(f'libs/{name}' for name in LIBRARIES)])
def test_urls_are_placeholders_that_the_checklist_names(name):
    project = tomllib.loads((ROOT / name / 'pyproject.toml').read_text())['project']
    assert all('example.com' in url for url in project['urls'].values())
    assert project['description']
    assert any('Apache' in each for each in project['classifiers'])
    assert (ROOT / name / 'LICENSE').exists()


@pytest.mark.parametrize('name', LIBRARIES)
def test_rosdep_and_the_wheel_need_the_same(name):
    found = release()
    folder = ROOT / 'libs' / name
    project = tomllib.loads((folder / 'pyproject.toml').read_text())['project']
    wanted = {found.name_of(line) for line in project['dependencies']}
    keys = set(
        re.findall(r'<exec_depend>(.*?)</exec_depend>', (folder / 'package.xml').read_text())
    )
    documented = (ROOT / 'docs' / 'reference' / 'dependencies.md').read_text()
    for each in wanted - {library.replace('_', '-') for library in LIBRARIES}:
        if each in ROSDEP:
            assert ROSDEP[each] in keys
        else:
            assert each in documented.lower(), f'{each}: rosdep has no key, so the docs name it'
    assert not {key for key in keys if key.startswith('python3-')} - {
        ROSDEP[each] for each in wanted if each in ROSDEP
    }
