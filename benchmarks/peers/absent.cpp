#include "peers.hpp"

namespace palpate::peers {

#if !PALPATE_PEER_embree
std::unique_ptr<ClosestPoints> make_embree(const TriangleMesh&) { return nullptr; }
#endif
#if !PALPATE_PEER_openvdb
std::unique_ptr<GridSampler> make_openvdb(const Vec3&, double, const std::array<std::int32_t, 3>&,
                                          std::span<const float>) {
  return nullptr;
}
std::unique_ptr<BandFill> make_openvdb_band(const TriangleMesh&, double, float) { return nullptr; }
#endif
#if !PALPATE_PEER_cholmod
std::unique_ptr<Factorisation> make_cholmod(const Eigen::SparseMatrix<double>&) { return nullptr; }
#endif

}  // namespace palpate::peers
