// The same two tetrahedra in every format and layout that is read, as other programs write them.
#include <fmt/format.h>
#include <zlib.h>

#include "tet_test.hpp"

// gcc 12 takes concatenated strings for reads out of bounds when it compiles for the thread sanitizer (PR
// 105329).
#pragma GCC diagnostic ignored "-Warray-bounds"
#pragma GCC diagnostic ignored "-Wstringop-overflow"
#pragma GCC diagnostic ignored "-Wrestrict"

namespace palpate {

namespace {

const char* const nodes_text = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n";

std::string gmsh2_binary(bool swapped) {
  const TetMesh mesh = two_tets();
  Bytes b(swapped);
  b << "$MeshFormat\n2.2 1 8\n";
  b.add<std::int32_t>({1})
      << "\n$EndMeshFormat\n$PhysicalNames\n3\n2 1 \"skin\"\n3 1 \"kidney\"\n3 2 \"stone of 3 mm\"\n"
         "$EndPhysicalNames\n$Nodes\n5\n";
  for (std::size_t i = 0; i < 5; ++i) {
    b.add<std::int32_t>({static_cast<double>(i + 1)});
    b.add<double>({mesh.nodes[i].x(), mesh.nodes[i].y(), mesh.nodes[i].z()});
  }
  b << "\n$EndNodes\n$Elements\n3\n";
  b.add<std::int32_t>({2, 1, 2, 7, 1, 1, 1, 3, 2});  // a triangle
  b.add<std::int32_t>({4, 2, 2, 1, 1, 1, 1, 2, 3, 4, 2, 2, 1, 2, 3, 4, 5});
  b << "\n$EndElements\n";
  return b.bytes;
}

std::string gmsh4_binary(bool swapped) {
  Bytes b(swapped);
  const auto box = [&] { b.add<double>({0, 0, 0, 1, 1, 1}); };
  b << "$MeshFormat\n4.1 1 8\n";
  b.add<std::int32_t>({1}) << "\n$EndMeshFormat\n$PhysicalNames\n2\n3 11 \"kidney\"\n3 12 \"stone of 3 mm\"\n"
                              "$EndPhysicalNames\n$Entities\n";
  b.add<std::int64_t>({1, 0, 1, 2});
  b.add<std::int32_t>({5}).add<double>({0, 0, 0}).add<std::int64_t>({1}).add<std::int32_t>({99});
  b.add<std::int32_t>({6}), box(), b.add<std::int64_t>({0, 1}).add<std::int32_t>({-3});
  b.add<std::int32_t>({1}), box(), b.add<std::int64_t>({1}).add<std::int32_t>({11}).add<std::int64_t>({0});
  b.add<std::int32_t>({2}), box(),
      b.add<std::int64_t>({1}).add<std::int32_t>({-12}).add<std::int64_t>({1}).add<std::int32_t>({6});
  b << "\n$EndEntities\n$Nodes\n";
  b.add<std::int64_t>({2, 5, 1, 50});
  b.add<std::int32_t>({2, 6, 1}).add<std::int64_t>({1, 50}).add<double>({1, 1, 1, 0.5, 0.25});  // parametric
  b.add<std::int32_t>({3, 1, 0}).add<std::int64_t>({4, 1, 2, 3, 4});
  b.add<double>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1});
  b << "\n$EndNodes\n$Elements\n";
  b.add<std::int64_t>({3, 3, 1, 3});
  b.add<std::int32_t>({2, 6, 2}).add<std::int64_t>({1, 1, 1, 3, 2});
  b.add<std::int32_t>({3, 1, 4}).add<std::int64_t>({1, 2, 1, 2, 3, 4});
  b.add<std::int32_t>({3, 2, 4}).add<std::int64_t>({1, 3, 2, 3, 4, 50});
  b << "\n$EndElements\n";
  return b.bytes;
}

template <class Integer, class Real>
std::string medit_binary(int version, bool swapped) {
  Bytes b(swapped);
  std::vector<std::pair<int, std::string>> sections;
  Bytes vertices(swapped), tets(swapped), triangles(swapped);
  vertices.add<Integer>({5});
  for (const Vec3& p : two_tets().nodes) vertices.add<Real>({p.x(), p.y(), p.z()}).template add<Integer>({0});
  tets.add<Integer>({2, 1, 2, 3, 4, 3, 2, 3, 4, 5, 9});
  triangles.add<Integer>({1, 1, 3, 2, 5});
  sections = {{4, vertices.bytes}, {6, triangles.bytes}, {8, tets.bytes}};
  b.add<std::int32_t>({1, static_cast<double>(version)});
  const auto position = [&](std::size_t to) {
    version < 3 ? b.add<std::int32_t>({static_cast<double>(to)})
                : b.add<std::int64_t>({static_cast<double>(to)});
  };
  const std::size_t width = version < 3 ? 4 : 8;
  b.add<std::int32_t>({3}), position(b.bytes.size() + width + 4), b.add<std::int32_t>({3});
  for (const auto& [code, data] : sections) {
    b.add<std::int32_t>({static_cast<double>(code)});
    position(b.bytes.size() + width + data.size());
    b << data;
  }
  b.add<std::int32_t>({54}), position(0);
  return b.bytes;
}

std::string vtk_binary(bool newer) {
  Bytes b(true);
  b << fmt::format("# vtk DataFile Version {}\nsomething\nBINARY\nDATASET UNSTRUCTURED_GRID\n",
                   newer ? "5.1" : "4.2");
  b << "FIELD FieldData 2\nTimeValue 1 1 double\n";
  b.add<double>({0.5})
      << "\nMETADATA\nINFORMATION 0\n\nregion_names 1 2 string\n\xc6kidney\xcdstone of 3 mm\n";
  b << "POINTS 5 float\n";
  b.nodes<float>(two_tets()) << "\n";
  if (newer) {
    b << "CELLS 4 11\nOFFSETS vtktypeint64\n";
    b.add<std::int64_t>({0, 4, 7, 11}) << "\nCONNECTIVITY vtktypeint64\n";
    b.add<std::int64_t>({0, 1, 2, 3, 0, 2, 1, 1, 2, 3, 4}) << "\n";
  } else {
    b << "CELLS 3 14\n";
    b.add<std::int32_t>({4, 0, 1, 2, 3, 3, 0, 2, 1, 4, 1, 2, 3, 4}) << "\n";
  }
  b << "CELL_TYPES 3\n";
  b.add<std::int32_t>({10, 5, 10}) << "\nPOINT_DATA 5\nVECTORS u float\n";
  b.nodes<float>(two_tets()) << "\nCELL_DATA 3\nSCALARS other unsigned_char 1\nLOOKUP_TABLE default\n";
  b << "abc\nFIELD FieldData 1\nregion 1 3 short\n";
  b.add<std::int16_t>({0, 0, 1}) << "\nMETADATA\nINFORMATION 0\n\n";
  return b.bytes;
}

std::string base64(const std::string& bytes) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : digits[bits >> (18 - 6 * k) & 63];
  }
  return out;
}

struct VtuLayout {
  bool swapped, wide, compressed, appended, raw, header_apart;
};

std::string vtu(const VtuLayout& layout) {
  std::string appended, xml;
  const auto numbers = [&](std::initializer_list<double> values) {
    Bytes b(layout.swapped);
    layout.wide ? b.add<std::uint64_t>(values) : b.add<std::uint32_t>(values);
    return b.bytes;
  };
  const auto array = [&](const std::string& attributes, const std::string& bytes) {
    std::string header = numbers({static_cast<double>(bytes.size())}), body = bytes;
    if (layout.compressed) {  // two blocks of which the last is shorter
      const std::size_t block = bytes.size() * 2 / 3, rest = bytes.size() - block;
      std::vector<std::string> packed;
      for (const std::string& part : {bytes.substr(0, block), bytes.substr(block)}) {
        uLongf size = compressBound(part.size());
        packed.emplace_back(size, '\0');
        compress(reinterpret_cast<Bytef*>(packed.back().data()), &size,
                 reinterpret_cast<const Bytef*>(part.data()), part.size());
        packed.back().resize(size);
      }
      header = numbers({2, static_cast<double>(block), static_cast<double>(rest),
                        static_cast<double>(packed[0].size()), static_cast<double>(packed[1].size())});
      body = packed[0] + packed[1];
    }
    const bool apart = layout.compressed || layout.header_apart;
    const std::string text = layout.raw ? header + body
                             : apart    ? base64(header) + base64(body)
                                        : base64(header + body);
    xml += "<DataArray " + attributes;
    if (layout.appended) {
      xml += fmt::format(" format=\"appended\" offset=\"{}\"/>\n", appended.size());
      appended += text;
    } else {
      xml += " format=\"binary\">\n  " + text + "\n</DataArray>\n";
    }
  };
  Bytes points(layout.swapped), connectivity(layout.swapped), offsets(layout.swapped), types(layout.swapped),
      regions(layout.swapped);
  points.nodes<double>(two_tets());
  connectivity.add<std::int64_t>({0, 1, 2, 3, 0, 2, 1, 1, 2, 3, 4});
  offsets.add<std::int64_t>({4, 7, 11}), types.add<std::uint8_t>({10, 5, 10}),
      regions.add<std::int32_t>({0, 0, 1});
  xml = fmt::format(
      "<?xml version=\"1.0\"?>\n<!-- a comment --><VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
      "byte_order=\"{}\"{}{}>\n"
      "<UnstructuredGrid>\n<FieldData>\n<DataArray type=\"String\" Name=\"region_names\" "
      "NumberOfTuples=\"2\" "
      "format=\"ascii\">107 105 100 110 101 121 0 115 116 111 110 101 32 111 102 32 51 32 109 109 "
      "0</DataArray>"
      "</FieldData>\n<Piece NumberOfPoints=\"5\" NumberOfCells=\"3\">\n<CellData>\n",
      layout.swapped ? "BigEndian" : "LittleEndian", layout.wide ? " header_type=\"UInt64\"" : "",
      layout.compressed ? " compressor=\"vtkZLibDataCompressor\"" : "");
  array("type=\"Int32\" Name=\"region\"", regions.bytes);
  xml += "</CellData><Points>\n";
  array("type=\"Float64\" Name=\"p\" NumberOfComponents=\"3\"", points.bytes);
  xml += "</Points><Cells>\n";
  array("type=\"Int64\" Name=\"connectivity\"", connectivity.bytes);
  array("type=\"Int64\" Name=\"offsets\"", offsets.bytes);
  array("type=\"UInt8\" Name=\"types\"", types.bytes);
  xml += "</Cells></Piece></UnstructuredGrid>\n";
  if (layout.appended)
    xml += fmt::format("<AppendedData encoding=\"{}\">\n   _{}\n</AppendedData>\n",
                       layout.raw ? "raw" : "base64", appended);
  return xml + "</VTKFile>\n";
}

}  // namespace

std::vector<Sample> samples() {
  const std::string names =
      "$PhysicalNames\n3\n2 1 \"skin\"\n3 1 \"kidney\"\n3 2 \"stone of 3 mm\"\n$EndPhysicalNames\n";
  std::string numbered = "1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n50 1 1 1\n";
  std::vector<Sample> list{
      {"gmsh1.msh",
       "$NOD\n5\n" + numbered +
           "$ENDNOD\n$ELM\n3\n1 2 9 9 3 1 3 2\n2 4 1 1 4 1 2 3 4\n3 4 2 2 4 2 3 4 50\n$ENDELM\n"},
      {"gmsh2.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" + names + "$Nodes\n5\n" + numbered +
                        "$EndNodes\n$Elements\n3\n1 2 2 7 1 1 3 2\n2 4 2 1 5 1 2 3 4\n3 4 3 2 5 0 2 3 4 "
                        "50\n$EndElements\n"},
      {"gmsh2_binary.msh", gmsh2_binary(false)},
      {"gmsh2_swapped.msh", gmsh2_binary(true)},
      {"gmsh4.msh",
       "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + names +
           "$Entities\n1 0 1 2\n5 0 0 0 1 99\n6 0 0 0 1 1 1 0 1 -3\n1 0 0 0 1 1 1 1 1 0\n2 0 0 0 1 1 1 1 2 1 "
           "6\n$EndEntities\n"
           "$Nodes\n2 5 1 50\n2 6 1 1\n50\n1 1 1 0.5 0.25\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 "
           "1\n$EndNodes\n"
           "$Elements\n3 3 1 3\n2 6 2 1\n1 1 3 2\n3 1 4 1\n2 1 2 3 4\n3 2 4 1\n3 2 3 4 50\n$EndElements\n"
           "$NodeData\nwhatever\n$EndNodeData\n"},
      {"gmsh4_binary.msh", gmsh4_binary(false)},
      {"gmsh4_swapped.msh", gmsh4_binary(true)},
      {"medit.mesh",
       "# a comment\nMeshVersionFormatted 2\nDimension\n3\nVertices\n5\n0 0 0 1\n+1 0 0 1\n0 1.0D+0 0 1 # "
       "here too\n0 0 1 1\n"
       "1 1 1 1\nTriangles 1\n1 3 2 4\nTetrahedra\n2\n1 2 3 4 3\n2 3 4 5 9\nRidges\n1\n1\nEnd\n"},
      {"medit1.meshb", medit_binary<std::int32_t, float>(1, false)},
      {"medit2.meshb", medit_binary<std::int32_t, double>(2, true)},
      {"medit3.meshb", medit_binary<std::int32_t, double>(3, false)},
      {"medit4.meshb", medit_binary<std::int64_t, double>(4, false)},
      {"text.vtk",
       std::string("# vtk DataFile Version 2.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n") +
           nodes_text +
           "CELLS 3 14\n4 0 1 2 3\n3 0 2 1\n4 1 2 3 4\n\nCELL_TYPES 3\n10\n5\n10\nCELL_DATA 3\nSCALARS "
           "region int 1\n"
           "LOOKUP_TABLE default\n0 0 1\nPOINT_DATA 5\nSCALARS t float\nLOOKUP_TABLE default\n1 nan 3 4 "
           "5\nFIELD more 2\n"
           "n%20m 2 5 float\n1 2 3 4 5 6 7 8 9 10\nwho 1 2 string\na%20b\nc\n"},
      {"text5.vtk",
       std::string("# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData "
                   "1\nregion_names 1 2 "
                   "string\nkidney\nstone%20of%203%20mm\nPOINTS 5 double\n") +
           nodes_text +
           "CELLS 4 11\nOFFSETS vtktypeint64\n0 4 7 11\nCONNECTIVITY vtktypeint64\n0 1 2 3 0 2 1 1 2 3 4\n"
           "CELL_TYPES 3\n10\n5\n10\nCELL_DATA 3\nSCALARS region int\nLOOKUP_TABLE default\n0 0 "
           "1\nMETADATA\nINFORMATION 0\n\n"},
      {"binary.vtk", vtk_binary(false)},
      {"binary5.vtk", vtk_binary(true)},
      {"text.vtu", std::string("<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" "
                               "byte_order=\"BigEndian\">\n<UnstructuredGrid>\n"
                               "<Piece NumberOfPoints=\"5\" NumberOfCells=\"3\">\n<Points>\n"
                               "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">\n") +
                       nodes_text +
                       "</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\" "
                       "format=\"ascii\">0 1 2 3 0 2 1 1 2 3 4"
                       "</DataArray><DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">4 7 "
                       "11</DataArray>\n<DataArray "
                       "type=\"UInt8\" Name=\"types\" format=\"ascii\">10 5 "
                       "10</DataArray></Cells><CellData><DataArray type=\"Float32\" "
                       "Name=\"region\" format=\"ascii\">0 0 "
                       "1</DataArray></CellData></Piece></UnstructuredGrid>\n</VTKFile>\n"}};
  for (const VtuLayout& layout :
       {VtuLayout{false, false, false, false, false, false},
        VtuLayout{true, true, false, false, false, false}, VtuLayout{false, false, false, false, false, true},
        VtuLayout{false, true, true, false, false, false}, VtuLayout{true, false, true, true, false, false},
        VtuLayout{false, true, false, true, false, false}, VtuLayout{false, false, false, true, true, false},
        VtuLayout{true, true, true, true, true, false}})
    list.push_back({fmt::format("layout{}.vtu", list.size()), vtu(layout)});
  return list;
}

}  // namespace palpate
