"""The ARMOR client for ROS nodes, and subscriptions to the facts of an ontology.

    client = ArmorClient(node, 'planner', reference_name)
    client.query.objectprop_b2_ind('canReach', 'Robot1')                      # in a worker thread
    await client.query.objectprop_b2_ind.call_async('canReach', 'Robot1')     # in a callback

Blocking calls wait while another thread spins the node's executor; in a callback they would wait
for themselves, so there they must be awaited.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from armor_service import client
from armor_service.client import (
    ArmorServiceCallError,
    ArmorServiceInternalError,
    Batch,
)
from armor_service.facts import FactSet, ShortFact
from armor_service.protocol import (
    DirectiveRequest,
    DirectiveResponse,
    ListResponse,
    name_in,
    value_in,
)
from state_machines import Interrupt
from state_machines.ros import CallError, CallTimeoutError, ServiceCaller
from state_machines.ros.waiting import executor_of
from surveillance_interfaces.msg import FactChanges
from surveillance_interfaces.srv import ArmorDirective, ArmorDirectiveList
from surveillance_ontology.conversions import (
    changes_from_ros,
    request_to_ros,
    response_from_ros,
)
from surveillance_ontology.patrol_vocabulary import ROBOT
from surveillance_runtime.node import PatrolNode

__all__ = [
    'ArmorClient',
    'ArmorServiceCallError',
    'ArmorServiceInternalError',
    'FactSubscription',
    'RosTransport',
    'declared_robot_name',
    'name_in',
    'value_in',
]

RETRY_SECONDS = 0.1
SPUN_WITHIN = 0.2
"""Seconds within which an executor that spins runs a task."""
CHANGES_TOPIC = 'fact_changes'
CHANGES_QOS = QoSProfile(
    depth=100,  # The publisher keeps one; a subscriber that is busy may catch up with a burst.
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


class RosTransport:
    """Brings directives to an armor server over its two services.

    Args:
        node: The node that calls; an executor must spin it.
        service_name: The service for one directive.
        serial_service_name: The service for batches.
        timeout: Seconds for finding the server and for its answer together.
        interrupt: Ends blocking calls early, for example the node's ``stopping``.
    """

    def __init__(
        self,
        node: Node,
        service_name: str,
        serial_service_name: str,
        timeout: float,
        interrupt: Interrupt | None = None,
    ) -> None:
        self._node = node
        self._single = ServiceCaller(node, ArmorDirective, service_name)
        self._serial = ServiceCaller(node, ArmorDirectiveList, serial_service_name)
        self._interrupt = interrupt
        self.timeout = timeout

    def is_ready(self) -> bool:
        """Tell whether the server is there now."""
        return self._single.is_ready() and self._serial.is_ready()

    def look_for_answer(self) -> Callable[[float], bool]:
        """Return a look whether a server that did not answer does again, see `ServiceCaller`."""
        caller, message = self._written(
            DirectiveRequest(self._node.get_name(), '', 'GET', 'ALL', 'REFS')
        )
        return caller.look_for_answer(message)

    def call(self, request: DirectiveRequest | Batch) -> DirectiveResponse | ListResponse:
        """Carry out a directive or a batch and block until the answer."""
        caller, message = self._written(request)
        try:
            return _read(caller.call(message, self.timeout, self._interrupt))
        except CallTimeoutError as error:
            if self._is_spun():
                raise ArmorServiceCallError(str(error)) from error
            raise ArmorServiceCallError(
                f'{error}: no thread spins node {self._node.get_name()!r} meanwhile; spin it in '
                'another thread, await ....call_async(...) where this is one of its callbacks, or '
                'use armor_api.armor_client.ArmorClient, which spins a node of its own. '
                'The server may have carried the directive out.'
            ) from error
        except CallError as error:
            raise ArmorServiceCallError(str(error)) from error

    async def call_async(
        self, request: DirectiveRequest | Batch
    ) -> DirectiveResponse | ListResponse:
        """Carry out a directive or a batch."""
        caller, message = self._written(request)
        try:
            return _read(await caller.call_async(message, self.timeout))
        except CallError as error:
            raise ArmorServiceCallError(str(error)) from error

    def _written(self, request: DirectiveRequest | Batch) -> tuple[ServiceCaller, Any]:
        """Return which service carries it out, and the message."""
        if isinstance(request, DirectiveRequest):
            message = ArmorDirective.Request(armor_request=request_to_ros(request))
            return self._single, message
        rows = [request_to_ros(row) for row in request]
        return self._serial, ArmorDirectiveList.Request(armor_requests=rows)

    def _is_spun(self) -> bool:
        if self._node.executor is None:
            return False
        spun = threading.Event()
        executor_of(self._node).create_task(spun.set)
        return spun.wait(SPUN_WITHIN)


def _read(answer: Any) -> DirectiveResponse | ListResponse:
    if isinstance(answer, ArmorDirective.Response):
        return response_from_ros(answer.armor_response)
    responses = [response_from_ros(response) for response in answer.armor_responses]
    return ListResponse(answer.success, answer.is_consistent, responses)


class ArmorClient(client.ArmorClient):
    """A client of one reference of an armor server.

    Args:
        node: The node that calls; an executor must spin it.
        client_id: Name of this client; matters for mounting only, several nodes may share it.
        reference_name: The ontology that its directives mean.
        service_name: The server's service for one directive.
        serial_service_name: The server's service for batches.
        timeout: Seconds for finding the server and for its answer together.
        interrupt: Ends blocking calls early, for example the node's ``stopping``.
    """

    def __init__(
        self,
        node: Node,
        client_id: str,
        reference_name: str,
        service_name: str = 'armor_interface_srv',
        serial_service_name: str = 'armor_interface_serialized_srv',
        timeout: float = 5.0,
        interrupt: Interrupt | None = None,
    ) -> None:
        transport = RosTransport(node, service_name, serial_service_name, timeout, interrupt)
        super().__init__(client_id, reference_name, transport)


class FactSubscription:
    """Keeps the facts that match a pattern, and tells of each that comes or goes.

    It asks the server for the facts first and follows the server's change messages then; when it
    missed some, or the server is another one, it asks again.

    Args:
        node: The node that subscribes; an executor must spin it.
        armor: A client of the reference.
        pattern: ``URGENT(?)``, ``canReach(Robot1, ?)``, ``visitedAt(?, ?)``.
        callback: Called in the executor with a fact and whether it came (True) or went (False).
        on_reload: Called when the reference was loaded or dropped, or another server appeared.

    Raises:
        ValueError: The pattern cannot be read.
    """

    def __init__(
        self,
        node: Node,
        armor: client.ArmorClient,
        pattern: str,
        callback: Callable[[ShortFact, bool], None],
        on_reload: Callable[[], None] | None = None,
    ) -> None:
        self._on_reload = on_reload
        self._set = FactSet(pattern)
        self._node = node
        self._armor = armor
        self._callback = callback
        self._asking = False
        self._ask_again = False
        # Steady time: a simulated clock may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._retry = node.create_timer(RETRY_SECONDS, self._on_retry, clock=steady)
        self._retry.cancel()
        self._subscription = node.create_subscription(
            FactChanges,
            CHANGES_TOPIC,
            self._on_changes,
            CHANGES_QOS,
            event_callbacks=SubscriptionEventCallbacks(matched=self._on_matched),
        )

    @property
    def facts(self) -> frozenset[ShortFact]:
        """The facts that match now, as far as is known."""
        return self._set.facts

    def _on_matched(self, _status: Any) -> None:
        # Another server may count on from any number, by chance from the next one.
        self._set.forget_sequence()
        if self._on_reload is not None:
            self._on_reload()
        self.ask_anew()

    def _on_changes(self, msg: FactChanges) -> None:
        is_own = msg.reference_name == self._armor.reference_name
        # One of another reference tells by its number whether any was missed.
        changes = changes_from_ros(msg) if is_own else []
        told = self._set.follow(msg.sequence, changes)
        if told is None and self._on_reload is not None:
            self._on_reload()  # That it was loaded or dropped may be what was missed.
        # An answer that is awaited may be from before these changes.
        if told is None or (self._asking and self._set.concerns(changes)):
            self.ask_anew()
        # That answer is told by its difference to what is known by then.
        self._tell(told or [])

    def _on_retry(self) -> None:
        self._retry.cancel()
        self.ask_anew()

    def ask_anew(self) -> None:
        """Ask for all facts again, as where the client's reference is another one."""
        stopping = getattr(self._node, 'stopping', None)
        if stopping is not None and stopping.is_set():
            return  # The server's leaving is news, too, and nobody would await the answer.
        if self._asking:
            self._ask_again = True
            return
        self._asking = True
        executor_of(self._node).create_task(self._ask)

    async def _ask(self) -> None:
        try:
            while True:
                self._ask_again = False
                facts = await self._answer()
                if not self._ask_again:
                    break
            self._tell(self._set.replace(*facts))
        except ArmorServiceCallError as error:
            self._node.get_logger().debug(f'facts {self._set.pattern}: {error}')
            if self._ask_again or self._subscription.get_publisher_count() > 0:
                # Its topic is discovered, its service not yet. Without it, its return is told.
                self._retry.reset()
        finally:
            self._asking = False

    async def _answer(self) -> tuple[list[ShortFact], list[ShortFact]]:
        """Return the facts that match, and those of them that are asserted."""
        try:
            return await self._armor.query.facts_by_origin.call_async(str(self._set.pattern))
        except ArmorServiceInternalError:
            # There is no such reference: no facts either. Its loading is announced.
            return [], []

    def _tell(self, changes: list[tuple[ShortFact, bool]]) -> None:
        for fact, came in changes:
            self._callback(fact, came)


def declared_robot_name(node: PatrolNode) -> str:
    """Declare and return the name that a node's robot has in the ontology."""
    name: str = node.parameter(
        'robot_name',
        ROBOT,
        "The robot's name in the ontology, in which each robot of a fleet has its own.",
        read_only=True,
    )
    return name
