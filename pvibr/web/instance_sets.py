"""Instances for pages: images and lighter meshes, and the sizes at which they change."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.gl import shader_source
from pvibr.gl.feature import sections
from pvibr.instances import mesh_draws
from pvibr.instances.card_layers import PATCH_SIDE, range_uniforms
from pvibr.instances.cards import CARD_SHADERS, FADE
from pvibr.instances.mesh_draws import copies, draws_feature
from pvibr.instances.mesh_pool import cutoff, with_looks
from pvibr.instances.placement import centers_of
from pvibr.things.shader_draws import card_mesh, is_shiny
from pvibr.things.shared_material import CardMaterial
from pvibr.things.soft_draws import CORE, DEPTH, FRINGE, SOFT, SOLID
from pvibr.web.container import Image
from pvibr.web.surfaces import WebSurface, coloring_of, material_of


def why_not_drawn(thing) -> str | None:
    """Return why a page cannot draw a set of instances with its levels, or None if it can."""
    if thing.is_translucent:
        return 'its colours are translucent'
    if list(thing.mapper.GetClippingPlanes() or ()):
        return 'it is clipped'
    for group in thing.groups:
        if group.atlas.animated or group.atlas.turntable is not None:
            return 'its images are those of clips or a turntable'
        parts = [part for level in group.levels for part in level.parts]
        if any(p.actor.HasTranslucentPolygonalGeometry() or len(p.strokes) for p in parts):
            return 'its mesh is translucent or has lines'
    return None


def instances_of(thing, programs) -> list[dict]:
    """Return a set of instances as things, one of each mesh."""
    table = table_of_colors(thing)
    pairs = zip(thing.groups, thing.limits, strict=True)
    trees = [_group(thing, group, limits, programs) for group, limits in pairs if len(group)]
    for tree in trees:
        tree |= {'kind': 'instances', 'name': thing.name, 'pickable': bool(thing.pickable)}
        if table is not None:
            values = np.asarray(thing.scalars, np.float32)[tree['ids']]
            tree |= {'coloring': table, 'scalars': {table['name']: values}}
    return trees


def table_of_colors(thing) -> dict | None:
    """Return the table by which a set's scalars are coloured, None without scalars."""
    if thing.scalars is None:
        return None
    coloring = coloring_of(thing.scalar_mapper())
    return coloring | {'name': thing.scalar_title() or 'scalars'}


def _group(thing, group, limits, programs) -> dict:
    """Return the instances of one mesh."""
    atlas = group.atlas
    levels = [[_part(part, atlas, programs) for part in level.parts] for level in group.levels]
    tree = group_of(group, limits, levels, cards_of(group, limits, programs))
    return tree | images_of(group) if tree['cards'] else tree


def cards_of(group, limits, programs) -> list[dict]:
    """Return the draws of the card shaders that limits use."""
    spans = limits.cards if group.atlas.errors else {}
    used = [s for s in CARD_SHADERS if s.name in spans and np.subtract(*spans[s.name]).any()]
    return [_layer(shader, group, limits, programs) for shader in used]


def group_of(group, limits, levels, cards) -> dict:
    """Return places, looks and limits of the instances of one mesh, with levels and cards."""
    ids, atlas = group.ids, group.atlas
    poses = group.poses[ids]
    centers = centers_of(group.poses, ids, atlas)
    origin = centers.mean(0)
    tree = {
        'ids': np.asarray(ids, np.uint32),
        'centers': (centers - origin).astype(np.float32),
        'radii': np.asarray(group.radii, np.float32),
        'origin': origin.tolist(),
        'looks': None if group.looks is None else np.asarray(group.looks, np.uint8),
        'uniforms': {n: flattened(v) for n, v in group.cards.uniforms.items()},
        'patch_side': PATCH_SIDE,
        'fade': FADE,
        'mesh_from': limits.mesh_from.tolist(),
        'mesh_to': limits.mesh_to.tolist(),
        'levels': levels,
        'cards': cards,
    }
    if poses.ndim == 3:
        tree['axes'] = poses[:, :3, :3].reshape(-1, 9).astype(np.float32)
    return tree


def images_of(group) -> dict:
    """Return the images of an atlas, rows from the bottom up, one or, of clips, one of each pose.

    And the material of cards, which show them.
    """
    atlas = group.atlas
    geometry, albedo = (
        [Image(p, lossless=is_exact) for p in (pictures if atlas.animated else [pictures])]
        for pictures, is_exact in ((atlas.geometry, True), (atlas.albedo, False))
    )
    return {
        'geometry': geometry,
        'albedo': albedo,
        'tile': atlas.tile,
        'pages': list(atlas.pages) if atlas.animated else [1, 1],
        'bins': atlas.bins if atlas.animated else None,
        'support': atlas.support.astype(np.float32),
        'material': material_of(group.card_prop),
    }


def _layer(shader, group, limits, programs) -> dict:
    """Return the draws of one card shader, their programs included."""
    above, _ = limits.spans[shader.name]
    prop = group.card_prop
    shiny = is_shiny(prop)

    def program(deep):
        feature = shader.feature(shiny, group.atlas.animated, deep=deep)
        return programs.add(card_actor(feature, prop, shader.corners))

    deep = program(deep=True)
    core_size = shader.core_size(group.atlas)
    return {
        'name': shader.name,
        'corners': shader.corners,
        'low': float(above.low[-1]),
        'high': float(above.high[-1]) * FADE,
        'uniforms': {
            'ibr_ranges': flattened(range_uniforms((above.ranges, above.ranges))['ibr_ranges'])
        },
        'core': deep if core_size < shader.largest else None,
        'fringe': deep if shader.steps > 0 else program(deep=False),
        'solid': deep,
        'core_size': min(core_size, 1e9),
        'parts': {
            'core': CORE.uniforms,
            'fringe': (FRINGE if core_size < shader.largest else SOFT).uniforms,
            'solid': SOLID.uniforms,
            'depth': DEPTH.uniforms,
        },
    }


def card_actor(feature, prop, corners) -> pv.Actor:
    """Return an actor that draws a card, for its program."""
    mapper = _vtk.vtkPolyDataMapper()
    mapper.ScalarVisibilityOff()
    mapper.SetInputData(card_mesh(2, corners, np.array([-1.0, 1.0] * 3)))
    actor = pv.Actor()
    actor.SetMapper(mapper)
    actor.SetProperty(CardMaterial(prop))
    _declare_span(actor)
    feature.attach(actor)
    return actor


def _declare_span(actor):
    uniforms = actor.GetShaderProperty().GetVertexCustomUniforms()
    uniforms.SetUniformi('ibr_first', 0)
    uniforms.SetUniformi('ibr_end', 0)


def _part(part, atlas, programs) -> dict:
    """Return a part of a level: its surface and its program."""
    section = sections(shader_source(mesh_draws.__file__))
    texts = section['vertex.instances'], section['vertex.begin']
    feature = partial(draws_feature, declarations=texts[0], begin=texts[1])
    return part_of(part, part.mesh, atlas.center, programs, feature)


def part_of(part, mesh, origin, programs, feature_of) -> dict:
    """Return a part of a level, its points relative to an origin, drawn by a feature."""
    surface = WebSurface(part.actor, mesh, origin)
    mesh = surface.polydata()
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputData(copies(mesh, 1, np.zeros(3)))
    surface.set_mapper(mapper)
    actor = with_looks(part, mapper)
    _declare_span(actor)
    feature_of(mesh).attach(actor)
    return surface.tree() | {
        'program': programs.add(actor),
        'uniforms': {'ibr_cutoff': cutoff(part), 'ibr_tint': [0.0] * 4},
    }


def flattened(value):
    """Return a uniform as numbers, matrices by columns."""
    if isinstance(value, np.ndarray) and value.ndim >= 2:
        return value.swapaxes(-1, -2).ravel().tolist()
    return value.tolist() if isinstance(value, np.ndarray) else value
