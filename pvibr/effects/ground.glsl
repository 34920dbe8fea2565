// The ground fades into the colour of the horizon with the distance from its centre, like a
// cyclorama in a studio. The mesh is a scaled disc of radius 1, so positions on it are equally exact
// anywhere in the world. Fading happens as the surface is drawn: translucent things in front of it
// are unchanged.
// Uniforms: ibr_horizon, a colour; ibr_fade, start and end of the fading, in radii of the disc.

//@vertex.declare
//VTK::PositionVC::Dec
out vec2 ibr_ground;

//@vertex.place
//VTK::PositionVC::Impl
  ibr_ground = vertexMC.xy;

//@fragment.declare
//VTK::PositionVC::Dec
in vec2 ibr_ground;

//@fragment.fade
  {
    float away = length(ibr_ground);
    // Slow at first, so that no ring shows where it starts.
    float share = clamp((away - ibr_fade.x) / (ibr_fade.y - ibr_fade.x), 0.0, 1.0);
    share = 1.0 - (1.0 - share) * (1.0 - share) * (1.0 - share);
    share *= smoothstep(ibr_fade.x, 7.0 * ibr_fade.x, away);
    gl_FragData[0].rgb = mix(gl_FragData[0].rgb, ibr_horizon, share);
  }
//VTK::DepthPeeling::Impl
