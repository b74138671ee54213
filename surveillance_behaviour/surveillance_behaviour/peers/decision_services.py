"""The services `why_not` and `go_to`, offered by the node that decides."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup

from surveillance_behaviour.decider import Decider
from surveillance_fsm.exceptions import CallError
from surveillance_interfaces.srv import GoTo, WhyNot
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.waiting import AwaitedWork


def offer_decision_services(
    node: PatrolNode,
    decider: Decider,
    now: Callable[[], float],
    avoided: Callable[[], frozenset[str]],
    work: AwaitedWork,
) -> None:
    """Answer why a place is not chosen, and take where an operator wants the robot.

    Args:
        node: The node that decides.
        decider: Decides.
        now: Seconds on the mission's clock.
        avoided: The places that could not be reached lately.
        work: Threads on which the ontology may be asked.
    """

    async def on_why_not(request: Any, response: Any) -> Any:
        def answer() -> None:
            try:
                told = decider.why_not(request.place, now(), node.stopping, avoided())
            except (ValueError, CallError) as error:
                response.success, response.message = False, str(error)
                return
            response.success, response.message = True, told.sentence
            response.premises = list(told.premises)

        await work.run(answer)
        return response

    def on_go_to(request: Any, response: Any) -> Any:
        try:
            response.message = decider.request(request.place)
            response.success = True
            node.get_logger().info(response.message)
        except ValueError as error:
            response.message = str(error)
        return response

    group = ReentrantCallbackGroup()
    node.create_service(WhyNot, 'why_not', on_why_not, callback_group=group)
    node.create_service(GoTo, 'go_to', on_go_to, callback_group=group)
