// Shaded triangles on a soft background: three lights fixed to the camera, a shadow map for the key light so
// that it shows where an instrument is above the tissue, four samples a pixel.
#define GL_GLEXT_PROTOTYPES
#include <GL/glcorearb.h>

#include <algorithm>
#include <cmath>

#include "palpate/base/error.hpp"
#include "palpate/picture/corner_normals.hpp"
#include "palpate/picture/gl_context.hpp"
#include "palpate/picture/picture.hpp"
#include "palpate/picture/shaders.hpp"

namespace palpate {
namespace {

using Mat4f = Eigen::Matrix4f;

constexpr double kCrease = 50;                                // degrees; sharper edges are drawn sharp
constexpr int kShadowTexels = 1024;                           // a side
constexpr int kLargest = 8192;                                // pixels a side
const Vec3 kKeyLight = Vec3(-0.42, 0.62, 0.66).normalized();  // towards the light, as in the shader

GLuint compile(GLenum kind, const char* text) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &text, nullptr);
  glCompileShader(shader);
  GLint ok = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  if (ok) return shader;
  char log[512] = "";
  glGetShaderInfoLog(shader, sizeof log, nullptr, log);
  throw Error(ErrorKind::internal, "shader does not compile: {}", log);
}

GLuint link(const char* vertex_text, const char* fragment_text) {
  const GLuint program = glCreateProgram();
  const GLuint vertex = compile(GL_VERTEX_SHADER, vertex_text),
               fragment = compile(GL_FRAGMENT_SHADER, fragment_text);
  glAttachShader(program, vertex), glAttachShader(program, fragment);
  glLinkProgram(program);
  glDeleteShader(vertex), glDeleteShader(fragment);
  GLint ok = 0;
  glGetProgramiv(program, GL_LINK_STATUS, &ok);
  if (!ok) throw Error(ErrorKind::internal, "shaders do not link");
  return program;
}

GLuint renderbuffer(GLenum format, GLsizei samples, GLsizei width, GLsizei height) {
  GLuint buffer = 0;
  glGenRenderbuffers(1, &buffer);
  glBindRenderbuffer(GL_RENDERBUFFER, buffer);
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, width, height);
  return buffer;
}

void check_complete(const char* what) {
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw Error(ErrorKind::resource, "no picture: OpenGL refuses {}", what);
}

// A mesh as the graphics card sees it: three corners a triangle, coordinates from the camera's target.
struct Uploaded {
  GLuint array = 0, buffer = 0;
  GLsizei corners = 0;
  Vec3 center = Vec3::Zero();
};

Uploaded upload(const DrawnMesh& mesh, const Vec3& origin) {
  if (!mesh.values.empty() && mesh.values.size() != mesh.vertices.size())
    throw Error(ErrorKind::internal, "{} values for {} vertices to draw", mesh.values.size(),
                mesh.vertices.size());
  for (const Triangle& t : mesh.triangles)
    for (const Index i : t)
      if (i < 0 || static_cast<std::size_t>(i) >= mesh.vertices.size())
        throw Error(ErrorKind::internal, "a triangle to draw names vertex {} of {}", i, mesh.vertices.size());
  const std::vector<Vec3f> normals = corner_normals(mesh.vertices, mesh.triangles, kCrease);
  std::vector<float> data;
  data.reserve(7 * normals.size());
  for (std::size_t c = 0; c < normals.size(); ++c) {
    const Index v = mesh.triangles[c / 3][c % 3];
    const Vec3f p = (mesh.vertices[v] - origin).cast<float>(), &n = normals[c];
    data.insert(data.end(), {p[0], p[1], p[2], n[0], n[1], n[2], mesh.values.empty() ? 0 : mesh.values[v]});
  }
  Uploaded result;
  result.corners = static_cast<GLsizei>(normals.size());
  Box box;
  for (const Vec3& v : mesh.vertices)
    if (v.allFinite()) box.add(v);
  result.center = box.empty() ? origin : box.center();
  glGenVertexArrays(1, &result.array);
  glBindVertexArray(result.array);
  glGenBuffers(1, &result.buffer);
  glBindBuffer(GL_ARRAY_BUFFER, result.buffer);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(data.size() * sizeof(float)), data.data(),
               GL_STREAM_DRAW);
  const GLint sizes[] = {3, 3, 1};
  std::size_t offset = 0;
  for (GLuint i = 0; i < 3; ++i) {
    glEnableVertexAttribArray(i);
    glVertexAttribPointer(i, sizes[i], GL_FLOAT, GL_FALSE, 7 * sizeof(float),
                          reinterpret_cast<const void*>(offset));
    offset += sizes[i] * sizeof(float);
  }
  return result;
}

// Rows: right, up, towards the eye.
Mat3 view_axes(const Camera& camera) {
  Vec3 back = camera.eye - camera.target;
  back = back.norm() > 0 ? Vec3(back.normalized()) : Vec3(Vec3::UnitZ());
  Vec3 right = camera.up.cross(back);
  if (!(right.norm() > 1e-9 * camera.up.norm())) right = back.unitOrthogonal();
  right.normalize();
  Mat3 axes;
  axes << right.transpose(), back.cross(right).transpose(), back.transpose();
  return axes;
}

Mat4f perspective(double field_of_view, double aspect, double near, double far) {
  const double f = 1 / std::tan(field_of_view * M_PI / 360);
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  m(0, 0) = f / aspect, m(1, 1) = f;
  m(2, 2) = (near + far) / (near - far), m(2, 3) = 2 * near * far / (near - far), m(3, 2) = -1;
  return m.cast<float>();
}

struct Matrices {
  Mat4f view, projection, shadow;  // of coordinates from the camera's target
};

Matrices make_matrices(const std::vector<DrawnMesh>& meshes, const Camera& camera, double aspect) {
  const Mat3 axes = view_axes(camera);
  const double distance = (camera.eye - camera.target).norm();
  const Vec3 from_target(0, 0, -distance);
  Mat3 light_axes = view_axes({kKeyLight, Vec3::Zero(), Vec3(0, 1, 0)}) * axes;
  Box seen, lit;  // what there is, in the camera's and the key light's axes
  for (const DrawnMesh& mesh : meshes)
    for (const Vec3& v : mesh.vertices) {
      if (!v.allFinite()) continue;
      seen.add(axes * (v - camera.target) + from_target);
      lit.add(light_axes * (v - camera.target));
    }
  if (seen.empty()) seen.add(from_target), lit.add(Vec3::Zero());
  const double far = std::max(1.01 * -seen.min[2], 1e-6);
  const double near = std::max(0.99 * -seen.max[2], 1e-3 * far);
  Matrices m;
  m.view = Mat4f::Identity();
  m.view.topLeftCorner<3, 3>() = axes.cast<float>();
  m.view.topRightCorner<3, 1>() = from_target.cast<float>();
  m.projection = perspective(camera.field_of_view, aspect, near, far);
  const Vec3 half = (0.51 * lit.size()).cwiseMax(1e-9),
             scale = half.cwiseInverse().cwiseProduct(Vec3(1, 1, -1));
  m.shadow = Mat4f::Identity();
  m.shadow.topLeftCorner<3, 3>() = (scale.asDiagonal() * light_axes).cast<float>();
  m.shadow.topRightCorner<3, 1>() = (-scale.cwiseProduct(lit.center())).cast<float>();
  return m;
}

void set(GLuint program, const char* name, const Mat4f& m) {
  glUniformMatrix4fv(glGetUniformLocation(program, name), 1, GL_FALSE, m.data());
}
void set(GLuint program, const char* name, float value) {
  glUniform1f(glGetUniformLocation(program, name), value);
}
void set(GLuint program, const char* name, int value) {
  glUniform1i(glGetUniformLocation(program, name), value);
}

}  // namespace

struct Painter::Impl {
  GlContext context;
  int width, height;
  GLuint surface = 0, depth_only = 0, background = 0, no_vertices = 0;
  GLuint samples_frame = 0, resolved_frame = 0, shadow_frame = 0, shadow_map = 0, scale = 0;

  Impl(int w, int h);
  std::vector<Uploaded> upload_all(const std::vector<DrawnMesh>& meshes, const Vec3& origin);
  void draw_shadows(const std::vector<DrawnMesh>& meshes, const std::vector<Uploaded>& uploaded,
                    const Mat4f& shadow);
  void draw_surfaces(const std::vector<DrawnMesh>& meshes, const std::vector<Uploaded>& uploaded,
                     const Vec3& eye);
  Image read_back();
};

Painter::Impl::Impl(int w, int h) : width(w), height(h) {
  surface = link(surface_vertex_shader, surface_fragment_shader);
  depth_only = link(depth_vertex_shader, depth_fragment_shader);
  background = link(background_vertex_shader, background_fragment_shader);
  glGenVertexArrays(1, &no_vertices);
  GLuint frames[3], textures[2];
  glGenFramebuffers(3, frames);
  glGenTextures(2, textures);
  samples_frame = frames[0], resolved_frame = frames[1], shadow_frame = frames[2];
  shadow_map = textures[0], scale = textures[1];
  for (const bool sampled : {true, false}) {
    const GLuint color = renderbuffer(GL_RGBA8, sampled ? 4 : 0, w, h);
    glBindFramebuffer(GL_FRAMEBUFFER, sampled ? samples_frame : resolved_frame);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color);
    if (sampled)
      glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER,
                                renderbuffer(GL_DEPTH_COMPONENT24, 4, w, h));
    check_complete("a picture of that size");
  }
  glBindTexture(GL_TEXTURE_2D, shadow_map);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, kShadowTexels, kShadowTexels, 0, GL_DEPTH_COMPONENT,
               GL_FLOAT, nullptr);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glBindFramebuffer(GL_FRAMEBUFFER, shadow_frame);
  glFramebufferTexture(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, shadow_map, 0);
  glDrawBuffer(GL_NONE), glReadBuffer(GL_NONE);
  check_complete("a shadow map");
  std::vector<std::uint8_t> texels;
  for (int i = 0; i < 256; ++i)
    for (const std::uint8_t byte : color_scale(i / 255.0)) texels.push_back(byte);
  glBindTexture(GL_TEXTURE_2D, scale);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB8, 256, 1, 0, GL_RGB, GL_UNSIGNED_BYTE, texels.data());
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LEQUAL);
  glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE);
}

std::vector<Uploaded> Painter::Impl::upload_all(const std::vector<DrawnMesh>& meshes, const Vec3& origin) {
  std::vector<Uploaded> uploaded;
  for (const DrawnMesh& mesh : meshes) uploaded.push_back(upload(mesh, origin));
  return uploaded;
}

void Painter::Impl::draw_shadows(const std::vector<DrawnMesh>& meshes, const std::vector<Uploaded>& uploaded,
                                 const Mat4f& shadow) {
  glBindFramebuffer(GL_FRAMEBUFFER, shadow_frame);
  glViewport(0, 0, kShadowTexels, kShadowTexels);
  glClear(GL_DEPTH_BUFFER_BIT);
  glUseProgram(depth_only);
  set(depth_only, "shadow", shadow);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(2.5f, 4);  // a lit surface must not shadow itself
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (meshes[i].opacity < 1) continue;
    glBindVertexArray(uploaded[i].array);
    glDrawArrays(GL_TRIANGLES, 0, uploaded[i].corners);
  }
  glDisable(GL_POLYGON_OFFSET_FILL);
}

void Painter::Impl::draw_surfaces(const std::vector<DrawnMesh>& meshes, const std::vector<Uploaded>& uploaded,
                                  const Vec3& eye) {
  std::vector<std::size_t> order(meshes.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto opaque_end = std::stable_partition(order.begin(), order.end(),
                                                [&](std::size_t i) { return meshes[i].opacity >= 1; });
  std::stable_sort(opaque_end, order.end(), [&](std::size_t a, std::size_t b) {
    return (uploaded[a].center - eye).squaredNorm() > (uploaded[b].center - eye).squaredNorm();
  });
  for (const std::size_t i : order) {
    const DrawnMesh& mesh = meshes[i];
    glUniform3fv(glGetUniformLocation(surface, "color"), 1, mesh.color.data());
    set(surface, "by_value", static_cast<int>(!mesh.values.empty()));
    set(surface, "opacity", std::clamp(mesh.opacity, 0.0f, 1.0f));
    glBindVertexArray(uploaded[i].array);
    if (mesh.opacity < 1) {  // depth first: of a translucent mesh only the nearest layer is seen
      glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
      glDrawArrays(GL_TRIANGLES, 0, uploaded[i].corners);
      glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
      glEnable(GL_BLEND);
    }
    glDrawArrays(GL_TRIANGLES, 0, uploaded[i].corners);
    glDisable(GL_BLEND);
  }
}

Image Painter::Impl::read_back() {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, samples_frame);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved_frame);
  glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved_frame);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  const std::size_t row = 3 * static_cast<std::size_t>(width);
  std::vector<std::uint8_t> from_below(row * static_cast<std::size_t>(height));
  glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, from_below.data());
  if (const GLenum error = glGetError())
    throw Error(ErrorKind::internal, "OpenGL error 0x{:04x} while drawing", error);
  Image image{width, height, {}};
  image.rgb.reserve(from_below.size());
  for (int y = height - 1; y >= 0; --y)
    image.rgb.insert(image.rgb.end(), from_below.begin() + row * y, from_below.begin() + row * (y + 1));
  return image;
}

Painter::Painter(int width, int height) {
  if (width < 1 || height < 1 || width > kLargest || height > kLargest)
    throw Error(ErrorKind::usage, "a picture of {} x {} pixels: sides must be 1 to {}", width, height,
                kLargest);
  impl_ = std::make_unique<Impl>(width, height);
}
Painter::~Painter() = default;

Image Painter::draw(const std::vector<DrawnMesh>& meshes, const Camera& camera, double value_min,
                    double value_max) {
  Impl& gl = *impl_;
  gl.context.make_current();
  const std::vector<Uploaded> uploaded = gl.upload_all(meshes, camera.target);
  const Matrices m = make_matrices(meshes, camera, double(gl.width) / gl.height);
  gl.draw_shadows(meshes, uploaded, m.shadow);

  glBindFramebuffer(GL_FRAMEBUFFER, gl.samples_frame);
  glViewport(0, 0, gl.width, gl.height);
  glClear(GL_DEPTH_BUFFER_BIT);
  glUseProgram(gl.background);
  glBindVertexArray(gl.no_vertices);
  glDrawArrays(GL_TRIANGLES, 0, 3);

  glUseProgram(gl.surface);
  set(gl.surface, "view", m.view), set(gl.surface, "projection", m.projection),
      set(gl.surface, "shadow", m.shadow);
  set(gl.surface, "texel", 1.0f / kShadowTexels);
  set(gl.surface, "scale", 0), set(gl.surface, "shadow_map", 1);
  const double span = value_max > value_min ? value_max - value_min : 0;
  const double factor = span > 0 ? 1 / span : 0;
  glUniform2f(glGetUniformLocation(gl.surface, "range"), static_cast<float>(factor),
              static_cast<float>(-value_min * factor));
  glActiveTexture(GL_TEXTURE1), glBindTexture(GL_TEXTURE_2D, gl.shadow_map);
  glActiveTexture(GL_TEXTURE0), glBindTexture(GL_TEXTURE_2D, gl.scale);
  gl.draw_surfaces(meshes, uploaded, camera.eye);
  for (const Uploaded& u : uploaded) glDeleteVertexArrays(1, &u.array), glDeleteBuffers(1, &u.buffer);
  return gl.read_back();
}

Camera frame_points(std::span<const Vec3> points, const Vec3& direction, const Vec3& up) {
  Camera camera;
  if (points.empty()) return camera;
  const Vec3 towards = direction.norm() > 0 ? Vec3(direction.normalized()) : Vec3(Vec3::UnitZ());
  camera.target = bounding_box(points).center();
  camera.eye = camera.target + towards;
  camera.up = up;
  const Mat3 axes = view_axes(camera);
  const double slope = 0.94 * std::tan(camera.field_of_view * M_PI / 360);  // leaves a border
  double distance = 0;
  // The middle of what is seen depends on the distance, the distance on the middle.
  for (int round = 0; round < 8; ++round) {
    distance = 0;
    for (const Vec3& p : points) {
      const Vec3 seen = axes * (p - camera.target);
      distance = std::max(distance, seen[2] + std::max(std::abs(seen[0]), std::abs(seen[1])) / slope);
    }
    Box shown;
    for (const Vec3& p : points) {
      const Vec3 seen = axes * (p - camera.target);
      shown.add(Vec3(seen / std::max(distance - seen[2], 1e-9)));
    }
    const Vec3 middle = shown.center() * distance;
    camera.target += axes.transpose() * Vec3(middle[0], middle[1], 0);
  }
  for (const Vec3& p : points) {
    const Vec3 seen = axes * (p - camera.target);
    distance = std::max(distance, seen[2] + std::max(std::abs(seen[0]), std::abs(seen[1])) / slope);
  }
  camera.eye = camera.target + std::max(distance, 1e-9) * towards;
  return camera;
}

Camera frame_box(const Box& box, const Vec3& direction, const Vec3& up) {
  std::vector<Vec3> corners;
  for (int corner = 0; corner < 8 && !box.empty(); ++corner)
    corners.emplace_back(corner & 1 ? box.max[0] : box.min[0], corner & 2 ? box.max[1] : box.min[1],
                         corner & 4 ? box.max[2] : box.min[2]);
  return frame_points(corners, direction, up);
}

}  // namespace palpate
