"""Messages from any peer: texts, trajectories, maps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from surveillance_interfaces.msg import MissionStatus
from surveillance_runtime.conversions import clean_texts, map_from, pose_message, trajectory_from


def test_texts_of_a_message_command_no_terminal() -> None:
    message = DiagnosticArray(
        status=[DiagnosticStatus(name='a\x1b[2Jb', values=[KeyValue(key='k', value='\x07')])]
    )
    message.header.frame_id = 'map\r'
    clean_texts(message)
    assert message.status[0].name == r'a\x1b[2Jb'
    assert message.status[0].values[0].value == r'\x07'
    assert message.header.frame_id == r'map\r'


def test_line_breaks_numbers_and_plain_texts_stay() -> None:
    message = MissionStatus(stamp=Time(sec=5), text='ümläut\nnext', avoided=['R1', '\x1b'])
    clean_texts(message)
    assert message == MissionStatus(stamp=Time(sec=5), text='ümläut\nnext', avoided=['R1', r'\x1b'])
    joints = JointState(name=['a'], position=[1.0])
    clean_texts(joints)
    assert joints == JointState(name=['a'], position=[1.0])


def test_a_trajectory_keeps_names_times_and_values() -> None:
    point = JointTrajectoryPoint(positions=[0.1, 0.2], velocities=[1.0, 2.0])
    point.time_from_start = Duration(sec=1, nanosec=250_000_000)
    message = JointTrajectory(joint_names=['arm_pan', 'arm_lift'], points=[point])
    names, points = trajectory_from(message)
    assert names == ['arm_pan', 'arm_lift']
    assert (points[0].time, points[0].positions, points[0].velocities) == (
        1.25,
        (0.1, 0.2),
        (1.0, 2.0),
    )


def turned_map(yaw: float) -> OccupancyGrid:
    """Return a square of 2 m with a wall of one cell through it, turned around (3, -2)."""
    message = OccupancyGrid()
    message.info.width = message.info.height = 20
    message.info.resolution = 0.1
    message.info.origin = pose_message((3.0, -2.0, yaw))
    cells = np.zeros((20, 20), np.int8)
    cells[10] = 100
    message.data.frombytes(cells.tobytes())
    return message


@pytest.mark.parametrize('yaw', [0.3, math.pi / 2, math.pi, -2.5])
def test_a_turned_map_is_drawn_anew_without_gaps_in_its_walls(yaw: float) -> None:
    grid = map_from(turned_map(yaw), 10_000)
    along = np.linspace(0.05, 1.95, 200)
    cos, sin = math.cos(yaw), math.sin(yaw)

    def values(x: NDArray[np.float64], y: float) -> set[int]:
        points = np.stack([3.0 + cos * x - sin * y, -2.0 + sin * x + cos * y], axis=1)
        return set(grid.cells[tuple(grid.cells_of(points).T)].tolist())

    assert values(along, 1.05) == {100}
    assert values(along, 0.85) == values(along, 1.25) == {0}
    occupied = grid.occupied.sum() * grid.resolution**2
    assert occupied == pytest.approx(2.0 * 0.1, rel=0.5)


def test_a_turned_map_that_would_become_too_large_is_refused() -> None:
    with pytest.raises(ValueError, match='a turned map of 39 x 39 cells: expected 500 at most'):
        map_from(turned_map(math.pi / 4 - 0.3), 500)
