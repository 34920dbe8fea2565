"""Instances of one atlas drawn as cards, textured quads, by several shaders."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pvibr.gl import Texture, shader_source
from pvibr.gl.feature import DITHER, Feature, sections
from pvibr.gl.mipmaps import put_rows
from pvibr.gl.texture import release
from pvibr.instances.atlas_textures import AtlasTextures
from pvibr.instances.card_layers import PATCH_SIDE, PATCHES, CardLayer
from pvibr.instances.placement import WIDTH
from pvibr.maths.blocks import BLOCK
from pvibr.things.depth_prepass import DEPTH_ONLY
from pvibr.things.shader_draws import DULL, ROW, pack

_CHUNKS = 8192, 65_536  # cards per draw, in small and in large sets
_DRAWS = 32  # draws per shader that the number of cards per draw aims at
_SHARPNESS = 1.42  # texels per pixel, up to twice as many: measured best, 1 blurs outlines
# Around any light code of VTK: its clamped cosines become those of spread normals.
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
        """Return the on-screen diameter, in pixels, up to which cards have no core."""
        if self.splat or atlas.core_level < 0:
            return np.inf
        texels_per_pixel = _SHARPNESS * self.taps**0.5  # at which the shader selects a mip level
        return atlas.tile / 2 ** (atlas.core_level + 1) / texels_per_pixel

    def defines(self, animated=False, has_turntable=False, *, deep=False, hides=False) -> str:
        """Return the preprocessor lines of the shader."""
        define_values = {
            'VIEWS_BLENDED': self.views,
            'STEPS': self.steps,
            'CARD_TAPS': self.taps,
            'CORNERS': self.corners,
            'SPLAT': int(self.splat),
            'DEEP': int(deep),
            'HIDES': int(hides),
            'ANIMATED': int(animated),
            'TURNED': int(has_turntable),
            'SIDES': self.sides,
            'PATCH_SIDE': PATCH_SIDE,
        }
        return DITHER + ''.join(f'#define {k} {v}\n' for k, v in define_values.items())

    def feature(
        self, shiny=True, animated=False, has_turntable=False, *, deep=True, hides=False
    ) -> Feature:
        """Return the shader code by VTK's tags, writing depth per pixel if `deep`.

        If it `hides`, for a depth prepass: the depth of the instance's far end, and no colour.
        """
        section = sections(shader_source(__file__))
        deep = deep and not self.splat
        defines = self.defines(animated, has_turntable, deep=deep, hides=hides)
        vertex_code = {
            'VTK::PositionVC::Dec': defines + section['surface'] + section['vertex.declare'],
            'VTK::PositionVC::Impl': section['vertex.position'],
        }
        depth_code = section['fragment.depth'] if deep else ''
        fragment_code = {
            'VTK::PositionVC::Dec': defines + section['surface'] + section['fragment.declare'],
            'VTK::PositionVC::Impl': section['fragment.sample'],
            'VTK::Depth::Impl': depth_code + '//VTK::Depth::Impl\n',
            'VTK::Color::Impl': '//VTK::Color::Impl\n' + section['fragment.color'],
            'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
            'VTK::Light::Impl': _SOFT_LIGHT if shiny else DULL[0] + _SOFT_LIGHT + DULL[1],
        }
        if hides:
            fragment_code |= DEPTH_ONLY
        name = f'card_{self.name}_{"hiding" if hides else int(deep)}'
        return Feature(name, vertex_code, fragment_code)


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
#: Cheapest first, with those of a turntable.
ALL_CARD_SHADERS = (SPLAT, BILLBOARD, TURNTABLE, FLAT, PARALLAX, BLENDED, FINE)
_SLACK = 0.25  # margin of VTK's bounds around a moving set, relative to its extent
_LOOSE = 4.0  # times that extent, at which VTK's bounds are too wide
#: Growth in size during which a level fades in over the coarser one, with both drawn. 1.1 pops no
#: less on a walk, and takes a tenth longer for a million instances.
FADE = 1.05
#: From, to, whether the mesh is next, and 0, by patch: drawn at every size.
ALWAYS = np.tile([0.0, 1e9, 0.0, 0.0], (PATCHES, 1))


def chunk(instances) -> int:
    """Return the number of cards per draw: each draw costs, and so do its unused cards."""
    return int(np.clip(-(-instances // _DRAWS // BLOCK) * BLOCK, *_CHUNKS))


def slabs(choices, turns, capacity) -> list[list[int]]:
    """Return where to cut the chosen blocks of each mesh, so that draws alternate far to near."""
    if len(choices) == 1:
        block_count = len(choices[0])
        return [[*range(0, block_count, capacity), block_count]]
    block_count = sum(map(len, choices))
    slab_size = min(capacity, max(1, -(-block_count // turns)))
    depths = np.concatenate([choice.depths for choice in choices])
    depth_rank = np.empty(block_count, int)
    depth_rank[np.argsort(depths, kind='stable')] = np.arange(block_count)
    slab_edges = np.arange(-(-block_count // slab_size) + 1)
    mesh_starts = np.cumsum([0, *map(len, choices)])
    slab_of_block = depth_rank // slab_size
    bounds = pairwise(mesh_starts)
    return [np.searchsorted(slab_of_block[a:b], slab_edges).tolist() for a, b in bounds]


def slab_counts(instances, meshes, has_turntable=False) -> dict[str, int]:
    """Return the maximum number of draws of each shader."""
    # Each mesh may have one block that is partly empty.
    full_draws = -(-(instances + meshes * BLOCK) // chunk(instances))
    shaders = ALL_CARD_SHADERS if has_turntable else CARD_SHADERS
    return {p.name: full_draws + (p.turns if meshes > 1 else 0) for p in shaders}


class Cards:
    """The instances of one atlas as cards."""

    def __init__(self, atlas, capacity, unit, draw_counts, prop, binder):
        self.atlas, self.binder, self.window = atlas, binder, None
        self.solid = self.deep = False
        #: Low and high corner of the bounds that VTK culls by, world units.
        self.bounds = np.full((2, 3), np.nan)
        self.textures: dict[str, Texture] = {}
        self._textures: dict[str, Texture] = {}
        self._images: AtlasTextures | None = None
        self._poses = np.zeros((1, WIDTH, 4), np.float32)
        self._looks: np.ndarray | None = None
        # Textures that changed since their upload: rows, None for all.
        self._stale: dict[str, list | None] = {}
        #: Those of the frame's view.
        self.view_uniforms: dict = {}
        #: Replaced with every change.
        self.uniforms: dict = atlas.card_uniforms | {
            'ibr_sharpness': _SHARPNESS,
            'ibr_fade': FADE,
            'ibr_count': 0,
            'ibr_has_looks': 0,
            'ibr_paint': (0.0, 0.0, 0.0, 0.0),
            'ibr_multiply': 0,
        }
        self.unit = unit
        draw_counts = draw_counts or slab_counts(capacity, 1, atlas.turntable is not None)
        #: Cards per draw.
        self.chunk = min(chunk(capacity), max(1, -(-capacity // unit)) * unit)
        shaders = [p for p in ALL_CARD_SHADERS if p.name in draw_counts]
        self.layers = {
            p.name: CardLayer(self, p, prop, draw_counts[p.name], self.chunk) for p in shaders
        }

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU, the images of the atlas included."""
        return self.item_nbytes + (self._images.nbytes if self._images else 0)

    @property
    def item_nbytes(self) -> int:
        """Bytes on the GPU that grow with the number of instances."""
        blocks = sum(layer.nbytes for layer in self.layers.values())
        return blocks + sum(texture.nbytes for texture in self._textures.values())

    @property
    def turntable_textures(self) -> dict[str, Texture]:
        """The textures of a turntable, if there is one."""
        return self._images.turned if self._images else {}

    @property
    def failure(self) -> str | None:
        """Error of the shaders, or None."""
        return next((layer.failure for layer in self.layers.values() if layer.failure), None)

    def check(self):
        """Note shaders that failed to draw."""
        for layer in self.layers.values():
            layer.check()

    def order(self) -> list:
        """Return pairs of sort key and actor, in drawing order."""
        keyed_actors = []
        for layer in self.layers.values():
            keyed_actors += layer.order(ALL_CARD_SHADERS.index(layer.shader))
        return sorted(keyed_actors, key=lambda pair: pair[0])

    def actors(self) -> list:
        """Return all actors in drawing order."""
        return [actor for _, actor in self.order()]

    def set(self, **uniforms):
        """Set uniforms of all shaders."""
        self.uniforms = self.uniforms | uniforms

    def place(self, placement, changed_rows=None):
        """Schedule the upload of a placement's poses, or of some rows of the texture."""
        self.set(ibr_count=len(placement.ids), ibr_texels=placement.texels_per_pose)
        self._poses, stale = placement.pose_texture, self._stale.get('ibr_poses', ())
        is_partial = changed_rows is not None and stale is not None
        self._stale['ibr_poses'] = [*(stale or ()), changed_rows] if is_partial else None

    def bound(self, bounds):
        """Set the bounds that VTK culls by and EDL scales by, with slack for motion."""
        low, high = np.reshape(bounds, (3, 2)).T
        extent, bounds_extent = (high - low).max(), np.ptp(self.bounds, axis=0).max()
        is_inside = (self.bounds[0] <= low).all() and (high <= self.bounds[1]).all()
        # Without slack each motion would be an upload; sets that never move need none.
        if not is_inside or bounds_extent > _LOOSE * extent:
            slack = _SLACK * extent if self.window is not None else 0.0
            self.bounds = np.stack([low - slack, high + slack])
            for layer in self.layers.values():
                layer.bound(self.bounds.T.ravel(), layer.shader.corners)

    def look(self, looks):
        """Schedule the upload of instance colours, (n, 4) uint8 or None."""
        self.set(ibr_has_looks=int(looks is not None))
        self._looks = None if looks is None else pack(looks, ROW, 4)
        self._stale['ibr_looks'] = None

    def upload(self, window):
        """Upload what has changed; the context is current."""
        if self.window is None:
            self._begin(window)
        images = {'ibr_poses': self._poses, 'ibr_looks': self._looks}
        images_of_atlas = self._images
        if ('ibr_looks' in self._textures) != (self._looks is not None) and images_of_atlas:
            self._switch_looks(images_of_atlas)
        for name, stale_rows in self._stale.items():
            texture, image = self.textures[name], images[name]
            if image is None:
                continue
            if stale_rows is None:
                texture.upload(image)
            else:
                put_rows(texture, image, np.unique(np.concatenate(stale_rows)))
        self._stale = {}

    def _begin(self, window):
        self._images = self._images or AtlasTextures.of(self.atlas, window)
        if self.atlas.animated:
            self._textures['ibr_moves'] = Texture(window)
            self.set(ibr_pages=self.atlas.pages)
        self._textures['ibr_poses'] = Texture(window)
        self._use_textures(self._images)
        self._stale = dict.fromkeys(('ibr_poses', 'ibr_looks'))
        self.window = window  # last: after a failure all is made again

    def _use_textures(self, images):
        """Draw with the images of the atlas and with what are the set's own textures."""
        self.textures = images.views | self._textures
        for layer in self.layers.values():
            layer.refresh()

    def _switch_looks(self, images):
        """Use a texture of looks while instances have any, else one that sets share."""
        release(self._textures.pop('ibr_looks', None))
        if self._looks is not None:
            self._textures['ibr_looks'] = Texture(self.window)
        self._use_textures(images)

    def move(self, moves):
        """Upload the motion of instances of an animated atlas."""
        self.textures['ibr_moves'].upload(pack(moves, ROW, 4))

    def view(self, frame, *, depth=False):
        """Set the uniforms of a frame's camera; `depth` if an effect reads that of soft edges."""
        self.solid = frame.picking or frame.casting
        self.deep = depth and not self.solid
        self.view_uniforms = frame.once(_view_uniforms)

    def show_only(self, names):
        """Draw nothing by shaders of other names."""
        for name, layer in self.layers.items():
            if not (layer.is_empty or name in names):
                layer.clear()

    def hide(self):
        """Draw nothing."""
        for layer in self.layers.values():
            layer.hide()

    def release(self):
        """Free GPU memory; the context is current."""
        self.binder.unbind()
        for layer in self.layers.values():
            layer.release(self.window)
        release(*self._textures.values())
        if self._images is not None:
            self._images.give_back()
        self.textures, self._textures, self._images, self.window = {}, {}, None, None


def _view_uniforms(frame) -> dict:
    """Return the uniforms of a frame's view."""
    view = frame.view
    clip = view.clip_from_view
    return {
        'ibr_parallel': int(view.parallel),
        'ibr_pixel_scale': frame.pixel_scale,
        'ibr_eye_from_world': view.view_from_world[:3, :3],
        'ibr_clip_from_eye': clip,
        'ibr_clip_depth': (clip[2, 2], clip[2, 3], clip[3, 2], clip[3, 3]),
        'ibr_fades': int(not (frame.picking or frame.casting)),
        'ibr_dither': frame.vary('levels')[0],
        'ibr_error': 1.0 / frame.quality,
    }
