// Damage done to files, and what a reader may do with them. Shared by tests and the fuzzing campaign.
#pragma once

#include <filesystem>
#include <string>

namespace palpate {

// The bytes with a few changes: bits flipped, numbers put in, pieces cut, doubled or swapped. By `seed`
// alone.
std::string damaged(std::string bytes, unsigned seed);

// Reads the bytes by the path's extension; the file is written only where another program reads it. Empty
// when that gives a sound mesh or volume, or an Error of a kind that a bad file may have, in one line;
// otherwise what happened instead.
std::string read_damaged(const std::filesystem::path& path, const std::string& bytes);

}  // namespace palpate
