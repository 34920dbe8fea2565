"""Images that a page projects on surfaces, by pvibr's own shader of projectors."""

from __future__ import annotations

import numpy as np

from pvibr.gl import set_fragment_uniforms, set_vertex_uniforms
from pvibr.photos.projector import Projector
from pvibr.visibility import depth_test
from pvibr.web.container import Image
from pvibr.web.shadows import view_tree

_RESOLUTION = 2048  # most texels along a side of a depth map
_NUMBERS = 24  # of a slide; the last is the size of a texel of its depth map
_TEXEL = 23


def is_drawn(effect) -> bool:
    """Return whether a page draws an effect as a projector: of still images on all surfaces."""
    is_projector = type(effect) is Projector and not effect.lives
    return is_projector and effect.actors is None and effect.casters is None


class PageProjector:
    """A projector, and the shader of what it paints."""

    def __init__(self, effect, frame):
        self.effect = effect
        self.multisampled = frame.window.GetMultiSamples() > 1
        self.time = frame.time
        self.uniforms = effect.world_uniforms()

    def attach(self, actor):
        """Let an actor receive the images."""
        self.effect.feature(self.multisampled).attach(actor)
        ahead = {'ibr_ahead': (0.0, 1.0)}
        set_vertex_uniforms([actor], {'ibr_view_from_clip': np.zeros((1, 4, 4))} | ahead)
        set_fragment_uniforms([actor], ahead | self.uniforms)

    def tree(self) -> dict:
        """Return images, views of depth maps, and uniforms in world space."""
        prefix = self.effect.prefix
        matrices, numbers, settings = (
            self.uniforms[f'{prefix}_{name}'] for name in ('matrix', 'number', 'set')
        )
        slides = []
        for k, slide in enumerate(self.effect.slides):
            resolution = min(slide.side(self.effect.resolution), _RESOLUTION)
            picture = slide.picture(self.time, self.effect)[::-1]
            tree: dict = {
                'image': Image(np.ascontiguousarray(picture), lossless=False),
                'view': None,
            }
            if self.effect.occlusion and slide.view is not None:
                texel = depth_test.texel_size(slide.view, resolution)
                numbers[_NUMBERS * k + _TEXEL] = texel
                tree |= {'view': view_tree(slide.view), 'resolution': resolution}
            slides.append(tree)
        return {
            'prefix': prefix,
            'matrices': [matrix.T.ravel().tolist() for matrix in matrices],
            'numbers': numbers.ravel().tolist(),
            'settings': settings.ravel().tolist(),
            'slides': slides,
        }
