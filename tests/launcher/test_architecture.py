"""The page on architecture names what is there: each path, module and package exists."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
TEXT = (CHECKOUT / 'docs' / 'explanation' / 'architecture.md').read_text(encoding='utf-8')
FILES = subprocess.run(
    ['git', '-C', str(CHECKOUT), 'ls-files', '--cached', '--others', '--exclude-standard'],
    capture_output=True,
    text=True,
    check=True,
).stdout.split()
FOLDERS = {str(folder) for file in FILES for folder in Path(file).parents}


def ends(path: str) -> bool:
    """Tell whether a file, or with a slash a folder, of the checkout ends with a path."""
    known = FOLDERS if path.endswith('/') else FILES
    path = path.rstrip('/')
    return any(one == path or one.endswith(f'/{path}') for one in known)


def test_every_file_and_folder_is_there() -> None:
    paths = {
        word
        for word in re.findall(r'`([\w./]+)`', TEXT)
        if re.search(r'(\.(py|xml|css|md)|\w/)\Z', word)
    }
    assert len(paths) > 30
    assert [path for path in sorted(paths) if not ends(path)] == []


def test_every_module_of_the_tables_is_in_its_package() -> None:
    rows = re.findall(r'^\| `((?:surveillance_)?\w+)` \| (.*)', TEXT, re.MULTILINE)
    packages = {path.split('/')[-2] for path in FILES if path.endswith('/__init__.py')}
    rows = [row for row in rows if row[0] in packages]
    assert len(rows) == 16
    missing = [
        f'{package}: {name}'
        for package, cells in rows
        for name in re.findall(r'`([a-z_]+)/?`', cells)
        if name != 'decide'  # the function to begin with
        and not any(
            re.search(rf'/{name}(_node)?(\.py|/)', file)
            for file in FILES
            if file.startswith((f'{package}/', f'libs/{package}/'))
        )
    ]
    assert missing == []
