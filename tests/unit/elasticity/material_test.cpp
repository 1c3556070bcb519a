#include "palpate/elasticity/material.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "palpate/base/error.hpp"

namespace palpate {
namespace {

TEST(Material, LameParameters) {
  const Material m{10e3, 0.25};
  EXPECT_DOUBLE_EQ(m.lambda(), 4e3);
  EXPECT_DOUBLE_EQ(m.mu(), 4e3);
}

TEST(Material, RefusesWhatHasNoStiffnessAndSaysWhere) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(),
                   inf = std::numeric_limits<double>::infinity();
  for (const Material& m :
       {Material{0, 0.3}, Material{-1, 0.3}, Material{nan, 0.3}, Material{inf, 0.3}, Material{1e4, 0.5},
        Material{1e4, 0.7}, Material{1e4, -1}, Material{1e4, nan}, Material{1e4, 0.3, 0},
        Material{1e4, 0.3, nan}, Material{1e308, 0.4999999999999999}})
    try {
      require_valid(m, "region 'stone'");
      ADD_FAILURE() << m.young << " " << m.poisson << " " << m.density;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::physics);
      EXPECT_NE(std::string(e.what()).find("region 'stone'"), std::string::npos) << e.what();
    }
  EXPECT_NO_THROW(require_valid({1e4, 0.499}, ""));
  EXPECT_NO_THROW(require_valid({1e4, -0.5}, ""));
}

}  // namespace
}  // namespace palpate
