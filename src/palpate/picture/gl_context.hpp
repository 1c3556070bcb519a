// An OpenGL context that needs no display, no window and no graphics card.
#pragma once

namespace palpate {

// Current on the thread that made it. Several may live at once; make_current() switches.
class GlContext {
 public:
  GlContext();  // Error(resource) with the packages to install
  ~GlContext();
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  void make_current() const;

 private:
  void* display_ = nullptr;
  void* context_ = nullptr;
};

}  // namespace palpate
