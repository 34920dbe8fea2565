"""Times of frames, in which no GPU is waited for."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from pvibr.core import _vtk
from pvibr.gl.driver import driver_of


class FrameTimer:
    """Times the frames of a window: in software each at its end, on a GPU a frame later."""

    def __init__(self):
        self._window: Any = None
        self._span: Any = None  # on the GPU
        self._start_time: float | None = None
        self._processor_ms: float | None = None
        self._is_software = True

    def start(self, window) -> float | None:
        """Begin a frame; return the milliseconds of the one before, if a GPU drew it."""
        if window is not self._window:
            self._window, self._is_software = window, driver_of(window).is_software
        is_hardware = not self._is_software
        if is_hardware:
            window.MakeCurrent()  # events of a window come before its context is made current
        last_ms, self._processor_ms = self._processor_ms, None
        if last_ms is not None and self._span is not None and self._span.Ready():
            last_ms = max(last_ms, self._span.GetElapsedMilliseconds())
        self._start_time = perf_counter()
        if is_hardware:
            self._begin_span(window)
        return last_ms

    def _begin_span(self, window):
        """Begin a span on the GPU, if it has timers."""
        if self._span is None and _vtk.vtkOpenGLRenderTimer.IsSupported():
            self._span = _vtk.vtkOpenGLRenderTimer()
        if self._span is not None:
            self._span.Reset()
            self._span.Start()

    def end(self, window) -> float | None:
        """End a frame; return its milliseconds in software, None on a GPU or without a start."""
        start_time = self._start_time
        if start_time is None:
            return None
        self.cancel()
        if self._is_software:
            window.WaitForCompletion()
        elif self._span is not None and self._span.Started():
            self._span.Stop()
        elapsed_ms = 1e3 * (perf_counter() - start_time)
        if self._is_software:
            return elapsed_ms
        self._processor_ms = elapsed_ms
        return None

    @property
    def is_running(self) -> bool:
        """Whether a frame has begun and not ended."""
        return self._start_time is not None

    def cancel(self):
        """Leave out the frame that has begun."""
        self._start_time = None

    def release(self):
        """Forget the frame, and free the GPU's timer."""
        if self._span is not None:
            if not self._window.GetNeverRendered():
                self._window.MakeCurrent()
            self._span.ReleaseGraphicsResources()
        self._window = self._span = self._start_time = self._processor_ms = None
