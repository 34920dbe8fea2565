"""Views of a model side by side in a small hidden window."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np

from pvibr.core import _vtk
from pvibr.core.errors import ShaderError
from pvibr.gl.binder import Binder
from pvibr.gl.hidden_window import hidden_window, read_pixels
from pvibr.instances.cards import ALWAYS
from pvibr.instances.group import InstanceGroup
from pvibr.instances.mesh_pool import MeshPool
from pvibr.instances.view_pictures import CELL, SAMPLES, fractions
from pvibr.maths import octahedral
from pvibr.things.frame import Frame


class Sheet:
    """Views of a model side by side in a small hidden window, its own or a shared one."""

    def __init__(self, model, layout, views, shared=None):
        self.model, self.layout = model, layout
        with ExitStack() as stack:
            self.window, self.renderer = shared or stack.enter_context(hidden_window())
            self._set_up(views)
            self._context = stack.pop_all()

    def _set_up(self, views):
        self.renderer.SetBackground(0, 0, 0)
        self.renderer.SetBackgroundAlpha(0.0)
        atlas = self.model.atlas
        self.spacing = 2 * atlas.radius * CELL
        poses = _poses(atlas.center, self.spacing, views)
        self.group = InstanceGroup(self.model, Binder(), 1, len(poses))
        self.group.put(poses, np.arange(len(poses), dtype=np.int32))
        self.group.upload(self.window)
        for actor in self.group.cards.actors():
            self.renderer.AddViewProp(actor)
        # The light kit of PyVista's plotters: harder on averaged normals than VTK's headlight.
        self.renderer.RemoveAllLights()
        self.lights = _vtk.vtkLightKit()
        self.lights.AddLightsToRenderer(self.renderer)

    def _resize(self, size, shift=0.0):
        """Set the size in pixels, and shift the camera by a fraction of one to the lower left."""
        cell = round(size * CELL)
        self.window.SetSize(cell * self.layout.side, cell * self.layout.side)
        shift *= self.spacing / cell
        radius, camera = self.model.atlas.radius, self.renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetViewUp(0, 1, 0)
        camera.SetParallelScale(self.spacing * self.layout.side / 2)
        camera.SetClippingRange(2 * radius, 6 * radius)
        camera.SetPosition(-shift, -shift, 4 * radius)
        camera.SetFocalPoint(-shift, -shift, 0)

    def draw_mesh(self, level):
        """Return the samples of a mesh level, premultiplied RGBA uint8."""
        self._resize(self.layout.sizes[-1] * SAMPLES, 0.5)
        pool = MeshPool(self.model.levels[level])
        slots = range(len(self.group))
        actors = pool.show(slots, self.group.matrix, lambda _: (0.0, 0.0, 0.0, 0.5))
        for actor in actors:
            self.renderer.AddViewProp(actor)
        picture = self._picture()
        for actor in actors:
            self.renderer.RemoveViewProp(actor)
            actor.ReleaseGraphicsResources(self.window)
        return picture

    def draw_cards(self, shader, size):
        """Return the image of a shader's cards, premultiplied RGBA, 0 to 1."""
        self._resize(size)
        cards = self.group.cards
        cards.hide()
        frame = Frame.of(self.renderer)
        cards.view(frame)
        index, origins = self.group.blocks.seen(frame)[:2]
        blocks = np.column_stack([origins, index]).astype(np.float32)
        options = {'ranges': (ALWAYS, ALWAYS), 'unit': cards.unit, 'cored': 0}
        cards.layers[shader].show(blocks, [0, len(blocks)], **options)
        picture = fractions(self._picture())
        cards.hide()
        if not cards.layers[shader].landed:
            raise ShaderError(f'this driver does not draw the cards of shader {shader!r}')
        return picture

    def _picture(self):
        self.window.Render()
        self.group.cards.binder.unbind()
        return read_pixels(self.window, alpha=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for actor in self.group.cards.actors():
            self.renderer.RemoveViewProp(actor)
        self.group.release()
        self._context.close()


def _poses(center, spacing, views):
    """Return a pose per view that turns its direction to +z in its cell, jittered."""
    views_per_side = round(len(views) ** 0.5)
    rng = np.random.default_rng(7)
    poses = np.tile(np.eye(4), (len(views), 1, 1))
    poses[:, :3, :3] = octahedral.frame(views)
    column, row = np.meshgrid(np.arange(views_per_side), np.arange(views_per_side))
    cell_positions = np.stack([column.ravel(), row.ravel()], 1) - (views_per_side - 1) / 2
    jitter = rng.uniform(-0.02, 0.02, cell_positions.shape)
    poses[:, :2, 3] = (cell_positions + jitter) * spacing
    poses[:, :3, 3] -= np.einsum('nij,j->ni', poses[:, :3, :3], center)
    return poses
