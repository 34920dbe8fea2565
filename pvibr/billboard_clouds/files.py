"""Billboard clouds as GLB, and as OBJ with its material."""

from __future__ import annotations

import io

import numpy as np

from pvibr.core.files import replacing
from pvibr.formats.glb_writer import GlbWriter

_CUTOFF = 0.5


def write_glb(cloud, path):
    """Write a cloud as binary glTF 2.0."""
    glb, mesh = GlbWriter(), cloud.mesh
    middle = np.asarray(mesh.center)
    uv = np.asarray(mesh.active_texture_coordinates)
    tangents = np.asarray(mesh.point_data['Tangents'])
    attributes = {
        'POSITION': glb.accessor(np.asarray(mesh.points, float) - middle, limits=True),
        'NORMAL': glb.accessor(mesh.point_data.active_normals),
        'TANGENT': glb.accessor(np.column_stack([tangents, np.ones(len(tangents))])),
        'TEXCOORD_0': glb.accessor(uv * [1, -1] + [0, 1]),  # glTF counts rows from the top
    }
    sampler = glb.add('samplers', {'wrapS': 33071, 'wrapT': 33071})  # CLAMP_TO_EDGE
    color, normal = (
        glb.add('textures', {'source': _image(glb, texture), 'sampler': sampler})
        for texture in (cloud.texture, cloud.normal_texture)
    )
    material = {
        'pbrMetallicRoughness': {
            'baseColorTexture': {'index': color},
            'metallicFactor': 0.0,
            'roughnessFactor': 1.0,
        },
        'normalTexture': {'index': normal},
        'alphaMode': 'MASK',
        'alphaCutoff': _CUTOFF,
        'doubleSided': True,
    }
    triangles = mesh.triangulate().regular_faces.astype(np.uint32)
    primitive = {
        'attributes': attributes,
        'indices': glb.accessor(triangles.reshape(-1)),
        'material': glb.add('materials', material),
    }
    number = glb.add('meshes', {'primitives': [primitive]})
    node = glb.add('nodes', {'mesh': number, 'translation': middle.tolist()})
    glb.document['scene'] = glb.add('scenes', {'nodes': [node]})
    glb.write(path)
    return [path]


def _image(glb, texture):
    view = glb.view(_png(texture))
    return glb.add('images', {'bufferView': view, 'mimeType': 'image/png'})


def _png(texture):
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.asarray(texture.to_array())).save(stream, 'PNG', optimize=True)
    return stream.getvalue()


def write_obj(cloud, path):
    """Write a cloud as OBJ, with its material and two pictures beside it."""
    stem = path.stem.replace(' ', '_')  # names in these files end at a blank
    material, color = path.with_name(f'{stem}.mtl'), path.with_name(f'{stem}.png')
    normal = path.with_name(f'{stem}_normals.png')
    looks = (
        'newmtl cloud\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\n'
        f'map_Kd {color.name}\nmap_d -imfchan m {color.name}\nnorm {normal.name}\n'
    )
    mesh = cloud.mesh
    lines = [f'mtllib {material.name}', 'usemtl cloud']
    for key, rows in (
        ('v', np.asarray(mesh.points, float)),
        ('vt', np.asarray(mesh.active_texture_coordinates, float)),
        ('vn', np.asarray(mesh.point_data.active_normals, float)),
    ):
        lines += [' '.join([key, *(f'{x:.9g}' for x in row)]) for row in rows.tolist()]
    lines += [
        'f ' + ' '.join(f'{i}/{i}/{i}' for i in row)
        for row in (mesh.triangulate().regular_faces + 1).tolist()
    ]
    shape = '\n'.join(lines) + '\n'
    # The mesh last: it names the others.
    for file, content in (
        (color, _png(cloud.texture)),
        (normal, _png(cloud.normal_texture)),
        (material, looks.encode()),
        (path, shape.encode()),
    ):
        with replacing(file) as part:
            part.write_bytes(content)
    return [path, material, color, normal]
