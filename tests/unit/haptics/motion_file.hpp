// A motion file for a device to play, gone with the test.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace palpate {

struct MotionText {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("palpate_hand_" + std::to_string(::getpid()) + ".csv");
  explicit MotionText(const std::string& text) { std::ofstream(path) << text; }
  ~MotionText() { std::filesystem::remove(path); }
  std::string device(const std::string& driver, const std::string& more = "") const {
    return driver + ":" + path.string() + more;
  }
};

}  // namespace palpate
