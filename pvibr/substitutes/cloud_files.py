"""Billboard clouds as GLB, and as OBJ with its material."""

from __future__ import annotations

import io

import numpy as np

from pvibr.core.files import replacing
from pvibr.io.glb_writer import CLAMPED, GlbWriter

_CUTOFF = 0.5


def write_glb(cloud, path):
    """Write a cloud as binary glTF 2.0."""
    glb, mesh = GlbWriter(), cloud.mesh
    middle = np.asarray(mesh.center)
    tangents = np.asarray(mesh.point_data['Tangents'])
    color, normal = (
        glb.texture(texture.to_array(), CLAMPED, optimize=True)
        for texture in (cloud.texture, cloud.normal_texture)
    )
    reflection = {
        'baseColorTexture': {'index': color},
        'metallicFactor': 0.0,
        'roughnessFactor': 1.0,
    }
    primitive = glb.primitive(
        np.asarray(mesh.points, float) - middle,
        mesh.triangulate().regular_faces,
        normals=mesh.point_data.active_normals,
        coordinates=np.asarray(mesh.active_texture_coordinates),
        TANGENT=np.column_stack([tangents, np.ones(len(tangents))]),
    )
    primitive['material'] = glb.material(
        reflection, normalTexture={'index': normal}, cutoff=_CUTOFF, two_sided=True
    )
    number = glb.add('meshes', {'primitives': [primitive]})
    glb.scene([glb.add('nodes', {'mesh': number, 'translation': middle.tolist()})])
    glb.write(path)
    return [path]


def _png(texture):
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.asarray(texture.to_array())).save(stream, 'PNG', optimize=True)
    return stream.getvalue()


def write_obj(cloud, path):
    """Write a cloud as OBJ, with material and two images beside it."""
    stem = path.stem.replace(' ', '_')  # OBJ names end at a space
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
    # The mesh last, as it refers to the others.
    for file, content in (
        (color, _png(cloud.texture)),
        (normal, _png(cloud.normal_texture)),
        (material, looks.encode()),
        (path, shape.encode()),
    ):
        with replacing(file) as part:
            part.write_bytes(content)
    return [path, material, color, normal]
