"""Client methods written once, called in two ways: blocking, or with ``await``.

A method decorated with `operation` is a generator: it yields the directives it wants carried out
and receives their responses, and what it returns is the result. How the directives travel is the
business of the client's `Transport`.

    client.query.ind_b2_class('ROOM')                    # blocks; from a thread
    await client.query.ind_b2_class.call_async('ROOM')   # in a callback of a node
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from functools import update_wrapper
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, TypeVar, overload

from surveillance_ontology.armor.protocol import (
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    ListResponse,
)

P = ParamSpec('P')
R = TypeVar('R')
S = TypeVar('S', bound='HasTransport')

Batch = Sequence[DirectiveRequest]
Steps = Generator[DirectiveRequest | Batch, Any, R]
"""What an operation is: it yields a directive (and is sent its response) or a batch of them."""


class ArmorServiceCallError(Exception):
    """The server could not be reached, or did not answer in time."""


class ArmorServiceInternalError(Exception):
    """The server refused a directive.

    Attributes:
        exit_code: ARMOR's exit code.
    """

    def __init__(self, message: str, exit_code: int | str) -> None:
        super().__init__(message)
        self.exit_code = ExitCode(int(exit_code))


class Transport(Protocol):
    """Brings directives to a server.

    Every method raises `ArmorServiceCallError` when no answer comes.
    """

    def call(self, request: DirectiveRequest) -> DirectiveResponse:
        """Carry out one directive and block until the answer."""

    def call_list(self, requests: Batch) -> ListResponse:
        """Carry out a batch and block until the answer."""

    async def call_async(self, request: DirectiveRequest) -> DirectiveResponse:
        """Carry out one directive."""

    async def call_list_async(self, requests: Batch) -> ListResponse:
        """Carry out a batch."""


class HasTransport(Protocol):
    """What owns operations."""

    @property
    def transport(self) -> Transport:
        """Where the directives go."""


class BoundOperation(Generic[P, R]):
    """An operation of one client."""

    def __init__(self, owner: HasTransport, steps: Callable[..., Steps[R]]) -> None:
        self._owner = owner
        self._steps = steps
        update_wrapper(self, steps)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Block until the result; never in a callback of the node that spins."""
        steps = self._steps(self._owner, *args, **kwargs)
        transport = self._owner.transport
        answer: Any = None
        try:
            while True:
                wanted = steps.send(answer)
                if isinstance(wanted, DirectiveRequest):
                    answer = transport.call(wanted)
                else:
                    answer = transport.call_list(wanted)
        except StopIteration as end:
            result: R = end.value
            return result

    async def call_async(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Give the result to ``await``."""
        steps = self._steps(self._owner, *args, **kwargs)
        transport = self._owner.transport
        answer: Any = None
        while True:
            try:
                wanted = steps.send(answer)
            except StopIteration as end:
                result: R = end.value
                return result
            if isinstance(wanted, DirectiveRequest):
                answer = await transport.call_async(wanted)
            else:
                answer = await transport.call_list_async(wanted)


class Operation(Generic[S, P, R]):
    """The descriptor behind `operation`."""

    def __init__(self, steps: Callable[Concatenate[S, P], Steps[R]]) -> None:
        self._steps = steps
        self.__doc__ = steps.__doc__

    @overload
    def __get__(self, owner: None, kind: type[S]) -> Operation[S, P, R]: ...
    @overload
    def __get__(self, owner: S, kind: type[S] | None = None) -> BoundOperation[P, R]: ...
    def __get__(
        self, owner: S | None, kind: type[S] | None = None
    ) -> Operation[S, P, R] | BoundOperation[P, R]:
        if owner is None:
            return self
        return BoundOperation(owner, self._steps)


def operation(steps: Callable[Concatenate[S, P], Steps[R]]) -> Operation[S, P, R]:
    """Make a generator method callable in both ways."""
    return Operation(steps)


class RequestMaker(HasTransport, Protocol):
    """The client that parts belong to."""

    reference_name: str

    def request(self, words: str, *args: str) -> DirectiveRequest:
        """Make a directive."""


class ClientPart:
    """A group of operations of one client."""

    def __init__(self, client: RequestMaker) -> None:
        self.client = client

    @property
    def transport(self) -> Transport:
        """Where the directives go."""
        return self.client.transport

    def request(self, words: str, *args: str) -> DirectiveRequest:
        """Make a directive of the client."""
        return self.client.request(words, *args)


def checked(response: DirectiveResponse) -> DirectiveResponse:
    """Pass a response on if it is a success.

    Raises:
        ArmorServiceInternalError: It is not.
    """
    if not response.success:
        raise ArmorServiceInternalError(response.error_description, response.exit_code)
    return response
