#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numeric>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/pad/pad.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

class OrganFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("palpate_organ_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    path_ = folder_ / "block.h5";
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_, path_;
};

ErrorKind kind_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.kind();
  }
  return static_cast<ErrorKind>(0);
}

// T 5.1.3: rows and columns of anchored nodes become the identity's, the whole is inverted, surface nodes are
// taken out; of quadratic tetrahedra by their hats. Largest difference to that, relative to sqrt(C_ii C_jj).
double error_of(const Organ& organ) {
  const ElementNodes nodes = element_nodes(organ.mesh, organ.order);
  Eigen::MatrixXd decoupled(assemble_stiffness(organ.mesh, nodes, organ.materials));
  const auto anchored = with_middles(anchored_nodes(organ.mesh, organ.anchors), nodes);
  std::vector<Index> all(nodes.size());
  std::iota(all.begin(), all.end(), 0);
  const auto rows = static_cast<Eigen::Index>(3 * organ.compliance.nodes());
  Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(decoupled.rows(), rows);
  if (organ.order == 2) loads = hat_loads(organ.surface, organ.surface_nodes, nodes, all, organ.node_of_row);
  for (Eigen::Index r = 0; organ.order == 1 && r < rows; ++r) {
    const auto node = static_cast<std::size_t>(organ.node_of_row[static_cast<std::size_t>(r / 3)]);
    loads(3 * organ.surface_nodes[node] + r % 3, r) = 1;
  }
  for (std::size_t n = 0; n < anchored.size(); ++n)
    for (int a = 0; anchored[n] && a < 3; ++a) {
      const auto d = static_cast<int>(3 * n) + a;
      decoupled.row(d).setZero();
      decoupled.col(d).setZero();
      decoupled(d, d) = 1;
      loads.row(d).setZero();
    }
  const Eigen::MatrixXd expected = loads.transpose() * decoupled.llt().solve(loads);
  const Eigen::Map<const Eigen::MatrixXf> c(organ.compliance.matrix().data(), rows, rows);
  const Eigen::ArrayXd scale = expected.diagonal().array().sqrt();
  return ((c.cast<double>() - expected).array().abs() / (scale.matrix() * scale.matrix().transpose()).array())
      .maxCoeff();
}

TEST(Organ, ComplianceIsTheInverseOfTheDecoupledStiffness) {
  for (const int order : {1, 2}) {
    const Organ organ = block_organ(order == 1 ? 4 : 3, {.order = order, .pinch = false});
    ASSERT_EQ(organ.compliance.nodes() + (order == 1 ? 25 : 16), organ.surface_size());
    EXPECT_LT(error_of(organ), 1e-6);
  }
}

TEST(Organ, AStoneAMillionTimesStifferThanTheKidney) {
  const TetMesh mesh = pad_delaunay(make_kidney(80), {{"stone", make_stone(20)}}).mesh;
  std::vector<Material> materials;
  for (const std::string& region : mesh.region_names)
    materials.push_back(region == "stone" ? Material{1e10, 0.3} : Material{1e4, 0.45});
  for (const int order : {1, 2}) {
    const Organ organ = bake(mesh, materials, {AnchorHalfSpace{{0, 0, -0.016}, {0, 0, 1}}}, 0, {}, nullptr,
                             {.order = order, .pinch = false});
    EXPECT_EQ(organ.mesh.region_names.size(), 2u);
    EXPECT_LT(error_of(organ), 1e-6);
  }
}

TEST(Organ, WhatCannotBeBakedIsANamedError) {
  const TetMesh mesh = make_block({Vec3::Zero(), Vec3::Ones()}, {2, 2, 2});
  const Material good{1e4, 0.45, 1000};
  const Anchor base = AnchorHalfSpace{Vec3::Zero(), Vec3::UnitZ()};
  EXPECT_EQ(kind_of([&] { bake(mesh, {good}, {}); }), ErrorKind::physics);
  EXPECT_EQ(kind_of([&] { bake(mesh, {{1e4, 0.5, 1000}}, {base}); }), ErrorKind::physics);
  EXPECT_EQ(kind_of([&] { bake(mesh, {{-1, 0.3, 1000}}, {base}); }), ErrorKind::physics);
  EXPECT_EQ(kind_of([&] {
              bake(mesh, {good}, {AnchorBox{{Vec3::Zero(), Vec3::Ones()}}});
            }),
            ErrorKind::physics);
  EXPECT_EQ(kind_of([&] { bake(TetMesh{}, {good}, {base}); }), ErrorKind::geometry);
  TetMesh bad = mesh;
  std::swap(bad.tets[5][0], bad.tets[5][1]);
  EXPECT_EQ(kind_of([&] { bake(bad, {good}, {base}); }), ErrorKind::geometry);
  bad = mesh;
  bad.nodes[3].x() = std::nan("");
  EXPECT_EQ(kind_of([&] { bake(bad, {good}, {base}); }), ErrorKind::geometry);
  std::atomic<bool> stop{true};
  Progress progress;
  progress.interrupted = &stop;
  EXPECT_EQ(kind_of([&] { bake(mesh, {good}, {base}, 1, progress); }), ErrorKind::interrupted);
}

TEST_F(OrganFile, RoundTripKeepsEveryBit) {
  for (const int order : {1, 2}) {
    const Organ a = block_organ(4, {.order = order, .pinch = false});
    write_organ(path_, a, "test");
    const Organ b = read_organ(path_);
    EXPECT_EQ(a.order, b.order);
    EXPECT_EQ(a.contact_points, b.contact_points);
    EXPECT_EQ(a.projection.rows(), b.projection.rows());
    EXPECT_EQ(a.mesh.nodes, b.mesh.nodes);
    EXPECT_EQ(a.mesh.tets, b.mesh.tets);
    EXPECT_EQ(a.mesh.region_names, b.mesh.region_names);
    EXPECT_EQ(a.surface.vertices, b.surface.vertices);
    EXPECT_EQ(a.surface.triangles, b.surface.triangles);
    EXPECT_EQ(a.surface_nodes, b.surface_nodes);
    EXPECT_EQ(a.row_of, b.row_of);
    EXPECT_EQ(a.node_of_row, b.node_of_row);
    EXPECT_EQ(a.areas, b.areas);
    EXPECT_EQ(a.hash, b.hash);
    ASSERT_EQ(a.compliance.nodes(), b.compliance.nodes());
    EXPECT_TRUE(std::equal(a.compliance.matrix().begin(), a.compliance.matrix().end(),
                           b.compliance.matrix().begin()));
  }
}

TEST_F(OrganFile, EveryStorageComesBackWithTheSameBits) {
  for (const Storage storage : all_storages) {
    const Organ a = block_organ(6, {1, storage, 1e-3, 0});
    EXPECT_STREQ(a.compliance.storage(), storage_name(storage));
    write_organ(path_, a, "test");
    for (const bool verify : {false, true}) {
      const Organ b = read_organ(path_, verify);
      EXPECT_STREQ(b.compliance.storage(), storage_name(storage));
      ASSERT_EQ(a.compliance.nodes(), b.compliance.nodes());
      EXPECT_EQ(a.compliance.bytes(), b.compliance.bytes());
      std::vector<float> x(3 * a.compliance.nodes()), y(x);
      for (const std::size_t row : {std::size_t{0}, std::size_t{100}, x.size() - 1}) {
        a.compliance.row(row, x), b.compliance.row(row, y);
        EXPECT_EQ(x, y);
      }
    }
  }
}

TEST_F(OrganFile, DamageInEveryStorageIsANamedError) {
  for (const Storage storage : all_storages) {
    write_organ(path_, block_organ(4, {1, storage, 1e-2, 0}), "test");
    std::ifstream in(path_, std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(in)), {});
    const fs::path damaged = folder_ / "damaged.h5";
    for (std::size_t at = 0; at < whole.size(); at += 1 + whole.size() / 150) {
      std::string bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ 0x40);
      std::ofstream(damaged, std::ios::binary) << bytes;
      for (const bool verify : {false, true}) {
        const ErrorKind kind = kind_of([&] { read_organ(damaged, verify); });
        EXPECT_TRUE(kind == ErrorKind::format || static_cast<int>(kind) == 0) << at;
      }
    }
  }
}

TEST(Organ, APivotThatIsNotPositiveNamesItsNodeAndTheLikelyCause) {
  const TetMesh mesh = make_block({Vec3::Zero(), Vec3::Ones()}, {3, 3, 3});
  const Anchor base = AnchorHalfSpace{Vec3::Zero(), Vec3::UnitZ()};
  const auto message = [&](const TetMesh& m, double poisson) {
    try {
      bake(m, {{1e4, poisson, 1000}}, {base});
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::physics);
      return std::string(e.what());
    }
    return std::string();
  };
  const std::string stiff = message(mesh, std::nextafter(0.5, 0));
  EXPECT_NE(stiff.find("at node "), std::string::npos) << stiff;
  EXPECT_NE(stiff.find("Poisson"), std::string::npos) << stiff;
}

TEST(Organ, MemoryIsPredictedAndWhatFitsIsNamed) {
  // Too little for anything, then for the dense storage alone, then enough.
  std::string seen;
  for (std::size_t limit = 1000000; seen.empty() || seen.back() != 'd'; limit += limit / 64) try {
      bake(make_block({Vec3::Zero(), Vec3(0.2, 0.2, 0.02)}, {20, 20, 2}), {{1e4, 0.45, 1000}},
           {AnchorHalfSpace{Vec3::Zero(), Vec3::UnitX()}}, 1, {}, nullptr, {1, Storage::dense, 1e-3, limit});
      seen += 'd';
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::resource);
      const bool other = std::string(e.what()).find("factored (") != std::string::npos;
      EXPECT_NE(other, std::string(e.what()).find("fewer surface nodes") != std::string::npos);
      if (seen.empty() || seen.back() != (other ? 'f' : '-')) seen += other ? 'f' : '-';
    }
  EXPECT_EQ(seen, "-fd");
  EXPECT_STREQ(block_organ(3, {1, std::nullopt, 1e-3, 0}).compliance.storage(), "dense float32");
}

TEST_F(OrganFile, DamageAndStalenessAreNamedErrors) {
  const Organ organ = block_organ(3);
  write_organ(path_, organ, "test");
  std::ifstream in(path_, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), {});
  const fs::path damaged = folder_ / "damaged.h5";
  const auto with = [&](const std::string& bytes) {
    std::ofstream(damaged, std::ios::binary) << bytes;
    return kind_of([&] { read_organ(damaged); });
  };
  for (std::size_t length = 0; length < whole.size(); length += 1 + whole.size() / 60)
    EXPECT_EQ(with(whole.substr(0, length)), ErrorKind::format) << length;
  for (std::size_t at = 0; at < whole.size(); at += 1 + whole.size() / 300) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x40);
    const ErrorKind kind = with(bytes);
    EXPECT_TRUE(kind == ErrorKind::format || static_cast<int>(kind) == 0) << at;
  }
  Organ stale = block_organ(3);
  stale.materials[0].young *= 2;  // a changed material with the old compliance
  write_organ(damaged, stale, "test");
  EXPECT_EQ(kind_of([&] { read_organ(damaged); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { read_organ(folder_ / "missing.h5"); }), ErrorKind::file);
  EXPECT_EQ(kind_of([&] { write_organ(folder_ / "no" / "folder.h5", organ, "test"); }), ErrorKind::file);
}

}  // namespace
}  // namespace palpate
