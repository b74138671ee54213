"""The node that all others derive from, and the life of a node's process.

A `PatrolNode` declares its parameters with descriptors and checks, and owns the threads that do
its long work. `run_node` is the body of every executable: the executor spins on a thread of its
own, so that the main thread takes SIGINT and SIGTERM at once, stops the node's work while
messages still flow (a running goal can be cancelled), and only then takes ROS down.
"""

from __future__ import annotations

import itertools
import queue
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import rclpy
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.event_handler import (
    PublisherEventCallbacks,
    QoSRequestedIncompatibleQoSInfo,
    SubscriptionEventCallbacks,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
)
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import qos_policy_name_from_kind
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from surveillance_runtime.parameters import Check, ParameterError, ParameterSpec, element_type
from surveillance_runtime.waiting import Interrupt
from surveillance_runtime.yaml_file import YamlFileError, read_yaml_file

JOIN_SECONDS = 2.0
"""How long a stopping node waits for each of its threads, seconds."""


EXIT_CANNOT_START = 2
"""The exit code of a node whose configuration does not let it start."""


class StartError(Exception):
    """The node cannot start; the message is one line that says why."""


class Destroyable(Protocol):
    """A part of a node that must be taken down by hand."""

    def destroy(self) -> None:
        """Leave the ROS graph."""


class PatrolNode(Node):  # type: ignore[misc]
    """A node with checked parameters and threads that end with it.

    Attributes:
        stopping: Raised when the node stops; give it to every wait.
        ended: Raised when the node's process shall end, wanted (`finish`) or not (`fail`).
        failure: Why the node cannot go on, once `fail` was called.
    """

    def __init__(self, name: str, **node_options: Any) -> None:
        self.stopping = Interrupt()
        self.ended = Interrupt()
        self.failure: str | None = None
        self._specs: dict[str, ParameterSpec] = {}
        self._on_change: dict[str, Callable[[Any], None]] = {}
        self._threads: list[threading.Thread] = []
        self._owned: list[Destroyable] = []
        super().__init__(name, **node_options)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._tell_parameters)

    def parameter(
        self,
        name: str,
        default: Any,
        description: str,
        *,
        minimum: float | None = None,
        maximum: float | None = None,
        choices: Sequence[Any] = (),
        of: type | None = None,
        read_only: bool = False,
        on_change: Callable[[Any], None] | None = None,
        check: Check | None = None,
    ) -> Any:
        """Declare a parameter and return its value.

        Args:
            name: The parameter's name.
            default: Its default, whose type is the parameter's type.
            description: One sentence with the unit.
            minimum: Least value of a number (or of a list's numbers).
            maximum: Greatest value, likewise.
            choices: The only values allowed.
            of: Element type of a list whose default is empty.
            read_only: Refuse changes at run time.
            on_change: Called with the new value after each change at run time.
            check: Looks at the value last; returns what was expected, or None when it is good.

        Raises:
            ParameterError: The value given at the start is not allowed.
        """
        element = element_type(name, default, of)
        spec = ParameterSpec(name, default, element, minimum, maximum, tuple(choices), check)
        descriptor = ParameterDescriptor(
            description=description,
            additional_constraints=f'Expected: {spec.expected()}.',
            read_only=read_only,
            # Typing is checked here, in the same words at the start and at run time.
            dynamic_typing=True,
        )
        if element is None and minimum is not None and maximum is not None:
            if isinstance(default, float):
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(minimum), to_value=float(maximum))
                ]
            else:
                descriptor.integer_range = [
                    IntegerRange(from_value=int(minimum), to_value=int(maximum))
                ]
        self._specs[name] = spec
        try:
            value = self.declare_parameter(name, default, descriptor).value
        except (InvalidParameterValueException, InvalidParameterTypeException) as error:
            override = self._parameter_overrides.get(name)
            given = override.value if override is not None else getattr(error, 'value', None)
            spec.accept(given)
            raise spec.error(given) from error
        if isinstance(default, list | tuple) and value is None:
            value = default
        if on_change is not None:
            self._on_change[name] = on_change
        return spec.accept(value)

    def parameters_under(self, prefix: str) -> dict[str, Any]:
        """Declare and return all parameters that were given below a prefix.

        Args:
            prefix: Without the dot: `map` for `map.R1`, `map.R2`, ...

        Returns:
            The values by the rest of the name, in the order given.
        """
        start = prefix + '.'
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
        self, msg_type: Any, topic: str, *args: Any, **kwargs: Any
    ) -> Subscription:
        """Create a subscription as rclpy does; it only warns of a publisher it cannot hear."""

        def on_mismatch(event: QoSRequestedIncompatibleQoSInfo) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            self.get_logger().warn(
                f'topic {topic}: nothing will come from a publisher that offers another {policy}'
            )

        kwargs.setdefault(
            'event_callbacks',
            SubscriptionEventCallbacks(incompatible_qos=on_mismatch, use_default_callbacks=False),
        )
        return super().create_subscription(msg_type, topic, *args, **kwargs)

    def spawn(self, work: Callable[[], None], name: str | None = None) -> threading.Thread:
        """Start a thread for long work; `stop` joins it, so it must heed `stopping`.

        An exception that the work lets out ends the node.
        """

        def body() -> None:
            try:
                work()
            except Exception as error:
                if self.stopping.is_set():
                    return
                traceback.print_exc()
                self.fail(f'{type(error).__name__}: {error}')

        thread = threading.Thread(target=body, name=name or work.__name__, daemon=True)
        self._threads = [t for t in self._threads if t.is_alive()]
        self._threads.append(thread)
        thread.start()
        return thread

    def own(self, entity: Destroyable) -> None:
        """Have an entity destroyed with the node: rclpy forgets action servers and clients."""
        self._owned.append(entity)

    def destroy_node(self) -> None:
        """Take the node out of the graph; only when no executor spins it any more."""
        while self._owned:
            self._owned.pop().destroy()
        super().destroy_node()

    def fail(self, reason: str) -> None:
        """End the node's process with an error: the node cannot go on, and says why."""
        if self.failure is None:
            self.failure = reason
            self.get_logger().fatal(reason)
            self.ended.set()

    def finish(self) -> None:
        """End the node's process as wanted, as SIGTERM does: the exit code is 0."""
        self.ended.set()

    def on_stop(self) -> None:
        """Called once when the node stops, while messages still flow."""

    def stop(self) -> None:
        """End the node's work; call it from outside the executor while that still spins."""
        if self.stopping.is_set():
            return
        self.stopping.set()
        self.on_stop()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(JOIN_SECONDS)
                if thread.is_alive():
                    self.get_logger().warn(f'{thread.name} did not end in {JOIN_SECONDS} s')

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            spec = self._specs.get(parameter.name)
            if spec is None:
                continue
            try:
                spec.accept(_plain(parameter.value))
            except ParameterError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _tell_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            told = self._on_change.get(parameter.name)
            if told is not None:
                told(self._specs[parameter.name].accept(_plain(parameter.value)))


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, 'tolist') else value


def run_node(factory: Callable[[], PatrolNode], args: Sequence[str] | None = None) -> int:
    """Run one node as this process until SIGINT, SIGTERM or its failure.

    Args:
        factory: Builds the node, once ROS is initialised.
        args: Command line without the program's name; None takes `sys.argv`.

    Returns:
        The exit code: 0 for a wanted stop, 1 when the node failed, `EXIT_CANNOT_START` when its
        configuration does not let it start, so that starting it again would not help.
    """
    return run_nodes([factory], args)


def run_nodes(
    factories: Sequence[Callable[[], PatrolNode]], args: Sequence[str] | None = None
) -> int:
    """Run several nodes in this process on one executor; otherwise as `run_node`."""
    # A handler may run in the middle of the main thread's own wait, where an Event's lock is taken
    # and would never be let go: only SimpleQueue.put may be entered anew.
    ended: queue.SimpleQueue[None] = queue.SimpleQueue()

    def end() -> None:
        ended.put(None)

    def on_signal(_number: int, _frame: Any) -> None:
        end()

    # Set by hand: background jobs of a shell inherit an ignored SIGINT.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    argv = [sys.argv[0], *(sys.argv[1:] if args is None else args)]
    try:
        _check_parameter_files(argv)
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:
        print(f'cannot start: {_one_line(error)}', file=sys.stderr)
        return EXIT_CANNOT_START
    nodes: list[PatrolNode] = []
    spinner = ExecutorThread()
    code = 0
    try:
        for factory in factories:
            nodes.append(factory())
            spinner.executor.add_node(nodes[-1])
            nodes[-1].ended.subscribe(end)
        spinner.start(on_end=end)
        ended.get()
    except (ParameterError, StartError) as error:
        print(f'cannot start: {_one_line(error)}', file=sys.stderr)
        code = EXIT_CANNOT_START
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        for node in reversed(nodes):
            node.stop()
        spinner.stop()
        for node in reversed(nodes):
            node.destroy_node()
        rclpy.try_shutdown()
    if spinner.error is not None:
        traceback.print_exception(spinner.error)
        code = 1
    if any(node.failure is not None for node in nodes):
        code = 1
    return code


class ExecutorThread:
    """A single-threaded executor that spins on a thread of its own.

    Args:
        context: ROS context of the nodes; None takes the default one.

    Attributes:
        executor: Add nodes to it before `start`, or later from any thread.
        error: What an executor's callback raised, once the thread has ended by it.
    """

    def __init__(self, context: Any = None) -> None:
        self.executor = SingleThreadedExecutor(context=context)
        self.error: BaseException | None = None
        self._thread: threading.Thread | None = None
        self._stopping = False

    def start(self, on_end: Callable[[], None] | None = None) -> None:
        """Begin to spin; `on_end` is called when spinning ends for whatever reason."""

        def spin() -> None:
            try:
                while not self._stopping:
                    self.executor.spin_once()
            except (ExternalShutdownException, ShutdownException):
                pass
            except BaseException as error:
                self.error = error
            finally:
                if on_end is not None:
                    on_end()

        self._thread = threading.Thread(target=spin, name='executor', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the spinning and join the thread, so that the nodes may be destroyed."""
        self._stopping = True
        # The executor's own shutdown would take its guard conditions away under a running callback.
        self.executor.create_task(lambda: None)
        if self._thread is not None:
            self._thread.join(JOIN_SECONDS)
        self.executor.shutdown(timeout_sec=JOIN_SECONDS)


def _check_parameter_files(argv: Sequence[str]) -> None:
    """Look at the parameter files first: rcl names neither line nor reason.

    Raises:
        StartError: A file is missing, is not YAML, or gives a parameter twice.
    """
    for option, path in itertools.pairwise(argv):
        if option == '--params-file':
            try:
                read_yaml_file(path)
            except YamlFileError as error:
                raise StartError(f'parameter file {error}') from error


def _one_line(error: BaseException) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return ' '.join(lines) or type(error).__name__
