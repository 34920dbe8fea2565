"""Effects on the picture of a frame; ``pvibr.EFFECTS`` registers them."""

from pvibr import EFFECTS

#: Names of classes, in the order in which effects run; all others run before, as added.
ORDER = (
    'Substitute',  # images of actors show live textures as these are now
    *EFFECTS,
    'Tap',  # reads what all of them have drawn
)
