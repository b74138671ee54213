"""Waiting until the camera has been read while the arm rests.

A dwell in seconds alone would guarantee nothing: on a busy machine no picture may fall into it.
"""

from __future__ import annotations

from state_machines import Interrupt
from state_machines.ros import ClockWait
from surveillance_interfaces.msg import MarkerDetectionArray
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.stamp_offset import StampOffset


class FreshImages:
    """Counts the pictures that the marker detector has looked at.

    Args:
        node: The node that waits; its threads call `wait`.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._clock = ClockWait(node)
        self._since: float | None = None
        # the detector keeps the camera's stamps, whatever clock they are of
        self._stamps = StampOffset('aruco_detector/detections', node.is_simulated)
        self._wanted = 0
        self._changed = Interrupt()
        self._subscription = node.create_subscription(
            MarkerDetectionArray, 'aruco_detector/detections', self._on_picture, 10
        )

    def is_told(self) -> bool:
        """Tell whether a marker detector is there."""
        return bool(self._subscription.get_publisher_count())

    def wait(self, pictures: int, dwell: float, patience: float, interrupt: Interrupt) -> bool:
        """Wait for pictures that were taken from now on; from a worker thread only.

        Args:
            pictures: How many to wait for.
            dwell: Shortest wait, seconds of ROS time.
            patience: Seconds of real time after that at which the wait ends without them.
            interrupt: Ends the wait early.

        Returns:
            False when the interrupt came.
        """
        self._changed.clear()
        self._wanted = pictures
        self._since = self._now()
        remove = interrupt.subscribe(self._changed.set)
        try:
            if not self._clock.sleep(dwell, interrupt):
                return False
            self._changed.wait(patience)
        finally:
            remove()
            self._since = None
        return not interrupt.is_set()

    def _on_picture(self, message: MarkerDetectionArray) -> None:
        taken = self._stamps.time_of(seconds_of(message.header.stamp), self._now())
        since = self._since
        if since is not None and taken >= since:
            self._wanted -= 1
            if self._wanted <= 0:
                self._changed.set()

    def _now(self) -> float:
        return float(self._node.get_clock().now().nanoseconds / 1e9)
