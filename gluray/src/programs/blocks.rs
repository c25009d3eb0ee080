//! Statements of VTK's shaders that only mean something together: what depth peeling, clipping planes, lights with a place, edges and physically based materials
//! put into them. A block counts only when all of its statements are there, in their order.

use super::template::{Peel, Pictured};

/// Most lights that VTK writes into a shader.
pub(super) const MOST_LIGHTS: usize = 6;

/// The statements of a peeling pass, in their order; others may come between them.
pub(super) const PASSES: [(Peel, &[&str]); 2] = [
    (
        Peel::Depths,
        &[
            "gl_FragDepth=gl_FragCoord.z",
            "ivec2pixel=ivec2(gl_FragCoord.xy)",
            "floatoDepth=texelFetch(opaqueDepth,pixel,0).y",
            "if(oDepth!=-1.&&gl_FragDepth>oDepth)",
            "fragOutput1.xy=vec2(-1.,oDepth)",
            "return",
            "else",
            "fragOutput1.xy=vec2(-gl_FragDepth,gl_FragDepth)",
            "return",
        ],
    ),
    (
        Peel::Layers,
        &[
            "gl_FragDepth=gl_FragCoord.z",
            "ivec2pixelCoord=ivec2(gl_FragCoord.xy)",
            "vec4front=texelFetch(lastFrontPeel,pixelCoord,0)",
            "vec2minMaxDepth=texelFetch(lastDepthPeel,pixelCoord,0).xy",
            "floatminDepth=-minMaxDepth.x",
            "floatmaxDepth=minMaxDepth.y",
            "floatepsilon=0.0000001",
            "fragOutput0=vec4(0.)",
            "fragOutput1=front",
            "fragOutput2.xy=vec2(-1.)",
            "if(gl_FragDepth<minDepth-epsilon||gl_FragDepth>maxDepth+epsilon)",
            "return",
            "if(gl_FragDepth>minDepth+epsilon&&gl_FragDepth<maxDepth-epsilon)",
            "fragOutput2.xy=vec2(-gl_FragDepth,gl_FragDepth)",
            "return",
            "vec4frag=fragOutput0",
            "if(gl_FragDepth>=minDepth-epsilon&&gl_FragDepth<=minDepth+epsilon)",
            "fragOutput0=vec4(0.)",
            "front.a=1.-front.a",
            "fragOutput1.rgb=front.a*frag.a*frag.rgb+front.rgb",
            "fragOutput1.a=1.-(front.a*(1.-frag.a))",
            "else",
            "frag.rgb*=frag.a",
            "fragOutput0=frag",
        ],
    ),
];

/// The pass that statements are of, without those of the pass.
pub(super) fn without_peeling(statements: Vec<String>) -> (Peel, Vec<String>) {
    for (peel, pass) in PASSES {
        let mut left = pass.iter().peekable();
        let rest: Vec<String> = statements
            .iter()
            // The tolerance has another power of ten in other versions.
            .map(|s| if s == "floatepsilon=0.000001" { "floatepsilon=0.0000001" } else { s.as_str() })
            .filter(|s| left.next_if(|p| *p == s).is_none())
            .map(str::to_owned)
            .collect();
        if left.next().is_none() {
            return (peel, rest);
        }
    }
    (Peel::No, statements)
}

/// Sums for translucency that needs no order, at the end of the shader.
pub(super) const WEIGHTED: &[&str] =
    &["fragOutput0=vec4(fragOutput0.rgb*fragOutput0.a,fragOutput0.a)", "fragOutput1.r=fragOutput0.a"];

/// Another material for back faces.
pub(super) const BACK: &[&str] = &[
    "if(gl_FrontFacing==false)",
    "ambientColor=ambientIntensityBF*ambientColorUniformBF",
    "diffuseColor=diffuseIntensityBF*diffuseColorUniformBF",
    "specularColor=specularIntensityBF*specularColorUniformBF",
    "specularPower=specularPowerUniformBF",
    "opacity=opacityUniformBF",
];

/// The same without light.
pub(super) const BACK_UNLIT: &[&str] = &[
    "if(gl_FrontFacing==false)",
    "ambientColor=ambientIntensityBF*ambientColorUniformBF",
    "diffuseColor=diffuseIntensityBF*diffuseColorUniformBF",
    "opacity=opacityUniformBF",
];

/// Clipping planes: of the fragment shader, of the vertex shader, and of a geometry shader with the statement that its vertex shader has for it.
pub(super) const CLIPPED: &[&str] = &[
    "for(intplaneNum=0",
    "planeNum<numClipPlanes",
    "planeNum++)",
    "if(clipDistancesVSOutput[planeNum]<0.0)discard",
];
pub(super) const CLIPS: &[&str] = &[
    "for(intplaneNum=0",
    "planeNum<numClipPlanes",
    "planeNum++)",
    "clipDistancesVSOutput[planeNum]=dot(clipPlanes[planeNum],vertexMC)",
];
pub(super) const CLIPS_LATER: &[&str] = &[
    "for(intplaneNum=0",
    "planeNum<numClipPlanes",
    "planeNum++)",
    "clipDistancesVSOutput[planeNum]=dot(clipPlanes[planeNum],clipVertexMC[i])",
];

/// A light that may have a place and a cone; `#` is its number.
pub(super) const LAMP: &[&str] = &[
    "attenuation=1.0",
    "if(lightPositional#==0)",
    "vertLightDirectionVC=lightDirectionVC#",
    "else",
    "vertLightDirectionVC=vertexVC.xyz-lightPositionVC#",
    "floatdistanceVC=length(vertLightDirectionVC)",
    "vertLightDirectionVC=normalize(vertLightDirectionVC)",
    "attenuation=1.0/(lightAttenuation#.x+lightAttenuation#.y*distanceVC+lightAttenuation#.z*distanceVC*distanceVC)",
    "if(lightConeAngle#<90.0)",
    "floatconeDot=dot(vertLightDirectionVC,lightDirectionVC#)",
    "if(coneDot>=cos(radians(lightConeAngle#)))",
    "attenuation=attenuation*pow(coneDot,lightExponent#)",
    "else",
    "attenuation=0.0",
    "df=max(0.0,attenuation*dot(normalVCVSOutput,-vertLightDirectionVC))",
    "diffuse+=(df*lightColor#)",
    "sf=sign(df)*attenuation*pow(max(1e-5,dot(reflect(vertLightDirectionVC,normalVCVSOutput),normalize(-vertexVC.xyz))),specularPower)",
    "specular+=(sf*lightColor#)",
];

/// A light from far away.
pub(super) const SUN: &[&str] = &[
    "df=max(0.0,dot(normalVCVSOutput,-lightDirectionVC#))",
    "diffuse+=(df*lightColor#)",
    "sf=sign(df)*pow(max(1e-5,dot(reflect(lightDirectionVC#,normalVCVSOutput),normalize(-vertexVC.xyz))),specularPower)",
    "specular+=(sf*lightColor#)",
];

/// Edges of cells, in the fragment shader.
pub(super) const EDGES: &[&str] = &[
    "floatedist[3]",
    "edist[0]=dot(edgeEqn[0].xy,gl_FragCoord.xy)+edgeEqn[0].w",
    "edist[1]=dot(edgeEqn[1].xy,gl_FragCoord.xy)+edgeEqn[1].w",
    "edist[2]=dot(edgeEqn[2].xy,gl_FragCoord.xy)+edgeEqn[2].w",
    "if(edist[0]<-0.5&&edgeEqn[0].z>0.0)discard",
    "if(edist[1]<-0.5&&edgeEqn[1].z>0.0)discard",
    "if(edist[2]<-0.5&&edgeEqn[2].z>0.0)discard",
    "edist[0]+=edgeEqn[0].z",
    "edist[1]+=edgeEqn[1].z",
    "edist[2]+=edgeEqn[2].z",
    "floatemix=clamp(0.5+0.5*lineWidth-min(min(edist[0],edist[1]),edist[2]),0.0,1.0)",
    "diffuseColor=mix(diffuseColor,vec3(0.0),emix*edgeOpacity)",
    "ambientColor=mix(ambientColor,edgeColor,emix*edgeOpacity)",
];

/// The geometry shader that measures them. VTK 9.1 and 9.2 have one that also makes triangles larger than they are; that one is not known.
pub(super) const MEASURES: &[&str] = &[
    "vec2pos[4]",
    "for(inti=0",
    "i<3",
    "i++)",
    "pos[i]=gl_in[i].gl_Position.xy/gl_in[i].gl_Position.w",
    "pos[i]=pos[i]*vec2(0.5)+vec2(0.5)",
    "pos[i]=pos[i]*vpDims.zw+vpDims.xy",
    "pos[3]=pos[0]",
    "floatccw=sign(cross(vec3(pos[1]-pos[0],0.0),vec3(pos[2]-pos[0],0.0)).z)",
    "for(inti=0",
    "i<3",
    "i++)",
    "vec2tmp=normalize(pos[i+1]-pos[i])",
    "tmp=ccw*vec2(-tmp.y,tmp.x)",
    "floatd=dot(pos[i],tmp)",
    "edgeEqn[i]=vec4(tmp.x,tmp.y,0.0,-d)",
    "floatedgeValues=255.0*texelFetch(edgeTexture,gl_PrimitiveIDIn+PrimitiveIDOffset).r",
    "if(edgeValues<4.0)edgeEqn[2].z=lineWidth",
    "if(mod(edgeValues,4.0)<2.0)edgeEqn[1].z=lineWidth",
    "if(mod(edgeValues,2.0)<1.0)edgeEqn[0].z=lineWidth",
    "for(inti=0",
    "i<3",
    "i++)",
    "gl_PrimitiveID=gl_PrimitiveIDIn",
];
/// What it ends with.
pub(super) const EMITS: &[&str] = &["gl_Position=gl_in[i].gl_Position", "EmitVertex()", "EndPrimitive()"];

/// What the fragments of a physically based material begin with.
pub(super) const PHYSICAL: &[&str] = &[
    "vec3albedo=diffuseColor",
    "floatroughness=roughnessUniform",
    "floatmetallic=metallicUniform",
    "floatao=1.0",
    "vec3emissiveColor=vec3(0.0)",
    "vec3N=normalVCVSOutput",
    "vec3V=normalize(-vertexVC.xyz)",
    "floatNdV=clamp(dot(N,V),1e-5,1.0)",
    "vec3irradiance=vec3(0.0)",
    "vec3prefilteredSpecularColor=vec3(0.0)",
    "vec2brdf=vec2(0.0,0.0)",
    "vec3Lo=vec3(0.0)",
    "vec3F0=mix(vec3(baseF0Uniform),albedo,metallic)",
    "floatf90=clamp(dot(F0,vec3(50.0*0.33)),0.0,1.0)",
    "vec3F90=mix(vec3(f90),edgeTintUniform,metallic)",
    "vec3L,H,radiance,F,specular,diffuse",
    "floatNdL,NdH,HdL,distanceVC,attenuation,D,Vis",
];
/// Its light at the eye.
pub(super) const PHYSICAL_HEADLIGHT: &[&str] = &[
    "specular=SpecularIsotropic(NdV,NdV,NdV,1.0,roughness,F0,F90,F)",
    "diffuse=(1.0-metallic)*(1.0-F)*DiffuseLambert(albedo)",
    "radiance=lightColor0",
    "Lo+=radiance*(diffuse+specular)*NdV",
];
/// Its light from far away.
pub(super) const PHYSICAL_SUN: &[&str] = &[
    "L=normalize(-lightDirectionVC#)",
    "H=normalize(V+L)",
    "HdL=clamp(dot(H,L),1e-5,1.0)",
    "NdL=clamp(dot(N,L),1e-5,1.0)",
    "NdH=clamp(dot(N,H),1e-5,1.0)",
    "radiance=lightColor#",
    "specular=SpecularIsotropic(NdH,NdV,NdL,HdL,roughness,F0,F90,F)",
    "diffuse=(1.0-metallic)*(1.0-F)*DiffuseLambert(albedo)",
    "Lo+=radiance*(diffuse+specular)*NdL",
];
/// Its light that may have a place and a cone.
pub(super) const PHYSICAL_LAMP: &[&str] = &[
    "if(lightPositional#==0)",
    "attenuation=1.0",
    "L=-lightDirectionVC#",
    "else",
    "L=lightPositionVC#-vertexVC.xyz",
    "distanceVC=length(L)",
    "L=normalize(L)",
    "attenuation=1.0/(lightAttenuation#.x+lightAttenuation#.y*distanceVC+lightAttenuation#.z*distanceVC*distanceVC)",
    "if(lightConeAngle#<90.0)",
    "floatconeDot=dot(-L,lightDirectionVC#)",
    "if(coneDot>=cos(radians(lightConeAngle#)))",
    "attenuation=attenuation*pow(coneDot,lightExponent#)",
    "else",
    "attenuation=0.0",
    "H=normalize(V+L)",
    "NdL=clamp(dot(N,L),1e-5,1.0)",
    "NdH=clamp(dot(N,H),1e-5,1.0)",
    "HdL=clamp(dot(H,L),1e-5,1.0)",
    "radiance=lightColor#",
    "radiance*=attenuation",
    "specular=SpecularIsotropic(NdH,NdV,NdL,HdL,roughness,F0,F90,F)",
    "diffuse=(1.0-metallic)*(1.0-F)*DiffuseLambert(albedo)",
    "Lo+=radiance*(diffuse+specular)*NdL",
];
/// What it ends with, in today's VTK and in 9.1 and 9.2.
pub(super) const PHYSICAL_ENDS: [&[&str]; 2] = [
    &[
        "vec3iblSpecular=vec3(0.0)",
        "vec3iblDiffuse=vec3(0.0)",
        "vec3color=iblDiffuse+iblSpecular",
        "color+=Lo",
        "color=mix(color,color*ao,aoStrengthUniform)",
        "color+=emissiveColor",
        "fragOutput0=vec4(color,opacity)",
        "fragOutput0.rgb=pow(fragOutput0.rgb,vec3(1.0/2.2))",
    ],
    &[
        "vec3specularBrdf=F0*brdf.r+F90*brdf.g",
        "vec3iblSpecular=prefilteredSpecularColor*specularBrdf",
        "vec3iblDiffuse=(1.0-F0)*(1.0-metallic)*irradiance*albedo",
        "vec3color=iblDiffuse+iblSpecular",
        "color+=Lo",
        "color=mix(color,color*ao,aoStrengthUniform)",
        "color+=emissiveColor",
        "color=pow(color,vec3(1.0/2.2))",
        "fragOutput0=vec4(color,opacity)",
    ],
];

/// A matrix for texture coordinates, in the vertex shader: for those of colour maps, where they have a name of their own, and for the others.
pub(super) const TURNED: [&[&str]; 2] = [
    &[
        "vec4colorTCoordTmp=tcMatrix*vec4(colorTCoord,0.0,1.0)",
        "colorTCoordVCVSOutput=colorTCoordTmp.xy/colorTCoordTmp.w",
    ],
    &["vec4tcoordTmp=tcMatrix*vec4(tcoord,0.0,1.0)", "tcoordVCVSOutput=tcoordTmp.xy/tcoordTmp.w"],
];

/// The texture of an actor, whose number in the shader is `#`: read, its components, and what is done with it.
pub(super) const READS: &str = "vec4tcolor_#=texture(actortexture,tcoordVCVSOutput)";
pub(super) const COMPONENTS: [(Pictured, Option<&str>); 4] = [
    (Pictured::Rgb, Some("tcolor_#=vec4(tcolor_#.r,tcolor_#.g,tcolor_#.b,1.0)")),
    (Pictured::Grey, Some("tcolor_#=vec4(tcolor_#.r,tcolor_#.r,tcolor_#.r,1.0)")),
    (Pictured::GreyAlpha, Some("tcolor_#=vec4(tcolor_#.r,tcolor_#.r,tcolor_#.r,tcolor_#.g)")),
    (Pictured::Rgba, None),
];
pub(super) const MULTIPLIES: [&str; 3] = [
    "vec4tcolor=tcolor_#",
    "if(gl_FrontFacing==true||showTexturesOnBackface)",
    "fragOutput0=fragOutput0*tcolor",
];
/// What comes after.
const DISCARDS: [&str; 2] = ["if(fragOutput0.a<=0.0)", "discard"];

/// A texture with the colour of a physically based material, and what becomes of its alpha.
pub(super) const ALBEDO: [&str; 2] =
    ["vec4albedoSample=texture(albedoTex,tcoordVCVSOutput)", "vec3albedo=albedoSample.rgb*diffuseColor"];
pub(super) const ALBEDO_ALPHA: [(Pictured, &str); 2] = [
    (Pictured::Albedo, "opacity=opacityUniform*albedoSample.a"),
    (Pictured::AlbedoAlone, "opacity=albedoSample.a"),
];

/// Takes a block out of statements, where all of it is there without anything between.
pub(super) fn take(statements: &mut Vec<String>, block: &[&str]) -> bool {
    let at = statements.windows(block.len()).position(|w| w.iter().zip(block).all(|(s, b)| s == b));
    if let Some(at) = at {
        statements.drain(at..at + block.len());
    }
    at.is_some()
}

/// Lights of a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Lights {
    /// One at the eye.
    pub(super) head: bool,
    /// From far away or, with `placed`, from a place; how many.
    pub(super) others: usize,
    pub(super) placed: bool,
}

/// Takes lights out that follow one another from number 0 on.
fn take_numbered(statements: &mut Vec<String>, block: &[&str]) -> usize {
    let numbered =
        |i: usize| -> Vec<String> { block.iter().map(|s| s.replace('#', &i.to_string())).collect() };
    let there = |i: &usize| take(statements, &numbered(*i).iter().map(String::as_str).collect::<Vec<_>>());
    (0..=MOST_LIGHTS).take_while(there).count()
}

/// Takes the lights out of a shader that lights by Phong's rule but for the one at the eye.
pub(super) fn take_lights(statements: &mut Vec<String>) -> Lights {
    match take_numbered(statements, LAMP) {
        0 => Lights { others: take_numbered(statements, SUN), ..Lights::default() },
        n => Lights { others: n, placed: true, ..Lights::default() },
    }
}

/// Takes a picture out that multiplies the lit colour: what it is, where that is done last of all.
pub(super) fn take_picture(statements: &mut Vec<String>) -> Option<Pictured> {
    const MOST_BEFORE: usize = 4;
    for (pictured, components) in COMPONENTS {
        for n in 0..MOST_BEFORE {
            let numbered = |s: &str| s.replace('#', &n.to_string());
            let block: Vec<String> =
                [READS].into_iter().chain(components).chain(MULTIPLIES).map(numbered).collect();
            let block: Vec<&str> = block.iter().map(String::as_str).collect();
            let end = [&block[..], &DISCARDS].concat();
            if statements.ends_with(&end.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>())
                && take(statements, &block)
            {
                return Some(pictured);
            }
        }
    }
    None
}

/// Puts the colour of a surface where a physically based material has that of a texture.
pub(super) fn take_albedo(statements: &mut Vec<String>) -> Option<Pictured> {
    let plain = PHYSICAL[0];
    ALBEDO_ALPHA.into_iter().find_map(|(pictured, alpha)| {
        let block = [ALBEDO[0], ALBEDO[1], alpha];
        let at = statements.windows(block.len()).position(|w| w == block)?;
        statements.splice(at..at + block.len(), [plain.to_owned()]);
        Some(pictured)
    })
}

/// Takes out a physically based material; its lights, or `None` where there is no such material.
pub(super) fn take_physical(statements: &mut Vec<String>) -> Option<Lights> {
    if !take(statements, PHYSICAL) {
        return None;
    }
    let lights = if take(statements, PHYSICAL_HEADLIGHT) {
        Lights { head: true, ..Lights::default() }
    } else {
        match take_numbered(statements, PHYSICAL_LAMP) {
            0 => Lights { others: take_numbered(statements, PHYSICAL_SUN), ..Lights::default() },
            n => Lights { others: n, placed: true, ..Lights::default() },
        }
    };
    PHYSICAL_ENDS.iter().any(|end| take(statements, end)).then_some(lights)
}
