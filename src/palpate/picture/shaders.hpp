// The shading of painter.cpp in GLSL 3.30. Lights stand still relative to the camera; a surface that faces
// the camera, unshadowed, shows its own colour, so that it can be read off the legend.
#pragma once

namespace palpate {

inline const char* surface_vertex_shader = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in float value;
uniform mat4 view, projection, shadow;
out vec3 p, n, s;
out float v;
void main() {
  vec4 seen = view * vec4(position, 1);
  p = seen.xyz;
  n = mat3(view) * normal;
  v = value;
  s = (shadow * vec4(position, 1)).xyz * 0.5 + 0.5;
  gl_Position = projection * seen;
})";

inline const char* surface_fragment_shader = R"(#version 330 core
in vec3 p, n, s;
in float v;
uniform sampler2D scale;
uniform sampler2DShadow shadow_map;
uniform vec3 color;
uniform vec2 range;
uniform bool by_value;
uniform float opacity, texel;
out vec4 result;
const vec3 key = vec3(-0.42, 0.62, 0.66), fill = vec3(0.80, -0.10, 0.59);
float light(vec3 m, float lit) {
  float k = max(0, (dot(m, key) + 0.2) / 1.2);
  float f = max(0, (dot(m, fill) + 0.3) / 1.3);
  return 0.30 + 0.08 * m.y + 0.72 * k * mix(0.25, 1, lit) + 0.20 * f;
}
void main() {
  vec3 m = normalize(gl_FrontFacing ? n : -n), eye = normalize(-p);
  float lit = 0;
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x)
      lit += texture(shadow_map, s + vec3(x * texel, y * texel, 0)) / 9;
  vec3 base = by_value ? texture(scale, vec2((range.x * v + range.y) * 255 / 256 + 0.5 / 256, 0.5)).rgb : color;
  float facing = max(dot(m, eye), 0);
  vec3 shade = pow(base, vec3(2.2)) * light(m, lit) / light(vec3(0, 0, 1), 1);
  float rim = pow(1 - facing, 3) * (0.5 + 0.5 * m.y);
  shade += 0.10 * rim;
  shade += 0.10 * lit * pow(max(dot(m, normalize(key + eye)), 0), 60);
  result = vec4(pow(min(shade, vec3(1)), vec3(1 / 2.2)), mix(opacity, 1, (1 - opacity) * pow(1 - facing, 3)));
})";

inline const char* depth_vertex_shader = R"(#version 330 core
layout(location = 0) in vec3 position;
uniform mat4 shadow;
void main() { gl_Position = shadow * vec4(position, 1); })";

inline const char* depth_fragment_shader = R"(#version 330 core
void main() {})";

inline const char* background_vertex_shader = R"(#version 330 core
out float height;
void main() {
  vec2 corner = vec2(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1);
  height = 0.5 + 0.5 * corner.y;
  gl_Position = vec4(corner, 1, 1);
})";

inline const char* background_fragment_shader = R"(#version 330 core
in float height;
out vec4 result;
void main() { result = vec4(mix(vec3(0.80, 0.83, 0.87), vec3(0.96, 0.97, 0.98), smoothstep(0.0, 1.0, height)), 1); })";

}  // namespace palpate
