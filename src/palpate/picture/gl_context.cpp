#include "palpate/picture/gl_context.hpp"

#include <EGL/egl.h>
#include <EGL/eglext.h>

#include "palpate/base/error.hpp"

namespace palpate {
namespace {

[[noreturn]] void fail(const char* step) {
  throw Error(ErrorKind::resource,
              "no picture: {} failed (EGL error 0x{:04x}); install Mesa's software renderer (Debian: "
              "libegl-mesa0 libgl1-mesa-dri), or run without pictures",
              step, eglGetError());
}

}  // namespace

GlContext::GlContext() {
  // The display belongs to the process and is never terminated: that would take it from other contexts.
  display_ = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (display_ == EGL_NO_DISPLAY) fail("opening the surfaceless display");
  if (!eglInitialize(display_, nullptr, nullptr)) fail("starting the surfaceless display");
  if (!eglBindAPI(EGL_OPENGL_API)) fail("choosing OpenGL");
  const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                               3,
                               EGL_CONTEXT_MINOR_VERSION,
                               3,
                               EGL_CONTEXT_OPENGL_PROFILE_MASK,
                               EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                               EGL_NONE};
  context_ = eglCreateContext(display_, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes);
  if (context_ == EGL_NO_CONTEXT) fail("creating an OpenGL 3.3 context");
  if (!eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_)) {
    eglDestroyContext(display_, context_);
    fail("using a context without a surface");
  }
}

GlContext::~GlContext() {
  if (eglGetCurrentContext() == context_)
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
}

void GlContext::make_current() const {
  if (!eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_)) fail("switching contexts");
}

}  // namespace palpate
