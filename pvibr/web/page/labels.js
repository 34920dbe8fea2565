// Labels of points that surfaces hide: which are, by a query for each after the scene is drawn.
import { withoutArrays } from './programs.js';
import { multiply } from './views.js';

const MARK = {
  vertex: `#version 300 es
uniform mat4 clip_from_world;
uniform vec3 point;
uniform float tolerance;
void main() {
  gl_Position = clip_from_world * vec4(point, 1.0);
  gl_Position.z -= 2.0 * tolerance * gl_Position.w;
  gl_PointSize = 1.0;
}`,
  fragment: `#version 300 es
precision highp float;
out vec4 color;
void main() { color = vec4(0.0); }`,
};

export class HiddenLabels {
  constructor(gl, programs, annotations = []) {
    Object.assign(this, { gl, program: programs.of(MARK), asked: [] });
    this.sets = annotations.filter(({ kind, tolerance }) => kind === 'labels' && tolerance !== null);
    for (const set of this.sets) set.hidden = new Uint8Array(set.texts.length);
  }

  // Asks which points the bound framebuffer's depth hides from a view.
  ask({ eyeFromWorld, clipFromEye }) {
    const { gl, program, sets } = this;
    if (!sets.length) return;
    this.asked.forEach(({ query }) => gl.deleteQuery(query));
    this.asked = [];
    program.use([{ clip_from_world: multiply(clipFromEye, eyeFromWorld) }]);
    withoutArrays(gl);
    gl.colorMask(false, false, false, false);
    gl.depthMask(false);
    for (const set of sets)
      set.texts.forEach((_, i) => {
        program.set('point', set.points.subarray(3 * i, 3 * i + 3));
        program.set('tolerance', set.tolerance);
        const query = gl.createQuery();
        gl.beginQuery(gl.ANY_SAMPLES_PASSED, query);
        gl.drawArrays(gl.POINTS, 0, 1);
        gl.endQuery(gl.ANY_SAMPLES_PASSED);
        this.asked.push({ set, i, query });
      });
    gl.colorMask(true, true, true, true);
    gl.depthMask(true);
  }

  // Takes the answers; false while some are missing.
  answered() {
    const { gl } = this;
    this.asked = this.asked.filter(({ set, i, query }) => {
      if (!gl.getQueryParameter(query, gl.QUERY_RESULT_AVAILABLE)) return true;
      set.hidden[i] = Number(!gl.getQueryParameter(query, gl.QUERY_RESULT));
      gl.deleteQuery(query);
      return false;
    });
    return !this.asked.length;
  }
}
