// Posing: where every vertex of a body is in a pose, one texel a vertex.
// Drawn once a pose into two textures, positions and normals; the vertex shaders of all passes
// fetch them by the vertex's number. Shapes (key frames, morph targets, correctives) are weighted
// sums of differences; then joints move the vertex, blended as matrices, or as dual quaternions
// after the stretch: Kavan et al., "Geometric Skinning with Approximate Dual Quaternion Blending",
// ACM Transactions on Graphics 27(4), 2008. The twin in float64 is Figure.posed.
// Spaces: rest = the mesh's, less the middle of its points; posed = the figure's, less an origin
// near the pose, so that floats of 32 bits keep their digits wherever the figure is.
// Texels are looked up at their middles, unfiltered: software drivers have less to do for that than
// for texelFetch.
// Defines: GROUPS, joints a vertex has, divided by 4 (0 without a skin); DUAL, SHAPES and WRAP (the
// state of a pose has several rows) 0 or 1; WIDTH, vertices of a row.

//@pose
uniform sampler2D ibr_rest;           // rest positions
uniform sampler2D ibr_rest_normals;
uniform float ibr_poses;              // how many are drawn together, one above another
uniform sampler2D ibr_state;          // what makes the poses: joints, then shapes
uniform int ibr_state_first;          // first row of the mesh
uniform int ibr_state_rows;           // rows of a pose
uniform vec2 ibr_state_sides;         // texels
#if GROUPS
uniform sampler2D ibr_joints;         // numbers of four joints; groups of rows for more of them
uniform sampler2D ibr_weights;        // the heaviest first
#endif
#if DUAL
uniform float ibr_bulge;
#define HALF_TURN 1e-6
#endif
#if SHAPES
uniform int ibr_palette;              // texels of the joints, before the shapes
uniform sampler2D ibr_shapes;         // differences of positions, a group of rows each
uniform sampler2D ibr_shape_normals;
uniform float ibr_shape_share;        // a group over all rows
#endif

int ibr_pose;  // first row of its state

vec4 ibr_number(int i)
{
#if WRAP
  int width = int(ibr_state_sides.x);
  ivec2 place = ivec2(i % width, i / width);
#else
  ivec2 place = ivec2(i, 0);  // divisions of integers are slow where they are not needed
#endif
  place.y += ibr_pose;
  return textureLod(ibr_state, (vec2(place) + 0.5) / ibr_state_sides, 0.0);
}

vec3 ibr_unit(vec3 v)
{
  float size = length(v);
  return size > 0.0 ? v / size : vec3(0.0);
}

void main()
{
  float up = uv.y * ibr_poses, pose = floor(up);
  vec2 place = vec2(uv.x, up - pose);
  ibr_pose = ibr_state_first + int(pose) * ibr_state_rows;
  vec3 p = textureLod(ibr_rest, place, 0.0).xyz;
  vec3 n = textureLod(ibr_rest_normals, place, 0.0).xyz;
#if SHAPES
  vec4 counts = ibr_number(ibr_palette);  // key frames, all shapes
  for (int i = 0; i < int(counts.y); ++i)
  {
    vec4 shape = ibr_number(ibr_palette + 1 + i);  // its group of rows, its weight
    vec2 there = vec2(place.x, (shape.x + place.y) * ibr_shape_share);
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
    vec2 there = vec2(place.x, (place.y + float(g)) / float(GROUPS));
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
// A shape goes to its group of rows.
uniform sampler2D ibr_shape;
uniform sampler2D ibr_shape_normal;
void main()
{
  ivec2 texel = ivec2(uv * vec2(textureSize(ibr_shape, 0)));
  gl_FragData[0] = texelFetch(ibr_shape, texel, 0);
  gl_FragData[1] = texelFetch(ibr_shape_normal, texel, 0);
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
