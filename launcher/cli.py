"""The command line of `launch.py`."""

from __future__ import annotations

import argparse
import errno
import importlib
import importlib.metadata
import io
import json
import os
import signal
import sys
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

from launcher import completion, interrupt, package_commands, system
from launcher.environment import (
    CHECKOUT,
    COMMAND,
    INSTALLED,
    PROGRAM,
    PythonEnvironment,
    clean_environ,
    compile_interfaces,
    keep_bytecode,
)
from launcher.instance_lock import claim
from launcher.run import Run, make_parser, shared_options, wanted_run
from strict_files.files import in_one_line, replace_text
from strict_files.suggestions import nearest
from surveillance_runtime import node_table
from surveillance_runtime.command_line import EXIT_BAD_INPUT, CommandParser
from surveillance_runtime.launch_protocol import NotNowError


def runs_folder(checkout: Path = CHECKOUT) -> Path:
    """Return where runs leave what they write: in the checkout, or the user's own of a read-only
    one.
    """
    if not INSTALLED and os.access(checkout, os.W_OK):
        return checkout / 'runs'
    state = os.environ.get('XDG_STATE_HOME') or os.path.expanduser('~/.local/state')
    return Path(state, 'surveillance', 'runs')


CONFIG = CHECKOUT / 'config'
WITH = ('nav2', 'mujoco', 'notify')
"""Groups of optional dependencies that a user may ask for."""
RUNS = runs_folder()
EXIT_INTERRUPTED = 130

_TEST_HELP = """\
usage: launch.py test [pytest arguments]

Runs the whole test suite on five processes. Further words go to pytest:
  python3 launch.py test libs/state_machines/tests -k preempt
  python3 launch.py test -n 0 -x tests/launcher
All that pytest takes: .venv/bin/python -m pytest --help"""


def entry() -> int:
    """Run the command `surveillance` of an installed wheel."""
    return main(sys.argv[1:])


def main(argv: Sequence[str]) -> int:
    """Run one command and return its exit code."""
    # A set-up that is told to end has to take its compilers along.
    _make_streams_safe()
    try:
        interrupt.raise_at_stop_signals()
        try:
            return _dispatch(list(argv))
        except Exception:
            interrupt.raise_if_lost()
            raise
    except ValueError as error:
        print(f'{PROGRAM}: {error}', file=sys.stderr)
        return os.EX_TEMPFAIL if isinstance(error, NotNowError) else EXIT_BAD_INPUT
    except BrokenPipeError:  # as when the output goes to `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:  # a full disk, a folder that is not ours
        print(f'{PROGRAM}: {in_one_line(error)}', file=sys.stderr)
        return os.EX_TEMPFAIL
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # one is enough
        ready = INSTALLED or PythonEnvironment(CHECKOUT).ready()
        more = '' if ready else '; the next start continues the set-up'
        print(f'\n{PROGRAM}: interrupted{more}', file=sys.stderr)
        return EXIT_INTERRUPTED


def _make_streams_safe() -> None:
    """Let output be closed, and the terminal's encoding lack a character."""
    for name in ('stdout', 'stderr'):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, 'w'))  # noqa: SIM115 - for the process's life
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='replace')


def _dispatch(argv: list[str]) -> int:
    if argv in (['--version'], ['-V'], ['version']):
        print(f'{PROGRAM} {version()}')
        return 0
    if argv[:1] == ['help']:
        argv = [*argv[1:2], '--help']
    commands: dict[str, Callable[[list[str]], int]] = {
        'run': _run,
        'explore': _explore,
        'node': _node,
        'list': _list,
        'params': _params,
        'service': _service,
        'completion': _completion,
        'setup': _setup,
        'lock': _lock,
        'test': _test,
        'lint': _lint,
    }
    if argv and argv[0] in ('setup', 'lock', 'test', 'lint') and INSTALLED:
        raise ValueError(f'{argv[0]!r} works in a checkout only: this is an installed {PROGRAM}')
    if argv and argv[0] in commands:
        return commands[argv[0]](argv[1:])
    if argv and argv[0] in package_commands.COMMANDS:
        return _package_command(argv[0], argv[1:])
    if argv and not argv[0].startswith('-'):
        known = nearest(argv[0], (*commands, *package_commands.COMMANDS))
        raise ValueError(f'unknown command {argv[0]!r}: expected {known}')
    return _run(argv)


def version(checkout: Path = CHECKOUT) -> str:
    """Return the version of this program."""
    if INSTALLED:
        return importlib.metadata.version('surveillance')
    with open(checkout / 'pyproject.toml', 'rb') as file:
        return str(tomllib.load(file)['project']['version'])


def _completion(argv: list[str]) -> int:
    parser = CommandParser(
        prog=f'{PROGRAM} completion',
        description='Prints what a shell reads to complete commands and options: '
        f'eval "$({" ".join(COMMAND)} completion bash)"',
    )
    parser.add_argument('shell', choices=completion.SHELLS)
    shell = parser.parse_args(argv).shell
    options = {
        name: completion.options_in(package_commands.help_of(name))
        for name in package_commands.COMMANDS
    }
    own = completion.options_in(make_parser().format_help())
    options |= {'run': own, 'service': [*own, '--print'], '': [*own, '--version']}
    options |= {
        'list': ['--json'],
        'params': ['--json', '--write'],
        'setup': ['--wheels', '--collect'],
    }
    options |= dict.fromkeys(('explore', 'node', 'help'), own) | {
        'completion': [],
        'test': [],
        'lint': [],
    }
    print(completion.script(shell, PROGRAM, options), end='')
    return 0


def _run(argv: list[str]) -> int:
    options = make_parser().parse_args(argv)
    if options.robots is None and options.place is None:
        node_table.select('RANDOM', only=options.only, without=options.without)
    _enter(['run', *argv])
    from launcher.run_folder import resumed
    from launcher.run_mission import run_mission

    run, folder = wanted_run(options), None
    if options.resume is not None:
        usual = wanted_run(make_parser().parse_args([]))
        run, folder = resumed(run, usual, RUNS, options.resume)
    interrupt.raise_if_lost()
    return run_mission(run, CONFIG, RUNS, folder)


def _explore(argv: list[str]) -> int:
    from launcher import explore

    options = explore.options_of(argv)
    _enter(['explore', *argv])
    interrupt.raise_if_lost()
    return explore.run_exploration(options, CONFIG, RUNS)


def _node(argv: list[str]) -> int:
    parser = CommandParser(
        prog=f'{PROGRAM} node',
        usage='%(prog)s [options] NAME [--ros-args ...]',
        description='Runs one node in this terminal with the parameters of config/.',
        parents=[shared_options()],
    )
    parser.add_argument('name', metavar='NAME', help=f'see {PROGRAM} list')
    parser.add_argument(
        '--ros-args',
        dest='rest',
        nargs=argparse.REMAINDER,
        help='to the end of the line, as with ros2 run: -p PARAMETER:=VALUE, -r FROM:=TO, '
        '--params-file FILE',
    )
    at = argv.index('--ros-args') if '--ros-args' in argv else len(argv)
    options, rest = parser.parse_args(argv[:at]), argv[at:]
    node = node_table.find(options.name)
    _enter(['node', *argv])
    from launcher import run_configuration, run_processes
    from surveillance_runtime.configuration import split_arguments
    from surveillance_runtime.profile import remappings
    from surveillance_runtime.run_parameters import full_name

    run = wanted_run(options)
    given = split_arguments(rest)
    run, profile = run_configuration.with_profile(run, CONFIG)
    merged = run_configuration.configuration(CONFIG, run, more=given)
    run_configuration.check_assignments(merged, [node])
    renamed = any('__ns:=' in word or '__node:=' in word for word in rest)
    name = given.full_name(node.name) if renamed else full_name(run.namespace, node.name)
    file = run_configuration.parameters_in_memory(name, merged.resolve(node.name, name))
    whole = [each.name for each in run.nodes(monitored=profile.is_monitored)]
    mode = run.mode or node_table.DEFAULT_MODE
    arguments = run_processes.ros_arguments([file], run, remappings(profile, whole, mode))
    arguments += [word for word in given.rest if word not in ('--ros-args', '--')]
    if not renamed:
        for descriptor in claim([node], run_processes.ros_domain(run), run.namespace):
            os.set_inheritable(descriptor, True)
    words = run_processes.command([node], arguments, 0)
    interrupt.hold_back()
    os.execve(words[0], words, run_processes.node_environ(run))


def _list(argv: list[str]) -> int:
    parser = CommandParser(prog=f'{PROGRAM} list', description='Lists the nodes.')
    parser.add_argument('--json', action='store_true', help='for programs')
    if parser.parse_args(argv).json:
        nodes = node_table.NODES
        print(
            json.dumps(
                [{'name': e.name, 'package': e.package, 'purpose': e.purpose} for e in nodes]
            )
        )
        return 0
    width = max(len(node.name) for node in node_table.NODES)
    for package in dict.fromkeys(node.package for node in node_table.NODES):
        print(package)
        for node in node_table.NODES:
            if node.package == package:
                print(f'  {node.name:<{width}}  {node.purpose}')
    return 0


def _params(argv: list[str]) -> int:
    parser = CommandParser(
        prog=f'{PROGRAM} params',
        usage='%(prog)s [options] [NODE]',
        description='Prints the value of each parameter and where it comes from.',
        parents=[shared_options()],
    )
    parser.add_argument('name', nargs='?', metavar='NODE', help='only of this node')
    parser.add_argument(
        '--write', action='store_true', help='write the schema, reference pages and help texts'
    )
    parser.add_argument('--json', action='store_true', help='for programs')
    options = parser.parse_args(argv)
    chosen = [node_table.find(options.name)] if options.name else list(node_table.NODES)
    _enter(['params', *argv])
    from launcher import reference_tables, run_configuration

    if options.write:
        for path in reference_tables.write(CHECKOUT):
            print(f'written: {path}')
        return 0
    run = wanted_run(options)
    merged = run_configuration.configuration(CONFIG, run)
    run_configuration.check_assignments(merged, chosen)
    namespace = (run.namespace or '').strip('/')
    tell = reference_tables.show_json if options.json else reference_tables.show
    tell(merged, chosen, f'/{namespace}' if namespace else '', print)
    return 0


def _service(argv: list[str]) -> int:
    from launcher import service

    parser = CommandParser(
        prog=f'{PROGRAM} service',
        usage='%(prog)s [--print] [options of run]',
        description='Writes a systemd user unit that keeps the robot running.',
        parents=[make_parser(help_too=False)],
    )
    parser.add_argument('--print', action='store_true', help='print the unit and write nothing')
    options = parser.parse_args(argv)
    words = [word for word in argv if word != '--print']
    # All nodes at their limit would be more than most machines have.
    text = service.unit_text(CHECKOUT, words, 4 * (options.memory or Run.memory))
    if options.print:
        print(text, end='')
        return 0
    path = service.unit_path()
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_text(path, text)
    print(f'written: {path}')
    print(f'start it: systemctl --user daemon-reload && systemctl --user enable --now {path.name}')
    print('to run it without a login: loginctl enable-linger')
    return 0


def _lock(argv: list[str]) -> int:
    CommandParser(
        prog=f'{PROGRAM} lock',
        description='Writes the lock file of this Python and machine anew: the newest packages '
        'that pyproject.toml allows, each by its hash.',
    ).parse_args(argv)
    print(f'written: {PythonEnvironment(CHECKOUT).write_lock()}')
    return 0


def _setup(argv: list[str]) -> int:
    parser = CommandParser(
        prog=f'{PROGRAM} setup', description='Sets up .venv for the other commands.'
    )
    either = parser.add_mutually_exclusive_group()
    either.add_argument(
        '--wheels', type=Path, metavar='DIR', help='install from this folder, without internet'
    )
    either.add_argument(
        '--collect', type=Path, metavar='DIR', help='fill a folder for --wheels, then end'
    )
    parser.add_argument(
        '--with',
        dest='extras',
        action='append',
        default=[],
        choices=WITH,
        metavar='|'.join(WITH),
        help='also set up: nav2 (messages of Nav2), mujoco (physics for the simulated robot), '
        'notify (news by MQTT)',
    )
    options = parser.parse_args(argv)
    environment = _environment(options.extras, options.wheels)
    if environment is not None and options.collect is not None:
        environment.collect(options.collect)
        print(f'collected in {options.collect}: python3 launch.py setup --wheels DIR')
    elif environment is not None:
        environment.prepare()
        print(f'ready: {environment.python}')
    return 0


def _test(argv: list[str]) -> int:
    if argv in (['-h'], ['--help']):
        print(_TEST_HELP)
        return 0
    for path in (word.partition('::')[0] for word in argv if word.startswith(('tests/', 'libs/'))):
        # Spread over processes, pytest does not say which file it lacks.
        if not (CHECKOUT / path).exists():
            missing = FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), CHECKOUT / path)
            raise ValueError(in_one_line(missing))
    _enter(['test', *argv], extras=('test',))
    spread = any(a.startswith(('-n', '--numprocesses', '--pdb')) or 'no:xdist' in a for a in argv)
    # On two cores five take a sixth less time than three: many tests wait for other processes.
    words = [] if spread else ['-n', '5', '--dist', 'loadfile', '--no-loadscope-reorder']
    os.chdir(CHECKOUT)
    # Its one plugin, that of trio, which selenium brings, imports that into each process.
    os.environ['HYPOTHESIS_NO_PLUGINS'] = '1'
    sys.stdout.flush()
    return os.execv(sys.executable, [sys.executable, '-m', 'pytest', *words, *argv])


def _lint(argv: list[str]) -> int:
    CommandParser(
        prog=f'{PROGRAM} lint', description='Runs ruff check, ruff format --check and mypy.'
    ).parse_args(argv)
    _enter(['lint'], extras=('test', 'lint'))
    import subprocess

    tests = ['mypy', '--config-file', 'tests/mypy.ini']
    # Each library's tests are modules of the same names: they are checked by themselves, with a
    # cache that does not know the names by which the robot's tests import them.
    libraries = [
        [
            str(each.relative_to(CHECKOUT) / part)
            for part in ('tests', 'examples')
            if (each / part).is_dir()
        ]
        for each in sorted((CHECKOUT / 'libs').iterdir())
    ]
    examples = _readme_examples(CHECKOUT / '.mypy_cache' / 'readmes')
    code = 0
    for words in (
        ['ruff', 'check'],
        ['ruff', 'format', '--check'],
        ['mypy'],
        [*tests, 'tests', 'benchmarks', 'examples', 'docs'],
        *([*tests, '--cache-dir', '.mypy_cache/libs', *folders] for folders in libraries),
        [*tests, '--strict', '--cache-dir', '.mypy_cache/libs', *examples],
    ):
        print('+', *words, flush=True)
        done = subprocess.run([sys.executable, '-m', *words], cwd=CHECKOUT, check=False)
        code = code or done.returncode
    return code


def _readme_examples(folder: Path) -> list[str]:
    """Write the example of each library's README as a module; return their paths."""
    import re

    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for readme in sorted(CHECKOUT.glob('libs/*/README.md')):
        blocks = re.findall(r'```python\n(.*?)```', readme.read_text(encoding='utf-8'), re.DOTALL)
        path = folder / f'{readme.parent.name}_example.py'
        path.write_text('\n'.join(blocks), encoding='utf-8')
        written.append(str(path.relative_to(CHECKOUT)))
    return written


def _package_command(name: str, argv: list[str]) -> int:
    if argv in (['-h'], ['--help']) and (said := package_commands.help_of(name)):
        print(said, end='')
        return 0
    _enter([name, *argv])
    carry_out = package_commands.main_of(name)
    interrupt.raise_if_lost()
    return carry_out(argv)


def _environment(extras: Sequence[str], wheels: Path | None = None) -> PythonEnvironment | None:
    """Return the environment to run in; None where an installed ROS with this workspace is
    active.
    """
    if system.sourced_ros():
        if system.sourced_workspace():
            return None
        raise ValueError(
            'ROS 2 Jazzy is active in this shell, but this workspace is not built. Build it:\n'
            f'{system.colcon_advice(CHECKOUT)}\nor use a shell without ROS.'
        )
    return PythonEnvironment(CHECKOUT, extras, wheels)


def _enter(argv: list[str], extras: Sequence[str] = ()) -> None:
    """Set the project's environment up, and go on as a process of it."""
    if INSTALLED:
        compile_interfaces()
        importlib.invalidate_caches()
        return
    keep_bytecode(os.environ)
    environment = _environment(extras)
    if environment is None:
        return
    environment.prepare()
    for line in environment.drop_missing_middleware(os.environ):
        print(f'{PROGRAM}: {line}', file=sys.stderr)
    if not environment.active():
        words = [str(environment.python), str(CHECKOUT / 'launch.py'), *argv]
        interrupt.hold_back()
        os.execve(words[0], words, clean_environ())
