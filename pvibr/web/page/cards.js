// Cards: four corners each, or a point, which programs place by their number alone.
import { withoutArrays } from './programs.js';

export class Cards {
  constructor(gl) {
    Object.assign(this, { gl, corners: gl.createBuffer(), room: 0 });
  }

  draw(program, count, corners) {
    const { gl } = this;
    withoutArrays(gl);
    for (const attribute of Object.values(program.attributes))
      if (attribute >= 0) gl.vertexAttrib4f(attribute, 0, 0, 0, 1);
    if (corners === 1) return gl.drawArrays(gl.POINTS, 0, count);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.corners);
    if (count > this.room) this.grow(count);
    return gl.drawElements(gl.TRIANGLES, 6 * count, gl.UNSIGNED_INT, 0);
  }

  // Makes room for more cards in the bound buffer.
  grow(count) {
    const { gl } = this;
    this.room = 2 ** Math.ceil(Math.log2(count));
    const index = new Uint32Array(6 * this.room);
    for (let i = 0; i < this.room; i++)
      index.set(
        [0, 1, 2, 0, 2, 3].map((c) => 4 * i + c),
        6 * i,
      );
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
  }
}
