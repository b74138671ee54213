"""The node that all others derive from.

A `PatrolNode` declares its parameters with descriptors and checks, and owns the threads that do
its long work. Stopping ends that work while messages still flow.
"""

from __future__ import annotations

import inspect
import os
import threading
import time
import traceback
from collections.abc import Callable, Collection, Container, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import (
    PublisherEventCallbacks,
    QoSRequestedIncompatibleQoSInfo,
    SubscriptionEventCallbacks,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import qos_policy_name_from_kind
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from state_machines import Interrupt
from state_machines.ros.waiting import CLIENT_QOS, SERVICE_QOS
from strict_files.one_line import clean
from surveillance_runtime.configuration import (
    Configuration,
    RosArguments,
    Setting,
    read_schema,
)
from surveillance_runtime.health import Health
from surveillance_runtime.incident_topic import IncidentPublisher
from surveillance_runtime.incidents import Incidents, IncidentUpdate, Severity
from surveillance_runtime.logging import CleanLogger
from surveillance_runtime.message_bounds import check_asked, check_length, lists_of
from surveillance_runtime.parameters import ParameterError, ParameterSpec, specs_of, with_values
from surveillance_runtime.periods import every

if TYPE_CHECKING:
    from surveillance_runtime.parameters import Record

_EMPTY = {
    bool: Parameter.Type.BOOL_ARRAY,
    int: Parameter.Type.INTEGER_ARRAY,
    float: Parameter.Type.DOUBLE_ARRAY,
    str: Parameter.Type.STRING_ARRAY,
}

_FEWER_SERVICES = (Parameter('start_type_description_service', value=False),)
"""rcl's service logs what a peer asks for as it came, line breaks too, and no tool needs it."""

_OF_PARAMETERS = ('_parameters', '_parameter_types', '_parameters_atomically')
"""How the names of a node's own services of its parameters end."""

MOST_WAITING = 200
"""How many requests to one service may wait at a time: rclpy's executor looks at each in each
round, and one whose client is gone waits as well."""
INCIDENT_PERIOD = 1.0
"""Seconds between two looks which incidents have held, or been away, for long enough."""
JOIN_SECONDS = 2.0
"""How long a stopping node waits for its threads, seconds."""


_given: tuple[RosArguments, Configuration] | None = None


def give_arguments(arguments: RosArguments | None) -> None:
    """Let the nodes that this process makes from now on take their parameters from arguments.

    Raises:
        ParameterError: A file or an assignment cannot be used.
    """
    global _given
    _given = (arguments, arguments.configuration()) if arguments is not None else None


class Destroyable(Protocol):
    """A part of a node that must be taken down by hand."""

    def destroy(self) -> None:
        """Leave the ROS graph."""


class PatrolNode(Node):
    """A node with checked parameters and threads that end with it.

    Attributes:
        stopping: Raised when the node stops; give it to every wait.
        ended: Raised when the node's process shall end, wanted (`finish`) or not (`fail`).
        failure: Why the node cannot go on, once `fail` was called.
        unusable: Whether that is its configuration.
        finished: Whether the node ended on purpose.
        health: What the node says of itself on `/diagnostics`.
        incidents: What a person should know of; each is told on the topic `incidents`, logged, and
            a finding of the health.
        declared: Its parameters, by name.
        prefixes: Prefixes below which it takes parameters of any name.
    """

    def __init__(self, name: str, **node_options: Any) -> None:
        self.stopping = Interrupt()
        self.ended = Interrupt()
        self.failure: str | None = None
        self.unusable = False
        self.finished = False
        self.health = Health()
        self.declared: dict[str, ParameterSpec] = {}
        self.prefixes: set[str] = set()
        self._on_change: dict[str, Callable[[Any], None]] = {}
        self._live: list[_LiveRecord] = []
        self._threads: list[threading.Thread] = []
        self._spawning = threading.Lock()
        self._owned: list[Destroyable] = []
        self._overrides_given: dict[str, Setting] = {}
        if _given is not None and 'parameter_overrides' not in node_options:
            arguments, given = _given
            full_name = arguments.full_name(name)
            if name in given.schema:
                given.check()
            self._overrides_given = given.resolve(name, full_name)
            given.place(name, full_name)
            node_options['parameter_overrides'] = [
                _override(name, key, setting.value)
                for key, setting in self._overrides_given.items()
            ]
        node_options['parameter_overrides'] = [
            *_FEWER_SERVICES,
            *(node_options.get('parameter_overrides') or ()),
        ]
        super().__init__(name, **node_options)
        self._logger = CleanLogger(self.get_logger().name)
        self._incident_topic = IncidentPublisher(self)
        robot = self.get_namespace().rpartition('/')[2]
        now = lambda: 1e-9 * self.get_clock().now().nanoseconds  # noqa: E731
        self.incidents = Incidents(self._tell_incident, name, robot, now, time.monotonic)
        every(self, INCIDENT_PERIOD, self.incidents.advance)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._tell_parameters)

    @property
    def is_simulated(self) -> bool:
        """Whether this node's clock is that of a simulation, which all nodes share."""
        return bool(self.get_parameter('use_sim_time').value)

    def parameter(
        self,
        name: str,
        default: Any,
        description: str,
        *,
        on_change: Callable[[Any], None] | None = None,
        **more: Any,
    ) -> Any:
        """Declare one parameter and return its value.

        Args:
            name: The parameter's name.
            default: Its default, whose type is the parameter's type.
            description: One sentence with the unit.
            on_change: Called with the new value after each change at run time.
            **more: Other attributes of `ParameterSpec`.

        Raises:
            ParameterError: The value given at the start is not allowed.
        """
        value = self._declare(ParameterSpec(name, default, description, **more))
        if on_change is not None:
            self._on_change[name] = on_change
        return value

    def declare_fields(
        self,
        record: Record,
        *,
        prefix: str = '',
        mode: str = '',
        without: Container[str] = (),
        on_change: Callable[[Record], None] | None = None,
    ) -> Record:
        """Declare the fields of a record that are parameters, see `parameters.parameter`.

        Args:
            record: The defaults.
            prefix: Stands before the fields' names, with its dot.
            mode: The mode of the node in which alone the parameters count, if it is one.
            without: Fields that are not declared; they stay as they are.
            on_change: Called with the new record after each change at run time; without it the
                parameters are read-only.

        Returns:
            The record with the parameters' values.

        Raises:
            ParameterError: A value given at the start is not allowed, alone or beside the others:
                then the record raised a ValueError that begins with a field's name.
        """
        note = f'{mode}: ' if mode else ''
        values = {}
        for spec in specs_of(record, prefix, without):
            text, read_only = note + spec.description, spec.read_only or on_change is None
            spec = replace(spec, description=text, read_only=read_only)
            values[spec.name] = self._declare(spec)
        try:
            record = with_values(record, values, prefix)
        except ParameterError as error:
            raise self._located(error) from None
        if on_change is not None:
            self._live.append(_LiveRecord(record, prefix, values.keys(), on_change))
        return record

    def was_given(self, name: str) -> bool:
        """Tell whether a parameter was given at the start, so that its value is no default."""
        return name in self._parameter_overrides

    def declare_live(self, record: Record, without: Container[str] = ()) -> Record:
        """Declare fields as `declare_fields`; the record that is returned follows each change."""
        live = self.declare_fields(
            record, without=without, on_change=lambda new: vars(live).update(vars(new))
        )
        return live

    def _declare(self, spec: ParameterSpec) -> Any:
        name, default, element = spec.name, spec.default, spec.element
        descriptor = ParameterDescriptor(
            description=spec.description,
            additional_constraints=f'Expected: {spec.expected()}.',
            read_only=spec.read_only,
            # Typing is checked here, in the same words at the start and at run time.
            dynamic_typing=True,
        )
        if element is None and spec.minimum is not None and spec.maximum is not None:
            if isinstance(default, float):
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(spec.minimum), to_value=float(spec.maximum))
                ]
            else:
                descriptor.integer_range = [
                    IntegerRange(from_value=int(spec.minimum), to_value=int(spec.maximum))
                ]
        self.declared[name] = spec
        try:
            try:
                value = self.declare_parameter(name, default, descriptor).value
            except (InvalidParameterValueException, InvalidParameterTypeException) as error:
                override = self._parameter_overrides.get(name)
                given = override.value if override is not None else getattr(error, 'value', None)
                spec.accept(given)
                raise spec.error(given) from error
            return spec.accept(default if element is not None and value is None else value)
        except ParameterError as error:
            raise self._located(error) from error

    def _located(self, error: ParameterError) -> ParameterError:
        """Return an error of a parameter with the file and line that its value came from."""
        name = str(error).split()[1].rstrip(':')
        setting = self._overrides_given.get(name)
        return ParameterError(f'{setting.origin}: {error}') if setting else error

    def parameters_under(self, prefix: str) -> dict[str, Any]:
        """Declare and return all parameters that were given below a prefix.

        Args:
            prefix: Without the dot: `map` for `map.R1`, `map.R2`, ...

        Returns:
            The values by the rest of the name, in the order given.
        """
        start = prefix + '.'
        self.prefixes.add(prefix)
        values = {}
        # rclpy offers no public way to list overrides before they are declared.
        for name, override in self._parameter_overrides.items():
            if name.startswith(start):
                if not self.has_parameter(name):
                    descriptor = ParameterDescriptor(dynamic_typing=True)
                    self.declare_parameter(name, override.value, descriptor)
                value = self.get_parameter(name).value
                values[name[len(start) :]] = value if isinstance(value, str) else _plain(value)
        return values

    def create_publisher(self, msg_type: Any, topic: str, *args: Any, **kwargs: Any) -> Publisher:
        """Create a publisher as rclpy does, with no events of its quality of service by default.

        rclpy's executor looks at every event source with each message it takes, two of each
        publisher and two of each subscription; without them a composed robot patrols faster, see
        benchmarks/navigation.py. A subscription keeps the one that warns of a mismatch.
        """
        kwargs.setdefault('event_callbacks', PublisherEventCallbacks(use_default_callbacks=False))
        return super().create_publisher(msg_type, topic, *args, **kwargs)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Any, *args: Any, **kwargs: Any
    ) -> Subscription:
        """Create a subscription as rclpy does; it only warns of a publisher it cannot hear.

        A message with an array of too many others is lost (`message_bounds`).
        """

        def on_mismatch(event: QoSRequestedIncompatibleQoSInfo) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            self.get_logger().warn(
                f'topic {topic}: nothing will come from a publisher that offers another {policy}'
            )

        kwargs.setdefault(
            'event_callbacks',
            SubscriptionEventCallbacks(incompatible_qos=on_mismatch, use_default_callbacks=False),
        )
        if lists_of(msg_type) and not kwargs.get('raw'):
            callback = _bounded(callback, topic)
        return super().create_subscription(msg_type, topic, callback, *args, **kwargs)

    def create_timer(self, *args: Any, **options: Any) -> Timer:
        """Create a timer as rclpy does, but without `use_sim_time` on the steady clock.

        One on the machine's clock rests for as long as that is set back.
        """
        if options.get('clock') is None and not self.get_parameter('use_sim_time').value:
            options['clock'] = Clock(clock_type=ClockType.STEADY_TIME)
        return super().create_timer(*args, **options)

    def create_service(  # type: ignore[override]  # rclpy's has no room for further options
        self, srv_type: Any, name: str, callback: Callable[..., Any], **options: Any
    ) -> Service:
        """Create a service as rclpy does, with a queue that does not lose requests."""
        options.setdefault('qos_profile', SERVICE_QOS)
        answering = self._answering(callback, name)
        return super().create_service(srv_type, name, answering, **options)

    def _answering(self, callback: Callable[..., Any], name: str) -> Callable[..., Any]:
        """Return a callback that answers whatever happens: who asked is not to wait for ever."""

        def empty(error: Exception, request: Any, response: Any) -> Any:
            report_exception(error, self, f'service {name}')
            return _refusal(type(response)(), request, error)

        if inspect.iscoroutinefunction(callback):
            waiting = 0

            async def answer_later(request: Any, response: Any) -> Any:
                nonlocal waiting
                if waiting >= MOST_WAITING:
                    error = RuntimeError(f'{waiting} requests wait for their answers already')
                    return empty(error, request, response)
                waiting += 1
                try:
                    return await callback(request, response)
                except Exception as error:
                    return empty(error, request, response)
                finally:
                    waiting -= 1

            return answer_later

        def answer(request: Any, response: Any) -> Any:
            try:
                if name.endswith(_OF_PARAMETERS):
                    check_asked(request)
                return callback(request, response)
            except Exception as error:
                return empty(error, request, response)

        return answer

    def create_client(  # type: ignore[override]  # likewise
        self, srv_type: Any, name: str, **options: Any
    ) -> Client:
        """Create a client as rclpy does, with a queue that does not lose answers."""
        options.setdefault('qos_profile', CLIENT_QOS)
        return super().create_client(srv_type, name, **options)

    def spawn(self, work: Callable[[], None], name: str | None = None) -> threading.Thread:
        """Start a thread for long work; `stop` joins it, so it must heed `stopping`.

        An exception that the work lets out ends the node.
        """

        def body() -> None:
            try:
                work()
            except Exception as error:
                if self.stopping.is_set() or not self.context.ok():
                    return  # also of a node whose start failed after this thread's
                traceback.print_exc()
                self.fail(f'{type(error).__name__}: {error}')

        thread = threading.Thread(target=body, name=name or work.__name__, daemon=True)
        # In one step: a thread that is known and not started yet cannot be joined by a stop.
        with self._spawning:
            thread.start()
            self._threads = [*(t for t in self._threads if t.is_alive()), thread]
        return thread

    def own(self, entity: Destroyable) -> None:
        """Have an entity destroyed with the node: rclpy forgets action servers and clients."""
        self._owned.append(entity)

    def destroy_node(self) -> None:
        """Take the node out of the graph; only when no executor spins it any more."""
        while self._owned:
            self._owned.pop().destroy()
        super().destroy_node()

    def fail(self, reason: str, *, unusable: bool = False) -> None:
        """End the node's process with an error: the node cannot go on, and says why.

        Args:
            reason: One line.
            unusable: Whether its configuration is to blame, so that a new start would not help.
        """
        if self.failure is None:
            self.failure, self.unusable = reason, unusable
            self.get_logger().fatal(reason)
            self.ended.set()

    def finish(self) -> None:
        """End the node's process as wanted: the exit code is 0, and it is not started again."""
        self.finished = True
        self.ended.set()

    def on_stop(self) -> None:
        """Do what is to be done once when the node stops, while messages still flow."""

    def stop(self) -> bool:
        """End the node's work; call it from outside the executor while that still spins.

        Returns:
            Whether all its threads have ended, or were told to before.
        """
        if self.stopping.is_set():
            return True
        self.stopping.set()
        self.on_stop()
        self.incidents.close()
        with self._spawning:
            threads = list(self._threads)
        deadline = time.monotonic() + JOIN_SECONDS
        others = [each for each in threads if each is not threading.current_thread()]
        for thread in others:
            thread.join(max(0.0, deadline - time.monotonic()))
        late = ', '.join(thread.name for thread in others if thread.is_alive())
        if late:
            self.get_logger().warn(f'{late} did not end in {JOIN_SECONDS} s')
        return not late

    def _tell_incident(self, told: IncidentUpdate) -> None:
        subject, log = str(told.cause), self.get_logger()
        if told.over:
            self.health.clear(subject)
            log.always(told.words(), LoggingSeverity.INFO)
        elif told.severity is Severity.ALARM:
            self.health.error(subject, told.text)
            log.always(told.words(), LoggingSeverity.ERROR)
        else:
            self.health.warn(subject, told.text)
            log.always(told.words(), LoggingSeverity.WARN)
        self._incident_topic.tell(told, self.incidents)

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            values = self._accepted(parameters)
            for live in self._live:
                live.changed(values)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _tell_parameters(self, parameters: list[Parameter]) -> None:
        values = self._accepted(parameters)
        for name in values.keys() & self._on_change.keys():
            self._on_change[name](values[name])
        for live in self._live:
            if values.keys() & live.names:
                live.record = live.changed(values)
                live.on_change(live.record)

    def _accepted(self, parameters: list[Parameter]) -> dict[str, Any]:
        known = (each for each in parameters if each.name in self.declared)
        return {each.name: self.declared[each.name].accept(_plain(each.value)) for each in known}


@dataclass
class _LiveRecord:
    """A record whose fields are parameters that may change at run time."""

    record: Any
    prefix: str
    names: Collection[str]
    on_change: Callable[[Any], None]

    def changed(self, values: Mapping[str, Any]) -> Any:
        return with_values(self.record, values, self.prefix)


def _bounded(callback: Callable[[Any], Any], topic: str) -> Callable[[Any], Any]:
    """Return a callback that is called with messages of bounded arrays only."""

    def bounded(message: Any) -> Any:
        try:
            check_length(message)
        except ValueError as error:
            raise ValueError(f'topic {topic}: {error}') from None
        return callback(message)

    return bounded


def report_exception(error: BaseException, node: Node, what: str) -> None:
    """Say in one line that a callback failed; its message is lost, the node goes on."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f' ({os.path.basename(frames[-1].filename)}:{frames[-1].lineno})' if frames else ''
    text = f'{what}: {type(error).__name__}: {error}{place}'
    node.get_logger().error(f'{text}; the message is lost')
    if isinstance(node, PatrolNode):
        node.health.lose_message(clean(text))


def _refusal(response: Any, request: Any, error: Exception) -> Any:
    """Return an answer that says no, in the words of the services of parameters."""
    no = SetParametersResult(successful=False, reason=clean(str(error)))
    if isinstance(response, SetParameters.Response):
        response.results = [no for _ in request.parameters]
    elif isinstance(response, SetParametersAtomically.Response):
        response.result = no
    return response


def _override(node: str, name: str, value: Any) -> Parameter:
    if value == []:  # rclpy cannot tell of what
        schema = read_schema().get(node)
        spec = schema.spec(name) if schema is not None else None
        return Parameter(name, _EMPTY[str if spec is None else spec.element or str], [])
    if isinstance(value, list) and {type(each) for each in value} == {int, float}:
        value = [float(each) for each in value]
    return Parameter(name, value=value)


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, 'tolist') else value
