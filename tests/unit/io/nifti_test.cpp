#include "palpate/io/nifti.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <set>

#include "palpate/io/atomic_file.hpp"
#include "surface_samples.hpp"
#include "tet_test.hpp"

namespace palpate {
namespace {

std::string gzip(const std::string& bytes) {
  z_stream z{};
  deflateInit2(&z, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&z, bytes.size()) + 64, '\0');
  z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data())),
  z.avail_in = static_cast<uInt>(bytes.size());
  z.next_out = reinterpret_cast<Bytef*>(out.data()), z.avail_out = static_cast<uInt>(out.size());
  deflate(&z, Z_FINISH);
  out.resize(z.total_out);
  deflateEnd(&z);
  return out;
}

LabelVolume read(const std::string& bytes) {
  const TempFolder folder;
  folder.write("a.nii", bytes);
  return read_labels(folder / "a.nii");
}

std::string trouble(const std::string& bytes) {
  try {
    read(bytes);
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::format) << e.what();
    return e.what();
  }
  return "";
}
bool has(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }
#define EXPECT_HAS(text, part) EXPECT_PRED2(has, text, part)

std::string with(std::string bytes, std::size_t at, const std::string& put) {
  std::copy(put.begin(), put.end(), bytes.data() + at);
  return bytes;
}
template <class T>
std::string numbers(std::initializer_list<double> values) {
  return Bytes().add<T>(values).bytes;
}

void expect_counting(const LabelVolume& v) {
  EXPECT_EQ(v.size, (std::array<std::size_t, 3>{2, 3, 4}));
  ASSERT_EQ(v.labels.size(), 24u);
  for (int i = 0; i < 24; ++i) EXPECT_EQ(v.labels[static_cast<std::size_t>(i)], i);
}

Vec3 place(const LabelVolume& v, double i, double j, double k) {
  return v.to_world * Eigen::Vector4d(i, j, k, 1);
}

TEST(Nifti, EveryTypeAndByteOrder) {
  for (const bool swapped : {false, true})
    for (const int type : {2, 4, 8, 16, 64, 256, 512, 768, 1024, 1280}) {
      SCOPED_TRACE(type);
      const LabelVolume v = read(nifti1(swapped, type));
      expect_counting(v);
      EXPECT_NEAR((place(v, 1, 1, 1) - Vec3(0.002, 0.003, 0.004)).norm(), 0, 1e-15);
    }
  for (const int type : {0, 1, 32, 128, 1536, 1792, 2304}) EXPECT_HAS(trouble(nifti1(false, type)), "type");
}

TEST(Nifti, Version2) {
  std::string h(544, '\0');
  h = with(h, 0,
           numbers<std::int32_t>({540}) + std::string("n+2\0\r\n\032\n", 8) + numbers<std::int16_t>({4, 16}) +
               numbers<std::int64_t>({4, 2, 3, 4, 1, 1, 1, 1}));
  h = with(h, 104, numbers<double>({1, 2, 3, 4}));
  h = with(h, 168, numbers<std::int64_t>({560}));
  h = with(h, 348, numbers<std::int32_t>({1}));
  h = with(h, 400, numbers<double>({0, 0, 5, 100, 6, 0, 0, 200, 0, 7, 0, 300}));
  h = with(h, 500, numbers<std::int32_t>({3}));
  std::string body(16, 'x');  // an extension
  for (int i = 0; i < 24; ++i) body += numbers<std::int16_t>({double(i)});
  const LabelVolume v = read(gzip(h + body));
  expect_counting(v);
  EXPECT_NEAR((place(v, 1, 2, 3) - 1e-6 * Vec3(115, 206, 314)).norm(), 0, 1e-15);  // micrometres
  EXPECT_HAS(trouble(with(h, 8, "\n\n\032\n") + body), "NIfTI-2");
}

TEST(Nifti, GzipInOneOrSeveralMembers) {
  const std::string plain = nifti1(true, 4), packed = gzip(plain);
  expect_counting(read(packed));
  expect_counting(read(gzip(plain.substr(0, 100)) + gzip(plain.substr(100, 260)) + gzip(plain.substr(360))));
  EXPECT_HAS(trouble(packed.substr(0, packed.size() - 12)), "truncated");
  EXPECT_HAS(trouble(packed.substr(0, packed.size() - 1)), "truncated");
  std::string wrong = packed;
  wrong[wrong.size() - 6] ^= 1;  // the checksum
  EXPECT_HAS(trouble(wrong), "damaged");
}

TEST(Nifti, Orientation) {
  std::string q = with(nifti1(), 252, numbers<std::int16_t>({1, 0}));
  q = with(q, 256, numbers<float>({0, 0, std::sqrt(0.5), 10, 20, 30}));  // a quarter turn about z
  EXPECT_NEAR((place(read(q), 1, 1, 1) - 1e-3 * Vec3(10 - 3, 20 + 2, 30 + 4)).norm(), 0, 1e-9);
  q = with(q, 76, numbers<float>({-1}));  // the third axis reversed
  EXPECT_NEAR((place(read(q), 1, 1, 1) - 1e-3 * Vec3(10 - 3, 20 + 2, 30 - 4)).norm(), 0, 1e-9);
  q = with(q, 256, numbers<float>({0, 1, 0}));  // a half turn about y, without a square root to take
  EXPECT_NEAR((place(read(q), 1, 1, 1) - 1e-3 * Vec3(10 - 2, 20 + 3, 30 + 4)).norm(), 0, 1e-9);
  std::string s = with(q, 254, numbers<std::int16_t>({2}));  // the sform comes first
  s = with(s, 280, numbers<float>({0, 2, 0, 1, 3, 0, 0, 2, 0, 0, -4, 3}));
  EXPECT_NEAR((place(read(s), 1, 1, 1) - 1e-3 * Vec3(3, 5, -1)).norm(), 0, 1e-9);
  EXPECT_HAS(trouble(with(s, 280, numbers<float>({0, 0, 0, 0}))), "sform");
  EXPECT_HAS(trouble(with(q, 256, numbers<float>({NAN}))), "qform");
  EXPECT_HAS(trouble(with(nifti1(), 80, numbers<float>({0}))), "pixdim");
  LabelVolume v = read(with(nifti1(), 123, std::string("\x01", 1)));
  EXPECT_NEAR((place(v, 1, 1, 1) - Vec3(2, 3, 4)).norm(), 0, 1e-12);  // metres
  v = read(with(nifti1(), 123, std::string("\0", 1)));
  EXPECT_NEAR((place(v, 1, 1, 1) - 1e-3 * Vec3(2, 3, 4)).norm(), 0, 1e-12);  // not stated
}

TEST(Nifti, ScaledAndRealVolumes) {
  EXPECT_EQ(read(with(nifti1(), 112, numbers<float>({2, 1}))).labels[5], 11);
  EXPECT_EQ(read(with(nifti1(), 112, numbers<float>({NAN, 1}))).labels[5], 5);
  EXPECT_HAS(trouble(with(nifti1(), 112, numbers<float>({0.5, 0}))), "voxel (1, 0, 0) is 0.5");
  EXPECT_HAS(trouble(with(nifti1(false, 16), 352 + 4 * 7, numbers<float>({NAN}))), "voxel (1, 0, 1) is nan");
  EXPECT_HAS(trouble(with(nifti1(false, 64), 352, numbers<double>({-1e10}))), "too big");
  EXPECT_HAS(trouble(with(nifti1(false, 1280), 352, numbers<std::uint64_t>({1.8e19}))), "too big");
}

TEST(Nifti, HeadersThatCannotBe) {
  const std::string good = nifti1();
  EXPECT_HAS(trouble(good.substr(0, 300)), "too short");
  EXPECT_HAS(trouble(good.substr(0, good.size() - 1)), "truncated");
  EXPECT_HAS(trouble(with(good, 344, "ni1")), "second file");
  EXPECT_HAS(trouble(with(good, 344, "xxx")), "ANALYZE");
  EXPECT_HAS(trouble(with(good, 0, "xxxx")), "no NIfTI");
  EXPECT_HAS(trouble(with(good, 40, numbers<std::int16_t>({4, 2, 3, 2, 2}))), "2 volumes");
  EXPECT_HAS(trouble(with(good, 40, numbers<std::int16_t>({8}))), "8 dimensions");
  EXPECT_HAS(trouble(with(good, 42, numbers<std::int16_t>({-1}))), "-1 voxels long");
  EXPECT_HAS(trouble(with(good, 42, numbers<std::int16_t>({32767, 32767, 32767}))), "truncated");
  EXPECT_HAS(trouble(with(good, 108, numbers<float>({1e9}))), "truncated");
  EXPECT_HAS(trouble(with(good, 108, numbers<float>({NAN}))), "byte nan");
  // A small file that says it is big: refused by its size, or read no further than it goes.
  const std::string bomb = with(good, 42, numbers<std::int16_t>({2000, 2000, 200}));
  EXPECT_HAS(trouble(gzip(bomb + std::string(1 << 20, '\0'))), "truncated");
}

TEST(Nifti, KeptVolumes) {
  if (kept_data("volumes").empty()) GTEST_SKIP() << "the kept data are not there (PALPATE_DATA)";
  const LabelVolume kidney = read_labels(kept_data("derived/VH_M_Kidney_L_labels.nii.gz"));
  EXPECT_EQ(kidney.size, (std::array<std::size_t, 3>{92, 123, 99}));
  EXPECT_EQ(std::count(kidney.labels.begin(), kidney.labels.end(), 2), 25113);
  const LabelVolume body = read_labels(kept_data("volumes/example_seg.nii.gz"));
  EXPECT_NEAR((place(body, 0, 0, 0) - Vec3(-0.178, 0.01132, 0.0943)).norm(), 0, 1e-4);
  EXPECT_EQ(std::set<int>(body.labels.begin(), body.labels.end()).size(), 42u);
  EXPECT_HAS(trouble(read_file(kept_data("volumes/example_nifti2.nii.gz"))), "2 volumes");
  // Its sform and its qform say the same.
  const std::string bytes = read_file(kept_data("volumes/anatomical.nii"));
  const LabelVolume s = read(bytes), q = read(with(bytes, 254, std::string(2, '\0')));
  EXPECT_NEAR((s.to_world - q.to_world).norm(), 0, 1e-7);
  EXPECT_NEAR((place(s, 0, 0, 0) - Vec3(0.032, -0.04, -0.016)).norm(), 0, 1e-6);
}

}  // namespace
}  // namespace palpate
