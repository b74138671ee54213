"""The life of a process that runs nodes: start, spinning, signals, and an orderly end.

`run_node` is the body of every executable: the executor spins on a thread of its own, so that the
main thread takes SIGINT and SIGTERM at once, stops the nodes' work while messages still flow (a
running goal can be cancelled), and only then takes ROS down.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.clock import ROSClock
from rclpy.executors import ExternalShutdownException, ShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from rclpy.time_source import CLOCK_TOPIC
from rosgraph_msgs.msg import Clock as ClockMessage

from surveillance_runtime.configuration import RosArguments, argument_layer, split_arguments
from surveillance_runtime.diagnostics import DiagnosticsThread, Heartbeat
from surveillance_runtime.discovery import prefer_quick_discovery
from surveillance_runtime.executor import PatrolExecutor
from surveillance_runtime.launch_protocol import (
    EXIT_CANNOT_START,
    EXIT_NOT_NOW,
    ONE_THREAD,
    SAY_WHERE,
    NotNowError,
)
from surveillance_runtime.node import (
    JOIN_SECONDS,
    PatrolNode,
    give_arguments,
    report_exception,
)
from surveillance_runtime.parameters import ParameterError

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
END_SECONDS = 30.0
"""Time for the threads and ROS to end once the nodes have stopped."""


def run_node(factory: Callable[[], PatrolNode], args: Sequence[str] | None = None) -> int:
    """Run one node as this process until SIGINT, SIGTERM or its failure.

    Args:
        factory: Builds the node, once ROS is initialised.
        args: Command line without the program's name; None takes `sys.argv`.

    Returns:
        The exit code: 0 for a wanted stop, 1 when the node failed, `EXIT_CANNOT_START` when its
        configuration does not let it start, so that starting it again would not help,
        `EXIT_NOT_NOW` when it may help later.
    """
    return run_nodes([factory], args)


def run_nodes(
    factories: Sequence[Callable[[], PatrolNode]], args: Sequence[str] | None = None
) -> int:
    """Run several nodes in this process on one executor; otherwise as `run_node`.

    Where threads have not ended in time, this ends the process: the interpreter would take apart
    what they use, and die of a signal. Where ROS does not end in `END_SECONDS`, the process says on
    stderr what each thread waits for, and ends with exit code 1.
    """
    code = _run_nodes(factories, args)
    if any(thread.daemon for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def _run_nodes(factories: Sequence[Callable[[], PatrolNode]], args: Sequence[str] | None) -> int:
    use_one_thread_for_matrices()
    prefer_quick_discovery()
    # Where ROS finds its code generator it loads it with a parser: 0.02 to 0.09 s of CPU a process.
    sys.modules.setdefault('rosidl_generator_py.generate_py_impl', None)  # type: ignore[arg-type]
    # A client that was killed, or is not fully discovered, gets no answer and asks again.
    warnings.filterwarnings('ignore', 'failed to send response', RuntimeWarning)
    ending = _Ending()
    faulthandler.register(SAY_WHERE, file=2, chain=True)
    argv = [sys.argv[0], *(sys.argv[1:] if args is None else args)]
    try:
        arguments = split_arguments(argv[1:])
        give_arguments(arguments)
        words = [argv[0], *arguments.rest]
        rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:
        give_arguments(None)
        print(f'cannot start: {_one_line(error)}{_about_security()}', file=sys.stderr)
        return EXIT_CANNOT_START
    nodes: list[PatrolNode] = []
    spinner = ExecutorThread()
    heartbeat = diagnostics = None
    code = 0
    try:
        for factory in factories:
            nodes.append(factory())
            spinner.executor.add_node(nodes[-1])
            nodes[-1].ended.subscribe(ending.come)
        check_taken(arguments, nodes)
        share_clock(nodes)
        heartbeat = Heartbeat(nodes)
        diagnostics = DiagnosticsThread(nodes, heartbeat.take_lateness)
        for node in nodes:
            node.get_logger().info('ready')
        spinner.start(on_end=ending.come)
        ending.wait()
        if any(node.finished for node in nodes):
            heartbeat.say_finished()
    except (ParameterError, NotNowError) as error:
        who = getattr(factory, '__name__', '') + ' ' if len(factories) > 1 else ''
        print(f'{who}cannot start: {_one_line(error)}', file=sys.stderr)
        code = EXIT_NOT_NOW if isinstance(error, NotNowError) else EXIT_CANNOT_START
    finally:
        ending.ignore_signals()
        give_arguments(None)
        late = [node for node in reversed(nodes) if not node.stop()]
        # Its watchdog needs neither the interpreter nor a lock; it tells where each thread hangs.
        faulthandler.dump_traceback_later(END_SECONDS, exit=True, file=2)
        if diagnostics is not None:
            diagnostics.stop()
        # What a callback that has not ended uses is not taken away from under it.
        if spinner.stop():
            if heartbeat is not None and not late:
                heartbeat.say_done()
            for node in reversed(nodes):
                node.destroy_node()
            rclpy.try_shutdown()
        faulthandler.cancel_dump_traceback_later()
    if spinner.error is not None:
        traceback.print_exception(spinner.error)
        code = 1
    if any(node.failure is not None for node in nodes):
        code = EXIT_CANNOT_START if all(n.unusable for n in nodes if n.failure) else 1
    return code


def use_one_thread_for_matrices() -> None:
    """Have the libraries behind NumPy and SciPy work on the calling thread alone.

    A node's matrices are small: further threads cost half as much processor time again, taken from
    the other nodes, and save none.
    """
    if ONE_THREAD.items() <= os.environ.items():
        return  # said before they were loaded
    # for libraries that are loaded from now on
    os.environ.update(ONE_THREAD)
    # for those that are there already
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)


def check_taken(arguments: RosArguments, nodes: Sequence[PatrolNode]) -> None:
    """Make sure that each `-p` is a parameter of one of the nodes.

    Raises:
        ParameterError: One would be ignored.
    """
    for entry in argument_layer(arguments.assignments).entries:
        takes = any(
            node.has_parameter(entry.name)
            for node in nodes
            if entry.addresses(node.get_name(), node.get_fully_qualified_name())
        )
        if not takes and not entry.name.startswith('qos_overrides.'):
            names = ' or '.join(node.get_name() for node in nodes)
            raise ParameterError(f'{entry.origin}: not a parameter of {names} as configured')


def share_clock(nodes: Sequence[PatrolNode]) -> None:
    """Let nodes of one process that follow `/clock` take each of its messages once for all.

    To be called before they are spun, by one executor. `use_sim_time` of each still switches its
    own clock. Taking the message for each node costs a tenth of a composed patrol.
    """
    following = [node for node in nodes if node.get_parameter('use_sim_time').value]

    def set_clocks(message: ClockMessage) -> None:
        now = Time.from_msg(message.clock)
        for node in following:
            try:
                clock = node.get_clock()
                assert isinstance(clock, ROSClock)
                clock.set_ros_time_override(now)
            except Exception as error:
                report_exception(error, node, CLOCK_TOPIC)

    if len(following) > 1:
        for node in following:
            node._time_source.detach_node()
        latest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        following[0].create_subscription(ClockMessage, CLOCK_TOPIC, set_clocks, latest)


class _Ending:
    """Why the main thread goes on: a stop signal, or a thread that says so.

    A pipe, for nothing else is safe: a signal that comes just before a lock is waited for does not
    end that wait, and a handler in the middle of an Event's wait finds its lock taken for good.
    """

    def __init__(self) -> None:
        # Left open: late threads may still write.
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        # Set by hand: background jobs of a shell inherit an ignored SIGINT.
        for number in STOP_SIGNALS:
            signal.signal(number, lambda _number, _frame: None)
        # The launcher's command `node` held them back while Python started.
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)

    def come(self) -> None:
        """End the wait; from any thread."""
        with contextlib.suppress(BlockingIOError):  # full of reasons to end
            os.write(self._writer, b'\0')

    def wait(self) -> None:
        """Wait for the end."""
        while not {0, *STOP_SIGNALS} & set(os.read(self._reader, 4096)):
            pass

    def ignore_signals(self) -> None:
        """Note that the process is ending: signals change nothing any more."""
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        signal.set_wakeup_fd(-1)


class ExecutorThread:
    """A single-threaded executor that spins on a thread of its own.

    Args:
        context: ROS context of the nodes; None takes the default one.

    Attributes:
        executor: Add nodes to it before `start`, or later from any thread.
        error: What ended the thread, where something did.
        lost: What the last callback raised that failed.
    """

    def __init__(self, context: Any = None) -> None:
        self.executor = PatrolExecutor(context=context)
        self.error: BaseException | None = None
        self.lost: Exception | None = None
        self._thread: threading.Thread | None = None
        self._stopping = False

    def start(self, on_end: Callable[[], None] | None = None) -> None:
        """Begin to spin; `on_end` is called when spinning ends for whatever reason."""

        def spin() -> None:
            try:
                while not self._stopping:
                    self._spin_once()
            except (ExternalShutdownException, ShutdownException):
                pass
            except BaseException as error:
                self.error = error
            finally:
                if on_end is not None:
                    on_end()

        self._thread = threading.Thread(target=spin, name='executor', daemon=True)
        self._thread.start()

    def _spin_once(self) -> None:
        """Spin; what a callback raises costs its message, never the process."""
        try:
            self.executor.spin_once()
        except (ExternalShutdownException, ShutdownException):
            raise
        except Exception as error:
            if self._stopping:
                return
            self.lost = error
            node = _node_of(error) or next(iter(self.executor.get_nodes()), None)
            if node is None:
                raise
            report_exception(error, node, 'callback')

    def stop(self) -> bool:
        """End the spinning and join the thread.

        Returns:
            Whether it ended in time, so that the nodes may be destroyed.
        """
        self._stopping = True
        # The executor's own shutdown would take its guard conditions away under a running callback.
        self.executor.create_task(lambda: None)
        if self._thread is not None:
            self._thread.join(JOIN_SECONDS)
            if self._thread.is_alive():
                return False
        self.executor.shutdown(timeout_sec=JOIN_SECONDS)
        return True


def _node_of(error: BaseException) -> Node | None:
    """Return the node in whose code an exception was raised, if it can be told."""
    found = None
    step = error.__traceback__
    while step is not None:
        for value in (step.tb_frame.f_locals.get('self'), step.tb_frame.f_locals.get('node')):
            if isinstance(value, PatrolNode):
                found = value
        step = step.tb_next
    return found


def _about_security() -> str:
    """Return what SROS2 needs, which rcl does not say, where it is asked for."""
    if os.environ.get('ROS_SECURITY_ENABLE', '').lower() != 'true':
        return ''
    keystore = os.environ.get('ROS_SECURITY_KEYSTORE') or 'not set'
    return (
        f'. ROS_SECURITY_ENABLE is true (ROS_SECURITY_KEYSTORE: {keystore}): expected a ROS with '
        'DDS security, which the one from PyPI has not'
    )


def _one_line(error: BaseException) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return ' '.join(lines) or type(error).__name__
