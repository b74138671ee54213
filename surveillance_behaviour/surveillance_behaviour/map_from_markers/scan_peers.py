"""What the initial scan asks of other nodes: the arm to move, and each marker's place."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from typing import Any

from std_msgs.msg import Int32

from state_machines import Interrupt
from state_machines.ros import CallError, ClockWait, GoalCaller, ServiceCaller, await_ready
from surveillance_behaviour.conversions import place_note_from
from surveillance_behaviour.map_from_markers.assembly import Survey, SurveyReport
from surveillance_interfaces.action import ScanSurroundings
from surveillance_interfaces.msg import MarkerDetectionArray
from surveillance_interfaces.srv import MarkerRoutine, RoomInformation
from surveillance_runtime.fresh_images import FreshImages
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.robot_arm import ARM, REST_PATIENCE

_ARM_SECONDS = 30.0
_ANSWER_SECONDS = 5.0
_START_SECONDS = 10.0
_SILENCE = REST_PATIENCE + ARM.longest_motion
"""Seconds without a word from a scan, beside the rest at a view: the arm has waited for pictures as
long as it may, or moved as far as it can."""


class CameraScanner:
    """Moves the arm over `move_arm` and `scan_surroundings`, and waits for pictures at rest.

    Args:
        node: The node that looks around; its threads call the methods.
        pictures: How many pictures to wait for at each pose.
        patience: Seconds after which a pose is left without them.
    """

    def __init__(self, node: PatrolNode, pictures: int, patience: float) -> None:
        self._node = node
        self._pictures = pictures
        self._patience = patience
        self._wait = ClockWait(node)
        self._move = ServiceCaller(node, MarkerRoutine, 'move_arm')
        self._scan = GoalCaller(node, ScanSurroundings, 'scan_surroundings', cancel_timeout=1.0)
        self._read = FreshImages(node)

    def await_peers(self) -> None:
        """Wait for the nodes of arm and detector: only then does looking begin."""
        arm, detector = self._move.is_ready, self._read.is_told
        try:
            for is_ready, what in (arm, 'service move_arm'), (detector, 'marker detector'):
                deadline = time.monotonic() + _START_SECONDS
                await_ready(is_ready, deadline, self._node.stopping, what)
        except CallError as error:
            self._complain(str(error))

    def pose(self, number: int) -> None:
        """Take one of the arm's poses and look."""
        if self._moved(number):
            self._read.wait(self._pictures, 0.0, self._patience, self._node.stopping)

    def home(self) -> None:
        """Fold the arm for driving."""
        self._moved(MarkerRoutine.Request.HOME)

    def scan(self, overlap: float, reach: float, dwell: float, done: Callable[[], bool]) -> None:
        """Look all around the horizon; `done` is asked after each view and ends the scan.

        An arm from which no view is heard for too long is given up.
        """
        goal = ScanSurroundings.Goal(overlap=overlap, lowest=-reach, highest=reach, dwell=dwell)
        heard, view_changed, ended = Interrupt(), Interrupt(), Interrupt()
        forget = self._node.stopping.subscribe(ended.set)

        def told(feedback: Any) -> None:
            if not feedback.resting and feedback.view > 1:
                view_changed.set()
            heard.set()

        def watch() -> None:
            # `done` may ask other nodes, which a feedback callback must not wait for
            while not ended.is_set():
                if self._is_silent(heard, _SILENCE + dwell) and not ended.is_set():
                    self._complain(f'scan given up: no view for {_SILENCE + dwell:.0f} s')
                    ended.set()
                heard.clear()
                if view_changed.is_set():
                    view_changed.clear()
                    if done():
                        ended.set()

        watcher = self._node.spawn(watch, 'scan watch')
        try:
            self._scan.run(goal, accept_timeout=_ARM_SECONDS, interrupt=ended, on_feedback=told)
        except CallError as error:
            if not ended.is_set():
                self._complain(str(error))
        finally:
            forget()
            ended.set()
            heard.set()
            watcher.join()

    def _is_silent(self, heard: Interrupt, seconds: float) -> bool:
        """Wait for a word; tell whether none came for so long on the node's clock and in truth."""
        begin = self._wait.elapsed()
        if heard.wait(seconds):
            return False
        return self._wait.sleep(seconds - (self._wait.elapsed() - begin), heard)

    def _moved(self, number: int) -> bool:
        request = MarkerRoutine.Request(pos=number)
        try:
            answer = self._move.call(request, _ARM_SECONDS, self._node.stopping)
        except CallError as error:
            self._complain(str(error))
            return False
        if not answer.success:
            self._complain(f'move_arm to pose {number}: {answer.message}')
        return bool(answer.success)

    def _complain(self, reason: str) -> None:
        if not self._node.stopping.is_set():
            self._node.get_logger().warn(reason)
            # without an arm there is nothing to wait for but the pictures that come anyway
            self._wait.sleep(1.0, self._node.stopping)


class MarkerInquiry:
    """Asks once for each marker what it stands for.

    Ids come from `aruco_detector/id`, where each is announced once, and from the confirmed ones
    among `aruco_detector/detections`, for a node that came later.

    Args:
        node: The node that asks.
        survey: Takes the answers.
        came: Gets 'id' whenever there is something to ask.
    """

    def __init__(self, node: PatrolNode, survey: Survey, came: queue.SimpleQueue[str]) -> None:
        self._node = node
        self._survey = survey
        self._came = came
        self._ids: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._taken: set[int] = set()
        self._room_info = ServiceCaller(node, RoomInformation, 'room_info')
        node.create_subscription(
            Int32, 'aruco_detector/id', lambda message: self._take(message.data), 100
        )
        node.create_subscription(
            MarkerDetectionArray, 'aruco_detector/detections', self._on_detections, 10
        )

    def judge(self) -> SurveyReport:
        """Ask for all that came, and judge what is known; from a worker thread only."""
        while not self._ids.empty() and not self._node.stopping.is_set():
            self._ask(self._ids.get())
        return self._survey.report()

    def _on_detections(self, message: MarkerDetectionArray) -> None:
        for detection in message.detections:
            if detection.confirmed:
                self._take(detection.id)

    def _take(self, marker_id: int) -> None:
        if marker_id >= 0 and marker_id not in self._taken:
            self._taken.add(marker_id)
            self._ids.put(marker_id)
            self._came.put('id')

    def _ask(self, marker_id: int) -> None:
        request = RoomInformation.Request(id=marker_id)
        log = self._node.get_logger()
        try:
            answer = self._room_info.call(request, _ANSWER_SECONDS, self._node.stopping)
        except CallError as error:
            # it is asked for again when it is seen again
            self._taken.discard(marker_id)
            if not self._node.stopping.is_set():
                log.warn(f'marker {marker_id}: {error}')
            return
        note = place_note_from(answer)
        if note is None:
            log.info(f'marker {marker_id} is discarded: {answer.room}')
        else:
            self._survey.note(marker_id, note)
            log.info(f'marker {marker_id} stands for {note.room}')
