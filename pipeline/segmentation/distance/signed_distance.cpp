// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/signed_distance.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>

#include "pipeline/segmentation/distance/widest.h"

namespace sonocase::pipeline::inline segmentation_distance {
namespace {

// Squared distance along x to the nearest marked voxel of the row, at most limit_sq.
void row_distances(
    const std::uint8_t* marked, int count, float spacing, float limit_sq, float* out) {
    float run = 1e9f;
    for (int i = 0; i < count; ++i) {
        run = marked[i] ? 0.0f : run + spacing;
        out[i] = run;
    }
    run = 1e9f;
    for (int i = count - 1; i >= 0; --i) {
        run = marked[i] ? 0.0f : run + spacing;
        const float d = std::min(out[i], run);
        out[i] = std::min(d * d, limit_sq);
    }
}

// What a row of squared distances holds: nothing but zeros, nothing nearer than the limit, or both
// and more.
enum class RowKind : std::uint8_t { zeros, limits, mixed };

// One more axis: out[l] = min over lines m of (in[m] + (l - m)^2 spacing^2), lines of `width`
// values. Few lines are within the limit, and the plain minimum is then faster than an envelope of
// parabolas.
SONOCASE_WIDEST void line_distances(const float* in,
                                    std::size_t width,
                                    int lines,
                                    std::size_t stride,
                                    float spacing,
                                    float limit_sq,
                                    RowKind* kinds,
                                    std::size_t kinds_pitch,
                                    float* out) {
    typedef float Eight __attribute__((vector_size(32)));
    constexpr std::size_t kBatch = 32;  // values that stay in registers over all lines
    const int reach = static_cast<int>(std::sqrt(limit_sq) / spacing);
    std::vector<RowKind> before(lines);
    for (std::size_t l = 0; l < before.size(); ++l) before[l] = kinds[l * kinds_pitch];
    std::vector<int> near;  // lines that can lower a distance
    for (int l = 0; l < lines; ++l) {
        float* to = out + static_cast<std::size_t>(l) * stride;
        const float* own = in + static_cast<std::size_t>(l) * stride;
        near.clear();
        for (int m = std::max(0, l - reach); m <= std::min(lines - 1, l + reach); ++m) {
            if (before[m] != RowKind::limits) near.push_back(m);
        }
        RowKind& kind = kinds[static_cast<std::size_t>(l) * kinds_pitch];
        if (kind == RowKind::zeros || near.empty()) {
            std::copy(own, own + width, to);
            continue;
        }
        kind = RowKind::mixed;
        std::size_t i = 0;
        for (; i + kBatch <= width; i += kBatch) {
            Eight a, b, c, d, v;
            __builtin_memcpy(&a, own + i, sizeof a);
            __builtin_memcpy(&b, own + i + 8, sizeof b);
            __builtin_memcpy(&c, own + i + 16, sizeof c);
            __builtin_memcpy(&d, own + i + 24, sizeof d);
            for (const int m : near) {
                const float* from = in + static_cast<std::size_t>(m) * stride + i;
                const float along = static_cast<float>(l - m) * spacing;
                const float add = along * along;
                __builtin_memcpy(&v, from, sizeof v);
                v += add;
                a = v < a ? v : a;
                __builtin_memcpy(&v, from + 8, sizeof v);
                v += add;
                b = v < b ? v : b;
                __builtin_memcpy(&v, from + 16, sizeof v);
                v += add;
                c = v < c ? v : c;
                __builtin_memcpy(&v, from + 24, sizeof v);
                v += add;
                d = v < d ? v : d;
            }
            __builtin_memcpy(to + i, &a, sizeof a);
            __builtin_memcpy(to + i + 8, &b, sizeof b);
            __builtin_memcpy(to + i + 16, &c, sizeof c);
            __builtin_memcpy(to + i + 24, &d, sizeof d);
        }
        for (; i < width; ++i) {
            float lowest = own[i];
            for (const int m : near) {
                const float along = static_cast<float>(l - m) * spacing;
                const float d = in[static_cast<std::size_t>(m) * stride + i] + along * along;
                lowest = d < lowest ? d : lowest;
            }
            to[i] = lowest;
        }
    }
}

}  // namespace

std::vector<VoxelBox> label_boxes(const LabelVolume& volume) {
    const Int3 n = volume.grid.size;
    std::vector<Int3> low(volume.labels.size(), n), high(volume.labels.size(), {-1, -1, -1});
    for (int k = 0; k < n.z; ++k) {
        for (int j = 0; j < n.y; ++j) {
            const std::uint8_t* row = volume.voxels.data() + volume.grid.index(0, j, k);
            for (int i = 0; i < n.x;) {  // a run of one label at a time
                int end = i + 1;
                while (end < n.x && row[end] == row[i]) ++end;
                Int3& a = low[row[i]];
                Int3& b = high[row[i]];
                a = {std::min(a.x, i), std::min(a.y, j), std::min(a.z, k)};
                b = {std::max(b.x, end - 1), std::max(b.y, j), std::max(b.z, k)};
                i = end;
            }
        }
    }
    std::vector<VoxelBox> boxes(volume.labels.size());
    for (std::size_t l = 0; l < boxes.size(); ++l) {
        if (high[l].x < 0) continue;
        boxes[l] = {low[l],
                    {high[l].x - low[l].x + 1, high[l].y - low[l].y + 1, high[l].z - low[l].z + 1}};
    }
    return boxes;
}

VoxelBox grow(const VoxelBox& box, Int3 voxels, Int3 size) {
    VoxelBox out;
    for (int a = 0; a < 3; ++a) {
        out.first[a] = std::max(0, box.first[a] - voxels[a]);
        const int end = std::min(size[a], box.first[a] + box.size[a] + voxels[a]);
        out.size[a] = end - out.first[a];
    }
    return out;
}

namespace {

struct DistanceScratch {
    std::vector<float>&first, &second;
    std::vector<std::uint8_t> mark;
    std::vector<RowKind> kinds;  // # rows
};

// phi from squared distances: those to the label first, then, inside it, those to its complement.
void to_signed(const float* squared,
               std::size_t count,
               RowKind kind,
               bool outside,
               float limit,
               float half,
               float* phi) {
    if (outside && kind == RowKind::zeros) return;
    if (kind != RowKind::mixed) {
        const float d = squared[0] > 0 ? std::min(std::sqrt(squared[0]), limit) : 0.0f;
        std::fill(phi, phi + count, outside ? half - d : squared[0] > 0 ? d - half : 0.0f);
    } else if (!outside) {
        for (std::size_t i = 0; i < count; ++i)
            phi[i] = squared[i] > 0 ? std::min(std::sqrt(squared[i]), limit) - half : 0.0f;
    } else {
        for (std::size_t i = 0; i < count; ++i) {
            const float d = half - std::min(std::sqrt(squared[i]), limit);
            phi[i] = squared[i] > 0 ? d : phi[i];
        }
    }
}

// phi: # box.count()
void distances_on(const LabelVolume& volume,
                  const std::array<std::uint8_t, 256>& member,
                  const VoxelBox& box,
                  double limit_mm,
                  std::array<bool, 3> axes,
                  float* phi,
                  DistanceScratch* scratch) {
    const std::size_t nx = static_cast<std::size_t>(box.size.x);
    const std::size_t plane = nx * static_cast<std::size_t>(box.size.y);
    const std::size_t count = box.count();
    const Vector3 h = volume.grid.spacing_mm;
    // Half a voxel from the last centre inside to the surface: the mean over the axes measured.
    double sum = 0, measured = 0;
    for (int a = 0; a < 3; ++a) {
        if (axes[a]) {
            sum += h[a];
            measured += 1;
        }
    }
    const float half = static_cast<float>(measured > 0 ? 0.5 * sum / measured : 0);
    const float limit = static_cast<float>(limit_mm) + half;
    const float limit_sq = limit * limit;
    auto& [first, second, mark, kinds] = *scratch;
    kinds.resize(static_cast<std::size_t>(box.size.y) * box.size.z);
    first.resize(count);
    second.resize(count);
    mark.resize(nx);
    for (const bool outside : {false, true}) {  // distance to the label, then to its complement
        for (int k = 0; k < box.size.z; ++k) {
            for (int j = 0; j < box.size.y; ++j) {
                const std::uint8_t* row =
                    volume.voxels.data() +
                    volume.grid.index(box.first.x, box.first.y + j, box.first.z + k);
                for (std::size_t i = 0; i < nx; ++i) mark[i] = member[row[i]] != outside;
                float* to = first.data() + box.index(0, j, k);
                RowKind& kind = kinds[j + static_cast<std::size_t>(k) * box.size.y];
                const bool same = std::memchr(mark.data(), !mark[0], nx) == nullptr;
                kind = !same ? RowKind::mixed : mark[0] ? RowKind::zeros : RowKind::limits;
                if (same) {
                    std::fill(to, to + nx, mark[0] ? 0.0f : limit_sq);
                } else if (axes[0]) {
                    row_distances(mark.data(), box.size.x, static_cast<float>(h.x), limit_sq, to);
                } else {
                    for (std::size_t i = 0; i < nx; ++i) to[i] = mark[i] ? 0.0f : limit_sq;
                }
            }
        }
        if (axes[1]) {
            for (int k = 0; k < box.size.z; ++k) {
                const std::size_t at = static_cast<std::size_t>(k) * plane;
                line_distances(first.data() + at, nx, box.size.y, nx, static_cast<float>(h.y),
                               limit_sq, kinds.data() + static_cast<std::size_t>(k) * box.size.y, 1,
                               second.data() + at);
            }
            first.swap(second);
        }
        if (axes[2]) {
            for (int j = 0; j < box.size.y;
                 ++j) {  // row by row, which keeps the lines in the cache
                const std::size_t at = static_cast<std::size_t>(j) * nx;
                line_distances(first.data() + at, nx, box.size.z, plane, static_cast<float>(h.z),
                               limit_sq, kinds.data() + j, static_cast<std::size_t>(box.size.y),
                               second.data() + at);
            }
            first.swap(second);
        }
        for (std::size_t r = 0; r < kinds.size(); ++r)
            to_signed(first.data() + r * nx, nx, kinds[r], outside, limit, half, phi + r * nx);
    }
}

}  // namespace

void signed_distance(const LabelVolume& volume,
                     const LabelSet& labels,
                     const VoxelBox& box,
                     double limit_mm,
                     std::array<bool, 3> axes,
                     std::vector<float>* phi,
                     DistanceSpace space) {
    assert(limit_mm > 0);
    phi->resize(box.count());
    std::array<std::uint8_t, 256> member;
    for (std::size_t l = 0; l < member.size(); ++l) member[l] = labels[l];
    DistanceScratch scratch{*space.first, *space.second, {}, {}};
    if (axes[2]) {
        distances_on(volume, member, box, limit_mm, axes, phi->data(), &scratch);
        return;
    }
    // Independent slices, all in the scratch space of one.
    for (int k = 0; k < box.size.z; ++k) {
        const VoxelBox slice{{box.first.x, box.first.y, box.first.z + k},
                             {box.size.x, box.size.y, 1}};
        distances_on(volume, member, slice, limit_mm, axes, phi->data() + box.index(0, 0, k),
                     &scratch);
    }
}

void signed_distance(const LabelVolume& volume,
                     const LabelSet& labels,
                     const VoxelBox& box,
                     double limit_mm,
                     std::array<bool, 3> axes,
                     std::vector<float>* phi) {
    std::vector<float> first, second;
    signed_distance(volume, labels, box, limit_mm, axes, phi, {&first, &second});
}

void signed_distance(const LabelVolume& volume,
                     std::uint8_t label,
                     const VoxelBox& box,
                     double limit_mm,
                     std::array<bool, 3> axes,
                     std::vector<float>* phi) {
    signed_distance(volume, one_label(label), box, limit_mm, axes, phi);
}

}  // namespace sonocase::pipeline::inline segmentation_distance
