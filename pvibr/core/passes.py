"""VTK's own render passes on a renderer: which there are, and what they do to a frame."""

from __future__ import annotations

from math import sqrt

from pyvista import vtk_version_info

# Pixels that a pass draws beyond each side, by a wider view; its result has no depth.
_MARGINS = {
    'vtkDepthOfFieldPass': 16,
    'vtkGaussianBlurPass': 2,
    'vtkSobelGradientMagnitudePass': 1,
}
_SAMPLES = sqrt(5)  # along a side, of a pixel that vtkSSAAPass draws
_NO_DEPTH = *_MARGINS, *(['vtkSSAAPass'] if vtk_version_info < (9, 7) else [])


def passes_of(renderer) -> list:
    """Return the passes, each with those that it delegates to after it."""
    found, last = [], renderer.GetPass()
    while last is not None:
        found.append(last)
        last = last.GetDelegatePass() if hasattr(last, 'GetDelegatePass') else None
    return found


def has_shadows(renderer) -> bool:
    """Return whether VTK draws shadows, as `enable_shadows` has it."""
    passes = [p for p in passes_of(renderer) if p.IsA('vtkSequencePass')]
    inner = [p for sequence in passes for p in sequence.GetPasses() or ()]
    return renderer.GetUseShadows() or any(p.IsA('vtkShadowMapPass') for p in inner)


def loses_depth(renderer) -> bool:
    """Return whether a frame is left without the depth of the scene."""
    return any(p.IsA(name) for p in passes_of(renderer) for name in _NO_DEPTH)


def margins(renderer, size) -> tuple[float, float]:
    """Return by how much the scene is drawn wider and higher than it is shown."""
    samples, (width, height) = 1.0, size
    drawn = [float(width), float(height)]
    for found in passes_of(renderer):
        if found.IsA('vtkSSAAPass'):
            samples *= _SAMPLES
        margin = next((m for name, m in _MARGINS.items() if found.IsA(name)), 0)
        drawn = [n + 2 * margin / samples for n in drawn]
    return (drawn[0] / width, drawn[1] / height) if width and height else (1.0, 1.0)


def samples_of(renderer) -> int:
    """Return the samples per pixel that the scene is drawn with, 1 without antialiasing."""
    passes = sum(p.IsA('vtkSSAAPass') for p in passes_of(renderer))
    return max(renderer.GetRenderWindow().GetMultiSamples(), 1) * round(_SAMPLES**2) ** passes


def peels_samples(renderer) -> bool:
    """Return whether VTK has just peeled what is translucent in a multisampled window."""
    samples = renderer.GetRenderWindow().GetMultiSamples()
    return samples > 1 and bool(renderer.GetLastRenderingUsedDepthPeeling())


def is_llvmpipe(window) -> bool:
    """Return whether Mesa draws without a GPU; asking the driver takes a millisecond."""
    return 'llvmpipe' in window.ReportCapabilities()
