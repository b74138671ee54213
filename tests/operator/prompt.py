"""The mission that a console speaks to, without one."""

from __future__ import annotations


class Prompt:
    """Two robots, of which one is spoken to."""

    def why(self) -> str:
        return 'because'

    def figures(self) -> str:
        return 'battery 80 %'

    def lines(self) -> list[str]:
        return ['anna', 'bert']

    def choose(self, robot: str) -> str:
        return f'you speak to {robot}'

    def tell_all(self, word: str) -> str:
        return f'all {word}'
