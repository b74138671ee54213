"""What a shell completes: commands, and the options of each, as their help says them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping

SHELLS = ('bash', 'zsh')
_OPTION = re.compile(r'(?<![\w-])--[a-z][a-z0-9-]+')


def options_in(help_text: str) -> list[str]:
    """Return the options that a help text names."""
    return sorted(set(_OPTION.findall(help_text)))


def script(shell: str, program: str, options: Mapping[str, Iterable[str]]) -> str:
    """Return what a shell reads to complete the words of a program.

    Args:
        shell: One of `SHELLS`.
        program: How it is called: as a command, or as a file that Python runs.
        options: Of each command; those of an empty name are for none.
    """
    cases = '\n'.join(
        f'    {shlex.quote(name)}) words={shlex.quote(" ".join(found))} ;;'
        for name, found in options.items()
        if name
    )
    first = ' '.join((*(name for name in options if name), *options.get('', ())))
    name = re.sub(r'\W', '_', program)
    zsh = 'autoload -U +X bashcompinit && bashcompinit\n' if shell == 'zsh' else ''
    return f"""{zsh}_{name}() {{
  local at=1 words
  [ "${{COMP_WORDS[0]##*/}}" = {shlex.quote(program)} ] || at=2
  case "${{COMP_WORDS[at]}}" in
{cases}
    *) words={shlex.quote(first)} ;;
  esac
  [ "$COMP_CWORD" -le "$at" ] && words={shlex.quote(first)}
  COMPREPLY=($(compgen -f -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _{name} {shlex.quote(program)} ./{shlex.quote(program)}
"""
