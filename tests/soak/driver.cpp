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
  for (std::size_t i = 0; i < state.loads.count; ++i)
    if (!state.loads.forces[i].allFinite() || (state.loads.u_known && !state.loads.u[i].allFinite()))
      return false;
  return std::isfinite(state.deepest_before) && std::isfinite(state.deepest_after);
}

}  // namespace

Driver::Driver(const Model& model, std::uint64_t seed, std::uint64_t ticks, bool coupled)
    : model_(model), random_(seed), ticks_(ticks) {
  for (std::size_t i = 0; i < model.instruments.size(); ++i) ways_.emplace_back(room(model.organ), random_);
  if (coupled) device_ = make_device(room(model.organ), random_, ticks);
}

void Driver::complain(std::uint64_t k, std::string text) {
  if (complaint_.empty()) complaint_ = fmt::format("tick {}: {}", k, text);
}

std::string Driver::complaint() const {
  return complaint_.empty() && bad_surface_ ? "a surface is not finite" : complaint_;
}

// The device may be lost for a while, or say nonsense; time may stand still.
void Driver::lead_by_hand(const State& before, Input& input) {
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
  input.instruments[0] = couple(settings_, coupling_, sample, before.wrenches[0], dt);
}

void Driver::add_fault(Input& input) {
  Pose& pose = input.instruments[random_.below(input.instruments.size())];
  const std::size_t fault = random_.below(8);
  must_refuse_ = fault < 6;
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
      pose.translation += random_.direction();
      break;
    default:
      pose.translation = input.organ * bounding_box(model_.organ.surface.vertices).center();
  }
}

bool Driver::lead(std::uint64_t k, const State& before, Input& input) {
  if (k >= ticks_ + leaving || !complaint_.empty()) return false;
  const bool still = random_.once_in(20) && k > 0 && !must_refuse_;  // a step of no time
  must_refuse_ = false, away_ = k >= ticks_;
  loads_before_ = before.loads.number, wrenches_before_ = before.wrenches;
  input.instruments.resize(model_.instruments.size());
  input.time = random_.once_in(50) ? (random_.once_in(2) ? nan : -1.0) : 1e-3 * static_cast<double>(k);
  if (random_.once_in(10)) organ_.translation += 1e-4 * random_.direction();
  if (random_.once_in(300))
    organ_ = {Eigen::Quaterniond(Eigen::AngleAxisd(random_.between(0, 3), random_.direction())),
              random_.direction()};
  input.organ = device_ ? Pose{} : organ_;
  if (away_) {  // a half-space is solid below z = 0
    for (Pose& p : input.instruments) p = input.organ * Pose{Eigen::Quaterniond::Identity(), Vec3(0, 0, -1)};
    return true;
  }
  for (std::size_t i = 0; i < ways_.size() && !still; ++i)
    input.instruments[i] = input.organ * ways_[i].next(random_);
  if (device_) lead_by_hand(before, input);
  if (random_.once_in(40)) add_fault(input);
  return true;
}

void Driver::check_hand(std::uint64_t k, const State& state) {
  const Wrench hand = hand_wrench(settings_, coupling_, state.wrenches[0]);
  if (!finite(hand)) return complain(k, "the hand's force is not finite");
  if (hand.force.norm() > settings_.force_limit * (1 + 1e-9) ||
      hand.torque.norm() > settings_.torque_limit * (1 + 1e-9))
    complain(k, fmt::format("the hand feels {} N, {} N m", hand.force.norm(), hand.torque.norm()));
  if (lost_for_ > 60 && hand.force.norm() > 0)
    complain(k, fmt::format("the device is lost for {} ticks, and the hand feels {} N", lost_for_,
                            hand.force.norm()));
  device_->write(hand);
  watchdog_.tick(clock_ += 1e-3);
  watchdog_.scale(clock_);
  if (!random_.once_in(200)) return;
  for (int i = 0; i < 100; ++i) watchdog_.scale(clock_ += 1e-3);  // the loop hangs for 0.1 s
  if (watchdog_.scale(clock_) > 0) complain(k, "the watchdog lets the force stay");
}

void Driver::check(std::uint64_t k, const State& state) {
  met_.touching += !state.contacts.empty(), met_.not_converged += (state.status & not_converged) != 0;
  met_.full += (state.status & too_many_contacts) != 0, met_.bad_inputs += must_refuse_;
  if (!finite(state)) return complain(k, "the state is not finite");
  if (must_refuse_ != (state.status == bad_input))
    complain(k, fmt::format("status {}, bad input {}", state.status, must_refuse_));
  if (must_refuse_) {
    if (state.loads.number != loads_before_) complain(k, "bad input changed the loads");
    for (std::size_t i = 0; i < wrenches_before_.size(); ++i)
      if (state.wrenches[i].force != wrenches_before_[i].force) complain(k, "bad input changed a force");
  }
  if (away_) {
    for (const Wrench& w : state.wrenches)
      if (w.force != Vec3::Zero() || w.torque != Vec3::Zero())
        complain(k, fmt::format("a metre away, and {} N", w.force.norm()));
    if (state.loads.count > 0 || !state.contacts.empty()) complain(k, "a metre away, and contacts");
  } else if (device_) {
    check_hand(k, state);
  }
}

void Driver::check_surface(const Surface& surface) {
  bool good = std::isfinite(surface.strains.largest);
  for (std::size_t i = 0; i < surface.positions.size(); ++i)
    good = good && surface.positions[i].allFinite() && surface.displacement[i].allFinite();
  if (!good) bad_surface_ = true;
}

}  // namespace palpate::soak
