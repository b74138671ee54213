"""The process that nodes run in."""

from __future__ import annotations

import subprocess
import sys
import time

import rclpy
from builtin_interfaces.msg import Time
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock as ClockMessage

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import ExecutorThread, share_clock

PROGRAM = """
import numpy, scipy.linalg
from threadpoolctl import threadpool_info
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.process import run_nodes

def node():
    print({each['user_api']: each['num_threads'] for each in threadpool_info()})
    raise ParameterError('enough')

run_nodes([node], [])
"""


def test_nodes_compute_on_one_thread_whatever_was_imported_before() -> None:
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM], capture_output=True, text=True, timeout=60
    )
    assert "{'blas': 1" in done.stdout, done


def test_nodes_of_one_process_hear_the_clock_once_and_each_keeps_its_own(
    ros_domain: int,
) -> None:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    simulated = Parameter('use_sim_time', value=True)
    nodes = [
        PatrolNode(name, context=context, parameter_overrides=[simulated])
        for name in ('first', 'second', 'third')
    ]
    clocks = [node.get_clock() for node in nodes]
    jump = clocks[1].create_jump_callback(
        JumpThreshold(min_forward=Duration(nanoseconds=1), min_backward=None),
        post_callback=lambda _jump: 1 / 0,
    )
    share_clock(nodes)
    spinner = ExecutorThread(context)
    for node in nodes:
        spinner.executor.add_node(node)
    spinner.start()
    teller = nodes[0].create_publisher(ClockMessage, '/clock', 1)

    def tell(seconds: int) -> list[int]:
        """Return the clocks in seconds once the last of them is told the time."""
        end = time.monotonic() + 60.0
        while clocks[2].now().nanoseconds != seconds * 10**9 and time.monotonic() < end:
            teller.publish(ClockMessage(clock=Time(sec=seconds)))
            time.sleep(0.01)
        return [clock.now().nanoseconds // 10**9 for clock in clocks]

    assert tell(5) == [5, 5, 5]
    assert teller.get_subscription_count() == 1
    assert [node.health.lost > 0 for node in nodes] == [False, True, False]
    nodes[0].set_parameters([Parameter('use_sim_time', value=False)])
    first, *others = tell(6)
    assert first > 10**9
    assert others == [6, 6]
    nodes[0].set_parameters([simulated])
    assert tell(7) == [7, 7, 7]
    jump.unregister()
    spinner.stop()
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown(context=context)


STUCK = """
import sys, threading, time
from surveillance_runtime import node, process

node.JOIN_SECONDS = process.JOIN_SECONDS = 0.1

class Stuck(node.PatrolNode):
    def __init__(self):
        super().__init__('stuck')
        for name in ('one', 'two'):
            self.spawn(lambda: threading.Event().wait(), name)
        self.create_timer(0.0, self.work)
    def work(self):
        self.finish()
        time.sleep(1000.0)

sys.exit(process.run_node(Stuck, []))
"""


def test_a_process_whose_threads_do_not_end_ends_all_the_same() -> None:
    done = subprocess.run([sys.executable, '-c', STUCK], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert 'one, two did not end in 0.1 s' in done.stderr


QUICK = """
import sys
from surveillance_runtime import node, process

class Quick(node.PatrolNode):
    def __init__(self):
        super().__init__('quick')
        print('lark' in sys.modules)
        self.create_timer(0.0, self.finish)

sys.exit(process.run_node(Quick, []))
"""


def test_a_node_starts_without_the_code_generator_of_ros() -> None:
    done = subprocess.run([sys.executable, '-c', QUICK], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, 'False\n'), done.stderr


HANGING = """
import sys, threading
from surveillance_runtime import node, process

process.END_SECONDS = 0.5
process.DiagnosticsThread.stop = lambda self: threading.Event().wait()

class Hanging(node.PatrolNode):
    def __init__(self):
        super().__init__('hanging')
        self.create_timer(0.0, self.finish)

sys.exit(process.run_node(Hanging, []))
"""


def test_a_process_that_ros_does_not_let_end_ends_and_tells_where_it_hung() -> None:
    done = subprocess.run(
        [sys.executable, '-c', HANGING], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert 'in _run_nodes' in done.stderr


LEFT_BEHIND = """
import warnings
warnings.simplefilter('error')
import rclpy
from surveillance_runtime.process import ExecutorThread

async def ask():
    raise AssertionError('its turn never comes')

context = rclpy.Context()
rclpy.init(context=context)
spinner = ExecutorThread(context)
spinner.executor.create_task(ask)
spinner.stop()
rclpy.shutdown(context=context)
"""


def test_a_coroutine_that_never_had_its_turn_is_closed_without_a_warning() -> None:
    done = subprocess.run(
        [sys.executable, '-c', LEFT_BEHIND], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, '')
