"""Cards on the GPU: an atlas, its instances and card shaders."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pvibr.gl import Texture, shader_source
from pvibr.gl.feature import DITHER, Feature, sections
from pvibr.gl.mipmaps import put_rows
from pvibr.gl.texture import release
from pvibr.instances.atlas import MARGIN
from pvibr.instances.atlas_textures import AtlasTextures
from pvibr.instances.card_layers import PATCH_SIDE, PATCHES, CardLayer
from pvibr.instances.placement import WIDTH
from pvibr.maths.blocks import BLOCK
from pvibr.meshes.turntable import LEVEL
from pvibr.scene.shader_draws import DULL, ROW, pack

_CHUNKS = 8192, 65_536  # cards of one draw, of small and of large sets
_DRAWS = 32  # of a shader, as long as the cards of one allow it
_SHARPNESS = 1.42  # 1.4 to 2.8 texels a pixel: measured best, 1 blurs outlines
# Around VTK's own light code, whatever it is: its clamped cosines become those of spread normals.
_SOFT_LIGHT = '#define max(a, b) ibr_lit(a, b)\n//VTK::Light::Impl\n#undef max\n'


@dataclass(frozen=True)
class CardShader:
    """A way to draw a card."""

    name: str
    views: int
    steps: int
    taps: int = 1
    corners: int = 4
    splat: bool = False
    sides: int = 0
    turns: int = 4
    least: float = 0.0
    largest: float = float('inf')

    def core_size(self, atlas) -> float:
        """Return the on-screen diameter, in pixels, up to which its cards have no core."""
        if self.splat or atlas.core_level < 0:
            return np.inf
        texels = _SHARPNESS * self.taps**0.5  # per pixel, at which the shader chooses a mip level
        return atlas.tile / 2 ** (atlas.core_level + 1) / texels

    def defines(self, animated=False, turned=False, *, deep=False) -> str:
        """Return the preprocessor lines of the shader."""
        values = {
            'VIEWS_BLENDED': self.views,
            'STEPS': self.steps,
            'CARD_TAPS': self.taps,
            'CORNERS': self.corners,
            'SPLAT': int(self.splat),
            'DEEP': int(deep),
            'ANIMATED': int(animated),
            'TURNED': int(turned),
            'SIDES': self.sides,
            'PATCH_SIDE': PATCH_SIDE,
        }
        return DITHER + ''.join(f'#define {k} {v}\n' for k, v in values.items())

    def feature(self, shiny=True, animated=False, turned=False, *, deep=True) -> Feature:
        """Return the shader text by VTK's tags, with depth of its own if it has one."""
        part = sections(shader_source(__file__))
        deep = deep and not self.splat
        defines = self.defines(animated, turned, deep=deep)
        vertex = {
            'VTK::PositionVC::Dec': defines + part['surface'] + part['vertex.declare'],
            'VTK::PositionVC::Impl': part['vertex.position'],
        }
        depth = part['fragment.depth'] if deep else ''
        fragment = {
            'VTK::PositionVC::Dec': defines + part['surface'] + part['fragment.declare'],
            'VTK::PositionVC::Impl': part['fragment.sample'],
            'VTK::Depth::Impl': depth + '//VTK::Depth::Impl\n',
            'VTK::Color::Impl': '//VTK::Color::Impl\n' + part['fragment.color'],
            'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
            'VTK::Light::Impl': _SOFT_LIGHT if shiny else DULL[0] + _SOFT_LIGHT + DULL[1],
        }
        return Feature(f'card_{self.name}_{int(deep)}', vertex, fragment)


SPLAT = CardShader(
    'splat', views=1, steps=0, corners=1, splat=True, turns=2, least=3.0, largest=6.0
)
FLAT = CardShader('flat', views=1, steps=0)
PARALLAX = CardShader('parallax', views=1, steps=2)
BLENDED = CardShader('blended', views=3, steps=2)
FINE = CardShader('fine', views=3, steps=2, taps=4, largest=32.0)
CARD_SHADERS = (SPLAT, FLAT, PARALLAX, BLENDED, FINE)
BILLBOARD = CardShader('billboard', views=1, steps=0, sides=1)
TURNTABLE = CardShader('turntable', views=1, steps=0, sides=2)
#: In the order of their cost, those of a turntable included.
ALL_CARD_SHADERS = (SPLAT, BILLBOARD, TURNTABLE, FLAT, PARALLAX, BLENDED, FINE)
_SLACK = 0.25  # of the extent of a set, around it: what bounds VTK has of it
_LOOSE = 4.0  # times that extent, from which these bounds are too wide
#: A level takes over from its coarser neighbour while the size grows by this factor. Both are
#: drawn meanwhile; 1.1 pops no less on a walk, and a million instances take a tenth longer.
FADE = 1.05
#: On-screen diameters from and to, and whether the mesh comes next, by patch: all of them.
ALWAYS = np.tile([0.0, 1e9, 0.0, 0.0], (PATCHES, 1))


def chunk(instances) -> int:
    """Return the cards of one draw: drivers are paid by the draw, and by the empty cards of it."""
    return int(np.clip(-(-instances // _DRAWS // BLOCK) * BLOCK, *_CHUNKS))


def slabs(depths, turns, capacity) -> list[np.ndarray]:
    """Divide the blocks of several meshes into alternating draws from far to near."""
    total = sum(len(d) for d in depths)
    if len(depths) == 1:
        return [np.minimum(np.arange(-(-total // capacity) + 1) * capacity, total)]
    size = min(capacity, max(1, -(-total // turns)))
    rank = np.empty(total, int)
    rank[np.argsort(np.concatenate(depths), kind='stable')] = np.arange(total)
    edges = np.arange(-(-total // size) + 1)
    starts = np.cumsum([0, *(len(d) for d in depths)])
    return [np.searchsorted(rank[a:b] // size, edges) for a, b in pairwise(starts)]


def slab_counts(instances, meshes, turned=False) -> dict[str, int]:
    """Return the maximum number of draws of each shader."""
    # A block may be partly empty, and each mesh has one such block.
    full = -(-(instances + meshes * BLOCK) // chunk(instances))
    used = ALL_CARD_SHADERS if turned else CARD_SHADERS
    return {p.name: full + (p.turns if meshes > 1 else 0) for p in used}


class Cards:
    """The instances of one atlas as cards."""

    def __init__(self, atlas, capacity, unit, draws, prop, binder):
        self.atlas, self.binder, self.window = atlas, binder, None
        self.solid = self.deep = False
        #: Corners of the bounds that VTK knows, the lower first, world units.
        self.bounds = np.full((2, 3), np.nan)
        self.textures: dict[str, Texture] = {}
        self._own: dict[str, Texture] = {}
        self._images: AtlasTextures | None = None
        self._poses = np.zeros((1, WIDTH, 4), np.float32)
        self._looks = np.zeros((1, 1, 4), np.uint8)
        # What changed since it was uploaded: its rows, None for all.
        self._stale: dict[str, list | None] = {}
        self.uniforms = {
            'ibr_count': 0,
            'ibr_views': atlas.views,
            'ibr_half': int(atlas.half),
            'ibr_tile': atlas.tile,
            'ibr_radius': atlas.radius,
            'ibr_margin': MARGIN,
            'ibr_box_center': (atlas.box.mean(0) - atlas.center) / atlas.radius,
            'ibr_box_half': np.ptp(atlas.box, axis=0) / 2 / atlas.radius,
            'ibr_sharpness': _SHARPNESS,
            'ibr_core_level': float(atlas.core_level),
            'ibr_fade': FADE,
            'ibr_has_looks': 0,
            'ibr_paint': (0.0, 0.0, 0.0, 0.0),
            'ibr_multiply': 0,
        }
        turntable = atlas.turntable
        if turntable is not None:
            sides = turntable.turns.sides()
            self.uniforms |= {
                'ibr_turn_level': LEVEL,
                'ibr_turn_axis': tuple(map(float, sides[2])),
                'ibr_turn_start': tuple(map(float, sides[0])),
            }
        self.unit = unit
        draws = draws or slab_counts(capacity, 1, turntable is not None)
        #: Cards of one draw.
        self.chunk = min(chunk(capacity), max(1, -(-capacity // unit)) * unit)
        used = [p for p in ALL_CARD_SHADERS if p.name in draws]
        self.layers = {p.name: CardLayer(self, p, prop, draws[p.name], self.chunk) for p in used}

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU, the images of the atlas included."""
        return self.item_nbytes + (self._images.nbytes if self._images else 0)

    @property
    def item_nbytes(self) -> int:
        """Bytes on the GPU that grow with the number of instances."""
        blocks = sum(layer.nbytes for layer in self.layers.values())
        return blocks + sum(texture.nbytes for texture in self._own.values())

    @property
    def turned(self) -> dict[str, Texture]:
        """The images around an axis, if there are any."""
        return self._images.turned if self._images else {}

    @property
    def failure(self) -> str | None:
        """Error of the shaders, or None."""
        return next((layer.failure for layer in self.layers.values() if layer.failure), None)

    def check(self):
        """Note shaders that the frame was not drawn with."""
        for layer in self.layers.values():
            layer.check()

    def shaders(self) -> list:
        """Return the card shaders in use, in drawing order."""
        return [layer.shader for layer in self.layers.values()]

    def order(self) -> list:
        """Return pairs of a key and an actor in the order of drawing."""
        found = []
        for layer in self.layers.values():
            found += layer.order(ALL_CARD_SHADERS.index(layer.shader))
        return sorted(found, key=lambda pair: pair[0])

    def actors(self) -> list:
        """Return all actors in the order of drawing."""
        return [actor for _, actor in self.order()]

    def place(self, placement, rows=None):
        """Take over the poses of a placement, or some rows of them, with the next upload."""
        self.uniforms |= {'ibr_count': len(placement.ids), 'ibr_texels': placement.texels}
        self._poses, stale = placement.rows, self._stale.get('ibr_poses', ())
        self._stale['ibr_poses'] = None if rows is None or stale is None else [*stale, rows]

    def bound(self, bounds):
        """Have VTK know about where the cards are: it culls by that, and EDL scales by it."""
        low, high = np.reshape(bounds, (3, 2)).T
        sides, known = (high - low).max(), np.ptp(self.bounds, axis=0).max()
        inside = (self.bounds[0] <= low).all() and (high <= self.bounds[1]).all()
        if not inside or known > _LOOSE * sides:  # else what moves would be uploaded each time
            slack = _SLACK * sides if self.window is not None else 0.0  # of what does move
            self.bounds = np.stack([low - slack, high + slack])
            for layer in self.layers.values():
                layer.bound(self.bounds.T.ravel(), layer.shader.corners)

    def look(self, looks):
        """Take over colours of instances with the next upload."""
        self.uniforms['ibr_has_looks'] = int(looks is not None)
        self._looks = np.zeros((1, 1, 4), np.uint8) if looks is None else pack(looks, ROW, 4)
        self._stale['ibr_looks'] = None

    def upload(self, window):
        """Upload what changed; the context is current."""
        if self.window is None:
            self._begin(window)
        images = {'ibr_poses': self._poses, 'ibr_looks': self._looks}
        for name, rows in self._stale.items():
            if rows is None:
                self.textures[name].upload(images[name])
            else:
                put_rows(self.textures[name], images[name], np.unique(np.concatenate(rows)))
        self._stale = {}

    def _begin(self, window):
        self._images = self._images or AtlasTextures.of(self.atlas, window)
        if self.atlas.animated:
            self._own['ibr_moves'] = Texture(window)
            self.uniforms['ibr_pages'] = self.atlas.pages
        self._own |= {name: Texture(window) for name in ('ibr_poses', 'ibr_looks')}
        self.textures = self._images.views | self._own
        self._stale = dict.fromkeys(('ibr_poses', 'ibr_looks'))
        self.window = window  # last: what fails begins anew

    def move(self, moves):
        """Upload the motion of instances of an animated atlas."""
        self.textures['ibr_moves'].upload(pack(moves, ROW, 4))

    def view(self, frame, *, depth=False):
        """Set the uniforms of a frame's camera; depth may be wanted of soft edges."""
        self.solid = frame.picking or frame.casting
        self.deep = depth and not self.solid
        clip, view = frame.clip_from_view, frame.view_from_world
        self.uniforms |= {
            'ibr_parallel': int(frame.parallel),
            'ibr_pixel_scale': frame.pixel_scale,
            'ibr_eye_from_world': view[:3, :3],
            'ibr_clip_from_eye': clip,
            'ibr_clip_depth': (clip[2, 2], clip[2, 3], clip[3, 2], clip[3, 3]),
            'ibr_fades': int(not self.solid),
            'ibr_dither': frame.vary('levels')[0],
            'ibr_error': 1.0 / frame.quality,
        }

    def show(self, name, blocks, cuts, *, ranges=ALWAYS, level=ALWAYS, unit=None, cored=0):
        """Draw some blocks by a shader, from far to near, the first of which have no core."""
        layer = self.layers[name]
        layer.ranges, layer.level, layer.unit = ranges, level, unit or self.unit
        layer.show(blocks, cuts, cored)

    def hide(self):
        """Draw nothing."""
        for layer in self.layers.values():
            layer.hide()

    def release(self):
        """Free GPU memory; the context is current."""
        self.binder.unbind()
        for layer in self.layers.values():
            layer.release(self.window)
        release(*self._own.values())
        if self._images is not None:
            self._images.give_back()
        self.textures, self._own, self._images, self.window = {}, {}, None, None
