"""Userdata: the dictionary a container's states share, and the view each state has of it.

A `Remapper` shows a state the keys it declared, under the state's own names. Its class is made
once per combination of keys, with one property per key, so that ``userdata.count += 1`` costs two
dictionary accesses and no name checks: what a state may read and write is settled when the class
is made, not on every access.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any, ClassVar

from state_machines.exceptions import InvalidUserCodeError, MissingKeyError
from state_machines.log import logerr


def raw(userdata: UserData) -> dict[str, Any]:
    """Return the dictionary behind userdata, for the engine's own copying."""
    return userdata._data


class UserData:
    """Userdata of one scope: attributes and items are the same thing."""

    __slots__ = ('_data',)

    _data: dict[str, Any]

    def __init__(self) -> None:
        object.__setattr__(self, '_data', {})

    def update(self, other_userdata: UserData) -> None:
        """Take over every key of `other_userdata`, overwriting equal names."""
        self._data.update(other_userdata._data)

    def extract(self, keys: Iterable[str], remapping: Mapping[str, str]) -> UserData:
        """Copy `keys` into new userdata, named by the inverse of `remapping` (inner -> outer)."""
        inner = {outer: name for name, outer in remapping.items()}
        if len(inner) != len(remapping):
            logerr(f'Userdata remapping is not one-to-one: {dict(remapping)}')
        extracted = UserData()
        for key in keys:
            extracted[inner.get(key, key)] = copy.copy(self[key])
        return extracted

    def merge(self, ud: UserData, keys: Iterable[str], remapping: Mapping[str, str]) -> None:
        """Copy `keys` of `ud` into this scope, renamed by `remapping` (inner -> outer)."""
        for key in keys:
            self[remapping.get(key, key)] = copy.copy(ud[key])

    def keys(self) -> list[str]:
        """Return the keys that have a value."""
        return list(self._data)

    def __contains__(self, key: object) -> bool:
        return key in self._data

    def __getitem__(self, key: str) -> Any:
        try:
            return self._data[key]
        except KeyError:
            raise MissingKeyError(
                f"Userdata key '{key}' is not set; the keys set are {sorted(self._data)}"
            ) from None

    def __setitem__(self, key: str, item: Any) -> None:
        self._data[key] = item

    def __getattr__(self, name: str) -> Any:
        if name.startswith('_'):
            raise AttributeError(name)
        return self[name]

    def __setattr__(self, name: str, value: Any) -> None:
        if name.startswith('_'):
            object.__setattr__(self, name, value)
        else:
            self._data[name] = value

    def __repr__(self) -> str:
        return f'UserData({self._data!r})'


class Remapper:
    """A state's view of userdata: only declared keys, under the state's own names.

    Reading a key that is not an input, and writing one that is not an output, raise
    `InvalidUserCodeError`; reading a declared key nobody wrote raises `MissingKeyError`. SMACH
    drops such a write with a line in the log and wraps objects of input-only keys in a ``Const``
    on which no method can be called; here the object itself is read.

    Args:
        ud: A `UserData`, a `Remapper`, or any object with items.
        input_keys: The state's names of the keys it reads.
        output_keys: The state's names of the keys it writes.
        remapping: From the state's names to those in `ud`.
        constants: Values of input keys that come from no userdata.
        where: The state's path, for error messages.
    """

    __slots__ = ('_constants', '_data', '_ud', '_where')

    _constants: Mapping[str, Any]
    _data: Any
    _ud: Any
    _where: str
    # Of the class that is made for a combination of keys: from the state's names to those outside.
    _input: ClassVar[Mapping[str, str]] = {}
    _output: ClassVar[Mapping[str, str]] = {}

    def __new__(
        cls,
        ud: Any,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        remapping: Mapping[str, str] | Iterable[Any] = (),
        constants: Mapping[str, Any] | None = None,
        where: str = '',
    ) -> Remapper:
        fixed = constants or _NO_CONSTANTS
        view_class = _view_class(
            frozenset(input_keys),
            frozenset(output_keys),
            # SMACH's own states pass an empty list for "no remapping".
            frozenset(dict(remapping).items()),
            frozenset(fixed),
        )
        return _made(view_class, ud, fixed, where)

    def update(self, other_userdata: UserData) -> None:
        """Take over every key of `other_userdata` into the scope behind the view."""
        self._ud.update(other_userdata)

    def keys(self) -> list[str]:
        """Return the state's names of its input keys that have a value."""
        return [key for key in self._input if key in self]

    def fsm_copy_to(self, target: dict[str, Any], keys: Iterable[str]) -> list[str]:
        """Copy the values of input keys into `target`; the keys that have none.

        Raises:
            InvalidUserCodeError: A key is not among the input keys.
        """
        data, outer, missing = self._data, self._input, []
        for key in keys:
            try:
                target[key] = data[outer[key]]
            except KeyError:
                if key in self:
                    target[key] = self[key]
                else:
                    missing.append(key)
        return missing

    def fsm_take_from(self, source: Mapping[str, Any], keys: Iterable[str]) -> list[str]:
        """Write the values that `source` has for output keys; the keys that it has none for.

        Raises:
            InvalidUserCodeError: A key is not among the output keys.
        """
        data, outer, constants, missing = self._data, self._output, self._constants, []
        for key in keys:
            if key not in source:
                missing.append(key)
            elif key in outer and key not in constants:
                data[outer[key]] = source[key]
            else:
                raise self._undeclared('write', key)
        return missing

    def fsm_names(self) -> tuple[tuple[tuple[str, str], ...], tuple[tuple[str, str], ...], bool]:
        """Return inputs and outputs as (the state's name, the name outside).

        Also whether copying by these names is all: there are no constants, and a dictionary is
        behind the view.
        """
        plain = not self._constants and type(self._data) is dict
        return tuple(self._input.items()), tuple(self._output.items()), plain

    def __contains__(self, key: object) -> bool:
        if key in self._constants:
            return key in self._input
        outer = self._input.get(key)  # type: ignore[call-overload]
        return outer is not None and outer in self._data

    def __getitem__(self, key: str) -> Any:
        if key not in self._input:
            raise self._undeclared('read', key)
        if key in self._constants:
            return self._constants[key]
        try:
            return self._data[self._input[key]]
        except KeyError:
            raise self._missing(key) from None

    def __setitem__(self, key: str, item: Any) -> None:
        if key not in self._output or key in self._constants:
            raise self._undeclared('write', key)
        self._data[self._output[key]] = item

    def __getattr__(self, name: str) -> Any:
        # Only names without a property come here: undeclared ones.
        if name.startswith('_'):
            raise AttributeError(name)
        raise self._undeclared('read', name)

    def fsm_revoke(self) -> Remapper:
        """Cut the view off its userdata, for a state that was left behind; return another one."""
        view = _made(type(self), self._ud, self._constants, self._where)
        self._data = self._ud = _Revoked(self._where)
        return view

    def fsm_explain(self, error: BaseException) -> InvalidUserCodeError | None:
        """Tell which undeclared key an ``AttributeError`` out of a state was about.

        A view has no ``__setattr__`` of its own, which would cost every write a function call; the
        interpreter itself refuses unknown names, and this puts its refusal in the engine's words.
        """
        if not isinstance(error, AttributeError):
            return None
        match = _UNKNOWN_ATTRIBUTE.search(str(error))
        return self._undeclared('write', match.group(1)) if match else None

    def _undeclared(self, deed: str, key: str) -> InvalidUserCodeError:
        kind, declared = ('input', self._input) if deed == 'read' else ('output', self._output)
        why = f'not among its {kind} keys {sorted(declared)}'
        if key in self._constants:
            why = 'a constant'
        return InvalidUserCodeError(f"{self._state()} cannot {deed} userdata key '{key}': {why}")

    def _missing(self, key: str) -> MissingKeyError:
        outer = self._input.get(key, key)
        renamed = f" (remapped to '{outer}')" if outer != key else ''
        available = sorted(self._data.keys()) if hasattr(self._data, 'keys') else []
        return MissingKeyError(
            f"{self._state()} reads userdata key '{key}'{renamed}, which nothing has written; the "
            f'keys set are {available}'
        )

    def _state(self) -> str:
        return f"State '{self._where}'" if self._where else 'A state'


_NO_CONSTANTS: Mapping[str, Any] = {}


def _made(
    view_class: type[Remapper], ud: Any, constants: Mapping[str, Any], where: str
) -> Remapper:
    view = object.__new__(view_class)
    view._constants = constants
    view._data = ud._data if isinstance(ud, UserData) else ud
    view._ud = ud
    view._where = where
    return view


class _Revoked:
    """What a state that was left behind finds in place of userdata."""

    def __init__(self, where: str) -> None:
        self._where = where

    def _refuse(self, *_: Any) -> Any:
        raise InvalidUserCodeError(
            f"State '{self._where}' uses userdata after the machine went on without it"
        )

    __getitem__ = __setitem__ = __contains__ = keys = update = _refuse


@lru_cache(maxsize=4096)
def _view_class(
    inputs: frozenset[str],
    outputs: frozenset[str],
    remapping: frozenset[tuple[str, str]],
    constants: frozenset[str],
) -> type[Remapper]:
    outer = dict(remapping)
    namespace: dict[str, Any] = {
        '__slots__': (),
        '_input': {key: outer.get(key, key) for key in sorted(inputs)},
        '_output': {key: outer.get(key, key) for key in sorted(outputs)},
    }
    for key in inputs | outputs:
        # Names of methods stay methods, as in SMACH: such keys are reached as items.
        if key.startswith('_') or hasattr(Remapper, key):
            continue
        if key in constants:
            namespace[key] = property(_constant(key), _refused_write(key))
        else:
            name = outer.get(key, key)
            # Without a reader, `Remapper.__getattr__` refuses.
            read = _reader(key, name) if key in inputs else None
            write = _writer(name) if key in outputs else _refused_write(key)
            namespace[key] = property(read, write)
    return type(_VIEW_NAME, (Remapper,), namespace)


def _reader(key: str, name: str) -> Callable[[Remapper], Any]:
    def read(view: Remapper) -> Any:
        try:
            return view._data[name]
        except KeyError:
            raise view._missing(key) from None

    return read


def _writer(name: str) -> Callable[[Remapper, Any], None]:
    def write(view: Remapper, value: Any) -> None:
        view._data[name] = value

    return write


def _constant(key: str) -> Callable[[Remapper], Any]:
    return lambda view: view._constants[key]


def _refused_write(key: str) -> Callable[[Remapper, Any], None]:
    def write(view: Remapper, value: Any) -> None:
        raise view._undeclared('write', key)

    return write


_VIEW_NAME = 'StateUserData'
_UNKNOWN_ATTRIBUTE = re.compile(rf"'{_VIEW_NAME}' object has no attribute '(\w+)'")
