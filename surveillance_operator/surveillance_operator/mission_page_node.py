"""The node `mission_page`: a live page of the mission for browsers.

It only listens and asks; with `control` it also does what a person at the page wants.
"""

from __future__ import annotations

import inspect
import os
import secrets
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image as ImageMessage

from floor_plans.editor import PlaceEditor
from floor_plans.writing import copy_place
from lidar_navigation.robot_base import robot_radius
from state_machines.exceptions import CallError
from strict_files.files import FileError
from strict_files.one_line import clean
from strict_files.regular_files import read_file
from strict_files.settings import parameter
from strict_files.suggestions import nearest
from surveillance_ontology.patrol_vocabulary import checked_names
from surveillance_operator.desk.alarm_actions import AlarmActions
from surveillance_operator.desk.documents import DeskDocuments
from surveillance_operator.desk.live_desk import LiveDesk
from surveillance_operator.desk.metrics import KIND, metrics
from surveillance_operator.desk.past_parts import PastParts
from surveillance_operator.desk.rule_file import add_rule, rule_entry
from surveillance_operator.fleet_actions import ALL, WORDS, FleetActions
from surveillance_operator.fleet_subscriber import FleetSubscriber
from surveillance_operator.hand_driving import HandDriving
from surveillance_operator.images import ANNOTATED, PLAIN, jpeg_from
from surveillance_operator.mission_actions import MissionActions
from surveillance_operator.mission_state import MissionState, Notice
from surveillance_operator.page.access import Links, PageUser
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Action, Document, Page
from surveillance_operator.place_page.edit_session import EditSession
from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_operator.sightings import Sightings
from surveillance_runtime import parameter_checks
from surveillance_runtime.event_log import EventLog, record_in
from surveillance_runtime.launch_protocol import FOR_THE_TERMINAL, HEARTBEAT, NotNowError
from surveillance_runtime.logging import print_lines
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for
from surveillance_runtime.process import run_node

POLL_PERIOD = 0.015
"""Least seconds between two looks at the topics while somebody looks at the page."""
IDLE_PERIOD = 0.5
"""And while nobody does."""
PATIENCE = 4.0
"""The plain image is heard when none with markers came for this time, seconds; and an image that
is older than this is not shown as if it were new."""
IDLE_SECONDS = 5.0
"""After this time without a question nobody listens to the camera any more."""


@dataclass(frozen=True)
class EditablePlace:
    """The place that can be edited on the page."""

    radius: float = robot_radius()
    place_file: str = parameter(
        '',
        'File of the place, which the page may change with `control`; empty: none.',
        read_only=True,
    )
    place_copy: str = parameter(
        '', "The run's own copy of it, written anew with it; empty: none.", read_only=True
    )


CONNECTIONS = 'page', 'connections'


class MissionPage(PatrolNode):
    """Serves the page."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('mission_page', **node_options)
        host = self.parameter(
            'host', '127.0.0.1', 'Address to listen at; all but loopback need the token.'
        )
        port = self.parameter(
            'port', 8080, 'Port to listen at; 0: any.', minimum=0, maximum=65535, read_only=True
        )
        control = self.parameter(
            'control', False, 'Allow actions to whoever has the token.', read_only=True
        )
        origin = self.parameter(
            'origin',
            '',
            'What browsers know the page by behind a TLS proxy, as https://robot.example.org; then '
            'everybody needs the token.',
            check=parameter_checks.web_origin,
            read_only=True,
        )
        # Not the token itself: any peer may ask a node for the values of its parameters.
        token_file = self.parameter(
            'token_file',
            '',
            'File with the token, made if missing; empty: a new one among the temporary files.',
            read_only=True,
        )
        evidence_folder = self.parameter(
            'evidence_folder',
            '',
            "The observer's pictures, for whoever may look; beyond this machine people in them are "
            'blurred. Empty: none are shown.',
            read_only=True,
        )
        folder = self.parameter(
            'folder',
            '',
            'Folder of the run: what its logs hold, and those of the runs beside it, can be '
            'searched, and what is pressed is written to its log. Empty: nothing is known of it.',
            read_only=True,
        )
        links_file = self.parameter(
            'links_file',
            '',
            'File with the names and roles of those who have links of their own, and the hashes '
            'of their tokens; empty: links last as long as the node.',
            read_only=True,
        )
        self._watch_file = self.parameter(
            'watch_file',
            '',
            'The rules of what matters, watch.yaml, to which the page may add one with `control`; '
            'empty: none.',
            read_only=True,
        )
        self._sightings = Sightings(self, evidence_folder)
        self._broadcaster = Broadcaster()
        self._desk = LiveDesk(Path(folder), self._broadcaster.show_desk) if folder else None
        self._drivers: dict[str, HandDriving] = {}
        self._driving_lock = threading.Lock()
        self._past = PastParts(Path(folder)) if folder else None
        self._presses = PressLog(Path(folder) if folder else None, self.get_logger().warning)
        files = self.declare_fields(EditablePlace())
        self._cameras: dict[str, CameraPictures] = {'': CameraPictures(self)}
        self._subscriber = FleetSubscriber(
            self, self._period, self._on_news, self._broadcaster.forget, streams=True
        )
        self._actions = FleetActions(self, lambda: self._subscriber.robots)
        session = self._session(files) if control and files.place_file else None
        self._own_token_file = '' if token_file else _temporary_token_file()
        token_file = token_file or self._own_token_file
        try:
            self.page = Page(
                self._broadcaster,
                questions=self._questions() | (session.questions if session else {}),
                actions=(self._offered_actions(session) if control else {})
                | (session.actions if session else {}),
                picture=self._picture,
                evidence=lambda name, robot, run, leaves: self._sightings.picture(
                    name, robot, run, blur=leaves
                ),
                host=host,
                port=port,
                origin=origin,
                token=_kept_token(token_file),
                report=self.get_logger().warning,
                documents=self._documents(),
                links=Links(Path(links_file) if links_file else None),
                pressed=self._presses.write,
                crowded=self._on_crowd,
            )
        except OSError as error:
            raise NotNowError(str(error)) from error
        self._broadcaster.show(self._subscriber.state(''))
        self.page.start()
        # The token is in no log and on no topic: they are recorded, and read by others.
        where = f' (its token is in {token_file})' if self.page.needs_token else ''
        self.get_logger().info(f'the mission is shown at {self.page.open_address}{where}')
        if self.page.needs_token and HEARTBEAT in os.environ:
            print_lines(f'{FOR_THE_TERMINAL}with its token: {self.page.address}')
        self.spawn(self._tick, 'page')
        if self._desk is not None:
            self.spawn(partial(self._desk.follow, self.stopping.wait), 'desk')
            self.spawn(partial(self._desk.read_older, self.stopping.is_set), 'older runs')

    def on_stop(self) -> None:
        """End the server, if there is one: its port may be taken."""
        if hasattr(self, 'page'):
            self.page.stop()
        if hasattr(self, '_presses'):
            self._presses.close()
        if self._own_token_file:
            Path(self._own_token_file).unlink(missing_ok=True)

    def _period(self) -> float:
        return POLL_PERIOD if self._broadcaster.viewers else IDLE_PERIOD

    def _on_news(self, robot: str, new: MissionState, _told: Sequence[Notice]) -> None:
        self._broadcaster.show(new, robot)

    def _on_crowd(self, is_crowded: bool) -> None:
        if is_crowded:
            text = 'the page has as many connections as it may have: the least useful ones end'
            self.incidents.begin(CONNECTIONS, text)
        else:
            self.incidents.end(CONNECTIONS, 'there is room for connections again')

    def _picture(self, robot: str) -> bytes | None:
        """Return the newest image of a robot's camera."""
        camera = self._cameras.get(robot)
        return None if camera is None else camera.jpeg()

    def _tick(self) -> None:
        while not self.stopping.wait(1.0):
            for robot, state in self._subscriber.see().items():
                self._broadcaster.show(state, robot)
                self._meet(robot)
            for camera in self._cameras.values():
                camera.rest()

    def _meet(self, robot: str) -> None:
        """Be ready for a robot: its services are found before a person wants them."""
        if robot not in self._cameras:
            self._actions.of(robot)
            self._sightings.follow(robot)
            self._cameras[robot] = CameraPictures(self, robot)

    def _session(self, files: EditablePlace) -> EditSession | None:
        """Let the place be edited; None, with a warning, where its file cannot be."""
        path, copy = Path(files.place_file), files.place_copy

        def tell(editor: PlaceEditor) -> str:
            try:
                if copy:
                    copy_place(path, Path(copy))
                return self._actions.shared.set_place(editor.whole())
            except (ValueError, CallError) as error:
                return f'but the running mission keeps the place that it has: {error}'

        try:
            editor = PlaceEditor(path, radius=files.radius, more_checks=checked_names)
        except FileError as error:
            self.get_logger().warn(f'the place cannot be edited: {error}')
            return None
        return EditSession(editor, tell)

    def _questions(self) -> dict[str, Action]:
        actions = self._actions

        def why_not(place: str, robot: str = '') -> Any:
            text, premises = actions.of(robot).why_not(place)
            return {'ok': True, 'text': text, 'premises': premises}

        return {
            'facts': lambda place: {'ok': True, 'facts': actions.shared.facts(place)},
            'explain': lambda fact: {'ok': True, 'lines': actions.shared.explain(fact)},
            'why_not': why_not,
            'sightings': self._sightings.listed,
            'baseline': self._sightings.baseline,
            **({} if self._desk is None else self._desk.questions()),
            **({} if self._past is None else {'past': self._past.past}),
        }

    def _offered_actions(self, session: EditSession | None) -> dict[str, Action]:
        shared = self._actions.shared
        rooms = RoomChanges(shared, session)
        return {
            'door': shared.set_door,
            'obstacle': shared.place_obstacle,
            'remove_obstacle': shared.remove_obstacle,
            'add_room': rooms.add,
            'remove_room': rooms.remove,
            'go': self._of_robots(MissionActions.go_to),
            'arm': self._of_robots(MissionActions.move_arm),
            'machine': self._of_robots(MissionActions.machine),
            'stop': self._of_robots(MissionActions.stop),
            'threshold': self._of_robots(MissionActions.set_threshold),
            'policy': self._of_robots(MissionActions.set_policy),
            'command': self._of_robots(MissionActions.command),
            'event': self._of_robots(MissionActions.event),
            'fleet': self._tell_fleet,
            'drive': self._drive,
            'pose': self._set_pose,
            **self._alarm_actions(),
            **({'rule': self._add_rule} if self._watch_file else {}),
        }

    def _add_rule(
        self,
        name: str,
        kind: str,
        wanted: str,
        subject: str = 'all',
        hours: str = '',
        severity: str = 'alert',
        places: Sequence[str] = (),
    ) -> str:
        """Add a rule to watch.yaml: the observers follow it at once."""
        entry = rule_entry(kind, wanted, subject, hours, severity, places)
        known = self._subscriber.state(min(self._subscriber.robots, default='')).place
        there = tuple(known.positions), tuple(known.doors or ())
        rule = add_rule(Path(self._watch_file), name, entry, *there)
        said = self._actions.carry_out(ALL, lambda actions: actions.event('rules'))
        return f'{rule}; {said}'

    def _drive(self, speed: float, turn: float, robot: str = '') -> str:
        """Drive a robot by hand for the next moment, m/s and rad/s; its mission is paused."""
        return self._driving(robot).drive(speed, turn)

    def _set_pose(self, x: float, y: float, yaw: float, robot: str = '') -> str:
        """Tell a robot where it is, metres and radians on the map."""
        return self._driving(robot).set_pose(x, y, yaw)

    def _driving(self, robot: str) -> HandDriving:
        actions = self._actions.of(robot)
        with self._driving_lock:
            if robot not in self._drivers:
                self._drivers[robot] = HandDriving(self, lambda: actions.machine('pause'), robot)
            return self._drivers[robot]

    def _documents(self) -> dict[str, Action]:
        """Return the files that are made for whoever may look."""
        desk = self._desk
        if desk is None:
            return {'metrics': self._metrics}
        made = DeskDocuments(desk.index, desk.folder.parent)
        return {'metrics': self._metrics, **made.all()}

    def _metrics(self) -> Document:
        """Tell figures of the mission as Prometheus reads them."""
        now = time.time()
        open_events = [] if self._desk is None else self._desk.index.open_at(now)
        states = {name: self._subscriber.state(name) for name in self._subscriber.robots}
        told = metrics(states, open_events, now, self._broadcaster.viewers)
        return Document(told.encode(), KIND)

    def _alarm_actions(self) -> dict[str, Action]:
        if self._desk is None:
            return {}
        alarms = AlarmActions(
            self._desk.find,
            self._actions.shared.alarm,
            lambda robot, line: self._actions.of(robot).event(line),
        )
        return {
            'alarm': alarms.say,
            'mute': alarms.mute,
            'unmute': alarms.unmute,
            'test_sink': alarms.test,
            'sinks': lambda: self._actions.shared.alarm('sinks'),
        }

    def _of_robots(self, do: Callable[..., str]) -> Action:
        """Return an action that takes the name of a robot, or `ALL`, beside its own fields."""

        def act(robot: str = '', **fields: Any) -> str:
            inspect.signature(do).bind(None, **fields)
            return self._actions.carry_out(robot, lambda actions: do(actions, **fields))

        return act

    def _tell_fleet(self, word: str, robot: str) -> str:
        """Have one robot or all do what a word says."""
        if word not in WORDS:
            raise ValueError(f'{word!r}: expected {nearest(word, WORDS)}')
        return self._actions.carry_out(robot, WORDS[word][1])


class PressLog:
    """Writes what was pressed, and by whom, to the log of the run.

    Args:
        folder: Of the run; None: nothing is written.
        complain: Takes a line about a log that cannot be written.
    """

    def __init__(self, folder: Path | None, complain: Callable[[str], object]) -> None:
        self._folder, self._complain = folder, complain
        self._lock = threading.Lock()
        self._log: EventLog | None = None

    def write(self, person: PageUser, action: str, fields: Mapping[str, Any], said: str) -> None:
        """Write one press."""
        if self._folder is None:
            return
        try:
            with self._lock:
                if self._log is None:
                    self._log = EventLog(record_in(self._folder))
            given = {str(key)[:40]: str(value)[:200] for key, value in list(fields.items())[:20]}
            self._log.write(
                'press',
                by=person.name,
                role=person.role,
                action=action,
                answer=clean(said),
                fields=given,
            )
        except FileError as error:
            self._complain(str(error))

    def close(self) -> None:
        """Close the log."""
        if self._log is not None:
            self._log.close()


class RoomChanges:
    """Rooms that a person adds or removes on the page: in the mission, and in the place's file.

    The mission says whether it can be; the file follows, so that the editor, the next run and the
    report have the place that the page shows.

    Args:
        mission: Changes the running mission.
        session: Edits the place's file; None: it is not edited, and the change is of this run.
    """

    def __init__(self, mission: MissionActions, session: EditSession | None) -> None:
        self._mission = mission
        self._session = session

    def add(self, name: str, x: float, y: float, doors: Sequence[str]) -> str:
        """Add a room to this run; in a file it needs walls and doors, which the editor draws."""
        said = self._mission.add_room(name, x, y, doors)
        if self._session is None:
            return said
        return f'{said}; for this run: in the file of the place it is drawn in the editor'

    def remove(self, name: str) -> str:
        """Remove a room; in the editor that can be undone."""
        if self._session is None:
            return f'{self._mission.remove_room(name)}; for this run'
        self._session.check_saved()
        said = self._mission.remove_room(name)
        try:
            self._session.change_now('remove_room', {'room': name})
        except ValueError as error:
            return f'{said}; for this run, its file keeps it: {error}'
        return f'{said}; also in the file: the editor can undo it'


def _temporary_token_file() -> str:
    """Return the name of a new file that its owner alone reads, with a token in it."""
    descriptor, path = tempfile.mkstemp(prefix='mission_page_token_')
    with open(descriptor, 'w', encoding='ascii') as file:
        file.write(secrets.token_urlsafe(24) + '\n')
    return path


def _kept_token(path: str) -> str:
    """Return the token in a file that its owner alone reads, so that it outlives the process.

    Raises:
        OSError: The file cannot be read or made; the error has its name.
    """
    with suppress(FileExistsError):
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        with open(descriptor, 'w', encoding='ascii') as file:
            file.write(secrets.token_urlsafe(24) + '\n')
    return read_file(path, 4096).decode('ascii', 'replace').strip()


class CameraPictures:
    """Gives the newest image of a node's camera, which is heard only while somebody looks.

    Args:
        node: The node that listens.
        robot: The robot of a fleet; empty: that of the node's namespace.
    """

    def __init__(self, node: PatrolNode, robot: str = '') -> None:
        self._node = node
        self._annotated, self._plain = name_for(robot, ANNOTATED), name_for(robot, PLAIN)
        self._lock = threading.Lock()
        self._subscriptions: dict[str, PolledSubscription] = {}
        self._asked = self._annotated_at = self._came_at = 0.0
        self._jpeg: bytes | None = None

    def jpeg(self) -> bytes | None:
        """Return the newest image; None where nothing came for a while."""
        with self._lock:
            now = time.monotonic()
            if not self._subscriptions:
                self._annotated_at = now if self._node.count_publishers(self._annotated) else 0.0
            self._asked = now
            newest = self._newest(self._annotated)
            if newest is not None:
                self._annotated_at = now
                self._leave(self._plain)
            elif now - self._annotated_at > PATIENCE:
                newest = self._newest(self._plain)
            if newest is not None:
                self._jpeg, self._came_at = jpeg_from(newest), now
            return self._jpeg if now - self._came_at <= PATIENCE else None

    def rest(self) -> None:
        """Leave the topics when nobody has asked for a while; call it now and then."""
        with self._lock:
            if time.monotonic() - self._asked > IDLE_SECONDS:
                self._leave(self._annotated)
                self._leave(self._plain)
                self._jpeg = None

    def _newest(self, topic: str) -> ImageMessage | None:
        if topic not in self._subscriptions:
            qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            self._subscriptions[topic] = PolledSubscription(self._node, ImageMessage, topic, qos)
        newest = self._subscriptions[topic].newest()
        return None if newest is None else newest[0]

    def _leave(self, topic: str) -> None:
        if (subscription := self._subscriptions.pop(topic, None)) is not None:
            subscription.destroy()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(MissionPage, args)
