"""The fields of a record as parameters: a table of descriptions and bounds beside its defaults.

FIELDS = {
    'speed': Described('Top speed, m/s.', 0.01, 20.0),
    'turn': Described('Top turning speed, rad/s.', 0.01, 20.0),
}
drive = declare_fields(node, DriveParameters(), FIELDS, prefix='drive.')
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Check, ParameterError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Record = TypeVar('Record', bound=DataclassInstance)


@dataclass(frozen=True)
class Described:
    """How a field is declared; its default and type are those of the record.

    Attributes:
        text: One sentence with the unit.
        minimum: Least value of a number (or of a list's numbers).
        maximum: Greatest value, likewise.
        choices: The only values allowed.
        of: Element type of a list whose default is empty.
        check: Looks at the value last; returns what was expected, or None when it is good.
        name: The parameter's name where it is not the field's behind the prefix.
    """

    text: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Any, ...] = ()
    of: type | None = None
    check: Check | None = None
    name: str = ''


def declare_fields(
    node: PatrolNode,
    record: Record,
    described: Mapping[str, Described],
    *,
    prefix: str = '',
    on_change: Callable[[str, Any], None] | None = None,
) -> Record:
    """Declare fields of a record as parameters.

    Args:
        node: The node.
        record: The defaults; a tuple among them is declared as a list.
        described: The fields that are parameters; the others stay as they are.
        prefix: Stands before the fields' names, with its dot.
        on_change: Called with a field's name and its new value after each change at run time;
            without it the parameters are read-only.

    Returns:
        The record with the parameters' values.

    Raises:
        ParameterError: A value given at the start is not allowed, alone or beside the others: then
            the record raised a ValueError that begins with the field's name.
    """
    values: dict[str, Any] = {}
    for field, how in described.items():
        default = getattr(record, field)
        kind = tuple if isinstance(default, tuple) else None
        value = node.parameter(
            how.name or prefix + field,
            list(default) if kind else default,
            how.text,
            minimum=how.minimum,
            maximum=how.maximum,
            choices=how.choices,
            of=how.of,
            check=how.check,
            read_only=on_change is None,
            on_change=None if on_change is None else partial(_tell, on_change, field, kind),
        )
        values[field] = kind(value) if kind else value
    try:
        return replace(record, **values)
    except ValueError as error:
        raise ParameterError(f'parameter {prefix}{error}') from None


def _tell(
    told: Callable[[str, Any], None], field: str, kind: Callable[[Any], Any] | None, value: Any
) -> None:
    told(field, kind(value) if kind else value)
