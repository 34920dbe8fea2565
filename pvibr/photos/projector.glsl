// Images projected from calibrated cameras: projective texturing (Segal et al., "Fast shadows and
// lighting effects using texture mapping", SIGGRAPH 1992), with Brown's lens distortion per
// fragment, and occlusion by a depth map.
//
// PRE is the prefix of the effect's names, SLIDE one of its images, VIEW the index of that image.
// PRE_matrix: per image, view space to plane and to depth texture. PRE_number: 24 floats per image,
// see slide.py. PRE_set: feather, minimum cosine, opacity, outside brightness, normal bias in
// texels.

//@picture
#ifndef IBR_PICTURE
#define IBR_PICTURE
// A picture sampled several times along the longer axis of the footprint: the anisotropic filters
// of some drivers blur surfaces seen frontally.
vec4 ibr_picture(sampler2D map, vec2 uv, vec2 across, vec2 along)
{
  vec2 size = vec2(textureSize(map, 0));
  float a = length(across * size), b = length(along * size);
  vec2 longer = a > b ? across : along;
  float looks = ceil(clamp(max(a, b) / max(min(a, b), 1.0) - 0.5, 1.0, 8.0));
  vec2 shorter = longer / looks;
  vec4 sum = vec4(0.0);
  for (float k = 0.5; k < looks; k += 1.0)
    sum += textureGrad(map, uv + (k / looks - 0.5) * longer, a > b ? shorter : across,
      a > b ? along : shorter);
  return sum / looks;
}
#endif

//@slide
#define NUMBER(k) PRE_number[24 * VIEW + k]
// Texture coordinates of a position, its place q before the lens, and whether the lens takes it in.
vec2 PRE_at_VIEW(vec3 p, out vec4 q, out bool shown)
{
  q = PRE_matrix[2 * VIEW] * vec4(p, 1.0);
  shown = q.w > 0.0 && abs(q.z - 0.5 * q.w) <= 0.5 * q.w;
  vec2 xy = q.xy / q.w;
#if LENS
  float s = dot(xy, xy);
  shown = shown && s < NUMBER(8);
  float radial = (1.0 + s * (NUMBER(0) + s * (NUMBER(1) + s * NUMBER(4))))
    / (1.0 + s * (NUMBER(5) + s * (NUMBER(6) + s * NUMBER(7))));
  xy = radial * xy + 2.0 * dot(xy, vec2(NUMBER(3), NUMBER(2))) * xy
    + s * vec2(NUMBER(3), NUMBER(2));
#endif
  return vec2(dot(vec3(NUMBER(9), NUMBER(10), NUMBER(11)), vec3(xy, 1.0)),
    dot(vec3(NUMBER(12), NUMBER(13), NUMBER(14)), vec3(xy, 1.0)));
}

// p: a position that is covered; middle: that of the pixel's middle; eyeward: see receiver.glsl.
vec4 PRE_slide_VIEW(vec3 p, vec3 middle, vec3 eyeward, vec3 n, out float cover, out float score)
{
  vec4 q;
  bool shown;
  vec2 uv = PRE_at_VIEW(middle, q, shown);
  // Derivatives need all four fragments of a quad, so take them before any exit.
  vec2 across = dFdx(uv), along = dFdy(uv);
  uv = PRE_at_VIEW(p, q, shown);
  vec3 toward = normalize(vec3(NUMBER(15), NUMBER(16), NUMBER(17)) - NUMBER(18) * p);
  float cosine = dot(n, toward);
  float inward = min(min(uv.x, 1.0 - uv.x), min(uv.y, 1.0 - uv.y));
  cover = 0.0;
  score = 0.0;
  if (!(shown && inward >= 0.0 && cosine > PRE_set[1])) return vec4(0.0);
  vec4 color = ibr_picture(PRE_picture_VIEW, uv, across, along);
  cover = color.a * (PRE_set[0] > 0.0 ? smoothstep(0.0, PRE_set[0], inward) : 1.0);
#if OCCLUSION
  mat4 m = PRE_matrix[2 * VIEW + 1];
  float texel = NUMBER(23) * (NUMBER(18) > 0.0 ? (m * vec4(p, 1.0)).w : 1.0);
  // A surface that faces away is behind itself.
  if (cosine < 0.0) eyeward = vec3(0.0), n = -n;
  cover *= ibr_seen(PRE_depth_VIEW, m, p, eyeward, n, PRE_set[4] * texel);
#endif
  float density = NUMBER(22) / q.w;
  score = cover * max(abs(cosine), 1e-3) * density * density;
  return vec4(color.rgb * vec3(NUMBER(19), NUMBER(20), NUMBER(21)), cosine);
}
#undef NUMBER

//@begin
// The blend of all images: colour times the cosine of the light, and coverage.
vec4 PRE_paint(vec3 p, vec3 middle, vec3 eyeward, vec3 n)
{
  vec3 sum = vec3(0.0);
  float total = 0.0, most = 0.0, cover, score;
  vec4 found;

//@one
  found = PRE_slide_VIEW(p, middle, eyeward, n, cover, score);
  most = max(most, cover);
#if LIGHT
  found.rgb *= max(found.a, 0.0);
#endif
#if BEST
  if (score > total)
  {
    sum = found.rgb * score;
    total = score;
  }
#else
  sum += found.rgb * score;
  total += score;
#endif

//@end
  return vec4(total > 0.0 ? sum / total : vec3(0.0), most * PRE_set[2]);
}

//@find
#ifdef IBR_PLACE
  vec3 PRE_p = IBR_PLACE, PRE_middle = PRE_p, PRE_eyeward = vec3(0.0);
  vec3 PRE_n = IBR_NORMAL;
#else
  vec3 PRE_middle = ibr_middleVSOutput, PRE_p = IBR_COVERED(PRE_middle);
  vec3 PRE_eyeward = IBR_EYEWARD(PRE_p, PRE_middle);
  vec3 PRE_n = ibr_flat(PRE_middle);
#endif
  vec4 PRE_found = PRE_paint(PRE_p, PRE_middle, PRE_eyeward, PRE_n);

//@lit
  ambientColor = mix(ambientColor * mix(PRE_set[3], 1.0, PRE_found.a),
    ambientIntensity * PRE_found.rgb, PRE_found.a);
  diffuseColor = mix(diffuseColor * mix(PRE_set[3], 1.0, PRE_found.a),
    diffuseIntensity * PRE_found.rgb, PRE_found.a);

//@over
  gl_FragData[0].rgb = mix(gl_FragData[0].rgb * PRE_set[3], PRE_found.rgb, PRE_found.a);

//@add
  gl_FragData[0].rgb = gl_FragData[0].rgb * mix(PRE_set[3], 1.0, PRE_found.a)
    + PRE_found.rgb * PRE_found.a;

//@modulate
  gl_FragData[0].rgb = gl_FragData[0].rgb * mix(PRE_set[3], 1.0, PRE_found.a)
    + diffuseColor * PRE_found.rgb * PRE_found.a;
