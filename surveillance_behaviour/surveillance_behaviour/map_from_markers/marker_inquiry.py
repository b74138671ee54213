"""From ids that the detector announces to notes in a survey, over `room_info`."""

from __future__ import annotations

import queue

from std_msgs.msg import Int32

from surveillance_behaviour.conversions import place_note_from
from surveillance_behaviour.map_from_markers.assembly import Survey, SurveyReport
from surveillance_fsm.ros import CallError, ServiceCaller
from surveillance_interfaces.msg import MarkerDetectionArray
from surveillance_interfaces.srv import RoomInformation
from surveillance_runtime.node import PatrolNode

_ANSWER_SECONDS = 5.0


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
            self._survey.discard(marker_id)
            log.info(f'marker {marker_id} is discarded: {answer.room}')
        else:
            self._survey.note(marker_id, note)
            log.info(f'marker {marker_id} stands for {note.room}')
