// Maps of a material that VTK does not sample (normals without tangents) or only with physically
// based shading (emission). They are bound as textures of the property; where VTK declares their
// samplers, IBR_NORMAL_MAP and IBR_EMISSION_MAP are defined; IBR_PHYSICAL with such shading.

//@normal
  // Tangents by the derivatives across the pixel: right in any pose, of mirrored coordinates, too.
#ifdef IBR_NORMAL_MAP
  {
    vec3 across = dFdx(vertexVCVSOutput.xyz), up = dFdy(vertexVCVSOutput.xyz);
    vec2 du = dFdx(tcoordVCVSOutput), dv = dFdy(tcoordVCVSOutput);
    float area = du.x * dv.y - dv.x * du.y;
    vec3 tangent = (across * dv.y - up * du.y) * sign(area);
    tangent -= dot(tangent, normalVCVSOutput) * normalVCVSOutput;
    vec3 mapped = texture(normalTex, tcoordVCVSOutput).xyz * 2.0 - 1.0;
    if (dot(tangent, tangent) > 0.0)
    {
      tangent = normalize(tangent);
      float turn = sign(area) * sign(dot(cross(across, up), normalVCVSOutput));
      vec3 bitangent = turn * cross(normalVCVSOutput, tangent);
      normalVCVSOutput = normalize(
        mapped.x * tangent + mapped.y * bitangent + max(mapped.z, 1e-3) * normalVCVSOutput);
    }
  }
#endif

//@emission
  // Light adds up as such; what is shown is about its power of 1 / 2.2, as VTK has it.
#if !(defined(IBR_PHYSICAL) && defined(IBR_EMISSION_MAP))  // VTK adds it
  {
    vec3 shine = IBR_EMISSION;
#ifdef IBR_EMISSION_MAP
    shine *= texture(emissiveTex, tcoordVCVSOutput).rgb;
#endif
    vec3 light = pow(max(gl_FragData[0].rgb, vec3(0.0)), vec3(2.2)) + shine;
    gl_FragData[0].rgb = pow(light, vec3(1.0 / 2.2));
  }
#endif
//VTK::DepthPeeling::Impl
