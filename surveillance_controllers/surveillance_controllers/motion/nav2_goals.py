"""Goals for servers that Nav2's lifecycle manager starts: when they may be sent, how they end.

A server that is up but not active rejects every goal; one whose inner servers are not active aborts
it at once. Neither is an obstacle: `Nav2Goals` looks at the states of Nav2's nodes, waits for them
with growing pauses, and tells which it waits for. It lets time pass after goals that ended at once,
cancels a goal while the robot is to stand, and waits while another program has Nav2 drive.

How the servers answer is that of nav2_util's SimpleActionServer (Jazzy, 1.3): a goal to an inactive
server is rejected; a goal that another one takes the place of is aborted with an empty result,
whose error code is 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from lifecycle_msgs.srv import GetState

from state_machines import Interrupt
from state_machines.ros import (
    CallError,
    CallInterruptedError,
    GoalCaller,
    GoalEnd,
    GoalRun,
    ServiceCaller,
)
from surveillance_controllers.motion.arrival import MotionFailedError
from surveillance_controllers.motion.holding import Hold
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import STATE_QOS

DRIVING_SERVERS = (
    'bt_navigator',
    'controller_server',
    'planner_server',
    'behavior_server',
    'velocity_smoother',
    'collision_monitor',
    'map_server',
    'amcl',
)
"""Nodes of Nav2 that have to be active for the robot to come to a goal. One that does not run, or
is no lifecycle node, is not asked."""
NAVIGATING = ('navigate_to_pose', 'navigate_through_poses')
"""Actions of which Nav2 carries out one goal at a time."""
STATE_TIMEOUT = 2.0
"""A node may take so long to tell its state, seconds."""
PAUSES = (0.5, 1.0, 2.0, 4.0, 8.0, 10.0)
"""Pauses after goals that ended at once, and between two looks, seconds; the last is repeated."""
AT_ONCE = 5.0
"""A goal that fails within this time is not sent again without a pause, seconds."""
MOST_REJECTED = 5
"""After so many rejections by a server that is active, the goal has failed."""
CALL_AFTER = 30.0
"""Whoever waits longer than this for a server calls a person, seconds."""
UNDER_WAY = (GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELING)


def nav2_actions(parameter: str, value: str, without: str, *names: str) -> list[Any]:
    """Return action types of Nav2 by their names.

    Args:
        parameter: Of the node, which asks for them,
        value: with this value.
        without: The value that does not need them.
        names: Of the types.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """
    try:
        from nav2_msgs import action

        return [getattr(action, name) for name in names]
    except (ImportError, AttributeError):
        raise ParameterError(
            f'parameter {parameter}: got {value}, but the Python package nav2_msgs is not '
            'installed: install ros-jazzy-nav2-msgs and source its workspace (python3 launch.py '
            'setup --with nav2 takes it from there), or use '
            f'{parameter}:={without}'
        ) from None


class Nav2Goals:
    """Sends goals to one action of Nav2.

    Args:
        node: The node that sends them.
        hold: Whether the robot is to stand; a goal is cancelled then.
        kind: The action's type.
        name: The action's name.
        servers: Names of the nodes that have to be active, the action's own first.
        timeout: How long the server may take to accept a goal, seconds.
    """

    def __init__(
        self,
        node: PatrolNode,
        hold: Hold,
        kind: Any,
        name: str,
        servers: Sequence[str],
        timeout: float,
    ) -> None:
        self._node, self._hold, self._timeout = node, hold, timeout
        self._caller = GoalCaller(node, kind, name)
        self._name, self._server = name, servers[0]
        self._states = {
            each: ServiceCaller(node, GetState, f'{each}/get_state') for each in servers
        }
        self._cause = 'node', servers[0]
        self._failed_in_a_row = 0

    def send(
        self,
        make: Callable[[], Any],
        run: GoalRun,
        on_feedback: Callable[[Any], None] | None = None,
        *,
        also: Interrupt | None = None,
        again: bool = True,
    ) -> GoalEnd | None:
        """Send a goal and wait for its end.

        A goal that is cancelled because the robot is to stand is sent again when it may move.

        Args:
            make: Returns the goal; called anew each time that it is sent.
            run: Of this node's own goal; its interrupt ends the wait and cancels the goal.
            on_feedback: Told each feedback message.
            also: Another interrupt that cancels the goal.
            again: Whether the goal is sent again when its server died while it ran.

        Returns:
            None: It was interrupted.

        Raises:
            MotionFailedError: The server, which is active, rejects it time and again, or it died.
        """
        rejected = 0
        while True:
            self._hold.await_end(run.interrupt)
            if run.interrupt.is_set() or not self._pause(run):
                return None
            began = run.now()
            try:
                with interrupted_by(run.interrupt, self._hold.begun, also) as either:
                    end = self._caller.run(
                        make(),
                        accept_timeout=self._timeout,
                        interrupt=either,
                        on_feedback=on_feedback,
                    )
            except CallInterruptedError:
                stands = either.is_set() and not (also is not None and also.is_set())
                if run.interrupt.is_set() or not stands:
                    return None
                continue
            except CallError as error:
                self._failed_in_a_row += 1
                self._node.get_logger().warn(f"Nav2's {self._server}: {error}")
                if not self._await_server(run, str(error)):
                    return None
                if not again:
                    raise MotionFailedError(str(error), None) from error
                continue
            if end.status == 'succeeded':
                self._failed_in_a_row = 0
                self._node.incidents.end(self._cause)
                return end
            at_once = run.now() - began < AT_ONCE
            self._failed_in_a_row = self._failed_in_a_row + 1 if at_once else 0
            if end.status != 'rejected':
                self._await_active(run)
                return end
            rejected += 1
            self._node.get_logger().warn(f'Nav2 rejected the goal on {self._name}')
            if not self._await_active(run):
                return None
            if rejected == MOST_REJECTED:
                raise MotionFailedError(f'Nav2 rejected the goal {rejected} times', None)

    def _pause(self, run: GoalRun) -> bool:
        """Let time pass after goals that failed at once; False: interrupted."""
        if not self._failed_in_a_row:
            return True
        return run.sleep(PAUSES[min(self._failed_in_a_row, len(PAUSES)) - 1])

    def _await_server(self, run: GoalRun, why: str) -> bool:
        """Wait until the action has a server again; False: interrupted."""
        return self._await(
            run, lambda: f'{why}; {self._server} is not there' * (not self._caller.is_ready())
        ) and self._await_active(run)

    def _await_active(self, run: GoalRun) -> bool:
        """Wait until each node is active; False: interrupted."""
        return self._await(run, lambda: self.inactive(run.interrupt))

    def _await(self, run: GoalRun, look: Callable[[], str]) -> bool:
        """Wait until a look finds nothing amiss, and tell what it finds."""
        began = run.now()
        told = False
        for number in range(10**9):
            if not (why := look()):
                break
            severity = Severity.ALARM if run.now() - began >= CALL_AFTER else Severity.WARNING
            action = 'start Nav2, or have its lifecycle manager activate it'
            text = f'{why}: the patrol waits for it'
            self._node.incidents.begin(self._cause, text, severity, action=action)
            told = True
            if not run.sleep(PAUSES[min(number, len(PAUSES) - 1)]):
                return False
        if told:
            self._node.incidents.end(self._cause, f"Nav2's {self._server} can be used again")
        return not run.interrupt.is_set()

    def inactive(self, interrupt: Interrupt) -> str:
        """Return which nodes are not active, in words; empty: each that tells its state is."""
        found = []
        for name, caller in self._states.items():
            if not caller.is_ready():
                continue
            try:
                answer = caller.call(GetState.Request(), STATE_TIMEOUT, interrupt)
            except CallInterruptedError:
                return ''
            except CallError:
                found.append(f"Nav2's {name} does not tell its state")
                continue
            if answer.current_state.label != 'active':
                found.append(f"Nav2's {name} is {answer.current_state.label}")
        return ', '.join(found)


class OtherGoals:
    """Whether another program has Nav2 drive: a person by RViz, say.

    Args:
        node: The node that looks.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._under_way = dict.fromkeys(NAVIGATING, False)

        def take(name: str) -> Callable[[GoalStatusArray], None]:
            def taken(message: GoalStatusArray) -> None:
                states = [each.status in UNDER_WAY for each in message.status_list]
                self._under_way[name] = any(states)

            return taken

        for name in NAVIGATING:
            node.create_subscription(
                GoalStatusArray, f'{name}/_action/status', take(name), STATE_QOS
            )

    def running(self) -> str:
        """Return the action of which a goal runs; empty: of none. Ask when no own goal runs."""
        return next((name for name, runs in self._under_way.items() if runs), '')


class GoalCanceller:
    """Cancels all goals of one action, whoever sent them.

    Args:
        node: The node that cancels.
        name: The action's name.
    """

    def __init__(self, node: PatrolNode, name: str) -> None:
        self._caller = ServiceCaller(node, CancelGoal, f'{name}/_action/cancel_goal')

    def cancel(self, interrupt: Interrupt) -> None:
        """Ask for it; nothing happens where nobody answers."""
        if self._caller.is_ready():
            try:
                self._caller.call(CancelGoal.Request(), STATE_TIMEOUT, interrupt)
            except CallError:
                return


@contextmanager
def interrupted_by(*causes: Interrupt | None) -> Iterator[Interrupt]:
    """Yield an interrupt that is raised once one of several is."""
    either = Interrupt()
    forget = [each.subscribe(either.set) for each in causes if each is not None]
    try:
        yield either
    finally:
        for each in forget:
            each()


def reason_of(result: Any) -> str:
    """Return what Nav2 says of a goal that it did not reach, in brackets; empty: nothing."""
    code = getattr(result, 'error_code', 0)
    text = ' '.join(str(getattr(result, 'error_msg', '')).split())
    name = _error_name(result, code) if code else ''
    said = [f'error code {code}{name and " " + name}'] * bool(code) + [text] * bool(text)
    return f' ({", ".join(said)})' if said else ''


def _error_name(result: Any, code: int) -> str:
    """Return the constant of an error code; empty: none has it.

    A navigator hands on the codes of its planner and controller, too, which stand in the results
    of their own actions; each action of Nav2 numbers its errors in a range of its own.
    """
    from nav2_msgs import action

    kinds = [getattr(kind, 'Result', None) for _, kind in sorted(vars(action).items())]
    for kind in (type(result), *kinds):
        for name in dir(kind):
            if name.isupper() and '__' not in name and getattr(kind, name) == code:
                return name
    return ''
