// Shadow volumes: the unlit space behind a caster, whose surfaces are counted in the stencil buffer.
//
// Vertices are in the caster's model space; all but the near ones are at infinity (w = 0), away from
// the light. Counted are the surfaces in front of the visible one (Heidmann, "Real shadows, real
// time", 1991), or, with caps, those behind it (Everitt and Kilgard, "Practical and robust stenciled
// shadow volumes", 2002).
// ibr_volume_clip (clip from caster), ibr_volume_near (number of near vertices) and
// ibr_volume_slack are custom uniforms: VTK declares them.

//@vertex
  gl_Position = ibr_volume_clip * vec4(vertexMC.xyz, gl_VertexID < ibr_volume_near ? 1.0 : 0.0);

//@cap
  // A cap is the caster's own surface and must not hide itself: push it back by the rounding of
  // pixels along its slope (of the rasterizer and of float32), of depth, and a few buffer steps.
  float ibr_w = gl_FragCoord.w;
  gl_FragDepth = gl_FragCoord.z + 4e-7 + ibr_volume_slack.y * ibr_w * ibr_w
    + (0.02 + ibr_volume_slack.x * ibr_w) * fwidth(gl_FragCoord.z);

//@declare
// The mask pixel of a fragment: its own, unless the pass has another resolution.
ivec2 ibr_shadow_pixel(vec3 p)
{
  vec4 q = ibr_shadow_clip * vec4(p, 1.0);
  vec2 guess = (q.xy / q.w * 0.5 + 0.5) * ibr_shadow_tile.zw;
  vec2 here = gl_FragCoord.xy - ibr_shadow_tile.xy;
  vec2 pixel = floor(max(abs(here.x - guess.x), abs(here.y - guess.y)) < 8.0 ? here : guess);
  return ivec2(clamp(pixel, vec2(0.0), ibr_shadow_tile.zw - 1.0));
}

//@light
vec3 ibr_shadow_NUMBER(vec3 p, vec3 n)
{
  vec3 toward = POSITIONAL ? ibr_shadow_place_NUMBER - p : ibr_shadow_place_NUMBER;
  bool away = !ibr_shadow_thin && dot(n, toward) <= 0.0;
  return vec3(away ? 0.0 : texelFetch(MASK, ibr_shadow_pixel(p), 0).CHANNEL);
}
