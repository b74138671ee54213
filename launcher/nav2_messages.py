"""The messages of Nav2 for the project's own environment, where no ROS with Nav2 is installed.

`setup --with nav2` compiles them beside this project's messages. Nav2 itself may run elsewhere, in
a container or on the robot: nodes understand each other by the names and definitions of their
types. The definitions are those of Jazzy (docs.ros.org, nav2_msgs), of the actions that this
project uses. Where a workspace of ROS is sourced, its nav2_msgs is used and this is not needed.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

EXTRA = 'nav2'
"""The group of optional dependencies that asks for them."""
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
"""By name, as rosidl takes them."""


def write_package(folder: Path, interfaces: Path) -> None:
    """Write the sources of the package nav2_msgs: those of our interfaces with other files in it.

    Args:
        folder: Where to; what is there goes.
        interfaces: The folder of this project's interfaces.
    """
    shutil.rmtree(folder, ignore_errors=True)
    (folder / 'action').mkdir(parents=True)
    for name, text in ACTIONS.items():
        (folder / 'action' / f'{name}.action').write_text(text)
    files = ''.join(f'  action/{name}.action\n' for name in ACTIONS)
    for name in ('CMakeLists.txt', 'package.xml', 'pyproject.toml', 'wheels.cmake'):
        text = (interfaces / name).read_text()
        text = re.sub(r'surveillance([_-])interfaces', r'nav2\1msgs', text)
        text = re.sub(r'(  action/.*\n|  msg/.*\n|  srv/.*\n)+', files, text)
        for line in ('find_package(std_msgs REQUIRED)', '<depend>std_msgs</depend>'):
            text = text.replace(line, f'{line}\n{line.replace("std_msgs", "nav_msgs")}')
        text = text.replace('geometry_msgs std_msgs', 'geometry_msgs nav_msgs std_msgs')
        text = text.replace('"ros-jazzy-std-msgs"', '"ros-jazzy-nav-msgs", "ros-jazzy-std-msgs"')
        (folder / name).write_text(text)
