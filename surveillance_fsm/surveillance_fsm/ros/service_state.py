"""A state that calls a service."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rclpy.node import Node

import surveillance_fsm as fsm
from surveillance_fsm.ros.exchange import (
    ExchangeError,
    Incoming,
    Outgoing,
    UserCallback,
    seconds,
)
from surveillance_runtime.calls import CallError, CallInterruptedError, ServiceCaller


class ServiceState(fsm.State):
    """Calls a service and ends with ``succeeded``, ``aborted`` or ``preempted``.

    However the server behaves, the state ends within `timeout`; a preempt ends it at once.

    Args:
        node: The node that calls; an executor must spin it in another thread.
        service_name: The service's name.
        service_spec: The service's type.
        request: The request; an empty one by default. It is copied, never changed.
        request_cb: ``(userdata, request, *args, **kwargs)``; returns the request, or None.
        request_cb_args: See `request_cb`.
        request_cb_kwargs: See `request_cb`.
        request_key: Userdata key that holds the request.
        request_slots: Fields of the request that are userdata keys.
        response_cb: ``(userdata, response, *args, **kwargs)``; may return an outcome.
        response_cb_args: See `response_cb`.
        response_cb_kwargs: See `response_cb`.
        response_key: Userdata key that takes the response.
        response_slots: Fields of the response that become userdata keys.
        input_keys: Userdata that callbacks without a `cb_interface` read.
        output_keys: Userdata that callbacks without a `cb_interface` write.
        outcomes: Outcomes that `response_cb` may return.
        timeout: Seconds (steady time, or an rclpy ``Duration``) for finding the server and for its
            answer together.

    Raises:
        InvalidStateError: A field or a callback is wrong.
    """

    def __init__(
        self,
        node: Node,
        service_name: str,
        service_spec: Any,
        request: Any = None,
        request_cb: Callable[..., Any] | None = None,
        request_cb_args: Iterable[Any] = (),
        request_cb_kwargs: Mapping[str, Any] | None = None,
        request_key: str | None = None,
        request_slots: Iterable[str] = (),
        response_cb: Callable[..., Any] | None = None,
        response_cb_args: Iterable[Any] = (),
        response_cb_kwargs: Mapping[str, Any] | None = None,
        response_key: str | None = None,
        response_slots: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
        *,
        timeout: Any = 60.0,
    ) -> None:
        keys = tuple(input_keys), tuple(output_keys)
        super().__init__(['succeeded', 'aborted', 'preempted', *outcomes], *keys)
        self._request = Outgoing(
            'request',
            service_spec.Request,
            request,
            request_key,
            tuple(request_slots),
            UserCallback('request_cb', request_cb, request_cb_args, request_cb_kwargs, *keys),
        )
        self._response = Incoming(
            'response',
            service_spec.Response,
            response_key,
            tuple(response_slots),
            UserCallback('response_cb', response_cb, response_cb_args, response_cb_kwargs, *keys),
        )
        self._request.declare(self)
        self._response.declare(self)
        self._timeout = seconds(timeout) or 0.0
        self._caller = ServiceCaller(node, service_spec, service_name)

    def execute(self, ud: Any) -> str:
        """Call the service."""
        if self.preempt_requested():
            self.service_preempt()
            return 'preempted'
        try:
            request = self._request.make(ud)
            response = self._caller.call(request, self._timeout, self.interrupt)
            return self._response.take(ud, self, response) or 'succeeded'
        except CallInterruptedError:
            self.service_preempt()
            return 'preempted'
        except (CallError, ExchangeError) as error:
            fsm.logerr(f"Service '{self._caller.name}': {error}")
            return 'aborted'
