// The haply driver against a service written here: it speaks the same protocol, and says wrong things.
#define BOOST_ASIO_DISABLE_FENCED_BLOCK  // as in the driver
#include <gtest/gtest.h>

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "palpate/base/error.hpp"
#include "palpate/haptics/device.hpp"

namespace palpate {
namespace {

using boost::asio::ip::tcp;
using Json = nlohmann::json;
using namespace std::chrono_literals;

std::string inverse3(double x) {
  return R"({"session_id":7,"inverse3":[{"device_id":"04BA","state":{"cursor_position":{"x":)" +
         std::to_string(x) +
         R"(,"y":-0.15,"z":0.14},"cursor_velocity":{"x":0.5,"y":0,"z":-1}},"status":{"ready":true}}],)"
         R"("wireless_verse_grip":[{"device_id":"6154","state":{"orientation":{"w":0.6,"x":0,"y":0,"z":0.8},)"
         R"("buttons":{"a":true,"b":false,"c":true}}}]})";
}

// Accepts one client after the other; sends the inventory and then one message an answer.
class Service {
 public:
  explicit Service(std::uint16_t port = 0)
      : acceptor_(io_, {boost::asio::ip::address_v4::loopback(), port}), says_(inverse3(0)) {
    thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
  }
  std::uint16_t port() const { return acceptor_.local_endpoint().port(); }
  std::string device() const { return "haply:ws://127.0.0.1:" + std::to_string(port()); }
  void say(const std::string& text) {
    const std::lock_guard lock(mutex_);
    says_ = text;
  }
  std::vector<std::string> heard() {
    const std::lock_guard lock(mutex_);
    return std::exchange(heard_, {});
  }
  void drop() { drop_ = true; }
  std::atomic<bool> silent{false};
  std::atomic<int> clients{0};

 private:
  void serve(const std::stop_token& stop) {
    acceptor_.non_blocking(true);
    while (!stop.stop_requested()) {
      boost::beast::error_code error;
      tcp::socket accepted(io_);
      acceptor_.accept(accepted, error);
      if (error) {
        std::this_thread::sleep_for(2ms);
        continue;
      }
      accepted.non_blocking(false);
      boost::beast::websocket::stream<tcp::socket> socket(std::move(accepted));
      socket.accept(error);
      if (error) continue;
      ++clients;
      boost::beast::flat_buffer buffer;
      for (drop_ = false; !error && !drop_ && !stop.stop_requested();) {
        std::string text;
        {
          const std::lock_guard lock(mutex_);
          text = says_;
        }
        while (silent && !drop_ && !stop.stop_requested()) std::this_thread::sleep_for(2ms);
        socket.write(boost::asio::buffer(text), error);
        if (error) break;
        socket.read(buffer, error);
        const std::lock_guard lock(mutex_);
        if (!error) heard_.push_back(boost::beast::buffers_to_string(buffer.data()));
        buffer.clear();
      }
    }
  }

  boost::asio::io_context io_;
  tcp::acceptor acceptor_;
  std::mutex mutex_;
  std::string says_;
  std::vector<std::string> heard_;
  std::atomic<bool> drop_{false};
  std::jthread thread_;
};

// Until it is so; false after ten seconds.
template <class So>
bool soon(const So& so) {
  for (int i = 0; i < 5000; ++i, std::this_thread::sleep_for(2ms))
    if (so()) return true;
  return false;
}

Vec3 force_in(const std::string& text) {
  const Json j = Json::parse(text);
  if (!j.contains("inverse3")) return Vec3::Constant(-1);
  EXPECT_EQ(j["inverse3"][0]["device_id"], "04BA");
  const Json& v = j["inverse3"][0]["commands"]["set_cursor_force"]["values"];
  return Vec3(v["x"].get<double>(), v["y"].get<double>(), v["z"].get<double>());
}

TEST(Haply, ReadsStatesAndSendsForces) {
  Service service;
  service.say(inverse3(0.08));
  const auto device = open_device(service.device());
  ASSERT_TRUE(soon([&] { return device->read().connected; }));
  const DeviceSample s = device->read();
  EXPECT_EQ(s.pose.translation, Vec3(0.08, -0.15, 0.14));
  EXPECT_EQ(s.velocity, Vec3(0.5, 0, -1));
  EXPECT_NEAR(s.pose.rotation.angularDistance(Eigen::Quaterniond(0.6, 0, 0, 0.8)), 0, 1e-12);
  EXPECT_EQ(s.buttons, 5u);
  service.say(inverse3(0.09));
  EXPECT_TRUE(soon([&] { return device->read().pose.translation.x() == 0.09; }));
  const Vec3 force(1, -2, 0.5);
  EXPECT_TRUE(soon([&] {  // after the ramp
    device->write({force, Vec3(9, 9, 9)});
    const auto heard = service.heard();
    return !heard.empty() && (force_in(heard.back()) - force).norm() < 1e-12;
  }));
  device->write({Vec3::Constant(std::nan("")), Vec3::Zero()});
  EXPECT_TRUE(soon([&] {
    const auto heard = service.heard();
    return !heard.empty() && force_in(heard.back()) == Vec3::Zero();
  }));
}

// The loop stops: what is sent falls to zero, without a step, and stays there.
TEST(Haply, ForceFadesWhenTheLoopStops) {
  Service service;
  const auto device = open_device(service.device());
  ASSERT_TRUE(soon([&] {
    device->write({Vec3(0, 0, 4), Vec3::Zero()});
    const auto heard = service.heard();
    return !heard.empty() && force_in(heard.back()).z() == 4;
  }));
  std::vector<double> sent;
  ASSERT_TRUE(soon([&] {
    for (const std::string& text : service.heard()) sent.push_back(force_in(text).z());
    return !sent.empty() && sent.back() == 0;
  }));
  EXPECT_TRUE(std::is_sorted(sent.rbegin(), sent.rend()));
  EXPECT_GT(std::count_if(sent.begin(), sent.end(), [](double f) { return f > 0 && f < 4; }), 0);
  std::this_thread::sleep_for(50ms);
  for (const std::string& text : service.heard()) EXPECT_EQ(force_in(text), Vec3::Zero());
}

// The driver ends: its last word is no force.
TEST(Haply, LeavesNoForceBehind) {
  Service service;
  auto device = open_device(service.device());
  ASSERT_TRUE(soon([&] {
    device->write({Vec3(0, 0, 4), Vec3::Zero()});
    const auto heard = service.heard();
    return !heard.empty() && force_in(heard.back()).z() == 4;
  }));
  device.reset();
  EXPECT_TRUE(soon([&] {
    const auto heard = service.heard();
    return !heard.empty() && force_in(heard.back()) == Vec3::Zero();
  }));
}

TEST(Haply, WrongMessages) {
  Service service;
  const std::string position = R"("cursor_position":{"x":1,"y":2,"z":3})";
  const std::vector<std::string> wrong{
      "",
      "{",
      "null",
      "7",
      "[]",
      "{}",
      R"({"inverse3":[]})",
      R"({"inverse3":{}})",
      R"({"inverse3":[null]})",
      R"({"inverse3":[{"device_id":"04BA"}]})",
      R"({"inverse3":[{"device_id":"04BA","state":[]}]})",
      R"({"inverse3":[{"device_id":"04BA","state":{"cursor_position":{"x":1,"y":2}}}]})",
      R"({"inverse3":[{"device_id":"04BA","state":{"cursor_position":{"x":"1","y":2,"z":3}}}]})",
      R"({"inverse3":[{"device_id":"04BA","state":{"cursor_position":{"x":1e999,"y":2,"z":3}}}]})",
      R"({"inverse3":[{"device_id":"04BA","state":{"cursor_position":null}}]})",
      std::string(100000, '['),
  };
  service.say(R"({"inverse3":[{"state":{)" + position + "}}]}");  // nothing to send a force to
  const auto device = open_device(service.device());
  const auto answers = [&] {  // three, so the last message has been read
    std::size_t heard = 0;
    return soon([&] { return (heard += service.heard().size()) > 2; });
  };
  ASSERT_TRUE(answers());
  EXPECT_FALSE(device->read().connected);
  for (const std::string& text : wrong) {
    service.say(text);
    service.heard();
    ASSERT_TRUE(answers()) << text.substr(0, 50);
    EXPECT_TRUE(soon([&] { return !device->read().connected; })) << text.substr(0, 50);
    service.say(inverse3(0.05));  // and it goes on
    EXPECT_TRUE(soon([&] { return device->read().connected; })) << text.substr(0, 50);
  }
  EXPECT_EQ(service.clients, 1);
  service.say("\xff\xfe");  // no text at all: WebSocket ends the connection
  ASSERT_TRUE(soon([&] { return service.clients > 1; }));
  service.say(inverse3(0.05));
  EXPECT_TRUE(soon([&] { return device->read().connected; }));
  // Without a grip, or with half of one, there is a position all the same.
  for (const char* grip : {"", R"(,"verse_grip":[{"state":{"button":true,"orientation":{"w":0}}}])",
                           R"(,"wireless_verse_grip":[{"state":{"buttons":[1],"orientation":7}}])"}) {
    service.say(R"({"inverse3":[{"device_id":"04BA","state":{)" + position + "}}]" + grip + "}");
    EXPECT_TRUE(soon([&] {
      const DeviceSample s = device->read();
      return s.connected && s.pose.translation == Vec3(1, 2, 3);
    })) << grip;
    EXPECT_NEAR(device->read().pose.rotation.norm(), 1, 1e-12);
    service.say(inverse3(0.05));
    EXPECT_TRUE(soon([&] { return device->read().pose.translation.x() == 0.05; }));
  }
}

TEST(Haply, DropsAndReconnects) {
  std::uint16_t port = 0;
  std::unique_ptr<HapticDevice> device;
  {
    Service service;
    port = service.port();
    device = open_device(service.device());
    ASSERT_TRUE(soon([&] { return device->read().connected; }));
    for (int i = 1; i <= 3; ++i) {
      service.drop();
      ASSERT_TRUE(soon([&] { return service.clients == 1 + i; }));
      EXPECT_TRUE(soon([&] { return device->read().connected; }));
    }
    service.silent = true;  // it hangs
    EXPECT_TRUE(soon([&] { return !device->read().connected; }));
    EXPECT_EQ(device->read().pose.translation.z(), 0.14);  // the last that was known
    service.drop();
    service.silent = false;
    EXPECT_TRUE(soon([&] { return device->read().connected; }));
  }
  EXPECT_TRUE(soon([&] { return !device->read().connected; }));  // the service is gone
  Service again(port);
  again.say(inverse3(0.07));
  EXPECT_TRUE(soon([&] {
    const DeviceSample s = device->read();
    return s.connected && s.pose.translation.x() == 0.07;
  }));
}

TEST(Haply, NobodyThere) {
  std::uint16_t port = 0;
  {
    boost::asio::io_context io;
    port = tcp::acceptor(io, {boost::asio::ip::address_v4::loopback(), 0}).local_endpoint().port();
  }
  const auto device = open_device("haply:ws://127.0.0.1:" + std::to_string(port));
  for (int i = 0; i < 50; ++i) {
    EXPECT_FALSE(device->read().connected);
    device->write({});
    std::this_thread::sleep_for(1ms);
  }
}

TEST(Haply, Addresses) {
  for (const char* spec :
       {"haply", "haply:ws://localhost:10001", "haply:ws://localhost/", "haply:localhost:9"})
    EXPECT_FALSE(open_device(spec)->read().connected) << spec;
  for (const char* spec : {"haply:ws://", "haply:ws://:10001", "haply:ws://localhost:", "haply:localhost:0",
                           "haply:localhost:65536", "haply:localhost:1x", "haply:localhost,speed=1"})
    EXPECT_THROW(open_device(spec), Error) << spec;
}

}  // namespace
}  // namespace palpate
