"""Each change of an edited place: what it says, and what it makes of the file."""

from __future__ import annotations

from . import edited_places


def test_each_change_says_and_changes_what_it_did() -> None:
    """What it should do is to be read in the record.

    `python -m libs.floor_plans.tests.edited_places` takes what each change does now.
    """
    before = edited_places.RECORD.read_text('utf-8').splitlines()
    assert edited_places.recorded() == before
