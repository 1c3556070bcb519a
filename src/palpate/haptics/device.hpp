// Haptic devices: pose and buttons in, force out. docs/haptics.md shows how to write a driver.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "palpate/simulation/model.hpp"

namespace palpate {

struct DeviceSample {
  Pose pose;                             // of the handle, world, m
  Vec3 velocity = Vec3::Zero();          // m/s, world
  Vec3 angular_velocity = Vec3::Zero();  // rad/s, world; zero when the device does not measure it
  std::uint32_t buttons = 0;             // bit i: button i is down
  bool connected = false;  // false: no device, or its data are old; the rest is then the last known
};

// What the force loop sees of a device. Both calls return at once and do not allocate, lock or throw; what
// has to wait (sockets, USB) belongs to a thread of the driver, which also lets the force fade when write()
// is no longer called (Watchdog).
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;
  virtual DeviceSample read() noexcept = 0;
  // N and N m about the handle's origin, world: what the hand is to feel. A device without torque drops it.
  virtual void write(const Wrench& on_hand) noexcept = 0;
};

// The part of a device's name after "driver:", as argument[,key=number]...
struct DeviceArguments {
  std::string text;                                      // the argument: a file, an address; may be empty
  std::vector<std::pair<std::string, double>> settings;  // in the order given
};
struct Driver {
  std::string name;
  std::string usage;  // one line: what its arguments are
  std::unique_ptr<HapticDevice> (*open)(const DeviceArguments& arguments);  // throws Error
};
// All there are, one a file driver_*.cpp.
const std::vector<Driver>& drivers();

// "driver" or "driver:argument,key=number,...", such as "replay:hand.csv". Error(usage) lists the drivers;
// Error(file | format) of a file that is named. A device that is not there (yet) is no error: its samples say
// connected = false.
std::unique_ptr<HapticDevice> open_device(const std::string& spec);

// For drivers: the settings by name, Error(usage) for one that is not in the list or that is not above zero.
void read_settings(const DeviceArguments& arguments, const std::string& driver,
                   std::initializer_list<std::pair<const char*, double*>> known);

}  // namespace palpate
