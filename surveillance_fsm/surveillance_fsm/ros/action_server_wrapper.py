"""A state machine as an action server."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from typing import Any

import surveillance_fsm as fsm
from surveillance_fsm.active import ActiveContainer
from surveillance_fsm.container import describe
from surveillance_runtime.action_server import GoalAbortedError, GoalRun, GoalServer
from surveillance_runtime.node import PatrolNode


class ActionServerWrapper:
    """Executes a container for every goal of an action; the newest goal wins.

    The container's input keys are taken from the wrapper's userdata and its output keys put there.

    Args:
        node: The node that serves.
        server_name: The action's name.
        action_spec: The action's type.
        wrapped_container: What to execute.
        succeeded_outcomes: Outcomes that make the goal succeed.
        aborted_outcomes: Outcomes that abort it; so do all that are not named.
        preempted_outcomes: Outcomes after a cancel; without a cancel they abort the goal.
        goal_key: Userdata key for the goal.
        feedback_key: Userdata key of the container that holds the feedback to publish at each
            transition.
        result_key: Userdata key for the result.
        goal_slots_map: From fields of the goal to userdata keys.
        feedback_slots_map: From fields of the feedback to userdata keys of the container.
        result_slots_map: From fields of the result to userdata keys.
        expand_goal_slots: Put every field of the goal under its own name.
        pack_result_slots: Take every field of the result from the key of its name, if set.

    Raises:
        InvalidStateError: An outcome is named twice, or is none of the container's.
    """

    def __init__(
        self,
        node: PatrolNode,
        server_name: str,
        action_spec: Any,
        wrapped_container: ActiveContainer,
        succeeded_outcomes: Iterable[str] = (),
        aborted_outcomes: Iterable[str] = (),
        preempted_outcomes: Iterable[str] = (),
        goal_key: str = 'action_goal',
        feedback_key: str = 'action_feedback',
        result_key: str = 'action_result',
        goal_slots_map: Mapping[str, str] | None = None,
        feedback_slots_map: Mapping[str, str] | None = None,
        result_slots_map: Mapping[str, str] | None = None,
        expand_goal_slots: bool = False,
        pack_result_slots: bool = False,
    ) -> None:
        self.wrapped_container = wrapped_container
        self.userdata = fsm.UserData()
        self._node = node
        self._server_name = server_name
        self._action_spec = action_spec
        self._succeeded = frozenset(succeeded_outcomes)
        self._preempted = frozenset(preempted_outcomes)
        aborted = frozenset(aborted_outcomes)
        named = [*self._succeeded, *self._preempted, *aborted]
        outcomes = wrapped_container.get_registered_outcomes()
        for outcome in named:
            if named.count(outcome) > 1 or outcome not in outcomes:
                raise fsm.InvalidStateError(
                    f"Action '{server_name}': outcome '{outcome}' must be named once and be one of "
                    f'{sorted(outcomes)}'
                )
        self._goal_key, self._feedback_key, self._result_key = goal_key, feedback_key, result_key
        self._goal_slots = dict(goal_slots_map or {})
        self._feedback_slots = dict(feedback_slots_map or {})
        self._result_slots = dict(result_slots_map or {})
        self._expand_goal_slots = expand_goal_slots
        self._pack_result_slots = pack_result_slots
        self._run: GoalRun | None = None
        wrapped_container.register_transition_cb(self._on_transition)

    def run_server(self) -> None:
        """Start to serve; does not block."""
        self._server = GoalServer(self._node, self._action_spec, self._server_name, self._execute)

    def publish_feedback(self, userdata: fsm.UserData) -> None:
        """Publish the feedback that is in `userdata`."""
        run = self._run
        if run is None:
            return
        feedback = self._action_spec.Feedback()
        if self._feedback_key in userdata:
            feedback = userdata[self._feedback_key]
        for slot, key in self._feedback_slots.items():
            if key in userdata:
                setattr(feedback, slot, userdata[key])
        run.feedback(feedback)

    def _on_transition(self, userdata: fsm.UserData, _active_states: list[str]) -> None:
        self.publish_feedback(userdata)

    def _execute(self, goal: Any, run: GoalRun) -> Any:
        container, userdata = self.wrapped_container, self.userdata
        spec = self._action_spec
        if self._expand_goal_slots:
            for slot in spec.Goal.get_fields_and_field_types():
                userdata[slot] = getattr(goal, slot)
        userdata[self._goal_key] = goal
        userdata[self._result_key] = spec.Result()
        userdata[self._feedback_key] = spec.Feedback()
        for slot, key in self._goal_slots.items():
            userdata[key] = getattr(goal, slot)
        # What a goal before asked for is not for this one.
        container.recall_preempt()
        self._run = run
        remove = run.interrupt.subscribe(container.request_preempt)
        try:
            outcome = container.execute(userdata)
        except fsm.SmachError as error:
            raise GoalAbortedError(describe(error)) from error
        finally:
            remove()
            self._run = None
            container.recall_preempt()
        result = self._result()
        if outcome in self._succeeded:
            return result
        if outcome in self._preempted and run.interrupt.is_set():
            return result
        raise GoalAbortedError(f"'{container.get_name()}' ended with '{outcome}'", result)

    def _result(self) -> Any:
        result = copy.copy(self.userdata[self._result_key])
        for slot, key in self._result_slots.items():
            setattr(result, slot, self.userdata[key])
        if self._pack_result_slots:
            for slot in self._action_spec.Result.get_fields_and_field_types():
                if slot in self.userdata:
                    setattr(result, slot, self.userdata[slot])
        return result
