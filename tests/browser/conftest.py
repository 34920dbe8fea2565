"""Pages in Chromium; they fail their test where they say an error."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace
from urllib.parse import urlsplit

import imageio.v3 as imageio
import pytest

FLAGS = [
    '--headless',
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
    # With it, a tab that is closed as its page arrives is never closed (crbug.com/536385539), and
    # Playwright 1.62 and later wait for that without end.
    '--disable-features=RenderDocument',
]


@pytest.fixture(scope='module')  # no longer: while it runs, its thread has a loop of asyncio
def chromium():
    """Debian's Chromium, driven by Playwright."""
    path = shutil.which('chromium') or shutil.which('chromium-browser')
    if path is None:
        pytest.skip('needs Chromium: apt-get install chromium')
    playwright = pytest.importorskip('playwright.sync_api', reason='needs playwright')
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def quiet():
    """Patterns of what pages say that is not their fault; tests add to it."""
    return []


@pytest.fixture
def said():
    """The errors that pages said."""
    return []


@pytest.fixture
def page(chromium, quiet, said):
    """A page; `page.context.new_page()` makes one more that is watched as well."""

    def hear(message):
        # What browsers ask for by themselves may meet a server that is closing.
        if message.type == 'error' and not str(message.location).count('favicon.ico'):
            said.append(f'{message.text} {message.location}')

    context = chromium.new_context(viewport={'width': 800, 'height': 600})
    context.on('console', hear)
    context.on('weberror', lambda e: said.append(str(e.error)))
    # An error that is an object says nothing of itself.
    context.add_init_script(
        "addEventListener('unhandledrejection', e => console.error(JSON.stringify(e.reason)))"
    )
    made = context.new_page()
    made.set_default_timeout(60_000)
    yield made
    context.close()
    errors = [text for text in said if not any(re.search(p, text) for p in quiet)]
    assert not errors, '\n'.join(errors)


@pytest.fixture(scope='session')
def picture_of():
    """A function: the pixels of a page or an element, (height, width, 3) uint8."""

    def take(part):
        return imageio.imread(io.BytesIO(part.screenshot()))[..., :3]

    return take


@pytest.fixture(scope='session')
def until():
    """A function: wait until another one returns something true, and return that."""

    def wait(true, seconds=60.0, every=0.05):
        end = time.monotonic() + seconds
        while not (found := true()):
            assert time.monotonic() < end, f'not within {seconds} s'
            time.sleep(every)
        return found

    return wait


class _Program:
    """A program that serves pages, and what it says."""

    def __init__(self, log, command, environment, own):
        self._log, self._own = log, own
        with log.open('w') as out:
            self._process = subprocess.Popen(
                [sys.executable, *command], stdout=out, stderr=subprocess.STDOUT, env=environment
            )

    @property
    def said(self) -> str:
        return self._log.read_text()

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None

    @property
    def url(self) -> str:
        """Where its page is, once it says so."""
        found = re.search(r'http://(localhost|127[.]0[.]0[.]1):\d+/\S*', self.said)
        assert found or not self.ended, self.said
        return found[0] if found else ''

    def close(self):
        """End it as Ctrl+C does; nothing must stay, and ours must have said no error."""
        port = urlsplit(self.url).port
        self._process.send_signal(signal.SIGINT)
        self._wait(60 if self._own else 10)
        if self._own and not self.ended:
            self._process.send_signal(signal.SIGABRT)  # it says where it waits
            self._wait(5)
        self._process.kill()
        self._process.wait()
        if self._own:
            assert self._process.returncode == 0, self.said
            assert not re.search(r'Traceback|Error|ERR[|]|Warning', self.said), self.said
        with socket.socket() as free:
            assert free.connect_ex(('127.0.0.1', port))

    def _wait(self, seconds):
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)


@pytest.fixture(scope='module')
def cache(tmp_path_factory):
    """A folder of what is baked, for these tests and the programs that they start."""
    folder = tmp_path_factory.mktemp('cache')
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('PVIBR_CACHE', str(folder))
        yield folder


@pytest.fixture(scope='module')
def start(tmp_path_factory, until, cache):
    """A function: start a Python program with arguments, once its page can be opened.

    One that is not our ``own`` may hang or complain when it is interrupted.
    """
    folder = tmp_path_factory.mktemp('programs')
    started = []

    def begin(*command, own=True):
        environment = os.environ | {
            'PVIBR_CACHE': str(cache),
            'PYTHONUNBUFFERED': '1',
            'PYTHONFAULTHANDLER': '1',
        }
        program = _Program(folder / f'{len(started)}.log', command, environment, own)
        started.append(program)
        until(lambda: program.url, 120)
        return program

    yield begin
    for program in started:
        program.close()


class _Files(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def do_GET(self):
        if self.path == '/favicon.ico':
            self.send_response(204)
            self.end_headers()
        else:
            super().do_GET()


@pytest.fixture
def files(tmp_path):
    """A folder of files and the address at which pages find them: ``folder``, ``url``."""
    folder = tmp_path / 'served'
    folder.mkdir()
    with ThreadingHTTPServer(('127.0.0.1', 0), partial(_Files, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield SimpleNamespace(folder=folder, url=f'http://127.0.0.1:{server.server_port}')
        server.shutdown()
        thread.join()
