// The plugin's additions to ParaView in the language of its server manager: a set of options, and a
// property of render views that holds one. ParaView builds the panel from them. Where ParaView has
// the same property for OSPRay, its name is used.
#pragma once

static const char* const rtvViewProperties = R"xml(
<ServerManagerConfiguration>
  <ProxyGroup name="annotations">
    <Proxy name="RayTracingOptions" label="Ray Tracing" class="vtkRtvViewOptions" processes="client|renderserver|dataserver">
      <Documentation>How vtk-bridge traces a render view.</Documentation>
      <IntVectorProperty name="EnableRayTracing" label="Enable Ray Tracing" command="SetEnableRayTracing" number_of_elements="1" default_values="1">
        <BooleanDomain name="bool" />
        <Documentation>Trace rays; off leaves everything to OpenGL. Without effects the picture is the same.</Documentation>
      </IntVectorProperty>
      <IntVectorProperty name="BackEnd" label="Back End" command="SetBackEnd" number_of_elements="1" default_values="0">
        <EnumerationDomain name="enum">
          <Entry text="Scivis" value="0" />
          <Entry text="Pathtracer" value="1" />
        </EnumerationDomain>
        <Documentation>Scivis: effects one by one. Pathtracer: light over many bounces.</Documentation>
      </IntVectorProperty>
      <IntVectorProperty name="Threads" label="Threads" command="SetThreads" number_of_elements="1" default_values="0">
        <IntRangeDomain name="range" min="0" max="1024" />
        <Documentation>Threads that trace; 0 for one on each core.</Documentation>
      </IntVectorProperty>
      <IntVectorProperty name="SamplesPerPixel" label="Samples Per Pixel" command="SetSamplesPerPixel" number_of_elements="1" default_values="1">
        <IntRangeDomain name="range" min="1" max="65536" />
        <Documentation>Rays through each pixel.</Documentation>
      </IntVectorProperty>
      <IntVectorProperty name="ProgressivePasses" label="Progressive Passes" command="SetProgressivePasses" number_of_elements="1" default_values="1">
        <IntRangeDomain name="range" min="1" max="65536" />
        <Documentation>Pictures that are averaged while nothing changes.</Documentation>
      </IntVectorProperty>
      <IntVectorProperty name="Shadows" label="Shadows" command="SetShadows" number_of_elements="1" default_values="0">
        <BooleanDomain name="bool" />
        <Documentation>Shadows of all lights but headlights.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="LightSize" label="Light Size" command="SetLightSize" number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" max="45" />
        <Documentation>Half angle in degrees under which lights are seen; above 0 shadows have soft edges.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="AmbientSamples" label="Ambient Samples" command="SetAmbientSamples" number_of_elements="1" default_values="0">
        <IntRangeDomain name="range" min="0" max="4096" />
        <Documentation>Rays of ambient occlusion per point and sample; 0 for none.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="AmbientRadius" label="Ambient Radius" command="SetAmbientRadius" number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" />
        <Documentation>How far ambient occlusion looks, in the data's units; 0 for a fifth of the scene's diagonal.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="AmbientStrength" label="Ambient Strength" command="SetAmbientStrength" number_of_elements="1" default_values="0.5">
        <DoubleRangeDomain name="range" min="0" max="1" />
        <Documentation>Share of the light that is ambient while there are ambient samples.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="Reflections" label="Reflections" command="SetReflections" number_of_elements="1" default_values="0">
        <BooleanDomain name="bool" />
        <Documentation>Physically based and metallic surfaces mirror what is around them.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="MirrorReflection" label="Mirror Reflection" command="SetMirrorReflection" number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" max="1" />
        <Documentation>Share of mirror reflection added to every surface.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="Material" label="Material" command="SetMaterial" number_of_elements="1" default_values="0">
        <EnumerationDomain name="enum">
          <Entry text="Scene" value="0" />
          <Entry text="Matte" value="1" />
          <Entry text="Metal" value="2" />
          <Entry text="Glass" value="3" />
          <Entry text="Transparent" value="4" />
        </EnumerationDomain>
        <Documentation>What all surfaces are made of; Scene leaves them what their own properties say.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="Roughness" label="Roughness" command="SetRoughness" number_of_elements="1" default_values="0.2" panel_visibility="advanced">
        <DoubleRangeDomain name="range" min="0" max="1" />
        <Documentation>Roughness of the material Metal.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="IndexOfRefraction" label="Index Of Refraction" command="SetIndexOfRefraction" number_of_elements="1" default_values="1.5" panel_visibility="advanced">
        <DoubleRangeDomain name="range" min="1" max="4" />
        <Documentation>Refractive index of the material Glass.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="MaximumBounces" label="Maximum Bounces" command="SetMaximumBounces" number_of_elements="1" default_values="8" panel_visibility="advanced">
        <IntRangeDomain name="range" min="0" max="1000" />
        <Documentation>Most reflections and refractions in a row.</Documentation>
      </IntVectorProperty>
      <DoubleVectorProperty name="LensRadius" label="Lens Radius" command="SetLensRadius" number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" />
        <Documentation>Radius of the camera's lens, in the data's units; above 0 only what is in focus is sharp.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="FocalDistance" label="Focal Distance" command="SetFocalDistance" number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" />
        <Documentation>Distance in focus, in the data's units; 0 for the camera's focal point.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="PointRadius" label="Point Radius" command="SetPointRadius" number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" />
        <Documentation>Points become spheres of this radius, in the data's units; 0: they stay OpenGL's points.</Documentation>
      </DoubleVectorProperty>
      <DoubleVectorProperty name="LineRadius" label="Line Radius" command="SetLineRadius" number_of_elements="1" default_values="0">
        <DoubleRangeDomain name="range" min="0" />
        <Documentation>Lines and edges become tubes of this radius, in the data's units; 0: they stay OpenGL's lines.</Documentation>
      </DoubleVectorProperty>
      <IntVectorProperty name="Robustness" label="Robustness" command="SetRobustness" number_of_elements="1" default_values="0" panel_visibility="advanced">
        <EnumerationDomain name="enum">
          <Entry text="Watertight" value="0" />
          <Entry text="Fast" value="1" />
        </EnumerationDomain>
        <Documentation>Watertight: no ray passes between triangles that share an edge. Fast: one may, rarely.</Documentation>
      </IntVectorProperty>
    </Proxy>
  </ProxyGroup>
  <ProxyGroup name="views">
    <Extension name="RenderView">
      <ProxyProperty name="RayTracing" label="Ray Tracing" command="AddPropToRenderer" panel_widget="proxy_editor">
        <ProxyListDomain name="proxy_list">
          <Proxy group="annotations" name="RayTracingOptions" />
        </ProxyListDomain>
        <Documentation>How vtk-bridge traces this view.</Documentation>
      </ProxyProperty>
      <PropertyGroup label="Ray Tracing (vtk-bridge)">
        <Property name="RayTracing" />
      </PropertyGroup>
    </Extension>
  </ProxyGroup>
</ServerManagerConfiguration>
)xml";
