"""The effects, and the one home of their order."""

#: Whatever is not here (things in a scene, effects of the user's own) comes before, as added.
ORDER = (
    'Shadows',  # scene side: what lights reach, known before anything is shaded
    'Projector',  # scene side: photographs are lit and shadowed like the surface that they cover
    'Projectors',  # as one
    'Sky',  # behind the scene: the lens blurs it, bright parts of it shine
    'Backdrop',  # as the sky
    'DepthOfField',  # a lens blurs the light of the scene itself
    'Glow',  # chosen objects shine; sharp light after the lens
    'Afterglow',  # as glow
    'Bloom',  # whatever is bright by now spreads, the glow too
    'ToneMapping',  # the last that sees light; from here on colours are those of a display
    'Outline',  # lines are drawn on the finished picture, in the colour that was asked for
    'ShaderEffect',  # a user's own, unless it says what it runs before
    'ImageOverlay',  # laid over the finished picture, in its own colours
    'NightVision',  # a device looks at all that
    'Vignette',  # its lens is darker at the rim
    'Flash',  # light into that lens
    'Iris',  # and its shutter, which covers everything
    'Tap',  # reads what is drawn by now
)
