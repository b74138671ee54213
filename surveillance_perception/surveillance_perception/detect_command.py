"""The `detect` command: prints the markers in image files; with `--out` it draws them too."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import cv2

from marker_detection import DetectorSettings, MarkerDetector, annotated
from strict_files.files import in_one_line
from strict_files.regular_files import replace_file
from surveillance_perception.stream.image_files import read_image
from surveillance_runtime.command_line import CommandParser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 when every image could be read, 1 when one could not, 2 for a wrong command line.
    """
    parser = CommandParser(
        prog='launch.py detect',
        description='Find ArUco markers in images; nothing is written without --out.',
    )
    parser.add_argument('images', nargs='+', type=Path, metavar='IMAGE')
    parser.add_argument(
        '--dictionary',
        default='DICT_5X5_100',
        help="one of OpenCV's, or a file in its form; default: %(default)s",
    )
    parser.add_argument('--known', type=int, nargs='+', metavar='ID', help='ids that are expected')
    parser.add_argument('--out', type=Path, metavar='FOLDER', help='write annotated copies into it')
    options = parser.parse_args(argv)
    known = None if options.known is None else frozenset(options.known)
    try:
        detector = MarkerDetector(DetectorSettings(options.dictionary, known))
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
    except (ValueError, OSError) as error:
        print(f'detect: {_words(error)}', file=sys.stderr)
        return 2
    failed = 0
    written = {path.resolve() for path in options.images}
    for path in options.images:
        try:
            _detect(detector, path, options.out, written)
        except (ValueError, OSError) as error:
            print(f'detect: {_words(error)}', file=sys.stderr)
            failed += 1
    return 1 if failed else 0


def _detect(detector: MarkerDetector, path: Path, folder: Path | None, written: set[Path]) -> None:
    image = read_image(path)
    detections = detector.detect(image)
    said = f'{path}: {len(detections)} marker{"" if len(detections) == 1 else "s"}'
    if folder is not None:
        target = _target(path, folder, written)
        encoded = cv2.imencode('.png', annotated(image, detections))[1]
        replace_file(target, encoded.tobytes())
        said += f', drawn in {target}'
    print(said)
    if not detections:
        for name, ids in detector.other_families(image).items():
            print(f'  looks like {name}: {", ".join(map(str, ids))}')
    for detection in sorted(detections, key=lambda each: each.marker_id):
        x, y = detection.corners.mean(axis=0)
        note = '' if detection.known else '  not on the known list'
        print(
            f'  id {detection.marker_id:4d}  at ({x:.1f}, {y:.1f})'
            f'  confidence {detection.confidence:.2f}{note}'
        )


def _words(error: ValueError | OSError) -> str:
    return in_one_line(error) if isinstance(error, OSError) else str(error)


def _target(path: Path, folder: Path, written: set[Path]) -> Path:
    """Return where the annotated copy goes: neither onto an image of this call nor onto another
    copy.
    """
    target, number = folder / f'{path.stem}_markers.png', 1
    while target.resolve() in written:
        number += 1
        target = folder / f'{path.stem}_markers_{number}.png'
    written.add(target.resolve())
    return target


if __name__ == '__main__':
    sys.exit(main())
