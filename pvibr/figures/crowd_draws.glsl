// Near members of a crowd, many a draw: as instances/mesh_draws.glsl, whose declarations come first,
// but each with a matrix and a pose of its own. Positions and normals of poses are texels, as in
// posing.glsl.
// Defines: POSED 1 where vertices are posed, 0 where the mesh is rigid; WIDTH of a row of vertices.

//@vertex.members
uniform sampler2D ibr_entries;    // per member three rows of eye from mesh, then: row of its pose, slot,
                                  // share of its pixels, distance that it may be off, negative
                                  // where joints mirror it
#if POSED
uniform sampler2D ibr_posed;
uniform sampler2D ibr_posed_normals;
vec3 ibr_vertex_normal;
#endif

//@vertex.begin
  {
    int copy = int(floor((float(gl_VertexID) + 0.5) / VERTICES));
    int entry = ibr_first + copy;
    ivec2 place = ivec2(4 * (entry % 1024), entry / 1024);
    vec4 r0 = texelFetch(ibr_entries, place, 0);
    vec4 r1 = texelFetch(ibr_entries, place + ivec2(1, 0), 0);
    vec4 r2 = texelFetch(ibr_entries, place + ivec2(2, 0), 0);
    vec4 known = texelFetch(ibr_entries, place + ivec2(3, 0), 0);
    mat3 eye_from_mesh = transpose(mat3(r0.xyz, r1.xyz, r2.xyz));
#if POSED
    uint id = uint(gl_VertexID - copy * int(VERTICES));
    ivec2 texel = ivec2(int(id % WIDTH), int(known.x) + int(id / WIDTH));
    vec3 position = texelFetch(ibr_posed, texel, 0).xyz;
    ibr_vertex_normal = texelFetch(ibr_posed_normals, texel, 0).xyz;
#else
    vec3 position = vertexMC.xyz / SHRUNK;
#endif
    vec3 at = vec3(r0.w, r1.w, r2.w) + eye_from_mesh * position;
    ibr_show(int(known.y), known.z, abs(known.w), entry < ibr_end, eye_from_mesh, at);
    ibr_normal_matrix *= sign(known.w);
  }
