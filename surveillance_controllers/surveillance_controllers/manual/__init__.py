"""MANUAL mode: an operator's commands, the requests that wait for them, and the prompt.

`commands` has the grammar and the texts, `requests` the queue, `prompt` reads lines from a terminal
or a pipe, `terminal` edits them.
"""

from surveillance_controllers.manual.commands import Command, CommandError, Grammar, ParsedCommand
from surveillance_controllers.manual.prompt import Console

__all__ = ['Command', 'CommandError', 'Console', 'Grammar', 'ParsedCommand']
