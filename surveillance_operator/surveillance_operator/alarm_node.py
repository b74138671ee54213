"""The node `alarm`: hears the incidents of all nodes, keeps them in the log, and calls a person.

Hears `incidents` and `/parameter_events`. What the launcher has to tell, which is no node, comes on
the standard input, one line each (`IncidentUpdate.to_line`), and is published as the launcher's.
The end of what a node that was started again tells of no more is published, too.

The service `alarm/command` takes what people say of alarms (`desk.handling`), such as `acknowledge
4f2a by Anna: I go there` or `shelve 4f2a 2 h`; `list`, `sinks` and `test SINK` ask for what is
open, who is told, and a test message.
"""

from __future__ import annotations

import contextlib
import os
import queue
import selectors
import stat
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.logging import LoggingSeverity
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events

from state_machines.ros.waiting import reported
from strict_files.files import FileError
from strict_files.one_line import clean
from strict_files.settings import parameter
from strict_files.suggestions import nearest
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_ontology.patrol_vocabulary import ROBOT
from surveillance_operator.notify.calls import Sinks, open_sinks, run_command
from surveillance_operator.notify.incident_keeper import IncidentKeeper
from surveillance_operator.notify.machine_watch import MachineWatch
from surveillance_runtime.incident_topic import TOPIC, IncidentPublisher, hear_incidents
from surveillance_runtime.incidents import IncidentCall, IncidentUpdate
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.logging import Allowance
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.process import run_node
from surveillance_runtime.state_topics import publishers_of

LOOK_PERIOD = 2.0
"""Seconds between two looks for nodes that were started again."""
PARAMETERS_PER_SECOND, PARAMETERS_AT_ONCE = 1.0, 50.0
"""Changes of parameters that the log takes: any peer may change one a thousand times a second."""
SINK_PATIENCE = 1.5
"""How long the end of the node waits for sinks, seconds."""
MOST_WAITING = 10_000
"""So much may wait for the worker; beyond that what is heard is left out."""
_SECRETS = ('token', 'password', 'secret')


@dataclass(frozen=True)
class AlarmSettings:
    """Who is called, and where what was called for is kept."""

    command: str = parameter(
        '', 'Run when a person is needed, with one line as its last argument; empty: none.'
    )
    notify_file: str = parameter(
        '', 'Who else is told, notify.yaml: webhooks, MQTT, e-mail, commands; empty: nobody.'
    )
    folder: str = parameter(
        '',
        'Folder of the run: its log gets the incidents, and what waits for a sink waits there; '
        'empty: nothing is kept.',
    )


class Alarm(PatrolNode):
    """Keeps the incidents of a run on a thread of its own."""

    def __init__(self, **node_options: object) -> None:
        super().__init__('alarm', **node_options)
        self._settings = self.declare_fields(AlarmSettings())
        folder = Path(self._settings.folder) if self._settings.folder else None
        self._machine = MachineWatch(self.incidents, folder)
        self._sinks = self._open_sinks(folder)
        self._of_others = IncidentPublisher(self)
        self._keeper = IncidentKeeper(
            self._on_call,
            folder,
            self._mission_time,
            lost=self._of_others.publish,
            escalations=() if self._sinks is None else self._sinks.escalations,
            warn=self._on_warning,
        )
        self.create_service(ConsoleCommand, 'alarm/command', self._on_command)
        self._inbox = queue.Queue[Callable[[], object]](MOST_WAITING)
        self._allowed = Allowance(PARAMETERS_PER_SECOND, PARAMETERS_AT_ONCE)
        # Whose publisher told of what goes on, and what that node is called in the graph.
        self._tellers: dict[str, bytes] = {}
        self._names: dict[bytes, str] = {}
        hear_incidents(self, lambda told, who: self._take(partial(self._hear, told, who)))
        self.create_subscription(
            ParameterEvent, '/parameter_events', self._on_parameters, qos_profile_parameter_events
        )
        self.spawn(self._work, 'alarm')
        if stat.S_ISFIFO(os.fstat(0).st_mode):
            threading.Thread(target=self._listen, name='launcher', daemon=True).start()

    def on_stop(self) -> None:
        """Have the worker see that it is to end."""
        self._take(lambda: None)

    def _mission_time(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _open_sinks(self, folder: Path | None) -> Sinks | None:
        file = self._settings.notify_file
        if not file:
            return None
        if folder is None:
            raise ParameterError('parameter notify_file: expected a folder, too, for what waits')
        robot = self.get_namespace().rpartition('/')[2] or ROBOT
        try:
            return open_sinks(Path(file), folder, robot, self._say, self._on_trouble)
        except (FileError, ValueError) as error:
            raise ParameterError(f'parameter notify_file: {error}') from None
        except OSError as error:
            raise NotNowError(f'parameter folder: {error}') from None

    def _say(self, line: str) -> None:
        self.get_logger().warn(f'notify: {line}')

    def _on_trouble(self, sink: str, text: str) -> None:
        """Tell the other sinks of one that does not work; empty: it works."""
        if text:
            self.incidents.begin(('sink', sink), f'{sink}: {text}')
        else:
            self.incidents.end(('sink', sink), f'{sink} works again')

    # --- in the executor ---

    def _take(self, work: Callable[[], object]) -> bool:
        """Have the worker do something; return whether there was room for it."""
        try:
            self._inbox.put_nowait(work)
        except queue.Full:
            self.get_logger().error(
                f'more than {MOST_WAITING} messages wait: the rest is left out',
                throttle_duration_sec=60.0,
            )
            return False
        return True

    async def _on_command(self, request: Any, response: Any) -> Any:
        """Have the worker do what a person says, whose book it is."""
        future, work = reported(self, lambda: self._carry_out(request.line))
        if not self._take(work):
            response.answer = 'the node is busy: try again'
            return response
        try:
            response.answer = str(await future)
            response.accepted = True
        except ValueError as error:
            response.answer = str(error)
        return response

    def _on_parameters(self, event: ParameterEvent) -> None:
        robot, _, node = event.node.strip('/').rpartition('/')
        for each in event.changed_parameters:
            if not self._allowed.take():
                return
            hidden = any(word in each.name for word in _SECRETS)
            value = '...' if hidden else clean(str(parameter_value_to_python(each.value)))
            self._take(
                partial(
                    self._keeper.write,
                    'parameter',
                    robot.rpartition('/')[2],
                    node=clean(node),
                    name=clean(each.name),
                    value=value,
                )
            )

    # --- in the worker ---

    def _work(self) -> None:
        wait: float = 0.0
        look_at = 0.0
        while not self.stopping.is_set():
            with contextlib.suppress(queue.Empty):
                self._inbox.get(timeout=max(0.01, min(wait, LOOK_PERIOD)))()
            now = time.monotonic()
            if now >= look_at:
                look_at = now + LOOK_PERIOD
                self._look_for_restarts()
                self._machine.look()
            due = self._keeper.advance()
            wait = LOOK_PERIOD if due is None else due
        while not self._inbox.empty():
            self._inbox.get_nowait()()
        self._keeper.close()
        if self._sinks is not None:
            self._sinks.outbox.close(SINK_PATIENCE)

    def _hear(self, told: IncidentUpdate, publisher: bytes) -> None:
        teller = self._tellers.get(told.owner, publisher)
        there = self._there() if publisher != teller else {}
        name = there.get(publisher, '')
        if name == self.get_fully_qualified_name():
            return  # this node has told of what is lost
        # A node that was started again is another publisher of the same name.
        if teller in there and name.rpartition('/')[2] not in ('', told.node):
            # Who can end another one's alarm, or take care of it, can silence it.
            text = f'{clean(name)} tells of {told.cause} of {told.owner}'
            self.get_logger().error(f'{text}, which is not believed', throttle_duration_sec=10.0)
            return
        self._tellers[told.owner] = publisher
        self._keeper.hear(told)

    def _there(self) -> dict[bytes, str]:
        """Return the names of the nodes that tell of incidents, by their publishers."""
        return publishers_of(self, self.resolve_topic_name(TOPIC))

    def _look_for_restarts(self) -> None:
        """Have what a node told of end after its restart, unless it tells of it again."""
        waiting = {each.told.owner for each in self._keeper.book.open()}
        self._tellers = {who: gid for who, gid in self._tellers.items() if who in waiting}
        if not self._tellers:
            return
        there = self._there()
        self._names |= there
        for owner, publisher in list(self._tellers.items()):
            name = self._names.get(publisher)
            if publisher not in there and name in there.values():
                del self._tellers[owner]
                self._keeper.restarted(owner)

    def _carry_out(self, line: str) -> str:
        """Do what a line says; return what was done.

        Raises:
            ValueError: What was wrong, and what was expected.
        """
        verb, _, rest = line.strip().partition(' ')
        names = () if self._sinks is None else self._sinks.names
        if verb == 'sinks':
            return ', '.join(names) or 'none: start with --notify'
        if verb != 'test':
            return clean(self._keeper.carry_out(line))
        name = rest.strip()
        if self._sinks is None or name not in names:
            raise ValueError(f'no sink {name[:40]!r}: expected {nearest(name[:40], names)}')
        self._sinks.test(name)
        return f'{name} is sent a test message'

    def _on_warning(self, call: IncidentCall) -> None:
        if self._sinks is not None:
            self._sinks.tell(call)

    def _on_call(self, call: IncidentCall) -> None:
        if call.only is not None:
            # The log and the command have told of it already.
            if self._sinks is not None:
                self._sinks.tell(call)
            return
        self.get_logger().always(f'alarm: {call.text}', LoggingSeverity.WARN)
        if self._settings.command and (
            problem := run_command(self._settings.command, clean(call.text))
        ):
            self.get_logger().error(problem)
        if self._sinks is not None:
            self._sinks.tell(call)

    # --- in the thread that hears the launcher ---

    def _listen(self) -> None:
        """Take what the launcher tells, until the node ends."""
        rest = b''
        with selectors.DefaultSelector() as selector:
            selector.register(0, selectors.EVENT_READ)
            while not self.stopping.is_set():
                if not selector.select(0.5):
                    continue
                chunk = os.read(0, 65536)
                if not chunk:
                    return
                *lines, rest = (rest + chunk).split(b'\n')
                for line in lines:
                    self._take_line(line.decode(errors='replace'))

    def _take_line(self, line: str) -> None:
        try:
            told = IncidentUpdate.from_line(line)
        except ValueError as error:
            self.get_logger().warn(f'the launcher: {error}')
            return
        self._take(partial(self._keeper.hear, told))
        self._of_others.publish(told)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(Alarm, args)


if __name__ == '__main__':
    raise SystemExit(main())
