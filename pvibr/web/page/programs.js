// Programs of WebGL from VTK's sources, their uniforms by name, and textures.

// Variants of a source that write what is drawn instead of its color: thing and index.
function picking({ vertex, fragment }) {
  const main = 'void main()';
  const found = vertex.includes('int slot = int(known.w);')
    ? vertex.replace('int slot = int(known.w);', '$& ibr_picked = slot;')
    : vertex.includes('ibr_show(int(known.y)')
    ? vertex.replace('ibr_show(int(known.y)', 'ibr_picked = int(known.y); $&')
    : vertex.replace(/int i = int\(block\.w\)[^;]*;/, '$& ibr_picked = i;');
  const placed =
    found === vertex
      ? vertex.replace(/void main\(\)\s*\{/, '$&\n  ibr_picked = gl_VertexID;')
      : found;
  const end = fragment.lastIndexOf('}');
  const code = 'ivec3(ibr_picked, ibr_picked >> 8, ibr_picked >> 16) & 255';
  return {
    vertex: placed.replace(main, `flat out int ibr_picked;\n${main}`),
    fragment:
      fragment
        .slice(0, end)
        .replace(main, `flat in int ibr_picked;\nuniform int ibr_thing;\n${main}`) +
      `  fragOutput0 = vec4(vec3(${code}), float(ibr_thing)) / 255.0;\n}\n`,
  };
}

// Variants that write colors times weights, and weights.
function weighted({ vertex, fragment }) {
  const end = fragment.lastIndexOf('}');
  const declared = fragment
    .slice(0, end)
    .replace(
      /out vec4 fragOutput0;/,
      'layout(location = 0) out vec4 fragOutput0;\nlayout(location = 1) out vec4 ibr_weight;',
    );
  const code = `  float weight = fragOutput0.a * pow(max(1.1 - gl_FragCoord.z, 0.0), 2.0);
  ibr_weight = vec4(weight);
  fragOutput0.rgb *= weight;\n}\n`;
  return { vertex, fragment: declared + code };
}

// Variants that write depth alone: compilers drop what is for colors.
const depth = ({ vertex, fragment }) => ({
  vertex,
  fragment: fragment.replace('out vec4 fragOutput0;', 'vec4 fragOutput0;'),
});

// Variants that write normals in eye space and the numbers of things, as buffers.py has them.
function surfaces({ vertex, fragment }) {
  const end = fragment.lastIndexOf('}');
  const lit = /vec3 normalVCVSOutput\s*=/.test(fragment);
  const code = `
#ifdef IBR_NORMAL
  vec3 ibr_n = normalize(IBR_NORMAL);
#else
  vec3 ibr_n = ${lit ? 'normalVCVSOutput' : 'vec3(2.0)'};
#endif
  float ibr_id = float(ibr_thing);
  fragOutput0 = vec4(ibr_n.xy, ibr_n.z < 0.0 ? -ibr_id : ibr_id, 1.0);\n}\n`;
  const declared = fragment.slice(0, end).replace('void main()', 'uniform int ibr_thing;\nvoid main()');
  return { vertex, fragment: declared + code };
}

const VARIANTS = { '': (sources) => sources, 'picks': picking, weighted, depth, surfaces };

export class RefusedError extends Error {}

class Program {
  constructor(gl, sources) {
    this.gl = gl;
    this.handle = gl.createProgram();
    for (const [kind, text] of [
      ['VERTEX_SHADER', sources.vertex],
      ['FRAGMENT_SHADER', sources.fragment],
    ]) {
      const shader = gl.createShader(gl[kind]);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(this.handle, shader);
      gl.deleteShader(shader);
    }
    gl.linkProgram(this.handle);
    if (!gl.getProgramParameter(this.handle, gl.LINK_STATUS) && !gl.isContextLost()) {
      const logs = gl
        .getAttachedShaders(this.handle)
        .map((s) => gl.getShaderInfoLog(s))
        .join('\n');
      throw new RefusedError(`${logs}${gl.getProgramInfoLog(this.handle)}`);
    }
    this.uniforms = {};
    this.units = {};
    const count = gl.getProgramParameter(this.handle, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < count; i++) {
      const { name, type } = gl.getActiveUniform(this.handle, i);
      const plain = name.replace(/\[0\]$/, '');
      this.uniforms[plain] = { type, place: gl.getUniformLocation(this.handle, name) };
      if (type === gl.SAMPLER_2D) this.units[plain] = Object.keys(this.units).length;
    }
    this.attributes = {};
    const attributes = gl.getProgramParameter(this.handle, gl.ACTIVE_ATTRIBUTES);
    for (let i = 0; i < attributes; i++) {
      const { name } = gl.getActiveAttrib(this.handle, i);
      this.attributes[name] = gl.getAttribLocation(this.handle, name);
    }
  }

  // Uses it with uniforms of some objects, of which later ones win, and textures by name.
  use(groups, textures = {}) {
    const { gl } = this;
    gl.useProgram(this.handle);
    for (const group of groups) for (const name in group) this.set(name, group[name]);
    for (const name in this.units) {
      gl.activeTexture(gl.TEXTURE0 + this.units[name]);
      gl.bindTexture(gl.TEXTURE_2D, textures[name] ?? null);
      gl.uniform1i(this.uniforms[name].place, this.units[name]);
    }
  }

  set(name, value) {
    const { gl } = this;
    const uniform = this.uniforms[name];
    if (!uniform || uniform.type === gl.SAMPLER_2D) return;
    const { place, type } = uniform;
    if (type === gl.INT || type === gl.BOOL) gl.uniform1i(place, Number(value));
    else if (type === gl.FLOAT && Array.isArray(value)) gl.uniform1fv(place, value);
    else if (type === gl.FLOAT) gl.uniform1f(place, Number(value));
    else if (type === gl.FLOAT_VEC2) gl.uniform2fv(place, value);
    else if (type === gl.FLOAT_VEC3) gl.uniform3fv(place, value);
    else if (type === gl.FLOAT_VEC4) gl.uniform4fv(place, value);
    else if (type === gl.FLOAT_MAT3) gl.uniformMatrix3fv(place, false, value);
    else if (type === gl.FLOAT_MAT4) gl.uniformMatrix4fv(place, false, value);
  }
}

// Lets no vertex be read from a buffer.
export function withoutArrays(gl) {
  gl.bindVertexArray(null);
  for (let i = 0; i < 8; i++) gl.disableVertexAttribArray(i);
}

// Programs by their sources, made when they are first used.
export class Programs {
  constructor(gl) {
    this.gl = gl;
    this.made = new Map();
  }

  of(sources, variant = '') {
    const key = `${variant} ${sources.vertex}${sources.fragment}`;
    if (!this.made.has(key)) this.made.set(key, this.make(VARIANTS[variant](sources)));
    const made = this.made.get(key);
    if (made instanceof RefusedError) throw made;
    return made;
  }

  make(sources) {
    try {
      return new Program(this.gl, sources);
    } catch (error) {
      if (!(error instanceof RefusedError)) throw error;
      console.warn(`a shader was refused: ${error.message}`);
      return error;
    }
  }
}

// A texture of floats, of 8 bits, or of an image; row 0 at v = 0.
export function texture(
  gl,
  source,
  { width, height, linear = false, repeat = false, mipmap = false } = {},
) {
  const handle = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, handle);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
  gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  const filter = linear ? gl.LINEAR : gl.NEAREST;
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
  gl.texParameteri(
    gl.TEXTURE_2D,
    gl.TEXTURE_MIN_FILTER,
    mipmap ? gl.LINEAR_MIPMAP_LINEAR : filter,
  );
  const wrap = repeat ? gl.REPEAT : gl.CLAMP_TO_EDGE;
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, wrap);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, wrap);
  fill(gl, handle, source, width, height);
  if (mipmap) gl.generateMipmap(gl.TEXTURE_2D);
  return handle;
}

// Replaces what is in a texture.
export function fill(gl, handle, source, width, height, channels = source.length / width / height) {
  gl.bindTexture(gl.TEXTURE_2D, handle);
  const target = gl.TEXTURE_2D;
  if (!ArrayBuffer.isView(source))
    gl.texImage2D(target, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, source);
  else if (source instanceof Float32Array) {
    const one = channels === 1;
    gl.texImage2D(
      target,
      0,
      one ? gl.R32F : gl.RGBA32F,
      width,
      height,
      0,
      one ? gl.RED : gl.RGBA,
      gl.FLOAT,
      source,
    );
  } else gl.texImage2D(target, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, source);
}

// The bytes of an image, exact: a canvas would multiply them by alpha.
export function pixelsOf(gl, image) {
  if (ArrayBuffer.isView(image))
    return { data: image, width: image.shape[1], height: image.shape[0] };
  const { width, height } = image;
  const handle = texture(gl, image);
  const target = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, handle, 0);
  const data = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.deleteFramebuffer(target);
  gl.deleteTexture(handle);
  return { data, width, height };
}
