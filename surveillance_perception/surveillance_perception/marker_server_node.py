"""The `marker_server` node: tells what a marker stands for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from strict_files.files import FileError
from surveillance_interfaces.msg import MarkerDetectionArray
from surveillance_interfaces.srv import RoomInformation
from surveillance_perception.conversions import fused_from_ros, marked_place_to_ros
from surveillance_perception.marker_registry import MarkedPlace, read_registry
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.process import run_node

_DISPLACED = 4.0
"""Standard deviations at which a marker is said to hang elsewhere."""

UNKNOWN = 'no room associated with this marker id'

_HERE = Path(__file__).resolve()
_IN_CHECKOUT = _HERE.parents[2] / 'config' / 'markers.yaml'
# From PREFIX/lib/python3.x/site-packages/surveillance_perception, where colcon puts this module.
_INSTALLED = _HERE.parents[4] / 'share' / 'surveillance_perception' / 'config' / 'markers.yaml'


class MarkerServer(PatrolNode):
    """Answers `room_info` from a file."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('marker_server', **node_options)
        path = self.parameter(
            'markers_file',
            '',
            "What markers stand for; empty: the project's config/markers.yaml.",
            check=registry_expected,
            on_change=self._read,
        )
        self._markers: dict[int, MarkedPlace] = {}
        self._displaced: set[int] = set()
        try:
            self._read(path)
        except FileError as error:
            raise ParameterError(f'{self.get_name()}: {error}') from None
        self.create_service(RoomInformation, 'room_info', self._on_room_info)
        self.create_subscription(MarkerDetectionArray, 'arm/markers', self._on_seen, 10)

    def _read(self, path: str) -> None:
        self._markers = read_registry(_file(path))
        self._displaced = set()
        self.get_logger().info(f'{len(self._markers)} markers from {_file(path).name}')

    def _on_seen(self, message: MarkerDetectionArray) -> None:
        """Say once of each marker that it is not where the file says."""
        for each in message.detections:
            place = self._markers.get(each.id)
            if place is None or place.hangs_at is None or each.id in self._displaced:
                continue
            seen = fused_from_ros(each)
            if seen is None or seen.distance_to(np.array(place.hangs_at)) < _DISPLACED:
                continue
            self._displaced.add(each.id)
            apart = math.dist(seen.position, place.hangs_at)
            self.get_logger().warn(
                f'marker {each.id} ({place.room}) is seen at {_metres(seen.position)}, '
                f'{apart:.2f} m from where the file has it: {_metres(place.hangs_at)}'
            )

    def _on_room_info(self, request: Any, response: Any) -> Any:
        place = self._markers.get(request.id)
        if place is None:
            response.room = UNKNOWN
        else:
            marked_place_to_ros(place, response)
        return response


def _metres(point: Iterable[float]) -> str:
    return '(' + ', '.join(f'{each:.2f}' for each in point) + ')'


def _file(path: str) -> Path:
    if path:
        return Path(path)
    return _INSTALLED if _INSTALLED.exists() else _IN_CHECKOUT


def registry_expected(path: str) -> str | None:
    """Ask for a file of markers."""
    try:
        read_registry(_file(path))
    except FileError as error:
        return f'a file of markers ({error})'
    return None


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(MarkerServer, args)


if __name__ == '__main__':
    raise SystemExit(main())
