"""Files that a person drops on the page: kept beside each other, and made a place of.

They are looked at in a folder of their own first; only what became a place is put where the command
was started, and nothing there is written over.
"""

from __future__ import annotations

import base64
import binascii
import contextlib
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from floor_plans.imports import SUFFIXES, ImportRequest, PlanPhoto, import_place, is_levels
from floor_plans.occupancy_map import PICTURES
from strict_files.files import FileError, in_one_line
from strict_files.yaml_file import read_yaml_file

MOST_BYTES = 48_000_000
"""Of all files together; as text they are a third longer."""
_YAML = ('.yaml', '.yml')
_NAME = re.compile(r'[^\W_][\w .()-]{0,99}')


def import_dropped(
    files: Mapping[str, Any],
    folder: Path,
    radius: float,
    resolution: str = '',
    level: str = '',
    corners: str = '',
    scale: str = '',
    older: Path | None = None,
) -> tuple[Path, str]:
    """Make a place of files; return it, and what was found in one line.

    Args:
        files: Their contents in base64, by name: a map.yaml with its picture, a picture, a building
            or a graph.
        folder: Where they are put, and the place beside them.
        radius: Of the robot, metres.
        resolution: Side of a picture's pixel, metres; empty: not given.
        level: The level of a building that has several; empty: not given.
        older: The place of an older map of the building, whose names are kept; None: there is none.
        corners, scale: How a picture shows a plan, see `PlanPhoto.from_words`; empty: it is a map.

    Raises:
        ValueError: They are none of these, or something of that name is there; one line.
    """
    contents = {_checked_name(name): _decoded(name, text) for name, text in files.items()}
    if sum(map(len, contents.values())) > MOST_BYTES:
        raise ValueError(f'more than {MOST_BYTES // 1_000_000} MB: expected smaller files')
    source = _source(contents)
    photo = PlanPhoto.from_words(corners, scale) if scale.strip() else None
    with tempfile.TemporaryDirectory(prefix='dropped-') as staged:
        stage = Path(staged)
        for name, data in contents.items():
            (stage / name).write_bytes(data)
        out = stage / f'{Path(source).stem.removesuffix(".building")}_place.yaml'
        request = ImportRequest(
            stage / source,
            out,
            radius,
            resolution=None if photo else _side(resolution),
            level=level.strip(),
            photo=photo,
            update=older,
        )
        try:
            if source.lower().endswith(_YAML) and not is_levels(contents[source]):
                contents[source] = _with_its_picture(stage / source, contents)
                (stage / source).write_bytes(contents[source])
            report = import_place(request)
        except ValueError as error:
            raise ValueError(str(error).replace(f'{stage}/', '')) from None
        made = sorted(stage.iterdir())
        for path in made:
            there = folder / path.name
            if there.exists() and not (
                path.name in contents and there.read_bytes() == contents[path.name]
            ):
                raise FileError(f'{there}: is there already; expected another name')
        new = [path for path in made if not (folder / path.name).exists()]
        try:
            for path in new:
                data = path.read_bytes()
                if path == out:
                    data = data.replace(f'{stage}/'.encode(), b'')
                (folder / path.name).write_bytes(data)
        except OSError as error:
            # Half of it would stand in the way of the next try.
            for path in new:
                with contextlib.suppress(OSError):
                    (folder / path.name).unlink(missing_ok=True)
            raise FileError(in_one_line(error)) from None
    drawn = {str(out), report.content['drawn']}
    told = [line for line in report.lines if line.partition(': ')[2] not in drawn]
    found = '; '.join(told).replace(f'{stage}/', '')
    return folder / out.name, f'{found}; written to {folder / out.name}'


def _checked_name(name: str) -> str:
    known = (*_YAML, *PICTURES, *SUFFIXES)
    if not _NAME.fullmatch(name) or not name.lower().endswith(known):
        raise ValueError(f'{name[:80]!r}: expected a file of a map, such as map.yaml or map.pgm')
    return name


def _decoded(name: str, text: Any) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, TypeError, ValueError):
        raise ValueError(f'{name}: did not arrive whole; drop it again') from None


def _source(contents: Mapping[str, bytes]) -> str:
    """Return which of the files says what the others are."""
    for kinds in (_YAML, SUFFIXES, PICTURES):
        found = sorted(name for name in contents if name.lower().endswith(kinds))
        if len(found) > 1:
            raise ValueError(f'{" and ".join(found)}: expected one map at a time')
        if found:
            return found[0]
    raise ValueError('no file came: expected map.yaml with its picture')


def _with_its_picture(source: Path, contents: Mapping[str, bytes]) -> bytes:
    """Return a map's description with the picture's name alone: nothing else is looked at here."""
    data, values = contents[source.name], read_yaml_file(source).values
    image = values.get('image')
    if not isinstance(image, str) or not image:
        return data  # whoever reads it says what is wrong
    named = image.replace('\\', '/').rpartition('/')[2]
    stem = Path(named).stem.casefold()
    if not any(Path(name).stem.casefold() == stem for name in contents.keys() - {source.name}):
        others = ', '.join(sorted(contents.keys() - {source.name}))
        came = f' (not {others})' if others else ''
        raise ValueError(f'{source.name} names {named}{came}: expected it with {source.name}')
    if named == image:
        return data
    return yaml.safe_dump({**values, 'image': named}, sort_keys=False).encode()


def _side(given: str) -> float | None:
    if not str(given).strip():
        return None
    try:
        return float(given)
    except ValueError:
        raise ValueError(f'{given!r}: expected the metres of a pixel, such as 0.05') from None
