#include "console.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>

#include "palpate/base/timer.hpp"

namespace palpate {

std::atomic<bool> interrupted{false};

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = [](int) { interrupted.store(true, std::memory_order_relaxed); };
  action.sa_flags = SA_RESETHAND;  // a second Ctrl-C ends the program at once
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

namespace {

// Draws at most ten times a second and leaves a clean line behind.
class Bar {
 public:
  explicit Bar(std::string label) : label_(std::move(label)) {}
  Bar(const Bar&) = delete;
  Bar& operator=(const Bar&) = delete;
  ~Bar() {
    if (drawn_) fmt::print(stderr, "\r\033[K");
  }
  void draw(double fraction) {
    const double now = timer_.seconds();
    if (now - last_ < 0.1) return;
    last_ = now;
    drawn_ = true;
    fraction = std::clamp(fraction, 0.0, 1.0);
    const int filled = static_cast<int>(30 * fraction);
    const std::string left = fraction > 0.01 ? human_time(now * (1 - fraction) / fraction) + " left" : "";
    fmt::print(stderr, "\r\033[K{:<12} [{:=<{}}{:{}}] {:3.0f} %  {}", label_, "", filled, "", 30 - filled,
               100 * fraction, left);
    std::fflush(stderr);
  }

 private:
  std::string label_;
  Timer timer_ = wall_timer();
  double last_ = 0;
  bool drawn_ = false;
};

}  // namespace

void Console::line(const std::string& text) const {
  if (json) return;
  fmt::print("{}\n", text);
  std::fflush(stdout);
}

void Console::object(const nlohmann::json& value) const {
  if (json) fmt::print("{}\n", value.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

Progress Console::progress(const std::string& label) const {
  Progress progress;
  progress.interrupted = &interrupted;
  if (isatty(STDERR_FILENO))
    progress.report = [bar = std::make_shared<Bar>(label)](double fraction) { bar->draw(fraction); };
  return progress;
}

std::string human_bytes(std::size_t bytes) {
  const auto b = static_cast<double>(bytes);
  if (b < 1e3) return fmt::format("{} B", bytes);
  if (b < 1e6) return fmt::format("{:.1f} kB", b * 1e-3);
  if (b < 1e9) return fmt::format("{:.1f} MB", b * 1e-6);
  return fmt::format("{:.2f} GB", b * 1e-9);
}

std::string human_time(double seconds) {
  if (seconds < 0.001) return fmt::format("{:.0f} us", seconds * 1e6);
  if (seconds < 1) return fmt::format("{:.3g} ms", seconds * 1e3);
  if (seconds < 60) return fmt::format("{:.2f} s", seconds);
  const auto whole = static_cast<long>(seconds);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole / 60 % 60);
}

}  // namespace palpate
