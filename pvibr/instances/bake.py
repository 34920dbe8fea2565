"""Bake an atlas: render an object from every view of the grid."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import Quad, Target, set_fragment_uniforms, shader_source, texture_limit
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature
from pvibr.gl.hidden_window import hidden_window
from pvibr.instances.atlas import MARGIN, Atlas, bounding_sphere
from pvibr.instances.enclosing_surfaces import winding
from pvibr.instances.support import support_table
from pvibr.maths import octahedral
from pvibr.maths.views import orthographic
from pvibr.meshes.texture_maps import attach_maps, emission_of
from pvibr.meshes.turntable import Turntable
from pvibr.textures.material_textures import PROPERTY_TEXTURES, copy_property, copy_texture

_FLAT = 0  # VTK_FLAT
# VTK's lighting is discarded: the output is the unlit colour, which VTK multiplies by the texture,
# and the normal after VTK's flips for two-sided surfaces. Ambient light is zero, but VTK sets the
# colours of back faces only where its uniforms are used.
_UNLIT = """//VTK::Light::Impl
  fragOutput0 = vec4(ambientColor + diffuseColor, opacity);
  vec3 ibr_normal = normalVCVSOutput;
"""
_CUT = """
  if (gl_FragData[0].a < ibr_cut) discard;
  gl_FragData[0].a = 1.0;
"""
_OUTPUT = """
  gl_FragData[0].rgb *= gl_FragData[0].a;
  gl_FragData[1] =
    gl_FragData[0].a * vec4(ibr_object_from_view * ibr_normal * 0.5 + 0.5, 1.0 - gl_FragCoord.z);
//VTK::DepthPeeling::Impl
"""


def bake_parts(
    parts,
    *,
    views=16,
    tile=128,
    half=False,
    supersample=2,
    sphere=None,
    support=None,
    turns=None,
    culls=True,
    progress=None,
) -> Atlas:
    """Render the parts of one object from all views into an atlas."""
    check_grid(views, tile)
    start = time.perf_counter()
    points = np.concatenate([p.mesh.points for p in parts])
    center, radius = bounding_sphere(points) if sphere is None else sphere
    with hidden_window() as (window, renderer):
        max_texture_size = texture_limit(window)
        while views * tile * 3 // 2 > max_texture_size and tile > 4:
            tile //= 2  # mip levels lie beside the image
        while views * tile * supersample > max_texture_size and supersample > 1:
            supersample //= 2
        directions = octahedral.view_directions(views, half)
        baker = Baker(renderer, parts, center, radius, (views, tile, supersample), culls=culls)
        try:
            geometry, albedo = baker.pictures(octahedral.frame(directions), progress)
        finally:
            baker.release()
        turntable = None
        if turns is not None:
            baker = Baker(renderer, parts, center, radius, (turns.columns, tile, supersample))
            try:
                turntable = Turntable(turns, *baker.pictures(turns.frames()))
            finally:
                baker.release()
    return Atlas(
        geometry,
        albedo,
        center,
        radius,
        support_table((points - center) / radius) if support is None else support,
        views,
        tile,
        half,
        seconds=time.perf_counter() - start,
        turntable=turntable,
    )


def check_grid(views, tile):
    """Raise ValueError for invalid numbers of views, and of texels of each, along a side."""
    if views < 2 or tile < 4 or tile & (tile - 1):
        raise ValueError(
            f'views must be at least 2 and tile a power of two from 4, got {views} and {tile}'
        )


class Baker:
    """Renders views of parts; their points may change in between."""

    def __init__(self, renderer, parts, center, radius, grid, *, culls=True):
        self.window, self.center = renderer.GetRenderWindow(), center
        self.radius = radius
        self.views, self.tile, self.scale = grid
        side = self.tile * self.scale
        self.drawer = Drawer(renderer)
        self.actors = [unlit_actor(p, None if culls else False) for p in parts]
        self.raster = Target(self.window, self.views * side, side, ('rgba8', 'rgba8'), depth=True)
        strip = (self.views * self.tile, self.tile)
        self.strip = Target(self.window, *strip, ('rgba8', 'rgba8'))
        source = f'#define SCALE {self.scale}\n{shader_source(__file__)}'
        self.reduce = Quad(self.window, source, 'bake.glsl')

    def pictures(self, frames, progress=None):
        """Return geometry and albedo of all views, (views * tile, views * tile, 4) uint8 each."""
        strips, filled = [], []
        with ThreadPoolExecutor(1) as pool:  # depth is filled while the next row is drawn
            for k, row in enumerate(frames):
                strips.append(self._row(row))
                # Row by row, within the processor's cache.
                filled.append(pool.submit(fill_depth, strips[-1][0], self.tile))
                if progress is not None:
                    progress((k + 1) / self.views)
        for future in filled:
            future.result()
        return [np.concatenate(s) for s in zip(*strips, strict=True)]

    def _row(self, frames):
        """Return geometry and albedo, (tile, views * tile, 4) uint8 each, of one row of views."""
        side = self.tile * self.scale
        with self.raster.drawing(clear=(0, 0, 0, 0)):
            for i, axes in enumerate(frames):
                self._draw(axes, (i * side, 0, side, side))
        surface_texture, shape_texture = self.raster.colors
        with self.strip.drawing():
            self.reduce.draw(textures={'surface': surface_texture, 'shape': shape_texture})
        return [c.download() for c in self.strip.colors]

    def _draw(self, axes, rect):
        half_side = MARGIN * self.radius
        low, high = (axes @ self.center + sign * half_side for sign in (-1, 1))
        self.drawer.look(orthographic(axes, low, high), rect, clear=False)
        set_fragment_uniforms(self.actors, {'ibr_object_from_view': axes.T})
        self.drawer.draw(self.actors)

    def release(self):
        """Free GPU memory; the context is current."""
        for actor in self.actors:
            actor.ReleaseGraphicsResources(self.window)
        for target in (self.raster, self.strip, self.reduce):
            target.release()
        self.drawer.release()


def unlit_actor(part, closed=None):
    """Return a copy of a part's actor that writes unlit colour, normal and depth."""
    if closed is None:
        closed = (
            part.alpha_cutoff is None and winding(part.mesh.points, part.mesh.regular_faces) > 0
        )
    actor = _vtk.vtkActor()
    actor.SetMapper(part.polydata_mapper())
    actor.ForceOpaqueOn()
    prop = _unlit(part.actor.GetProperty())
    if closed and not prop.GetFrontfaceCulling():
        prop.BackfaceCullingOn()  # hidden anyway: a third of the work
    actor.SetProperty(prop)
    if part.actor.GetBackfaceProperty() is not None:
        actor.SetBackfaceProperty(_unlit(part.actor.GetBackfaceProperty()))
    color_texture = copy_texture(part.actor.GetTexture())
    if color_texture is not None:
        actor.SetTexture(color_texture)
    cut_text = _CUT if part.alpha_cutoff else ''  # unused, it would disable early depth tests
    # Images do not store emitted light: it brightens the colour, which is then lit.
    attach_maps(actor, emission_of(part.actor))
    shader_text = {'VTK::Light::Impl': _UNLIT, 'VTK::DepthPeeling::Impl': cut_text + _OUTPUT}
    Feature('bake', fragment=shader_text).attach(actor)
    if cut_text:
        set_fragment_uniforms((actor,), {'ibr_cut': float(part.alpha_cutoff)})
    return actor


def _unlit(prop):
    """Return an unlit copy of a material, with its normals."""
    copy = _vtk.vtkProperty()
    copy_property(copy, prop)
    if prop.GetInterpolation() != _FLAT:
        copy.SetInterpolationToPhong()
    copy.LightingOn()
    copy.SetAmbient(0.0)
    copy.SetDiffuse(1.0)
    copy.SetSpecular(0.0)
    copy.SetOpacity(1.0)
    copy.EdgeVisibilityOff()
    for name in PROPERTY_TEXTURES:
        texture = copy_texture(prop.GetTexture(name))
        if texture is not None:
            copy.RemoveTexture(name)  # or VTK warns that it is replaced
            copy.SetTexture(name, texture)
    return copy


def fill_depth(geometry, tile):
    """Dilate depth into the background of every tile, for rays that pass beside the object.

    Pull-push interpolation within tiles: Gortler et al., "The Lumigraph", SIGGRAPH 1996, 3.4.
    """
    weight = (geometry[..., 1] > 0).astype(np.float32)
    mip_levels = [(geometry[..., 0] * weight, weight)]
    for _ in range(tile.bit_length() - 1):
        mip_levels.append(tuple(map(_halve, mip_levels[-1])))
    filled = np.full_like(mip_levels[-1][0], 127.5)
    for total, weight in reversed(mip_levels):
        if filled.shape != total.shape:
            filled = filled.repeat(2, 0).repeat(2, 1)
        filled = np.where(weight > 0, total / np.maximum(weight, 1e-6), filled)
    geometry[..., 0] = np.rint(filled)


def _halve(a):
    return 0.25 * (a[::2, ::2] + a[1::2, ::2] + a[::2, 1::2] + a[1::2, 1::2])
