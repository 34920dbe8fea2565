"""VTK's own render passes on a renderer, and how they affect a frame."""

from __future__ import annotations

from math import sqrt

from pyvista import vtk_version_info

# Margin in pixels that a pass adds by widening the view; its result has no depth.
_MARGINS = {
    'vtkDepthOfFieldPass': 16,
    'vtkGaussianBlurPass': 2,
    'vtkSobelGradientMagnitudePass': 1,
}
_SAMPLES = sqrt(5)  # per pixel side in vtkSSAAPass
_NO_DEPTH = *_MARGINS, *(['vtkSSAAPass'] if vtk_version_info < (9, 7) else [])


def passes_of(renderer) -> list:
    """Return a renderer's passes, delegates included, the outermost first."""
    passes, render_pass = [], renderer.GetPass()
    while render_pass is not None:
        passes.append(render_pass)
        render_pass = getattr(render_pass, 'GetDelegatePass', lambda: None)()
    return passes


def has_shadows(renderer) -> bool:
    """Return whether VTK draws shadows, as after `enable_shadows`."""
    sequence_passes = [p for p in passes_of(renderer) if p.IsA('vtkSequencePass')]
    inner_passes = [p for sequence in sequence_passes for p in sequence.GetPasses() or ()]
    return renderer.GetUseShadows() or any(p.IsA('vtkShadowMapPass') for p in inner_passes)


def loses_depth(renderer) -> bool:
    """Return whether a frame ends without the depth of the scene."""
    return any(p.IsA(name) for p in passes_of(renderer) for name in _NO_DEPTH)


def margins(renderer, size) -> tuple[float, float]:
    """Return by which factors the scene is drawn wider and higher than shown."""
    samples_per_side, (width, height) = 1.0, size
    drawn_size = [float(width), float(height)]
    for render_pass in passes_of(renderer):
        if render_pass.IsA('vtkSSAAPass'):
            samples_per_side *= _SAMPLES
        margin = next((m for name, m in _MARGINS.items() if render_pass.IsA(name)), 0)
        drawn_size = [n + 2 * margin / samples_per_side for n in drawn_size]
    return (drawn_size[0] / width, drawn_size[1] / height) if width and height else (1.0, 1.0)


def samples_of(renderer) -> int:
    """Return the samples per pixel of the scene, 1 without antialiasing."""
    ssaa_passes = sum(p.IsA('vtkSSAAPass') for p in passes_of(renderer))
    return max(renderer.GetRenderWindow().GetMultiSamples(), 1) * round(_SAMPLES**2) ** ssaa_passes


def supersampling_of(renderer) -> float:
    """Return how many samples passes draw along a side of a pixel, 1 without them."""
    return sqrt(samples_of(renderer) / max(renderer.GetRenderWindow().GetMultiSamples(), 1))


def peels_samples(renderer) -> bool:
    """Return whether VTK depth-peeled the last frame in a multisampled window."""
    sample_count = renderer.GetRenderWindow().GetMultiSamples()
    return sample_count > 1 and bool(renderer.GetLastRenderingUsedDepthPeeling())
