"""The Python client of ARMOR's services, with the method names of ARMOR's own Python API.

    client = ArmorClient('planner', 'map', InProcessTransport(service))
    client.manipulation.add_objectprop_to_ind('hasDoor', 'R1', 'D1')
    client.utils.sync_buffered_reasoner()
    client.query.objectprop_b2_ind('canReach', 'Robot1')         # ['C1', 'C2']

Each method can be called in two ways: blocking, or with ``await``:

    client.query.ind_b2_class('ROOM')                    # blocks; from a thread
    await client.query.ind_b2_class.call_async('ROOM')   # in a callback of a node

Most methods are one directive of the service's table: a line says which one, what it takes and what
is read of the answer. ``help(client.query.rules)`` says what the table does, which is imported for
that alone: a client needs no reasoner. A method decorated with `operation` makes a generator: it
yields the directives it wants carried out and receives their responses, and what it returns is the
result.

How directives travel is the business of the client's `Transport`. The client for ROS is
`surveillance_ontology.armor_client.ArmorClient`; this module knows no ROS.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from inspect import Signature, signature
from typing import (
    TYPE_CHECKING,
    Any,
    Concatenate,
    Generic,
    ParamSpec,
    Protocol,
    TypeVar,
    cast,
    overload,
)

from armor_service.facts import ShortFact, parse_fact
from armor_service.protocol import (
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    ListResponse,
    name_in,
)

if TYPE_CHECKING:
    from armor_service.service import ArmorService

P = ParamSpec('P')
R = TypeVar('R')
S = TypeVar('S', bound='HasTransport')

Batch = Sequence[DirectiveRequest]
Steps = Generator[DirectiveRequest | Batch, Any, R]
"""What an operation is: it yields a directive (and is sent its response) or a batch of them."""


class ArmorError(Exception):
    """A directive that was not carried out.

    Attributes:
        msg: What went wrong, in one line.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.msg = message


class ArmorServiceCallError(ArmorError):
    """The server could not be reached, or did not answer in time."""


class ArmorServiceInternalError(ArmorError):
    """The server refused a directive.

    Attributes:
        code: ARMOR's exit code; one that `ExitCode` does not know stays a number.
    """

    def __init__(self, message: str, exit_code: int | str) -> None:
        super().__init__(message)
        self.code = int(exit_code)
        with suppress(ValueError):
            self.code = ExitCode(self.code)

    @property
    def exit_code(self) -> int:
        """The same as `code`, by the name of the response's field."""
        return self.code


class Transport(Protocol):
    """Brings directives to a server.

    A directive is answered with a `DirectiveResponse`, a batch with a `ListResponse`. Both methods
    raise `ArmorServiceCallError` when no answer comes.
    """

    def call(self, request: DirectiveRequest | Batch) -> Any:
        """Carry out a directive or a batch and block until the answer."""

    async def call_async(self, request: DirectiveRequest | Batch) -> Any:
        """Carry out a directive or a batch."""


class HasTransport(Protocol):
    """What owns operations."""

    @property
    def transport(self) -> Transport:
        """Where the directives go."""


class BoundOperation(Generic[P, R]):
    """An operation of one client.

    Attributes:
        operation: What it is for any client.
    """

    def __init__(self, owner: HasTransport, operation: Operation[Any, P, R]) -> None:
        self._owner = owner
        self._steps = operation.steps
        self.operation = operation

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """What the operation does."""
        return self.operation.help

    @property
    def __signature__(self) -> Signature:
        """What it takes."""
        taken = signature(self.operation.takes)
        arguments = [one for one in taken.parameters.values() if one.name != 'self']
        return taken.replace(parameters=arguments, return_annotation=Signature.empty)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Block until the result; never in a callback of the node that spins."""
        steps = self._steps(self._owner, *args, **kwargs)
        transport = self._owner.transport
        answer: Any = None
        while True:
            try:
                wanted = steps.send(answer)
            except StopIteration as end:
                result: R = end.value
                return result
            answer = transport.call(wanted)

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
            answer = await transport.call_async(wanted)


class Operation(Generic[S, P, R]):
    """The descriptor behind `operation` and `directive`.

    Args:
        steps: What it does for its owner.
        words: The directives that it may send.
        takes: A function with the arguments of the method.
        help: What it does, in a sentence; without, what the table says of its first directive.

    Attributes:
        steps, words, takes: As above.
    """

    def __init__(
        self,
        steps: Callable[Concatenate[S, P], Steps[R]],
        words: Sequence[str],
        takes: Callable[..., object],
        help: str | None = None,
    ) -> None:
        self.steps, self.words, self.takes = steps, words, takes
        self._help = help

    @property
    def help(self) -> str:
        """What it does."""
        if self._help is not None:
            return self._help
        # The table needs the reasoner, which a client does not.
        from armor_service.directives import TABLE

        return next(row.summary for row in TABLE.values() if row.words == self.words[0])

    @overload
    def __get__(self, owner: None, kind: type[S]) -> Operation[S, P, R]: ...
    @overload
    def __get__(self, owner: S, kind: type[S] | None = None) -> BoundOperation[P, R]: ...
    def __get__(
        self, owner: S | None, kind: type[S] | None = None
    ) -> Operation[S, P, R] | BoundOperation[P, R]:
        return self if owner is None else BoundOperation(owner, self)


def operation(
    *words: str,
) -> Callable[[Callable[Concatenate[S, P], Steps[R]]], Operation[S, P, R]]:
    """Make a generator method, which sends directives of these words, callable in both ways."""
    return lambda steps: Operation(steps, words, steps, steps.__doc__)


def directive(
    words: str, takes: Callable[P, None], read: Callable[[DirectiveResponse], R], *last: str
) -> Operation[ClientPart, P, R]:
    """Return a method that sends one directive with its arguments in order, as text.

    A list stands for several arguments. ``with_URI`` is not sent: without it, entities in the
    result are read as names.

    Args:
        words: Command and specifications; behind ``|`` those for when the last argument, which is
            optional then, is given.
        takes: A function with the arguments of the method.
        read: Makes the result of the response, which is a success.
        last: Further arguments, always the same.
    """
    short, *long = words.split('|')
    parameters = signature(takes)
    has_names = 'with_URI' in parameters.parameters

    def steps(owner: ClientPart, /, *args: P.args, **kwargs: P.kwargs) -> Steps[R]:
        bound = parameters.bind(*args, **kwargs)
        bound.apply_defaults()
        values: list[Any] = list(bound.args)
        shortened = has_names and not values.pop()
        if long and not values[-1]:
            values.pop()
        sent: list[str] = []
        for value in values:
            sent += [str(value)] if isinstance(value, str | float | int) else value
        chosen = long[0] if long and len(values) > 1 else short
        result: Any = read((yield from owner.carry_out(chosen, *sent, *last)))
        named: Any = [name_in(text) for text in result] if shortened else result
        return cast('R', named)

    return Operation(steps, (short, *long), takes)


def _texts(response: DirectiveResponse) -> list[str]:
    return response.queried_objects


def _entities(response: DirectiveResponse) -> list[str]:
    # Without owl:Nothing.
    return [rendered for rendered in response.queried_objects if rendered.startswith('<')]


def _first(response: DirectiveResponse) -> str | None:
    return next(iter(response.queried_objects), None)


def _rows(response: DirectiveResponse) -> list[dict[str, str]]:
    return [json.loads(row) for row in response.queried_objects]


def _facts(response: DirectiveResponse) -> list[ShortFact]:
    return [parse_fact(text) for text in response.queried_objects]


def _explanation(response: DirectiveResponse) -> tuple[str, str] | None:
    found = response.queried_objects
    return (found[0], found[1]) if found else None


def _done(_: DirectiveResponse) -> None:
    return


def _consistent(response: DirectiveResponse) -> bool:
    return response.is_consistent


# What the methods take, by the names of ARMOR's own Python API.
def _nothing() -> None: ...
def _ind(ind_name: str) -> None: ...
def _inds(ind_names: Iterable[str]) -> None: ...
def _ind_of_class(ind_name: str, class_name: str) -> None: ...
def _class(class_name: str) -> None: ...
def _classes(class_names: Iterable[str]) -> None: ...
def _class_below(class_name: str, super_class_name: str = '') -> None: ...
def _members(class_name: str, ind_name: str = '') -> None: ...
def _cardinality(
    class_name: str, objectprop_name: str, cardinality: int, value_class_name: str
) -> None: ...
def _related(objectprop_name: str, ind_name: str = '') -> None: ...
def _relation(objectprop_name: str, ind_name: str, value_obj_name: str) -> None: ...
def _relation_instead(
    objectprop_name: str, ind_name: str, new_value: str, old_value: str
) -> None: ...
def _values(dataprop_name: str, ind_name: str) -> None: ...
def _value(dataprop_name: str, ind_name: str, value_type: str, value: str) -> None: ...
def _value_instead(
    dataprop_name: str, ind_name: str, value_type: str, new_value: str, old_value: str
) -> None: ...
def _renaming(old_name: str, new_name: str) -> None: ...
def _name(name: str) -> None: ...
def _axiom(axiom: str) -> None: ...
def _rule(rule: str) -> None: ...
def _query(query: str, timeout_ms: int = 0) -> None: ...
def _seconds(seconds: float) -> None: ...
def _file(filepath: str) -> None: ...
def _ind_uri(ind_name: str, with_URI: bool = False) -> None: ...  # noqa: N803
def _class_uri(class_name: str, with_URI: bool = False) -> None: ...  # noqa: N803
def _expression_uri(expression: str, with_URI: bool = False) -> None: ...  # noqa: N803
def _related_uri(objectprop_name: str, ind_name: str, with_URI: bool = False) -> None: ...  # noqa: N803


class ClientPart:
    """A group of operations of one client."""

    def __init__(self, client: ArmorClient) -> None:
        self.client = client

    @property
    def transport(self) -> Transport:
        """Where the directives go."""
        return self.client.transport

    def request(self, words: str, *args: str) -> DirectiveRequest:
        """Make a directive of the client."""
        return self.client.request(words, *args)

    def carry_out(self, words: str, *args: str) -> Steps[DirectiveResponse]:
        """Send a directive and return its response, which is a success."""
        return checked((yield self.request(words, *args)))


def checked(response: DirectiveResponse) -> DirectiveResponse:
    """Pass a response on if it is a success.

    Raises:
        ArmorServiceInternalError: It is not.
    """
    if not response.success:
        raise ArmorServiceInternalError(response.error_description, response.exit_code)
    return response


class Manipulation(ClientPart):
    """Directives that change the ontology.

    All return whether the ontology is consistent; with buffering, as of the last reasoning. All
    raise `ArmorServiceCallError` and `ArmorServiceInternalError`. Values are given as text.
    """

    add_ind = directive('ADD IND', _ind, _consistent)
    add_ind_to_class = directive('ADD IND CLASS', _ind_of_class, _consistent)
    add_class = directive('ADD CLASS|ADD CLASS CLASS', _class_below, _consistent)
    disj_inds = directive('DISJOINT IND', _inds, _consistent)
    disj_inds_of_class = directive('DISJOINT IND CLASS', _class, _consistent)
    disj_classes = directive('DISJOINT CLASS', _classes, _consistent)
    disj_subclasses = directive('DISJOINT CLASS CLASS', _class, _consistent)
    make_equivalent = directive('MAKE EQUIVALENT CLASS', _class, _consistent)
    add_min_cardinality = directive('ADD CARDINALITY MIN', _cardinality, _consistent)
    add_objectprop_to_ind = directive('ADD OBJECTPROP IND', _relation, _consistent)
    add_dataprop_to_ind = directive('ADD DATAPROP IND', _value, _consistent)

    @operation('ADD DATAPROP IND')
    def add_batch_dataprop_to_ind(
        self, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> Steps[bool]:
        """Add values, each ``[property, type, value]``, in one batch."""
        return self._change_all('ADD', ind_name, properties)

    set_objectprop_of_ind = directive('SET OBJECTPROP IND', _relation, _consistent)
    set_dataprop_of_ind = directive('SET DATAPROP IND', _value, _consistent)
    replace_objectprop_b2_ind = directive('REPLACE OBJECTPROP IND', _relation_instead, _consistent)
    replace_dataprop_b2_ind = directive('REPLACE DATAPROP IND', _value_instead, _consistent)

    @operation('QUERY DATAPROP IND', 'REPLACE DATAPROP IND', 'ADD DATAPROP IND')
    def replace_one_dataprop_b2_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, new_value: str
    ) -> Steps[bool]:
        """Put a value in the place of the only one there is, or add it when there is none.

        Raises:
            ArmorServiceInternalError: 206, there are several values.
        """
        return self._replace_one('DATAPROP IND', dataprop_name, ind_name, value_type, new_value)

    @operation('QUERY OBJECTPROP IND', 'REPLACE OBJECTPROP IND', 'ADD OBJECTPROP IND')
    def replace_one_objectprop_b2_ind(
        self, objectprop_name: str, ind_name: str, new_value: str
    ) -> Steps[bool]:
        """Relate to a new individual instead of the only one there is, or add it without any.

        Raises:
            ArmorServiceInternalError: 206, there are several.
        """
        return self._replace_one('OBJECTPROP IND', objectprop_name, ind_name, new_value)

    remove_ind = directive('REMOVE IND', _ind, _consistent)
    remove_ind_from_class = directive('REMOVE IND CLASS', _ind_of_class, _consistent)
    remove_class = directive('REMOVE CLASS|REMOVE CLASS CLASS', _class_below, _consistent)
    remove_dataprop_from_ind = directive('REMOVE DATAPROP IND', _value, _consistent)

    @operation('REMOVE DATAPROP IND')
    def remove_batch_dataprop_to_ind(
        self, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> Steps[bool]:
        """Retract values, each ``[property, type, value]``, in one batch."""
        return self._change_all('REMOVE', ind_name, properties)

    remove_objectprop_from_ind = directive('REMOVE OBJECTPROP IND', _relation, _consistent)
    rename_ind = directive('RENAME IND', _renaming, _consistent)
    rename_class = directive('RENAME CLASS', _renaming, _consistent)
    rename_dataprop = directive('RENAME DATAPROP', _renaming, _consistent)
    rename_objectprop = directive('RENAME OBJECTPROP', _renaming, _consistent)
    add_axiom = directive('ADD AXIOM', _axiom, _consistent)
    remove_axiom = directive('REMOVE AXIOM', _axiom, _consistent)
    add_rule = directive('ADD RULE', _rule, _consistent)
    remove_rule = directive('REMOVE RULE', _rule, _consistent)
    close_objectprop = directive('CLOSE OBJECTPROP|CLOSE OBJECTPROP IND', _related, _consistent)
    close_class = directive('CLOSE CLASS|CLOSE CLASS IND', _members, _consistent)

    def _change_all(
        self, command: str, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> Steps[bool]:
        words = f'{command} DATAPROP IND'
        requests = [self.request(words, prop, ind_name, *value) for prop, *value in properties]
        if not requests:
            return True
        answer: ListResponse = yield requests
        for response in answer.responses:
            checked(response)
        return answer.is_consistent

    def _replace_one(self, words: str, prop: str, ind: str, *new: str) -> Steps[bool]:
        old = (yield from self.carry_out(f'QUERY {words}', prop, ind)).queried_objects
        if len(old) > 1:
            raise ArmorServiceInternalError(
                f'{prop} of {ind} has {len(old)} values, expected one: {", ".join(old)}',
                ExitCode.SEVERAL_VALUES,
            )
        command = 'REPLACE' if old else 'ADD'
        response = yield from self.carry_out(f'{command} {words}', prop, ind, *new, *old)
        return response.is_consistent


class Query(ClientPart):
    """Directives that ask. All raise `ArmorServiceCallError` and `ArmorServiceInternalError`.

    ``with_URI`` asks for ``<iri#name>``, where without it the name alone is given.
    """

    ind_b2_class = directive('QUERY IND CLASS', _class_uri, _texts)
    objectprop_b2_ind = directive('QUERY OBJECTPROP IND', _related_uri, _texts)
    dataprop_b2_ind = directive('QUERY DATAPROP IND', _values, _texts)

    @operation('QUERY IND')
    def check_ind_exists(self, ind_name: str) -> Steps[bool]:
        """Tell whether an individual is of any class."""
        response: DirectiveResponse = yield self.request('QUERY IND', ind_name)
        if not response.success and response.exit_code != ExitCode.OK:
            checked(response)
        return response.success and bool(response.queried_objects)

    class_of_ind = directive('QUERY CLASS IND', _ind_uri, _texts, 'false')
    bottom_class_of_ind = directive('QUERY CLASS IND', _ind, _first, 'true')
    subclasses = directive(
        'QUERY CLASS CLASS',
        _class_uri,
        _entities,
    )
    restrictions = directive('QUERY CLASS RESTRICTIONS', _class, _texts)
    dataprops_of_ind = directive('QUERY IND DATAPROP', _ind_uri, _texts)
    objectprops_of_ind = directive('QUERY IND OBJECTPROP', _ind_uri, _texts)
    sparql = directive('QUERY SPARQL ROWS', _query, _rows)

    @operation('QUERY FACT')
    def facts(self, pattern: str) -> Steps[list[ShortFact]]:
        """Return asserted and derived facts that match a pattern, ``canReach(Robot1, ?)``."""
        parse_fact(pattern)
        return _facts((yield from self.carry_out('QUERY FACT', pattern)))

    @operation('QUERY FACT')
    def facts_by_origin(self, pattern: str) -> Steps[tuple[list[ShortFact], list[ShortFact]]]:
        """Return facts that match a pattern: all of them, and those of them that are asserted."""
        parse_fact(pattern)
        answer: ListResponse = yield [
            self.request('QUERY FACT', pattern),
            self.request('QUERY FACT', pattern, 'true'),
        ]
        every, asserted = answer.responses
        return _facts(checked(every)), _facts(checked(asserted))

    @operation('QUERY EXPLAIN')
    def explain(self, fact: str) -> Steps[tuple[str, str] | None]:
        """Return why a fact such as ``URGENT(R3)`` holds, a sentence and a tree, or None."""
        parse_fact(fact)
        response: DirectiveResponse = yield self.request('QUERY EXPLAIN', fact)
        if not response.success and response.exit_code == ExitCode.OK:
            return None
        return _explanation(checked(response))

    @operation('QUERY EXPLAIN ABSENCE')
    def explain_absence(self, fact: str) -> Steps[list[str]]:
        """Return what a fact such as ``URGENT(R3)`` lacks: a sentence, then each missing condition;
        nothing where it holds.
        """
        parse_fact(fact)
        return _texts((yield from self.carry_out('QUERY EXPLAIN ABSENCE', fact)))

    ind_b2_expression = directive('QUERY IND EXPRESSION', _expression_uri, _texts)
    axioms = directive('QUERY AXIOMS', _name, _texts)
    rules = directive('QUERY RULES', _nothing, _texts)
    unsupported = directive('QUERY UNSUPPORTED', _nothing, _texts)
    rolled_back = directive('QUERY TAKEN BACK', _nothing, _texts)
    explain_inconsistency = directive('QUERY EXPLAIN INCONSISTENCY', _nothing, _explanation)


class Utils(ClientPart):
    """Directives about references, files and logging."""

    apply_buffered_changes = directive('APPLY', _nothing, _consistent)
    sync_buffered_reasoner = directive('REASON', _nothing, _consistent)
    reason_within = directive('REASON', _seconds, _consistent)
    cancel = directive('CANCEL', _nothing, _done)
    save_ref_with_inferences = directive('SAVE INFERENCE', _file, _done)

    @operation('SAVE', 'SAVE INFERENCE')
    def save(self, filepath: str, inference: bool = False) -> Steps[None]:
        """Save, with the derived facts if asked for; an empty path is the file that was loaded."""
        yield from self.carry_out('SAVE INFERENCE' if inference else 'SAVE', filepath)

    backup = directive('BACKUP', _file, _done)

    @operation('LOAD FILE', 'LOAD FILE MOUNTED')
    def load_ref_from_file(
        self,
        owl_file_path: str,
        iri: str,
        buffered_manipulation: bool = False,
        reasoner: str = 'PELLET',
        buffered_reasoner: bool = False,
        mounted: bool = False,
    ) -> Steps[None]:
        """Load an ontology; nothing happens when the reference is loaded already."""
        flags = (str(buffered_manipulation), reasoner, str(buffered_reasoner))
        words = 'LOAD FILE MOUNTED' if mounted else 'LOAD FILE'
        yield from self.carry_out(words, owl_file_path, iri, *flags)

    drop_ref = directive('DROP', _nothing, _done)
    mount_on_ref = directive('MOUNT', _nothing, _done)
    unmount_from_ref = directive('UNMOUNT', _nothing, _done)
    get_all_refs = directive('GET ALL REFS', _nothing, _texts)

    @operation('GET REF CLIENT')
    def get_ref_client(self, reference_name: str = '') -> Steps[str | None]:
        """Return the client mounted on a reference (the own one if none is named); None when nobody
        is.
        """
        name = reference_name or self.client.reference_name
        (mounted,) = _texts((yield from self.carry_out('GET REF CLIENT', name)))
        return None if mounted == 'none' else mounted

    @operation('LOG SCREEN ON', 'LOG SCREEN OFF')
    def set_log_to_terminal(self, switch: bool) -> Steps[None]:
        """Switch the server's log on its console."""
        yield from self.carry_out(f'LOG SCREEN {"ON" if switch else "OFF"}')

    @operation('LOG FILE ON', 'LOG FILE OFF')
    def set_log_to_file(self, switch: bool, filepath: str = '') -> Steps[None]:
        """Switch the server's log to a file."""
        if switch and not filepath:
            raise ArmorServiceCallError('set_log_to_file: expected the path of a file')
        yield from self.carry_out(*(('LOG FILE ON', filepath) if switch else ('LOG FILE OFF',)))


class ArmorClient:
    """A client of one reference.

    Args:
        client_id: Name of this client; matters for mounting only.
        reference_name: The ontology that its directives mean.
        transport: How they travel.

    Attributes:
        manipulation: Directives that change the ontology.
        query: Directives that ask.
        utils: Directives about references, files and logging.
    """

    def __init__(self, client_id: str, reference_name: str, transport: Transport) -> None:
        self.client_id = client_id
        self.reference_name = reference_name
        self.transport = transport
        self.manipulation = Manipulation(self)
        self.query = Query(self)
        self.utils = Utils(self)

    def request(self, words: str, *args: str) -> DirectiveRequest:
        """Make a directive, ``request('ADD IND CLASS', 'R1', 'ROOM')``, for example for `batch`."""
        command, primary, secondary, *_ = (*words.split(), '', '', '')
        return DirectiveRequest(
            self.client_id, self.reference_name, command, primary, secondary, args
        )

    @operation()
    def call(
        self, command: str, first_spec: str, second_spec: str, args_list: Sequence[str]
    ) -> Steps[DirectiveResponse]:
        """Carry out any directive; the response also when it is no success."""
        response: DirectiveResponse = yield DirectiveRequest(
            self.client_id, self.reference_name, command, first_spec, second_spec, args_list
        )
        return response

    @operation()
    def batch(self, requests: Sequence[DirectiveRequest]) -> Steps[ListResponse]:
        """Carry out directives in order, with no other client's in between."""
        answer: ListResponse = yield requests
        return answer


class InProcessTransport:
    """Brings directives to a service in this process."""

    def __init__(self, service: ArmorService) -> None:
        self._service = service

    def call(self, request: DirectiveRequest | Batch) -> DirectiveResponse | ListResponse:
        """Carry out a directive or a batch."""
        if isinstance(request, DirectiveRequest):
            return self._service.execute(request)
        return self._service.execute_list(request)

    async def call_async(
        self, request: DirectiveRequest | Batch
    ) -> DirectiveResponse | ListResponse:
        """Carry out a directive or a batch."""
        return self.call(request)
