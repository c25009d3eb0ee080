// The properties that the plugin adds to render views, in the language of ParaView's server manager. ParaView makes the panel from them.
#pragma once

static const char* const rtvViewProperties = R"xml(
<ServerManagerConfiguration>
  <ProxyGroup name="views">
    <!-- More options for ray tracing, beside those that ParaView has for OSPRay (Enable Ray Tracing, Shadows, Ambient Samples, ...). -->
    <Extension name="RenderView">
      <IntVectorProperty name="RayTraceGeometry" label="Ray Trace Geometry" command="SetRtvGeometry"
        number_of_elements="1" default_values="1">
        <BooleanDomain name="bool" />
        <Documentation>Ray trace surfaces also while "Enable Ray Tracing" is off: the same picture as OpenGL's, faster for many triangles.</Documentation>
      </IntVectorProperty>
      <IntVectorProperty name="RayTracingThreads" label="Ray Tracing Threads" command="SetRtvThreads"
        number_of_elements="1" default_values="0">
        <IntRangeDomain name="range" min="0" max="1024" />
        <Documentation>Threads that trace; 0 for one on each core.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="AmbientRadius" label="Ambient Radius" command="SetRtvAmbientRadius"
        number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" />
        <Documentation>How far ambient occlusion looks, in the data's units; 0 for a fifth of the scene's diagonal.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="AmbientStrength" label="Ambient Strength" command="SetRtvAmbientStrength"
        number_of_elements="1" default_values="0.5">
        <DoubleRangeDomain name="range" min="0" max="1" />
        <Documentation>Share of the light that is ambient while there are ambient samples.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="LightSize" label="Light Size" command="SetRtvLightSize"
        number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" max="45" />
        <Documentation>Half angle in degrees under which lights are seen; above 0 shadows get soft edges.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="Reflections" label="Reflections" command="SetRtvReflections"
        number_of_elements="1" default_values="0">
        <BooleanDomain name="bool" />
        <Documentation>Physically based and metallic surfaces mirror what is around them.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="MirrorReflection" label="Mirror Reflection" command="SetRtvMirror"
        number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" max="1" />
        <Documentation>Share of mirror reflection added to every surface.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="RayTracingMaterial" label="Ray Tracing Material" command="SetRtvMaterial"
        number_of_elements="1" default_values="0">
        <EnumerationDomain name="enum">
          <Entry text="Scene" value="0" />
          <Entry text="Matte" value="1" />
          <Entry text="Metal" value="2" />
          <Entry text="Glass" value="3" />
          <Entry text="Transparent" value="4" />
        </EnumerationDomain>
        <Documentation>What all surfaces of the view are made of; Scene leaves them what their properties say.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="MetalRoughness" label="Metal Roughness" command="SetRtvRoughness"
        number_of_elements="1" default_values="0.2" panel_visibility="advanced">
        <DoubleRangeDomain name="range" min="0" max="1" />
        <Documentation>Roughness of the material Metal.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="IndexOfRefraction" label="Index Of Refraction" command="SetRtvIndexOfRefraction"
        number_of_elements="1" default_values="1.5" panel_visibility="advanced">
        <DoubleRangeDomain name="range" min="1" max="4" />
        <Documentation>Refractive index of the material Glass.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="MaximumBounces" label="Maximum Bounces" command="SetRtvMaximumBounces"
        number_of_elements="1" default_values="8" panel_visibility="advanced">
        <IntRangeDomain name="range" min="0" max="1000" />
        <Documentation>Most reflections and refractions in a row.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="LensRadius" label="Lens Radius" command="SetRtvLensRadius"
        number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" />
        <Documentation>Radius of the camera's lens, in the data's units; above 0 only what is in focus is sharp.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="LensFocalDistance" label="Lens Focal Distance" command="SetRtvFocalDistance"
        number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" />
        <Documentation>Distance in focus, in the data's units; 0 for the camera's focal point.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="RayTracingRobustness" label="Ray Tracing Robustness" command="SetRtvRobustness"
        number_of_elements="1" default_values="0" panel_visibility="advanced">
        <EnumerationDomain name="enum">
          <Entry text="Watertight" value="0" />
          <Entry text="Fast" value="1" />
        </EnumerationDomain>
        <Documentation>Watertight: no ray passes between triangles that share an edge. Fast: it may, at one pixel in many.</Documentation>
      </IntVectorProperty>
      <PropertyGroup label="Ray Tracing (vtk-bridge)">
        <Property name="RayTraceGeometry" />
        <Property name="EnableOSPRay" />
        <Property name="OSPRayRendererType" />
        <Property name="RayTracingThreads" />
        <Property name="SamplesPerPixel" />
        <Property name="Shadows" />
        <Property name="LightSize" />
        <Property name="AmbientSamples" />
        <Property name="AmbientRadius" />
        <Property name="AmbientStrength" />
        <Property name="Reflections" />
        <Property name="MirrorReflection" />
        <Property name="RayTracingMaterial" />
        <Property name="MetalRoughness" />
        <Property name="IndexOfRefraction" />
        <Property name="MaximumBounces" />
        <Property name="LensRadius" />
        <Property name="LensFocalDistance" />
        <Property name="RayTracingRobustness" />
      </PropertyGroup>
    </Extension>
  </ProxyGroup>
</ServerManagerConfiguration>
)xml";
