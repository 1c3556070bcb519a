#include "palpate/haptics/device.hpp"

#include <charconv>
#include <cmath>

#include "palpate/base/error.hpp"

namespace palpate {

namespace driver_files {
#define PALPATE_DRIVER(name) Driver name();
#include "drivers.inc"
#undef PALPATE_DRIVER
}  // namespace driver_files

const std::vector<Driver>& drivers() {
#define PALPATE_DRIVER(name) driver_files::name(),
  static const std::vector<Driver> all{
#include "drivers.inc"
  };
#undef PALPATE_DRIVER
  return all;
}

namespace {

// "argument,key=number,...": a piece without '=' belongs to the argument, so that its comma may stay.
DeviceArguments parse(const std::string& text, const std::string& spec) {
  DeviceArguments arguments;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    const std::string piece = text.substr(at, end - at);
    const std::size_t equals = piece.find('=');
    if (at == 0 || equals == std::string::npos) {
      arguments.text += (at == 0 ? "" : ",") + piece;
    } else {
      double value = 0;
      const char* last = piece.data() + piece.size();
      const auto [stop, status] = std::from_chars(piece.data() + equals + 1, last, value);
      if (status != std::errc() || stop != last || !std::isfinite(value))
        throw Error(ErrorKind::usage, "device '{}': '{}' is not key=number", spec, piece);
      arguments.settings.emplace_back(piece.substr(0, equals), value);
    }
    at = end + 1;
  }
  return arguments;
}

}  // namespace

std::unique_ptr<HapticDevice> open_device(const std::string& spec) {
  const std::size_t colon = spec.find(':');
  std::string usages;
  for (const Driver& driver : drivers()) {
    if (driver.name == spec.substr(0, colon))
      return driver.open(colon == std::string::npos ? DeviceArguments{}
                                                    : parse(spec.substr(colon + 1), spec));
    usages += (usages.empty() ? "" : "; ") + driver.usage;
  }
  throw Error(ErrorKind::usage, "no device '{}'; there are: {}", spec, usages);
}

void read_settings(const DeviceArguments& arguments, const std::string& driver,
                   std::initializer_list<std::pair<const char*, double*>> known) {
  for (const auto& [key, value] : arguments.settings) {
    std::string names;
    double* place = nullptr;
    for (const auto& [name, to] : known) {
      if (key == name) place = to;
      names += std::string(names.empty() ? "" : ", ") + name;
    }
    if (!place)
      throw Error(ErrorKind::usage, "device {}: no setting '{}'; there are: {}", driver, key,
                  names.empty() ? "none" : names);
    if (!(value > 0))
      throw Error(ErrorKind::usage, "device {}: {} is {}; use more than 0", driver, key, value);
    *place = value;
  }
}

}  // namespace palpate
