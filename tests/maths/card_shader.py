"""The functions of ``cards.glsl``, evaluated on the GPU."""

import numpy as np

import pvibr.instances.cards
from pvibr.gl import Quad, Target, Texture, shader_source
from pvibr.gl.feature import sections
from pvibr.gl.hidden_window import hidden_window

HEAD = """
uniform sampler2D points;
uniform sampler2D ibr_support;
uniform int ibr_half;
"""


def evaluated(main, points, support=None, half=False, count=1):
    """Return what a main function writes, for points of shape (32, 32, 3)."""
    text = sections(shader_source(pvibr.instances.cards.__file__))['vertex.declare']
    images = {'points': points} if support is None else {'points': points, 'ibr_support': support}
    with hidden_window() as (window, _):
        target = Target(window, 32, 32, ('rgba32f',) * count)
        textures = {k: Texture(window).upload(v.astype(np.float32)) for k, v in images.items()}
        quad = Quad(window, HEAD + text[text.index('vec2 ibr_signs') :] + main, 'twin')
        with target.drawing():
            quad.draw({'ibr_half': int(half)}, textures)
        found = [color.download()[..., :3] for color in target.colors]
        for owner in (target, quad, *textures.values()):
            owner.release()
    return found
