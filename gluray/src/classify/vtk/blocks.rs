//! The blocks that VTK writes into the shaders of surfaces, in the order in which it writes them.
//! `#` is a number.

use super::signature::ActorTexture;

/// The most lights that VTK writes into a shader.
pub(super) const MOST_LIGHTS: usize = 6;

// ---- Vertex shaders -----------------------------------------------------------------------------
/// Colours, normals, texture coordinates.
pub(super) const VERTEX_COLOR: &str = "vertexColorVSOutput = scalarColor;";
pub(super) const VERTEX_NORMAL: &str = "normalVCVSOutput = normalMatrix * normalMC;";
/// Texture coordinates of colour maps, where they have their own name, and the others.
pub(super) const COORDINATES: [&str; 2] =
    ["colorTCoordVCVSOutput = colorTCoord;", "tcoordVCVSOutput = tcoord;"];
/// The same with a matrix.
pub(super) const TURNED: [&str; 2] = [
    "vec4 colorTCoordTmp = tcMatrix * vec4(colorTCoord, 0.0, 1.0);
     colorTCoordVCVSOutput = colorTCoordTmp.xy / colorTCoordTmp.w;",
    "vec4 tcoordTmp = tcMatrix * vec4(tcoord, 0.0, 1.0);
     tcoordVCVSOutput = tcoordTmp.xy / tcoordTmp.w;",
];
/// Clipping planes, and what a geometry shader needs for them.
pub(super) const CLIPS: &str = "for (int planeNum = 0; planeNum < numClipPlanes; planeNum++)
     { clipDistancesVSOutput[planeNum] = dot(clipPlanes[planeNum], vertexMC); }";
pub(super) const CLIPPED_LATER: &str = "clipVertexMC = vertexMC;";
pub(super) const VERTEX_VIEW: &str = "vertexVCVSOutput = MCVCMatrix * vertexMC;";
pub(super) const VERTEX_PLACE: &str = "gl_Position = MCDCMatrix * vertexMC;";

/// The vertex shader of glyphs: copies of a source, each with a matrix, a matrix for normals and a
/// colour. The blocks above then place `vertex`.
pub(super) const GLYPH: &str = "vec4 vertex = GCMCMatrix * vertexMC;";
pub(super) const GLYPH_COLOR: &str = "vertexColorVSOutput = glyphColor;";
pub(super) const GLYPH_NORMAL: &str =
    "normalVCVSOutput = normalMatrix * glyphNormalMatrix * normalMC;";

// ---- The geometry shader that measures edges ----------------------------------------------------
/// VTK 9.1 and 9.2 have one that also enlarges triangles. That one is not recognised.
pub(super) const MEASURES: &str = "vec2 pos[4];
     for (int i = 0; i < 3; i++)
     {
       pos[i] = gl_in[i].gl_Position.xy / gl_in[i].gl_Position.w;
       pos[i] = pos[i] * vec2(0.5) + vec2(0.5);
       pos[i] = pos[i] * vpDims.zw + vpDims.xy;
     }
     pos[3] = pos[0];
     float ccw = sign(cross(vec3(pos[1] - pos[0], 0.0), vec3(pos[2] - pos[0], 0.0)).z);
     for (int i = 0; i < 3; i++)
     {
       vec2 tmp = normalize(pos[i+1] - pos[i]);
       tmp = ccw * vec2(-tmp.y, tmp.x);
       float d = dot(pos[i], tmp);
       edgeEqn[i] = vec4(tmp.x, tmp.y, 0.0, -d);
     }
     float edgeValues = 255.0 * texelFetch(edgeTexture, gl_PrimitiveIDIn + PrimitiveIDOffset).r;
     if (edgeValues < 4.0) edgeEqn[2].z = lineWidth;
     if (mod(edgeValues, 4.0) < 2.0) edgeEqn[1].z = lineWidth;
     if (mod(edgeValues, 2.0) < 1.0) edgeEqn[0].z = lineWidth;";
/// Its loop over the corners, which are passed through unchanged. It is split here, because `split`
/// needs whole blocks.
pub(super) const CORNERS: [&str; 3] =
    ["for(inti=0;i<3;i++)", "{", "gl_PrimitiveID=gl_PrimitiveIDIn;"];
pub(super) const CLIPS_LATER: &str = "for (int planeNum = 0; planeNum < numClipPlanes; planeNum++)
     { clipDistancesVSOutput[planeNum] = dot(clipPlanes[planeNum], clipVertexMC[i]); }";
pub(super) const GOES_THROUGH: [&str; 5] =
    ["vertexColor", "normalVC", "colorTCoordVC", "tcoordVC", "vertexVC"];
pub(super) const EMITS: [&str; 4] =
    ["gl_Position=gl_in[i].gl_Position;", "EmitVertex();", "}", "EndPrimitive();"];

// ---- Fragment shaders, from their beginning to their end ----------------------------------------
pub(super) const VIEW: &str = "vec4 vertexVC = vertexVCVSOutput;";

/// The derivatives for normals of triangles. VTK 9.7 avoids underflow of the differences; the
/// normal is the same.
pub(super) const DIFFERENCES: [&str; 2] = [
    "vec3 fdx = dFdx(vertexVC.xyz); vec3 fdy = dFdy(vertexVC.xyz);",
    "float scale = 1.0/length(fwidth(vertexVC.xyz));
     vec3 fdx = dFdx(vertexVC.xyz)*scale; vec3 fdy = dFdy(vertexVC.xyz)*scale;",
];

/// The slope of the surface, for depths that are offset.
pub(super) const SLOPE: &str =
    "float cscale = length(vec2(dFdx(gl_FragCoord.z), dFdy(gl_FragCoord.z)));";
/// Offset depths, without and with the slope, in VTK 9.1 to 9.6 and in 9.7.
pub(super) const MOVED: [&str; 2] = [
    "gl_FragDepth = gl_FragCoord.z + 1.0*cOffset/65000;",
    "gl_FragDepth = gl_FragCoord.z + 1.0*cOffset/65000.0;",
];
pub(super) const MOVED_BY_SLOPE: [&str; 2] = [
    "gl_FragDepth = gl_FragCoord.z + cFactor*cscale + 1.0*cOffset/65000;",
    "gl_FragDepth = gl_FragCoord.z + cFactor*cscale + 1.0*cOffset/65000.0;",
];

/// Depth peeling: the pass that finds the range of depths, and the beginning and end of the pass
/// that peels layers.
pub(super) const PEEL_DEPTHS: &str = "gl_FragDepth = gl_FragCoord.z;
     ivec2 pixel = ivec2(gl_FragCoord.xy);
     float oDepth = texelFetch(opaqueDepth, pixel, 0).y;
     if (oDepth != -1. && gl_FragDepth > oDepth)
     { fragOutput1.xy = vec2(-1., oDepth); return; }
     else
     { fragOutput1.xy = vec2(-gl_FragDepth, gl_FragDepth); return; }";
pub(super) const PEEL_LAYERS: &str = "gl_FragDepth = gl_FragCoord.z;
     ivec2 pixelCoord = ivec2(gl_FragCoord.xy);
     vec4 front = texelFetch(lastFrontPeel, pixelCoord, 0);
     vec2 minMaxDepth = texelFetch(lastDepthPeel, pixelCoord, 0).xy;
     float minDepth = -minMaxDepth.x;
     float maxDepth = minMaxDepth.y;
     float epsilon = 0.0000001;
     fragOutput0 = vec4(0.);
     fragOutput1 = front;
     fragOutput2.xy = vec2(-1.);
     if (gl_FragDepth < minDepth - epsilon || gl_FragDepth > maxDepth + epsilon) { return; }
     if (gl_FragDepth > minDepth + epsilon && gl_FragDepth < maxDepth - epsilon)
     { fragOutput2.xy = vec2(-gl_FragDepth, gl_FragDepth); return; }";
/// Other versions have another power of ten in the tolerance.
pub(super) const OTHER_EPSILON: [&str; 2] = ["0.0000001", "0.000001"];
pub(super) const PEELED_LAYERS: &str = "vec4 frag = fragOutput0;
     if (gl_FragDepth >= minDepth - epsilon && gl_FragDepth <= minDepth + epsilon)
     {
       fragOutput0 = vec4(0.);
       front.a = 1. - front.a;
       fragOutput1.rgb = front.a * frag.a * frag.rgb + front.rgb;
       fragOutput1.a = 1. - (front.a * (1. - frag.a));
     }
     else
     { frag.rgb *= frag.a; fragOutput0 = frag; }";

pub(super) const CLIPPED: &str = "for (int planeNum = 0; planeNum < numClipPlanes; planeNum++)
     { if (clipDistancesVSOutput[planeNum] < 0.0) discard; }";

pub(super) const SPECULAR: &str = "vec3 specularColor = specularIntensity * specularColorUniform;
     float specularPower = specularPowerUniform;";
/// Colours of maps, with their own coordinates (VTK 9.3 and later) or the only ones, and colours of
/// cells.
pub(super) const MAPS: [&str; 2] = [
    "vec4 texColor = texture(colortexture, colorTCoordVCVSOutput.st);",
    "vec4 texColor = texture(colortexture, tcoordVCVSOutput.st);",
];
pub(super) const CELLS: &str =
    "vec4 texColor = texelFetchBuffer(textureC, gl_PrimitiveID + PrimitiveIDOffset);";
pub(super) const OF_TEXTURE: &str = "vec3 ambientColor = ambientIntensity * texColor.rgb;
     vec3 diffuseColor = diffuseIntensity * texColor.rgb;
     float opacity = opacityUniform * texColor.a;";
pub(super) const OF_VERTICES: &str =
    "vec3 ambientColor = ambientIntensity * vertexColorVSOutput.rgb;
     vec3 diffuseColor = diffuseIntensity * vertexColorVSOutput.rgb;
     float opacity = opacityUniform * vertexColorVSOutput.a;";
pub(super) const OF_UNIFORMS: &str = "vec3 ambientColor = ambientIntensity * ambientColorUniform;
     vec3 diffuseColor = diffuseIntensity * diffuseColorUniform;
     float opacity = opacityUniform;";
/// Colours made linear for physically based materials.
pub(super) const LINEAR: &str = "ambientColor = pow(ambientColor, vec3(2.2));
     diffuseColor = pow(diffuseColor, vec3(2.2));";
/// The material of back faces, lit and unlit.
pub(super) const BACK: [&str; 2] = [
    "if (gl_FrontFacing == false) {
       ambientColor = ambientIntensityBF * ambientColorUniformBF;
       diffuseColor = diffuseIntensityBF * diffuseColorUniformBF;
       specularColor = specularIntensityBF * specularColorUniformBF;
       specularPower = specularPowerUniformBF;
       opacity = opacityUniformBF; }",
    "if (gl_FrontFacing == false) {
       ambientColor = ambientIntensityBF * ambientColorUniformBF;
       diffuseColor = diffuseIntensityBF * diffuseColorUniformBF;
       opacity = opacityUniformBF; }",
];
/// The colour of a block of composite data, on both faces and over all others.
pub(super) const OVERRIDES: &str = "if (OverridesColor) {
       ambientColor = ambientColorUniform * ambientIntensity;
       diffuseColor = diffuseColorUniform * diffuseIntensity; }";

/// The colour of a glyph, over the uniforms', where back faces have none of their own, and where
/// they have.
pub(super) const GLYPH_COLORS: [&str; 2] = [
    "diffuseColor = diffuseIntensity * vertexColorVSOutput.rgb;
     ambientColor = ambientIntensity * vertexColorVSOutput.rgb;
     opacity = opacity * vertexColorVSOutput.a;",
    "diffuseColor = (gl_FrontFacing) ? diffuseIntensity * vertexColorVSOutput.rgb :
       diffuseIntensityBF * diffuseColorUniformBF;
     ambientColor = (gl_FrontFacing) ? ambientIntensity * vertexColorVSOutput.rgb :
       ambientIntensityBF * ambientColorUniformBF;
     opacity = (gl_FrontFacing) ? opacity * vertexColorVSOutput.a : opacityUniformBF;",
];

pub(super) const EDGES: &str = "float edist[3];
     edist[0] = dot(edgeEqn[0].xy, gl_FragCoord.xy) + edgeEqn[0].w;
     edist[1] = dot(edgeEqn[1].xy, gl_FragCoord.xy) + edgeEqn[1].w;
     edist[2] = dot(edgeEqn[2].xy, gl_FragCoord.xy) + edgeEqn[2].w;
     if (edist[0] < -0.5 && edgeEqn[0].z > 0.0) discard;
     if (edist[1] < -0.5 && edgeEqn[1].z > 0.0) discard;
     if (edist[2] < -0.5 && edgeEqn[2].z > 0.0) discard;
     edist[0] += edgeEqn[0].z;
     edist[1] += edgeEqn[1].z;
     edist[2] += edgeEqn[2].z;
     float emix = clamp(0.5 + 0.5 * lineWidth - min(min(edist[0], edist[1]), edist[2]), 0.0, 1.0);
     diffuseColor = mix(diffuseColor, vec3(0.0), emix * edgeOpacity);
     ambientColor = mix(ambientColor, edgeColor, emix * edgeOpacity);";

/// Normals of vertices, and of triangles.
pub(super) const SMOOTH: &str = "vec3 normalVCVSOutput = normalize(normalVCVSOutput);
     if (gl_FrontFacing == false) { normalVCVSOutput = -normalVCVSOutput; }";
pub(super) const FLAT: &str = "vec3 normalVCVSOutput = normalize(cross(fdx,fdy));
     if (cameraParallel == 1 && normalVCVSOutput.z < 0.0) { normalVCVSOutput = \
     -1.0*normalVCVSOutput; }
     if (cameraParallel == 0 && dot(normalVCVSOutput,vertexVC.xyz) > 0.0)
     { normalVCVSOutput = -1.0*normalVCVSOutput; }";

/// Surfaces without lighting.
pub(super) const UNLIT: &str = "fragOutput0 = vec4(ambientColor + diffuseColor, opacity);";
/// A headlight. VTK 9.1 has another minimum of the cosine.
pub(super) const HEADLIGHT: &str = "float df = max(0.000001, normalVCVSOutput.z);
     float sf = pow(df, specularPower);
     vec3 diffuse = df * diffuseColor * lightColor0;
     vec3 specular = sf * specularColor * lightColor0;
     fragOutput0 = vec4(ambientColor + diffuse + specular, opacity);";
/// The part of [`HEADLIGHT`] and of other lights since VTK 9.2, and before.
pub(super) const LEAST_AT_EYE: [&str; 2] = ["max(0.000001,", "max(0.0,"];
pub(super) const LEAST_ELSEWHERE: [&str; 2] = ["max(1e-5,", "max(0.0,"];
/// The code before and after other lights.
pub(super) const SUNS: &str =
    "vec3 diffuse = vec3(0,0,0); vec3 specular = vec3(0,0,0); float df; float sf;";
pub(super) const LAMPS: &str = "vec3 diffuse = vec3(0,0,0); vec3 specular = vec3(0,0,0);
     vec3 vertLightDirectionVC; float attenuation; float df; float sf;";
pub(super) const SUMMED: &str = "diffuse = diffuse * diffuseColor;
     specular = specular * specularColor;
     fragOutput0 = vec4(ambientColor + diffuse + specular, opacity);";
/// A directional light.
pub(super) const SUN: &str = "df = max(0.0, dot(normalVCVSOutput, -lightDirectionVC#));
     diffuse += (df * lightColor#);
     sf = sign(df)*pow(max(1e-5, dot(reflect(lightDirectionVC#, normalVCVSOutput), \
     normalize(-vertexVC.xyz))),
       specularPower);
     specular += (sf * lightColor#);";
/// A light that may have a position and a cone.
pub(super) const LAMP: &str = "attenuation = 1.0;
     if (lightPositional# == 0)
     { vertLightDirectionVC = lightDirectionVC#; }
     else
     {
       vertLightDirectionVC = vertexVC.xyz - lightPositionVC#;
       float distanceVC = length(vertLightDirectionVC);
       vertLightDirectionVC = normalize(vertLightDirectionVC);
       attenuation = 1.0 / (lightAttenuation#.x + lightAttenuation#.y * distanceVC
         + lightAttenuation#.z * distanceVC * distanceVC);
       if (lightConeAngle# < 90.0)
       {
         float coneDot = dot(vertLightDirectionVC, lightDirectionVC#);
         if (coneDot >= cos(radians(lightConeAngle#)))
         { attenuation = attenuation * pow(coneDot, lightExponent#); }
         else
         { attenuation = 0.0; }
       }
     }
     df = max(0.0, attenuation*dot(normalVCVSOutput, -vertLightDirectionVC));
     diffuse += (df * lightColor#);
     sf = sign(df)*attenuation*pow(max(1e-5, dot(reflect(vertLightDirectionVC, normalVCVSOutput),
       normalize(-vertexVC.xyz))), specularPower);
     specular += (sf * lightColor#);";

/// The colour of a physically based material: that of the surface, or a texture, with the use of
/// its alpha.
pub(super) const ALBEDO: &str = "vec3 albedo = diffuseColor;";
pub(super) const ALBEDO_OF_TEXTURE: &str =
    "vec4 albedoSample = texture(albedoTex, tcoordVCVSOutput);
     vec3 albedo = albedoSample.rgb * diffuseColor;";
pub(super) const ALBEDO_ALPHA: [(ActorTexture, &str); 2] = [
    (ActorTexture::Albedo, "opacity = opacityUniform * albedoSample.a;"),
    (ActorTexture::AlbedoAlone, "opacity = albedoSample.a;"),
];
/// The code after it.
pub(super) const PHYSICAL: &str = "float roughness = roughnessUniform;
     float metallic = metallicUniform;
     float ao = 1.0;
     vec3 emissiveColor = vec3(0.0);
     vec3 N = normalVCVSOutput;
     vec3 V = normalize(-vertexVC.xyz);
     float NdV = clamp(dot(N, V), 1e-5, 1.0);
     vec3 irradiance = vec3(0.0);
     vec3 prefilteredSpecularColor = vec3(0.0);
     vec2 brdf = vec2(0.0, 0.0);
     vec3 Lo = vec3(0.0);
     vec3 F0 = mix(vec3(baseF0Uniform), albedo, metallic);
     float f90 = clamp(dot(F0, vec3(50.0 * 0.33)), 0.0, 1.0);
     vec3 F90 = mix(vec3(f90), edgeTintUniform, metallic);
     vec3 L, H, radiance, F, specular, diffuse;
     float NdL, NdH, HdL, distanceVC, attenuation, D, Vis;";
/// The addition to `D_GGX` since VTK 9.7, without blanks.
pub(super) const LOBES_HAVE_AN_END: &str = "max(PI*d*d,1e-8)";
/// Its headlight.
pub(super) const PHYSICAL_HEADLIGHT: &str = "
     specular = SpecularIsotropic(NdV, NdV, NdV, 1.0, roughness, F0, F90, F);
     diffuse = (1.0 - metallic) * (1.0 - F) * DiffuseLambert(albedo);
     radiance = lightColor0;
     Lo += radiance * (diffuse + specular) * NdV;";
/// Its directional light.
pub(super) const PHYSICAL_SUN: &str = "L = normalize(-lightDirectionVC#);
     H = normalize(V + L);
     HdL = clamp(dot(H, L), 1e-5, 1.0);
     NdL = clamp(dot(N, L), 1e-5, 1.0);
     NdH = clamp(dot(N, H), 1e-5, 1.0);
     radiance = lightColor#;
     specular = SpecularIsotropic(NdH, NdV, NdL, HdL, roughness, F0, F90, F);
     diffuse = (1.0 - metallic) * (1.0 - F) * DiffuseLambert(albedo);
     Lo += radiance * (diffuse + specular) * NdL;";
/// Its light that may have a position and a cone.
pub(super) const PHYSICAL_LAMP: &str = "if (lightPositional# == 0)
     { attenuation = 1.0; L = -lightDirectionVC#; }
     else
     {
       L = lightPositionVC# - vertexVC.xyz;
       distanceVC = length(L);
       L = normalize(L);
       attenuation = 1.0 / (lightAttenuation#.x + lightAttenuation#.y * distanceVC
         + lightAttenuation#.z * distanceVC * distanceVC);
       if (lightConeAngle# < 90.0)
       {
         float coneDot = dot(-L, lightDirectionVC#);
         if (coneDot >= cos(radians(lightConeAngle#)))
         { attenuation = attenuation * pow(coneDot, lightExponent#); }
         else
         { attenuation = 0.0; }
       }
     }
     H = normalize(V + L);
     NdL = clamp(dot(N, L), 1e-5, 1.0);
     NdH = clamp(dot(N, H), 1e-5, 1.0);
     HdL = clamp(dot(H, L), 1e-5, 1.0);
     radiance = lightColor#;
     radiance *= attenuation;
     specular = SpecularIsotropic(NdH, NdV, NdL, HdL, roughness, F0, F90, F);
     diffuse = (1.0 - metallic) * (1.0 - F) * DiffuseLambert(albedo);
     Lo += radiance * (diffuse + specular) * NdL;";
/// Its end, in current VTK and in 9.1 to 9.3.
pub(super) const PHYSICAL_ENDS: [&str; 2] = [
    "vec3 iblSpecular = vec3(0.0);
     vec3 iblDiffuse = vec3(0.0);
     vec3 color = iblDiffuse + iblSpecular;
     color += Lo;
     color = mix(color, color * ao, aoStrengthUniform);
     color += emissiveColor;
     fragOutput0 = vec4(color, opacity);
     fragOutput0.rgb = pow(fragOutput0.rgb, vec3(1.0/2.2));",
    "vec3 specularBrdf = F0 * brdf.r + F90 * brdf.g;
     vec3 iblSpecular = prefilteredSpecularColor * specularBrdf;
     vec3 iblDiffuse = (1.0 - F0) * (1.0 - metallic) * irradiance * albedo;
     vec3 color = iblDiffuse + iblSpecular;
     color += Lo;
     color = mix(color, color * ao, aoStrengthUniform);
     color += emissiveColor;
     color = pow(color, vec3(1.0/2.2));
     fragOutput0 = vec4(color, opacity);",
];

/// An actor's texture, by its number in the shader: the read, its components, and their use.
pub(super) const READS: &str = "vec4 tcolor_# = texture(actortexture, tcoordVCVSOutput);";
pub(super) const COMPONENTS: [(ActorTexture, &str); 4] = [
    (ActorTexture::Rgb, "tcolor_# = vec4(tcolor_#.r,tcolor_#.g,tcolor_#.b,1.0);"),
    (ActorTexture::Grey, "tcolor_# = vec4(tcolor_#.r,tcolor_#.r,tcolor_#.r,1.0);"),
    (ActorTexture::GreyAlpha, "tcolor_# = vec4(tcolor_#.r,tcolor_#.r,tcolor_#.r,tcolor_#.g);"),
    (ActorTexture::Rgba, ""),
];
pub(super) const MULTIPLIES: &str = "vec4 tcolor = tcolor_#;
     if (gl_FrontFacing == true || showTexturesOnBackface)
     { fragOutput0 = fragOutput0 * tcolor; }";
/// Textures that VTK may have numbered before it.
pub(super) const MOST_BEFORE: usize = 4;

pub(super) const DISCARDS: &str = "if (fragOutput0.a <= 0.0) { discard; }";
/// Sums for order-independent translucency.
pub(super) const WEIGHTED: &str =
    "fragOutput0 = vec4(fragOutput0.rgb * fragOutput0.a, fragOutput0.a);
     fragOutput1.r = fragOutput0.a;";
