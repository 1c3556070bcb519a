#include "palpate/elasticity/tissues.hpp"

#include <gtest/gtest.h>

#include <set>

#include "palpate/base/error.hpp"

namespace palpate {
namespace {

TEST(Tissues, AreMaterialsWithinTheirRanges) {
  std::set<std::string> names;
  for (const Tissue& t : tissues()) {
    EXPECT_NO_THROW(require_valid(t.typical, t.name));
    EXPECT_LT(t.young_low, t.young_high) << t.name;
    EXPECT_LE(t.young_low, t.typical.young) << t.name;
    EXPECT_GE(t.young_high, t.typical.young) << t.name;
    EXPECT_GT(t.typical.density, 900);
    EXPECT_LT(t.typical.density, 2000);
    EXPECT_TRUE(names.insert(t.name).second);
    EXPECT_NE(std::string(t.source).find_first_of("12"), std::string::npos) << "a year";
  }
}

TEST(Tissues, AndNumbersAreRead) {
  EXPECT_EQ(parse_material("liver", "x").young, 5.5e3);
  const Material m = parse_material("10e3,0.45,1050", "x");
  EXPECT_EQ(m.young, 10e3);
  EXPECT_EQ(m.poisson, 0.45);
  EXPECT_EQ(m.density, 1050);
  EXPECT_EQ(parse_material("1e4,0.3", "x").density, 1000);
  for (const char* text :
       {"", "cheese", "1e4", "1e4,", "1e4,0.3,1000,2", "1e4,0.5", "-1,0.3", "1e4 0.3", ",,"})
    EXPECT_THROW(parse_material(text, "x"), Error) << text;
  try {
    parse_material("cheese", "--material x=cheese");
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::usage);
    EXPECT_NE(std::string(e.what()).find("liver"), std::string::npos);
  }
}

}  // namespace
}  // namespace palpate
