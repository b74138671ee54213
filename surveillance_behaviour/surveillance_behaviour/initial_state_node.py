"""The `initial_state` node: looks around for markers and has the map built from them.

A map that is not complete when the patrol begins is extended while it patrols: by markers that come
into view, and by a scan every `look_again` seconds. What was found is kept in
``<record>.survey.json``, so that a scan whose node was killed goes on where it was.
"""

from __future__ import annotations

import queue
from collections.abc import Sequence
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.callback_groups import ReentrantCallbackGroup
from std_srvs.srv import Empty

from state_machines.ros import CallError, ServiceCaller
from strict_files.files import KeptFile
from surveillance_behaviour.conversions import map_message
from surveillance_behaviour.map_from_markers.assembly import (
    PlaceNote,
    Survey,
    SurveyReport,
    notes_of,
)
from surveillance_behaviour.map_from_markers.initial_scan import InitialScan, ScanProgress
from surveillance_behaviour.map_from_markers.scan_peers import CameraScanner, MarkerInquiry
from surveillance_interfaces.msg import OntologyMap
from surveillance_interfaces.srv import ReferenceName
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_parameters import described_place
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.state_topics import OwnedTopic
from surveillance_runtime.waiting import AwaitedEvent

_BUILD_SECONDS = 20.0


class InitialState(PatrolNode):
    """Serves `start`; afterwards goes on listening for new markers."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('initial_state', **node_options)
        self._configured = described_place(self, source='markers', required=True)
        self._scan = self.declare_live(InitialScan())
        pictures = self.parameter('pictures', 6, 'Pictures to take at each pose.', minimum=1)
        patience = self.parameter(
            'patience',
            3.0,
            'Seconds of real time after which a pose is left without them.',
            minimum=0.0,
        )
        look_again: float = self.parameter(
            'look_again',
            60.0,
            'Seconds between two scans while places are missing on patrol; 0: none.',
            minimum=0.0,
            read_only=True,
        )
        record: str = self.parameter(
            'record',
            '',
            'Mission record beside which `FILE.survey.json` keeps what was found; empty: none.',
            read_only=True,
        )
        self._survey = Survey(self.get_parameter('robot_room').value, (0.0, 0.0))
        self._progress = ScanProgress()
        self._file = KeptFile.of_record(record, '.survey.json')
        self._missing: list[str] = []
        if problem := self._file.read(self._take_kept):
            self.get_logger().warn(problem)
        self._sent: tuple[PlaceNote, ...] = ()
        self._finished = False
        self._found = AwaitedEvent(self)
        self._events: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._inquiry = MarkerInquiry(self, self._survey, self._events)
        self._camera = CameraScanner(self, pictures, patience)
        self._reference = ServiceCaller(self, ReferenceName, 'ontology_map/reference_name')
        self._map = OwnedTopic(self, OntologyMap, 'ontology_map/build_map')
        self.create_subscription(Odometry, 'odom', self._on_odometry, SENSOR_QOS)
        self.create_service(Empty, 'start', self._on_start, callback_group=ReentrantCallbackGroup())
        if look_again > 0.0 and self._configured is None:
            self.create_timer(look_again, lambda: self._events.put('look'))
        self.spawn(self._work, 'initial state')

    def on_stop(self) -> None:
        """End the worker."""
        self._events.put('stop')

    # --- callbacks ---

    async def _on_start(self, _request: Any, response: Any) -> Any:
        if not self._finished:
            self._events.put('start')
        await self._found.wait_for(lambda: self._finished)
        return response

    def _on_odometry(self, message: Odometry) -> None:
        if not self._finished:
            position = message.pose.pose.position
            self._survey.robot_position = (position.x, position.y)

    # --- work, on the worker's thread ---

    def _work(self) -> None:
        ended = False
        while (event := self._events.get()) != 'stop':
            if event == 'start' and not ended:
                ended = self._start()
            elif event == 'id' and ended and self._configured is None:
                self._extend(self._inquiry.judge())
            elif event == 'look' and ended and self._missing:
                self._camera.scan(0.24, 0.6, self._scan.dwell, self._all_found)
                self._camera.home()
                self._extend(self._inquiry.judge())

    def _all_found(self) -> bool:
        return self.stopping.is_set() or self._inquiry.judge().complete

    def _keep(self) -> None:
        """Write what was found, if that has changed."""
        self._file.write({**self._survey.to_json(), **vars(self._progress)})

    def _take_kept(self, kept: dict[str, Any]) -> None:
        poses = [int(number) for number in kept['poses']]
        progress = ScanProgress(poses, float(kept['seconds']))
        self._survey.restore(kept)
        self._progress = progress

    def _start(self) -> bool:
        """Find out and send the map; False when the node stops first."""
        if self._configured is not None:
            notes = notes_of(self._configured)
            self._publish(notes, self._configured.start)
        else:
            logger = self.get_logger()
            self._camera.await_peers()
            report = self._scan.run(
                self._camera,
                self._inquiry.judge,
                lambda: self.get_clock().now().nanoseconds / 1e9,
                lambda sentence: logger.info(sentence),
                self.stopping.is_set,
                self._progress,
                self._keep,
            )
            if self.stopping.is_set():
                return False
            self._tell(report)
            self._publish(report.places, report.robot_room)
        self._await_map()
        self._finished = True
        self._found.happen()
        return True

    def _extend(self, report: SurveyReport) -> None:
        if report.places != self._sent:
            known = {place.room for place in self._sent}
            new = [place.room for place in report.places if place.room not in known]
            self.get_logger().info(f'the map is extended: {", ".join(new) or "new doors"}')
            self._publish(report.places, '')
            self._keep()
        missing = report.sentences()
        if missing != self._missing:
            self._missing = missing
            for sentence in missing or ['all places are found']:
                self.get_logger().info(sentence)

    def _tell(self, report: SurveyReport) -> None:
        found = ', '.join(sorted(place.room for place in report.places))
        if report.complete:
            self.get_logger().info(f'all places are found: {found}')
            return
        self._missing = report.sentences()
        for sentence in self._missing:
            self.get_logger().warn(sentence)
        self.get_logger().warn(f'patrolling without what is missing: {found}')

    def _publish(self, places: Sequence[PlaceNote], robot_room: str) -> None:
        self._sent = tuple(places)
        self._map.publish(map_message(places, robot_room))

    def _await_map(self) -> None:
        try:
            self._reference.call(ReferenceName.Request(), _BUILD_SECONDS, self.stopping)
        except CallError as error:
            if not self.stopping.is_set():
                self.get_logger().warn(f'the map was sent, but it is not confirmed: {error}')


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(InitialState, args)


if __name__ == '__main__':
    raise SystemExit(main())
