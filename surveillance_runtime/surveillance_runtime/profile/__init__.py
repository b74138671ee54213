"""What differs between robots: topics and their types, frames, body, speeds, sensors, battery.

`record` is the profile as a record whose fields carry their own checks, `reading` reads one from a
file `robot.yaml`, `use` says what it means to the nodes of a run (parameters and names of topics),
`description` draws it as a URDF, `nav2_parameters` lays it over Nav2's own file. No ROS in here.
"""

from surveillance_runtime.profile.node_configuration import (
    check_base,
    check_behaviour,
    out_of_nav2s_way,
    profile_layer,
    remappings,
    unmonitored_entries,
)
from surveillance_runtime.profile.reading import (
    BUILT_IN,
    ProfileFile,
    find_profile,
    profile_names,
    read_profile,
)
from surveillance_runtime.profile.record import RobotProfile

__all__ = [
    'BUILT_IN',
    'ProfileFile',
    'RobotProfile',
    'check_base',
    'check_behaviour',
    'find_profile',
    'out_of_nav2s_way',
    'profile_layer',
    'profile_names',
    'read_profile',
    'remappings',
    'unmonitored_entries',
]
