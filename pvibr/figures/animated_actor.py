"""A figure in a scene: its meshes as actors, posed on the GPU."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pyvista as pv

from pvibr.animation.joint_tables import joint_table
from pvibr.core.arguments import checked_numbers
from pvibr.core.effect import put_into
from pvibr.core.signatures import takes
from pvibr.figures.figure_picking import nearest_hit, stand_in
from pvibr.figures.figure_posing import FigurePosing
from pvibr.figures.lying import lying_note
from pvibr.figures.mesh_actors import (
    PosedMeshActor,
    as_mesh_actors,
    drawn_figure,
    moved_figure,
    posed_part,
)
from pvibr.figures.player import FigurePlayer
from pvibr.figures.posing import draw_together
from pvibr.maths.transforms import transform_normals, transform_points
from pvibr.meshes.parts import as_parts
from pvibr.things.picking import pixel_ray
from pvibr.things.thing import Thing


class AnimatedActor(FigurePlayer):
    """An animated figure: ordinary actors whose vertices are posed on the GPU.

    Parameters
    ----------
    figure : pvibr.Figure
        Meshes, skeleton and clips.
    name : str, optional
        Name in the plotter and in reports.
    clip : str, int or Clip, optional
        Clip to play from time 0 on; default the first one.
    pickable : bool
        Whether pickers find the figure.
    theme : pyvista.plotting.themes.Theme, optional
        Defaults of the looks.
    skinning : {'linear', 'dual'}
        Linear blend or dual quaternion skinning.
    bulge : float
        Share of dual quaternions, see :func:`pvibr.animation.skinning.dual_blend`.
    **mesh_kwargs
        Keywords of :meth:`pyvista.Plotter.add_mesh`, which override the looks of the meshes.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Figure
    >>> from pvibr.animation import FigureMesh, Skeleton
    >>> from pvibr.figures.animated_actor import AnimatedActor
    >>> wheel = Figure([FigureMesh(pv.Disc(), node=0)], Skeleton([-1], [np.eye(4)]))
    >>> pl = pv.Plotter(off_screen=True)
    >>> actor = pl.ibr.add(AnimatedActor(wheel, color='red'))
    >>> turned = np.eye(4)
    >>> turned[2, 3] = 5.0
    >>> actor.pose = [turned]
    >>> actor.bounds[4:]
    (5.0, 5.0)
    >>> pl.close()
    """

    moved_by = None
    web = 'baked', 'meshes, posed as they are now'

    #: Picking passes need the pose too.
    picks = True
    #: Number of poses so far.
    posed = 0
    _visible: bool | None = None
    _failure: Exception | None = None

    @takes(mesh_kwargs=as_parts)
    def __init__(
        self,
        figure,
        *,
        name=None,
        clip=None,
        pickable=True,
        theme=None,
        skinning='linear',
        bulge=1.0,
        **mesh_kwargs,
    ):
        mesh_options = {key: value for key, value in mesh_kwargs.items() if value is not None}
        figure = drawn_figure(figure, mesh_options, theme)
        super().__init__(figure, clip, skinning=skinning, bulge=bulge)
        self.name = name
        self._mesh_actors = as_mesh_actors(figure, mesh_options, theme)
        self._posed = [a for a in self._mesh_actors if isinstance(a, PosedMeshActor)]
        self._posing = FigurePosing(self._posed)
        self._share_material()
        self.pickable = pickable
        self._stand_ins = [stand_in(self, a.index, a.actor) for a in self._posed]
        # Held: otherwise Python recreates the wrapper of an object.
        self._sources = [a.GetMapper().GetInputAlgorithm() for a in self._stand_ins]
        self._meshes: tuple = (-1, [])
        self._attachments: list[tuple] = []
        self._observers: list[int] = []
        self._drawn_state: tuple = ()

    # -- where it is -------------------------------------------------------------------------

    @property
    def bounds(self):
        """World bounds of the posed figure: (x min, x max, y min, ...)."""
        self._current_moment()
        return super().bounds

    def mesh(self, *, merge=True):
        """Return the posed figure in world space, as :meth:`pvibr.Figure.mesh` returns it.

        Parameters
        ----------
        merge : bool
            Return one mesh; False keeps the figure's meshes apart.
        """
        options = {'skinning': self.skinning, 'bulge': self.bulge, 'merge': merge}
        return moved_figure(self.figure.mesh(pose=self.pose, **options), self.matrix)

    def joints(self, *, world=True):
        """Return where the joints are now, as :meth:`pvibr.Figure.joints` returns it.

        Parameters
        ----------
        world : bool
            In the scene's space, otherwise relative to the parents.
        """
        figure_from_joint = self._current_moment().world
        return joint_table(self.figure.skeleton, self.matrix @ figure_from_joint, world)

    def attach_prop(self, prop, joint, offset=None):
        """Move an actor, or another figure, with a joint: a sword, a rider, a lamp.

        Parameters
        ----------
        prop : pyvista.Actor, thing or pyvista.Light
            Moved by its ``user_matrix``, a light by its ``transform_matrix``; its own position and
            scale are in the joint's space. If it is attached already, its joint changes.
        joint : str or int
            The joint.
        offset : array_like, shape (4, 4), optional
            ``joint_from_prop``; default identity.

        Raises
        ------
        TypeError
            If the prop cannot be moved.
        ValueError
            If there is no such joint, or the offset is not a finite (4, 4) matrix.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh, Pose, Skeleton
        >>> wheel = Figure([FigureMesh(pv.Disc(), node=0)], Skeleton([-1], Pose([[0, 0, 3.0]])))
        >>> pl = pv.Plotter(off_screen=True)
        >>> actor = pl.ibr.add_animated(wheel)
        >>> lamp = pl.add_mesh(pv.Sphere())
        >>> actor.attach_prop(lamp, 0)
        >>> lamp.center
        (0.0, 0.0, 3.0)
        >>> pl.close()
        """
        offset = np.eye(4) if offset is None else checked_numbers('offset', offset, (4, 4))
        if prop is self or not (hasattr(prop, 'SetUserMatrix') or isinstance(prop, pv.Light)):
            raise TypeError(
                f'prop must be an actor, a light or another thing that can be moved, got {prop!r}'
            )
        joint = self.figure.skeleton.index(joint)
        self.detach_prop(prop)
        self._attachments.append((prop, joint, offset))
        _set_transform(prop, self.matrix @ self._current_moment().world[joint] @ offset)

    def add_lights(self, exposure=1.0):
        """Add the lights of the figure's file, which move with their joints.

        Parameters
        ----------
        exposure : float
            Factor of the intensities, which files give in candela and lux: 1 is VTK's full light.

        Returns
        -------
        list of pyvista.Light
            The lights, in the order of ``figure.lights``; :meth:`detach_prop` leaves one where it
            is.

        Raises
        ------
        ValueError
            If the actor is in no plotter.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> pl = pv.Plotter(off_screen=True)
        >>> pl.ibr.add_animated(Figure([])).add_lights()
        []
        >>> pl.close()
        """
        if self.pipeline is None:
            raise ValueError('figure must be in a plotter to add its lights: add it first')
        lights = [light.held(exposure) for light in self.figure.lights]
        for light, placed in zip(lights, self.figure.lights, strict=True):
            self.pipeline.renderer.AddLight(light)
            self.attach_prop(light, placed.node)
        return lights

    def detach_prop(self, prop):
        """Stop moving a prop; no effect if it is not attached.

        Parameters
        ----------
        prop : pyvista.Actor, thing or pyvista.Light
            The attached object.
        """
        self._attachments = [held for held in self._attachments if held[0] is not prop]

    def _pose_key(self) -> tuple:
        return *super()._pose_key(), self.GetMatrix().GetData()

    def _show(self, moment):
        world_from_figure = self.matrix
        for mesh_actor in self._mesh_actors:
            mesh_actor.move(world_from_figure, moment)
        for prop, joint, offset in self._attachments:
            _set_transform(prop, world_from_figure @ moment.world[joint] @ offset)
        self._set_bounds(moment.bounds)
        for source in self._sources:
            source.Modified()

    # -- the life of an effect ---------------------------------------------------------------

    def actors(self) -> list:
        """Return the actors of the meshes, and the stand-ins that pickers find."""
        return [*self._drawing(), *self._stand_ins]

    def _drawing(self) -> list:
        return [mesh_actor.actor for mesh_actor in self._mesh_actors]

    def _materials_of_all(self) -> list:
        return [actor.GetProperty() for actor in self._drawing()]

    def depths(self) -> list:
        """Return actors that draw the depth of the visible meshes."""
        return [a.depth_actor() for a in self._mesh_actors if a.actor.GetVisibility()]

    def solids(self) -> list:
        """Return actors whose mappers hold the posed meshes."""
        if not self.visibility:
            return []
        instead = {b.index: actor for b, actor in zip(self._posed, self._stand_ins, strict=True)}
        return [instead.get(i, self._mesh_actors[i].actor) for i in self._visible_indices()]

    def _visible_indices(self) -> list[int]:
        """Return the indices of the visible meshes."""
        return [i for i, a in enumerate(self._mesh_actors) if a.actor.GetVisibility()]

    def content_key(self) -> tuple:
        """Return a key that changes when the content changes, whatever the camera."""
        return self._changes, self.revision, self.visibility

    def _contents(self) -> str:
        return f'{len(self._mesh_actors)} meshes, {len(self.figure.clips)} clips'

    def attach(self, pipeline):
        """Add its props to the scene."""
        put_into(self, pipeline)
        self._current_moment()
        self._framed = self._changes, self.GetBounds()
        super().attach(pipeline)

    def _put_in(self, renderer):
        super()._put_in(renderer)
        # Before the pipeline starts the frame, so that props are up to date.
        self._observers = [
            renderer.AddObserver('StartEvent', self._on_start),
            renderer.AddObserver('EndEvent', self._on_end),
        ]

    def _on_end(self, _renderer, _event):
        self._show_stand_ins(self.pickable and self.visibility)

    def _show_stand_ins(self, are_visible):
        for actor, mesh_actor in zip(self._stand_ins, self._posed, strict=True):
            actor.SetVisibility(bool(are_visible and mesh_actor.actor.GetVisibility()))

    def _on_start(self, _renderer, _event):
        self._show_stand_ins(False)
        try:
            self._call_finished()
            self._current_moment()
            self._stay_whole(self._changes)
        except Exception as error:  # noqa: BLE001, RUF100
            self._failure = error  # raised in the pipeline: VTK's loop swallows errors

    def _take_out(self, renderer):
        for observer in self._observers:
            renderer.RemoveObserver(observer)
        super()._take_out(renderer)

    def needed(self, frame) -> bool | str:
        """Return True if the figure must be posed."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        self._set_visible(self.visibility)
        return super().needed(frame)

    def deactivate(self):
        """Hide the meshes: unposed, they have no position."""
        self._set_visible(False)
        self._show_stand_ins(False)

    def _set_visible(self, is_visible):
        """Show or hide all meshes on a change; in between, users may hide some."""
        if is_visible != self._visible:
            self._visible = is_visible
            for actor in self._drawing():
                actor.SetVisibility(is_visible)

    def prepare(self, frame):
        """Pose the vertices if the pose changed."""
        if frame.picking and frame.own:
            self._show_stand_ins(self.pickable)
        pose_passes, posed_actors = self._pose_passes(frame.window), [self]
        if pose_passes:
            things = () if self.pipeline is None else self.pipeline.things
            for other_actor in things:  # one pass draws all that moved
                if isinstance(other_actor, AnimatedActor) and other_actor.is_drawn():
                    with suppress(Exception):  # its own prepare reports it
                        pose_passes += other_actor._pose_passes(frame.window)  # noqa: SLF001
                        posed_actors.append(other_actor)
            try:
                draw_together(pose_passes)
            except Exception:
                for actor in posed_actors:
                    actor._drawn_state = ()  # noqa: SLF001
                raise

    def is_drawn(self) -> bool:
        """Return whether frames draw it."""
        return self.enabled and self.visibility and self._visible is not False

    def _pose_passes(self, window) -> list:
        """Return the passes that update the posed meshes, none if they are up to date."""
        moment = self._current_moment()
        pose_state = self._changes, self.skinning, self.bulge
        if not self._posed or pose_state == self._drawn_state:
            return []
        pose_passes = self._posing.passes(window, moment, self.skinning, self.bulge)
        self._drawn_state = pose_state
        self.posed += 1
        return pose_passes

    def finish(self, _frame):
        """Release the texture units."""
        self._posing.unbind()

    def release(self):
        """Release all GPU resources; the context is current."""
        self._posing.release()
        self._drawn_state = ()
        window = None if self.pipeline is None else self.pipeline.window
        if window is not None:
            for mesh_actor in self._mesh_actors:
                mesh_actor.release(window)

    def report(self) -> dict:
        """Return bytes on the GPU, vertices, and the number of poses so far."""
        vertex_count = sum(len(a.figure_mesh.points) for a in self._posed)
        details: dict = {
            'bytes': self._posing.nbytes,
            'vertices': vertex_count,
            'poses': self.posed,
        }
        details |= {'posed by': self._posing.refusal} if self._posing.refusal else {}
        return details | lying_note(self.figure, self.matrix, self.pipeline)

    def download_posed(self):
        """Yield index, points and normals (n, 3) of each mesh as the GPU has it, for tests."""
        if self._posing.gpu is None:
            return
        for index, mesh_actor in enumerate(self._posed):
            count = len(mesh_actor.figure_mesh.points)
            points, normals = (v[:count].astype(float) for v in self._posing.gpu.download(index))
            # What VTK adds to them, here in float64: the middle of the figure, or its node.
            matrix = np.asarray(mesh_actor.actor.user_matrix)
            world_arrays = transform_points(matrix, points), transform_normals(matrix, normals)
            yield mesh_actor.index, *world_arrays

    def bake_into(self, scene):
        """Hand the posed meshes to a scene without pvibr."""
        parts = self._posed_parts(self._current_moment().pose)
        for i in self._visible_indices():
            scene.part(self, parts[i])

    def _posed_parts(self, pose) -> list:
        placement = self.matrix, pose, self.skinning, self.bulge
        return [
            posed_part(self.figure, i, a.part, *placement) for i, a in enumerate(self._mesh_actors)
        ]

    def dataset(self):
        """Return the posed figure in world space."""
        return self.mesh()

    def set_clipping_planes(self, planes):
        """Clip it by a vtkPlaneCollection."""
        for mapper in (actor.GetMapper() for actor in self.actors()):
            mapper.RemoveAllClippingPlanes()
            if planes is not None:
                mapper.SetClippingPlanes(planes)

    # -- picking -----------------------------------------------------------------------------

    def posed_meshes(self) -> list:
        """Return the posed meshes as triangles in world units, one per mesh of the figure."""
        moment = self._current_moment()
        if self._meshes[0] != self._changes:
            posed_parts = self._posed_parts(moment.pose)
            self._meshes = self._changes, [part.mesh for part in posed_parts]
        return self._meshes[1]

    def pick(self, x, y):
        """Return the :class:`FigureHit` at a pixel, or None."""
        if not self.pickable or self.pipeline is None or not self.visibility:
            return None
        meshes = self.posed_meshes()
        visible = {i: meshes[i] for i in self._visible_indices()}
        planes = self.actors()[0].GetMapper().GetClippingPlanes() if visible else None
        ray_origin, ray_direction = pixel_ray(self.pipeline.renderer, x, y)
        return nearest_hit(visible, ray_origin, ray_direction, planes)

    # -- scalar bars -------------------------------------------------------------------------

    def scalar_mapper(self):
        """Return the actor's mapper with the table of the shown scalars, None without scalars."""
        return self._with_table_of(mesh_actor.part for mesh_actor in self._mesh_actors)

    def set_scalar_range(self, clim):
        """Map the scalars by another range."""
        if self._set_range_of([mesh_actor.part for mesh_actor in self._mesh_actors], clim):
            for mesh_actor in self._mesh_actors:
                scalar_range = mesh_actor.part.actor.mapper.GetScalarRange()
                mesh_actor.actor.GetMapper().SetScalarRange(scalar_range)


def _set_transform(prop, world_from_prop):
    """Move an actor, a light or a thing by a matrix."""
    if isinstance(prop, pv.Light):
        prop.transform_matrix = world_from_prop
        return
    prop.SetUserMatrix(pv.vtkmatrix_from_array(world_from_prop))
    if isinstance(prop, Thing):
        prop.follow()
