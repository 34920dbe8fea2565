"""Python processes that work for this one, and end with it."""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

#: Frames of the parent come first: a tenth longer where these take all processors.
NICENESS = 12
#: Names of programs that run Python; another one would start an application again.
_INTERPRETERS = 'python', 'pypy', 'pvpython', 'vtkpython'
_STDERR_BYTES = 2000  # of a child that died, from its end
# Ctrl+C is for the parent, which decides. Not a session of its own: Linux shares processors out by
# session first, and then a child takes half of them, however nice it is.
_SETUP = 'import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); sys.path[:] = {!r}'
_PROGRAM = 'from {} import main; main()'


def can_start() -> bool:
    """Return True if another Python can be started here."""
    name = Path(sys.executable or '').name.lower()
    is_python = name.startswith(_INTERPRETERS) and not getattr(sys, 'frozen', False)
    return is_python and sys.platform != 'emscripten'


class ChildProcess:
    """A process that runs ``main`` of a module, with pipes to and from it."""

    def __init__(self, module: str):
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `end`
        program = f'{_SETUP.format(sys.path)}; {_PROGRAM.format(module)}'
        try:
            self._process = subprocess.Popen(
                [sys.executable, '-c', program],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._stderr,
                creationflags=getattr(subprocess, 'CREATE_NO_WINDOW', 0),
            )
        except OSError:
            self._stderr.close()
            raise
        #: Pipes of bytes.
        self.stdin: Any = self._process.stdin
        self.stdout: Any = self._process.stdout
        self.poll, self.wait = self._process.poll, self._process.wait

    def ask(self, question) -> Any:
        """Return what it answers, by `send`; raise a RuntimeError with its last words."""
        try:
            send(question, self.stdin)
        except (OSError, ValueError) as error:
            raise RuntimeError(self.last_words()) from error
        return self.answer()

    def answer(self) -> Any:
        """Return what it sends next; raise a RuntimeError with its last words."""
        try:
            return pickle.load(self.stdout)  # noqa: S301 - from a child of ours
        except (OSError, EOFError, ValueError, pickle.UnpicklingError) as error:
            raise RuntimeError(self.last_words()) from error

    def last_words(self) -> str:
        """Return how it ended, and the last line that it wrote about it."""
        status = self._process.wait()
        with contextlib.suppress(OSError, ValueError):
            self._stderr.seek(-min(_STDERR_BYTES, self._stderr.seek(0, os.SEEK_END)), os.SEEK_END)
            lines = self._stderr.read().decode('utf-8', 'replace').strip().splitlines()
            if lines:
                return f'the process ended with status {status}: {lines[-1]}'
        return f'the process ended with status {status}'

    def end(self):
        """End it, whatever it does."""
        with contextlib.suppress(OSError):
            self._process.kill()
        self._process.wait()
        for stream in (self.stdin, self.stdout, self._stderr):
            with contextlib.suppress(OSError):
                stream.close()


def send(value, pipe):
    """Write a value to a pipe of bytes."""
    pickle.dump(value, pipe, pickle.HIGHEST_PROTOCOL)
    pipe.flush()


def pipes_of_child(niceness=0):
    """Return where a child reads and writes bytes; what libraries print goes to its errors."""
    output = os.fdopen(os.dup(1), 'wb')
    os.dup2(2, 1)
    if hasattr(os, 'nice'):
        os.nice(niceness)
    return sys.stdin.buffer, output


def end_with_parent():
    """Let this process end when its parent does, which closes the pipe to it."""

    def wait():
        os.read(0, 1)
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
