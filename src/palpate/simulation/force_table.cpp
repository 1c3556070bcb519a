#include "palpate/simulation/force_table.hpp"

#include <fmt/core.h>

#include "palpate/io/atomic_file.hpp"

namespace palpate {

ForceTable::ForceTable(std::span<const Model> models, const std::vector<std::string>& names)
    : text_(
          "step,time_s,contacts,deepest_before_m,deepest_after_m,relinearisations,status,step_ms,"
          "force_error") {
  const auto wrench_columns = [&](const std::string& of) {
    for (const Instrument& i : models[0].instruments)
      for (const char* c : {"fx_N", "fy_N", "fz_N", "tx_Nm", "ty_Nm", "tz_Nm", "grasped"})
        text_ += "," + of + i.name + "." + c;
  };
  wrench_columns("");
  for (std::size_t o = 0; o < models.size() && models.size() > 1; ++o) {
    text_ += "," + names[o] + ".contacts";
    wrench_columns(names[o] + ".");
  }
  text_ += "\n";
}

void ForceTable::add(std::uint64_t step, std::span<const Frame> frames) {
  double ms = 0, before = 0, after = 0;
  std::size_t contacts = 0;
  int relinearisations = 0;
  std::uint32_t status = status_ok;
  for (const Outcome& o : frames) {
    ms += 1e3 * o.times.total, contacts += o.contacts.size(), relinearisations += o.relinearisations;
    before = std::max(before, o.deepest_before), after = std::max(after, o.deepest_after);
    status |= o.status;
  }
  text_ += fmt::format("{},{:.9g},{},{:.6g},{:.6g},{},{},{:.4g},{:.4g}", step, frames[0].outcome.time,
                       contacts, before, after, relinearisations, status, ms, largest_bar(frames).total());
  const auto wrenches = [&](std::span<const Frame> of) {
    for (std::size_t i = 0; i < of[0].outcome.wrenches.size(); ++i) {
      const Wrench w = wrench_of(of, i);
      text_ += fmt::format(",{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{}", w.force.x(), w.force.y(),
                           w.force.z(), w.torque.x(), w.torque.y(), w.torque.z(), grasped_by(of, i));
    }
  };
  wrenches(frames);
  for (std::size_t o = 0; o < frames.size() && frames.size() > 1; ++o) {
    text_ += fmt::format(",{}", frames[o].outcome.contacts.size());
    wrenches(frames.subspan(o, 1));
  }
  text_ += "\n";
}

void ForceTable::write(const std::filesystem::path& path) const {
  AtomicFile out(path);
  out.write(text_);
  out.commit();
}

}  // namespace palpate
