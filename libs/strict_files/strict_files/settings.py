"""Settings of this library: fields of frozen records that say what they mean and what they take.

A field's metadata has the key ``parameter``: a mapping with the default, the description, and
where there are some ``minimum``, ``maximum``, ``choices``, ``of`` (the type of a list's elements),
``check`` (returns what was expected, or None) and ``name``. Whoever reads settings from a file or a
command line finds there what to accept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any, TypeVar

T = TypeVar('T')


def parameter(
    default: T,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    **more: Any,
) -> T:
    """Return the field of a record with its default, description and bounds in its metadata."""
    spec = {'description': description, 'minimum': minimum, 'maximum': maximum, **more}
    declared: T = field(default=default, metadata={'parameter': {'default': default, **spec}})
    return declared


def converted(make: Callable[[Any], T], default: Any, description: str, **more: Any) -> T:
    """Return as `parameter` a field whose value ``make`` makes from what a person writes."""
    spec = {'default': default, 'description': description, **more}
    declared: T = field(
        default_factory=lambda: make(default), metadata={'parameter': spec, 'make': make}
    )
    return declared


def parameters(record: Callable[[], T], prefix: str = '') -> T:
    """Return the field of a record that is a record of settings itself."""
    declared: T = field(default_factory=record, metadata={'parameters': prefix})
    return declared


def names_expected(values: Sequence[str]) -> str | None:
    """Ask for one name at least, and for none that is empty."""
    return None if values and all(values) else 'at least one name'
