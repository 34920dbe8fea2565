// Billboards: one quad for each point, turned toward the eye, with an image from one texture.
// The vertex shader fetches a point, turns its card (twin: pvibr.maths.facing) and finds the
// rectangle of its image; the fragment shader samples its mip levels without bleeding from
// neighbours, and discards or blends transparent texels.
// Positions are differences of point and eye, each a pair of floats relative to the middle of all
// points, and so exact for small differences (Ohlarik, "Precisions, Precisions", 2008).
// ibr_first, a draw's first slot, and ibr_end, the entry after its last, are custom uniforms of the
// actor, declared by VTK.

//@vertex.declare
uniform sampler2D ibr_points;     // xyz, rotation; low part of xyz, image; width and height of the
                                  // card, yaw; axis or quaternion if per card
uniform sampler2D ibr_looks;      // rgb that multiplies the image; opacity, 0 hidden
uniform sampler2D ibr_entries;    // blocks or points to draw, in order
uniform sampler2D ibr_rects;      // left, bottom, right, top of each image, texels
uniform int ibr_count;            // points
uniform int ibr_unit;             // points per entry
uniform int ibr_texels;           // texels per point: 3 or 4
uniform int ibr_images;           // number of images
uniform int ibr_views;            // views per image, about the axis
uniform int ibr_two_views;        // 1 to blend the two nearest
uniform int ibr_step;             // images that flipbooks have advanced
uniform int ibr_facing;           // 0 world, 1 cylindrical, 2 spherical, 3 screen
uniform int ibr_own_up;           // 1 if a spherical card has its own axis
uniform int ibr_plane;            // 1 to face the view plane, not the eye
uniform int ibr_parallel;
uniform float ibr_size_scale;     // eye units per pixel at a distance of 1; 0 for sizes in world units
uniform vec4 ibr_size_depth;      // plane whose distance is that from the camera, if a light draws
                                  // sizes in the camera's pixels; else 0
uniform vec4 ibr_turn;            // axis or quaternion of all cards
uniform vec2 ibr_anchor;          // point on the card, 0 to 1
uniform vec3 ibr_eye_high;        // the eye, relative to the middle of all points
uniform vec3 ibr_eye_low;
uniform mat3 ibr_eye_from_world;
uniform mat4 ibr_clip_from_eye;
out vec4 vertexVCVSOutput;
out vec2 ibr_texel;
flat out vec4 ibr_rect;
flat out vec4 ibr_other;
flat out float ibr_share;
flat out vec4 ibr_look;
flat out vec3 ibr_normal;
flat out float ibr_reach;

vec3 ibr_rotated(vec4 q, vec3 v)
{
  return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v);
}

// Direction to the eye, eye space.
vec3 ibr_toward(vec3 c)
{
  bool plane = ibr_plane == 1 || ibr_parallel == 1 || dot(c, c) == 0.0;
  return plane ? vec3(0.0, 0.0, 1.0) : -normalize(c);
}

// Azimuth of the eye about the axis, in full turns.
float ibr_azimuth(vec3 c, vec3 axis)
{
  vec3 toward = transpose(ibr_eye_from_world) * ibr_toward(c);
  vec3 side = abs(axis.x) < 0.9 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
  vec3 first = side - axis * dot(axis, side);
  vec2 p = vec2(dot(toward, first), dot(toward, cross(axis, first)));
  return dot(p, p) > 0.0 ? atan(p.y, p.x) * 0.15915494309 : 0.0;
}

// Columns right, up, normal in eye space, of a card whose point is at c.
mat3 ibr_axes(vec3 c, vec4 turn)
{
  if (ibr_facing == 3) return mat3(1.0);
  if (ibr_facing == 0)
  {
    return ibr_eye_from_world * mat3(ibr_rotated(turn, vec3(1.0, 0.0, 0.0)),
      ibr_rotated(turn, vec3(0.0, 1.0, 0.0)), ibr_rotated(turn, vec3(0.0, 0.0, 1.0)));
  }
  vec3 toward = ibr_toward(c);
  bool cylindrical = ibr_facing == 1;
  vec3 axis = vec3(0.0, 1.0, 0.0);
  if (cylindrical || ibr_own_up == 1) axis = ibr_eye_from_world * turn.xyz;
  vec3 right = cross(axis, toward);
  if (length(right) <= 1e-4)
  {
    vec3 fixed_axis = cylindrical ? axis : toward;
    right = vec3(1.0, 0.0, 0.0) - fixed_axis * fixed_axis.x;
  }
  right = normalize(right);
  return cylindrical ? mat3(right, axis, cross(right, axis))
    : mat3(right, cross(toward, right), toward);
}

//@vertex.position
  {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside the clip volume: an empty slot
    vertexVCVSOutput = vec4(0.0);
    ibr_texel = vec2(0.0);
    ibr_rect = vec4(0.0);
    ibr_other = vec4(0.0);
    ibr_share = 0.0;
    ibr_look = vec4(0.0);
    ibr_normal = vec3(0.0, 0.0, 1.0);
    ibr_reach = 0.0;
    int slot = ibr_first + gl_VertexID / 4;
    int corner = gl_VertexID % 4;
    int entry = slot / ibr_unit;
    bool live = entry < ibr_end;
    ivec2 at = live ? ivec2(entry % 1024, entry / 1024) : ivec2(0);
    int i = int(texelFetch(ibr_entries, at, 0).r) * ibr_unit + slot % ibr_unit;
    live = live && i < ibr_count;
    if (live)
    {
      ibr_look = texelFetch(ibr_looks, ivec2(i % 1024, i / 1024), 0);
      live = ibr_look.a > 0.0;
    }
    if (live)
    {
      int texel = i * ibr_texels;
      ivec2 where = ivec2(texel % 3072, texel / 3072);
      vec4 high = texelFetch(ibr_points, where, 0);
      vec4 low = texelFetch(ibr_points, where + ivec2(1, 0), 0);
      vec3 sides = texelFetch(ibr_points, where + ivec2(2, 0), 0).xyz;
      vec2 size = sides.xy;
      vec4 turn = ibr_texels == 4 ? texelFetch(ibr_points, where + ivec2(3, 0), 0) : ibr_turn;
      vec3 away = (high.xyz - ibr_eye_high) + (low.xyz - ibr_eye_low);
      vec3 c = ibr_eye_from_world * away;
      if (ibr_size_scale > 0.0)
      {
        float deep = ibr_parallel == 1 ? 1.0 : -c.z;
        if (ibr_size_depth != vec4(0.0))
        {
          deep = max(dot(ibr_size_depth, vec4(high.xyz + low.xyz, 1.0)), 0.0);
        }
        size *= ibr_size_scale * deep;
      }
      mat3 axes = ibr_axes(c, turn);
      vec2 unit = vec2(corner == 1 || corner == 2 ? 1.0 : 0.0, corner >= 2 ? 1.0 : 0.0);
      vec2 off = (unit - ibr_anchor) * size;
      vec2 spin = vec2(cos(high.w), sin(high.w));
      off = vec2(spin.x * off.x - spin.y * off.y, spin.y * off.x + spin.x * off.y);
      vec4 p = vec4(c + axes[0] * off.x + axes[1] * off.y, 1.0);
      vertexVCVSOutput = p;
      gl_Position = ibr_clip_from_eye * p;
      vec3 to_eye = ibr_parallel == 1 ? vec3(0.0, 0.0, 1.0) : -c;
      ibr_normal = dot(axes[2], to_eye) < 0.0 ? -axes[2] : axes[2];
      int image = int(low.w) + ibr_step;
      image -= image / ibr_images * ibr_images;
      image *= ibr_views;
      int beside = image;
      if (ibr_views > 1)
      {
        float view = (ibr_azimuth(c, turn.xyz) - sides.z * 0.15915494309) * float(ibr_views);
        float lower = floor(ibr_two_views == 1 ? view : view + 0.5);
        ibr_share = ibr_two_views == 1 ? view - lower : 0.0;
        int k = int(lower - floor(lower / float(ibr_views)) * float(ibr_views));
        beside += (k + 1) % ibr_views;
        image += k % ibr_views;
      }
      ibr_rect = texelFetch(ibr_rects, ivec2(image % 1024, image / 1024), 0);
      ibr_other = texelFetch(ibr_rects, ivec2(beside % 1024, beside / 1024), 0);
      ibr_texel = mix(ibr_rect.xy, ibr_rect.zw, unit);
      ibr_reach = 0.5 * max(size.x, size.y);
    }
  }

//@fragment.declare
uniform sampler2D ibr_sheet;
uniform float ibr_smallest;       // last level whose texels belong to one image each
uniform float ibr_cutout;         // least alpha of cut-outs; 0 to blend
uniform float ibr_least_opacity;  // least opacity that is drawn
uniform int ibr_padded;           // 1 if images are padded to whole texels of the last level
uniform int ibr_two_views;
in vec4 vertexVCVSOutput;
in vec2 ibr_texel;
flat in vec4 ibr_rect;
flat in vec4 ibr_other;
flat in float ibr_share;
flat in vec4 ibr_look;
flat in vec3 ibr_normal;
flat in float ibr_reach;

// Samples, premultiplied by alpha, stay half a texel of the coarser level away from neighbours, and
// from the padding.
vec4 ibr_sampled(vec4 rect, vec2 texel, float lod)
{
  vec2 extent = rect.zw - rect.xy;
  if (ibr_padded == 1) extent = ceil(extent * exp2(-ibr_smallest)) * exp2(ibr_smallest);
  vec2 inset = min(vec2(0.5 * exp2(ceil(lod))), 0.5 * extent);
  vec2 at = clamp(texel, rect.xy + inset, rect.xy + extent - inset);
  vec4 color = textureLod(ibr_sheet, at / vec2(textureSize(ibr_sheet, 0)), lod);
  return vec4(color.rgb * color.a, color.a);
}

//@fragment.sample
  vec4 vertexVC = vertexVCVSOutput;
#ifdef CLIPS
  if (!ibr_kept(vertexVC.xyz)) discard;
#endif
  vec2 ibr_dx = dFdx(ibr_texel), ibr_dy = dFdy(ibr_texel);
  float ibr_lod = 0.5 * log2(max(max(dot(ibr_dx, ibr_dx), dot(ibr_dy, ibr_dy)), 1.0));
  ibr_lod = min(ibr_lod, ibr_smallest);
  // The mean of two levels would pass the alpha test less often than either.
  if (ibr_cutout > 0.0) ibr_lod = floor(ibr_lod + 0.5);
  vec4 ibr_seen = ibr_sampled(ibr_rect, ibr_texel, ibr_lod);
  if (ibr_two_views == 1)
  {
    vec2 ibr_there = (ibr_texel - ibr_rect.xy) / (ibr_rect.zw - ibr_rect.xy);
    ibr_there = mix(ibr_other.xy, ibr_other.zw, ibr_there);
    ibr_seen = mix(ibr_seen, ibr_sampled(ibr_other, ibr_there, ibr_lod), ibr_share);
  }
  float ibr_coverage = ibr_look.a;
  if (ibr_cutout == 0.0) ibr_coverage *= ibr_seen.a;
  else if (ibr_seen.a < ibr_cutout) discard;
  if (ibr_coverage < ibr_least_opacity) discard;
  vec3 ibr_base = min(ibr_seen.rgb / max(ibr_seen.a, 1e-4), 1.0) * ibr_look.rgb;
  // For features that need the surface point: a light sees the card turned toward itself.
#define IBR_PLACE_ERROR ibr_reach
#define IBR_PLACE vertexVC.xyz
#define IBR_NORMAL ibr_normal

//@fragment.color
  diffuseColor = diffuseIntensity * ibr_base;
  ambientColor = ambientIntensity * ibr_base;
  opacity = opacityUniform * ibr_coverage;
