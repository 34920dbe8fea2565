// The ground fades with the distance from the scene, as a cyclorama in a studio: what is farther
// from its middle than ibr_fade begins takes the colour of the horizon. It is a disc of radius 1 that
// is scaled, so that places on it are as exact anywhere in the world. Done as the surface is drawn:
// what is before it, translucent things too, stays as it is.
// Uniforms: ibr_horizon, a colour; ibr_fade, where it begins and ends, in radii of the disc.

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
    // Slow at first: no ring shows where it begins.
    float share = clamp((away - ibr_fade.x) / (ibr_fade.y - ibr_fade.x), 0.0, 1.0);
    share = 1.0 - (1.0 - share) * (1.0 - share) * (1.0 - share);
    share *= smoothstep(ibr_fade.x, 7.0 * ibr_fade.x, away);
    gl_FragData[0].rgb = mix(gl_FragData[0].rgb, ibr_horizon, share);
  }
//VTK::DepthPeeling::Impl
