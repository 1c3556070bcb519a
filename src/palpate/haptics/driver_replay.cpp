// replay: plays a motion file (docs/scenes.md), a millisecond a read; the hand in it gives way to no force.
#include <algorithm>

#include "palpate/base/error.hpp"
#include "palpate/haptics/device.hpp"
#include "palpate/haptics/hand_path.hpp"

namespace palpate {

namespace {

class Replay final : public HapticDevice {
 public:
  Replay(HandPath path, double tick) : path_(std::move(path)), tick_(tick), time_(path_.begin()) {}

  DeviceSample read() noexcept override {
    DeviceSample sample = path_.at(time_);
    sample.connected = time_ <= path_.end() + 0.5 * tick_;
    time_ += tick_;
    return sample;
  }
  void write(const Wrench&) noexcept override {}

 private:
  HandPath path_;
  double tick_, time_;
};

}  // namespace

namespace driver_files {
Driver replay() {
  return {"replay", "replay:FILE.csv[#INSTRUMENT][,tick=0.001] plays a motion, connected until its end",
          [](const DeviceArguments& arguments) -> std::unique_ptr<HapticDevice> {
            double tick = 1e-3;  // s
            read_settings(arguments, "replay", {{"tick", &tick}});
            return std::make_unique<Replay>(HandPath(arguments.text), tick);
          }};
}
}  // namespace driver_files

}  // namespace palpate
