"""What the JSON of a glTF 2.0 file may say, as types that msgspec checks while it parses."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct, field

#: Beyond the largest number that float64, and so JSON, holds exactly.
_LARGEST = 2**53
#: Beyond it the products of matrices, and float32, overflow.
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


class _Thing(Struct, rename='camel', omit_defaults=True, frozen=True):
    """Anything in the file."""


class _Named(_Thing, frozen=True, kw_only=True):
    """Anything that may have a name."""

    name: str | None = None


class Asset(_Thing, frozen=True):
    """Of which version the file is."""

    version: str
    min_version: str | None = None
    generator: str | None = None
    copyright: str | None = None


class Buffer(_Named, frozen=True):
    """Bytes: in the GLB, in the URI, or in the file that it names."""

    byte_length: Count
    uri: str | None = None


class BufferView(_Named, frozen=True):
    """A part of a buffer."""

    buffer: Index
    byte_length: Count
    byte_offset: Index = 0
    byte_stride: Annotated[int, Meta(ge=4, le=252)] | None = None
    target: int | None = None


class SparseIndices(_Thing, frozen=True):
    """Which elements differ."""

    buffer_view: Index
    component_type: Literal[5121, 5123, 5125]
    byte_offset: Index = 0


class SparseValues(_Thing, frozen=True):
    """How they differ."""

    buffer_view: Index
    byte_offset: Index = 0


class Sparse(_Thing, frozen=True):
    """Elements that differ from those of the buffer view, or from zero."""

    count: Count
    indices: SparseIndices
    values: SparseValues


class Accessor(_Named, frozen=True):
    """An array in a buffer view."""

    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Count
    type: Literal['SCALAR', 'VEC2', 'VEC3', 'VEC4', 'MAT2', 'MAT3', 'MAT4']
    buffer_view: Index | None = None
    byte_offset: Index = 0
    normalized: bool = False
    sparse: Sparse | None = None
    min: list[float] | None = None
    max: list[float] | None = None


class Primitive(_Thing, frozen=True):
    """Triangles, lines or points of one material."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Meta(ge=0, le=6)] = 4
    targets: list[dict[str, Index]] = []


class MeshExtras(_Thing, frozen=True):
    """What exporters agree to write beside the standard: the names of morph targets."""

    target_names: list[str] | None = None


class Mesh(_Named, frozen=True):
    """Primitives that are morphed together."""

    primitives: Annotated[list[Primitive], Meta(min_length=1)]
    weights: list[Number] = []
    extras: msgspec.Raw = msgspec.Raw()


class LightIndex(_Thing, frozen=True):
    """The light at a node."""

    light: Index


class NodeExtensions(_Thing, frozen=True):
    """Extensions of a node."""

    lights: LightIndex | None = field(default=None, name='KHR_lights_punctual')


class Node(_Named, frozen=True):
    """A joint of the scene: where it is, what hangs there."""

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
    """What is shown together."""

    nodes: list[Index] = []


class Skin(_Named, frozen=True):
    """Joints that deform a mesh."""

    joints: Indices
    inverse_bind_matrices: Index | None = None
    skeleton: Index | None = None


class Target(_Thing, frozen=True):
    """What a channel drives."""

    path: str
    node: Index | None = None


class Channel(_Thing, frozen=True):
    """Which sampler drives what."""

    sampler: Index
    target: Target


class AnimationSampler(_Thing, frozen=True):
    """Keys: times and values."""

    input: Index
    output: Index
    interpolation: Literal['LINEAR', 'STEP', 'CUBICSPLINE'] = 'LINEAR'


class Animation(_Named, frozen=True):
    """Channels that play together."""

    channels: Annotated[list[Channel], Meta(min_length=1)]
    samplers: Annotated[list[AnimationSampler], Meta(min_length=1)]


class TextureTransform(_Thing, frozen=True):
    """How texture coordinates are moved: scaled, then turned, then shifted."""

    offset: Vec2 = (0.0, 0.0)
    rotation: Number = 0.0
    scale: Vec2 = (1.0, 1.0)
    tex_coord: Index | None = None


class TextureInfoExtensions(_Thing, frozen=True):
    """Extensions of the use of a texture."""

    transform: TextureTransform | None = field(default=None, name='KHR_texture_transform')


class TextureInfo(_Thing, frozen=True):
    """The use of a texture."""

    index: Index
    tex_coord: Index = 0
    extensions: TextureInfoExtensions = TextureInfoExtensions()


class Metallic(_Thing, frozen=True):
    """Physically based shading."""

    base_color_factor: Vec4 = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | None = None
    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    metallic_roughness_texture: TextureInfo | None = None


class EmissiveStrength(_Thing, frozen=True):
    """A factor of what shines."""

    emissive_strength: NotNegative = 1.0


class Unlit(_Thing, frozen=True):
    """Shown as it is, whatever the lights."""


class MaterialExtensions(_Thing, frozen=True):
    """Extensions of a material."""

    emissive: EmissiveStrength = field(
        default=EmissiveStrength(), name='KHR_materials_emissive_strength'
    )
    unlit: Unlit | None = field(default=None, name='KHR_materials_unlit')


class Material(_Named, frozen=True):
    """How a primitive looks."""

    pbr_metallic_roughness: Metallic = Metallic()
    normal_texture: TextureInfo | None = None
    occlusion_texture: TextureInfo | None = None
    emissive_texture: TextureInfo | None = None
    emissive_factor: Vec3 = (0.0, 0.0, 0.0)
    alpha_mode: Literal['OPAQUE', 'MASK', 'BLEND'] = 'OPAQUE'
    alpha_cutoff: NotNegative = 0.5
    double_sided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()


class Sampler(_Named, frozen=True):
    """How a texture is filtered and repeated."""

    mag_filter: int | None = None
    min_filter: int | None = None
    wrap_s: Literal[33071, 33648, 10497] = 10497
    wrap_t: Literal[33071, 33648, 10497] = 10497


class Texture(_Named, frozen=True):
    """An image and how it is sampled."""

    source: Index | None = None
    sampler: Index | None = None


class Image(_Named, frozen=True):
    """A picture: in a buffer view, in the URI, or in the file that it names."""

    uri: str | None = None
    buffer_view: Index | None = None
    mime_type: str | None = None


class Perspective(_Thing, frozen=True):
    """A camera's frustum: radians and the file's unit."""

    yfov: Positive
    znear: Positive
    zfar: Positive | None = None
    aspect_ratio: Positive | None = None


class Orthographic(_Thing, frozen=True):
    """A camera's box: half sizes, in the file's unit."""

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

    type: Literal['directional', 'point', 'spot']
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
    """A whole file."""

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
