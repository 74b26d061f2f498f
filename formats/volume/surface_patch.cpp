// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/surface_patch.h"

#include <algorithm>
#include <cmath>

#include "formats/volume/boundary_record.h"

namespace sonocase {
namespace {

// Compiles loops over a brick's voxels for the widest registers of the machine. They work on
// integers, except for the division and rounding of the direction, which round alike on every
// machine.
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SONOCASE_WIDEST __attribute__((target_clones("avx2", "default")))
#else
#define SONOCASE_WIDEST
#endif

using Voxels = std::array<std::int32_t, kBrickVoxels>;

// Twice each voxel's offset from the centre of its brick.
struct Places {
    Voxels x, y, z;
};
constexpr Places places_of_voxels() {
    Places out{};
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        out.x[v] = 2 * static_cast<std::int32_t>(v % 4) - 3;
        out.y[v] = 2 * static_cast<std::int32_t>(v / 4 % 4) - 3;
        out.z[v] = 2 * static_cast<std::int32_t>(v / 16) - 3;
    }
    return out;
}
alignas(64) constexpr Places kPlaces = places_of_voxels();

// q in 1/512 voxel.
inline std::int32_t distance_at(const std::array<std::int16_t, kPatchCoefficients>& c,
                                std::size_t v) {
    const std::int32_t x = kPlaces.x[v], y = kPlaces.y[v], z = kPlaces.z[v];
    return 16 * c[0] + x * (4 * c[1] + c[4] * x + c[7] * y + c[8] * z) +
           y * (4 * c[2] + c[5] * y + c[9] * z) + z * (4 * c[3] + c[6] * z);
}

// Steps of 1/48 voxel from 1/512 voxel, rounded; not negative.
inline std::int32_t steps_of(std::int32_t q) {
    return (q * 3 + 16) >> 5;
}

inline std::int32_t rounded(float v) {  // |v| <= 128
    return static_cast<std::int32_t>(v + 256.5f) - 256;
}

// Distance and direction packed as in boundary_record.h, without the second label.
inline std::uint32_t packed_plane(std::int32_t steps,
                                  std::int32_t x,
                                  std::int32_t y,
                                  std::int32_t z) {
    const float fx = static_cast<float>(x), fy = static_cast<float>(y), fz = static_cast<float>(z);
    const float sum = std::abs(fx) + std::abs(fy) + std::abs(fz);
    const float scale = 127.0f / std::max(sum, 1.0f);
    const float u = fx * scale, v = fy * scale;
    const float fold_u = 127.0f - std::abs(v), fold_v = 127.0f - std::abs(u);
    const float folded_u = fx < 0 ? -fold_u : fold_u, folded_v = fy < 0 ? -fold_v : fold_v;
    const std::int32_t a = rounded(fz < 0 ? folded_u : u), b = rounded(fz < 0 ? folded_v : v);
    return static_cast<std::uint32_t>(steps) << 8 | (static_cast<std::uint32_t>(a) & 0xFFu) << 16 |
           (static_cast<std::uint32_t>(b) & 0xFFu) << 24;
}

SONOCASE_WIDEST void sides(const SurfacePatch& patch, std::uint8_t* labels) {
    Voxels q;
    for (std::size_t v = 0; v < kBrickVoxels; ++v) q[v] = distance_at(patch.c, v);
    for (std::size_t v = 0; v < kBrickVoxels; ++v) labels[v] = q[v] >= 0 ? patch.low : patch.high;
}

SONOCASE_WIDEST void records_from_one(const SurfacePatch& patch,
                                      const std::uint8_t* labels,
                                      int reach_steps,
                                      std::uint32_t* records) {
    const auto& c = patch.c;
    const std::int32_t low = patch.low, high = patch.high;
    Voxels label;
    for (std::size_t v = 0; v < kBrickVoxels; ++v) label[v] = labels[v];
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        const std::int32_t x = kPlaces.x[v], y = kPlaces.y[v], z = kPlaces.z[v];
        const std::int32_t side = label[v] == low ? 1 : -1;
        const std::int32_t steps = steps_of(std::max(side * distance_at(c, v), 0));
        // 512 times the change of q over half a voxel along each axis.
        const std::int32_t gx = 4 * c[1] + 2 * c[4] * x + c[7] * y + c[8] * z,
                           gy = 4 * c[2] + c[7] * x + 2 * c[5] * y + c[9] * z,
                           gz = 4 * c[3] + c[8] * x + c[9] * y + 2 * c[6] * z;
        const std::uint32_t plane = packed_plane(steps, side * gx, side * gy, side * gz) |
                                    static_cast<std::uint32_t>(label[v] == low ? high : low);
        const bool none = (label[v] != low && label[v] != high) || steps > reach_steps;
        records[v] = none ? kNoBoundary : plane;
    }
}

// The nearer of two patches' records; at equal distance the first.
std::uint32_t nearer_of(std::uint32_t record, std::uint32_t other) {
    if (other == kNoBoundary) return record;
    const bool nearer = record == kNoBoundary || (other >> 8 & 0xFFu) < (record >> 8 & 0xFFu);
    return nearer ? other : record;
}

// The 10 monomials of q are fitted in voxels. Only the lower half of the matrix of the normal
// equations is kept, row by row. What a voxel's record adds to it depends only on the voxel's
// position and is a multiple of 1/16, so that the sums are exact in any order.
constexpr int kMatrix = kPatchCoefficients * (kPatchCoefficients + 1) / 2;
constexpr int entry(int i, int j) {
    return i * (i + 1) / 2 + j;
}

// The four terms of the derivative along each axis. Fitting them to unit normals makes q a distance
// and keeps the fit stable where there are few records.
constexpr int kSlopeAt[3][4] = {{1, 4, 7, 8}, {2, 5, 7, 9}, {3, 6, 8, 9}};

struct Terms {
    double value[kPatchCoefficients];
    double slope[3][4];
    double matrix[kMatrix];
};

constexpr std::array<Terms, kBrickVoxels> terms_of_voxels() {
    std::array<Terms, kBrickVoxels> out{};
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        const double x = 0.5 * kPlaces.x[v], y = 0.5 * kPlaces.y[v], z = 0.5 * kPlaces.z[v];
        Terms& t = out[v];
        const double value[] = {1, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z};
        const double slope[3][4] = {{1, 2 * x, y, z}, {1, 2 * y, x, z}, {1, 2 * z, x, y}};
        for (int i = 0; i < kPatchCoefficients; ++i) {
            t.value[i] = value[i];
            for (int j = 0; j <= i; ++j) t.matrix[entry(i, j)] += value[i] * value[j];
        }
        for (int a = 0; a < 3; ++a) {
            for (int i = 0; i < 4; ++i) {
                t.slope[a][i] = slope[a][i];
                for (int j = 0; j <= i; ++j)
                    t.matrix[entry(kSlopeAt[a][i], kSlopeAt[a][j])] += slope[a][i] * slope[a][j];
            }
        }
    }
    return out;
}
alignas(64) constexpr std::array<Terms, kBrickVoxels> kTerms = terms_of_voxels();

// The records that a patch is fitted to, signed from the patch's side.
struct Samples {
    std::size_t count = 0;
    std::array<std::uint8_t, kBrickVoxels> voxel;
    std::array<std::array<double, 4>, kBrickVoxels> plane;  // distance, normal
};

struct Fit {
    double matrix[kMatrix] = {};
    double right[kPatchCoefficients] = {};

    SONOCASE_WIDEST void add(const Samples& samples) {
        for (std::size_t s = 0; s < samples.count; ++s) {
            const Terms& t = kTerms[samples.voxel[s]];
            for (int e = 0; e < kMatrix; ++e) matrix[e] += t.matrix[e];
        }
        for (std::size_t s = 0; s < samples.count; ++s) {
            const Terms& t = kTerms[samples.voxel[s]];
            const auto& plane = samples.plane[s];
            for (int i = 0; i < kPatchCoefficients; ++i) right[i] += t.value[i] * plane[0];
            for (int a = 0; a < 3; ++a) {
                for (int i = 0; i < 4; ++i) right[kSlopeAt[a][i]] += t.slope[a][i] * plane[1 + a];
            }
        }
    }

    // By Cholesky factors. A small penalty on the curvatures decides what too few records leave
    // open.
    void solve(double* c) {
        constexpr double kCurvaturePenalty = 0.1, kRegularisation = 1e-9;
        double l[kPatchCoefficients][kPatchCoefficients];
        double inverse[kPatchCoefficients];  // 1 / l[i][i]
        for (int i = 0; i < kPatchCoefficients; ++i) {
            for (int j = 0; j <= i; ++j) {
                double sum = matrix[entry(i, j)];
                if (i == j) sum += i < 4 ? kRegularisation : kCurvaturePenalty;
                for (int k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
                l[i][j] = i == j ? std::sqrt(sum) : sum * inverse[j];
            }
            inverse[i] = 1 / l[i][i];
        }
        for (int i = 0; i < kPatchCoefficients; ++i) {
            double sum = right[i];
            for (int k = 0; k < i; ++k) sum -= l[i][k] * c[k];
            c[i] = sum * inverse[i];
        }
        for (int i = kPatchCoefficients; i-- > 0;) {
            double sum = c[i];
            for (int k = i + 1; k < kPatchCoefficients; ++k) sum -= l[k][i] * c[k];
            c[i] = sum * inverse[i];
        }
    }
};

}  // namespace

void labels_from_patch(const SurfacePatch& patch, std::uint8_t* labels) {
    sides(patch, labels);
}

void records_from_patches(std::span<const SurfacePatch> patches,
                          const std::uint8_t* labels,
                          int reach_steps,
                          std::uint32_t* records) {
    if (patches.size() == 1) {
        records_from_one(patches[0], labels, reach_steps, records);
        return;
    }
    std::fill(records, records + kBrickVoxels, kNoBoundary);
    BrickRecords one;
    for (const SurfacePatch& patch : patches) {
        records_from_one(patch, labels, reach_steps, one.data());
        for (std::size_t v = 0; v < kBrickVoxels; ++v) records[v] = nearer_of(records[v], one[v]);
    }
}

SurfacePatch continued(const SurfacePatch& patch, int axis) {
    // u becomes u + 4 along the axis; exact in whole steps of the coefficients.
    const int square = 4 + axis;
    const int cross[3][2] = {{7, 8}, {7, 9}, {8, 9}};  // the products that the axis is part of
    const int other[3][2] = {{2, 3}, {1, 3}, {1, 2}};  // and the linear terms that they add to
    const auto at = [&](int i) { return static_cast<int>(patch.c[i]); };
    SurfacePatch out = patch;
    const auto put = [&](int i, int value) {  // wraps around on invalid input, as the reader does
        out.c[i] = static_cast<std::int16_t>(value);
    };
    put(0, at(0) + 2 * at(1 + axis) + 4 * at(square));
    put(1 + axis, at(1 + axis) + 4 * at(square));
    for (int n = 0; n < 2; ++n) put(other[axis][n], at(other[axis][n]) + 2 * at(cross[axis][n]));
    return out;
}

std::vector<SurfacePatch> fit_patches(const BrickLabels& labels,
                                      const BrickRecords& records,
                                      int step) {
    std::array<std::uint16_t, kBrickVoxels> pair;  // low << 8 | high; 0: no record
    std::vector<std::uint16_t> pairs;
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        pair[v] = 0;
        if (records[v] == kNoBoundary) continue;
        const unsigned own = labels[v], second = records[v] & 0xFFu;
        if (own == second) return {};
        pair[v] = static_cast<std::uint16_t>(std::min(own, second) << 8 | std::max(own, second));
        if (std::find(pairs.begin(), pairs.end(), pair[v]) == pairs.end()) pairs.push_back(pair[v]);
    }
    if (pairs.size() > static_cast<std::size_t>(kMaxPatches)) return {};
    std::sort(pairs.begin(), pairs.end());
    std::vector<SurfacePatch> out;
    for (const std::uint16_t wanted : pairs) {
        SurfacePatch patch;
        patch.low = static_cast<std::uint8_t>(wanted >> 8);
        patch.high = static_cast<std::uint8_t>(wanted & 0xFFu);
        Samples samples;
        for (std::size_t v = 0; v < kBrickVoxels; ++v) {
            if (pair[v] != wanted) continue;
            const BoundaryRecord r = unpack_boundary(records[v]);
            const double side = labels[v] == patch.low ? 1 : -1;
            samples.voxel[samples.count] = static_cast<std::uint8_t>(v);
            samples.plane[samples.count++] = {side * r.distance_vx, side * r.normal.x,
                                              side * r.normal.y, side * r.normal.z};
        }
        Fit fit;
        fit.add(samples);
        double c[kPatchCoefficients];
        fit.solve(c);
        for (int i = 0; i < kPatchCoefficients; ++i) {
            const double unit = (i == 0 ? 32.0 : i < 4 ? 64.0 : 128.0) / step;
            const int max_steps = 32767 / step;  // whole steps that 16 bits hold
            const double max = max_steps;
            patch.c[i] =
                static_cast<std::int16_t>(step * std::lround(std::clamp(unit * c[i], -max, max)));
        }
        out.push_back(patch);
    }
    return out;
}

}  // namespace sonocase
