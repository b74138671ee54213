"""What goes wrong with a machine, for one group of processes only, and with one thread of one.

A small disk that fills up is a tmpfs in this process's own mount namespace; it ends with the
process. A thread that stands is held by a tracer (ptrace(2)). A clock that steps is the real-time
clock of the processes that are started with `SteppedClock.environ`: a library in front of libc's
adds an offset, the machine's own clock stays.
"""

from __future__ import annotations

import contextlib
import ctypes
import mmap
import os
import platform
import shutil
import struct
import subprocess
import sys
from pathlib import Path

CLONE_NEWNS = 0x00020000  # linux/sched.h
_STEPPED = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

static long offset(void) {
  static volatile long *seconds;
  if (!seconds) {
    int file = open(getenv("STEPPED_CLOCK"), O_RDONLY);
    seconds = mmap(0, sizeof(long), PROT_READ, MAP_SHARED, file, 0);
  }
  return *seconds;
}

int clock_gettime(clockid_t clock, struct timespec *at) {
  static int (*real)(clockid_t, struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
  int failed = real(clock, at);
  if (!failed && clock == CLOCK_REALTIME) at->tv_sec += offset();
  return failed;
}

// What a thread waits for on the real-time clock is a time of the stepped one. Times of the other
// clocks are those since the start of the machine: they are small.
static const struct timespec *unstepped(const struct timespec *at, struct timespec *real) {
  if (at->tv_sec < 500000000) return at;
  *real = *at;
  real->tv_sec -= offset();
  return real;
}

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                           const struct timespec *at) {
  static int (*wait)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
  struct timespec real;
  if (!wait) wait = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  return wait(condition, mutex, unstepped(at, &real));
}

int sem_timedwait(sem_t *semaphore, const struct timespec *at) {
  static int (*wait)(sem_t *, const struct timespec *);
  struct timespec real;
  if (!wait) wait = dlsym(RTLD_NEXT, "sem_timedwait");
  return wait(semaphore, unstepped(at, &real));
}

int pthread_mutex_timedlock(pthread_mutex_t *mutex, const struct timespec *at) {
  static int (*lock)(pthread_mutex_t *, const struct timespec *);
  struct timespec real;
  if (!lock) lock = dlsym(RTLD_NEXT, "pthread_mutex_timedlock");
  return lock(mutex, unstepped(at, &real));
}

int gettimeofday(struct timeval *restrict at, void *restrict zone) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  at->tv_sec = now.tv_sec;
  at->tv_usec = now.tv_nsec / 1000;
  return 0;
}

time_t time(time_t *at) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (at) *at = now.tv_sec;
  return now.tv_sec;
}
"""


class SmallDisk:
    """A disk of a few megabytes that can be filled up.

    Args:
        folder: Where it is mounted; made if it is not there.
        megabytes: Its size.
    """

    def __init__(self, folder: Path, megabytes: int) -> None:
        self.folder = folder
        self._filler = folder / 'filler'
        folder.mkdir(exist_ok=True)
        # Of this thread and what it starts from now on.
        if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNS):
            raise OSError(ctypes.get_errno(), 'unshare')
        subprocess.run(['mount', '--make-rprivate', '/'], check=True)
        size = f'size={megabytes}m'
        subprocess.run(['mount', '-t', 'tmpfs', '-o', size, 'tmpfs', str(folder)], check=True)

    @staticmethod
    def may_be_made() -> bool:
        """Tell whether this user may mount."""
        return sys.platform == 'linux' and os.geteuid() == 0

    def fill(self) -> None:
        """Leave no byte free."""
        with contextlib.suppress(OSError), self._filler.open('ab', buffering=0) as file:
            while True:
                file.write(bytes(4096))

    def free(self) -> None:
        """Give the space back."""
        self._filler.unlink(missing_ok=True)


class SteppedClock:
    """A real-time clock that is some seconds off, for the processes with its environment.

    Args:
        folder: Where its library is built.
    """

    def __init__(self, folder: Path) -> None:
        source, library = folder / 'stepped.c', folder / 'stepped.so'
        source.write_text(_STEPPED)
        words = ['cc', '-shared', '-fPIC', '-O1', '-o', str(library), str(source), '-ldl']
        subprocess.run(words, check=True)
        shared = folder / 'offset'
        shared.write_bytes(struct.pack('l', 0))
        with shared.open('r+b') as file:
            self._offset = mmap.mmap(file.fileno(), 0)
        self.environ = {'LD_PRELOAD': str(library), 'STEPPED_CLOCK': str(shared)}
        self.seconds = 0

    @staticmethod
    def may_be_made() -> bool:
        """Tell whether there is a compiler, and the libc that its library is written for."""
        known = sys.platform == 'linux' and platform.machine() == 'x86_64'
        return known and platform.libc_ver()[0] == 'glibc' and shutil.which('cc') is not None

    def step(self, seconds: int) -> None:
        """Set the clock forward, or back."""
        self.seconds += seconds
        self._offset[:] = struct.pack('l', self.seconds)


_TRACER = r"""
import ctypes, os, sys
trace = ctypes.CDLL(None, use_errno=True).ptrace
trace.argtypes, trace.restype = [ctypes.c_long] * 4, ctypes.c_long
threads = [int(each) for each in sys.argv[1:]]
for thread in threads:
    for request in (0x4206, 0x4207):  # PTRACE_SEIZE, PTRACE_INTERRUPT
        if trace(request, thread, 0, 0):
            sys.exit(os.strerror(ctypes.get_errno()))
for thread in threads:
    os.waitpid(thread, 0x40000000)  # __WALL
print('stands', flush=True)
for thread in threads:  # until it is killed: who traces it has to take note of that
    while not (os.WIFEXITED(end := os.waitpid(thread, 0x40000000)[1]) or os.WIFSIGNALED(end)):
        pass
"""


class FrozenThreads:
    """Threads of another process that stand until the process is killed, or this is closed.

    Args:
        pid: The process.
        name: What their names begin with, as the kernel knows them.

    Raises:
        OSError: There is none, or they may not be traced.
    """

    def __init__(self, pid: int, name: str) -> None:
        threads = []
        for thread in os.listdir(f'/proc/{pid}/task'):
            with open(f'/proc/{pid}/task/{thread}/comm', encoding='utf-8') as file:
                if file.read().startswith(name):
                    threads.append(thread)
        words = [sys.executable, '-c', _TRACER, *threads]
        self._tracer = subprocess.Popen(words, stdout=subprocess.PIPE)
        assert self._tracer.stdout is not None
        if not threads or not self._tracer.stdout.readline():
            self.close()
            raise OSError(f'process {pid}: no thread {name}..., or it may not be traced')

    def close(self) -> None:
        """Let them go on."""
        self._tracer.kill()
        self._tracer.wait()
