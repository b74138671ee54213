"""The actions of nav2_msgs that this project uses, with the fields and constants that Jazzy's
definitions have (docs.ros.org, nav2_msgs: Jazzy, action definitions).

nav2_msgs is no wheel and no package of an index, so that it is made here: `stand_in` gives classes
at once, `build` compiles real types as `surveillance_interfaces` is compiled, which takes a minute.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import sys
import zipfile
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace
from typing import Any

CHECKOUT = Path(__file__).parents[1]
ACTIONS = {
    'NavigateThroughPoses': """
geometry_msgs/PoseStamped[] poses
string behavior_tree
---
uint16 NONE=0
uint16 error_code
string error_msg
---
geometry_msgs/PoseStamped current_pose
builtin_interfaces/Duration navigation_time
builtin_interfaces/Duration estimated_time_remaining
int16 number_of_recoveries
float32 distance_remaining
int16 number_of_poses_remaining
""",
    'Spin': """
float32 target_yaw
builtin_interfaces/Duration time_allowance
---
uint16 NONE=0
uint16 UNKNOWN=700
uint16 TIMEOUT=701
uint16 TF_ERROR=702
uint16 COLLISION_AHEAD=703
builtin_interfaces/Duration total_elapsed_time
uint16 error_code
string error_msg
---
float32 angular_distance_traveled
""",
    'FollowPath': """
nav_msgs/Path path
string controller_id
string goal_checker_id
string progress_checker_id
---
uint16 NONE=0
uint16 UNKNOWN=100
uint16 INVALID_CONTROLLER=101
uint16 TF_ERROR=102
uint16 INVALID_PATH=103
uint16 PATIENCE_EXCEEDED=104
uint16 FAILED_TO_MAKE_PROGRESS=105
uint16 NO_VALID_CONTROL=106
uint16 CONTROLLER_TIMED_OUT=107
std_msgs/Empty result
uint16 error_code
string error_msg
---
float32 distance_to_goal
float32 speed
""",
    'DockRobot': """
bool use_dock_id true
string dock_id
geometry_msgs/PoseStamped dock_pose
string dock_type
float32 max_staging_time 1000.0
bool navigate_to_staging_pose true
---
uint16 NONE=0
uint16 DOCK_NOT_IN_DB=901
uint16 DOCK_NOT_VALID=902
uint16 FAILED_TO_STAGE=903
uint16 FAILED_TO_DETECT_DOCK=904
uint16 FAILED_TO_CONTROL=905
uint16 FAILED_TO_CHARGE=906
uint16 UNKNOWN=999
bool success true
uint16 error_code 0
uint16 num_retries 0
string error_msg
---
uint16 state
builtin_interfaces/Duration docking_time
uint16 num_retries 0
""",
    'UndockRobot': """
string dock_type
float32 max_undocking_time 30.0
---
uint16 NONE=0
uint16 DOCK_NOT_VALID=902
uint16 FAILED_TO_CONTROL=905
uint16 UNKNOWN=999
bool success true
uint16 error_code 0
string error_msg
---
""",
}
LIBRARIES = (
    'generator_c',
    'typesupport_fastrtps_c',
    'typesupport_introspection_c',
    'typesupport_c',
    'generator_py',
)
"""Those of nav2_msgs, each before the ones that need it."""
_DEFAULTS = {'bool': False, 'string': '', 'float32': 0.0}


def stand_in(action: str) -> SimpleNamespace:
    """Return classes that stand in for an action's Goal and Result; as rosidl's do, they refuse a
    field that they do not have.
    """
    goal, result, _ = ACTIONS[action].split('---')
    return SimpleNamespace(Goal=_message_type(goal), Result=_message_type(result))


def _message_type(section: str) -> Any:
    fields: dict[str, Any] = {}
    constants: dict[str, int] = {}
    for line in section.split('\n'):
        kind, _, rest = line.partition(' ')
        name, _, value = rest.partition('=' if '=' in rest else ' ')
        if '=' in rest:
            constants[name] = int(value)
        elif kind:
            plain = 0 if 'int' in kind else [] if kind.endswith('[]') else _DEFAULTS.get(kind)
            fields[name] = plain if not value else value == 'true' or float(value)

    def fill(self: Any, **given: Any) -> None:
        for name, value in (fields | given).items():
            setattr(self, name, value)

    return type('Message', (), {'__slots__': tuple(fields), '__init__': fill, **constants})


def build() -> Path:
    """Compile nav2_msgs, once for each state of the definitions; return where it can be imported.

    It is loaded into this process, too: its libraries lie beside no others of ROS.
    """
    packages = 'lib/python*/site-packages'
    state = sha256(f'{sys.version}{ACTIONS}'.encode()).hexdigest()[:16]
    folder = CHECKOUT / 'build' / 'nav2_msgs' / state
    if not list(folder.glob(packages)):
        sources = _sources(folder.with_suffix('.new'))
        pip = [sys.executable, '-m', 'pip', '--disable-pip-version-check', 'wheel', '-q']
        words = [*pip, '--no-deps', '-w', str(sources), str(sources)]
        subprocess.run(words, check=True, stdin=subprocess.DEVNULL)
        (wheel,) = sources.glob('*.whl')
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(sources / 'wheel')
        (data,) = (sources / 'wheel').glob('*.data/data')
        shutil.rmtree(folder, ignore_errors=True)
        data.rename(folder)
        shutil.rmtree(sources)
    for kind in LIBRARIES:
        ctypes.CDLL(str(folder / f'lib/libnav2_msgs__rosidl_{kind}.so'), ctypes.RTLD_GLOBAL)
    (found,) = folder.glob(packages)
    return found


def _sources(folder: Path) -> Path:
    """Write the package: that of surveillance_interfaces with other files in it."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / 'action').mkdir(parents=True)
    for name, text in ACTIONS.items():
        (folder / 'action' / f'{name}.action').write_text(text)
    files = ''.join(f'  action/{name}.action\n' for name in ACTIONS)
    for name in ('CMakeLists.txt', 'package.xml', 'pyproject.toml', 'wheels.cmake'):
        text = (CHECKOUT / 'surveillance_interfaces' / name).read_text()
        text = re.sub(r'surveillance([_-])interfaces', r'nav2\1msgs', text)
        text = re.sub(r'(  action/.*\n|  msg/.*\n|  srv/.*\n)+', files, text)
        for line in ('find_package(std_msgs REQUIRED)', '<depend>std_msgs</depend>'):
            text = text.replace(line, f'{line}\n{line.replace("std_msgs", "nav_msgs")}')
        text = text.replace('geometry_msgs std_msgs', 'geometry_msgs nav_msgs std_msgs')
        text = text.replace('"ros-jazzy-std-msgs"', '"ros-jazzy-nav-msgs", "ros-jazzy-std-msgs"')
        (folder / name).write_text(text)
    return folder
