#include "surface_samples.hpp"

#include <array>
#include <string>

#include "tet_test.hpp"

namespace palpate {

namespace {

const std::string cube_points = "0 0 0, 1 0 0, 1 1 0, 0 1 0, 0 0 1, 1 0 1, 1 1 1, 0 1 1";
const std::string cube_faces = "0 3 2 1 -1 4 5 6 7 -1 0 1 5 4 -1 1 2 6 5 -1 2 3 7 6 -1 3 0 4 7 -1";
const std::string cube_inside_out = "1 2 3 0 -1 7 6 5 4 -1 4 5 1 0 -1 5 6 2 1 -1 6 7 3 2 -1 7 4 0 3 -1";
const std::string tetrahedron = "0 0 0, 1 0 0, 0 1 0, 0 0 1";
const std::string cube_set =
    "Coordinate3 { point [ " + cube_points + " ] } IndexedFaceSet { coordIndex [ " + cube_faces + " ] }\n";
const std::string mirrored_set = "Coordinate3 { point [ " + cube_points +
                                 " ] } IndexedFaceSet { coordIndex [ " + cube_inside_out + " ] }\n";

constexpr std::array<std::array<double, 3>, 4> corners{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
constexpr std::array<std::array<int, 3>, 4> faces{{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}};

std::string iv(const std::string& scene) { return "#Inventor V2.1 ascii\n\n" + scene; }
std::string wrl(const std::string& geometry) {
  return "#VRML V2.0 utf8\nShape { geometry " + geometry + " }\n";
}

std::string stl_binary(const std::string& header) {
  Bytes out;
  out << header + std::string(80 - header.size(), ' ');
  out.add<std::uint32_t>({4});
  for (const auto& f : faces) {
    out.add<float>({0, 0, 0});
    for (const int v : f) {
      const auto& p = corners[static_cast<std::size_t>(v)];
      out.add<float>({p[0], p[1], p[2]});
    }
    out.add<std::uint16_t>({0x7fff});
  }
  return out.bytes;
}

std::string stl_text(const std::string& end, bool capitals) {
  std::string out = "solid body with facet in its name" + end;
  for (const auto& f : faces) {
    out += "  facet normal nan 0 0" + end + "    outer loop" + end;
    for (const int v : f) {
      const auto& p = corners[static_cast<std::size_t>(v)];
      out += fmt::format("\tvertex {:e} {} +{}{}", p[0], p[1], p[2], end);
    }
    out += "    endloop" + end + "  endfacet" + end;
  }
  out += "endsolid" + end + "solid empty" + end + "endsolid empty" + end;
  if (capitals)
    for (char& c : out) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return out;
}

std::string ply_text() {
  std::string out =
      "ply\nformat ascii 1.0\ncomment faces first\nelement face 4\nproperty list uchar float uv\n"
      "property list uint8 int32 vertex_index\nelement nothing 18000000000000000\nelement vertex 4\n"
      "property float quality\nproperty float z\nproperty double y\nproperty float32 x\nelement edge 1\n"
      "property int a\nproperty int b\nend_header\n";
  for (const auto& f : faces) out += fmt::format("2 0.5 nan 3 {} {} {}\n", f[0], f[1], f[2]);
  for (const auto& p : corners) out += fmt::format("inf {} {} {}\n", p[2], p[1], p[0]);
  return out + "0 1\n";
}

template <class Real, class Count, class Int>
std::string ply_binary(bool swapped, const std::string& real, const std::string& count,
                       const std::string& integer) {
  Bytes out(swapped);
  out << fmt::format(
      "ply\r\nformat binary_{}_endian 1.0\r\nelement vertex 4\r\nproperty {} x\r\nproperty {} y\r\nproperty "
      "{} z\r\n"
      "property list {} ushort more\r\nelement face 4\r\nproperty list {} {} vertex_indices\r\nproperty char "
      "flag\r\n"
      "end_header\r\n",
      swapped ? "big" : "little", real, real, real, count, count, integer);
  for (const auto& p : corners)
    out.add<Real>({p[0], p[1], p[2]}).template add<Count>({2}).template add<std::uint16_t>({7, 8});
  for (const auto& f : faces)
    out.add<Count>({3})
        .template add<Int>({double(f[0]), double(f[1]), double(f[2])})
        .template add<std::int8_t>({-1});
  return out.bytes;
}

std::string ply_strips() {
  return "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
         "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
         "10 0 2 1 3 0 -1 -1 0 3 2\n";
}

std::string obj_cube(const std::string& end) {
  std::string out = "\xef\xbb\xbf# cube" + end + "mtllib none.mtl" + end + "o body" + end;
  for (const char* p : {"0 0 0", "1 0 0", "1 1 0", "0 1 0", "0 0 1 1.0", "1e0 0. +1 0.5 .5 1", "10E-1 1 1"})
    out += std::string("v  ") + p + "  # place" + end;
  out += "v 0 \\" + end + "\t1 1" + end + "vt 0 0" + end + "vn 0 0 1" + end + "g side" + end + "s off" + end;
  for (const char* f :
       {"1 4 3 2", "5/1 6/1 7/1 8/1", "1//1 2//1 6//1 5//1", "2/1/1 3/1/1 7/1/1 6/1/1", "-6 -5 -1 -2"})
    out += std::string("f ") + f + end;
  return out + "l 1 2" + end + "p 1" + end + "f 4 1 \\" + end + " 5 8";  // the last line has no end
}

}  // namespace

std::string glb(const std::string& nodes, int mode, const std::vector<int>& indices) {
  Bytes body;
  for (const auto& p : corners) body.add<float>({p[0], p[1], p[2]});
  for (const int i : indices) body.add<std::uint16_t>({double(i)});
  const std::size_t used = body.bytes.size();
  body << std::string((4 - used % 4) % 4, '\0');
  std::string json = fmt::format(
      R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{}],)"
      R"("meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":{}}}]}}],)"
      R"("accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},)"
      R"({{"bufferView":1,"componentType":5123,"count":{},"type":"SCALAR"}}],)"
      R"("bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":{}}}],)"
      R"("buffers":[{{"byteLength":{}}}]}})",
      nodes, mode, indices.size(), used - 48, body.bytes.size());
  json += std::string((4 - json.size() % 4) % 4, ' ');
  Bytes out;
  out << "glTF";
  out.add<std::uint32_t>({2, double(28 + json.size() + body.bytes.size()), double(json.size())});
  out << "JSON" + json;
  out.add<std::uint32_t>({double(body.bytes.size())});
  out << std::string("BIN\0", 4) + body.bytes;
  return out.bytes;
}

std::string nifti1(bool swapped, int datatype) {
  const auto number = [&](auto sample, double value) {
    return Bytes(swapped).add<decltype(sample)>({value}).bytes;
  };
  std::string h(352, '\0');
  const auto put = [&](std::size_t at, const std::string& bytes) {
    std::copy(bytes.begin(), bytes.end(), h.data() + at);
  };
  put(0, number(std::int32_t{}, 348));
  put(40, Bytes(swapped).add<std::int16_t>({3, 2, 3, 4, 1, 1, 1, 1}).bytes);
  put(70, number(std::int16_t{}, datatype));
  put(76, Bytes(swapped).add<float>({1, 2, 3, 4}).bytes);
  put(108, number(float{}, 352));
  h[123] = 2;
  put(344, std::string("n+1\0", 4));
  for (int i = 0; i < 24; ++i) switch (datatype) {
      case 2:
        h += number(std::uint8_t{}, i);
        break;
      case 4:
        h += number(std::int16_t{}, i);
        break;
      case 8:
        h += number(std::int32_t{}, i);
        break;
      case 16:
        h += number(float{}, i);
        break;
      case 64:
        h += number(double{}, i);
        break;
      case 256:
        h += number(std::int8_t{}, i);
        break;
      case 512:
        h += number(std::uint16_t{}, i);
        break;
      case 768:
        h += number(std::uint32_t{}, i);
        break;
      case 1024:
        h += number(std::int64_t{}, i);
        break;
      case 1280:
        h += number(std::uint64_t{}, i);
        break;
      default:
        h += std::string(4, '\0');
    }
  return h;
}

std::vector<SurfaceSample> own_surface_samples() {
  const double sixth = 1.0 / 6;
  return {
      {"cube.obj", obj_cube("\n"), 8, 12, 1},
      {"crlf.obj", obj_cube("\r\n"), 8, 12, 1},
      {"cr.obj", "v 0 0 0\rv 1 0 0\rv 0 1 0\rv 0 0 1\rf 1 3 2\rf 1 2 4\rf 2 3 4\rf 1 4 3\r", 4, 4, sixth},
      {"binary.stl", stl_binary("any"), 4, 4, sixth},
      {"solid.stl", stl_binary("solid that is none"), 4, 4, sixth},
      {"text.stl", stl_text("\n", false), 4, 4, sixth},
      {"capitals.stl", stl_text("\r\n", true), 4, 4, sixth},
      {"text.ply", ply_text(), 4, 4, sixth},
      {"little.ply", ply_binary<float, std::uint8_t, std::int32_t>(false, "float", "uchar", "int"), 4, 4,
       sixth},
      {"big.ply", ply_binary<double, std::uint32_t, std::uint16_t>(true, "double", "uint", "ushort"), 4, 4,
       sixth},
      {"odd.ply", ply_binary<float, std::int16_t, float>(true, "float32", "int16", "float32"), 4, 4, sixth},
      {"strips.ply", ply_strips(), 4, 4, sixth}};
}

std::vector<SurfaceSample> surface_samples() {
  const double sixth = 1.0 / 6;
  std::vector<SurfaceSample> all = own_surface_samples();
  const std::vector<SurfaceSample> imported{
      {"faces.iv", iv(cube_set), 8, 12, 1},
      {"v1.iv", "#Inventor V1.0 ascii\n" + cube_set, 8, 12, 1},
      {"clockwise.iv",
       iv("ShapeHints { vertexOrdering CLOCKWISE faceType UNKNOWN_FACE_TYPE }\n" + mirrored_set), 8, 12, 1},
      {"mirror.iv", iv("Scale { scaleFactor -2 1 1 }\n" + cube_set), 8, 12, 2},
      {"both.iv", iv("Scale { scaleFactor 1 1 -1 } ShapeHints { vertexOrdering CLOCKWISE }\n" + mirrored_set),
       8, 12, 1},
      {"use.iv",
       iv("Separator { DEF part Separator { " + cube_set +
          " } Transform { translation 0 0 5 scaleFactor 2 2 2 } USE part }"),
       16, 24, 9},
      {"property.iv",
       iv("IndexedFaceSet { vertexProperty VertexProperty { vertex [ " + tetrahedron +
          " ] } coordIndex [ 0,2,1,-1, 0,1,3,-1, 1,2,3,-1, 0,3,2,-1 ] }"),
       4, 4, sixth},
      {"strip.iv",
       iv("Coordinate3 { point [ " + tetrahedron +
          " ] } IndexedTriangleStripSet { coordIndex [ 0, 2, 1, 3, 0, 2 ] }"),
       4, 4, sixth},
      {"plainstrip.iv",
       iv("VertexProperty { vertex [ 9 9 9, 0 0 0, 0 1 0, 1 0 0, 0 0 1, 0 0 0, 0 1 0 ] } "
          "TriangleStripSet { startIndex 1 numVertices 6 }"),
       4, 4, sixth},
      {"quads.iv",
       iv("Coordinate3 { point [ 0 0 0, 0 1 0, 1 1 0, 1 0 0, 0 0 0, 0 0 1, 0 1 1, 1 1 1, 1 0 1, 0 0 1 ] } "
          "QuadMesh { verticesPerRow 5 verticesPerColumn 2 } FaceSet { numVertices [ 4 ] } "
          "Translation { translation 0 0 1 } Scale { scaleFactor 1 1 -1 } FaceSet { numVertices 4 }"),
       8, 12, 1},
      {"solids.iv",
       iv("Cube {} Text2 { string \"x\" } Text3 { string \"x\" } LineSet { numVertices 0 } NurbsCurve {}"), 8,
       12, 8},
      {"clockwise.wrl",
       wrl("IndexedFaceSet { ccw FALSE coord Coordinate { point [ " + cube_points + " ] } coordIndex [ " +
           cube_inside_out + " ] }"),
       8, 12, 1},
      {"concave.wrl",
       wrl("Extrusion { crossSection [ 0 0, 0 2, 1 .5, 2 2, 2 0, 0 0 ] spine [ 0 0 0, 0 1 0 ] convex FALSE "
           "}"),
       10, 16, 2.5},
      {"box.wrl", wrl("Box { size 1 2 3 }"), 8, 12, 6},
      {"one.glb", glb(R"({"mesh":0})"), 4, 4, sixth},
      {"mirror.glb", glb(R"({"mesh":0,"scale":[-2,2,2],"translation":[5,0,0]})"), 4, 4, 8 * sixth},
      {"nodes.glb",
       glb(R"({"children":[1,2],"matrix":[0,1,0,0,0,0,1,0,1,0,0,0,0,0,0,1]},{"mesh":0},)"
           R"({"mesh":0,"translation":[3,0,0]})"),
       8, 8, 2 * sixth},
      {"strip.glb", glb(R"({"mesh":0})", 5, {0, 2, 1, 3, 0, 2}), 4, 4, sixth}};
  all.insert(all.end(), imported.begin(), imported.end());
  return all;
}

}  // namespace palpate
