"""Damage real files of every format, and read them: an error that names them, or a right result.

``python -m tests.stress.fuzz --seconds N --seed S`` damages files for a time, and says how to go
on; ``--only NAME --start K --cases 1`` repeats one case. Each child process reads many files: one
that crashes, hangs or needs a gigabyte ends it, and is named.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import secrets
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import vtk

from pvibr.core.errors import PvibrError
from tests.photos.test_broken_cameras import broken
from tests.stress.readers import FORGERS, SOURCES

#: Seconds of processor time and bytes that reading a small file may take; where it is ended.
SECONDS, BYTES, HANGS = 3.0, 2**30, 30
#: Cases that a child reads.
CHUNK = 40
FINE = 'read', 'refused'


def read_case(name, folder, files, seed, case) -> str:
    """Damage one of the files of a source, read it, and return what came of it."""
    rng = random.Random(f'{seed} {name} {case}')
    file = rng.choice(files)
    whole = file.read_bytes()
    if name in FORGERS:
        FORGERS[name](rng, file)
    else:
        for _ in range(rng.choice([1, 1, 2])):
            file.write_bytes(broken(file.read_bytes() or b' ', rng))
    start = time.process_time()
    try:
        verdict = outcome(SOURCES[name].read, folder, files)
    finally:
        if file.exists() or name == 'cache':  # a cache removes what is damaged
            file.write_bytes(whole)
    seconds = time.process_time() - start
    return verdict if seconds < SECONDS else f'slow: {seconds:.1f} s, {verdict}'


def outcome(read, folder, files) -> str:
    """Return whether the files of a folder are read, or refused with a name, or what else."""
    try:
        read(folder)
    except (ValueError, TypeError, OSError, PvibrError) as error:
        named = any(part in str(error) for part in (str(folder), *(file.name for file in files)))
        return 'refused' if named else f'nameless: {type(error).__name__}: {error}'
    except BaseException as error:
        return f'wrong: {type(error).__name__}: {error}'
    return 'read'


def guard(folder):
    """Let no file outside of the folder be opened but those of programs."""
    allowed = (str(folder), sys.prefix, sys.base_prefix, '/proc', '/sys', '/dev', '/usr', '/etc')
    allowed += (os.getcwd(), str(Path(__file__).parents[2]))

    def check(event, arguments):
        if event == 'open' and isinstance(arguments[0], str):
            path = os.path.realpath(arguments[0])
            if not path.startswith(tuple(map(os.path.realpath, allowed))):
                raise AssertionError(f'{path} is opened, outside of its folder')
            if path == '/etc/passwd':
                raise AssertionError('a name in the file led to /etc/passwd')

    sys.addaudithook(check)


def child(name, seed, cases, out):
    """Read cases, and write a line of each to a pipe."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    vtk.vtkObject.GlobalWarningDisplayOff()
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path, 'project')
        folder.mkdir()
        files = SOURCES[name].write(folder)
        SOURCES[name].read(folder)
        guard(path)
        size = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + BYTES, size + BYTES))
        for case in cases:
            os.write(out, f'{case} begun\n'.encode())
            signal.alarm(HANGS)
            verdict = read_case(name, folder, files, seed, case)
            signal.alarm(0)
            text = ' '.join(verdict.split())[:400]
            os.write(out, f'{case} {text}\n'.encode())


def in_child(name, seed, cases) -> dict[int, str]:
    """Return what came of cases that a child process read, to the one that ended it."""
    ours, theirs = os.pipe()
    pid = os.fork()
    if not pid:
        os.close(ours)
        try:
            child(name, seed, cases, theirs)
        except BaseException as error:
            os.write(theirs, f'{cases[0]} wrong: of the fuzz itself: {error!r}\n'.encode())
        os._exit(0)
    os.close(theirs)
    with os.fdopen(ours, encoding='utf-8', errors='replace') as lines:
        found = {int(k): verdict for k, verdict in (line.strip().split(' ', 1) for line in lines)}
    _, status = os.waitpid(pid, 0)
    if os.WIFSIGNALED(status):
        last = max(found, default=cases[0])
        found[last] = f'ended by {signal.Signals(os.WTERMSIG(status)).name}'
    return found


def fuzz(seed, names, start, *, seconds=None, count=None):
    """Yield name, case and verdict of all, in turns, until a time or a number is reached."""
    begun, case = time.monotonic(), start
    while count is None or case < start + count:
        end = case + min(CHUNK, count or CHUNK)
        for name in names:
            at = case
            while at < end:
                if seconds is not None and time.monotonic() - begun > seconds:
                    return
                found = in_child(name, seed, range(at, end))
                yield from ((name, k, verdict) for k, verdict in found.items())
                at = max(found, default=at) + 1
        case = end


def say(line):
    """Write a line at once."""
    sys.stdout.write(f'{line}\n')
    sys.stdout.flush()


def main(arguments=None) -> int:
    """Fuzz, print what is found, and return how many findings there are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float)
    parser.add_argument('--cases', type=int, help='of each format, in place of a time')
    parser.add_argument('--seed', default=secrets.token_hex(4))
    parser.add_argument('--start', type=int, default=0)
    parser.add_argument('--only', action='append', choices=[*SOURCES])
    asked = parser.parse_args(arguments)
    if asked.seconds is None and asked.cases is None:
        asked.cases = CHUNK
    names = asked.only or [*SOURCES]
    say(f'seed {asked.seed}, from case {asked.start}')
    counts, last = Counter(), asked.start
    extent = {'seconds': asked.seconds, 'count': asked.cases}
    for name, case, verdict in fuzz(asked.seed, names, asked.start, **extent):
        counts[verdict if verdict in FINE else 'found'] += 1
        last = max(last, case)
        if verdict not in FINE:
            say(f'{name}, case {case}: {verdict}')
    say(f'{counts.total()} cases: {dict(counts)}; go on with --seed {asked.seed} --start {last}')
    return counts['found']


if __name__ == '__main__':
    sys.exit(min(main(), 1))
