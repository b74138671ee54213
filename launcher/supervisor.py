"""Child processes under supervision: started, their output merged, restarted, stopped together.

One thread, one `selectors` loop: output, input, deaths and signals all arrive as readable file
descriptors; pauses and deadlines are looked at in each round.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from launcher.log_merge import MergedLog
from launcher.process_watch import IDLE_AFTER, Activity, Heartbeats, look_at
from launcher.receive_queues import ReceiveQueues
from launcher.restarts import PAUSES, Restarts
from launcher.service import notify
from surveillance_runtime.launch_protocol import (
    DONE,
    EXIT_CANNOT_START,
    EXIT_NOT_NOW,
    FINISHED,
    HEARTBEAT,
    MEMORY,
    RESTARTS,
    SAY_WHERE,
    SLEPT,
    UP,
)

START_WITHIN = 1.5
"""Seconds for which the next process waits at most until this one says that it is up."""
STOP_LEADERS_WITHIN = 1.2
"""Seconds that the processes which use the others have before those are told to stop as well."""
EXIT_CUT = 1
"""The exit code of a run that its process has not brought to an end: `ManagedProcess.ends_run`."""
STOP_WITHIN, STOP_AT_MOST = 2.5, 12.0
"""Seconds until whatever is left and does nothing, or has done its work, is killed, and until all
that is left is."""
STOP_AGAIN_AFTER = 0.5
"""Seconds from a stop signal on which another one kills all that is left; one Ctrl-C may come as
two signals."""
LAST_WORDS = 0.5
"""Seconds that a process which does not end has to say where it is, before it is killed."""
TICK = 0.1
"""Seconds that a round of the loop takes at most."""
LOOK_PERIOD = 0.5
"""Seconds between two looks at the heartbeats and the memory of the processes."""
_LONGEST_LINE = 64 * 1024
_STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True)
class ManagedProcess:
    """A process to run.

    It says when it is up, and writes heartbeats (`launch_protocol`). It is ended and started again
    when it hangs, and started again when it ends without having said that it has finished.

    Attributes:
        name: in the log.
        command, environ: as for `subprocess`.
        nodes: what it holds: the log names these when it starts and dies; default: its own name.
        takes_input: whether it reads lines, see `Supervisor.send`.
        leads: whether it uses the others, and so is stopped before them.
        ends_run: whether all others are stopped when it has ended, by itself or not: what it
            knows is the run's result, and one that were started again would begin anew.
        can_be_missed: whether the others go on without it where it cannot start at present.
        memory: bytes of resident memory beyond which it is ended and started again; 0: any.
    """

    name: str
    command: Sequence[str]
    environ: Mapping[str, str]
    nodes: Sequence[str] = ()
    takes_input: bool = False
    leads: bool = False
    ends_run: bool = False
    can_be_missed: bool = False
    memory: int = 0

    @property
    def names(self) -> Sequence[str]:
        """What it holds."""
        return self.nodes or (self.name,)

    @property
    def told(self) -> str:
        """What it holds, in one line."""
        return ', '.join(self.names)


@dataclass
class RunningProcess:
    """What runs of a `ManagedProcess` at present, and its history."""

    program: ManagedProcess
    restarts: Restarts
    process: subprocess.Popen[bytes] | None = None
    started: float = 0.0
    starts: int = 0
    restart_at: float | None = None
    told_to_stop: bool = False
    killed: bool = False
    kill_at: float | None = None
    coming_up: bool = False
    finished: bool = False
    done: bool = False
    heartbeats: Heartbeats | None = None
    activity: Activity = field(default_factory=Activity)
    ended_for: str = ''
    died_of: str = ''
    read: Callable[[], bool] = lambda: False

    @property
    def running(self) -> bool:
        return self.process is not None


class Supervisor:
    """Runs programs until told to stop.

    Only so many come up at once as the machine has processors for: the first are not slowed down by
    the last.

    Args:
        programs: in start order.
        log: where their output goes.
        pauses: seconds before a restart, see `restarts.PAUSES`.
        at_once: how many may come up at the same time; default: one more than there are
            processors, for each waits at times.
        on_trouble: called with the nodes and one line when a program dies again and again.
        on_restart: called with the name of each node that is started again, and why.
        on_tick: called in each round, with steady time in seconds.

    Attributes:
        time_is_over: whether it stopped because the time that was asked for was over.
    """

    def __init__(
        self,
        programs: Sequence[ManagedProcess],
        log: MergedLog,
        pauses: Sequence[float] = PAUSES,
        at_once: int | None = None,
        on_trouble: Callable[[Sequence[str], str], None] = lambda _nodes, _text: None,
        on_restart: Callable[[str, str], None] = lambda _name, _why: None,
        on_tick: Callable[[float], None] = lambda _now: None,
    ) -> None:
        self.children = {
            program.name: RunningProcess(program, Restarts(pauses)) for program in programs
        }
        self._to_start: list[RunningProcess] = []
        self._at_once = at_once or (os.cpu_count() or 1) + 1
        self._log = log
        self._on_trouble = on_trouble
        self._on_restart = on_restart
        self._on_tick = on_tick
        self._look_at = 0.0
        domain = next((each.environ.get('ROS_DOMAIN_ID', '') for each in programs), '')
        self._queues = ReceiveQueues(int(domain) if domain.isdecimal() else 0)
        self._selector = selectors.DefaultSelector()
        self._stopping_since: float | None = None
        self._stop_at_once = False
        self._code = 0
        self.time_is_over = False

    def read_from(self, source: int, on_line: Callable[[str], None]) -> Callable[[], bool]:
        """Call `on_line` for each line that can be read from a descriptor until its end.

        Returns:
            Reads at once what is there; returns whether there may be more.
        """
        rest = b''

        def take() -> bool:
            nonlocal rest
            try:
                chunk = os.read(source, 65536)
            except BlockingIOError:
                return False
            except OSError:
                chunk = b''
            *lines, rest = (rest + chunk).split(b'\n')
            if not chunk:
                self._selector.unregister(source)
            if rest and (not chunk or len(rest) > _LONGEST_LINE):
                lines.append(rest)
                rest = b''
            for line in lines:
                on_line(line.decode('utf-8', 'replace'))
            return bool(chunk)

        self._selector.register(source, selectors.EVENT_READ, take)
        return take

    def send(self, name: str, line: str) -> bool:
        """Write a line to the input of the program that holds a node; return whether it lives."""
        process = next(c.process for c in self.children.values() if name in c.program.names)
        if process is None or process.stdin is None:
            return False
        try:
            process.stdin.write(line.encode() + b'\n')
            process.stdin.flush()
        except OSError:
            return False
        return True

    def stop(self, code: int = 0) -> None:
        """Begin to end every process; `run` returns when all are gone."""
        if self._stopping_since is None:
            self._stopping_since = time.monotonic()
            self._code = code
            self._to_start.clear()
            for child in self.children.values():
                child.restart_at = None
            self._tell_to_stop(leaders_only=True)
            self._keep_stopping(self._stopping_since)

    def run(self, seconds: float | None = None) -> int:
        """Start everything and return the exit code when everything has ended.

        Args:
            seconds: stop after this time; None runs until a signal or until every program ended.
        """
        end = None if seconds is None else time.monotonic() + seconds
        with self._signals():
            notify('READY=1')
            self._to_start = list(self.children.values())
            self._start_next()
            while self._to_start or any(
                child.running or child.restart_at for child in self.children.values()
            ):
                for key, _ in self._selector.select(TICK):
                    key.data()
                self._reap()
                self._keep_time(end)
            self._log.say('every process has ended')
        self._selector.close()
        return self._code

    def _start_next(self) -> None:
        late = time.monotonic() - START_WITHIN
        while self._to_start and self._at_once > sum(
            child.coming_up and child.started > late for child in self.children.values()
        ):
            self._start(self._to_start.pop(0))

    def _start(self, child: RunningProcess) -> None:
        child.finished, child.done, child.ended_for = False, False, ''
        with self._pipe(self._when_it_tells(child)) as writer:
            process = self._spawn(child, writer)
        child.process = process
        child.started = time.monotonic()
        child.starts += 1
        assert process.stdout is not None
        os.set_blocking(process.stdout.fileno(), False)
        if process.stdin is not None:
            os.set_blocking(process.stdin.fileno(), False)
        child.read = self.read_from(
            process.stdout.fileno(), partial(self._log.line, child.program.name)
        )
        for name in child.program.names:
            self._log.say(f'started {name} (process {process.pid})')
            if child.starts > 1:
                self._on_restart(name, child.died_of)

    @contextlib.contextmanager
    def _pipe(self, on_read: Callable[[bytes], None]) -> Iterator[int]:
        """Give what a process writes to; its end is read as b''."""
        reader, writer = os.pipe()

        def take() -> None:
            chunk = os.read(reader, 4096)
            if not chunk:
                self._selector.unregister(reader)
                os.close(reader)
            on_read(chunk)

        self._selector.register(reader, selectors.EVENT_READ, take)
        try:
            yield writer
        finally:
            os.close(writer)

    def _when_it_tells(self, child: RunningProcess) -> Callable[[bytes], None]:
        """Return what takes the bytes that a process tells of itself (`launch_protocol`)."""
        child.coming_up = True
        heartbeats = child.heartbeats = Heartbeats(time.monotonic())

        def take(told: bytes) -> None:
            if child.heartbeats is not heartbeats:
                return  # the process before
            if UP in told:
                child.coming_up = False
            if told.strip(UP):
                heartbeats.beat(time.monotonic())
            child.finished = child.finished or FINISHED in told
            child.done = child.done or DONE in told
            # Who is alone has nobody who could have forgotten it.
            if SLEPT in told and len(self.children) > 1:
                self._end(child, 'slept so long that its peers may have forgotten it')

        return take

    def _spawn(self, child: RunningProcess, writer: int) -> subprocess.Popen[bytes]:
        environ = {**child.program.environ, HEARTBEAT: str(writer), RESTARTS: str(child.starts)}
        if child.program.memory:
            # What is mapped is more than what is held.
            environ[MEMORY] = str(2 * child.program.memory + 2**30)
        return subprocess.Popen(
            child.program.command,
            env=environ,
            pass_fds=(writer,),
            stdin=subprocess.PIPE if child.program.takes_input else subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            # Ctrl-C in the terminal reaches the launcher alone, which then ends each child once.
            start_new_session=True,
        )

    def _reap(self) -> None:
        for child in self.children.values():
            process = child.process
            if process is None or not _has_ended(process):
                continue
            _kill_group(process.pid)
            code = process.wait()
            self._close(child, process)
            child.process = child.kill_at = None
            child.coming_up = False
            self._after_death(child, code)
            child.heartbeats = None

    def _close(self, child: RunningProcess, process: subprocess.Popen[bytes]) -> None:
        """Take what a dead process still printed, then let its pipes go."""
        assert process.stdout is not None
        # A process that left its group may hold the pipe open: its end is not waited for.
        while process.stdout in self._selector.get_map() and child.read():
            pass
        if process.stdout in self._selector.get_map():
            self._selector.unregister(process.stdout)
        for stream in (process.stdout, process.stdin):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()

    def _after_death(self, child: RunningProcess, code: int) -> None:
        name = child.program.told
        if self._stopping_since is not None:
            if code not in (0, -signal.SIGTERM) and not child.killed:
                self._log.warn(f'{name} ended with {describe_exit(code)}')
            return
        if child.finished:
            self._log.say(f'{name} has ended by itself')
            if child.program.ends_run:
                self.stop()
            return
        if code == EXIT_NOT_NOW and child.starts == 1 and child.program.can_be_missed:
            self._log.error(f'{name} cannot start: the run goes on without it')
            return
        if code in (EXIT_CANNOT_START, EXIT_NOT_NOW) and child.starts == 1:
            self._log.error(f'{name} cannot start with this configuration: stopping')
            self.stop(code)
            return
        why = child.died_of = child.ended_for or describe_exit(code)
        if child.program.ends_run:
            self._log.error(f'{name} died ({why}): the run ends with what there is')
            self.stop(EXIT_CUT)
            return
        now = time.monotonic()
        worked = child.heartbeats is not None and child.heartbeats.begun
        pause = child.restarts.died(now, now - child.started, worked=worked)
        child.restart_at = now + pause
        when = f' in {pause:g} s' if pause else ''
        for each in child.program.names:
            self._log.warn(f'{each} died ({why}): starting it again{when}')
        if trouble := child.restarts.trouble(now):
            self._log.error(f'{name} {trouble}, last: {why}: a person should look at it')
            self._on_trouble(child.program.names, f'{name} {trouble}, last: {why}')

    def _watch(self, now: float) -> None:
        """End what hangs or holds too much memory; it is started again as after a death."""
        if now < self._look_at:
            return
        notify('WATCHDOG=1')
        late = now - self._look_at
        self._look_at = now + LOOK_PERIOD
        if late > LOOK_PERIOD:  # the launcher itself did not run: the machine slept
            self._queues.excuse()
        come_up = [
            child.process.pid
            for child in self.children.values()
            if child.process is not None and child.heartbeats is not None and child.heartbeats.begun
        ]
        deaf = self._queues.look(come_up, now)
        for child in self.children.values():
            if child.process is None or child.heartbeats is None or child.killed:
                continue
            if late > LOOK_PERIOD:
                child.heartbeats.excuse(now)
                continue
            look = look_at(child.process.pid)
            problem = child.heartbeats.problem(now, look) or deaf.get(child.process.pid, '')
            can_tell = bool(problem) and look is not None and look.state != 'T'
            most = child.program.memory
            if look is not None and most and look.memory > most:
                held, allowed = look.memory >> 20, most >> 20
                problem = f'holds {held} MB of memory, at most {allowed} MB are allowed'
            if problem:
                self._end(child, problem, can_tell=can_tell)

    def _end(self, child: RunningProcess, problem: str, *, can_tell: bool = False) -> None:
        """End a process, to be started again as after a death."""
        if child.process is not None and not child.ended_for and self._stopping_since is None:
            child.ended_for = problem
            self._log.warn(f'{child.program.told} {problem}: ending it')
            self._kill(child, can_tell=can_tell)

    def _kill(self, child: RunningProcess, *, can_tell: bool) -> None:
        """Kill a process and what it started, at once or after it has told where it hangs."""
        assert child.process is not None
        if can_tell:
            _send(child.process, SAY_WHERE)
            child.kill_at = time.monotonic() + LAST_WORDS
        else:
            _kill_group(child.process.pid)

    def _tell_to_stop(self, *, leaders_only: bool) -> None:
        for child in reversed(self.children.values()):
            wanted = child.program.leads or not leaders_only
            if child.process is not None and wanted and not child.told_to_stop:
                child.told_to_stop = True
                _send(child.process, signal.SIGTERM)

    def _keep_stopping(self, now: float) -> None:
        """Go on with a stop: leaders first, then the rest, at last by force.

        On a busy machine an orderly end takes long: who still does something is waited for.
        """
        since = self._stopping_since
        if since is None:
            return
        running = [child for child in self.children.values() if child.process is not None]
        if now >= since + STOP_LEADERS_WITHIN or not any(c.program.leads for c in running):
            self._tell_to_stop(leaders_only=False)
        for child in running:
            if child.process is None or child.killed:
                continue
            look = look_at(child.process.pid)
            works = look is not None and child.activity.idle(now, look) < IDLE_AFTER
            allowed = STOP_AT_MOST if works and not child.done else STOP_WITHIN
            if not self._stop_at_once and now < since + allowed:
                continue
            child.killed = True
            if child.done:
                self._log.say(f'{child.program.told} has done its work, ROS does not let it end')
            else:
                self._log.warn(f'{child.program.told} did not end in time: killed')
            self._kill(child, can_tell=not (self._stop_at_once or child.done))

    def _keep_time(self, end: float | None) -> None:
        now = time.monotonic()
        self._on_tick(now)
        if self._log.broken:
            self.stop()
        if end is not None and now >= end and self._stopping_since is None:
            self._log.say('the time is over: stopping')
            self.time_is_over = True
            self.stop()
        for child in self.children.values():
            if child.process is not None and child.kill_at is not None and now >= child.kill_at:
                _kill_group(child.process.pid)
            if child.restart_at is not None and now >= child.restart_at:
                child.restart_at = None
                self._to_start.append(child)
        self._start_next()
        if self._stopping_since is None:
            self._watch(now)
        self._keep_stopping(now)

    @contextlib.contextmanager
    def _signals(self) -> Iterator[None]:
        """Turn stop signals and deaths of children into events of the loop.

        Afterwards stop signals are ignored: what was running has ended, the rest is soon said.
        """
        reader, writer = socket.socketpair()
        reader.setblocking(False)
        writer.setblocking(False)

        def on_signal() -> None:
            for number in reader.recv(4096):
                if number not in _STOP_SIGNALS:
                    continue
                if self._stopping_since is None:
                    self._log.say(f'{signal.Signals(number).name}: stopping')
                    self.stop()
                elif time.monotonic() - self._stopping_since >= STOP_AGAIN_AFTER:
                    self._stop_at_once = True

        def nothing(_number: int, _frame: object) -> None:
            pass

        # First, so that no signal falls between the handlers before and these.
        wakeup = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
        self._selector.register(reader, selectors.EVENT_READ, on_signal)
        before = signal.signal(signal.SIGCHLD, nothing)
        for number in _STOP_SIGNALS:
            signal.signal(number, nothing)
        try:
            yield
        finally:
            signal.set_wakeup_fd(wakeup)
            for number in _STOP_SIGNALS:
                signal.signal(number, signal.SIG_IGN)
            signal.signal(signal.SIGCHLD, before)
            reader.close()
            writer.close()


def describe_exit(code: int) -> str:
    """Return an exit code in words, e.g. `killed by SIGKILL` or `exit code 1`."""
    if code < 0:
        try:
            return f'killed by {signal.Signals(-code).name}'
        except ValueError:
            return f'killed by signal {-code}'
    return f'exit code {code}'


def _has_ended(process: subprocess.Popen[bytes]) -> bool:
    """Tell whether a child is dead; it is not reaped, so that its group's number stays taken."""
    options = os.WEXITED | os.WNOHANG | os.WNOWAIT
    return os.waitid(os.P_PID, process.pid, options) is not None


def _send(process: subprocess.Popen[bytes], number: int) -> None:
    """Send a signal to a process that is not reaped: `Popen.send_signal` would reap a dead one."""
    with contextlib.suppress(PermissionError):
        os.kill(process.pid, number)


def _kill_group(group: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)
