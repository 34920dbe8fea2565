// Meshes of instances, many a draw: a vertex buffer holds copies of a mesh, each vertex finds its
// instance by its number. The mesh's own space is replaced by the eye's, and VTK does all else
// (lights, scalars, textures) as ever; the actor's matrix and bounds only tell it where that is.
// Spaces: model = the mesh's, less the centre of its bounding sphere; eye = VTK's VC.
// ibr_first, the first instance of a draw, and ibr_end, the one after its last, are an actor's
// custom uniforms: VTK declares them.
// Defines: VERTICES of one copy, with a decimal point; SHRUNK, the scale of copies; CELL_NORMALS 1 where VTK has no other.

//@vertex.declare
uniform sampler2D ibr_looks;      // per instance rgb, alpha 0 hidden, 128 as it is, 129 to 255 coloured
uniform int ibr_has_looks;
uniform vec4 ibr_tint;            // for all that a program draws, where alpha is 1
uniform mat4 ibr_clip_from_eye;
flat out vec4 ibr_known;          // packed colour, share of its pixels, distance it may be off, alpha
#if CELL_NORMALS
flat out mat3 ibr_eye_normal;
#endif
out vec3 ibr_middle;              // the normal in the middle of a pixel
centroid out vec3 ibr_within;     // and where the pixel is covered
vec4 ibr_vertex;
mat3 ibr_normal_matrix;

// Place a vertex of an instance, which may be a distance off, unless it is not drawn.
void ibr_show(int slot, float share, float distance_off, bool is_drawn, mat3 eye_from_model, vec3 at)
{
  vec4 look = vec4(0.0, 0.0, 0.0, 0.5);
  for (int i = 0; i < ibr_has_looks; ++i)  // software drivers skip loops, not branches
  {
    look = texelFetch(ibr_looks, ivec2(slot % 1024, slot / 1024), 0);
  }
  if (ibr_tint.a > 0.5 && look.a > 0.25) { look = ibr_tint; }
  float color = dot(floor(look.rgb * 255.0 + 0.5), vec3(1.0, 256.0, 65536.0));
  ibr_known = vec4(look.a > 0.504 ? color : -1.0, share, distance_off, look.a);
  ibr_vertex = vec4(at, 1.0);
  // Outside of any view: all corners of a triangle at one place.
  if (!is_drawn || look.a < 0.25) { ibr_vertex.xyz = vec3(1e18); }
  // The inverse transpose; VTK turns normals by the winding that it sees, which a mirrored pose
  // turns around.
  ibr_normal_matrix = mat3(cross(eye_from_model[1], eye_from_model[2]),
    cross(eye_from_model[2], eye_from_model[0]), cross(eye_from_model[0], eye_from_model[1]));
  ibr_normal_matrix /= abs(dot(eye_from_model[0], ibr_normal_matrix[0]));
}

//@vertex.instances
uniform sampler2D ibr_entries;    // of what is drawn: centre in eye space, slot and share
uniform sampler2D ibr_poses;      // rows of the pose, 3 texels an instance (1 where it is a point)
uniform int ibr_texels;           // texels an instance in ibr_poses: 1 or 3
uniform float ibr_radius;         // bounding sphere, model units
uniform mat3 ibr_eye_from_world;

//@vertex.begin
  {
    int entry = ibr_first + int(floor((float(gl_VertexID) + 0.5) / VERTICES));
    vec4 known = texelFetch(ibr_entries, ivec2(entry % 1024, entry / 1024), 0);
    int slot = int(known.w);
    mat3 eye_from_model = ibr_eye_from_world;
    for (int i = 3; i <= ibr_texels; ++i)
    {
      int texel = slot * 3;
      ivec2 place = ivec2(texel % 3072, texel / 3072);
      vec3 r0 = texelFetch(ibr_poses, place, 0).xyz;
      vec3 r1 = texelFetch(ibr_poses, place + ivec2(1, 0), 0).xyz;
      vec3 r2 = texelFetch(ibr_poses, place + ivec2(2, 0), 0).xyz;
      eye_from_model *= transpose(mat3(r0, r1, r2));
    }
    // Of its pixels, while it takes over from a card; nothing behind the slot is all.
    float share = fract(known.w) > 0.0 ? fract(known.w) : 1.0;
    vec3 at = known.xyz + eye_from_model * (vertexMC.xyz / SHRUNK);
    mat3 squares = transpose(eye_from_model) * eye_from_model;
    vec3 sums = abs(squares[0]) + abs(squares[1]) + abs(squares[2]);
    float distance_off = 0.02 * ibr_radius * sqrt(max(max(sums.x, sums.y), sums.z));
    ibr_show(slot, share, distance_off, entry < ibr_end, eye_from_model, at);
#if CELL_NORMALS
    ibr_eye_normal = ibr_normal_matrix;
#endif
  }
//@vertex.placed
// All that VTK does with a vertex, it does with the placed one.
#define vertexMC ibr_vertex
#define MCDCMatrix ibr_clip_from_eye
#define MCVCMatrix mat4(1.0)
//VTK::CustomBegin::Impl

//@vertex.normal
  ibr_middle = ibr_within = vec3(0.0);  // as VTK has none of flat meshes
#define normalVCVSOutput ibr_middle = ibr_within = normalVCVSOutput
#define normalMatrix ibr_normal_matrix
//VTK::Normal::Impl
#undef normalMatrix
#undef normalVCVSOutput

//@fragment.declare
uniform int ibr_multiply;         // instance colours multiply those of the mesh
uniform float ibr_cutoff;
uniform float ibr_dither;         // shift of the pattern by which levels share pixels
flat in vec4 ibr_known;
#if CELL_NORMALS
flat in mat3 ibr_eye_normal;
#endif
vec4 ibr_unpacked()
{
  vec3 color = floor(ibr_known.x * vec3(1.0, 1.0 / 256.0, 1.0 / 65536.0));
  color.xy -= 256.0 * color.yz;
  return ibr_known.x < 0.0 ? vec4(0.0, 0.0, 0.0, 0.5) : vec4(color / 255.0, ibr_known.w);
}
#define ibr_look ibr_unpacked()
#define ibr_share ibr_known.y
#define ibr_place_error ibr_known.z

//@fragment.declare_normal
#define normalVCVSOutput ibr_given_normal
//VTK::Normal::Dec
#undef normalVCVSOutput
in vec3 ibr_middle;
centroid in vec3 ibr_within;
vec3 normalVCVSOutput;

// Some of a pixel's samples may lie in a triangle whose edges its middle is far beyond: there the
// normals of light levels, extrapolated, look away from the eye, and VTK, which turns such, lights
// them from behind. Where they turn less than 14 degrees the middle's serve: drivers shade at one
// of the samples covered, most often the same one, which would shift the light to its side.
vec3 ibr_normal_of_triangle()
{
  float along = dot(ibr_middle, ibr_within);
  float square = dot(ibr_middle, ibr_middle) * dot(ibr_within, ibr_within);
  return along < 0.0 || along * along < 0.94 * square ? ibr_within : ibr_middle;
}

//@fragment.normal
  normalVCVSOutput = ibr_normal_of_triangle();
#define normalMatrix ibr_eye_normal
//VTK::Normal::Impl
#undef normalMatrix
