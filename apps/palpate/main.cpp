// The program: options to structs, dispatch, errors to one line and an exit code (docs/errors.md).
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <new>

#include "commands.hpp"
#include "palpate/base/error.hpp"
#include "palpate/compliance/blas.hpp"

namespace palpate {
namespace {

// A subcommand with its help, an example at the foot, and what it runs.
CLI::App* command(CLI::App& app, const std::string& name, const std::string& help,
                  const std::string& example) {
  CLI::App* sub = app.add_subcommand(name, help);
  sub->footer("Example:\n  " + example);
  return sub;
}

const std::string unit_help = "unit of the file's lengths: m, cm, mm, um, in, ft";

void add_lattice(CLI::App& app, LatticeOptions& o, const Console& console) {
  CLI::App* c = command(app, "lattice", "Turn a surface into a lattice of exact signed distances.",
                        "palpate lattice bishop.iv --unit m --subdivisions 40 -o bishop.h5\n"
                        "  palpate lattice skull.stl --unit mm --spacing 0.2 --band 4 -o skull.h5");
  c->add_option("input", o.input, "surface: .iv .obj .stl .ply .glb")->required();
  c->add_option("-o,--output", o.output, "file to write; - prints the text format")->required();
  c->add_option("--unit", o.unit, unit_help)->capture_default_str();
  c->add_option("-n,--subdivisions", o.subdivisions, "cells along the shortest side of the bounding box")
      ->capture_default_str();
  c->add_option("--spacing", o.spacing, "cell size instead, in file units");
  c->add_option("--margin", o.margin, "grow the box by this much on all sides, in file units");
  c->add_option(
      "--band", o.band,
      "exact samples only this many cells about the surface, lower bounds elsewhere: for big grids");
  c->add_option("--sign", o.sign, "auto, pseudonormal or winding")->capture_default_str();
  c->add_option("--format", o.format,
                "auto (by extension), h5, text (the thesis' seven numbers a line) or vti")
      ->capture_default_str();
  c->callback([&] { run_lattice(o, console); });
}

void add_pad(CLI::App& app, PadCommandOptions& o, const Console& console) {
  CLI::App* c =
      command(app, "pad", "Fill a closed surface with tetrahedra.",
              "palpate pad kidney.stl --unit mm --surface-nodes 3000 --region stone=stone.stl -o kidney.vtu\n"
              "  palpate pad kidney.stl --unit mm --method delaunay -o kidney.vtu   (keeps its triangles)\n"
              "  palpate pad seg.nii.gz --labels kidney=2,3 --labels stone=5 -o kidney.vtu");
  c->add_option("input", o.input, "closed surface, or a label volume: .nii .nii.gz")->required();
  c->add_option("-o,--output", o.output, "tetrahedra: .vtu .msh .mesh .vtk .node (written in metres)")
      ->required();
  c->add_option("--unit", o.unit, unit_help)->capture_default_str();
  c->add_option("--region", o.regions,
                "NAME=FILE, a closed surface inside (repeatable; later ones lie inside earlier ones)")
      ->allow_extra_args(false);
  c->add_option(
       "--labels", o.labels,
       "of a label volume: NAME=1,2 (repeatable; the first is the tissue around the others; default: all)")
      ->allow_extra_args(false);
  c->add_option("--name", o.name, "name of the region in no inner surface")->capture_default_str();
  c->add_option(
       "--method", o.method,
       "stuffing (elements of the size asked for, angles from 10.7 to 164.8 degrees) or delaunay (the "
       "surface's own triangles)")
      ->capture_default_str();
  c->add_option("--surface-nodes", o.surface_nodes, "stuffing: how many, within 10 %")->capture_default_str();
  c->add_option(
      "--spacing", o.spacing,
      "stuffing: size of the elements; delaunay: of the interior nodes near the surface (default: 1.4 "
      "mean edges), in file units");
  c->add_flag(
      "--repair", o.repair,
      "stuffing: bridge small holes; delaunay: smooth the surfaces where they run through themselves");
  c->add_flag("!--uniform", o.grade, "do not let the tetrahedra grow with depth");
  c->callback([&] { run_pad(o, console); });
}

void add_precompute(CLI::App& app, PrecomputeOptions& o, const Console& console) {
  CLI::App* c =
      command(app, "precompute",
              "Turn tetrahedra, materials and anchors into a model (the compliance of its surface).",
              "palpate precompute kidney.vtu --material tissue=10e3,0.45 --material stone=1e9,0.3 \\\n"
              "    --anchor \"half-space 0 0 -0.02 0 0 1\" -o kidney.h5");
  c->add_option("input", o.input, "tetrahedra: .vtu .msh .mesh .vtk .node")->required();
  c->add_option("-o,--output", o.output, "model to write (.h5)")->required();
  c->add_option("--unit", o.unit, unit_help)->capture_default_str();
  c->add_option("--material", o.materials,
                "REGION=E,nu[,density]: Pa, -, kg/m3; or REGION=TISSUE, see `palpate tissues` (repeatable; "
                "without REGION= for all regions; default: cell arrays young, poisson, density)")
      ->allow_extra_args(false);
  c->add_option("--anchor", o.anchors,
                "fixed nodes (repeatable): box x0 y0 z0 x1 y1 z1 | sphere x y z r | half-space px py pz nx "
                "ny nz | region NAME | nodes 1,2,3")
      ->allow_extra_args(false);
  c->add_option("--bedding", o.beddings,
                "MODULUS and a place as of --anchor: springs to ground over that surface, N/m3 (repeatable), "
                "as in \"2e5 half-space 0 0 -0.02 0 0 1\"")
      ->allow_extra_args(false);
  c->add_option(
      "--drawing", o.drawing,
      "finer surface of the organ, in the unit of the input: rides on it and is drawn in its place");
  c->add_flag("!--no-pinch", o.pinch, "leave out the estimate of the discretisation error");
  c->add_option(
       "--order", o.order,
       "of the tetrahedra: 2 quadratic, accurate near nu = 0.5; 1 linear, quicker to precompute, too "
       "stiff on coarse meshes. Online both cost the same")
      ->capture_default_str()
      ->check(CLI::IsMember({1, 2}));
  c->add_option(
       "--storage", o.storage,
       "auto | dense (float32) | half (float16) | factored (exact, small, slow to use) | hierarchical")
      ->capture_default_str();
  c->add_option("--tolerance", o.tolerance,
                "of the hierarchical storage: certified error of each of its blocks")
      ->capture_default_str();
  c->add_option("--memory", o.memory, "that may be taken, as in 500M or 4G (default: what is free)");
  c->callback([&] { run_precompute(o, console); });
}

void add_simulate(CLI::App& app, SimulateOptions& o, const Console& console) {
  CLI::App* c = command(app, "simulate", "Run a scene file and leave frames, forces and a summary.",
                        "palpate simulate out/demo/scene.toml -o out/again\n"
                        "palpate simulate out/demo/scene.toml -o out/loop --loop --ticks 100000");
  c->add_option("scene", o.scene, "scene file (.toml, docs/scenes.md)")->required();
  c->add_option("-o,--output", o.output, "folder to write")->required();
  c->add_option("--steps", o.steps, "stop after so many steps (default: to the end of the motion)");
  c->add_option("--every", o.every, "steps between frames; 0: no frames")->capture_default_str();
  c->add_flag("!--no-pictures", o.pictures, "no contact sheet");
  CLI::Option* const loop = c->add_flag(
      "--loop", o.loop,
      "in real time: a force loop and the deforming surface, each in a thread; prints how long ticks take "
      "and leaves that in summary.json");
  c->add_option("--rate", o.rate, "with --loop: ticks a second, 1 to 4000; 0: as fast as they go")
      ->capture_default_str()
      ->needs(loop);
  c->add_flag("--awake", o.awake,
              "with --loop: never sleep between ticks; they are done sooner, and a core is taken")
      ->needs(loop);
  c->add_option("--frame-rate", o.frame_rate, "with --loop: surfaces a second, 1 to 1000")
      ->capture_default_str()
      ->needs(loop);
  c->add_option("--ticks", o.ticks,
                "with --loop: how many; the motion goes to and fro (default: as long as the motion)")
      ->needs(loop);
  CLI::Option* const device =
      c->add_option("--device", o.device,
                    "with --loop: a haptic device leads the first instrument and feels its force: haply, "
                    "loopback:FILE.csv, replay:FILE.csv (docs/haptics.md)");
  device->needs(loop);
  c->add_option("--device-at", o.device_at, "x y z: where the device's frame stands in the world, m")
      ->expected(3)
      ->needs(device);
  c->add_option("--record", o.record, "write every tick's input and a hash of every 1,000th state (.h5)");
  c->add_option("--replay", o.replay,
                "run a recording instead of the motion and compare the states bit by bit");
  c->callback([&] { run_simulate(o, console); });
}

void add_info(CLI::App& app, InfoOptions& o, const Console& console) {
  CLI::App* c = command(app, "info", "Say what a file holds: surface, tetrahedra, lattice or model.",
                        "palpate info liver.obj --unit mm");
  c->add_option("input", o.input, "any file palpate reads")->required();
  c->add_option("--unit", o.unit, unit_help)->capture_default_str();
  c->add_flag("--verify", o.verify, "also compare all checksums");
  c->callback([&] { run_info(o, console); });
}

void add_convert(CLI::App& app, ConvertOptions& o, const Console& console) {
  CLI::App* c =
      command(app, "convert", "Convert between mesh formats, models and the thesis' hand-over format.",
              "palpate convert ventricle.msh --unit mm ventricle.vtu");
  c->add_option("input", o.input, "file to read")->required();
  c->add_option("output", o.output,
                "file to write; its extension says the format (.handover: T 5.1.3, .inp: CalculiX)")
      ->required();
  c->add_option("--unit", o.unit, unit_help)->capture_default_str();
  c->add_option("--to-unit", o.to_unit, "unit of the lengths written")->capture_default_str();
  c->add_option("--material", o.materials, "tetrahedra to .inp: as of precompute")->allow_extra_args(false);
  c->add_option("--anchor", o.anchors, "tetrahedra to .inp: as of precompute")->allow_extra_args(false);
  c->add_option("--order", o.order, "tetrahedra to .inp: 1 C3D4, 2 C3D10")
      ->capture_default_str()
      ->check(CLI::IsMember({1, 2}));
  c->callback([&] { run_convert(o, console); });
}

void add_tissues(CLI::App& app, const Console& console) {
  command(app, "tissues", "Tissues that --material knows by name, with ranges and sources.",
          "palpate precompute liver.vtu --material liver --anchor \"box 0 0 0 1 1 0.1\" -o liver.h5")
      ->callback([&] { run_tissues(console); });
}

void add_demo(CLI::App& app, DemoOptions& o, const Console& console) {
  CLI::App* c = command(app, "demo", "A kidney with a stone, pressed by a chess bishop: the whole path.",
                        "palpate demo -o out/demo");
  c->add_option("-o,--output", o.output, "folder to write")->capture_default_str();
  c->add_option("--instrument", o.instrument,
                "surface of the instrument (default: bishop.iv of Debian's inventor-data)");
  c->add_option("--nodes", o.nodes, "surface nodes of the kidney")->capture_default_str();
  c->add_option("--steps", o.steps, "steps of the motion")->capture_default_str();
  c->add_flag("!--no-pictures", o.pictures, "no contact sheet");
  c->callback([&] { run_demo(o, console); });
}

int run(int argc, char** argv) {
  Console console;
  CLI::App app("palpate: organs that deform as elasticity says, with contact forces at haptic rate.",
               "palpate");
  app.set_version_flag("--version", PALPATE_VERSION);
  app.add_flag("--json", console.json, "print one JSON object instead of lines");
  app.add_option("--threads", console.threads, "threads to use (default: all)");
  app.require_subcommand(1);
  app.fallthrough();
  app.footer(
      "Exit codes: 0 done, 1 internal, 2 usage, 3 file, 4 format, 5 geometry, 6 physics, 7 memory, 130 "
      "interrupted.\n"
      "palpate COMMAND --help shows an example.");
  LatticeOptions lattice;
  add_lattice(app, lattice, console);
  PadCommandOptions pad;
  add_pad(app, pad, console);
  PrecomputeOptions precompute;
  add_precompute(app, precompute, console);
  SimulateOptions simulate;
  add_simulate(app, simulate, console);
  InfoOptions info;
  add_info(app, info, console);
  ConvertOptions convert;
  add_convert(app, convert, console);
  add_tissues(app, console);
  DemoOptions demo;
  add_demo(app, demo, console);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // help, version
    const bool unknown = app.get_subcommands().empty() && argc > 1 && argv[1][0] != '-';
    throw Error(ErrorKind::usage, "{}; see palpate {}--help",
                unknown ? fmt::format("'{}' is no command", argv[1]) : error.what(),
                app.get_subcommands().empty() ? "" : app.get_subcommands()[0]->get_name() + " ");
  }
  return 0;
}

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  palpate::set_up_blas();
  palpate::catch_interrupts();
  try {
    return palpate::run(argc, argv);
  } catch (const palpate::Error& error) {
    fmt::print(stderr, "palpate: {}\n", error.what());
    return static_cast<int>(error.kind());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "palpate: out of memory; use a smaller model or close other programs\n");
    return static_cast<int>(palpate::ErrorKind::resource);
  } catch (const std::exception& error) {
    fmt::print(stderr, "palpate: internal error: {}; please report it with the command that led to it\n",
               error.what());
    return static_cast<int>(palpate::ErrorKind::internal);
  }
}
