"""A check of the installation: what renders, what is missing, and how to fix it."""

from __future__ import annotations

import ctypes
import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

TIMEOUT_SECONDS = 120

# A module of each extra, whose presence shows that it is installed.
_EXTRAS = {
    'bench': 'psutil',
    'city': 'cjio',
    'cluster': 'distributed',
    'docs': 'sphinx_gallery',
    'jupyter': 'trame',
    'las': 'laspy',
    'movie': 'imageio_ffmpeg',
    'parquet': 'pyarrow',
    'rays': 'embreex',
    'sun': 'ephem',
    'test': 'pytest',
}

# OpenGL limits by enum, and how to print them.
_LIMITS = {
    0x0D33: '{} px wide textures',  # GL_MAX_TEXTURE_SIZE
    0x88FF: '{} array layers',  # GL_MAX_ARRAY_TEXTURE_LAYERS
    0x8B4D: '{} texture units',  # GL_MAX_COMBINED_TEXTURE_IMAGE_UNITS
    0x8D57: '{} samples',  # GL_MAX_SAMPLES
}


@dataclass(frozen=True)
class Diagnosis:
    """Facts and problems; ``str()`` is the output of ``pvibr doctor``."""

    facts: dict[str, str] = field(default_factory=dict)
    problems: list[tuple[str, str]] = field(default_factory=list)

    def __str__(self) -> str:
        lines = [f'{name:<12}{value}' for name, value in self.facts.items()]
        for what, remedy in self.problems:
            lines += ['', f'missing: {what}', f'  mend it: {remedy}']
        return '\n'.join(lines if self.problems else [*lines, '', 'Nothing is missing.'])


def diagnose() -> Diagnosis:
    """Check versions, rendering, cache and packages; one image is rendered in another process."""
    found = Diagnosis()
    for look in (_versions, _packages, _drawing, _cache, _extras):
        look(found)
    return found


def require_gl() -> None:
    """Raise if nothing can be rendered here, before VTK aborts the process."""
    # A VTK with its own OpenGL needs no system libraries: only rendering can tell.
    if has_gl_libraries() or not _draw_elsewhere()[1]:
        return
    from pvibr.core.errors import PvibrError

    raise PvibrError(
        f'Nothing can be drawn here: OpenGL libraries are missing. Run: {gl_remedy()}'
    )


def prefer_egl() -> None:
    """Make VTK use EGL directly if there is no display."""
    headless = sys.platform.startswith('linux') and not os.environ.get('DISPLAY')
    if headless and _loads_egl():
        os.environ.setdefault('VTK_DEFAULT_OPENGL_WINDOW', 'vtkEGLRenderWindow')


def has_gl_libraries() -> bool:
    """Return True if the libraries exist that VTK loads for its first window."""
    if not sys.platform.startswith('linux'):
        return True
    glx = _loads('libGL.so.1') and bool(os.environ.get('DISPLAY'))
    osmesa = _loads('libOSMesa.so.8') or _loads('libOSMesa.so.6')
    return _loads('libX11.so.6') and (_loads_egl() or glx or osmesa)


def gl_remedy() -> str:
    """Return the command that installs the OpenGL libraries."""
    sudo = '' if getattr(os, 'geteuid', lambda: 0)() == 0 else 'sudo '
    if shutil.which('apt-get'):
        return f'{sudo}apt-get install --no-install-recommends libegl1 libgl1'
    if shutil.which('dnf'):
        return f'{sudo}dnf install mesa-libEGL mesa-libGL mesa-dri-drivers libX11'
    return 'install the graphics driver, or Mesa (EGL, OpenGL and X11 libraries)'


def _loads_egl() -> bool:
    return _loads('libEGL.so.1') and (_loads('libGL.so.1') or _loads('libOpenGL.so.0'))


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _versions(found: Diagnosis) -> None:
    for name in ('pvibr', 'PyVista', 'VTK'):
        found.facts[name] = _version(name.lower()) or 'not installed'
    found.facts['Python'] = f'{platform.python_version()}, {platform.platform()}'


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _packages(found: Diagnosis) -> None:
    needed = [
        line for line in importlib.metadata.requires('pvibr') or [] if 'extra ==' not in line
    ]
    absent = [line for line in needed if _version(re.split(r'[^\w.-]', line)[0]) is None]
    if absent:
        install = ' '.join(f'"{line}"' for line in absent)
        found.problems.append(('Python packages', f'python -m pip install {install}'))


def _drawing(found: Diagnosis) -> None:
    chosen = os.environ.get('VTK_DEFAULT_OPENGL_WINDOW')
    if chosen:
        found.facts['chosen'] = f'{chosen} (VTK_DEFAULT_OPENGL_WINDOW)'
    facts, failure = _draw_elsewhere()
    found.facts.update(facts)
    found.facts['off-screen'] = failure or 'works'
    if not failure:
        return
    if has_gl_libraries():
        remedy = 'update the graphics driver, or unset VTK_DEFAULT_OPENGL_WINDOW and DISPLAY'
        found.problems.append((f'a working OpenGL driver ({failure})', remedy))
    else:
        found.problems.append(('OpenGL libraries', gl_remedy()))


def _draw_elsewhere() -> tuple[dict[str, str], str]:
    """Render in another process, which may crash; return the facts and the failure, if any."""
    command = [sys.executable, '-c', 'from pvibr.cli import doctor; doctor._draw()']
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=TIMEOUT_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return {}, f'no picture within {TIMEOUT_SECONDS} s'
    if done.returncode < 0:
        return {}, f'VTK crashed ({signal.Signals(-done.returncode).name})'
    if done.returncode:
        return {}, f'failed ({_last_line(done.stderr)})'
    facts: dict[str, str] = json.loads(_last_line(done.stdout))
    return facts, ''


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or ['no output'])[-1]


def _draw() -> None:
    """Render one image off screen and print facts of the driver; runs in its own process."""
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=[64, 64])
    plotter.background_color = pv.Color('black')
    plotter.add_mesh(pv.Sphere(), color='white', lighting=False)
    image = plotter.screenshot(return_img=True)
    if image is None or not image[32, 32].all():
        raise RuntimeError('the picture stayed empty')
    print(json.dumps(_window_facts(plotter.render_window)))


def _window_facts(window) -> dict[str, str]:
    said = dict(re.findall(r'OpenGL (\w+) string: *(.*)', window.ReportCapabilities()))
    return {
        'OpenGL': said.get('version', 'unknown'),
        'driver': said.get('vendor', 'unknown'),
        'renderer': said.get('renderer', 'unknown'),
        'window': window.GetClassName(),
        'limits': ', '.join(_limits(window.GetState())),
    }


def _limits(state) -> list[str]:
    limits = []
    for name, phrase in _LIMITS.items():
        value = [0]
        state.vtkglGetIntegerv(name, value)
        limits.append(phrase.format(value[0]))
    return limits


def _cache(found: Diagnosis) -> None:
    try:
        from pvibr.instances.cache import AtlasCache
    except ImportError:
        return  # said among the packages
    cache = AtlasCache()
    used, cap = (size / 2**20 for size in (cache.nbytes(), cache.cap_bytes))
    found.facts['cache'] = f'{cache.path} ({used:.1f} of {cap:.0f} MiB)'
    if not os.access(_nearest_folder(cache.path), os.W_OK):
        remedy = 'set the environment variable PVIBR_CACHE to a folder that can be written'
        found.problems.append((f'write access to the cache folder {cache.path}', remedy))


def _nearest_folder(path: Path) -> Path:
    return next(folder for folder in (path, *path.absolute().parents) if folder.exists())


def _extras(found: Diagnosis) -> None:
    there = [extra for extra, module in _EXTRAS.items() if importlib.util.find_spec(module)]
    absent = ','.join(extra for extra in _EXTRAS if extra not in there)
    found.facts['extras'] = ', '.join(there) or 'none'
    if absent:
        found.facts['optional'] = f'python -m pip install "pvibr[{absent}]"'


if __name__ == '__main__':
    sys.exit(not has_gl_libraries())
