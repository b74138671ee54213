"""A small film of an event: what the camera saw, and where the robot was, ten seconds around it.

It is made of the recording when somebody asks for it, and kept nowhere: an animated WebP, which
every browser plays as a picture and Pillow writes. Of a film that leaves this machine the rules of
pictures hold: whoever may be a person in it cannot be recognised.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, UnidentifiedImageError

from strict_files.files import FileError
from surveillance_operator.recording.timeline import Timeline
from surveillance_runtime.run_files import RECORDING, TIMELINE

AROUND = 10.0
"""Seconds before and after the event."""
STEP = 0.5
"""Seconds between two pictures: a recording has one of the camera a second."""
HEIGHT, WIDEST = 270, 400
"""Of each half, pixels."""
ROBOT = ((0.55, 0.0), (-0.35, 0.38), (-0.15, 0.0), (-0.35, -0.38))
_CARD, _INK, _WALL, _BLUE, _RED = '#ffffff', '#1b1f24', '#8a929c', '#0b5cad', '#b3132b'
KEPT = 8
"""So many films are remembered."""


def clip_of(
    run: Path, robot: str, at: float, spot: tuple[float, float] | None, *, blur: bool
) -> bytes:
    """Return the film around a moment as WebP.

    Args:
        run: The folder of the run.
        robot: Whose recording; empty: that of a robot that was alone.
        at: The moment, seconds since 1970.
        spot: Of the event, map frame, metres; None: not known.
        blur: Whether it leaves this machine.

    Raises:
        ValueError: Nothing is recorded of it.
    """
    return _made(run, robot, round(at, 1), spot, blur)


@lru_cache(KEPT)
def _made(run: Path, robot: str, at: float, spot: tuple[float, float] | None, blur: bool) -> bytes:
    folder = run / robot
    with contextlib.ExitStack() as stack:
        sights = line = None
        with contextlib.suppress(FileError, ImportError):
            from surveillance_operator.recording.stored import RecordedSights

            sights = RecordedSights(folder / RECORDING)
            stack.callback(sights.close)
        with contextlib.suppress(FileError):
            line = Timeline(folder / TIMELINE)
            stack.callback(line.close)
        frames: list[Image.Image] = []
        seen: dict[bytes, Image.Image] = {}
        found = False
        for number in range(round(2 * AROUND / STEP) + 1):
            moment = at - AROUND + number * STEP
            jpeg = None if sights is None else sights.jpeg(moment)
            if jpeg is not None and jpeg not in seen:
                seen[jpeg] = _camera(jpeg, blur=blur)
            parts = _parts(line, moment)
            found = found or jpeg is not None or bool(parts)
            frames.append(_frame(seen.get(jpeg or b''), parts, moment, at, spot))
    if not found:
        raise ValueError('nothing is recorded of this time: start with --record')
    file = io.BytesIO()
    frames[0].save(
        file,
        'WEBP',
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 * STEP),
        loop=0,
        quality=55,
        method=2,
    )
    return file.getvalue()


def _parts(line: Timeline | None, moment: float) -> Mapping[str, Any]:
    if line is None or not line.times[0] <= moment <= line.times[-1] + AROUND:
        return {}
    return line.at(moment)[2]


def _camera(jpeg: bytes, *, blur: bool) -> Image.Image:
    """Return a picture of the camera as it is shown; a black one where it is damaged."""
    try:
        picture = Image.open(io.BytesIO(jpeg)).convert('RGB')
    except (OSError, UnidentifiedImageError):
        return Image.new('RGB', (WIDEST, HEIGHT))
    if blur:
        # It takes its time, and a page on this machine needs none of it.
        import numpy as np

        from indoor_watch.privacy import blurred, installed_finder

        shown = blurred(np.asarray(picture)[:, :, ::-1].copy(), installed_finder())
        picture = Image.fromarray(np.ascontiguousarray(shown[:, :, ::-1]))
    picture.thumbnail((WIDEST, HEIGHT))
    return picture


def _frame(
    camera: Image.Image | None,
    parts: Mapping[str, Any],
    moment: float,
    at: float,
    spot: tuple[float, float] | None,
) -> Image.Image:
    frame = Image.new('RGB', (2 * WIDEST, HEIGHT + 22), _CARD)
    pen = ImageDraw.Draw(frame)
    if camera is not None:
        frame.paste(camera, ((WIDEST - camera.width) // 2, (HEIGHT - camera.height) // 2))
    else:
        pen.text((20, HEIGHT // 2), 'no picture of the camera', _INK)
    _map(frame, parts, spot)
    place = (parts.get('status') or {}).get('place', '')
    told = f'{datetime.fromtimestamp(moment):%Y-%m-%d %H:%M:%S}  {moment - at:+.1f} s  {place}'
    pen.text((8, HEIGHT + 4), told, _RED if abs(moment - at) < STEP else _INK)
    return frame


def _map(frame: Image.Image, parts: Mapping[str, Any], spot: tuple[float, float] | None) -> None:
    """Draw what the map showed into the right half."""
    points: list[Sequence[float]] = [
        each['at'] for each in (parts.get('places') or {}).values() if each.get('at')
    ]
    doors = [door['line'] for door in (parts.get('doors') or {}).values() if door.get('line')]
    points += [end for line in doors for end in (line[:2], line[2:])]
    box = (parts.get('grid') or {}).get('known')
    if box is None:
        if not points:
            return
        xs, ys = [p[0] for p in points], [p[1] for p in points]
        box = (min(xs) - 2, min(ys) - 2, max(xs) + 2, max(ys) + 2)
    left, bottom, right, top = box
    scale = min(WIDEST / max(right - left, 0.1), HEIGHT / max(top - bottom, 0.1))

    def on(point: Sequence[float]) -> tuple[float, float]:
        return WIDEST + (point[0] - left) * scale, (top - point[1]) * scale

    _walls(frame, parts.get('grid'), on)
    pen = ImageDraw.Draw(frame)
    for line in doors:
        pen.line([on(line[:2]), on(line[2:])], _WALL, 3)
    for name, each in (parts.get('places') or {}).items():
        if each.get('at'):
            x, y = on(each['at'])
            pen.text((x - 6, y + 6), name, _INK)
    for part, colour in (('trail', '#5b9bd5'), ('plan', _BLUE)):
        if len(way := parts.get(part) or []) > 1:
            pen.line([on(point) for point in way], colour, 2)
    if spot is not None:
        x, y = on(spot)
        pen.ellipse((x - 9, y - 9, x + 9, y + 9), outline=_RED, width=3)
    if pose := parts.get('pose'):
        x, y, yaw = pose
        turned = [
            (
                x + a * math.cos(yaw) - b * math.sin(yaw),
                y + a * math.sin(yaw) + b * math.cos(yaw),
            )
            for a, b in ROBOT
        ]
        pen.polygon([on(point) for point in turned], '#ffd54a', _INK)


def _walls(frame: Image.Image, grid: Any, on: Any) -> None:
    """Draw the cells of the map, which a time line has as a picture."""
    if not grid or not str(grid.get('image', '')).startswith('data:image/png;base64,'):
        return
    import base64

    data = base64.b64decode(str(grid['image']).partition(',')[2])
    try:
        picture = Image.open(io.BytesIO(data)).convert('LA')
    except (OSError, UnidentifiedImageError):
        return
    left, bottom, right, top = grid['box']
    (x0, y0), (x1, y1) = on((left, top)), on((right, bottom))
    size = max(1, round(x1 - x0)), max(1, round(y1 - y0))
    picture = picture.resize(size)
    frame.paste(picture.convert('RGB'), (round(x0), round(y0)), picture.getchannel('A'))
