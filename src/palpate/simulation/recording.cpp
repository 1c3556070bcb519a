#include "palpate/simulation/recording.hpp"

#include <algorithm>

#include "palpate/base/error.hpp"
#include "palpate/base/hash.hpp"
#include "palpate/io/container.hpp"

namespace palpate {

namespace {

// 1: of one organ, 2: of several, both still written for what has no grip.
constexpr int recording_version = 3;

void put(const Pose& p, std::vector<double>& out) {
  const Eigen::Quaterniond& q = p.rotation;
  for (const double x : {p.translation.x(), p.translation.y(), p.translation.z(), q.w(), q.x(), q.y(), q.z()})
    out.push_back(x);
}

Pose pose(const double* x) { return {Eigen::Quaterniond(x[3], x[4], x[5], x[6]), Vec3(x[0], x[1], x[2])}; }

// One hash of several; of one its own.
template <class T, class HashOf>
std::uint64_t together(std::span<const T> all, const HashOf& hash_of) noexcept {
  if (all.size() == 1) return hash_of(all[0]);
  Hash hash;
  for (const T& one : all) {
    const std::uint64_t h = hash_of(one);
    hash.add_bytes(&h, sizeof h);
  }
  return hash.value();
}

std::uint64_t hash_of(std::span<const Model> models) noexcept {
  return together(models, [](const Model& model) { return model.organ.hash; });
}

}  // namespace

std::uint64_t state_hash(const State& state) noexcept {
  Hash hash;
  const std::uint32_t status = state.status & ~std::uint32_t{strain_beyond_linear};  // the surface's
  hash.add_bytes(&status, sizeof status);
  for (const Contact& c : state.contacts) {
    hash.add_bytes(&c.node, sizeof c.node);
    hash.add_bytes(&c.instrument, sizeof c.instrument);
    if (c.triangle >= 0) {
      hash.add_bytes(&c.triangle, sizeof c.triangle);
      hash.add_bytes(c.weights.data(), 3 * sizeof(double));
    }
    hash.add_bytes(c.force_in_organ.data(), 3 * sizeof(double));
    hash.add_bytes(&c.gap_after, sizeof c.gap_after);
  }
  for (std::size_t i = 0; i < state.loads.count; ++i) {
    hash.add_bytes(&state.loads.rows[i], sizeof(Index));
    hash.add_bytes(state.loads.forces[i].data(), 3 * sizeof(double));
    hash.add_bytes(state.loads.u[i].data(), 3 * sizeof(double));
  }
  for (const Grasp& g : state.grasps) {
    hash.add_bytes(&g.node, sizeof g.node);
    hash.add_bytes(&g.instrument, sizeof g.instrument);
    hash.add_bytes(g.place.data(), 3 * sizeof(double));
  }
  for (const Wrench& w : state.wrenches) {
    hash.add_bytes(w.force.data(), 3 * sizeof(double));
    hash.add_bytes(w.torque.data(), 3 * sizeof(double));
  }
  return hash.value();
}

std::uint64_t state_hash(std::span<const State> states) noexcept {
  return together(states, [](const State& state) { return state_hash(state); });
}

Recording::Recording(std::span<const Model> models, std::uint64_t ticks)
    : organs_(models.size()),
      instruments_(models[0].instruments.size()),
      organ_(hash_of(models)),
      room_(ticks) {
  times_.reserve(ticks);
  poses_.reserve(per_pose * bodies() * ticks);
  grips_.reserve(instruments_ * ticks);
  hashes_.reserve(ticks / hash_every + 1);
}

bool Recording::made_with(std::span<const Model> models) const noexcept {
  return models.size() == organs_ && models[0].instruments.size() == instruments_ &&
         hash_of(models) == organ_;
}

bool Recording::add(std::span<const Input> inputs, std::span<const State> states) noexcept {
  if (times_.size() >= room_ || inputs.size() != organs_ || inputs[0].instruments.size() != instruments_) {
    ++left_out_;
    return false;
  }
  times_.push_back(inputs[0].time);
  for (const Input& input : inputs) put(input.organ, poses_);
  for (const Pose& p : inputs[0].instruments) put(p, poses_);
  for (std::size_t i = 0; i < instruments_; ++i)
    grips_.push_back(i < inputs[0].grips.size() && inputs[0].grips[i] != 0);
  last_ = state_hash(states);
  if (has_hash(times_.size() - 1)) hashes_.push_back(static_cast<std::int64_t>(last_));
  return true;
}

void Recording::set_inputs(std::uint64_t k, std::span<Input> inputs) const noexcept {
  const double* const organs = poses_.data() + per_pose * bodies() * k;
  const double* const instruments = organs + per_pose * organs_;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    inputs[i].time = times_[k];
    inputs[i].organ = pose(organs + per_pose * i);
    for (std::size_t j = 0; j < inputs[i].instruments.size(); ++j)
      inputs[i].instruments[j] = pose(instruments + per_pose * j);
    inputs[i].grips.assign(grips_.begin() + static_cast<std::ptrdiff_t>(instruments_ * k),
                           grips_.begin() + static_cast<std::ptrdiff_t>(instruments_ * (k + 1)));
  }
}

bool Recording::agrees(std::uint64_t k, std::span<const State> states) const noexcept {
  if (k + 1 == times_.size()) return state_hash(states) == last_;
  return !has_hash(k) || state_hash(states) == static_cast<std::uint64_t>(hashes_[k / hash_every]);
}

void Recording::write(const std::filesystem::path& path, const std::string& provenance) const {
  if (left_out_ > 0)
    throw Error(
        ErrorKind::usage,
        "{}: {} of {} ticks are not in the recording, which was made for {} ticks of {} instrument(s); "
        "make it for all",
        path.string(), left_out_, left_out_ + ticks(), room_, instruments_);
  const bool gripped = std::find(grips_.begin(), grips_.end(), 1) != grips_.end();
  ContainerWriter out(path, "recording", gripped ? recording_version : organs_ == 1 ? 1 : 2);
  out.attribute("provenance", provenance);
  out.attribute("organ_hash", static_cast<std::int64_t>(organ_));
  if (organs_ > 1 || gripped) out.attribute("organs", static_cast<std::int64_t>(organs_));
  out.attribute("instruments", static_cast<std::int64_t>(instruments_));
  out.attribute("last_hash", static_cast<std::int64_t>(last_));
  out.array<double>("time", times_, {times_.size()}, "s", "of each tick");
  out.array<double>("poses", poses_, {times_.size(), bodies(), per_pose}, "m, 1",
                    "position and quaternion (w x y z) of the organs and the instruments in each tick");
  if (gripped)
    out.array<std::uint8_t>("grips", grips_, {times_.size(), instruments_}, "",
                            "1 where an instrument's grip is closed in each tick");
  out.array<std::int64_t>("hashes", hashes_, {hashes_.size()}, "",
                          "of the state after every thousandth tick; of the last: attribute last_hash");
  out.commit();
}

Recording Recording::read(const std::filesystem::path& path) {
  const ContainerReader in(path, "recording", recording_version);
  Recording r;
  const auto require = [&](bool ok, const char* what) {
    if (!ok) throw Error(ErrorKind::format, "{}: {}; the file is damaged", path.string(), what);
  };
  const std::int64_t instruments = in.integer("instruments");
  require(instruments >= 0 && instruments < 1000, "a strange number of instruments");
  r.instruments_ = static_cast<std::size_t>(instruments);
  const std::int64_t organs = in.version() > 1 ? in.integer("organs") : 1;
  require(organs > 0 && organs < 1000, "a strange number of organs");
  r.organs_ = static_cast<std::size_t>(organs);
  r.organ_ = static_cast<std::uint64_t>(in.integer("organ_hash"));
  r.last_ = static_cast<std::uint64_t>(in.integer("last_hash"));
  r.times_ = in.vector<double>("time");
  r.poses_ = in.vector<double>("poses");
  r.grips_.assign(r.times_.size() * r.instruments_, 0);
  if (in.version() > 2) r.grips_ = in.vector<std::uint8_t>("grips");
  r.hashes_ = in.vector<std::int64_t>("hashes");
  require(r.poses_.size() == per_pose * r.bodies() * r.times_.size(), "poses do not match the times");
  require(r.grips_.size() == r.instruments_ * r.times_.size(), "grips do not match the times");
  require(r.hashes_.size() == r.times_.size() / hash_every, "hashes do not match the times");
  return r;
}

}  // namespace palpate
