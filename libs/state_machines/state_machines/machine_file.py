"""A machine as data: YAML that names states, outcomes, transitions and remappings.

A file is loaded with the same checks as code, and `to_yaml` writes a machine back. Classes
and functions are named as ``package.module:Name`` and imported, so a machine's file is trusted as
code is; names without a colon are looked up in what the caller offers.

    machine: StateMachine          # or Sequence, Concurrence, Iterator; this is the default
    name: PATROL
    outcomes: [finished, preempted]
    userdata: {rooms: [R1, R2]}
    initial: CHOOSE                # default: the first state
    states:
      CHOOSE:
        state: my_package.states:Choose
        transitions: {chosen: EXPLORE}
      EXPLORE:
        state: my_package.states:Explore
        arguments: {seconds: 10.0} # of the class; $name stands for an object the caller offers
        transitions: {explored: CHOOSE}
        remapping: {place: room}
        timeout: 30.0              # also deadline, retry, retry_on, constants
    interrupts:
      CHARGE: {function: my_package.states:charge, outcomes: [charged], priority: 5}

A `function` is a `CBState`, with ``outcomes``, ``input_keys`` and ``output_keys``. A state that is
a container has ``machine`` and ``states`` of its own. Further keys are ``connector_outcome`` of a
Sequence, ``default_outcome`` and ``outcome_map`` of a Concurrence, and ``items``, ``item_key`` and
``exhausted_outcome`` of an Iterator, whose one state has ``loop_outcomes``, ``break_outcomes`` and
``final_outcome_map``.

Both need PyYAML.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from state_machines.concurrence import Concurrence
from state_machines.container import Container
from state_machines.exceptions import MachineFileError, describe, shown, unknown
from state_machines.files import read_file
from state_machines.nodes import LimitOptions
from state_machines.state import CBState, State
from state_machines.state_machine import Iterator, Sequence, StateMachine
from state_machines.userdata import raw

KINDS: dict[str, type[Container]] = {
    kind.__name__: kind for kind in (StateMachine, Sequence, Concurrence, Iterator)
}

LARGEST = 4_000_000
"""More bytes than this are no machine."""

_LIMITS = set(LimitOptions.__annotations__)
_KEYS = {'input_keys', 'output_keys'}
_CONTAINER = {'machine', 'name', 'outcomes', 'userdata', 'states', 'interrupts', *_KEYS}
_OF_KIND: dict[str, dict[str, tuple[str, str]]] = {
    'StateMachine': {},
    'Sequence': {'connector_outcome': ('connector_outcome', 'connector_outcome')},
    'Concurrence': {
        'default_outcome': ('default_outcome', 'default_outcome'),
        'outcome_map': ('outcome_map', 'outcome_map'),
    },
    'Iterator': {
        'items': ('it', 'items'),
        'item_key': ('it_label', 'items_label'),
        'exhausted_outcome': ('exhausted_outcome', 'exhausted_outcome'),
    },
}
"""Further keys of a container: the argument of its class for each, and the attribute."""
_NEEDED = {'connector_outcome', 'default_outcome', 'items'}
_INTERRUPT = {'priority', 'transitions', 'remapping'}


def load_machine(path: str | Path, offered: Mapping[str, Any] | None = None) -> Container:
    """Build the machine that a YAML file describes.

    Args:
        path: The file.
        offered: Classes, functions and objects by the names that the file uses for them.

    Raises:
        MachineFileError: The file cannot be read, or describes no machine that can run.
    """
    try:
        return machine_from(parse(read_file(path, LARGEST).decode('utf-8')), offered)
    except (OSError, UnicodeDecodeError, MachineFileError) as error:
        raise MachineFileError(f'{path}: {getattr(error, "strerror", describe(error))}') from error


def parse(text: str) -> Any:
    """Return the values of a YAML text; a key that comes twice is an error.

    Raises:
        MachineFileError: It is no YAML.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        """Refuses a key that comes twice, of which YAML would take the last."""

    def mapping(loader: Any, node: Any) -> dict[Any, Any]:
        found: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key = loader.construct_object(key_node, deep=True)
            line = key_node.start_mark.line + 1
            if not isinstance(key, str):
                raise MachineFileError(
                    f'line {line}: the key {shown(key)} is no string; put it in quotes'
                )
            if key in found:
                raise MachineFileError(f"line {line}: the key '{key}' comes twice")
            found[key] = loader.construct_object(value_node, deep=True)
        return found

    Loader.add_constructor('tag:yaml.org,2002:map', mapping)
    try:
        return yaml.load(text, Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = f'line {mark.line + 1}: ' if mark is not None else ''
        raise MachineFileError(f'{line}{getattr(error, "problem", None) or "no YAML"}') from error
    except RecursionError:
        raise MachineFileError('nested too deep') from None


def machine_from(data: Any, offered: Mapping[str, Any] | None = None) -> Container:
    """Build the machine that plain data describes; see `load_machine`.

    Raises:
        MachineFileError: It describes no machine that can run.
    """
    try:
        machine = _Builder(offered or {}).container(data, 'machine')
        _check(machine, 'machine')
    except RecursionError:
        raise MachineFileError('nested too deep') from None
    return machine


def _check(machine: Container, place: str) -> None:
    _guarded(place, machine.check_consistency)
    for label, state in machine.get_children().items():
        if isinstance(state, Container):
            _check(state, f'{place}.states.{label}')


def _guarded(place: str, build: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Call what builds, and name the place in the file when that is wrong."""
    try:
        return build(*args, **kwargs)
    except MachineFileError:
        raise
    except Exception as error:
        raise MachineFileError(f'{place}: {describe(error)}') from error


class _Builder:
    """Builds containers and states from data.

    Args:
        offered: See `load_machine`.
    """

    def __init__(self, offered: Mapping[str, Any]) -> None:
        self._offered = offered

    def container(self, data: Any, place: str, further: Iterable[str] = ()) -> Container:
        """Build a container.

        Args:
            data: What describes it.
            place: Where that stands, for errors.
            further: Keys that say how it stands in its parent.
        """
        entry = _mapping(place, data)
        kind = entry.get('machine', 'StateMachine')
        if kind not in KINDS:
            raise MachineFileError(f'{place}.machine: {unknown(kind, KINDS)}')
        initial = {'initial'} if issubclass(KINDS[kind], StateMachine) else set()
        _known_keys(place, entry, _CONTAINER | {*_OF_KIND[kind], *initial, *further})
        outcomes = _names(f'{place}.outcomes', entry.get('outcomes', []))
        keys = {key: _names(f'{place}.{key}', entry.get(key, [])) for key in sorted(_KEYS)}
        arguments = self._arguments(kind, entry, place)
        machine: Container = _guarded(place, KINDS[kind], outcomes, **keys, **arguments)
        if 'name' in entry:
            _guarded(f'{place}.name', machine.set_name, entry['name'])
        for key, value in _mapping(f'{place}.userdata', entry.get('userdata', {})).items():
            machine.userdata[key] = value
        states = _mapping(f'{place}.states', entry.get('states', {}))
        for label, inside in states.items():
            where = f'{place}.states.{label}'
            state, options = self._state(inside, where, {*machine.fsm_arguments, *_LIMITS})
            # Every kind but the iterator, which has one state only, has `add_state`.
            add = machine.set_state if isinstance(machine, Iterator) else machine.add_state  # type: ignore[attr-defined]
            _guarded(where, add, label, state, **options)
        interrupts = _mapping(f'{place}.interrupts', entry.get('interrupts', {}))
        for label, inside in interrupts.items():
            where = f'{place}.interrupts.{label}'
            state, options = self._state(inside, where, _INTERRUPT)
            _guarded(where, machine.add_interrupt, label, state, **options)
        if 'initial' in entry:
            _guarded(f'{place}.initial', machine.set_initial_state, [entry['initial']])
        return machine

    def _arguments(self, kind: str, entry: Mapping[str, Any], place: str) -> dict[str, Any]:
        """Return the arguments that one kind of container alone takes."""
        arguments = {}
        for key, (argument, _) in _OF_KIND[kind].items():
            if key in _NEEDED:
                _needed(place, entry, key)
            elif key not in entry:
                continue
            value, where = entry[key], f'{place}.{key}'
            if key == 'outcome_map':
                for outcome, wanted in _mapping(where, value).items():
                    _mapping(f'{where}.{outcome}', wanted)
            elif key == 'items':
                value = self._value(value, where)
                if not callable(value) and not isinstance(value, Iterable):
                    raise MachineFileError(f'{where}: expected a list, not {shown(value)}')
            arguments[argument] = value
        return arguments

    def _state(self, data: Any, place: str, further: set[str]) -> tuple[State, dict[str, Any]]:
        """Build a state; it, and what says how it stands in its container."""
        entry = _mapping(place, data)
        options = {
            key: _OPTIONS[key](f'{place}.{key}', entry[key]) for key in further if key in entry
        }
        if 'states' in entry or 'machine' in entry:
            return self.container(entry, place, further), options
        if 'function' in entry:
            declared = {'outcomes', *_KEYS}
            _known_keys(place, entry, {'function', *declared, *further})
            function = self._value(entry['function'], f'{place}.function', import_names=True)
            given = {key: _names(f'{place}.{key}', entry[key]) for key in declared if key in entry}
            if not callable(function):
                raise MachineFileError(f'{place}.function: {entry["function"]} cannot be called')
            return _guarded(place, CBState, function, **given), options
        _known_keys(place, entry, {'state', 'arguments', *further})
        kind = self._value(_needed(place, entry, 'state'), f'{place}.state', import_names=True)
        if not callable(kind):
            raise MachineFileError(f'{place}.state: {entry["state"]} is no class of states')
        arguments = _mapping(f'{place}.arguments', entry.get('arguments', {}))
        values = {key: self._value(v, f'{place}.arguments.{key}') for key, v in arguments.items()}
        state = _guarded(place, kind, **values)
        if not isinstance(state, State):
            raise MachineFileError(f'{place}.state: {entry["state"]} makes no State')
        # What it was made of, for whoever writes the machine back.
        state.fsm_source = {'state': entry['state'], 'arguments': dict(arguments)}
        return state, options

    def _value(self, value: Any, place: str, *, import_names: bool = False) -> Any:
        """Return what a value of the file stands for."""
        if isinstance(value, str) and value.startswith('$'):
            if value[1:] not in self._offered:
                raise MachineFileError(f'{place}: {unknown(value[1:], self._offered)}')
            return self._offered[value[1:]]
        if not import_names:
            return value
        if not isinstance(value, str):
            raise MachineFileError(f'{place}: expected package.module:Name, not {shown(value)}')
        if value in self._offered:
            return self._offered[value]
        module, colon, name = value.partition(':')
        if not colon:
            raise MachineFileError(
                f'{place}: {unknown(value, self._offered)}, or package.module:Name'
            )
        found = _guarded(place, importlib.import_module, module)
        for part in name.split('.'):
            if not hasattr(found, part):
                raise MachineFileError(f"{place}: '{module}' has no {unknown(part, dir(found))}")
            found = getattr(found, part)
        return found


def _mapping(place: str, data: Any) -> Mapping[str, Any]:
    if not isinstance(data, Mapping):
        raise MachineFileError(f'{place}: expected keys with values, not {shown(data)[:80]}')
    for key in data:
        if not isinstance(key, str):
            raise MachineFileError(f'{place}: the key {shown(key)} is no string')
    return data


def _names(place: str, data: Any) -> list[str]:
    if not isinstance(data, list) or not all(isinstance(name, str) for name in data):
        raise MachineFileError(f'{place}: expected a list of strings, not {shown(data)[:80]}')
    return data


def _renaming(place: str, data: Any) -> dict[str, str]:
    renaming = dict(_mapping(place, data))
    for key, value in renaming.items():
        if not isinstance(value, str):
            raise MachineFileError(f'{place}.{key}: expected a name, not {shown(value)[:80]}')
    return renaming


def _number(place: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MachineFileError(f'{place}: expected a number, not {shown(value)[:80]}')
    return value


_OPTIONS: dict[str, Callable[[str, Any], Any]] = {
    'constants': _mapping,
    'transitions': _renaming,
    'remapping': _renaming,
    'final_outcome_map': _renaming,
    'retry_on': _names,
    'loop_outcomes': _names,
    'break_outcomes': _names,
    'timeout': _number,
    'deadline': _number,
    'retry': _number,
    'priority': _number,
}
"""What reads a key that says how a state stands in its container."""


def _needed(place: str, entry: Mapping[str, Any], key: str) -> Any:
    if key not in entry:
        raise MachineFileError(f"{place}: the key '{key}' is missing")
    return entry[key]


def _known_keys(place: str, entry: Mapping[str, Any], known: Iterable[str]) -> None:
    known = set(known)
    for key in entry:
        if key not in known:
            raise MachineFileError(f'{place}: {unknown(key, known)}')


# Writing.


def to_yaml(container: Container) -> str:
    """Write a machine as YAML that `load_machine` reads; needs PyYAML.

    Raises:
        MachineFileError: A part of it has no form as data: a callback, a function without a name, a
            class with arguments that did not come from a file.
    """
    import yaml

    data = to_data(container)
    text: str = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None)
    return text


def to_data(container: Container) -> dict[str, Any]:
    """Describe a machine by plain data, as `machine_from` takes it.

    Raises:
        MachineFileError: See `to_yaml`.
    """
    return {
        'machine': _kind_of(container),
        'name': container.get_name(),
        **_container_data(container, container.get_name()),
    }


def _kind_of(container: Container) -> str:
    kind = type(container).__name__
    if KINDS.get(kind) is not type(container):
        raise MachineFileError(
            f"'{container.get_name()}' is a {kind}: only the engine's own containers have a form "
            'as data'
        )
    return kind


def _container_data(container: Container, path: str) -> dict[str, Any]:
    data = {'outcomes': [], **_declared(container)}
    if raw(container.userdata):
        data['userdata'] = {
            key: _plain(f'userdata key {key!r} of {path!r}', value)
            for key, value in raw(container.userdata).items()
        }
    data |= _kind_data(container, path)
    data['states'] = {
        label: _state_data(container, label, state, f'{path}/{label}')
        for label, state in container.fsm_states.items()
    }
    if container.fsm_branches:
        data['interrupts'] = {
            branch.label: {
                **_what(branch.state, f'{path}/{branch.label}'),
                'priority': branch.priority,
                'transitions': dict(branch.transitions),
                **_remapping(container, branch.label),
            }
            for branch in container.fsm_branches.values()
        }
    return data


def _kind_data(container: Container, path: str) -> dict[str, Any]:
    """Return what one kind of container alone has."""
    data: dict[str, Any] = {}
    for key, (_, attribute) in _OF_KIND[_kind_of(container)].items():
        value = getattr(container, attribute)
        if key == 'items':
            if not isinstance(value, list | tuple | range | str):
                raise MachineFileError(f"'{path}' has items that are no list")
            value = list(value)
        if value or key != 'outcome_map':
            data[key] = _plain(f'a value in {key} of {path!r}', value)
    if isinstance(container, Concurrence):
        if container.outcome_cb is not None or container.child_termination_cb is not None:
            raise MachineFileError(f"'{path}' has callbacks, which have no form as data")
    elif isinstance(container, StateMachine) and container.fsm_states:
        data['initial'] = container.get_initial_states()[0]
    return data


def _state_data(container: Container, label: str, state: State, path: str) -> dict[str, Any]:
    data = _what(state, path)
    if isinstance(container, StateMachine):
        bound = {
            outcome: target
            for outcome, source, target in container.get_internal_edges()
            if source == label and target
        }
        if bound:
            data['transitions'] = bound
    elif isinstance(container, Iterator):
        data['loop_outcomes'] = sorted(container.loop_outcomes)
        if container.final_outcome_map:
            data['final_outcome_map'] = dict(container.final_outcome_map)
    data |= _remapping(container, label)
    if container.fsm_constants.get(label):
        data['constants'] = {
            key: _plain(f'constant {key!r} of {path!r}', value)
            for key, value in container.fsm_constants[label].items()
        }
    limits = container.fsm_limits.get(label)
    if limits is not None:
        for name in ('timeout', 'deadline', 'retry'):
            if getattr(limits, name):
                data[name] = getattr(limits, name)
        if limits.retry:
            data['retry_on'] = sorted(limits.failures - {limits.late_outcome}) or ['aborted']
    return data


def _remapping(container: Container, label: str) -> dict[str, Any]:
    remapping = container.fsm_remappings.get(label)
    return {'remapping': dict(remapping)} if remapping else {}


def _what(state: State, path: str) -> dict[str, Any]:
    """Return what a state is, as data."""
    if isinstance(state, Container):
        return {'machine': _kind_of(state), **_container_data(state, path)}
    if state.fsm_source is not None:
        source = {'state': state.fsm_source['state']}
        if state.fsm_source['arguments']:
            source['arguments'] = dict(state.fsm_source['arguments'])
        return source
    if type(state) is CBState:
        return {'function': _name_of(state.function, path), **_declared(state)}
    return {'state': _name_of(type(state), path)}


def _declared(state: State) -> dict[str, Any]:
    """Return outcomes and keys of a state, as far as it has any."""
    declared = {
        'outcomes': state.get_registered_outcomes(),
        'input_keys': state.get_registered_input_keys(),
        'output_keys': state.get_registered_output_keys(),
    }
    return {name: sorted(names) for name, names in declared.items() if names}


def _name_of(thing: Any, path: str) -> str:
    name = f'{thing.__module__}:{thing.__qualname__}'
    if '<' in name or thing.__module__ == '__main__':
        raise MachineFileError(f"'{path}': {name} cannot be imported by that name")
    return name


def _plain(what: str, value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_plain(what, item) for item in value]
    if isinstance(value, dict):
        return {str(key): _plain(what, item) for key, item in value.items()}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise MachineFileError(f'{what} is a {type(value).__name__}, which has no form as data')
