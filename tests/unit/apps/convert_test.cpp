#include <gtest/gtest.h>

#include "palpate/io/container.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/io/tet_file.hpp"
#include "palpate/lattice/lattice_file.hpp"
#include "palpate/simulation/organ.hpp"
#include "run.hpp"
#include "unit/io/tet_test.hpp"
#include "unit/simulation/fixtures.hpp"

namespace palpate {
namespace {

struct Convert : ::testing::Test {
  Ran operator()(const std::string& from, const std::string& to, const std::string& options = "") const {
    return run_palpate(
        fmt::format("convert '{}' '{}' {}", (folder / from).string(), (folder / to).string(), options));
  }
  void done(const std::string& from, const std::string& to, const std::string& options = "") const {
    const Ran run = (*this)(from, to, options);
    EXPECT_EQ(run.exit_code, 0) << run.output;
  }
  void refused(const std::string& from, const std::string& to, ErrorKind kind,
               const std::string& options = "") const {
    const std::size_t files = folder.files();
    const Ran run = (*this)(from, to, options);
    EXPECT_EQ(run.exit_code, static_cast<int>(kind)) << run.output;
    const std::size_t message = run.output.find("palpate: ");  // one line, the last
    EXPECT_EQ(run.output.find('\n', std::min(message, run.output.size())), run.output.size() - 1)
        << run.output;
    EXPECT_EQ(folder.files(), files);
  }
  TempFolder folder;
};

TEST_F(Convert, TetrahedraThroughEveryFormat) {
  write_tets(folder / "a.msh", two_tets(), 0.001);
  done("a.msh", "b.vtu", "--unit mm");
  done("b.vtu", "c.vtk");
  done("c.vtk", "d.msh", "--to-unit cm");
  done("d.msh", "e.vtu", "--unit cm");
  EXPECT_TRUE(read_tets(folder / "e.vtu").mesh == two_tets());
  done("e.vtu", "f.node");
  done("f.ele", "g.mesh");
  EXPECT_EQ(read_tets(folder / "g.mesh").mesh.tets, two_tets().tets);
  done("e.vtu", "h.stl", "--to-unit mm");
  EXPECT_EQ(read_surface(folder / "h.stl", 0.001).mesh.triangles.size(), 6u);
  done("e.vtu", "h.inp");
  EXPECT_NE(read_file(folder / "h.inp").find("TYPE=C3D10"), std::string::npos);
  refused("e.vtu", "i.inp", ErrorKind::usage, "--material stone=1e4,0.3");
  refused("e.vtu", "i.inp", ErrorKind::usage, "--to-unit mm");
  refused("e.vtu", "h", ErrorKind::usage);
  refused("absent.vtu", "h.msh", ErrorKind::file);
  refused("e.vtu", "no/such/h.msh", ErrorKind::file);
  refused("e.vtu", "h.msh", ErrorKind::usage, "--unit parsec");
}

TEST_F(Convert, Surfaces) {
  write_surface(folder / "a.obj", boundary(two_tets()).surface);
  done("a.obj", "b.ply", "--unit mm");
  EXPECT_EQ(read_surface(folder / "b.ply").mesh.vertices[1], Vec3(0.001, 0, 0));
  done("b.ply", "c.vtu", "--to-unit mm");
  refused("c.vtu", "d.stl", ErrorKind::format);  // triangles in a .vtu are for ParaView
  refused("b.ply", "d.msh", ErrorKind::usage);
  folder.write("empty.stl", "");
  refused("empty.stl", "d.obj", ErrorKind::format);
}

TEST_F(Convert, ModelsAndTheHandOver) {
  const Organ organ = block_organ(2);
  write_organ(folder / "a.h5", organ, "test");
  done("a.h5", "b.handover");
  done("b.handover", "c.h5");
  const Organ back = read_organ(folder / "c.h5");
  const std::span<const float> a = back.compliance.matrix(), b = organ.compliance.matrix();
  EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin(), b.end()));
  done("a.h5", "d.vtu");
  EXPECT_TRUE(read_tets(folder / "d.vtu").mesh == organ.mesh);
  done("a.h5", "d.inp");
  EXPECT_NE(read_file(folder / "d.inp").find("*ELASTIC"), std::string::npos);
  done("a.h5", "d.stl", "--to-unit mm");
  done("a.h5", "d.msh", "--to-unit mm");
  done("b.handover", "e.vtu");  // the surface is all it has
  refused("b.handover", "e.inp", ErrorKind::usage);
  refused("a.h5", "e.handover", ErrorKind::usage, "--to-unit mm");
  refused("a.h5", "e.vtu", ErrorKind::usage, "--unit mm");
  refused("a.h5", "e.txt", ErrorKind::usage);
  folder.write("damaged.h5", read_file(folder / "a.h5").substr(0, 3000));
  refused("damaged.h5", "e.vtu", ErrorKind::format);
}

TEST_F(Convert, Lattices) {
  LatticeSamples samples;
  samples.grid = {Vec3(0, 0, 0), 0.5, {2, 2, 3}};
  for (int i = 0; i < 12; ++i) {  // of the point (0, 0, 0.5)
    samples.closest.push_back(Vec3(0, 0, 0.5));
    samples.distance.push_back((samples.grid.point(i / 6, i / 3 % 2, i % 3) - samples.closest.back()).norm());
  }
  write_lattice(folder / "a.h5", samples, boundary(two_tets()).surface, "test");
  done("a.h5", "b.txt");
  done("b.txt", "c.h5");
  EXPECT_NEAR(read_lattice(folder / "c.h5").samples.distance[11], samples.distance[11], 1e-5);
  done("c.h5", "d.vti");
  done("a.h5", "d.stl");
  refused("c.h5", "e.stl", ErrorKind::usage);  // no surface in a text lattice
  refused("a.h5", "e.txt", ErrorKind::usage, "--to-unit mm");
}

}  // namespace
}  // namespace palpate
