"""Servers that do not do what they should, and states that talk to them."""

from __future__ import annotations

import threading
from contextlib import contextmanager

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future
from std_srvs.srv import Trigger

import state_machines as fsm
from libs.state_machines.tests.states import Answer, Waiter
from state_machines.ros import (
    ServiceState,
    SimpleActionState,
)
from surveillance_interfaces.action import FollowPath
from surveillance_runtime.introspection import IntrospectionServer
from surveillance_runtime.node import PatrolNode

SHORT = 0.3
LONG = 60.0


def machine_of(state, userdata=None):
    machine = fsm.StateMachine(state.get_registered_outcomes())
    machine.set_name('ROOT')
    for key, value in (userdata or {}).items():
        machine.userdata[key] = value
    with machine:
        fsm.StateMachine.add('STATE', state)
    return machine


class Asleep(fsm.Interrupt):
    """An interrupt that tells when a sleep has begun.

    Attributes:
        begun: The sleeper has fixed when it ends: from now on time may pass.
    """

    def __init__(self):
        super().__init__()
        self.begun = threading.Event()

    def subscribe(self, callback):
        self.begun.set()
        return super().subscribe(callback)


class SilentServer(PatrolNode):
    """A service that never answers."""

    def __init__(self, **options):
        super().__init__('silent', **options)
        self.asked = threading.Event()
        self.create_service(Trigger, 'trigger', self._serve)

    async def _serve(self, request, response):
        self.asked.set()
        await Future()
        return response


class LossyActionServer(ActionServer):
    """An action server that loses requests.

    Attributes:
        loses: What it loses the next request of: ``goal``, ``cancel``, ``result``.
        asked: What it was asked for, what was lost included.
    """

    def __init__(self, *args, **kwargs):
        self.loses = set()
        self.asked = set()
        super().__init__(*args, **kwargs)

    async def execute(self, taken_data):
        self.asked |= set(taken_data)
        for kind in self.loses & set(taken_data):
            self.loses.remove(kind)
            del taken_data[kind]
        await super().execute(taken_data)


class ScriptedActionServer(PatrolNode):
    """An action server that accepts, refuses or drops as it is told."""

    accept = True
    cancel = CancelResponse.ACCEPT

    def __init__(self, **options):
        super().__init__('scripted', **options)
        self.began = threading.Event()
        self.cancelled = threading.Event()
        self.hold = Future()
        self.server = LossyActionServer(
            self,
            FollowPath,
            'follow_path',
            self._execute,
            goal_callback=lambda _: GoalResponse.ACCEPT if self.accept else GoalResponse.REJECT,
            cancel_callback=self._cancel,
        )
        self.own(self.server)

    def let_go(self):
        """Have the goals end; by the executor, which nothing else might wake."""
        self.executor.create_task(self.hold.set_result, None)

    def _cancel(self, _handle):
        self.cancelled.set()
        return self.cancel

    async def _execute(self, handle):
        self.began.set()
        await self.hold
        handle.succeed()
        return FollowPath.Result()


class Refusing(ScriptedActionServer):
    accept = False


class Stubborn(ScriptedActionServer):
    cancel = CancelResponse.REJECT


def feed(run, message, heard):
    """Publish a feedback until its client has heard it.

    Feedback is a topic: what is published before the two have met, or just before the result, may
    never be heard, since rclpy's client listens no more once it has the result.

    Args:
        run: The goal's run.
        message: The feedback.
        heard: A predicate: the client has this feedback.
    """
    while not heard():
        run.feedback(message)
        run.sleep(0.01)


def service(node, **arguments):
    return ServiceState(node, 'trigger', Trigger, **{'timeout': LONG, **arguments})


def action(node, **arguments):
    times = {'server_wait_timeout': LONG, 'preempt_timeout': LONG}
    return SimpleActionState(node, 'follow_path', FollowPath, **{**times, **arguments})


@contextmanager
def introspected(node):
    """Serve a machine whose inner one waits; gives its root and the state that waits."""
    waiter = Waiter(100.0)
    inner = fsm.StateMachine(['done', 'preempted'])
    root = fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('FIRST', Answer('done'), {'done': 'INNER'})
        fsm.StateMachine.add('INNER', inner)
        with inner:
            fsm.StateMachine.add('WAIT', waiter, {'done': 'LAST'})
            fsm.StateMachine.add('LAST', Answer('done'))
    root.userdata.level = 7
    root.userdata.secret = object()
    server = IntrospectionServer(node, 'robot', root, '/PATROL')
    server.start()
    yield root, waiter
    root.request_preempt()
    server.stop()
