"""A check of the installation: rendering, packages, cache, and how to fix problems."""

# Only the standard library at the top: `.ci/bootstrap` runs this before anything is installed.

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

TIMEOUT_SECONDS = 120

# One module per extra that shows whether it is installed.
_EXTRAS = {
    'bench': 'psutil',
    'city': 'cjio',
    'docs': 'sphinx_gallery',
    'jupyter': 'trame',
    'las': 'laspy',
    'movie': 'imageio_ffmpeg',
    'parquet': 'pyarrow',
    'rays': 'embreex',
    'sun': 'ephem',
    'test': 'pytest',
}

# OpenGL limits by enum, with formats.
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
        for problem, remedy in self.problems:
            lines += ['', f'missing: {problem}', f'  fix: {remedy}']
        return '\n'.join(lines if self.problems else [*lines, '', 'Nothing is missing.'])


def diagnose() -> Diagnosis:
    """Check versions, rendering (in another process), cache and packages."""
    diagnosis = Diagnosis()
    for check in (_versions, _packages, _drawing, _cache, _extras):
        check(diagnosis)
    return diagnosis


def require_gl() -> None:
    """Raise if rendering is impossible, before VTK aborts the process."""
    # A VTK with its own OpenGL needs no system libraries, so only a test render can tell.
    if has_gl_libraries() or not _draw_elsewhere()[1]:
        return
    from pvibr.core.errors import PvibrError

    raise PvibrError(f'OpenGL libraries are missing, nothing can be rendered. Run: {gl_remedy()}')


def prefer_egl() -> None:
    """Make VTK use EGL directly if there is no display."""
    headless = sys.platform.startswith('linux') and not os.environ.get('DISPLAY')
    if headless and _loads_egl():
        os.environ.setdefault('VTK_DEFAULT_OPENGL_WINDOW', 'vtkEGLRenderWindow')


def has_gl_libraries() -> bool:
    """Return True if the libraries that VTK loads for its first window exist."""
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


def _versions(diagnosis: Diagnosis) -> None:
    for name in ('pvibr', 'PyVista', 'VTK'):
        diagnosis.facts[name] = _version(name.lower()) or 'not installed'
    diagnosis.facts['Python'] = f'{platform.python_version()}, {platform.platform()}'


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _packages(diagnosis: Diagnosis) -> None:
    requirements = [
        line for line in importlib.metadata.requires('pvibr') or [] if 'extra ==' not in line
    ]
    missing = [line for line in requirements if _version(re.split(r'[^\w.-]', line)[0]) is None]
    if missing:
        install = ' '.join(f'"{line}"' for line in missing)
        diagnosis.problems.append(('Python packages', f'python -m pip install {install}'))


def _drawing(diagnosis: Diagnosis) -> None:
    window_class = os.environ.get('VTK_DEFAULT_OPENGL_WINDOW')
    if window_class:
        diagnosis.facts['chosen'] = f'{window_class} (VTK_DEFAULT_OPENGL_WINDOW)'
    facts, failure = _draw_elsewhere()
    diagnosis.facts.update(facts)
    diagnosis.facts['off-screen'] = failure or 'works'
    if not failure:
        return
    if has_gl_libraries():
        remedy = 'update the graphics driver, or unset VTK_DEFAULT_OPENGL_WINDOW and DISPLAY'
        diagnosis.problems.append((f'a working OpenGL driver ({failure})', remedy))
    else:
        diagnosis.problems.append(('OpenGL libraries', gl_remedy()))


def _draw_elsewhere() -> tuple[dict[str, str], str]:
    """Render in another process, which may crash; return facts and the failure, if any."""
    command = [sys.executable, '-c', 'from pvibr.cli import doctor; doctor._draw()']
    try:
        process = subprocess.run(
            command, capture_output=True, text=True, timeout=TIMEOUT_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return {}, f'no image within {TIMEOUT_SECONDS} s'
    if process.returncode < 0:
        return {}, f'VTK crashed ({signal.Signals(-process.returncode).name})'
    if process.returncode:
        return {}, f'failed ({_last_line(process.stderr)})'
    facts: dict[str, str] = json.loads(_last_line(process.stdout))
    return facts, ''


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or ['no output'])[-1]


def _draw() -> None:
    """Render one image off screen and print facts of the driver, in its own process."""
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=[64, 64])
    plotter.background_color = pv.Color('black')
    plotter.add_mesh(pv.Sphere(), color='white', lighting=False)
    image = plotter.screenshot(return_img=True)
    if image is None or not image[32, 32].all():
        raise RuntimeError('the image stayed empty')
    print(json.dumps(_window_facts(plotter.render_window)))


def _window_facts(window) -> dict[str, str]:
    from pvibr.gl.driver import VARIABLE, capabilities_of, driver_of

    capabilities = capabilities_of(window)
    return {
        'OpenGL': capabilities.get('version', 'unknown'),
        'driver': capabilities.get('vendor', 'unknown'),
        'renderer': capabilities.get('renderer', 'unknown'),
        'drawn by': f'{driver_of(window).kind} ({VARIABLE} overrides)',
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


def _cache(diagnosis: Diagnosis) -> None:
    try:
        from pvibr.instances.cache import AtlasCache
    except ImportError:
        return  # reported by _packages
    cache = AtlasCache()
    used_mib, cap_mib = (size / 2**20 for size in (cache.nbytes(), cache.cap_bytes))
    diagnosis.facts['cache'] = f'{cache.path} ({used_mib:.1f} of {cap_mib:.0f} MiB)'
    folders = cache.path, *cache.path.absolute().parents
    if not os.access(next(folder for folder in folders if folder.exists()), os.W_OK):
        remedy = 'set the environment variable PVIBR_CACHE to a writable folder'
        diagnosis.problems.append((f'write access to the cache folder {cache.path}', remedy))


def _extras(diagnosis: Diagnosis) -> None:
    installed = [extra for extra, module in _EXTRAS.items() if importlib.util.find_spec(module)]
    missing = ','.join(extra for extra in _EXTRAS if extra not in installed)
    diagnosis.facts['extras'] = ', '.join(installed) or 'none'
    if missing:
        diagnosis.facts['optional'] = f'python -m pip install "pvibr[{missing}]"'


if __name__ == '__main__':
    sys.exit(not has_gl_libraries())
