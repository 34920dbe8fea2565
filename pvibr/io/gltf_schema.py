"""The JSON of glTF 2.0 files as types that msgspec validates while it parses."""

from __future__ import annotations

import re
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct, field

#: A pointer to what joints have.
_POINTER = re.compile(
    r'/nodes/(\d{1,9})/(?:(translation|rotation|scale|weights)'
    r'|extensions/KHR_node_visibility/visible)'
)
#: Largest integer that float64, and so JSON, holds exactly.
_LARGEST = 2**53
#: Beyond it float32 and matrix products overflow.
_FARTHEST = 1e30
Number = Annotated[float, Meta(ge=-_FARTHEST, le=_FARTHEST)]
Positive = Annotated[float, Meta(gt=0, le=_FARTHEST)]
NotNegative = Annotated[float, Meta(ge=0, le=_FARTHEST)]
Index = Annotated[int, Meta(ge=0, le=_LARGEST)]
Count = Annotated[int, Meta(ge=1, le=_LARGEST)]
Vec2 = tuple[Number, Number]
Vec3 = tuple[Number, Number, Number]
Vec4 = tuple[Number, Number, Number, Number]
Indices = Annotated[list[Index], Meta(min_length=1)]


class _Thing(Struct, rename='camel', omit_defaults=True, frozen=True, gc=False):
    """Base of all elements."""


class _Named(_Thing, frozen=True, kw_only=True):
    """Base of named elements."""

    name: str | None = None


class Asset(_Thing, frozen=True):
    """Version and origin of the file."""

    version: str
    min_version: str | None = None
    generator: str | None = None
    copyright: str | None = None


class Buffer(_Named, frozen=True):
    """Bytes: the binary chunk, a data URI or an external file."""

    byte_length: Count
    uri: str | None = None


class BufferView(_Named, frozen=True):
    """A slice of a buffer."""

    buffer: Index
    byte_length: Count
    byte_offset: Index = 0
    byte_stride: Annotated[int, Meta(ge=4, le=252)] | None = None
    target: int | None = None


class SparseIndices(_Thing, frozen=True):
    """Indices of the replaced elements."""

    buffer_view: Index
    component_type: Literal[5121, 5123, 5125]
    byte_offset: Index = 0


class SparseValues(_Thing, frozen=True):
    """Values of the replaced elements."""

    buffer_view: Index
    byte_offset: Index = 0


class Sparse(_Thing, frozen=True):
    """Replaced elements of an accessor."""

    count: Count
    indices: SparseIndices
    values: SparseValues


class Accessor(_Named, frozen=True):
    """A typed array in a buffer view."""

    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Count
    #: A name of `gltf_accessors`; unused ones may have any.
    type: str
    buffer_view: Index | None = None
    byte_offset: Index = 0
    normalized: bool = False
    sparse: Sparse | None = None
    min: list[float] | None = None
    max: list[float] | None = None


class Draco(_Thing, frozen=True):
    """A compressed mesh: its bytes, and the numbers of its attributes."""

    buffer_view: Index
    attributes: dict[str, Index]


class PrimitiveExtensions(_Thing, frozen=True):
    """Extensions of a primitive."""

    draco: Draco | None = field(default=None, name='KHR_draco_mesh_compression')


class Primitive(_Thing, frozen=True):
    """Triangles, lines or points of one material."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Meta(ge=0, le=6)] = 4
    targets: list[dict[str, Index]] = []
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class MeshExtras(_Thing, frozen=True):
    """Names of morph targets, as exporters write them by convention."""

    target_names: list[str] | None = None


class Mesh(_Named, frozen=True):
    """Primitives that are morphed together."""

    primitives: Annotated[list[Primitive], Meta(min_length=1)]
    weights: list[Number] = []
    extras: msgspec.Raw = msgspec.Raw()


class LightIndex(_Thing, frozen=True):
    """Reference to a light."""

    light: Index


class Instancing(_Thing, frozen=True):
    """Accessors of the transforms of a node's instances."""

    attributes: dict[str, Index] = {}


class Visibility(_Thing, frozen=True):
    """Whether a node and those below it are shown."""

    visible: bool = True


class NodeExtensions(_Thing, frozen=True):
    """Extensions of a node."""

    instancing: Instancing | None = field(default=None, name='EXT_mesh_gpu_instancing')
    lights: LightIndex | None = field(default=None, name='KHR_lights_punctual')
    visibility: Visibility = field(default=Visibility(), name='KHR_node_visibility')


class Node(_Named, frozen=True):
    """A node of the scene graph."""

    children: list[Index] = []
    matrix: Annotated[list[Number], Meta(min_length=16, max_length=16)] | None = None
    translation: Vec3 = (0.0, 0.0, 0.0)
    rotation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    scale: Vec3 = (1.0, 1.0, 1.0)
    mesh: Index | None = None
    skin: Index | None = None
    weights: list[Number] | None = None
    camera: Index | None = None
    extensions: NodeExtensions = NodeExtensions()


class Scene(_Named, frozen=True):
    """Root nodes of a scene."""

    nodes: list[Index] = []


class Skin(_Named, frozen=True):
    """Joints that deform a mesh."""

    joints: Indices
    inverse_bind_matrices: Index | None = None
    skeleton: Index | None = None


class Pointer(_Thing, frozen=True):
    """The place of a property in the file's JSON."""

    pointer: str


class TargetExtensions(_Thing, frozen=True):
    """Extensions of the target of a channel."""

    pointer: Pointer | None = field(default=None, name='KHR_animation_pointer')


class Target(_Thing, frozen=True):
    """The property that a channel drives."""

    path: str
    node: Index | None = None
    extensions: TargetExtensions = TargetExtensions()

    def place(self):
        """Return node and path: 'visible' for visibility, else a pointer without a node."""
        pointer = self.extensions.pointer
        if self.path != 'pointer' or pointer is None:
            return self.node, self.path
        match = _POINTER.fullmatch(pointer.pointer)
        return (int(match[1]), match[2] or 'visible') if match else (None, pointer.pointer)


class Channel(_Thing, frozen=True):
    """A sampler and its target."""

    sampler: Index
    target: Target


class AnimationSampler(_Thing, frozen=True):
    """Key frames: accessors of times and values."""

    input: Index
    output: Index
    interpolation: Literal['LINEAR', 'STEP', 'CUBICSPLINE'] = 'LINEAR'


class Animation(_Named, frozen=True):
    """Channels that play together."""

    channels: Annotated[list[Channel], Meta(min_length=1)]
    samplers: Annotated[list[AnimationSampler], Meta(min_length=1)]


class TextureTransform(_Thing, frozen=True):
    """Transform of texture coordinates: scale, then rotation, then offset."""

    offset: Vec2 = (0.0, 0.0)
    rotation: Number = 0.0
    scale: Vec2 = (1.0, 1.0)
    tex_coord: Index | None = None


class TextureInfoExtensions(_Thing, frozen=True):
    """Extensions of a texture reference."""

    transform: TextureTransform | None = field(default=None, name='KHR_texture_transform')


class TextureInfo(_Thing, frozen=True):
    """Reference to a texture."""

    index: Index
    tex_coord: Index = 0
    extensions: TextureInfoExtensions = TextureInfoExtensions()


class NormalTextureInfo(TextureInfo, frozen=True):
    """Reference to a normal map."""

    scale: Number = 1.0


class Metallic(_Thing, frozen=True):
    """Metallic-roughness shading."""

    base_color_factor: Vec4 = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | None = None
    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    metallic_roughness_texture: TextureInfo | None = None


class EmissiveStrength(_Thing, frozen=True):
    """Factor of the emissive colour."""

    emissive_strength: NotNegative = 1.0


class SpecularGlossiness(_Thing, frozen=True):
    """Specular-glossiness shading, as files before metallic-roughness have it."""

    diffuse_factor: Vec4 = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: TextureInfo | None = None
    glossiness_factor: Number = 1.0


class Unlit(_Thing, frozen=True):
    """Marks an unlit material."""


class MaterialExtensions(_Thing, frozen=True):
    """Extensions of a material."""

    emissive: EmissiveStrength = field(
        default=EmissiveStrength(), name='KHR_materials_emissive_strength'
    )
    specular_glossiness: SpecularGlossiness | None = field(
        default=None, name='KHR_materials_pbrSpecularGlossiness'
    )
    unlit: Unlit | None = field(default=None, name='KHR_materials_unlit')


class Material(_Named, frozen=True):
    """Look of a primitive."""

    pbr_metallic_roughness: Metallic = Metallic()
    normal_texture: NormalTextureInfo | None = None
    occlusion_texture: TextureInfo | None = None
    emissive_texture: TextureInfo | None = None
    emissive_factor: Vec3 = (0.0, 0.0, 0.0)
    alpha_mode: Literal['OPAQUE', 'MASK', 'BLEND'] = 'OPAQUE'
    alpha_cutoff: NotNegative = 0.5
    double_sided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()


class Sampler(_Named, frozen=True):
    """Filter and wrap modes of a texture."""

    mag_filter: int | None = None
    min_filter: int | None = None
    wrap_s: Literal[33071, 33648, 10497] = 10497
    wrap_t: Literal[33071, 33648, 10497] = 10497


class TextureSource(_Thing, frozen=True):
    """The WebP image of a texture."""

    source: Index | None = None


class TextureExtensions(_Thing, frozen=True):
    """Extensions of a texture."""

    webp: TextureSource | None = field(default=None, name='EXT_texture_webp')


class Texture(_Named, frozen=True):
    """An image and its sampler."""

    source: Index | None = None
    sampler: Index | None = None
    extensions: TextureExtensions = TextureExtensions()


class Image(_Named, frozen=True):
    """An image: a buffer view, a data URI or an external file."""

    uri: str | None = None
    buffer_view: Index | None = None
    mime_type: str | None = None


class Perspective(_Thing, frozen=True):
    """A perspective projection: radians and the file's unit."""

    yfov: Positive
    znear: Positive
    zfar: Positive | None = None
    aspect_ratio: Positive | None = None


class Orthographic(_Thing, frozen=True):
    """An orthographic projection: half sizes in the file's unit."""

    xmag: Number
    ymag: Number
    zfar: Positive
    znear: NotNegative


class Camera(_Named, frozen=True):
    """A camera that looks along -z."""

    type: Literal['perspective', 'orthographic']
    perspective: Perspective | None = None
    orthographic: Orthographic | None = None


class Spot(_Thing, frozen=True):
    """The cone of a spot light, radians from its axis."""

    inner_cone_angle: NotNegative = 0.0
    outer_cone_angle: Positive = 0.7853981633974483


class Light(_Named, frozen=True):
    """A light that shines along -z: lux if directional, else candela."""

    #: 'directional', 'point' or 'spot'; others are left out.
    type: str
    color: Vec3 = (1.0, 1.0, 1.0)
    intensity: NotNegative = 1.0
    range: Positive | None = None
    spot: Spot = Spot()


class Lights(_Thing, frozen=True):
    """All lights of the file."""

    lights: list[Light] = []


class GltfExtensions(_Thing, frozen=True):
    """Extensions of the file."""

    lights: Lights = field(default=Lights(), name='KHR_lights_punctual')


class Gltf(_Thing, frozen=True):
    """The whole file."""

    asset: Asset
    accessors: list[Accessor] = []
    animations: list[Animation] = []
    buffers: list[Buffer] = []
    buffer_views: list[BufferView] = []
    cameras: list[Camera] = []
    images: list[Image] = []
    materials: list[Material] = []
    meshes: list[Mesh] = []
    nodes: list[Node] = []
    samplers: list[Sampler] = []
    scene: Index | None = None
    scenes: list[Scene] = []
    skins: list[Skin] = []
    textures: list[Texture] = []
    extensions: GltfExtensions = GltfExtensions()
    extensions_used: list[str] = []
    extensions_required: list[str] = []
