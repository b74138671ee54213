"""What the machine offers: wheels for its processor, an installed ROS 2, compiler and headers.

Looks before anything is changed, so that a set-up either goes through or ends at once with the one
command that is missing.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from pathlib import Path

from launcher.progress import Output, SetUpStep
from surveillance_runtime.launch_protocol import NotNowError

ROS_PREFIX = Path('/opt/ros/jazzy')
WHEEL_PYTHONS = ((3, 11), (3, 12), (3, 13))

COLCON_STEPS = """\
  mkdir -p ~/surveillance_ws/src && ln -s {checkout} ~/surveillance_ws/src/surveillance
  cd ~/surveillance_ws && source /opt/ros/jazzy/setup.bash
  colcon build && source install/setup.bash
  ros2 launch surveillance_behaviour surveillance.launch.py"""


def why_no_wheels(name: str, processor: str, libc: str, python: tuple[int, int]) -> str:
    """Return why the ROS wheels do not fit a machine, empty when they do.

    Args:
        name, processor, libc: As `platform` has them.
        python: Version of the interpreter.
    """
    if name != 'Linux' or processor not in ('x86_64', 'AMD64'):
        return f'there are no ROS 2 wheels for {name} on {processor}'
    if libc != 'glibc':
        return 'the ROS 2 wheels need glibc, which this Linux does not use'
    if python not in WHEEL_PYTHONS:
        return (
            f'there are no ROS 2 wheels for Python {python[0]}.{python[1]}: '
            'run launch.py with Python 3.11, 3.12 or 3.13'
        )
    return ''


def sourced_ros(environ: Mapping[str, str] | None = None) -> bool:
    """Tell whether a ROS 2 Jazzy is active in this shell."""
    environ = os.environ if environ is None else environ
    return environ.get('ROS_DISTRO') == 'jazzy' and bool(environ.get('AMENT_PREFIX_PATH'))


def sourced_workspace() -> bool:
    """Tell whether this very interpreter imports ROS and the compiled interfaces already."""
    # The folders of the checkout look like packages without a file to load: those do not count.
    specs = [
        importlib.util.find_spec(name)
        for name in ('rclpy', 'surveillance_interfaces', 'surveillance_behaviour')
    ]
    return all(spec is not None and spec.origin is not None for spec in specs)


def note_of_unused_ros(checkout: Path, ros_prefix: Path = ROS_PREFIX) -> str:
    """Say, where a ROS is installed but not active, how to use it; empty where none is."""
    if not ros_prefix.exists():
        return ''
    return (
        f'ROS 2 Jazzy is installed in {ros_prefix}, but not active in this shell: this set-up '
        f'brings its own. To use the installed one:\n{colcon_advice(checkout)}'
    )


def colcon_advice(checkout: Path) -> str:
    """Return the commands that build and run the project on an installed ROS 2 Jazzy."""
    return COLCON_STEPS.format(checkout=checkout)


def no_wheels_advice(reason: str, checkout: Path, ros_prefix: Path = ROS_PREFIX) -> str:
    """Return what to do on a machine that the wheels do not fit."""
    if ros_prefix.exists():
        return f'{reason}, but ROS 2 Jazzy is installed. Build with it:\n{colcon_advice(checkout)}'
    return (
        f'{reason}, and no ROS 2 Jazzy is installed.\nInstall ROS 2 Jazzy '
        '(Ubuntu 24.04: https://docs.ros.org/en/jazzy/Installation.html; macOS and others: '
        'https://robostack.github.io), then:\n' + colcon_advice(checkout)
    )


def missing_packages() -> list[str]:
    """Return the Debian packages without which the set-up would fail half-way."""
    major, minor = sys.version_info[:2]
    versioned = f'python{major}.{minor}'
    system_python = Path('/usr/bin/python3')
    if system_python.exists() and system_python.resolve().name == versioned:
        versioned = 'python3'
    missing = []
    if importlib.util.find_spec('venv') is None or importlib.util.find_spec('ensurepip') is None:
        missing.append(f'{versioned}-venv')
    if not Path(sysconfig.get_config_var('INCLUDEPY'), 'Python.h').exists():
        missing.append(f'{versioned}-dev')
    if not any(shutil.which(compiler) for compiler in ('g++', 'c++', 'clang++')):
        missing.append('g++')
    return missing


def install_packages(packages: Sequence[str]) -> None:
    """Installs Debian packages with apt, where that needs no password.

    Raises:
        ValueError: There is no apt, or no right to use it.
        NotNowError: It failed, as without network, or where another one runs.
    """
    names = ' '.join(packages)
    if shutil.which('apt-get') is None:
        raise ValueError(
            f'this machine lacks what Debian calls {names}: install them with its package manager '
            '(a C++ compiler, the headers of Python, its venv module), then start again'
        )
    prefix = _privilege()
    if prefix is None:
        raise ValueError(
            'a few system packages are missing. Type this, then start again:\n'
            f'  {_as_root(packages)}'
        )
    environ = {**os.environ, 'DEBIAN_FRONTEND': 'noninteractive'}
    commands = (['update'], ['install', '-y', '--no-install-recommends', *packages])
    for number, command in enumerate(commands, 1):
        title = f'system packages: {names}' if command[0] == 'install' else 'lists of packages'
        with (
            SetUpStep(number, len(commands), title) as step,
            subprocess.Popen(
                [*prefix, 'apt-get', '-q', *command],
                env=environ,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            ) as process,
        ):
            output = list(Output(process).lines(step))
        # A repository that does not answer is no reason to stop: the packages may come from others.
        if process.returncode != 0 and command[0] == 'install':
            tail = '\n'.join(output[-4:])
            raise NotNowError(
                f'apt-get could not install {names}:\n{tail}\nInstall them, then start again:\n'
                f'  {_as_root(packages)}'
            )
    # Modules looked for before they were installed are remembered as absent.
    importlib.invalidate_caches()


def _as_root(packages: Sequence[str]) -> str:
    """Return what a person types to install packages."""
    # The lists of packages of a machine just set up are empty.
    command = f'apt-get update && apt-get install -y {" ".join(packages)}'
    return f"sudo sh -c '{command}'" if shutil.which('sudo') else f"su -c '{command}'"


def _privilege() -> list[str] | None:
    """Return what to write before apt-get: nothing for root, sudo when it asks no password, else
    None.
    """
    if os.geteuid() == 0:
        return []
    if shutil.which('sudo') is not None:
        answer = subprocess.run(
            ['sudo', '-n', 'true'],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        )
        if answer.returncode == 0:
            return ['sudo', '-n', 'env', 'DEBIAN_FRONTEND=noninteractive']
    return None
