"""A file with a mistake in it: one line says what is wrong, and where."""

from __future__ import annotations

import tempfile
from pathlib import Path

from strict_files.files import FileError
from strict_files.yaml_file import read_yaml_file

TEXT = """\
robot:
  speed: 0.6
  speed: 0.8
"""


def main() -> None:
    """Read a file that gives one value twice, then one that is right."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'robot.yaml'
        path.write_text(TEXT, encoding='utf-8')
        try:
            read_yaml_file(path)
        except FileError as error:
            print(str(error).replace(folder, '.'))
        path.write_text('robot:\n  speed: 0.6\n', encoding='utf-8')
        file = read_yaml_file(path)
        print(file.values, 'line', file.lines['robot', 'speed'])


if __name__ == '__main__':
    main()
