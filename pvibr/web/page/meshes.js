// Triangles, lines and vertices on the GPU, and what colors them.
import { texture, fill } from './programs.js';

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

  // Colors values by a table: below the range the first color, above it the last, as VTK does.
  color(values, { range: [low, high], table, nan }) {
    const { gl } = this;
    const count = table.length / 4;
    const places = new Float32Array(2 * values.length);
    const scale = high > low ? 1 / (high - low) : 0;
    for (let i = 0; i < values.length; i++) {
      places[2 * i] = (values[i] - low) * scale;
      places[2 * i + 1] = Number.isNaN(values[i]) ? 1 : 0;
    }
    this.put('colorTCoord', places, 2);
    const pixels = new Uint8Array(8 * count);
    pixels.set(table);
    for (let i = 0; i < count; i++) pixels.set(nan ?? [128, 128, 128, 255], 4 * (count + i));
    if (this.textures.colortexture) fill(gl, this.textures.colortexture, pixels, count, 2);
    else this.textures.colortexture = texture(gl, pixels, { width: count, height: 2 });
  }

  bind(program) {
    const { gl } = this;
    gl.bindVertexArray(null);
    for (let i = 0; i < 8; i++) gl.disableVertexAttribArray(i);
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
