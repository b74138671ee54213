"""Stand-ins for what launch files use of the package `launch`, which is in no package index."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass
class Argument:
    name: str
    default_value: str
    description: str
    choices: list[str] | None = None


@dataclasses.dataclass
class Configured:
    name: str

    def perform(self, context: dict[str, str]) -> str:
        return context[self.name]
