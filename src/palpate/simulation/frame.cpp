#include "palpate/simulation/frame.hpp"

namespace palpate {

std::vector<Frame> frames_of(std::span<const Model> models, std::span<const State> states) {
  std::vector<Frame> frames;
  for (std::size_t o = 0; o < states.size(); ++o) frames.push_back(frame_of(models[o], states[o]));
  return frames;
}

ErrorBar error_bar(const Organ& organ, const Frame& frame, const Contact& contact) noexcept {
  const auto of_node = [&](Index node) {
    return error_bar(frame.bar, frame.surface, organ.row_of[static_cast<std::size_t>(node)]);
  };
  if (contact.triangle < 0) return of_node(contact.node);
  ErrorBar bar = frame.bar;
  bar.linearity = 0;
  const Triangle& nodes = organ.surface.triangles[static_cast<std::size_t>(contact.triangle)];
  for (std::size_t k = 0; k < 3; ++k)
    bar.linearity += contact.weights[static_cast<int>(k)] * of_node(nodes[k]).linearity;
  return bar;
}

ErrorBar largest_bar(std::span<const Frame> frames) noexcept {
  ErrorBar largest = frames[0].bar;
  for (const Frame& frame : frames.subspan(1))
    if (frame.bar.total() >= largest.total()) largest = frame.bar;
  return largest;
}

}  // namespace palpate
