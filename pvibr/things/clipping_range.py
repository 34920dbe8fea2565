"""The clipping range of a camera: what it cuts, and where it is reset to."""

from __future__ import annotations

#: Ratio of near to far plane to which VTK goes if the eye is within the scene, rounded up.
_NEAREST = 1.001e-3


def is_within_clipping_range(renderer, bounds) -> bool:
    """Return True if bounds are not empty and lie within the clipping range."""
    if bounds[0] > bounds[1]:
        return False
    camera = renderer.GetActiveCamera()
    near, far = camera.GetClippingRange()
    middle_depth = half_depth = 0.0  # plain floats: many figures ask in each frame
    pairs = zip(camera.GetDirectionOfProjection(), camera.GetPosition(), strict=True)
    for (axis, eye), low, high in zip(pairs, bounds[::2], bounds[1::2], strict=True):
        middle_depth += axis * ((low + high) / 2 - eye)
        half_depth += abs(axis) * (high - low) / 2
    nearest_depth = middle_depth - half_depth
    if nearest_depth <= 0:  # around the eye: VTK goes no nearer
        nearest_depth = _NEAREST * far
    return near <= nearest_depth and middle_depth + half_depth <= far


def is_cut(renderer) -> bool:
    """Return True if the clipping range cuts the visible scene."""
    bounds = renderer.ComputeVisiblePropBounds()
    return bounds[0] <= bounds[1] and not is_within_clipping_range(renderer, bounds)


def reset_clipping_range(renderer):
    """Reset the clipping range to the scenes of all subplots that share the camera."""
    camera, window = renderer.GetActiveCamera(), renderer.GetRenderWindow()
    renderer.ResetCameraClippingRange()
    if window is None:
        return
    for other in window.GetRenderers():
        has_camera = other is not renderer and other.IsActiveCameraCreated()
        if has_camera and other.GetActiveCamera() is camera:
            near, far = camera.GetClippingRange()
            other.ResetCameraClippingRange()
            other_near, other_far = camera.GetClippingRange()
            camera.SetClippingRange(min(near, other_near), max(far, other_far))
