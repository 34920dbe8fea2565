"""Figures and crowds that play in pages: joints in frames of their clips, and meshes at rest."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from pvibr.animation.mixer import ClipSource, Source
from pvibr.animation.normals import with_flipped_winding
from pvibr.core._vtk import address
from pvibr.core.plotters import names_of
from pvibr.figures.animated_actor import AnimatedActor
from pvibr.figures.crowd import Crowd
from pvibr.figures.crowd_draws import can_share_draws, member_feature
from pvibr.figures.mesh_actors import PosedMeshActor, WireMeshActor
from pvibr.figures.pose_sheet import STATE_WIDTH, WIDTH, shader
from pvibr.figures.posing import posed_feature
from pvibr.figures.shapes import MeshShapes
from pvibr.gl import set_vertex_uniforms
from pvibr.web.container import Frames, Points
from pvibr.web.instance_sets import cards_of, group_of, images_of, part_of, table_of_colors
from pvibr.web.programs import as_es
from pvibr.web.surfaces import WebSurface, thing_of

#: Frames of a clip: at first and at most a second, and the largest error between two, relative to
#: the figure's size.
_LEAST_RATE, _MOST_RATE, _TOLERANCE = 8.0, 128.0, 5e-4
#: Seconds of what plays by other sources than a clip.
_RECORDED = 10.0
#: Poses of a clip of which the bounds are taken.
_BOUNDED = 16
_WEIGHT_TOLERANCE = 0.01  # of a morph target
_UNITS = 65535


def why_still(thing) -> str | None:
    """Return why a page cannot play a figure or a crowd, or None if it can."""
    if type(thing) is AnimatedActor:
        return _why_figure_still(thing)
    state = thing._crowd_state  # noqa: SLF001
    if thing.is_translucent or list(thing.mapper.GetClippingPlanes() or ()):
        return 'it is translucent or clipped'
    levels = [level for group in thing.groups for level in group.levels]
    if state.may_mirror() or not all(can_share_draws(level, False) for level in levels):
        return 'its meshes are mirrored or translucent, or have lines'
    return _why_meshes_still(state.figure, state.mesh_actors, state.skinning)


def _why_figure_still(actor) -> str | None:
    if actor.driver is None:
        return 'it holds a pose'
    if not isinstance(_source_of(actor), Source):
        return 'its driver is not one of pvibr'
    if list(actor.actors()[0].GetMapper().GetClippingPlanes() or ()):
        return 'it is clipped'
    return _why_meshes_still(actor.figure, actor._mesh_actors, actor.skinning)  # noqa: SLF001


def _why_meshes_still(figure, mesh_actors, skinning) -> str | None:
    if skinning != 'linear':
        return 'it is skinned by dual quaternions'
    if not mesh_actors or not len(_joints_of(mesh_actors)):
        return 'no joint moves it'
    if figure.correctives is not None:
        return 'it has correctives'
    if any(isinstance(actor, WireMeshActor) for actor in mesh_actors):
        return 'it has meshes of points or lines'
    if any(mesh.frames is not None for mesh in figure.meshes):
        return 'it is an animation of vertices'
    return None


def what_plays(thing) -> str:
    """Return what a page plays of a figure or a crowd."""
    clips = thing.figure.clips if type(thing) is AnimatedActor else set(thing.clips)
    what = [f'plays {len(clips)} clip{"s" if len(clips) != 1 else ""}']
    attached = [prop for prop, *_ in getattr(thing, '_attachments', ())]
    still = any(not isinstance(prop, pv.Actor) for prop in attached)
    what += ['attached lights and figures stand still'] if still else []
    return ', '.join(what)


def _source_of(actor):
    """Return what a figure plays, after a cross-fade what follows it."""
    return actor._source()  # noqa: SLF001


def posing_program() -> dict:
    """Return the parts of the program that poses vertices, without its defines."""
    text = shader('pose', WIDTH=WIDTH, STATE_WIDTH=STATE_WIDTH, NUMBERS=0, DUAL=0)
    for number in (0, 1):
        text = text.replace(f'gl_FragData[{number}]', f'ibr_out{number}')
    outputs = ''.join(f'layout(location = {n}) out vec4 ibr_out{n};\n' for n in (0, 1))
    header, rest = as_es('#define ibr_begin\n' + text, 'in').split('#define ibr_begin\n')
    return {'header': header, 'source': outputs + rest, 'width': WIDTH, 'state': STATE_WIDTH}


# -- what moves ---------------------------------------------------------------------------------


def _joints_of(mesh_actors) -> np.ndarray:
    """Return the numbers of the joints that move meshes."""
    return np.unique(np.concatenate([_nodes(actor) for actor in mesh_actors]))


def _nodes(mesh_actor) -> np.ndarray:
    if isinstance(mesh_actor, PosedMeshActor) and mesh_actor.figure_mesh.skin is not None:
        return np.asarray(mesh_actor.figure_mesh.skin.nodes)
    node = getattr(mesh_actor, 'node', None)
    node = mesh_actor.figure_mesh.node if node is None else node
    return np.array([node] if node >= 0 else [], int)


def _clip_of(figure, clip, held_weights, joints, origin, size) -> dict:
    """Return a clip as frames of joints and of morph weights, enough for what lies between two."""
    name, poses_at, duration = clip

    def sampled(times):
        poses = poses_at(times)
        weights = poses.weights if held_weights is None else held_weights
        shape = len(times), len(figure.rest.weights)
        weights = np.broadcast_to(weights if np.size(weights) else figure.rest.weights, shape)
        return figure.world(poses)[:, joints, :3], weights

    count = 4 * max(1, round(duration * _LEAST_RATE / 4)) if duration else 0
    while True:
        times = np.linspace(0.0, duration, count + 1)
        frames, weights = sampled(times)
        if not count or count >= duration * _MOST_RATE:
            break
        between, amounts = sampled((times[1:] + times[:-1]) / 2)
        off_weight = np.abs((weights[1:] + weights[:-1]) / 2 - amounts).max(initial=0)
        off = np.abs((frames[1:] + frames[:-1]) / 2 - between)
        scale = np.abs(frames[..., :3]).max(initial=1e-30)
        error = off[..., 3].max(initial=0) / size + 0.3 * off[..., :3].max(initial=0) / scale
        if error <= _TOLERANCE and off_weight <= _WEIGHT_TOLERANCE:
            break
        count *= 2
    columns = np.moveaxis(frames, 0, 2)  # joint, row, frame, column
    axes = columns[..., :3].transpose(0, 3, 2, 1).reshape(-1, count + 1, 3)
    places = columns[..., 3].transpose(0, 2, 1) - origin
    return {
        'name': name,
        'duration': duration,
        'axes': Frames(axes),
        'places': Frames(places),
        'weights': np.array(weights, np.float32),
    }


def _motion(figure, joints, clips, box, held_weights=None) -> dict:
    """Return clips of some joints, with names and durations, relative to a box's middle."""
    low, high = np.asarray(box).reshape(3, 2).T
    origin, size = (low + high) / 2, max(float((high - low).max()), 1e-30)
    return {
        'origin': origin.tolist(),
        'clips': [_clip_of(figure, clip, held_weights, joints, origin, size) for clip in clips],
        'joints': joints.tolist(),
    }


def _clip_poses(figure, clip) -> tuple:
    """Return name, poses by time, and duration of a clip; None is the rest pose."""
    duration = 0.0 if clip is None else float(clip.duration)
    name = 'at rest' if clip is None else clip.name
    return name, lambda t: figure.sample(t, clip, loop=False), duration


def _timing(speed, offset, cycles, count) -> list:
    """Return how clip time follows from time: speed, offset, lengths of a cycle, and cycles."""
    return [speed, offset, cycles, count]


def _part(mesh_actor, origin, joints) -> dict:
    """Return how a mesh follows joints: by one, or by those of its vertices."""
    places = {joint: k for k, joint in enumerate(joints)}
    skin = mesh_actor.figure_mesh.skin if isinstance(mesh_actor, PosedMeshActor) else None
    if skin is None:
        nodes = _nodes(mesh_actor)
        return {'node': places[int(nodes[0])] if len(nodes) else -1}
    to_origin = np.eye(4)
    to_origin[:3, 3] = origin
    return {
        'nodes': [places[int(node)] for node in skin.nodes],
        'bind': (skin.inverse_bind @ to_origin)[:, :3].reshape(-1, 12).astype(np.float32),
        'influences': skin.joints.shape[1],
    }


def _influences(skin, rows) -> dict:
    """Return joints and weights of vertices, heaviest first."""
    order = np.argsort(-skin.weights[rows], axis=1, kind='stable')
    joints = np.take_along_axis(skin.joints[rows], order, 1)
    weights = np.take_along_axis(skin.weights[rows], order, 1)
    return {
        'joints': joints.astype(np.uint16),
        'weights': np.rint(weights * _UNITS).astype(np.uint16),
    }


def _shapes(figure, mesh_actor, rows) -> dict:
    """Return the differences that morph targets make to the points and normals of vertices."""
    index, rows = mesh_actor.index, np.asarray(rows)
    shapes = MeshShapes(figure, index, rows)
    none = np.zeros((len(rows), 3))
    pairs = [[none if v is None else v for v in shapes[k]] for k in range(len(shapes))]
    points, normals = (np.concatenate(values) for values in zip(*pairs, strict=True))
    first = sum(mesh.n_targets for mesh in figure.meshes[:index])
    return {
        'first': first,
        'count': len(shapes),
        'points': Points(points),
        'normals': Points(normals),
    }


def _deformers(figure, mesh_actor, rows) -> dict:
    """Return what moves the vertices of a mesh, beside where it is as a whole."""
    if not isinstance(mesh_actor, PosedMeshActor):
        return {}
    skin, morphs = mesh_actor.figure_mesh.skin, mesh_actor.figure_mesh.morphs
    deformers = {} if skin is None else _influences(skin, rows)
    return deformers | ({} if morphs is None else {'shapes': _shapes(figure, mesh_actor, rows)})


# -- figures ------------------------------------------------------------------------------------


def figure_of(actor, programs, number) -> tuple[dict, list[dict]]:
    """Return what a figure plays, and its meshes as things that follow it by its number."""
    figure, mesh_actors = actor.figure, actor._mesh_actors  # noqa: SLF001
    source, now = _source_of(actor), actor._now()  # noqa: SLF001
    clips: list = [_clip_poses(figure, clip) for clip in figure.clips]
    if type(source) is ClipSource and source.root is None:
        current = next((k for k, c in enumerate(figure.clips) if c is source.clip), len(clips))
        clips += [] if current < len(clips) else [_clip_poses(figure, source.clip)]
        count = np.inf if source.loop and source.count is None else source.count or 1.0
        cycles = 2.0 if source.loop == 'pingpong' else 1.0
        timing = _timing(source.speed, source.offset, cycles, count)
    else:
        current = len(clips)
        clips.append(('as it plays', lambda t: source.sample(now + t), _RECORDED))
        timing = _timing(1.0, -now, 1.0, 1.0)
    box = _box(figure, clips)
    attached = [joint for _, joint, _ in actor._attachments]  # noqa: SLF001
    joints = np.union1d(_joints_of(mesh_actors), attached).astype(int)
    tree = _motion(figure, joints, clips, box, actor._weights) | {  # noqa: SLF001
        'name': actor.name,
        'matrix': actor.matrix.ravel().tolist(),
        'reach': box.tolist(),
        'clip': np.array([current], np.uint16),
        'timing': np.array([timing]),
    }
    shown = [a for a in mesh_actors if actor.visibility and a.actor.GetVisibility()]
    return tree, [_thing(actor, a, tree, programs, number) for a in shown]


def _box(figure, clips) -> np.ndarray:
    """Return bounds of a figure over some poses of all clips, slightly too large."""
    boxes = []
    for _, poses_at, duration in clips:
        poses = poses_at(np.linspace(0.0, duration, _BOUNDED if duration else 1))
        boxes.append(figure.bounds(poses).reshape(-1, 6))
    every = np.concatenate(boxes)
    return np.stack([every[:, ::2].min(0), every[:, 1::2].max(0)], 1).ravel()


def _thing(actor, mesh_actor, tree, programs, number) -> dict:
    """Return a mesh of a figure as a thing."""
    figure = actor.figure
    mesh = mesh_actor.part.mesh
    if mesh_actor._turned:  # noqa: SLF001
        mesh = with_flipped_winding(mesh)
    surface = WebSurface(mesh_actor.actor, mesh)
    part = _part(mesh_actor, surface.origin, tree['joints'])
    part |= _deformers(figure, mesh_actor, surface.source)
    prepare = _posed if isinstance(mesh_actor, PosedMeshActor) else None
    return thing_of(surface, actor.name, programs, prepare) | {
        'pickable': bool(actor.pickable),
        'matrix': tree['matrix'],
        'origin': tree['origin'] if 'nodes' in part else surface.origin.tolist(),
        'follows': part | {'figure': number},
    }


def _posed(actor):
    """Have an actor's vertices be those that are posed."""
    posed_feature().attach(actor)
    set_vertex_uniforms((actor,), {'ibr_posed_row': 0})


def let_follow(actor, tree, number, things):
    """Let things of the actors that are attached to a figure follow its joints."""
    names = names_of(actor.pipeline.renderer)
    figure_from_joint = actor.figure.world(actor.pose)
    for prop, joint, _ in actor._attachments:  # noqa: SLF001
        name = names.get(address(prop))
        for thing in (t for t in things if t['kind'] == 'mesh' and t['name'] == name):
            joint_from_world = np.linalg.inv(actor.matrix @ figure_from_joint[joint])
            joint_from_mesh = joint_from_world @ np.reshape(thing['matrix'], (4, 4))
            thing['follows'] = {
                'figure': number,
                'node': tree['joints'].index(joint),
                'offset': joint_from_mesh.ravel().tolist(),
            }


# -- crowds -------------------------------------------------------------------------------------


def crowd_of(crowd, programs) -> list[dict]:
    """Return a crowd as a set of instances whose meshes are posed."""
    state = crowd._crowd_state  # noqa: SLF001
    table = table_of_colors(crowd)
    trees = []
    for group, limits in zip(crowd.groups, crowd.limits, strict=True):
        if not len(group):
            continue
        tree = _crowd_group(crowd, group, limits, programs)
        playback, ids = state.playback, group.ids
        counts = np.where(playback.loop[ids], np.inf, 1.0)
        rows = [playback.speed[ids], playback.offset[ids], np.ones(len(ids)), counts]
        tree['plays'] |= {
            'name': crowd.name,
            'clip': playback.clip[ids].astype(np.uint16),
            'timing': np.stack(rows, 1),
        }
        tree |= {'kind': 'instances', 'name': crowd.name, 'pickable': bool(crowd.pickable)}
        if table is not None:
            values = np.asarray(crowd.scalars, np.float32)[ids]
            tree |= {'coloring': table, 'scalars': {table['name']: values}}
        trees.append(tree)
    return trees


def _crowd_group(crowd, group, limits, programs) -> dict:
    """Return the members of a crowd: meshes at all sizes, the lightest for the smallest."""
    state = crowd._crowd_state  # noqa: SLF001
    center, radius = group.atlas.center, group.atlas.radius
    box = np.stack([center - radius, center + radius], 1).ravel()
    clips = [_clip_poses(state.figure, motion.clip) for motion in state.motions]
    motion = _motion(state.figure, _joints_of(state.mesh_actors), clips, box)
    levels = [
        [_member_part(*row, motion, programs) for row in zip(v.parts, v.mesh_actors, strict=True)]
        for v in group.levels
    ]
    tree = group_of(group, limits, levels, cards_of(group, limits, programs)) | {'plays': motion}
    if tree['cards']:
        tree |= images_of(group)
        tree['uniforms'] |= {'ibr_pages': list(group.atlas.pages), 'ibr_time': 0.0}
    return tree


def _member_part(part, mesh_actor, motion, programs) -> dict:
    """Return a mesh of a level of a crowd."""
    origin = np.asarray(part.mesh.points, float).mean(0)
    feature = partial(member_feature, is_posed=isinstance(mesh_actor, PosedMeshActor))
    tree = part_of(part, part.mesh, origin, programs, feature)
    source = tree.get('source', np.arange(len(tree['points'].values)))
    follows = _part(mesh_actor, origin, motion['joints'])
    return tree | {
        'follows': follows | _deformers(getattr(mesh_actor, 'figure', None), mesh_actor, source)
    }


def moves(thing) -> bool:
    """Return whether a thing is a figure or a crowd."""
    return type(thing) in (AnimatedActor, Crowd)


def is_played(thing) -> bool:
    """Return whether a page plays a thing."""
    return moves(thing) and why_still(thing) is None
