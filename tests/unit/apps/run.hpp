// Runs the program and catches what it says.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <string>

namespace palpate {

struct Ran {
  int exit_code = -1;
  std::string output;  // stdout and stderr
};

// Arguments as the shell takes them; `shell` is said to it first.
inline Ran run_palpate(const std::string& arguments, const std::string& shell = "") {
  Ran run;
  FILE* pipe = popen((shell + PALPATE_BIN_DIR "/palpate " + arguments + " 2>&1").c_str(), "r");
  if (!pipe) return run;
  char buffer[4096];
  for (std::size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) run.output.append(buffer, n);
  const int status = pclose(pipe);
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return run;
}

}  // namespace palpate
