"""Which way to move a robot has in SIMULATED mode: by this project or by Nav2, docking or not."""

from __future__ import annotations

from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.docking import DockingMotion, Motion
from surveillance_controllers.motion.nav2 import Nav2Motion
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_controllers.motion.robot_parameters import robot_settings
from surveillance_controllers.motion.simulated_motion import SimulatedMotion
from surveillance_runtime.node import PatrolNode


def make_motion(
    node: PatrolNode, settings: MotionSettings, knowledge: MapKnowledge, recorder: PlaceRecorder
) -> Motion:
    """The way to move that the parameters ask for.

    Args:
        node: The motion controller's node.
        settings: What it is told.
        knowledge: Map and ontology.
        recorder: Is told the place that the robot is in.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
        StartError: The messages of Nav2 or of the docking server are not installed.
    """
    motion: Motion
    if settings.navigator == 'nav2':
        motion = Nav2Motion(node, knowledge, settings)
    else:
        motion = SimulatedMotion(node, robot_settings(node, settings), knowledge, recorder)
    if settings.docking == 'none':
        return motion
    return DockingMotion(
        node,
        motion,
        settings.station,
        settings.dock_reach,
        settings.dock_type,
        settings.peer_timeout,
    )
