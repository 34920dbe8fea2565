"""Effects on the picture of a frame; ``pvibr.EFFECTS`` registers them."""

from pvibr import EFFECTS

#: Names of classes, in the order in which effects run; all others run before, as added.
ORDER = (*EFFECTS, 'Tap')  # a tap reads what all of them have drawn
