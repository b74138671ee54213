"""The `initial_state` node: looks around for markers and has the map built from them."""

from __future__ import annotations

import queue
from collections.abc import Sequence
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from std_srvs.srv import Empty

from surveillance_behaviour.conversions import map_message
from surveillance_behaviour.marker_inquiry import MarkerInquiry
from surveillance_behaviour.ros_eyes import RosEyes
from surveillance_behaviour.surroundings import LookingAround
from surveillance_behaviour.survey import PlaceNote, Survey, SurveyReport, notes_of
from surveillance_interfaces.msg import OntologyMap
from surveillance_interfaces.srv import ReferenceName
from surveillance_runtime.calls import CallFailed, ServiceCaller
from surveillance_runtime.node import PatrolNode, StartError
from surveillance_runtime.place import Place, PlaceError, make_place
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS

_BUILD_SECONDS = 20.0


class InitialState(PatrolNode):
    """Serves `start`; afterwards goes on listening for new markers."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('initial_state', **node_options)
        source = self.parameter(
            'map_source',
            'markers',
            'Where the map comes from.',
            choices=('markers', 'configuration'),
            read_only=True,
        )
        robot_room = self.parameter(
            'robot_room', '', 'Where the robot starts; empty: the place nearest to it.'
        )
        poses = self.parameter(
            'poses', [1, 2, 3, 4], "The arm's poses for looking around.", minimum=1, maximum=4
        )
        deadline = self.parameter(
            'deadline',
            45.0,
            'Seconds after which what was found has to do.',
            minimum=0.0,
            on_change=lambda value: setattr(self._looking, 'deadline', value),
        )
        dwell = self.parameter('dwell', 0.5, 'Rest at each view of a scan, seconds.', minimum=0.0)
        pictures = self.parameter('pictures', 6, 'Pictures to take at each pose.', minimum=1)
        patience = self.parameter(
            'patience', 2.0, 'Seconds after which a pose is left without them.', minimum=0.0
        )
        self._looking = LookingAround(tuple(poses), deadline, dwell)
        self._survey = Survey(robot_room, (0.0, 0.0))
        self._configured = self._place(robot_room) if source == 'configuration' else None
        self._sent: tuple[PlaceNote, ...] = ()
        self._finished = False
        self._waiting: list[Future] = []
        self._events: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._inquiry = MarkerInquiry(self, self._survey, self._events)
        self._eyes = RosEyes(self, pictures, patience)
        self._reference = ServiceCaller(self, ReferenceName, 'ontology_map/reference_name')
        self._map = self.create_publisher(OntologyMap, 'ontology_map/build_map', STATE_QOS)
        self.create_subscription(Odometry, 'odom', self._on_odometry, SENSOR_QOS)
        self.create_service(Empty, 'start', self._on_start, callback_group=ReentrantCallbackGroup())
        self.spawn(self._work, 'initial state')

    def on_stop(self) -> None:
        """End the worker."""
        self._events.put('stop')

    def _place(self, robot_room: str) -> Place:
        rooms, positions = self.parameters_under('map'), self.parameters_under('room_positions')
        try:
            return make_place(rooms, positions, robot_room)
        except PlaceError as error:
            raise StartError(f'{self.get_name()}: parameter {error}') from None

    # --- callbacks ---

    async def _on_start(self, _request: Any, response: Any) -> Any:
        if not self._finished:
            future = Future(executor=self.executor)
            self._waiting.append(future)
            self._events.put('start')
            await future
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

    def _start(self) -> bool:
        """Find out and send the map; False when the node stops first."""
        if self._configured is not None:
            notes = notes_of(self._configured)
            self._publish(notes, self._configured.start)
        else:
            logger = self.get_logger()
            report = self._looking.run(
                self._eyes,
                self._inquiry.judge,
                lambda: self.get_clock().now().nanoseconds / 1e9,
                lambda sentence: logger.info(sentence),
                self.stopping.is_set,
            )
            if self.stopping.is_set():
                return False
            self._tell(report)
            self._publish(report.places, report.robot_room)
        self._await_map()
        self.executor.create_task(self._answer)
        return True

    def _extend(self, report: SurveyReport) -> None:
        if report.places != self._sent:
            known = {place.room for place in self._sent}
            new = [place.room for place in report.places if place.room not in known]
            self.get_logger().info(f'the map is extended: {", ".join(new) or "new doors"}')
            self._publish(report.places, '')

    def _tell(self, report: SurveyReport) -> None:
        found = ', '.join(sorted(place.room for place in report.places))
        if report.complete:
            self.get_logger().info(f'all places are found: {found}')
            return
        for sentence in report.sentences():
            self.get_logger().warn(sentence)
        self.get_logger().warn(f'patrolling without what is missing: {found}')

    def _publish(self, places: Sequence[PlaceNote], robot_room: str) -> None:
        self._sent = tuple(places)
        self._map.publish(map_message(places, robot_room))

    def _await_map(self) -> None:
        try:
            self._reference.call(ReferenceName.Request(), _BUILD_SECONDS, self.stopping)
        except CallFailed as error:
            if not self.stopping.is_set():
                self.get_logger().warn(f'the map is sent, but not known to be built: {error}')

    def _answer(self) -> None:
        self._finished = True
        waiting, self._waiting = self._waiting, []
        for future in waiting:
            future.set_result(None)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(InitialState, args)


if __name__ == '__main__':
    raise SystemExit(main())
