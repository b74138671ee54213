"""The services `why_not` and `go_to`, offered by the node that decides."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup

from surveillance_behaviour.decider import Decider
from surveillance_fsm import Interrupt
from surveillance_fsm.exceptions import CallError
from surveillance_interfaces.srv import GoTo, WhyNot
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.waiting import AwaitedWork


class DecisionServices:
    """Answers why a place is not chosen, and takes where an operator wants the robot.

    Args:
        node: The node that decides.
        decider: Decides.
        now: Seconds on the mission's clock.
        avoided: The places that could not be reached lately.
        work: Threads on which the ontology may be asked.
    """

    def __init__(
        self,
        node: PatrolNode,
        decider: Decider,
        now: Callable[[], float],
        avoided: Callable[[], frozenset[str]],
        work: AwaitedWork,
    ) -> None:
        self._decider = decider
        self._now = now
        self._avoided = avoided
        self._work = work
        self._interrupt = Interrupt()
        node.stopping.subscribe(self._interrupt.set)
        group = ReentrantCallbackGroup()
        node.create_service(WhyNot, 'why_not', self._on_why_not, callback_group=group)
        node.create_service(GoTo, 'go_to', self._on_go_to, callback_group=group)
        self._log = node.get_logger()

    async def _on_why_not(self, request: Any, response: Any) -> Any:
        def answer() -> None:
            try:
                told = self._decider.why_not(
                    request.place, self._now(), self._interrupt, self._avoided()
                )
            except (ValueError, CallError) as error:
                response.success, response.message = False, str(error)
                return
            response.success, response.message = True, told.sentence
            response.premises = list(told.premises)

        await self._work.run(answer)
        return response

    def _on_go_to(self, request: Any, response: Any) -> Any:
        try:
            response.message = self._decider.request(request.place)
            response.success = True
            self._log.info(response.message)
        except ValueError as error:
            response.message = str(error)
        return response
