// Cards: depth-corrected octahedral impostors, one quad (or one triangle) per instance.
// The vertex shader fetches the instance, chooses its views and lays a card through its centre;
// the fragment shader meets the eye's ray with each view's depth by fixed-point steps, blends the
// views that agree and hands albedo, normal and coverage to VTK's own lighting.
// Sources: Schaufler, "Nailboards", EGWR 1997; Brucks, "Octahedral Impostors", 2018; Policarpo
// and Oliveira, "Relaxed Cone Stepping", GPU Gems 3, ch. 18 (the fixed-point step before it);
// weights by residual: Buehler et al., "Unstructured Lumigraph Rendering", SIGGRAPH 2001.
// Spaces: q = the object's bounding sphere scaled to the unit sphere; eye = VTK's VC.
// ibr_first, the first slot of a draw, and ibr_end, the block after its last, are an actor's custom
// uniforms: VTK declares them.
// IBR_DITHER is a number from 0 to 1 that depends on the pixel, and on its shift.
// Defines: VIEWS_BLENDED 1 or 3; STEPS 0, 1, 2; CORNERS 4 or 1; SPLAT 0 or 1;
// CARD_TAPS 1 or 4: points of a pixel at which its views are looked up;
// PATCH_SIDE, of the square of patches of directions, each with errors of its own;
// ANIMATED 1 where an atlas has a page for each pose of the clips, and instances move;
// HIDES 1 in a depth prepass, whose fragments have the depth of the far end of their instance;
// DEEP 1 where a fragment has the depth of its surface, 0 where it has that of the card's plane;
// TURNED 1 where it has a turntable, whose pictures serve eyes that are level with it; SIDES 1 or 2
// for a card that stands upright and shows one of these: the first, or that nearest to the eye.

//@surface
// Both of a mean over what is covered: of a pixel, or of a whole splat.

vec3 ibr_base_of(vec3 albedo, float coverage, vec4 look, vec4 paint, int multiply)
{
  vec3 base = clamp(albedo / max(coverage, 0.003), 0.0, 1.0);
  if (paint.a > 0.5) { base = paint.rgb; }
  if (look.a > 0.75) { base = multiply == 1 ? base * look.rgb : look.rgb; }
  return base;
}

// Normal in eye space, as long as the mean, and how much it spreads.
vec4 ibr_normal_of(mat3 eye_from_q, vec3 normal, float coverage)
{
  vec3 mean = normal / max(coverage, 0.003);
  float square = min(dot(mean, mean), 1.0);
  vec3 turned = eye_from_q * mean;
  return vec4(turned * sqrt(square / max(dot(turned, turned), 1e-12)), 0.92 * sqrt(1.0 - square));
}

//@vertex.declare
uniform sampler2D ibr_poses;      // rows of the pose, 3 texels an instance (1 where it is a point)
uniform sampler2D ibr_entries;     // visible blocks: origin in eye space, index of the block
uniform sampler2D ibr_looks;      // per instance rgb, alpha 0 hidden, 128 as baked, 255 coloured
uniform int ibr_count;            // instances
uniform int ibr_unit;             // instances of a block
uniform int ibr_nearest_first;    // 1 to draw the entries of a span from its end
uniform float ibr_back;           // how far it is pushed back, in shares of w
uniform vec3 ibr_part;            // coverages from, to; opacity: below 0 the coverage
uniform float ibr_core_level;     // the coarsest level of the pictures whose core is drawn
uniform int ibr_texels;           // texels an instance in ibr_poses: 1 or 3
uniform int ibr_has_looks;
uniform vec4 ibr_tint;            // for all that a program draws, where alpha is 1
uniform int ibr_views;            // N of the N x N grid
uniform int ibr_half;
uniform int ibr_tile;             // texels of a tile
uniform int ibr_parallel;
uniform float ibr_radius;         // bounding sphere, model units
uniform float ibr_margin;         // half side of a tile in radii
uniform sampler2D ibr_support;    // how far it reaches in q, see pvibr.instances.support
uniform float ibr_pixel_scale;    // pixels per unit tangent, or per world unit when parallel
uniform float ibr_sharpness;      // texels per pixel that are asked for
// On-screen diameters in px, a column for each patch of directions: from, to, and 1 where the mesh
// is the next level.
uniform mat4 ibr_ranges[PATCH_SIDE];
uniform float ibr_fade;           // growth by which a level takes over from the one before
#if TURNED
uniform mat4 ibr_turn_ranges[PATCH_SIDE];  // the same for those that the eye is level with
uniform float ibr_turn_level;     // sine of the angle up to which it is
uniform vec3 ibr_turn_axis;       // of the turntable, model space
uniform vec3 ibr_turn_start;      // where azimuth is 0
uniform int ibr_turn_views;       // views around it
#endif
uniform mat3 ibr_eye_from_world;
uniform mat4 ibr_clip_from_eye;
#if ANIMATED
uniform sampler2D ibr_moves;      // per instance: rounds at time 0 and a second, row, goes round
uniform sampler2D ibr_bins;       // a row for each clip: the poses of a cycle
uniform vec2 ibr_pages;           // columns and rows of pages in the atlas
uniform float ibr_time;           // seconds
#endif
out vec4 vertexVCVSOutput;
#if SPLAT
uniform vec3 ibr_box_center;      // bounding box in q: middle and half sides
uniform vec3 ibr_box_half;
uniform sampler2D ibr_geometry;
uniform sampler2D ibr_albedo;
uniform int ibr_multiply;
uniform vec4 ibr_paint;
flat out vec4 ibr_box;                   // its half sides and its first axis, in pixels
flat out float ibr_side;                 // side of the sprite in pixels
flat out vec4 ibr_mean_base;             // colour and coverage of its box: means of the view
flat out vec4 ibr_mean_normal;           // normal and how much it spreads
#else
out vec3 ibr_point[VIEWS_BLENDED];
out vec3 ibr_ray[VIEWS_BLENDED];
flat out vec3 ibr_cell[VIEWS_BLENDED];   // column, row, weight
flat out vec4 ibr_depth_row[VIEWS_BLENDED];
flat out vec4 ibr_level;                 // origin and scale of the level of detail
#endif
#if !SPLAT
flat out mat3 ibr_eye_normal;
flat out vec4 ibr_look;
#endif
flat out float ibr_stretch;              // radius of the instance
flat out vec4 ibr_card;                  // half texel, size in px, where it ends, where it begins
flat out vec2 ibr_part_of;               // coverage up to which it is drawn; 1 if a mesh is next

vec2 ibr_signs(vec2 p) { return vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0); }

vec2 ibr_octahedral(vec3 d)
{
  vec2 p = d.xy / (abs(d.x) + abs(d.y) + abs(d.z));
  return d.z < 0.0 ? (1.0 - abs(p.yx)) * ibr_signs(p) : p;
}

vec2 ibr_encode(vec3 d)
{
  if (ibr_half == 0) { return ibr_octahedral(d); }
  vec2 p = ibr_octahedral(vec3(d.x + 1e-12, d.y, max(d.z, 0.0)));
  return vec2(p.x + p.y, p.x - p.y);
}

// The support function, within a face of the octahedron: never less than it is.
float ibr_support_of(vec3 u)
{
  vec2 p = ibr_octahedral(u);
  float middle = float(textureSize(ibr_support, 0).x / 2);
  vec2 place = abs(p) * middle;
  vec2 low = min(floor(place), middle - 1.0);
  vec2 part = place - low;
  bool beyond = part.x + part.y > 1.0;
  if (beyond) { part = 1.0 - part.yx; }
  vec2 turn = ibr_signs(p);
  float first = texelFetch(ibr_support, ivec2(middle + turn * (beyond ? low + 1.0 : low)), 0).r;
  float x = texelFetch(ibr_support, ivec2(middle + turn * (low + vec2(1.0, 0.0))), 0).r;
  float y = texelFetch(ibr_support, ivec2(middle + turn * (low + vec2(0.0, 1.0))), 0).r;
  return (abs(u.x) + abs(u.y) + abs(u.z)) * (first + part.x * (x - first) + part.y * (y - first));
}

vec3 ibr_decode(vec2 p)
{
  if (ibr_half == 1) { p = 0.5 * vec2(p.x + p.y, p.x - p.y); }
  float z = 1.0 - abs(p.x) - abs(p.y);
  vec2 q = z < 0.0 ? (1.0 - abs(p.yx)) * ibr_signs(p) : p;
  return normalize(vec3(q, z));
}

// Rows: right, up, toward the eye.
mat3 ibr_frame(vec3 d)
{
  vec3 right = normalize(cross(abs(d.z) < 0.99 ? vec3(0.0, 0.0, 1.0) : vec3(0.0, 1.0, 0.0), d));
  return transpose(mat3(right, cross(d, right), d));
}

//@vertex.position
  {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside: an empty slot
    vertexVCVSOutput = vec4(0.0);
    vec4 look = vec4(0.0, 0.0, 0.0, 0.5);
    ibr_stretch = 0.0;
    ibr_card = vec4(0.0);
    ibr_part_of = vec2(0.0);
#if SPLAT
    ibr_box = vec4(0.0);
    ibr_side = 1.0;
    gl_PointSize = 1.0;
    ibr_mean_base = vec4(0.0);
    ibr_mean_normal = vec4(0.0);
#else
    ibr_eye_normal = mat3(1.0);
    ibr_look = look;
    ibr_level = vec4(0.0);
    for (int k = 0; k < VIEWS_BLENDED; ++k)
    {
      ibr_point[k] = vec3(0.0); ibr_ray[k] = vec3(0.0); ibr_cell[k] = vec3(0.0);
      ibr_depth_row[k] = vec4(0.0);
    }
#endif
    int slot = ibr_first + gl_VertexID / CORNERS;
    int corner = gl_VertexID % CORNERS;
    int entry = slot / ibr_unit;
    bool live = entry < ibr_end;
    if (ibr_nearest_first == 1) { entry = ibr_first / ibr_unit + ibr_end - 1 - entry; }
    vec4 block = texelFetch(ibr_entries, live ? ivec2(entry % 1024, entry / 1024) : ivec2(0), 0);
    int i = int(block.w) * ibr_unit + slot % ibr_unit;
    live = live && i < ibr_count;
    if (live)
    {
      int texel = i * ibr_texels;
      vec4 r0 = texelFetch(ibr_poses, ivec2(texel % 3072, texel / 3072), 0);
      mat3 world_from_q = mat3(ibr_radius);
      vec3 center = r0.xyz;
      if (ibr_texels == 3)
      {
        vec4 r1 = texelFetch(ibr_poses, ivec2((texel + 1) % 3072, texel / 3072), 0);
        vec4 r2 = texelFetch(ibr_poses, ivec2((texel + 2) % 3072, texel / 3072), 0);
        world_from_q = transpose(mat3(r0.xyz, r1.xyz, r2.xyz)) * ibr_radius;
        center = vec3(r0.w, r1.w, r2.w);
      }
      if (ibr_has_looks == 1) { look = texelFetch(ibr_looks, ivec2(i % 1024, i / 1024), 0); }
      if (ibr_tint.a > 0.5 && look.a > 0.25) { look = ibr_tint; }
      vec3 c = block.xyz + ibr_eye_from_world * center;
      mat3 eye_from_q = ibr_eye_from_world * world_from_q;
      // Gershgorin's bound of the largest stretch, exact where the columns are at right angles.
      mat3 squares = transpose(eye_from_q) * eye_from_q;
      vec3 sums = abs(squares[0]) + abs(squares[1]) + abs(squares[2]);
      float stretch = sqrt(max(max(sums.x, sums.y), sums.z));
      float away = ibr_parallel == 1 ? 1.0 : length(c);
      float size = 2.0 * stretch * ibr_pixel_scale / away;
      // The inverse transpose by cross products: normals need it, its transpose is the inverse.
      mat3 n = mat3(cross(eye_from_q[1], eye_from_q[2]), cross(eye_from_q[2], eye_from_q[0]),
        cross(eye_from_q[0], eye_from_q[1]));
      n /= dot(eye_from_q[0], n[0]);
      mat3 q_from_eye = transpose(n);
      vec3 eye = ibr_parallel == 1 ? q_from_eye * vec3(0.0, 0.0, 1.0) : -(q_from_eye * c);
      float e = max(length(eye), 1e-30);
      vec3 d = eye / e;
      vec2 cell = (ibr_encode(d) * 0.5 + 0.5) * float(PATCH_SIDE);
      cell = clamp(cell, 0.0, float(PATCH_SIDE) - 0.5);
      ivec2 patch_of = ivec2(cell);
      vec4 range = ibr_ranges[patch_of.y][patch_of.x];
#if TURNED
      vec3 upright = normalize(eye_from_q * ibr_turn_axis);
      float rise = ibr_parallel == 1 ? upright.z : dot(upright, c) / away;
      if (abs(rise) < ibr_turn_level) { range = ibr_turn_ranges[patch_of.y][patch_of.x]; }
#endif
      float texels = size * ibr_sharpness * sqrt(float(CARD_TAPS));
      float lod = max(floor(log2(float(ibr_tile) / texels)), 0.0);
      lod = min(lod, log2(float(ibr_tile)));
      bool cored = lod <= ibr_core_level;
      ibr_part_of = vec2(cored ? ibr_part.y : 2.0, range.z);
      bool shown = (cored || ibr_nearest_first == 0) && look.a > 0.25 && size >= range.x
        && size < range.y * ibr_fade && (ibr_parallel == 1 || c.z < stretch);
#if HIDES
      // None that shares its pixels with another level, or that the near plane may cut.
      vec4 front = ibr_clip_from_eye * vec4(c.xy, c.z + stretch, 1.0);
      shown = shown && size < range.y && size >= range.x * ibr_fade && front.z > -front.w;
#endif
      if (shown)
      {
        vec3 helper = abs(d.z) < 0.99 ? vec3(0.0, 0.0, 1.0) : vec3(0.0, 1.0, 0.0);
        vec3 right = normalize(cross(helper, d));
        vec3 up = cross(d, right);
#if SIDES
        // The card turns about the axis, and shows the picture from where the eye is.
        up = ibr_turn_axis;
        right = normalize(cross(up, d));
        vec3 ahead = cross(right, up);
        vec3 other = cross(ibr_turn_axis, ibr_turn_start);
        float turn = 6.2831853 / float(ibr_turn_views);
        float view = floor(atan(dot(other, ahead), dot(ibr_turn_start, ahead)) / turn + 0.5);
        view = mod(view, float(ibr_turn_views));
        vec3 seen = cos(view * turn) * ibr_turn_start + sin(view * turn) * other;
#endif
#if SIDES == 0
        vec2 g = (ibr_encode(d) * 0.5 + 0.5) * float(ibr_views - 1);
#if !SPLAT
        vec2 base = clamp(floor(g), vec2(0.0), vec2(float(ibr_views - 2)));
        vec2 f = g - base;
#if VIEWS_BLENDED == 3
        vec2 side = f.x > f.y ? vec2(1.0, 0.0) : vec2(0.0, 1.0);
        ibr_cell[0] = vec3(base, 1.0 - max(f.x, f.y));
        ibr_cell[1] = vec3(base + side, abs(f.x - f.y));
        ibr_cell[2] = vec3(base + 1.0, min(f.x, f.y));
#else
        ibr_cell[0] = vec3(base + floor(f + 0.5), 1.0);
#endif
#if STEPS == 0
        vec3 seen = ibr_decode(ibr_cell[0].xy / float(ibr_views - 1) * 2.0 - 1.0);
#endif
#endif
#endif
        float soft = ibr_margin * exp2(lod) / float(ibr_tile) + 1.0 / size;
#if SPLAT
        vec2 q = vec2(dot(right, ibr_box_center), dot(up, ibr_box_center));
        vec2 half_sides = vec2(dot(abs(right), ibr_box_half), dot(abs(up), ibr_box_half));
        float nearer = dot(d, ibr_box_center) + dot(abs(d), ibr_box_half);
#else
        // The card holds the silhouette, and half a texel and half a pixel more for the filters.
        vec2 q = vec2(corner == 1 || corner == 2 ? 1.0 : -1.0, corner >= 2 ? 1.0 : -1.0);
        vec3 across = q.x * right;
        vec3 along = q.y * up;
        float nearer = ibr_support_of(d);
#if SIDES
        across = q.x * cross(up, seen);
#elif STEPS == 0
        // That of the picture, whose points are moved along d to the plane of the card.
        vec3 tilt = d / max(dot(d, seen), 0.5);
        across -= tilt * dot(across, seen);
        along -= tilt * dot(along, seen);
#endif
        vec2 ends = vec2(ibr_support_of(across), ibr_support_of(along));
#if STEPS > 0
        if (ibr_parallel == 0)
        {
          // In perspective rays touch what is nearer. The support function is convex: it is no
          // greater where they do than at both ends, as they are and past the nearest point.
          vec2 past = ends / max(e - min(nearer, 1.0), 0.2);
          vec2 touched = vec2(ibr_support_of(across + past.x * d), ibr_support_of(along + past.y * d));
          ends = max(ends, touched);
        }
#endif
        float reach = ibr_margin;
        if (ibr_parallel == 0) { reach *= inversesqrt(max(1.0 - 1.0 / (e * e), 0.05)); }
        q *= min(ends + soft, vec2(reach));
#endif
        vec3 v = q.x * right + q.y * up;
        vec4 p = vec4(c + eye_from_q * v, 1.0);
        vertexVCVSOutput = p;
        gl_Position = ibr_clip_from_eye * p;
        gl_Position.z += ibr_back * gl_Position.w;
#if HIDES
        vec4 far_end = ibr_clip_from_eye * vec4(p.xy, c.z - stretch, 1.0);
        gl_Position.z = far_end.z / far_end.w * gl_Position.w;
#endif
#if !DEEP
        if (ibr_back > 0.0 && size < range.x * ibr_fade)
        {
          // It blends with the core of a coarser level: in front of the object's nearest point.
          float ahead = clamp(nearer, 0.0, 1.0) * stretch;
          float near_z = ibr_parallel == 1 ? p.z + ahead : p.z * (1.0 - min(ahead / away, 0.5));
          vec4 front = ibr_clip_from_eye * vec4(p.xy, near_z, 1.0);
          gl_Position.z = max(front.z / front.w - 1e-5, -0.9999) * gl_Position.w;
        }
#endif
        vec3 ray = ibr_parallel == 1 ? -d : v - eye;
        ibr_stretch = stretch;
        ibr_card = vec4(0.5 * exp2(lod) / float(ibr_tile), size,
          (size - range.y) / max(range.y * (ibr_fade - 1.0), 1e-6),
          range.x > 0.0 ? (size - range.x) / (range.x * (ibr_fade - 1.0)) : 1.0);
#if ANIMATED
        vec4 move = texelFetch(ibr_moves, ivec2(i % 1024, i / 1024), 0);
        float rounds = move.x + move.y * ibr_time;
        rounds = move.w > 0.5 ? fract(rounds) : clamp(rounds, 0.0, 1.0);
        int bins = textureSize(ibr_bins, 0).x;
        ivec2 bin = ivec2(min(int(rounds * float(bins)), bins - 1), int(move.z));
        int pose = int(texelFetch(ibr_bins, bin, 0).r);
        ivec2 page = ivec2(pose % int(ibr_pages.x), pose / int(ibr_pages.x));
#endif
#if !SPLAT
        // Level 0 fills the left two thirds of the texture, the others are stacked beside it.
        vec2 scale = vec2(2.0 / 3.0, 1.0) * exp2(-lod) / float(ibr_views);
        vec2 origin = lod > 0.0 ? vec2(2.0 / 3.0, 1.0 - exp2(1.0 - lod)) : vec2(0.0);
#if ANIMATED
        origin = (vec2(page) + origin) / ibr_pages;
        scale /= ibr_pages;
#endif
        ibr_level = vec4(origin, scale);
#endif
        // Normals go by the inverse transpose; their length, the spread of an average, is kept.
        mat3 eye_normal = n / length(n[0]);
#if SIDES
        eye_normal *= mat3(right, up, ahead) * transpose(mat3(cross(up, seen), up, seen));
        ivec2 cell = ivec2(int(view) % ibr_views, int(view) / ibr_views);
        ibr_cell[0] = vec3(vec2(cell), 1.0);
        ibr_point[0] = vec3(q, 0.0);
        ibr_ray[0] = vec3(0.0, 0.0, -1.0);
        vec3 deep = vec3(eye_from_q[0].z, eye_from_q[1].z, eye_from_q[2].z);
        ibr_depth_row[0] = vec4(dot(deep, right), dot(deep, up), dot(deep, ahead), c.z);
#endif
#if !SPLAT
        ibr_eye_normal = eye_normal;
        ibr_look = look;
#endif
#if !SIDES
#if SPLAT
        vec2 axis = normalize((eye_from_q * right).xy + vec2(1e-30, 0.0));
        vec2 lengths = vec2(length(eye_from_q * right), length(eye_from_q * up));
        ibr_box = vec4(half_sides * lengths * ibr_pixel_scale / away, axis);
        float fill = ibr_margin * ibr_margin / max(half_sides.x * half_sides.y, 1e-6);
        // The smallest square around what a pixel's own box reaches of it.
        vec2 ends = abs(axis) * (ibr_box.x + 0.5) + abs(axis.yx) * (ibr_box.y + 0.5);
        ibr_side = 2.0 * max(ends.x, ends.y) + 0.02;
        gl_PointSize = ibr_side;
        ivec2 texel = ivec2(g + 0.5) + ibr_views * ivec2(ibr_tile, ibr_tile - 2);
#if ANIMATED
        texel += page * (ibr_views * ibr_tile) * ivec2(3, 2) / 2;
#endif
        vec4 geometry = texelFetch(ibr_geometry, texel, 0);
        vec4 albedo = texelFetch(ibr_albedo, texel, 0);
        vec3 normal = vec3(geometry.ba, albedo.a) * 2.0 - 1.0;
        ibr_mean_base = vec4(ibr_base_of(albedo.rgb, geometry.g, look, ibr_paint, ibr_multiply),
          min(geometry.g * fill, 1.0));
        ibr_mean_normal = ibr_normal_of(eye_normal, normal, geometry.g);
#else
        for (int k = 0; k < VIEWS_BLENDED; ++k)
        {
          vec2 cell = ibr_cell[k].xy;
          mat3 frame = ibr_frame(ibr_decode(cell / float(ibr_views - 1) * 2.0 - 1.0));
          ibr_point[k] = frame * v;
          ibr_ray[k] = frame * ray;
          // Eye-space depth of a point given in the view's axes.
          vec3 row = frame * vec3(eye_from_q[0].z, eye_from_q[1].z, eye_from_q[2].z);
          ibr_depth_row[k] = vec4(row, c.z);
        }
#endif
#endif
      }
    }
  }

//@fragment.declare
uniform sampler2D ibr_geometry;
uniform sampler2D ibr_albedo;
uniform int ibr_multiply;             // instance colours multiply the albedo instead
uniform vec4 ibr_paint;               // a colour in place of the albedo, where alpha is 1
uniform float ibr_margin;
uniform vec3 ibr_part;                // coverages from, to; opacity: below 0 the coverage
uniform int ibr_fades;                // 1 where levels blend with each other
uniform float ibr_dither;             // shift of the pattern by which levels share pixels
uniform float ibr_error;              // px, how far from the mesh a level may be
uniform vec4 ibr_clip_depth;          // rows z and w of clip from eye, z columns: zz, zw, wz, ww
in vec4 vertexVCVSOutput;
#if SPLAT
flat in vec4 ibr_box;
flat in float ibr_side;
flat in vec4 ibr_mean_base;
flat in vec4 ibr_mean_normal;
#else
in vec3 ibr_point[VIEWS_BLENDED];
in vec3 ibr_ray[VIEWS_BLENDED];
flat in vec3 ibr_cell[VIEWS_BLENDED];
flat in vec4 ibr_depth_row[VIEWS_BLENDED];
flat in vec4 ibr_level;
#endif
#if !SPLAT
flat in mat3 ibr_eye_normal;
flat in vec4 ibr_look;
#endif
flat in float ibr_stretch;
flat in vec4 ibr_card;
flat in vec2 ibr_part_of;

// How much the normals of a fragment spread: half the width of the soft corner of its cosine.
float ibr_spread = 1e-4;
float ibr_bend = 2500.0;  // of its parabola: a quarter of the inverse

// The mean of max(0, n . l) over spread normals, which is more than max(0, mean . l): what the
// card of a tree would lose by lighting the mean alone. A normal distribution of n . l of variance
// (1 - |mean|^2) / 3 gives the value 0.4 sigma at 0; the parabola agrees there. VTK's light code
// calls it as max(0, cosine); its max(1e-5, ...) of highlights stays what it is.
float ibr_lit(float least, float cosine)
{
  float soft = clamp(cosine, -ibr_spread, ibr_spread) + ibr_spread;
  float mean = ibr_bend * soft * soft + max(cosine - ibr_spread, 0.0);
  return least < 5e-6 ? mean : max(least, cosine);
}

#if !SPLAT
vec2 ibr_texcoord(vec2 p, vec2 cell)
{
  vec2 t = clamp(p / ibr_margin * 0.5 + 0.5, ibr_card.x, 1.0 - ibr_card.x);
  return ibr_level.xy + (cell + t) * ibr_level.zw;
}

// Adds what the eye's ray meets in one view to the weighted sums.
void ibr_see(vec3 point, vec3 ray, vec3 cell, vec4 depth_row, inout vec4 geometry,
  inout vec4 albedo, inout float weights)
{
  vec2 slope = ray.xy / ray.z;
  vec2 base = point.xy - slope * point.z;
  float h = 0.0;
#if STEPS > 0
  // Where the ray meets the depth: two fixed-point steps. Where one view must do, the second is
  // a secant step, exact on planes however steep, where another fixed-point step would run away;
  // where views are weighed by what they miss, those that run away lose.
  vec2 t0 = ibr_texcoord(base, cell.xy);
  float h1 = (texture(ibr_geometry, t0).r * 2.0 - 1.0) * ibr_margin;
  vec2 t1 = ibr_texcoord(base + slope * h1, cell.xy);
  h = (texture(ibr_geometry, t1).r * 2.0 - 1.0) * ibr_margin;
#if VIEWS_BLENDED == 1
  float bend = 2.0 * h1 - h;
  h = abs(bend) > 0.3 * abs(h1) ? h1 + (h - h1) * h1 / bend : h;
#endif
  h = clamp(h, -ibr_margin, ibr_margin);
#endif
  vec2 p = STEPS > 0 ? base + slope * h : point.xy;
  vec2 t = ibr_texcoord(p, cell.xy);
  vec4 g = texture(ibr_geometry, t);
  vec4 a = texture(ibr_albedo, t);
  float z = (g.r * 2.0 - 1.0) * ibr_margin;
#if VIEWS_BLENDED == 3
  // A view that sees the background where others see the object may just look past an edge.
  float miss = z - h;
  float w = cell.z * (exp2(-400.0 * miss * miss) * (0.3 + 0.7 * g.g) + 1e-6);
#else
  float w = 1.0;
#endif
  float depth = dot(depth_row.xyz, vec3(p, z)) + depth_row.w;
  float inside = step(max(abs(p.x), abs(p.y)), ibr_margin);
  geometry += w * vec4(depth, inside * vec3(g.g, g.ba * 2.0 - 1.0));
  albedo += w * inside * vec4(a.rgb, a.a * 2.0 - 1.0);
  weights += w;
}

vec3 ibr_beside(vec3 point, vec2 off)
{
  return CARD_TAPS == 1 ? point : point + off.x * dFdx(point) + off.y * dFdy(point);
}

// Adds what all views see at a place that is so many pixels off the middle of the pixel.
void ibr_tap(vec2 off, inout vec4 geometry, inout vec4 albedo)
{
  vec4 g = vec4(0.0);
  vec4 a = vec4(0.0);
  float w = 0.0;
  // No loop: NVIDIA's compiler (580.159) loses its sums where normals are not used.
  ibr_see(ibr_beside(ibr_point[0], off), ibr_ray[0], ibr_cell[0], ibr_depth_row[0], g, a, w);
#if VIEWS_BLENDED == 3
  ibr_see(ibr_beside(ibr_point[1], off), ibr_ray[1], ibr_cell[1], ibr_depth_row[1], g, a, w);
  ibr_see(ibr_beside(ibr_point[2], off), ibr_ray[2], ibr_cell[2], ibr_depth_row[2], g, a, w);
#endif
  geometry += g / (float(CARD_TAPS) * w);
  albedo += a / (float(CARD_TAPS) * w);
}
#endif

//@fragment.sample
  vec4 vertexVC = vertexVCVSOutput;
#if SPLAT
  vec4 ibr_g = vec4(vertexVC.z, ibr_mean_base.a, 0.0, 0.0);
#else
  vec4 ibr_g = vec4(0.0);        // eye depth, coverage, normal xy: means over views
  vec4 ibr_a = vec4(0.0);        // albedo, normal z
#if CARD_TAPS == 4
  ibr_tap(vec2(0.125, 0.375), ibr_g, ibr_a);
  ibr_tap(vec2(0.375, -0.125), ibr_g, ibr_a);
  ibr_tap(vec2(-0.125, -0.375), ibr_g, ibr_a);
  ibr_tap(vec2(-0.375, 0.125), ibr_g, ibr_a);
#else
  ibr_tap(vec2(0.0), ibr_g, ibr_a);
#endif
#endif
  // For features that ask where the surface is that is seen, and how well that is known: to a
  // pixel; depth has 8 bits in the pictures, and a splat is as deep as it is large.
#define IBR_PLACE_ERROR (ibr_stretch * (SPLAT == 1 ? 1.0 : clamp(2.0 * ibr_error / ibr_card.y, 0.02, 1.0)))
  vertexVC.xyz = cameraParallel == 1 ? vec3(vertexVC.xy, ibr_g.r)
    : vertexVC.xyz * (ibr_g.r / vertexVC.z);
#define IBR_PLACE vertexVC.xyz
#define IBR_NORMAL ibr_normal
  float ibr_coverage = ibr_g.g;
#if SPLAT
  vec3 ibr_base = ibr_mean_base.rgb;
  vec4 ibr_spread_normal = ibr_mean_normal;
#else
  vec3 ibr_base = ibr_base_of(ibr_a.rgb, ibr_coverage, ibr_look, ibr_paint, ibr_multiply);
  vec4 ibr_spread_normal = ibr_normal_of(ibr_eye_normal, vec3(ibr_g.ba, ibr_a.a), ibr_coverage);
#endif
  vec3 ibr_normal = ibr_spread_normal.xyz;
  ibr_spread = max(ibr_spread_normal.w, 1e-4);
  ibr_bend = 0.25 / ibr_spread;
#if SPLAT
  // The bounding box's rectangle with the view's mean coverage, filtered by the pixel's own box:
  // exact, so that what is smaller than a pixel neither flickers nor vanishes.
  vec2 ibr_off = (gl_PointCoord - 0.5) * vec2(ibr_side, -ibr_side);
  ibr_off = vec2(dot(ibr_off, ibr_box.zw), dot(ibr_off, vec2(-ibr_box.w, ibr_box.z)));
  vec2 ibr_in = clamp(min(ibr_off + 0.5, ibr_box.xy) - max(ibr_off - 0.5, -ibr_box.xy), 0.0, 1.0);
  ibr_coverage *= ibr_in.x * ibr_in.y;
#endif
  // While it takes over from a coarser level a card of coverage c is drawn over it with w c; the
  // coarser one has what is missing to c below it: c (1 - w) / (1 - w c). So edges keep their
  // area and nothing shines through. Before a mesh, which cannot blend, pixels are shared.
  // Where nothing is blended (a light, a pick, ids of pixels) both are there wholly.
  if (ibr_fades == 1 && ibr_part_of.y < 0.5)
  {
    float ibr_over = clamp(ibr_card.z, 0.0, 0.999);
    float ibr_left = (1.0 - ibr_over) / (1.0 - ibr_over * ibr_coverage);
    ibr_coverage *= ibr_left;
    if (ibr_card.z >= 0.98) { discard; }  // the finer level has a core of its own
  }
  if (ibr_fades == 1) { ibr_coverage *= clamp(ibr_card.w, 0.0, 1.0); }
  if (ibr_coverage < ibr_part.x || ibr_coverage >= ibr_part_of.x) { discard; }
  if (ibr_fades == 1 && ibr_part_of.y > 0.5 && IBR_DITHER(ibr_dither) < ibr_card.z) { discard; }

//@fragment.depth
  {
    // The surface's own depth, so that things which touch or pierce one another meet where they do.
    float z = ibr_g.r;
    // While a finer level takes over, the coarser one stays behind it, by some steps of the depth
    // in the pictures: what is hidden farther behind must not show through.
    if (ibr_fades == 1 && ibr_card.z > 0.0 && ibr_part_of.y < 0.5) { z -= 0.02 * ibr_stretch; }
    vec2 zw = vec2(ibr_clip_depth.x * z + ibr_clip_depth.y, ibr_clip_depth.z * z + ibr_clip_depth.w);
    gl_FragDepth = clamp(zw.x / zw.y * 0.5 + 0.5, 0.0, 1.0);
  }

//@fragment.color
  diffuseColor = diffuseIntensity * ibr_base;
  ambientColor = ambientIntensity * ibr_base;
  opacity = opacityUniform * (ibr_part.z < 0.0 ? ibr_coverage : ibr_part.z);
