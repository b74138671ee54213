"""Resident Java reasoners (the copies that owlready2 brings), for comparison only."""

from __future__ import annotations

import importlib.util
import os
import select
import shutil
import subprocess
from pathlib import Path

SOURCE = Path(__file__).parent / 'java' / 'ResidentReasoner.java'
KINDS = ('pellet', 'hermit')


class JavaReasonerError(Exception):
    """The reasoner refused, failed, or took too long; the text is one line."""


def absent() -> str:
    """Return why no Java reasoner can run here; '' when one can."""
    if shutil.which('java') is None or shutil.which('javac') is None:
        return 'no Java development kit'
    if importlib.util.find_spec('owlready2') is None:
        return 'owlready2 is not installed'
    return ''


def _classpath() -> str:
    found = importlib.util.find_spec('owlready2')
    assert found is not None
    assert found.origin is not None
    folder = Path(found.origin).parent
    jars = sorted((folder / 'pellet').glob('*.jar'))
    return os.pathsep.join([*map(str, jars), str(folder / 'hermit' / 'HermiT.jar')])


class JavaReasoner:
    """One reasoner in a JVM of its own.

    Args:
        kind: One of `KINDS`.
        memory: Largest heap, megabytes.
        timeout: Longest wait for one answer, seconds.

    Raises:
        JavaReasonerError: From every method, when the JVM fails or does not answer in time.
    """

    def __init__(self, kind: str, memory: int = 2000, timeout: float = 60.0) -> None:
        command = ['java', f'-Xmx{memory}m', '-cp', _classpath(), str(SOURCE), kind]
        self._timeout = timeout
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, *words: str) -> str:
        """Send a command and return its answer."""
        return self._exchange('\t'.join(words) + '\n')

    def ask_all(self, questions: list[tuple[str, ...]]) -> str:
        """Send questions and return a letter for each: t(rue), f(alse) or e(rror)."""
        lines = ''.join('\t'.join(words) + '\n' for words in questions)
        return self._exchange(f'all\t{len(questions)}\n{lines}')

    def _exchange(self, text: str) -> str:
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(text)
            process.stdin.flush()
        except BrokenPipeError:
            raise JavaReasonerError('the JVM ended') from None
        ready, _, _ = select.select([process.stdout], [], [], self._timeout)
        if not ready:
            self.close()
            raise JavaReasonerError(f'no answer within {self._timeout:g} s')
        answer = process.stdout.readline().strip()
        if not answer or answer.startswith('error'):
            raise JavaReasonerError(answer.removeprefix('error ') or 'the JVM ended')
        return answer

    def cpu_seconds(self) -> float:
        """Return the processor time that the JVM took so far (Linux)."""
        fields = Path(f'/proc/{self._process.pid}/stat').read_text().rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def close(self) -> None:
        """End the JVM."""
        self._process.kill()
        self._process.wait()

    def __enter__(self) -> JavaReasoner:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
