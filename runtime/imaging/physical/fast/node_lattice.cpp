// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/fast/node_lattice.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/model/gas_faces.h"
#include "runtime/imaging/physical/model/wall_sheets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "node_lattice.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// These come after Highway's: they are included again for each instruction set.
#include "runtime/imaging/physical/fast/beam_place-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
using namespace physical;

template <class D>
struct NodePlace {
    hn::Vec<D> x, y, z;
};

template <class D>
HWY_INLINE hn::Vec<hn::RebindToSigned<D>> kind_at(D d, const FaceSearch& s, const NodePlace<D>& p) {
    return hn::GatherIndex(hn::RebindToSigned<D>(), s.kinds,
                           nearest_label(d, *s.block, p.x, p.y, p.z));
}

// Follows a vector of nodes' beams, from v on, down to the first two nodes of gas.
template <class D>
HWY_INLINE void search_vector(D d, FaceSearch& s, int v) {
    const hn::RebindToSigned<D> di;
    const NodeLattice& n = *s.nodes;
    const auto place = [&](int row) HWY_ATTR {
        const std::size_t at = n.at(row, s.first + v);
        return NodePlace<D>{hn::LoadU(d, n.x.data() + at), hn::LoadU(d, n.y.data() + at),
                            hn::LoadU(d, n.z.data() + at)};
    };
    const auto zero = hn::Zero(di);
    auto done = hn::RebindMask(di, hn::Lt(hn::LoadU(d, n.gap.data() + s.first + v), hn::Zero(d)));
    auto above = zero, organ = zero, found = zero, dome = zero;
    for (int row = 1; n.spacing.r_mm(row) < static_cast<double>(s.depth_mm); ++row) {
        const auto kind = kind_at(d, s, place(row));
        // Two nodes of gas in a row: the face lies before the first.
        const auto both = hn::TestBit(hn::And(above, kind), hn::Set(di, kNodeGas));
        const auto face = hn::AndNot(done, both);
        const auto deep = hn::Set(di, n.spacing.r_mm(row - 1) > kDomeFromMm ? kNodeLung : 0);
        found = hn::IfThenElse(face, hn::Set(di, row - 1), found);
        dome = hn::IfThenElse(face, hn::And(hn::And(above, deep), hn::ShiftLeft<1>(organ)), dome);
        done = hn::Or(done, hn::Or(face, hn::TestBit(kind, hn::Set(di, kNodeBone))));
        if (hn::AllTrue(di, done)) break;
        organ = hn::Or(organ, hn::And(kind, hn::Set(di, kNodeOrgan)));
        above = kind;
    }
    hn::StoreU(found, di, s.row + v);
    hn::StoreU(dome, di, s.dome + v);
    hn::StoreU(hn::Set(d, kNoFace), d, s.depth + v);
    const auto any = hn::Gt(found, zero);
    if (hn::AllFalse(di, any)) return;

    // Halve the stretch between the last node before the face and the first behind it.
    const auto index =
        hn::Add(hn::Mul(hn::Max(hn::Sub(found, hn::Set(di, 1)), zero), hn::Set(di, n.stride)),
                hn::Iota(di, s.first + v));
    const auto from = [&](const std::vector<float>& of, int next)
                          HWY_ATTR { return hn::GatherIndex(d, of.data() + next, index); };
    const NodePlace<D> a{from(n.x, 0), from(n.y, 0), from(n.z, 0)};
    const NodePlace<D> way{hn::Sub(from(n.x, n.stride), a.x), hn::Sub(from(n.y, n.stride), a.y),
                           hn::Sub(from(n.z, n.stride), a.z)};
    auto part = hn::Set(d, 0.5f);
    float half = 0.25f;
    for (int halving = 0; halving < kFaceHalvings; ++halving, half *= 0.5f) {
        const auto kind =
            kind_at(d, s,
                    {hn::Add(a.x, hn::Mul(way.x, part)), hn::Add(a.y, hn::Mul(way.y, part)),
                     hn::Add(a.z, hn::Mul(way.z, part))});
        const auto gas = hn::RebindMask(d, hn::TestBit(kind, hn::Set(di, kNodeGas)));
        part = hn::Add(part, hn::IfThenElse(gas, hn::Set(d, -half), hn::Set(d, half)));
    }
    const auto step = static_cast<float>(n.spacing.samples * n.spacing.step_mm);
    const auto before = hn::ConvertTo(d, hn::Sub(found, hn::Set(di, 1)));
    const auto depth = hn::Add(hn::Mul(hn::Add(before, part), hn::Set(d, step)),
                               hn::Set(d, static_cast<float>(0.5 * n.spacing.step_mm)));
    hn::StoreU(hn::IfThenElse(hn::RebindMask(d, any), depth, hn::Set(d, kNoFace)), d, s.depth + v);
}

void find_block(FaceSearch& s) {
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int v = 0; v < kBeamBlock; v += lanes) search_vector(d, s, v);
}

// The four numbers of a cell side by side, so that compilers use vectors of four. Eight cells are
// blended: distances linearly, noises by smooth steps.
struct Layers {
    float of[4];
};

HWY_INLINE Layers blended(const Layers& a, const Layers& b, float linear) {
    const float smooth = linear * linear * (3 - 2 * linear);
    const float part[4] = {linear, linear, smooth, smooth};
    Layers out;
    for (int n = 0; n < 4; ++n) out.of[n] = a.of[n] + (b.of[n] - a.of[n]) * part[n];
    return out;
}

HWY_INLINE Layers layers_at(const TissueLayers& t, float x, float y, float z) {
    const auto per_voxel = static_cast<float>(t.cells_per_voxel());
    const auto place = [&](float v, int size, int& first) {
        const float cell =
            std::clamp((v + 0.5f) * per_voxel - 0.5f, 0.0f, static_cast<float>(size - 1));
        first = std::min(static_cast<int>(cell), std::max(size - 2, 0));
        return cell - static_cast<float>(first);
    };
    const Int3 size = t.size();
    int i = 0, j = 0, k = 0;
    const float px = place(x, size.x, i), py = place(y, size.y, j), pz = place(z, size.z, k);
    const std::ptrdiff_t sx = size.x > 1 ? 4 : 0, sy = size.y > 1 ? 4 * size.x : 0,
                         sz = size.z > 1 ? static_cast<std::ptrdiff_t>(4) * size.x * size.y : 0;
    const std::int16_t* p =
        t.cells() + 4 * ((static_cast<std::ptrdiff_t>(k) * size.y + j) * size.x + i);
    const auto cell = [&](std::ptrdiff_t at) {
        Layers out;
        for (int n = 0; n < 4; ++n) out.of[n] = static_cast<float>(p[at + n]);
        return out;
    };
    const auto row = [&](std::ptrdiff_t at) { return blended(cell(at), cell(at + sx), px); };
    return blended(blended(row(0), row(sy), py), blended(row(sz), row(sz + sy), py), pz);
}

void layers_of_block(const LayerSearch& s) {
    const NodeLattice& n = *s.nodes;
    constexpr auto kMm = static_cast<float>(TissueLayers::kDistanceUnit),
                   kNoise = static_cast<float>(TissueLayers::kNoiseUnit);
    const int end = std::min(s.first + kBeamBlock, n.nodes);
    for (int row = 0; row < s.rows; ++row) {
        for (int node = s.first; node < end; ++node) {
            const std::size_t at = n.at(row, node);
            const auto [p] = layers_at(*s.layers, n.x[at], n.y[at], n.z[at]);
            const float wave = s.wave_mm * (p[2] * (1 / kNoise));
            s.depth[at] = p[0] * (1 / kMm) + wave;
            s.above[at] = p[1] * (1 / kMm) + wave + s.own_wave_mm * (p[3] * (1 / kNoise));
            s.course[at] = p[3] * (1 / kNoise);
        }
    }
}

void noise_of_block(const NoiseSearch& s) {
    const NodeLattice& n = *s.nodes;
    constexpr auto kNoise = static_cast<float>(TissueLayers::kNoiseUnit);
    const int end = std::min(s.first + kBeamBlock, n.nodes);
    for (int row = 0; row < s.rows; ++row) {
        // Nodes lie at the middles of their samples.
        const float at_row =
            (static_cast<float>(row * s.samples) + 0.5f * static_cast<float>(s.samples - 1)) /
            static_cast<float>(n.spacing.samples);
        const int above = std::min(static_cast<int>(at_row), n.rows - 2);
        const float part = at_row - static_cast<float>(above);
        for (int node = s.first; node < end; ++node) {
            const std::size_t at = n.at(above, node), below = n.at(above + 1, node);
            const auto between = [&](const std::vector<float>& of) {
                return of[at] + (of[below] - of[at]) * part;
            };
            const auto [p] = layers_at(*s.layers, between(n.x), between(n.y), between(n.z));
            s.noise[n.at(row, node)] = p[3] * (1 / kNoise);
        }
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(find_block);
HWY_EXPORT(layers_of_block);
HWY_EXPORT(noise_of_block);

void search_faces(SimdTarget simd, FaceSearch& search) {
    HWY_DISPATCH_TABLE(find_block)[simd.index](search);
}
void search_layers(SimdTarget simd, const LayerSearch& search) {
    HWY_DISPATCH_TABLE(layers_of_block)[simd.index](search);
}
void search_noise(SimdTarget simd, const NoiseSearch& search) {
    HWY_DISPATCH_TABLE(noise_of_block)[simd.index](search);
}

void NodeLattice::create(const ScanGeometry& g, const physical::Tables& tables) {
    spacing = physical::node_spacing(g, tables);
    nodes = spacing.nodes();
    stride = (nodes + kBeamBlock - 1) / kBeamBlock * kBeamBlock;
    rows = g.samples / spacing.samples + 2;
    for (int row = 0; row < rows; ++row)
        contact.push_back(static_cast<float>(std::exp(-spacing.r_mm(row) / physical::kGapReachMm)));
    for (auto& axis : origin) axis.assign(stride, 0.0f);
    for (auto& axis : per_mm) axis.assign(stride, 0.0f);
    gap.assign(stride, -1.0f);  // nodes that only fill up a block count as air
    for (auto* axis : {&x, &y, &z}) axis->assign(at(rows, 0) + kRowSlack, 0.0f);
}

}  // namespace sonocase::runtime
#endif
