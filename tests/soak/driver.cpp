#include "soak/driver.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "palpate/simulation/scene.hpp"

namespace palpate::soak {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

// Where instruments wander: the organ's box and some air.
Box room(const Organ& organ) {
  const Box box = bounding_box(organ.surface.vertices);
  return box.grown(0.25 * box.diagonal());
}

// The loopback device whose hand follows a random way.
std::unique_ptr<HapticDevice> make_device(const Box& where, Random& random, std::uint64_t ticks) {
  MotionFile file;
  for (double t = 0; t < 1e-3 * static_cast<double>(ticks); t += random.between(0.02, 0.3)) {
    file.motion.times.push_back(t);
    file.motion.poses.push_back({random.pose_in(where)});
    file.organs.push_back({Pose{}});
    file.motion.grips.push_back({random.once_in(2)});
  }
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / fmt::format("palpate-soak-{}.csv", getpid());
  write_motion(path, file, {"tool"});
  auto device = open_device("loopback:" + path.string());
  std::filesystem::remove(path);
  return device;
}

bool finite(const Wrench& w) { return w.force.allFinite() && w.torque.allFinite(); }

bool finite(const State& state) {
  for (const Wrench& w : state.wrenches)
    if (!finite(w)) return false;
  for (const Contact& c : state.contacts)
    if (!c.force.allFinite() || !std::isfinite(c.gap_after) || !std::isfinite(c.gap_before) ||
        !c.touched.allFinite())
      return false;
  for (const Grasp& g : state.grasps)
    if (!g.place.allFinite()) return false;
  for (std::size_t i = 0; i < state.loads.count; ++i)
    if (!state.loads.forces[i].allFinite() || (state.loads.u_known && !state.loads.u[i].allFinite()))
      return false;
  return std::isfinite(state.deepest_before) && std::isfinite(state.deepest_after);
}

}  // namespace

Driver::Driver(std::span<const Model> models, std::uint64_t seed, std::uint64_t ticks, bool coupled)
    : models_(models),
      random_(seed),
      ticks_(ticks),
      grips_(models[0].instruments.size()),
      before_(models.size()) {
  const Box where = room(models[0].organ);
  for (std::size_t i = 0; i < grips_.size(); ++i) ways_.emplace_back(where, random_);
  for (std::size_t o = 0; o < models.size(); ++o)
    beside_.push_back(o == 0 ? Vec3(Vec3::Zero()) : Vec3(0.08 * random_.direction()));
  if (coupled) device_ = make_device(where, random_, ticks);
}

void Driver::complain(std::uint64_t k, std::string text) {
  if (complaint_.empty()) complaint_ = fmt::format("tick {}: {}", k, text);
}

std::string Driver::complaint() const {
  return complaint_.empty() && bad_surface_ ? "a surface is not finite" : complaint_;
}

// The device may be lost for a while, or say nonsense; time may stand still.
void Driver::lead_by_hand(std::span<const State> before, std::span<Input> inputs) {
  DeviceSample sample = device_->read();
  if (lose_ == 0 && random_.once_in(150)) lose_ = 1 + static_cast<int>(random_.below(150));
  sample.connected = lose_ == 0;
  if (lose_ > 0) --lose_, ++lost_for_, ++met_.lost;
  if (sample.connected) lost_for_ = 0;
  double dt = 1e-3;
  switch (random_.below(200)) {
    case 0:
      sample.pose.translation[1] = nan;
      break;
    case 1:
      sample.pose.rotation.coeffs().setConstant(infinity);
      break;
    case 2:
      sample.velocity.setConstant(nan);
      break;
    case 3:
      sample.pose.translation += random_.direction();  // a jump of a metre
      break;
    case 4:
      sample.pose.translation *= 1e30;
      break;
    case 5:
      dt = 0;
      break;
    case 6:
      dt = random_.once_in(2) ? nan : -1;
      break;
    case 7:
      dt = 10;
      break;
  }
  place(inputs, 0, couple(settings_, coupling_, sample, wrench_of(before, 0), dt, is_taken(before)));
  grip(inputs, 0, sample.buttons != 0);
}

// In one organ's input.
void Driver::add_fault(std::span<Input> inputs) {
  const std::size_t organ = random_.below(inputs.size());
  Input& input = inputs[organ];
  Pose& pose = input.instruments[random_.below(input.instruments.size())];
  const std::size_t fault = random_.below(9);
  before_[organ].must_refuse |= fault < 7;
  switch (fault) {
    case 0:
      pose.translation[0] = nan;
      break;
    case 1:
      pose.translation[2] = -infinity;
      break;
    case 2:
      pose.rotation.coeffs().setZero();
      break;
    case 3:
      input.instruments.resize(random_.below(input.instruments.size()));
      break;
    case 4:
      input.organ.rotation.coeffs()[2] = nan;
      break;
    case 5:
      pose.translation.setConstant(1e30);
      break;
    case 6:
      input.grips.push_back(1);
      break;
    case 7:
      pose.translation += random_.direction();
      break;
    default:
      pose.translation = input.organ * bounding_box(models_[organ].organ.surface.vertices).center();
  }
}

bool Driver::lead(std::uint64_t k, std::span<const State> before, std::span<Input> inputs) {
  if (k >= ticks_ + leaving || !complaint_.empty()) return false;
  bool still = random_.once_in(20) && k > 0;  // a step of no time
  away_ = k >= ticks_;
  for (std::size_t o = 0; o < inputs.size(); ++o) {
    still = still && !before_[o].must_refuse;
    before_[o] = {false, before[o].loads.number, before[o].wrenches};
    inputs[o].instruments.resize(grips_.size());
  }
  const double time = random_.once_in(50) ? (random_.once_in(2) ? nan : -1.0) : 1e-3 * static_cast<double>(k);
  if (random_.once_in(10)) organ_.translation += 1e-4 * random_.direction();
  if (random_.once_in(300))
    organ_ = {Eigen::Quaterniond(Eigen::AngleAxisd(random_.between(0, 3), random_.direction())),
              random_.direction()};
  for (std::uint8_t& grip : grips_)
    if (random_.once_in(60)) grip = !grip;
  const Pose origin = device_ ? Pose{} : organ_;
  for (std::size_t o = 0; o < inputs.size(); ++o) {
    inputs[o].time = time, inputs[o].grips = grips_;
    inputs[o].organ = origin * Pose{Eigen::Quaterniond::Identity(), beside_[o]};
  }
  for (std::size_t i = 0; i < ways_.size(); ++i)
    if (away_)  // a half-space is solid below z = 0
      place(inputs, i, origin * Pose{Eigen::Quaterniond::Identity(), Vec3(0, 0, -1)});
    else if (!still)
      place(inputs, i, origin * ways_[i].next(random_));
  if (away_) return true;
  if (device_) lead_by_hand(before, inputs);
  if (random_.once_in(40)) add_fault(inputs);
  if (refuse_ == 0 && random_.once_in(300)) refuse_ = 1 + static_cast<int>(random_.below(150));
  refused_for_ = refuse_ > 0 ? refused_for_ + 1 : 0;
  if (refuse_ > 0) --refuse_, inputs[0].organ.translation[1] = nan, before_[0].must_refuse = true;
  return true;
}

// Each node once, and no more than the grips that are closed hold.
void Driver::check_grips(std::uint64_t k, const State& state) {
  for (std::size_t i = 0; i < state.grasps.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (state.grasps[i].node == state.grasps[j].node) complain(k, "a node is grasped twice");
  for (const Contact& c : state.contacts) {
    bool known = !c.grasped;
    for (const Grasp& g : state.grasps) known = known || (g.node == c.node && g.instrument == c.instrument);
    if (!known) complain(k, "a grasped contact without a grasp");
  }
}

void Driver::check_hand(std::uint64_t k, std::span<const State> states) {
  const Wrench hand = hand_wrench(settings_, coupling_, wrench_of(states, 0));
  if (!finite(hand)) return complain(k, "the hand's force is not finite");
  if (hand.force.norm() > settings_.force_limit * (1 + 1e-9) ||
      hand.torque.norm() > settings_.torque_limit * (1 + 1e-9))
    complain(k, fmt::format("the hand feels {} N, {} N m", hand.force.norm(), hand.torque.norm()));
  if (std::max(lost_for_, refused_for_) > 60 && hand.force.norm() > 0)
    complain(
        k, fmt::format("the device is lost for {} ticks, inputs are refused for {}, and the hand feels {} N",
                       lost_for_, refused_for_, hand.force.norm()));
  device_->write(hand);
  watchdog_.tick(clock_ += 1e-3);
  watchdog_.scale(clock_);
  if (!random_.once_in(200)) return;
  for (int i = 0; i < 100; ++i) watchdog_.scale(clock_ += 1e-3);  // the loop hangs for 0.1 s
  if (watchdog_.scale(clock_) > 0) complain(k, "the watchdog lets the force stay");
}

void Driver::check_one(std::uint64_t k, const State& state, const Before& before) {
  met_.touching += !state.contacts.empty(), met_.not_converged += (state.status & not_converged) != 0;
  met_.full += (state.status & too_many_contacts) != 0, met_.bad_inputs += before.must_refuse;
  met_.grasping += !state.grasps.empty();
  if (!finite(state)) return complain(k, "the state is not finite");
  if (before.must_refuse != (state.status == bad_input))
    complain(k, fmt::format("status {}, bad input {}", state.status, before.must_refuse));
  if (before.must_refuse) {
    if (state.loads.number != before.loads) complain(k, "bad input changed the loads");
    for (std::size_t i = 0; i < before.wrenches.size(); ++i)
      if (state.wrenches[i].force != before.wrenches[i].force) complain(k, "bad input changed a force");
  }
  check_grips(k, state);
  if (away_) {
    for (const Wrench& w : state.wrenches)
      if (w.force != Vec3::Zero() || w.torque != Vec3::Zero())
        complain(k, fmt::format("a metre away, and {} N", w.force.norm()));
    if (state.loads.count > 0 || !state.contacts.empty() || !state.grasps.empty())
      complain(k, "a metre away, and contacts");
  }
}

void Driver::check(std::uint64_t k, std::span<const State> states) {
  for (std::size_t o = 0; o < states.size(); ++o) check_one(k, states[o], before_[o]);
  if (device_ && !away_) check_hand(k, states);
}

void Driver::check_surface(const Surface& surface) {
  bool good = std::isfinite(surface.strains.largest);
  for (std::size_t i = 0; i < surface.positions.size(); ++i)
    good = good && surface.positions[i].allFinite() && surface.displacement[i].allFinite();
  if (!good) bad_surface_ = true;
}

}  // namespace palpate::soak
