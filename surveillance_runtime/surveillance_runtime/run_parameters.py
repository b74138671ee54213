"""The parameters of one run of the robot: where they come from, and which source wins.

Weakest first: `parameters.yaml`, what `--watch` asks for, the robot's profile, the place's file,
what the behaviour needs, what the run itself chooses, the user's files, the options. `launch.py`
and the launch file for an installed ROS use this alike, so that a robot gets the same from both.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from floor_plans import Place
from surveillance_runtime.command_line import page_address
from surveillance_runtime.configuration import (
    Configuration,
    Entry,
    Layer,
    file_layer,
    resolved_text,
)
from surveillance_runtime.node_table import ALARM, NODES, Node
from surveillance_runtime.profile import ProfileFile, profile_layer
from surveillance_runtime.run_files import EVIDENCE, PLACE
from surveillance_runtime.run_options import MUJOCO

BEHAVIOUR_NODE = 'robot_behavior'
PAGE = 'mission_page'
OBSERVER = 'observer'
PAGE_LINKS = 'page_links.json'
"""Beside the runs: a link that somebody was given holds for the next run, too."""
WATCHED_STAY = 30.0
"""With `--watch` the robot stays so long in each place unless somebody says otherwise, seconds: the
usual stay is too short to look at anything."""
PLACES = {'surveillance': 'seven_rooms.yaml', 'patrol': 'patrol_world.yaml'}


def place_file(config: Path, behaviour: str, place: Path | None = None) -> Path:
    """Return the file of the place: the one that is asked for, else the behaviour's own."""
    return (place or config / PLACES[behaviour]).resolve()


def place_name(file: Path, place: Place | None) -> str:
    """Return a name for a place, by which what is kept of it is told from another one's.

    Two places differ in the name of their file, or in their rooms and doors: what an ontology has
    of a place. A room that is moved is the same room.

    Args:
        file: The file of the place.
        place: What it describes; None: nothing but parameters.
    """
    stem = re.sub(r'\W', '_', file.stem)
    if place is None:
        return stem
    doors = sorted((room, sorted(doors)) for room, doors in place.rooms.items())
    return f'{stem}_{hashlib.sha256(json.dumps(doors).encode()).hexdigest()[:8]}'


def run_layers(
    config: Path,
    behaviour: str,
    *,
    watched: bool,
    place: Path | None = None,
    robot: ProfileFile | None = None,
    chosen: Iterable[Entry] = (),
    files: Iterable[Path] = (),
    options: Iterable[Entry] = (),
) -> tuple[Layer, ...]:
    """Return the sources of a run's parameters, the weakest first.

    Args:
        config: The folder with `parameters.yaml` and the places.
        behaviour: One of `node_table.BEHAVIOURS`.
        watched: Whether the robot looks at the rooms.
        place: The file of the place, None for the behaviour's own.
        robot: The robot's profile; None: the nodes' defaults, which are the built-in robot.
        chosen: What the run chooses where the user says nothing, as the folders that it writes to.
        files: The user's parameter files; a later one wins.
        options: What options say as parameters.

    Raises:
        FileError, ParameterError: A file cannot be used.
    """
    layers = [file_layer(config / 'parameters.yaml')]
    if watched:
        stay = for_node(BEHAVIOUR_NODE, 'exploration_seconds', WATCHED_STAY, '--watch')
        layers.append(Layer('--watch', (stay,)))
    if robot is not None:
        layers.append(profile_layer(robot))
    layers.append(file_layer(place_file(config, behaviour, place)))
    asked = []
    if behaviour == 'patrol':
        # The place's file is for the simulator: the robot learns its map from the markers.
        origin = '--behaviour patrol'
        entries = [Entry('/**', 'map_source', 'markers', origin)]
        if (markers := config / 'markers.yaml').is_file():
            entries.append(for_node(OBSERVER, 'markers_file', str(markers.resolve()), origin))
        layers.append(Layer(origin, tuple(entries)))
        asked.append(for_node(BEHAVIOUR_NODE, 'behaviour', behaviour, origin))
    layers.append(Layer('this run', tuple(chosen)))
    layers += [file_layer(path.absolute()) for path in files]
    layers.append(Layer('options', (*asked, *options)))
    return tuple(layers)


def mode_entries(mode: str, *, prompts: bool) -> Iterator[Entry]:
    """Yield what a mode means to the nodes that have one.

    Args:
        mode: One of `node_table.MODES`.
        prompts: Whether each of them may ask at a prompt of its own.
    """
    for node in NODES:
        if node.has_modes:
            yield for_node(node.name, 'execution_mode', mode, f'--mode {mode}')
            yield for_node(node.name, 'console', prompts, f'--mode {mode}')


def simulator_entries(simulator: str) -> Iterator[Entry]:
    """Yield what the simulator is told where the run asks for another one than the usual."""
    if simulator == MUJOCO:
        yield for_node('simulator', 'engine', MUJOCO, f'--simulator {MUJOCO}')


def record_entries(record: Path) -> Iterator[Entry]:
    """Yield where the nodes that write the mission's record find it."""
    for node in (BEHAVIOUR_NODE, 'reasoner', 'initial_state', OBSERVER):
        yield for_node(node, 'record', str(record), 'this run')


def alarm_entries(folder: Path, *, command: str, notify: Path | None) -> Iterator[Entry]:
    """Yield what the node is told that calls people.

    Args:
        folder: Where the run writes.
        command: Run when a person is needed; empty: none.
        notify: Who else is told; None: nobody.
    """
    yield for_node(ALARM, 'folder', str(folder.resolve()), 'this run')
    if command:
        yield for_node(ALARM, 'command', command, '--alarm')
    if notify is not None:
        yield for_node(ALARM, 'notify_file', str(notify.absolute()), '--notify')


def page_entries(
    folder: Path,
    *,
    control: bool,
    address: str | None,
    origin: str | None,
    place: Path | None = None,
) -> Iterator[Entry]:
    """Yield what the page is told: who may control the robot, and where it is served.

    Args:
        folder: Where the run writes.
        control: Whether it has controls.
        address: Of the form HOST:PORT; None: the usual one.
        origin: What browsers know it by; None: its address.
        place: The place's file, to be edited there; None: it is not.

    Raises:
        ValueError: The address is none.
    """
    yield for_node(PAGE, 'control', control, '--web-control')
    if place is not None:
        yield for_node(PAGE, 'place_file', str(place.resolve()), 'this run')
        yield for_node(PAGE, 'place_copy', str(folder.resolve() / PLACE), 'this run')
    # In a file, so that a page that is started again keeps it, and no peer can ask for it.
    yield for_node(PAGE, 'folder', str(folder.resolve()), 'this run')
    yield for_node(PAGE, 'links_file', str(folder.resolve().parent / PAGE_LINKS), 'this run')
    yield for_node(PAGE, 'token_file', str(folder.resolve() / 'page_token'), 'this run')
    if address is not None:
        host, port = page_address(address)
        yield for_node(PAGE, 'host', host, '--web-address')
        yield for_node(PAGE, 'port', port, '--web-address')
    if origin is not None:
        yield for_node(PAGE, 'origin', origin, '--web-origin')


def watch_entries(folder: Path, file: Path) -> Iterator[Entry]:
    """Yield what the observer is told: the rules, and where it keeps what it saw.

    Args:
        folder: Where the run writes.
        file: The rules.
    """
    for node in (OBSERVER, PAGE):
        yield for_node(node, 'watch_file', str(file.absolute()), '--watch')
    yield for_node(BEHAVIOUR_NODE, 'looks', True, '--watch')
    kept = folder.resolve()
    yield for_node(OBSERVER, 'state_file', str(kept / f'{OBSERVER}.json'), 'this run')
    for node in (OBSERVER, PAGE):
        yield for_node(node, 'evidence_folder', str(kept / EVIDENCE), 'this run')


def stage_entry(file: Path) -> Entry:
    """Return what the simulator is told of a script of what happens in its place."""
    return for_node('simulator', 'stage_file', str(file.absolute()), '--stage')


def for_node(node: str, name: str, value: object, origin: str) -> Entry:
    """Return the entry of one node's parameter, in whatever namespace the node is."""
    return Entry(f'/**/{node}', name, value, origin)


def full_name(namespace: str | None, node: str) -> str:
    """Return a node's name in the graph."""
    names = [*(namespace or '').strip('/').split('/'), node]
    return '/' + '/'.join(name for name in names if name)


def write_parameters(
    folder: Path, namespace: str | None, merged: Configuration, nodes: Sequence[Node]
) -> dict[str, Path]:
    """Write one file for each node with all its parameters and where each came from.

    Raises:
        OSError: A file cannot be written.
    """
    files = {}
    for node in nodes:
        path = folder / f'{node.name}.yaml'
        name = full_name(namespace, node.name)
        try:
            folder.mkdir(exist_ok=True)
            path.touch(mode=0o600)  # the page's token may be in it
            path.write_text(resolved_text(name, merged.resolve(node.name, name)), 'utf-8')
        except OSError as error:
            why = f'cannot be written: {error.strerror}'
            raise OSError(error.errno, why, str(path)) from None
        files[node.name] = path
    return files
