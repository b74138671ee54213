"""Reads the profile of a robot from a file, or finds a ready one by its name."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from strict_files.files import FileError
from strict_files.suggestions import nearest
from strict_files.yaml_file import KeyPath, YamlFile, read_yaml_file
from surveillance_runtime.parameters import ParameterError, specs_of, with_values
from surveillance_runtime.profile.record import Lidars, RobotProfile

BUILT_IN = 'built_in'
ROBOTS = 'robots'
"""The folder of the ready profiles, in the configuration's."""


@dataclass(frozen=True)
class ProfileFile:
    """A profile and the file it is from."""

    path: Path
    profile: RobotProfile


def profile_names(config: Path) -> list[str]:
    """Return the names of the ready profiles."""
    return sorted(path.stem for path in (config / ROBOTS).glob('*.yaml'))


def find_profile(config: Path, robot: str) -> Path:
    """Return the file of a profile, which is named or given as a file.

    Args:
        config: The folder with the ready profiles.
        robot: A name, or a path.

    Raises:
        FileError: It is neither.
    """
    ready = config / ROBOTS / f'{robot}.yaml'
    if '/' not in robot and ready.exists():
        return ready
    path = Path(robot)
    if path.exists():
        return path
    known = nearest(robot, profile_names(config))
    raise FileError(f'--robot {robot!r}: expected a file robot.yaml, or {known}')


def read_profile(path: str | Path) -> ProfileFile:
    """Read the profile of a robot.

    Raises:
        FileError: One line: what is wrong, where, and what was expected.
    """
    file = read_yaml_file(path)
    specs = {spec.name: spec for spec in specs_of(RobotProfile())}
    values: dict[str, Any] = {}
    origins: dict[str, str] = {}
    for where, name, given in _leaves(file.values, ()):
        line = file.lines[where]
        if name not in specs:
            expected = nearest(name, _alternatives(name, specs))
            raise file.error_at(where, f'unknown key {name!r}: expected {expected}')
        try:
            values[name] = specs[name].accept(_plain(name, given))
        except ParameterError as error:
            raise file.error_at(where, str(error).removeprefix('parameter ')) from None
        origins[name] = f'{path}:{line}'
    # Where the lidars of another robot are it has to say itself, here or on tf_static.
    unknown = replace(RobotProfile(), lidars=Lidars(mounts=()))
    profile = replace(with_values(unknown, values), origins=origins)
    _check_together(file, profile)
    return ProfileFile(Path(path), profile)


def _leaves(body: Mapping[str, Any], where: KeyPath) -> Iterator[tuple[KeyPath, str, Any]]:
    for key, value in body.items():
        here = (*where, key)
        if isinstance(value, Mapping):
            yield from _leaves(value, here)
        else:
            yield here, '.'.join(here), value


def _alternatives(name: str, specs: Mapping[str, Any]) -> list[str]:
    """Return the keys of the same part, or all where there is no such part."""
    part = name.rpartition('.')[0]
    alike = [key for key in specs if part and key.startswith(f'{part}.')]
    return alike or list(specs)


def _plain(name: str, given: Any) -> Any:
    """Return a value with its lists of lists (corners, mounts, voltages) as one list.

    Nav2 has a footprint as a text that holds such a list.
    """
    if name == 'body.footprint' and isinstance(given, str):
        try:
            given = json.loads(given)
        except ValueError:
            return given
    if not isinstance(given, list) or not any(isinstance(each, list) for each in given):
        return given
    flat: list[Any] = []
    for each in given:
        row = list(each) if isinstance(each, list) else [each]
        # A mount without a roll stands upright.
        flat += [*row, 0.0] if name == 'lidars.mounts' and len(row) == 3 else row
    return flat


def _check_together(file: YamlFile, profile: RobotProfile) -> None:
    """Make sure that what is said of the lidars and the battery goes together."""
    topics, mounts = profile.topics, profile.lidars.mounts
    lidars = len(topics.scans)
    if mounts and len(mounts) != 4 * lidars:
        told = len(mounts) / 4
        raise file.error(
            ('lidars', 'mounts'), f'{told:g} mounts for {lidars} topics.scans: expected {lidars}'
        )
    if 'frames.scans' in profile.origins and len(profile.frames.scans) != lidars:
        raise file.error(
            ('frames', 'scans'),
            f'{len(profile.frames.scans)} frames for {lidars} topics.scans: expected {lidars}',
        )
    if topics.command == topics.wanted:
        raise file.error(
            ('topics', 'command'),
            f'{topics.command}, as topics.wanted: expected two topics, for the collision monitor '
            'stands between them',
        )
    if profile.battery.source == 'topic' and not topics.battery:
        raise file.error(('topics', 'battery'), 'empty: expected the topic of the driver')
    if not math.isfinite(profile.body.reach):
        raise file.error(('body', 'footprint'), 'expected finite numbers')
