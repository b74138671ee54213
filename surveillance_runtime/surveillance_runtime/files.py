"""Files of nodes and commands: one error for all of them, and replacing one in a single step."""

from __future__ import annotations

import os
from pathlib import Path


class FileError(ValueError):
    """A file cannot be read, written or understood; one line that says which, and often where."""


def replace_text(path: Path, text: str) -> None:
    """Write a file so that whoever reads it finds all of the old text or all of the new one.

    Args:
        path: The file; its folder is there.
        text: What it is to hold.

    Raises:
        OSError: It cannot be written; the old file is whole.
    """
    draft = path.with_name(path.name + '.new')
    draft.write_text(text, encoding='utf-8')
    os.replace(draft, path)
