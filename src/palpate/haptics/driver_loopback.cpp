// loopback: a simulated hand that holds the device, to close the loop without one. A mass m (hand and handle)
// hangs by a spring and a damper, the arm's, on a target that follows a motion file; friction b slows it. The
// force from the simulation pushes it away from the target:
//     m x'' = F + k (target - x) + d (target' - x') - b x',
// semi-implicit Euler in steps of a tenth of a tick, with F held over the tick as a device holds it. The
// orientation is the target's. Values of a hand that holds a stylus: Hajian, Howe: Identification of the
// mechanical impedance at the human finger tip. J. Biomech. Eng. 119 (1997); Speich, Shao, Goldfarb: Modeling
// the human hand as it interacts with a telemanipulation system. Mechatronics 15 (2005).
#include "palpate/haptics/hand_path.hpp"

namespace palpate {

namespace {

struct Hand {
  double mass = 0.15;      // kg
  double stiffness = 400;  // N/m, to the target
  double damping = 5;      // N s/m, to the target
  double friction = 0.5;   // N s/m, to the ground
  double tick = 1e-3;      // s between two writes
};

class Loopback final : public HapticDevice {
 public:
  Loopback(HandPath path, const Hand& hand)
      : path_(std::move(path)), hand_(hand), time_(path_.begin()), sample_(path_.at(time_)) {
    sample_.velocity.setZero();
  }

  DeviceSample read() noexcept override { return sample_; }

  void write(const Wrench& on_hand) noexcept override {
    constexpr int parts = 10;
    const double dt = hand_.tick / parts;
    const Vec3 force = on_hand.force.allFinite() ? on_hand.force : Vec3(Vec3::Zero());
    Vec3 x = sample_.pose.translation, v = sample_.velocity;
    DeviceSample target;
    for (int i = 1; i <= parts; ++i) {
      target = path_.at(time_ + i * dt);
      v += dt / hand_.mass *
           (force + hand_.stiffness * (target.pose.translation - x) + hand_.damping * (target.velocity - v) -
            hand_.friction * v);
      x += dt * v;
    }
    time_ += hand_.tick;
    sample_ = target;
    sample_.pose.translation = x;
    sample_.velocity = v;
  }

 private:
  HandPath path_;
  Hand hand_;
  double time_;
  DeviceSample sample_;
};

}  // namespace

namespace driver_files {
Driver loopback() {
  return {
      "loopback",
      "loopback:FILE.csv[#INSTRUMENT][,mass=0.15][,stiffness=400][,damping=5][,friction=0.5][,tick=0.001] "
      "simulates a hand that follows a motion",
      [](const DeviceArguments& arguments) -> std::unique_ptr<HapticDevice> {
        Hand hand;
        read_settings(arguments, "loopback",
                      {{"mass", &hand.mass},
                       {"stiffness", &hand.stiffness},
                       {"damping", &hand.damping},
                       {"friction", &hand.friction},
                       {"tick", &hand.tick}});
        return std::make_unique<Loopback>(HandPath(arguments.text), hand);
      }};
}
}  // namespace driver_files

}  // namespace palpate
