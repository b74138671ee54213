"""Persons found in pictures, and in pictures without any.

.venv/bin/python benchmarks/persons.py --with FOLDER_OR_PICTURE ... --without FOLDER_OR_PICTURE ...
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import cv2
import numpy as np

from surveillance_perception.observation.persons import PersonFinder, load_finder

ENDINGS = ('.jpg', '.jpeg', '.png')


def pictures(given: list[Path]) -> list[Path]:
    """Return the pictures that are named, and those in folders that are."""
    found = [each for path in given for each in ([path] if path.is_file() else path.rglob('*'))]
    return sorted(each for each in found if each.suffix.lower() in ENDINGS)


def measured(finder: PersonFinder, paths: list[Path]) -> tuple[list[str], float]:
    """Return the names of the pictures with a find, and milliseconds of CPU a picture."""
    hits, spent = [], 0.0
    for path in paths:
        read = cv2.imread(str(path))
        if read is None:
            continue
        began = time.process_time()
        if finder.find(np.asarray(read, np.uint8)):
            hits.append(path.name)
        spent += time.process_time() - began
    return hits, 1000.0 * spent / max(1, len(paths))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('--with', dest='persons', type=Path, nargs='*', default=[])
    parser.add_argument('--without', type=Path, nargs='*', default=[])
    given = parser.parse_args()
    persons, without = pictures(given.persons), pictures(given.without)
    finder = load_finder()
    print(f'{"":12} {"found":>10} {"false":>10} {"ms CPU":>8}')
    hits, first = measured(finder, persons)
    false, second = measured(finder, without)
    spent = (first * len(persons) + second * len(without)) / max(1, len(persons + without))
    found, wrong = f'{len(hits)}/{len(persons)}', f'{len(false)}/{len(without)}'
    print(f'{"BlazePose":12} {found:>10} {wrong:>10} {spent:8.0f}   {", ".join(false)}')


if __name__ == '__main__':
    main()
