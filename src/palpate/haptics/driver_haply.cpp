// haply: an Inverse3 with a VerseGrip through Haply's Inverse Service, JSON over a local WebSocket
// (docs.haply.co, Simulation Channel, 3.x). The service sends its inventory when a client connects and then
// one state a message it receives:
//   {"inverse3": [{"device_id": "04BA", "state": {"cursor_position": {"x": ..}, "cursor_velocity": {..}}}],
//    "wireless_verse_grip": [{"state": {"orientation": {"w": ..}, "buttons": {"a": false, ..}}}],
//    "verse_grip": [{"state": {"orientation": {..}, "button": false}}]}           m, m/s, x right, z up
//   {"inverse3": [{"device_id": "04BA", "commands": {"set_cursor_force": {"values": {"x": ..}}}}]}     N
// A thread of the driver talks; the force loop's read and write only touch triple buffers. The thread goes on
// sending when the force loop stops, with the force fading (Watchdog), and reconnects when the service is
// gone. Whatever the service sends: no crash, and not connected before a position has been understood.
#define BOOST_ASIO_DISABLE_FENCED_BLOCK  // one thread an io_context; the thread sanitizer knows no fences
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <charconv>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/base/triple_buffer.hpp"
#include "palpate/haptics/device.hpp"
#include "palpate/haptics/watchdog.hpp"

namespace palpate {

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using Json = nlohmann::json;
using std::chrono::microseconds, std::chrono::milliseconds;

constexpr double stale = 0.1;                     // s, older states are no connection
constexpr auto period = microseconds(500);        // between two commands
constexpr auto patience = milliseconds(500);      // for the service's answer
constexpr std::size_t longest_message = 1 << 20;  // bytes

// The member, nothing when it is missing or j is no object.
const Json* member(const Json* j, const char* key) {
  if (!j || !j->is_object()) return nullptr;
  const auto it = j->find(key);
  return it == j->end() ? nullptr : &*it;
}

// The state of the first device of a kind.
const Json* first(const Json& message, const char* kind) {
  const Json* devices = member(&message, kind);
  return devices && devices->is_array() && !devices->empty() ? &devices->front() : nullptr;
}

std::optional<double> number(const Json* j, const char* key) {
  const Json* value = member(j, key);
  if (!value || !value->is_number() || !std::isfinite(value->get<double>())) return {};
  return value->get<double>();
}

std::optional<Vec3> vector(const Json* j) {
  const auto x = number(j, "x"), y = number(j, "y"), z = number(j, "z");
  if (!x || !y || !z) return {};
  return Vec3(*x, *y, *z);
}

bool down(const Json* buttons, const char* key) {
  const Json* b = member(buttons, key);
  return b && b->is_boolean() && b->get<bool>();
}

// Takes what a message says into the sample and the device's name; false when there is no position in it.
bool understand(const std::string& text, DeviceSample& sample, std::string& device) {
  const Json message = Json::parse(text, nullptr, false);
  const Json* inverse = first(message, "inverse3");
  const Json* id = member(inverse, "device_id");
  if (id && id->is_string()) device = id->get<std::string>();
  const Json* state = member(inverse, "state");
  const auto position = vector(member(state, "cursor_position"));
  if (device.empty() || !position) return false;
  sample.pose.translation = *position;
  sample.velocity = vector(member(state, "cursor_velocity")).value_or(Vec3::Zero());
  for (const char* kind : {"wireless_verse_grip", "verse_grip"}) {
    const Json* grip = member(first(message, kind), "state");
    if (!grip) continue;
    const Json* q = member(grip, "orientation");
    const auto w = number(q, "w");
    const auto v = vector(q);
    if (w && v) {
      const Eigen::Quaterniond rotation(*w, v->x(), v->y(), v->z());
      if (std::abs(rotation.norm() - 1) < 0.1) sample.pose.rotation = rotation.normalized();
    }
    const Json* buttons = member(grip, "buttons");
    sample.buttons = (down(buttons, "a") || down(grip, "button") ? 1u : 0u) | (down(buttons, "b") ? 2u : 0u) |
                     (down(buttons, "c") ? 4u : 0u);
    break;
  }
  return true;
}

std::string command(const std::string& device, const Vec3& force) {
  if (device.empty()) return R"({"session":{"force_render_full_state":{}}})";  // ask what devices there are
  const Json values{{"x", force.x()}, {"y", force.y()}, {"z", force.z()}};
  return Json{{"inverse3", Json::array({{{"device_id", device},
                                         {"commands", {{"set_cursor_force", {{"values", values}}}}}}})}}
      .dump(-1, ' ', false, Json::error_handler_t::replace);
}

class Haply final : public HapticDevice {
 public:
  Haply(std::string host, std::string port) : host_(std::move(host)), port_(std::move(port)) {
    thread_ = std::jthread([this](const std::stop_token& stop) { talk(stop); });
  }

  DeviceSample read() noexcept override {
    states_.fetch();
    DeviceSample sample = states_.front().sample;
    sample.connected = sample.connected && clock_.seconds() - states_.front().time < stale;
    return sample;
  }

  void write(const Wrench& on_hand) noexcept override {
    forces_.back() = on_hand.force.allFinite() ? on_hand.force : Vec3(Vec3::Zero());
    forces_.publish();
    watchdog_.tick(clock_.seconds());
  }

 private:
  struct Stamped {
    DeviceSample sample;
    double time = 0;  // s, of clock_
  };
  using Socket = beast::websocket::stream<beast::tcp_stream>;

  // Runs one asynchronous operation to its end; false when it failed or took longer than the patience.
  template <class Start>
  static bool finish(asio::io_context& io, beast::tcp_stream& stream, const Start& start) {
    beast::error_code result = asio::error::in_progress;
    start([&result](beast::error_code error, const auto&...) { result = error; });
    io.restart();
    io.run_for(patience);
    if (result == asio::error::in_progress) {
      beast::error_code ignored;
      stream.socket().close(ignored);  // ends the operation
      io.restart();
      io.run();
    }
    return !result;
  }

  void talk(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      try {
        session(stop);
      } catch (const std::exception&) {  // out of memory or of sockets: once more
      }
      state_.sample.connected = false;
      states_.back() = state_;
      states_.publish();
      for (int i = 0; i < 20 && !stop.stop_requested(); ++i) std::this_thread::sleep_for(milliseconds(10));
    }
  }

  // From connecting to the end of the connection.
  void session(const std::stop_token& stop) {
    asio::io_context io;
    Socket socket(io);
    beast::tcp_stream& stream = socket.next_layer();
    const auto run = [&](const auto& start) { return finish(io, stream, start); };
    const auto addresses = asio::ip::tcp::resolver(io).resolve(host_, port_);
    if (!run([&](auto done) { stream.async_connect(addresses, done); })) return;
    stream.socket().set_option(asio::ip::tcp::no_delay(true));
    socket.read_message_max(longest_message);
    if (!run([&](auto done) { socket.async_handshake(host_ + ":" + port_, "/", done); })) return;

    std::string device, text;
    beast::flat_buffer buffer;
    const auto send = [&](const Vec3& force) {
      text = command(device, force);
      return run([&](auto done) { socket.async_write(asio::buffer(text), done); });
    };
    auto next = std::chrono::steady_clock::now();
    while (run([&](auto done) { socket.async_read(buffer, done); })) {
      if (understand(beast::buffers_to_string(buffer.data()), state_.sample, device)) {
        state_.sample.connected = true, state_.time = clock_.seconds();
        states_.back() = state_;
        states_.publish();
      }
      buffer.clear();
      if (stop.stop_requested()) {
        send(Vec3::Zero());
        return;
      }
      next = std::max(next + period, std::chrono::steady_clock::now());
      std::this_thread::sleep_until(device.empty() ? next + 40 * period : next);
      forces_.fetch();
      if (!send(watchdog_.scale(clock_.seconds()) * forces_.front())) return;
    }
  }

  const std::string host_, port_;
  const Timer clock_ = wall_timer();
  Watchdog watchdog_;
  Stamped state_;  // the thread's
  TripleBuffer<Stamped> states_;
  TripleBuffer<Vec3> forces_{Vec3::Zero()};
  std::jthread thread_;  // last: ends before what it uses
};

// "", "ws://host", "ws://host:port"
std::unique_ptr<HapticDevice> open(const DeviceArguments& arguments) {
  read_settings(arguments, "haply", {});
  std::string host = arguments.text, port = "10001";
  if (host.rfind("ws://", 0) == 0) host.erase(0, 5);
  if (!host.empty() && host.back() == '/') host.pop_back();
  if (const std::size_t colon = host.rfind(':'); colon != std::string::npos)
    port = host.substr(colon + 1), host.resize(colon);
  if (arguments.text.empty()) host = "localhost";
  unsigned number = 0;
  const auto [end, status] = std::from_chars(port.data(), port.data() + port.size(), number);
  if (host.empty() || status != std::errc() || end != port.data() + port.size() || number == 0 ||
      number > 65535)
    throw Error(ErrorKind::usage, "device haply: '{}' is no address; use ws://host:port", arguments.text);
  return std::make_unique<Haply>(host, port);
}

}  // namespace

namespace driver_files {
Driver haply() {
  return {"haply", "haply[:ws://localhost:10001] is an Inverse3 through Haply's Inverse Service", open};
}
}  // namespace driver_files

}  // namespace palpate
