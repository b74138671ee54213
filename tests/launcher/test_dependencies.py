"""What the packages import is what `pyproject.toml` installs."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from launcher.environment import LIBRARIES, PACKAGES, requirements
from tests.launcher.conftest import ROOT

pytestmark = pytest.mark.early

# Names under which distributions are imported, where they differ.
DISTRIBUTIONS = {
    'cv2': 'opencv-python-headless',
    'skimage': 'scikit-image',
    'yaml': 'pyyaml',
    'PIL': 'pillow',
    're2': 'google-re2',
    'ruamel': 'ruamel.yaml',
    'paho': 'paho-mqtt',
}
# InspectionLog for at run time and done without when absent: an installed ROS has them.
OPTIONAL = {
    'tf2_msgs',
    'nav2_msgs',
    'control_msgs',
    'mujoco',
    'launch',
    'launch_ros',
    'pip',
}
# Known to type checkers alone.
TYPES = {'_typeshed'}
# With rclpy[fastrtps] and common_interfaces.
ROS = re.compile(
    r'(rclpy|ament_index_python|action_msgs|builtin_interfaces|lifecycle_msgs|'
    r'rcl_interfaces|rosgraph_msgs|unique_identifier_msgs|rosidl_\w+|rpyutils|'
    r'(diagnostic|geometry|nav|sensor|shape|std|stereo|trajectory|visualization)_msgs|'
    r'std_srvs)$'
)


def imports(folder: Path) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for path in folder.rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names = [node.module]
            else:
                continue
            found.update({name.partition('.')[0]: path for name in names})
    return found


def installed() -> set[str]:
    return {name_of(line) for line in requirements(ROOT, ('test',))}


def name_of(line: str) -> str:
    return re.split(r'[\[<>=!~ ]', line)[0].lower().replace('_', '-')


OWN = (*LIBRARIES, 'surveillance_interfaces', 'armor_api', 'launcher', 'tests', 'libs')
"""What the checkout holds beside its packages."""


@pytest.mark.parametrize('folder', [*(f'{p}/{p}' for p in PACKAGES), 'launcher', 'tests'])
def test_every_import_is_installed_by_the_set_up(folder):
    known = installed()
    benchmarks = {'benchmarks', *(path.stem for path in (ROOT / 'benchmarks').glob('*.py'))}
    for name, path in imports(ROOT / folder).items():
        own = name in {*PACKAGES, *OWN, *benchmarks}
        if own or name in sys.stdlib_module_names or name in OPTIONAL | TYPES or ROS.match(name):
            continue
        distribution = DISTRIBUTIONS.get(name, name).lower().replace('_', '-')
        assert distribution in known, f'{path} imports {name}'


def needs(library: str) -> list[str]:
    project = tomllib.loads((ROOT / 'libs' / library / 'pyproject.toml').read_text())['project']
    return list(project['dependencies'])


@pytest.mark.parametrize('library', LIBRARIES)
def test_a_library_imports_only_what_its_own_project_names(library):
    known = {library, *(name_of(line) for line in needs(library))}
    known |= {name.replace('-', '_') for name in known}
    for name, path in imports(ROOT / 'libs' / library / library).items():
        if name in sys.stdlib_module_names or name in TYPES:
            continue
        if library == 'state_machines' and (path.parent.name == 'ros' or name == 'yaml'):
            continue  # its extras
        distribution = DISTRIBUTIONS.get(name, name).lower()
        assert distribution in known, f'{path} imports {name}'


def test_one_range_of_versions_serves_the_robot_and_all_libraries():
    lines = [*requirements(ROOT, ()), *(line for name in LIBRARIES for line in needs(name))]
    ranges: dict[str, set[str]] = {}
    for line in lines:
        ranges.setdefault(name_of(line), set()).add(line)
    assert [found for found in ranges.values() if len(found) > 1] == []


def test_the_set_up_itself_needs_the_standard_library_alone(tmp_path):
    # A Python without any package, in a copy without those that need one.
    for part in ('launcher', 'surveillance_runtime', 'libs/strict_files'):
        shutil.copytree(ROOT / part, tmp_path / part)
    modules = ('cli', 'run', 'environment', 'instance_lock', 'progress', 'system')
    program = ';'.join(f'import launcher.{module}' for module in modules)
    words = [sys.executable, '-S', '-E', '-c', program]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
