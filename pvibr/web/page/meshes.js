// Triangles, lines and vertices on the GPU, and what colors them.
import { texturePlaces, textureOf } from './coloring.js';
import { texture, fill, withoutArrays } from './programs.js';

const NAMES = { points: ['vertexMC', 3], normals: ['normalMC', 3], coordinates: ['tcoord', 2] };

export class Mesh {
  constructor(gl, tree) {
    this.gl = gl;
    this.tree = tree;
    this.buffers = {};
    this.indices = {};
    for (const key in NAMES) if (tree[key]) this.put(NAMES[key][0], tree[key], NAMES[key][1]);
    if (tree.colors) this.put('scalarColor', tree.colors, 4);
    for (const key of ['faces', 'lines', 'verts', 'edges'])
      if (tree[key]?.length) this.indices[key] = this.index(tree[key]);
    this.textures = {};
    if (tree.texture) {
      const { image, linear, repeat, mipmap } = tree.texture;
      const [height, width] = image.shape ?? [];
      this.textures.actortexture = texture(gl, image, { width, height, linear, repeat, mipmap });
    }
    if (tree.values) this.color(tree.values, tree.coloring);
  }

  put(name, array, size) {
    const { gl } = this;
    const handle = this.buffers[name]?.handle ?? gl.createBuffer();
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, handle);
    gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
    this.buffers[name] = { handle, size, bytes: array instanceof Uint8Array };
  }

  index(array) {
    const { gl } = this;
    const handle = gl.createBuffer();
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, handle);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, array, gl.STATIC_DRAW);
    return { handle, count: array.length };
  }

  color(values, coloring) {
    const { gl } = this;
    this.put('colorTCoord', texturePlaces(values, coloring), 2);
    const { pixels, width } = textureOf(coloring);
    if (this.textures.colortexture) fill(gl, this.textures.colortexture, pixels, width, 2);
    else this.textures.colortexture = texture(gl, pixels, { width, height: 2 });
  }

  bind(program) {
    const { gl } = this;
    withoutArrays(gl);
    for (const name in program.attributes) {
      const place = program.attributes[name];
      const buffer = this.buffers[name];
      if (place < 0) continue;
      if (!buffer) {
        gl.vertexAttrib4f(place, 0, 0, 0, 1);
        continue;
      }
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer.handle);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(
        place,
        buffer.size,
        buffer.bytes ? gl.UNSIGNED_BYTE : gl.FLOAT,
        buffer.bytes,
        0,
        0,
      );
    }
  }

  draw(key, copies = 1) {
    const { gl } = this;
    const index = this.indices[key];
    if (!index) return;
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, index.handle);
    const mode = { faces: gl.TRIANGLES, lines: gl.LINES, edges: gl.LINES, verts: gl.POINTS }[key];
    gl.drawElementsInstanced(mode, index.count, gl.UNSIGNED_INT, 0, copies);
  }
}
