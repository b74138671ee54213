"""The Python client of ARMOR's services, with the method names of ARMOR's own Python API.

    client = ArmorClient('planner', 'map', InProcessTransport(service))
    client.manipulation.add_objectprop_to_ind('hasDoor', 'R1', 'D1')
    client.utils.sync_buffered_reasoner()
    client.query.objectprop_b2_ind('canReach', 'Robot1')         # ['C1', 'C2']

Each method can be called in two ways: blocking, or with ``await``:

    client.query.ind_b2_class('ROOM')                    # blocks; from a thread
    await client.query.ind_b2_class.call_async('ROOM')   # in a callback of a node

A method decorated with `operation` makes a generator: it yields the directives it wants carried out
and receives their responses, and what it returns is the result. How the directives travel is the
business of the client's `Transport`. The client for ROS is
`surveillance_ontology.armor_client.ArmorClient`; this module knows no ROS.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from functools import update_wrapper
from typing import (
    TYPE_CHECKING,
    Any,
    Concatenate,
    Generic,
    ParamSpec,
    Protocol,
    TypeVar,
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

    def _carry_out(self, words: str, *args: str) -> Steps[DirectiveResponse]:
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

    def _change(self, words: str, *args: str) -> Steps[bool]:
        return (yield from self._carry_out(words, *args)).is_consistent

    def _change_all(self, requests: Sequence[DirectiveRequest]) -> Steps[bool]:
        if not requests:
            return True
        answer: ListResponse = yield requests
        for response in answer.responses:
            checked(response)
        return answer.is_consistent

    @operation
    def add_ind(self, ind_name: str) -> Steps[bool]:
        """Make an individual known."""
        return self._change('ADD IND', ind_name)

    @operation
    def add_ind_to_class(self, ind_name: str, class_name: str) -> Steps[bool]:
        """Assert that an individual is of a class."""
        return self._change('ADD IND CLASS', ind_name, class_name)

    @operation
    def add_class(self, class_name: str, super_class_name: str = '') -> Steps[bool]:
        """Make a class known, below another if one is given."""
        if super_class_name:
            return self._change('ADD CLASS CLASS', class_name, super_class_name)
        return self._change('ADD CLASS', class_name)

    @operation
    def disj_inds(self, ind_names: Iterable[str]) -> Steps[bool]:
        """State that individuals are different."""
        return self._change('DISJOINT IND', *ind_names)

    @operation
    def disj_inds_of_class(self, class_name: str) -> Steps[bool]:
        """State that the instances of a class, as of the last reasoning, are different."""
        return self._change('DISJOINT IND CLASS', class_name)

    @operation
    def disj_classes(self, class_names: Iterable[str]) -> Steps[bool]:
        """State that no two classes share an instance."""
        return self._change('DISJOINT CLASS', *class_names)

    @operation
    def disj_subclasses(self, class_name: str) -> Steps[bool]:
        """State that no two subclasses of a class share an instance."""
        return self._change('DISJOINT CLASS CLASS', class_name)

    @operation
    def make_equivalent(self, class_name: str) -> Steps[bool]:
        """Turn what a class is a subclass of into its definition."""
        return self._change('MAKE EQUIVALENT CLASS', class_name)

    @operation
    def add_min_cardinality(
        self, class_name: str, objectprop_name: str, cardinality: int, value_class_name: str
    ) -> Steps[bool]:
        """State that instances of a class have so many values of a property at least."""
        args = (class_name, objectprop_name, str(cardinality), value_class_name)
        return self._change('ADD CARDINALITY MIN', *args)

    @operation
    def add_objectprop_to_ind(
        self, objectprop_name: str, ind_name: str, value_obj_name: str
    ) -> Steps[bool]:
        """Relate an individual to another."""
        return self._change('ADD OBJECTPROP IND', objectprop_name, ind_name, value_obj_name)

    @operation
    def add_dataprop_to_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, value: str
    ) -> Steps[bool]:
        """Add a value to a data property of an individual; ``value_type`` as LONG, STRING, ..."""
        return self._change('ADD DATAPROP IND', dataprop_name, ind_name, value_type, value)

    @operation
    def add_batch_dataprop_to_ind(
        self, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> Steps[bool]:
        """Add values, each ``[property, type, value]``, in one batch."""
        return self._change_all(self._dataprops('ADD', ind_name, properties))

    @operation
    def replace_objectprop_b2_ind(
        self, objectprop_name: str, ind_name: str, new_value: str, old_value: str
    ) -> Steps[bool]:
        """Relate an individual to a new one instead of an old one."""
        args = (objectprop_name, ind_name, new_value, old_value)
        return self._change('REPLACE OBJECTPROP IND', *args)

    @operation
    def replace_dataprop_b2_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, new_value: str, old_value: str
    ) -> Steps[bool]:
        """Put a new value in the place of an old one; both bare or as queries return them."""
        args = (dataprop_name, ind_name, value_type, new_value, old_value)
        return self._change('REPLACE DATAPROP IND', *args)

    @operation
    def replace_one_dataprop_b2_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, new_value: str
    ) -> Steps[bool]:
        """Put a value in the place of the only one there is, or add it when there is none.

        Raises:
            ArmorServiceInternalError: 206, there are several values.
        """
        return self._replace_one('DATAPROP IND', dataprop_name, ind_name, value_type, new_value)

    @operation
    def replace_one_objectprop_b2_ind(
        self, objectprop_name: str, ind_name: str, new_value: str
    ) -> Steps[bool]:
        """Relate to a new individual instead of the only one there is, or add it without any.

        Raises:
            ArmorServiceInternalError: 206, there are several.
        """
        return self._replace_one('OBJECTPROP IND', objectprop_name, ind_name, new_value)

    def _replace_one(self, words: str, prop: str, ind: str, *new: str) -> Steps[bool]:
        old = (yield from self._carry_out(f'QUERY {words}', prop, ind)).queried_objects
        if len(old) > 1:
            raise ArmorServiceInternalError(
                f'{prop} of {ind} has {len(old)} values, expected one: {", ".join(old)}',
                ExitCode.SEVERAL_VALUES,
            )
        command = 'REPLACE' if old else 'ADD'
        return (yield from self._change(f'{command} {words}', prop, ind, *new, *old))

    @operation
    def remove_ind(self, ind_name: str) -> Steps[bool]:
        """Remove an individual with all that is asserted of it."""
        return self._change('REMOVE IND', ind_name)

    @operation
    def remove_ind_from_class(self, ind_name: str, class_name: str) -> Steps[bool]:
        """Retract that an individual is of a class."""
        return self._change('REMOVE IND CLASS', ind_name, class_name)

    @operation
    def remove_class(self, class_name: str, super_class_name: str = '') -> Steps[bool]:
        """Remove a class, or only that it is below another."""
        if super_class_name:
            return self._change('REMOVE CLASS CLASS', class_name, super_class_name)
        return self._change('REMOVE CLASS', class_name)

    @operation
    def remove_dataprop_from_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, value: str
    ) -> Steps[bool]:
        """Retract a value of a data property."""
        return self._change('REMOVE DATAPROP IND', dataprop_name, ind_name, value_type, value)

    @operation
    def remove_batch_dataprop_to_ind(
        self, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> Steps[bool]:
        """Retract values, each ``[property, type, value]``, in one batch."""
        return self._change_all(self._dataprops('REMOVE', ind_name, properties))

    @operation
    def remove_objectprop_from_ind(
        self, objectprop_name: str, ind_name: str, value_obj_name: str
    ) -> Steps[bool]:
        """Retract a relation."""
        return self._change('REMOVE OBJECTPROP IND', objectprop_name, ind_name, value_obj_name)

    @operation
    def rename_ind(self, old_name: str, new_name: str) -> Steps[bool]:
        """Give an individual another name."""
        return self._change('RENAME IND', old_name, new_name)

    @operation
    def rename_class(self, old_name: str, new_name: str) -> Steps[bool]:
        """Give a class another name."""
        return self._change('RENAME CLASS', old_name, new_name)

    @operation
    def rename_dataprop(self, old_name: str, new_name: str) -> Steps[bool]:
        """Give a data property another name."""
        return self._change('RENAME DATAPROP', old_name, new_name)

    @operation
    def rename_objectprop(self, old_name: str, new_name: str) -> Steps[bool]:
        """Give an object property another name."""
        return self._change('RENAME OBJECTPROP', old_name, new_name)

    @operation
    def add_axiom(self, axiom: str) -> Steps[bool]:
        """Assert frames in Manchester syntax, ``Class: A SubClassOf: B``."""
        return self._change('ADD AXIOM', axiom)

    @operation
    def remove_axiom(self, axiom: str) -> Steps[bool]:
        """Retract frames in Manchester syntax."""
        return self._change('REMOVE AXIOM', axiom)

    @operation
    def add_rule(self, rule: str) -> Steps[bool]:
        """Assert a rule, ``ROOM(?r), hasDoor(?r, ?d) -> Open(?r)``."""
        return self._change('ADD RULE', rule)

    @operation
    def remove_rule(self, rule: str) -> Steps[bool]:
        """Retract a rule."""
        return self._change('REMOVE RULE', rule)

    @operation
    def close_objectprop(self, objectprop_name: str, ind_name: str = '') -> Steps[bool]:
        """State that an individual, or each, is related to nothing but what is known."""
        if ind_name:
            return self._change('CLOSE OBJECTPROP IND', objectprop_name, ind_name)
        return self._change('CLOSE OBJECTPROP', objectprop_name)

    @operation
    def close_class(self, class_name: str, ind_name: str = '') -> Steps[bool]:
        """State that an individual, or each that is not known to be of a class, is not."""
        if ind_name:
            return self._change('CLOSE CLASS IND', class_name, ind_name)
        return self._change('CLOSE CLASS', class_name)

    def _dataprops(
        self, command: str, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> list[DirectiveRequest]:
        return [
            self.request(f'{command} DATAPROP IND', prop, ind_name, value_type, value)
            for prop, value_type, value in properties
        ]


class Query(ClientPart):
    """Directives that ask. All raise `ArmorServiceCallError` and `ArmorServiceInternalError`."""

    def _objects(self, words: str, *args: str) -> Steps[list[str]]:
        return (yield from self._carry_out(words, *args)).queried_objects

    def _names(self, with_uri: bool, words: str, *args: str) -> Steps[list[str]]:
        objects = yield from self._objects(words, *args)
        return objects if with_uri else [name_in(rendered) for rendered in objects]

    @operation
    def ind_b2_class(self, class_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Yield individuals of a class: names, or ``<iri#name>`` when asked for."""
        return self._names(with_URI, 'QUERY IND CLASS', class_name)

    @operation
    def objectprop_b2_ind(
        self,
        objectprop_name: str,
        ind_name: str,
        with_URI: bool = False,  # noqa: N803
    ) -> Steps[list[str]]:
        """Yield individuals that an individual is related to: names, or ``<iri#name>``."""
        return self._names(with_URI, 'QUERY OBJECTPROP IND', objectprop_name, ind_name)

    @operation
    def dataprop_b2_ind(self, dataprop_name: str, ind_name: str) -> Steps[list[str]]:
        """Yield values of a data property, as ``"1665579740"^^xsd:long``; see `value_in`."""
        return self._objects('QUERY DATAPROP IND', dataprop_name, ind_name)

    @operation
    def check_ind_exists(self, ind_name: str) -> Steps[bool]:
        """Tell whether an individual is of any class."""
        response: DirectiveResponse = yield self.request('QUERY IND', ind_name)
        if not response.success and response.exit_code != ExitCode.OK:
            checked(response)
        return response.success and bool(response.queried_objects)

    @operation
    def class_of_ind(self, ind_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Yield all classes of an individual: names, or ``<iri#name>``."""
        return self._names(with_URI, 'QUERY CLASS IND', ind_name, 'false')

    @operation
    def bottom_class_of_ind(self, ind_name: str) -> Steps[str | None]:
        """Name of a class of an individual that has no subclass; None when there is none."""
        names = yield from self._objects('QUERY CLASS IND', ind_name, 'true')
        return names[0] if names else None

    @operation
    def subclasses(self, class_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Classes below a class: names, or ``<iri#name>``; without owl:Nothing."""
        objects = yield from self._objects('QUERY CLASS CLASS', class_name)
        below = [rendered for rendered in objects if rendered.startswith('<')]
        return below if with_URI else [name_in(rendered) for rendered in below]

    @operation
    def restrictions(self, class_name: str) -> Steps[list[str]]:
        """Definitions of a class as text."""
        return self._objects('QUERY CLASS RESTRICTIONS', class_name)

    @operation
    def dataprops_of_ind(self, ind_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Yield data properties that have a value for an individual."""
        return self._names(with_URI, 'QUERY IND DATAPROP', ind_name)

    @operation
    def objectprops_of_ind(self, ind_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Yield object properties that have a value for an individual."""
        return self._names(with_URI, 'QUERY IND OBJECTPROP', ind_name)

    @operation
    def sparql(self, query: str, timeout_ms: int = 0) -> Steps[list[dict[str, str]]]:
        """Run a SPARQL SELECT over asserted and derived facts.

        Args:
            query: The query with its prefixes.
            timeout_ms: Longest time in milliseconds; 0 leaves it to the server.

        Returns:
            One dictionary of variable and value for each row, without the unbound variables.
        """
        objects = yield from self._objects('QUERY SPARQL ROWS', query, str(timeout_ms))
        return [json.loads(row) for row in objects]

    @operation
    def facts(self, pattern: str) -> Steps[list[ShortFact]]:
        """Yield asserted and derived facts that match a pattern such as ``canReach(Robot1, ?)``."""
        parse_fact(pattern)
        objects = yield from self._objects('QUERY FACT', pattern)
        return [parse_fact(text) for text in objects]

    @operation
    def facts_by_origin(self, pattern: str) -> Steps[tuple[list[ShortFact], list[ShortFact]]]:
        """Yield facts that match a pattern: all of them, and those of them that are asserted."""
        parse_fact(pattern)
        rows = [
            self.request('QUERY FACT', pattern),
            self.request('QUERY FACT', pattern, 'true'),
        ]
        answer: ListResponse = yield rows
        every, asserted = (
            [parse_fact(text) for text in checked(response).queried_objects]
            for response in answer.responses
        )
        return every, asserted

    @operation
    def explain(self, fact: str) -> Steps[tuple[str, str] | None]:
        """Yield why a fact such as ``URGENT(R3)`` holds: a sentence and a tree; None when it does
        not.
        """
        parse_fact(fact)
        response: DirectiveResponse = yield self.request('QUERY EXPLAIN', fact)
        if not response.success and response.exit_code == ExitCode.OK:
            return None
        sentence, tree = checked(response).queried_objects
        return sentence, tree

    @operation
    def explain_absence(self, fact: str) -> Steps[list[str]]:
        """Yield what a fact such as ``URGENT(R3)`` lacks: a sentence, then each missing condition;
        nothing where it holds.
        """
        parse_fact(fact)
        return self._objects('QUERY EXPLAIN ABSENCE', fact)

    @operation
    def ind_b2_expression(self, expression: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Yield individuals of a class expression in Manchester syntax."""
        return self._names(with_URI, 'QUERY IND EXPRESSION', expression)

    @operation
    def axioms(self, name: str) -> Steps[list[str]]:
        """Yield what is asserted of an entity, in Manchester syntax."""
        return self._objects('QUERY AXIOMS', name)

    @operation
    def rules(self) -> Steps[list[str]]:
        """Yield the rules, in Manchester syntax."""
        return self._objects('QUERY RULES')

    @operation
    def taken_back(self) -> Steps[list[str]]:
        """Yield the changes that were taken back for want of time: what, whose, when and why."""
        return self._objects('QUERY TAKEN BACK')

    @operation
    def explain_inconsistency(self) -> Steps[tuple[str, str] | None]:
        """Yield why the ontology contradicts itself; None when it does not."""
        objects = yield from self._objects('QUERY EXPLAIN INCONSISTENCY')
        return (objects[0], objects[1]) if objects else None


class Utils(ClientPart):
    """Directives about references, files and logging."""

    @operation
    def apply_buffered_changes(self) -> Steps[bool]:
        """Apply buffered manipulations; whether the ontology was consistent at the last REASON."""
        return (yield from self._carry_out('APPLY')).is_consistent

    @operation
    def sync_buffered_reasoner(self) -> Steps[bool]:
        """Apply buffered manipulations and reason; whether the ontology is consistent."""
        return (yield from self._carry_out('REASON')).is_consistent

    @operation
    def reason_within(self, seconds: float) -> Steps[bool]:
        """Reason as `sync_buffered_reasoner` does, for so many seconds of processor time."""
        return (yield from self._carry_out('REASON', repr(float(seconds)))).is_consistent

    @operation
    def cancel(self) -> Steps[None]:
        """End the reasoning that runs."""
        yield from self._carry_out('CANCEL')

    @operation
    def save_ref_with_inferences(self, filepath: str) -> Steps[None]:
        """Save with the derived facts."""
        yield from self._carry_out('SAVE INFERENCE', filepath)

    @operation
    def save(self, filepath: str, inference: bool = False) -> Steps[None]:
        """Save, with the derived facts if asked for; an empty path is the file that was loaded."""
        yield from self._carry_out('SAVE INFERENCE' if inference else 'SAVE', filepath)

    @operation
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
        yield from self._carry_out(words, owl_file_path, iri, *flags)

    @operation
    def drop_ref(self) -> Steps[None]:
        """Forget the reference."""
        yield from self._carry_out('DROP')

    @operation
    def mount_on_ref(self) -> Steps[None]:
        """Let only this client change the ontology."""
        yield from self._carry_out('MOUNT')

    @operation
    def unmount_from_ref(self) -> Steps[None]:
        """End `mount_on_ref`."""
        yield from self._carry_out('UNMOUNT')

    @operation
    def get_all_refs(self) -> Steps[list[str]]:
        """Yield names of all references."""
        return (yield from self._carry_out('GET ALL REFS')).queried_objects

    @operation
    def get_ref_client(self, reference_name: str = '') -> Steps[str | None]:
        """Yield the client mounted on a reference (the own one if none is named); None when nobody
        is.
        """
        name = reference_name or self.client.reference_name
        (mounted,) = (yield from self._carry_out('GET REF CLIENT', name)).queried_objects
        return None if mounted == 'none' else mounted

    @operation
    def set_log_to_terminal(self, switch: bool) -> Steps[None]:
        """Switch the server's log on its console."""
        yield from self._carry_out(f'LOG SCREEN {"ON" if switch else "OFF"}')

    @operation
    def set_log_to_file(self, switch: bool, filepath: str = '') -> Steps[None]:
        """Switch the server's log to a file."""
        if switch:
            if not filepath:
                raise ArmorServiceCallError('set_log_to_file: expected the path of a file')
            yield from self._carry_out('LOG FILE ON', filepath)
        else:
            yield from self._carry_out('LOG FILE OFF')


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

    @operation
    def call(
        self, command: str, first_spec: str, second_spec: str, args_list: Sequence[str]
    ) -> Steps[DirectiveResponse]:
        """Carry out any directive; the response also when it is no success."""
        response: DirectiveResponse = yield DirectiveRequest(
            self.client_id, self.reference_name, command, first_spec, second_spec, args_list
        )
        return response

    @operation
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
