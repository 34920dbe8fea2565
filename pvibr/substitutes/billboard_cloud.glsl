// Rectangles of a billboard cloud: discarded where the filtered alpha is below a half, so that edges
// are straight between texels; the rest is as opaque as the actor.
//@fragment.normal
  if (texture(actortexture, tcoordVCVSOutput).a < 0.5) discard;
//VTK::Normal::Impl
//@fragment.coordinates
//VTK::TCoord::Impl
  gl_FragData[0].a = opacity;
