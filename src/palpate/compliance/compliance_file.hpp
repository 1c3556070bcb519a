// The compliance in a model's container (docs/formats.md).
#pragma once

#include "palpate/compliance/compliance.hpp"
#include "palpate/io/container.hpp"

namespace palpate {

// Adds the attribute `storage` and the arrays compliance/*.
void write_compliance(ContainerWriter& out, const Compliance& compliance, const Progress& progress = {});
// nodes: as the rest of the model says. verify: checksums of the big arrays too. Throws Error(format) where
// something does not fit.
Compliance read_compliance(const ContainerReader& in, const std::string& path, std::size_t nodes, bool verify,
                           const Progress& progress = {});

}  // namespace palpate
