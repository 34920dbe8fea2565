"""What a frame offers beside its colours: depth, normals, and which object is where."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from pvibr.casters import Surfaces, address
from pvibr.effect import Effect
from pvibr.gl import Quad, Target
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature
from pvibr.maths.views import View

NAMES = ('depth', 'normal', 'id', 'color')

_SURFACE = 2  # VTK_SURFACE
# VTK has a normal only where it lights; cards and spheres say where theirs is.
_WRITE = """#ifdef IBR_NORMAL
#define IBR_BUFFERED normalize(IBR_NORMAL)
#else
#define IBR_BUFFERED {normal}
#endif
  if (ibr_id > 0.5) gl_FragData[0] = vec4(IBR_BUFFERED, ibr_id);
//VTK::DepthPeeling::Impl
"""
_LIT, _UNLIT = (
    Feature(name, fragment={'VTK::DepthPeeling::Impl': _WRITE.replace('{normal}', normal)})
    for name, normal in (('buffer_lit', 'normalVCVSOutput'), ('buffer_unlit', 'vec3(0.0)'))
)
_LINEAR = """uniform sampler2D depth; uniform vec2 planes; uniform int parallel;
void main()
{
  float d = texture(depth, uv).r;
  float z = parallel == 1 ? mix(planes.x, planes.y, d)
    : planes.x * planes.y / (planes.y - d * (planes.y - planes.x));
  gl_FragData[0] = vec4(d < 1.0 ? z : -1.0);
}
"""


class Geometry:
    """Normals, numbers and depth of opaque surfaces as the camera sees them, in textures.

    Translucent props and volumes are left out.

    Parameters
    ----------
    renderer : vtkRenderer
        In a window whose context is current.

    Attributes
    ----------
    numbered : list
        Actors and things; ``numbered[i]`` has the number i + 1 in the texture.
    """

    def __init__(self, renderer):
        self.numbered: list = []
        self._drawer = Drawer(renderer)
        self._surfaces = Surfaces(renderer)
        self._target: Target | None = None
        self._dressed: dict = {}

    @property
    def surface(self):
        """View-space normal, 0 where there is none, and number, 0 for nothing; (r, g, b, a)."""
        return self._drawn().colors[0]

    @property
    def depth(self):
        """Depth, 0 near to 1 far."""
        return self._drawn().depth

    def _drawn(self) -> Target:
        if self._target is None:
            msg = 'nothing is drawn yet: call draw first'
            raise RuntimeError(msg)
        return self._target

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self._target.nbytes if self._target else 0

    def draw(self, frame, size, things=(), choice=None):
        """Draw what a frame shows.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame that is drawn.
        size : tuple of 2 int
            Pixels.
        things : sequence of pvibr.Effect
            What draws by actors of its own.
        choice : None, callable or sequence
            Which actors and things; all by default.
        """
        self._surfaces.update(things)
        actors, chosen = self._surfaces.chosen(choice, things)
        self.numbered = [*actors.values(), *chosen]
        seen = replace(frame, casting=True)
        view = View(frame.view_from_world, frame.clip_from_view, frame.near, frame.far,
                    frame.parallel)  # fmt: skip
        with self._sized_target(size).drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            self._drawer.look(view, (0, 0, *size))
            for number, actor in enumerate(actors.values(), 1):
                if actor.GetVisibility():
                    self._draw([actor], number)
            for number, thing in enumerate(chosen, len(actors) + 1):
                if thing.enabled and thing.needed(frame) is True:
                    thing.prepare(seen)
                    self._draw(thing.drawn(), number)
                    thing.finish(seen)
        self._drawer.done()

    def _sized_target(self, size):
        if self._target is None or (self._target.width, self._target.height) != tuple(size):
            if self._target is not None:
                self._target.release()
            self._target = Target(
                self._drawer.window, size[0], size[1], ('rgba32f',), depth=True, filter='nearest'
            )
        return self._target

    def _draw(self, actors, number):
        with self._numbered(actors, number):
            self._drawer.draw(actors)

    @contextmanager
    def _numbered(self, actors, number):
        for actor in actors:
            lit = _is_lit(actor, self._drawer.renderer)
            (_UNLIT if lit else _LIT).detach(actor)
            (_LIT if lit else _UNLIT).attach(actor)
            self._dressed[address(actor)] = actor
            _set_number(actor, number)
        try:
            yield
        finally:
            for actor in actors:
                _set_number(actor, 0)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        for actor in self._dressed.values():
            _LIT.detach(actor)
            _UNLIT.detach(actor)
        self._dressed = {}
        if self._target is not None:
            self._target.release()
            self._target = None
        self._drawer.release()


def _set_number(actor, number):
    actor.GetShaderProperty().GetFragmentCustomUniforms().SetUniformf('ibr_id', float(number))


def _is_lit(actor, renderer) -> bool:
    """Tell whether VTK has a normal in every program that draws an actor."""
    prop, data = actor.GetProperty(), actor.GetMapper().GetInput()
    if not prop.GetLighting() or not any(light.GetSwitch() for light in renderer.GetLights()):
        return False
    if data is None or not data.IsA('vtkDataSet'):
        return data is not None
    if prop.GetInterpolation() and data.GetPointData().GetNormals() is not None:
        return True
    if prop.GetRepresentation() != _SURFACE:
        return False
    return not (data.IsA('vtkPolyData') and data.GetNumberOfVerts() + data.GetNumberOfLines())


class Buffers:
    """One frame's buffers, as textures for effects and as arrays.

    Parameters
    ----------
    renderer : vtkRenderer
        Whose frames.
    """

    def __init__(self, renderer):
        self.renderer = renderer
        self._geometry: Geometry | None = None
        self._drawn = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self._geometry.nbytes if self._geometry else 0

    @property
    def numbered(self) -> list:
        """Actors and things that ids are indices into."""
        return list(self._geometry.numbered) if self._geometry else []

    def geometry(self, frame, size, things) -> Geometry:
        """Return normals and numbers of a frame, drawn when first asked for.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame that is drawn.
        size : tuple of 2 int
            Pixels.
        things : sequence of pvibr.Effect
            What draws by actors of its own.

        Returns
        -------
        Geometry
            Of all actors.
        """
        if self._geometry is None:
            self._geometry = Geometry(self.renderer)
        if self._drawn is not frame:
            self._geometry.draw(frame, size, things)
            self._drawn = frame
        return self._geometry

    def array(self, name, frame, picture, things) -> np.ndarray:
        """Return a buffer of a frame.

        Parameters
        ----------
        name : {'depth', 'normal', 'id', 'color'}
            Which.
        frame : pvibr.frame.Frame
            The frame that is drawn.
        picture : pvibr.gl.picture.Picture
            Its pixels.
        things : sequence of pvibr.Effect
            What draws by actors of its own.

        Returns
        -------
        numpy.ndarray
            float32, top row first.
        """
        if name == 'color':
            texels = picture.color.download()
            scale = 255 if texels.dtype == np.uint8 else 1
            return np.ascontiguousarray(texels[::-1].astype(np.float32) / scale)
        if name == 'depth':
            far = self._linear_depth(frame, picture)[::-1, :, 0]
            return np.where(far < 0, np.float32(np.inf), far)
        texels = self.geometry(frame, picture.size, things).surface.download()[::-1]
        return texels[..., 3] - 1 if name == 'id' else np.ascontiguousarray(texels[..., :3])

    def _linear_depth(self, frame, picture):
        width, height = picture.size
        quad = Quad(frame.window, _LINEAR, 'linear depth')
        target = Target(frame.window, width, height, ('r32f',), filter='nearest')
        try:
            with target.drawing():
                planes = {'planes': (frame.near, frame.far), 'parallel': int(frame.parallel)}
                quad.draw(planes, {'depth': picture.depth})
            return target.colors[0].download()
        finally:
            target.release()
            quad.release()

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        if self._geometry is not None:
            self._geometry.release()
        self._geometry = self._drawn = None


class Tap(Effect):
    """Reads a buffer of the next frame; the picture stays as it is.

    Parameters
    ----------
    buffer : {'depth', 'normal', 'id', 'color'}
        Which.

    Attributes
    ----------
    array : numpy.ndarray or None
        What was read.
    numbered : list
        Actors and things that ids are indices into.
    """

    def __init__(self, buffer):
        if buffer not in NAMES:
            msg = f'buffer = {buffer!r}: must be one of {", ".join(map(repr, NAMES))}'
            raise ValueError(msg)
        super().__init__()
        self.buffer, self.array = buffer, None
        self.numbered: list = []

    def render(self, frame, picture):
        """Read it.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame that is drawn.
        picture : pvibr.gl.picture.Picture
            Its pixels.
        """
        buffers = self.pipeline.buffers
        self.array = buffers.array(self.buffer, frame, picture, self.pipeline.things)
        self.numbered = buffers.numbered
