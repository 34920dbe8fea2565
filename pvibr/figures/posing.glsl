// Posing: where every vertex of a body is in a pose, one texel a vertex.
// Drawn once a pose into rows of two textures that the figures of a window share, positions and
// normals; the vertex shaders of all passes fetch them by the vertex's number. Shapes (key frames,
// morph targets, correctives) are weighted sums of differences; then joints move the vertex, blended
// as matrices, or as dual quaternions after the stretch: Kavan et al., "Geometric Skinning with
// Approximate Dual Quaternion Blending", ACM Transactions on Graphics 27(4), 2008. The twin in
// float64 is Model.posed.
// Spaces: rest = the mesh's, less the middle of its points; posed = the figure's, less an origin
// near the pose, so that floats of 32 bits keep their digits wherever the figure is.
// Texels are looked up at their middles, unfiltered: software drivers have less to do for that than
// for texelFetch.
// A row of the target is a row of a mesh at rest, in the pose of a state.
// Defines: GROUPS, joints a vertex has, divided by 4 (0 without a skin); DUAL and SHAPES 0 or 1;
// NUMBERS, the state of one pose as uniform matrices, 0 for a texture; WIDTH and STATE_WIDTH, vertices
// and numbers of a row, powers of two; TEXTURES, how many are written.

//@pose
uniform sampler2D ibr_rest;           // rest positions
uniform sampler2D ibr_rest_normals;
uniform float ibr_rest_share;         // a row of them over all
#if GROUPS
uniform sampler2D ibr_joints;         // numbers of four joints; further rows for more of them
uniform sampler2D ibr_weights;        // the heaviest first
#endif
#if DUAL
uniform float ibr_bulge;
#define HALF_TURN 1e-6
#endif
#if SHAPES
uniform sampler2D ibr_shapes;         // differences of positions, a group of rows each
uniform sampler2D ibr_shape_normals;
uniform float ibr_shape_share;        // a row over all
uniform float ibr_shape_first;        // row at rest of the first vertex
#endif

#if NUMBERS
uniform mat4 ibr_numbers[NUMBERS];    // of one pose, if they are few: no texture is uploaded
uniform vec4 ibr_place;               // as in ibr_places, less the target's row

vec4 ibr_number(int i)
{
  return ibr_numbers[i >> 2][i & 3];
}
#else
uniform sampler2D ibr_state;          // what makes the poses: joints, then shapes
uniform sampler2D ibr_places;         // row at rest, first number, rows of the mesh, joints
uniform vec2 ibr_shares;              // a row over all, of both
int ibr_first;

vec4 ibr_number(int i)
{
  uint k = uint(ibr_first + i);  // of powers of two: no division is left
  vec2 place = vec2(float(k % uint(STATE_WIDTH)) + 0.5, float(k / uint(STATE_WIDTH)) + 0.5);
  return textureLod(ibr_state, place * vec2(1.0 / float(STATE_WIDTH), ibr_shares.x), 0.0);
}
#endif

vec3 ibr_unit(vec3 v)
{
  float size = length(v);
  return size > 0.0 ? v / size : vec3(0.0);
}

void main()
{
#if NUMBERS
  vec4 row = ibr_place + vec4(gl_FragCoord.y, 0.0, 0.0, 0.0);
#else
  vec4 row = textureLod(ibr_places, vec2(0.5, gl_FragCoord.y * ibr_shares.y), 0.0);
  row.x += 0.5;
  ibr_first = int(row.y);
#endif
  vec2 place = vec2(gl_FragCoord.x / float(WIDTH), row.x * ibr_rest_share);
  vec3 p = textureLod(ibr_rest, place, 0.0).xyz;
  vec3 n = textureLod(ibr_rest_normals, place, 0.0).xyz;
#if SHAPES
  int palette = int(row.w);
  vec4 counts = ibr_number(palette);  // key frames, all shapes
  for (int i = 0; i < int(counts.y); ++i)
  {
    vec4 shape = ibr_number(palette + 1 + i);  // its first row, its weight
    vec2 there = vec2(place.x, (shape.x + row.x - ibr_shape_first) * ibr_shape_share);
    p += shape.y * textureLod(ibr_shapes, there, 0.0).xyz;
    n += shape.y * textureLod(ibr_shape_normals, there, 0.0).xyz;
    if (i + 1 == int(counts.x)) n = ibr_unit(n);
  }
#endif
#if GROUPS
  // Rows of the blended matrix; of dual quaternions, of the stretch that comes first.
  vec4 a = vec4(0.0), b = vec4(0.0), c = vec4(0.0);
#if DUAL
  vec4 real = vec4(0.0), dual = vec4(0.0), heaviest = vec4(0.0);
  vec4 la = vec4(0.0), lb = vec4(0.0), lc = vec4(0.0);
#endif
  for (int g = 0; g < GROUPS; ++g)
  {
    vec2 there = vec2(place.x, (row.x + float(g) * row.z) * ibr_rest_share);
    vec4 joints = textureLod(ibr_joints, there, 0.0);
    vec4 weights = textureLod(ibr_weights, there, 0.0);
    for (int i = 0; i < 4; ++i)
    {
      float w = weights[i];
      if (w == 0.0) break;
#if DUAL
      int k = int(joints[i]) * 8;
      vec4 q = ibr_number(k + 6);
      if (g == 0 && i == 0) heaviest = q;
      float s = dot(q, heaviest) < -HALF_TURN ? -w : w;  // as the twin does
      real += s * q;
      dual += s * ibr_number(k + 7);
      la += w * ibr_number(k + 3);
      lb += w * ibr_number(k + 4);
      lc += w * ibr_number(k + 5);
#else
      int k = int(joints[i]) * 3;
#endif
      a += w * ibr_number(k);
      b += w * ibr_number(k + 1);
      c += w * ibr_number(k + 2);
    }
  }
#if DUAL
  // Quaternions are w, x, y, z in order.
  float size = length(real);
  real /= size;
  dual /= size;
  vec3 v = real.yzw, t = dual.yzw;
  vec3 shift = 2.0 * (real.x * t - dual.x * v + cross(v, t));
  mat3 turn = mat3(  // columns
    1.0 - 2.0 * (v.y * v.y + v.z * v.z), 2.0 * (v.x * v.y + real.x * v.z),
    2.0 * (v.x * v.z - real.x * v.y),
    2.0 * (v.x * v.y - real.x * v.z), 1.0 - 2.0 * (v.x * v.x + v.z * v.z),
    2.0 * (v.y * v.z + real.x * v.x),
    2.0 * (v.x * v.z + real.x * v.y), 2.0 * (v.y * v.z - real.x * v.x),
    1.0 - 2.0 * (v.x * v.x + v.y * v.y));
  mat4 stretch = mat4(a, b, c, vec4(0.0, 0.0, 0.0, 1.0));  // rows as columns
  mat3x4 both = mat3x4(
    stretch * vec4(turn[0].x, turn[1].x, turn[2].x, shift.x),
    stretch * vec4(turn[0].y, turn[1].y, turn[2].y, shift.y),
    stretch * vec4(turn[0].z, turn[1].z, turn[2].z, shift.z));
  a = mix(la, both[0], ibr_bulge);
  b = mix(lb, both[1], ibr_bulge);
  c = mix(lc, both[2], ibr_bulge);
#endif
  // Cofactors are the inverse transpose times the determinant.
  vec3 ca = cross(b.xyz, c.xyz), cb = cross(c.xyz, a.xyz), cc = cross(a.xyz, b.xyz);
  n = vec3(dot(ca, n), dot(cb, n), dot(cc, n)) * (dot(a.xyz, ca) < 0.0 ? -1.0 : 1.0);
  p = vec3(dot(a, vec4(p, 1.0)), dot(b, vec4(p, 1.0)), dot(c, vec4(p, 1.0)));
#endif
  gl_FragData[0] = vec4(p, 1.0);
  gl_FragData[1] = vec4(ibr_unit(n), 0.0);
}

//@store
// Images go to rows.
uniform sampler2D ibr_part0;
uniform sampler2D ibr_part1;
uniform sampler2D ibr_part2;
uniform sampler2D ibr_part3;
uniform float ibr_first;              // row
void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy - vec2(0.0, ibr_first));
  gl_FragData[0] = texelFetch(ibr_part0, texel, 0);
  gl_FragData[1] = texelFetch(ibr_part1, texel, 0);
#if TEXTURES > 2
  gl_FragData[2] = texelFetch(ibr_part2, texel, 0);
  gl_FragData[3] = texelFetch(ibr_part3, texel, 0);
#endif
}

//@vertex.declare
vec4 ibr_vertex;
vec3 ibr_vertex_normal;
// All that VTK does with a vertex, it does with the posed one.
#define vertexMC ibr_vertex

//@vertex.begin
  {
    // Of positive numbers and a power of two: no division is left.
    uint id = uint(gl_VertexID);
    ivec2 texel = ivec2(int(id % WIDTH), ibr_posed_row + int(id / WIDTH));
    ibr_vertex = vec4(texelFetch(ibr_posed, texel, 0).xyz, 1.0);
    ibr_vertex_normal = texelFetch(ibr_posed_normals, texel, 0).xyz;
  }
//VTK::CustomBegin::Impl

//@vertex.normal
#define normalMC ibr_vertex_normal
//VTK::Normal::Impl
#undef normalMC
