#include "formats/surface_patch.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <numeric>

#include "formats/boundary_record.h"

namespace sonocase {
namespace {

// q in 1/512 voxel at the 64 voxels, and 512 times its change a half voxel along each axis.
struct PatchValues {
    std::array<std::int32_t, kBrickVoxels> q, x, y, z;
};

void evaluate_distance(const SurfacePatch& patch, std::int32_t* q) {
    const auto& c = patch.c;
    for (int k = 0; k < kBrickEdge; ++k) {
        const int mz = 2 * k - 3;  // voxels lie at odd halves of a voxel from the brick's centre
        for (int j = 0; j < kBrickEdge; ++j) {
            const int my = 2 * j - 3;
            const int base = 16 * c[0] + 4 * (c[2] * my + c[3] * mz) + c[5] * my * my +
                             c[6] * mz * mz + c[9] * my * mz;
            const int slope = 4 * c[1] + c[7] * my + c[8] * mz;
            for (int i = 0; i < kBrickEdge; ++i) {
                const int mx = 2 * i - 3;
                *q++ = base + mx * (slope + c[4] * mx);
            }
        }
    }
}

void evaluate(const SurfacePatch& patch, PatchValues* out) {
    const auto& c = patch.c;
    evaluate_distance(patch, out->q.data());
    std::size_t v = 0;
    for (int k = 0; k < kBrickEdge; ++k) {
        const int mz = 2 * k - 3;
        for (int j = 0; j < kBrickEdge; ++j) {
            const int my = 2 * j - 3;
            const int x = 4 * c[1] + c[7] * my + c[8] * mz;
            const int y = 4 * c[2] + 2 * c[5] * my + c[9] * mz;
            const int z = 4 * c[3] + 2 * c[6] * mz + c[9] * my;
            for (int i = 0; i < kBrickEdge; ++i, ++v) {
                const int mx = 2 * i - 3;
                out->x[v] = x + 2 * c[4] * mx;
                out->y[v] = y + c[7] * mx;
                out->z[v] = z + c[8] * mx;
            }
        }
    }
}

// Steps of 1/48 voxel from 1/512 voxel, rounded; not negative.
std::int32_t steps_of(std::int32_t q) {
    return (q * 3 + 16) >> 5;
}

std::int32_t rounded(float v) {  // |v| <= 128
    return static_cast<std::int32_t>(v + 256.5f) - 256;
}

// Distance and direction packed as boundary_record.h has them, without the second label.
std::uint32_t packed_plane(std::int32_t steps, std::int32_t x, std::int32_t y, std::int32_t z) {
    const float fx = static_cast<float>(x), fy = static_cast<float>(y), fz = static_cast<float>(z);
    const float sum = std::abs(fx) + std::abs(fy) + std::abs(fz);
    const float scale = 127.0f / std::max(sum, 1.0f);
    const float u = fx * scale, v = fy * scale;
    const float folded_u = fx < 0 ? std::abs(v) - 127.0f : 127.0f - std::abs(v);
    const float folded_v = fy < 0 ? std::abs(u) - 127.0f : 127.0f - std::abs(u);
    const std::int32_t a = rounded(fz < 0 ? folded_u : u), b = rounded(fz < 0 ? folded_v : v);
    return static_cast<std::uint32_t>(steps) << 8 | (static_cast<std::uint32_t>(a) & 0xFFu) << 16 |
           (static_cast<std::uint32_t>(b) & 0xFFu) << 24;
}

// What a patch says of voxel v.
std::uint32_t record_at(const SurfacePatch& patch,
                        const PatchValues& value,
                        std::size_t v,
                        std::uint32_t label,
                        int reach_steps) {
    const std::uint32_t low = patch.low, high = patch.high;
    const bool in_low = label == low, in_high = label == high;
    const std::int32_t side = in_low ? 1 : -1;
    const std::int32_t steps = steps_of(std::max(side * value.q[v], 0));
    if (!(in_low || in_high) || steps > reach_steps) return kNoBoundary;
    return packed_plane(steps, side * value.x[v], side * value.y[v], side * value.z[v]) |
           (in_low ? high : low);
}

void records_from_one(const SurfacePatch& patch,
                      const std::uint8_t* labels,
                      int reach_steps,
                      std::uint32_t* records) {
    PatchValues value;
    evaluate(patch, &value);
    for (std::size_t v = 0; v < kBrickVoxels; ++v)
        records[v] = record_at(patch, value, v, labels[v], reach_steps);
}

// Of two patches' records the nearer, the earlier at equal distance.
std::uint32_t nearer_of(std::uint32_t record, std::uint32_t other) {
    if (other == kNoBoundary) return record;
    const bool nearer = record == kNoBoundary || (other >> 8 & 0xFFu) < (record >> 8 & 0xFFu);
    return nearer ? other : record;
}

// The 10 monomials of q are fitted in voxels; the sums of the normal equations.
struct Fit {
    double matrix[kPatchCoefficients][kPatchCoefficients] = {};
    double right[kPatchCoefficients] = {};

    void add(Vector3 u, double distance, Vector3 normal) {
        const double row[kPatchCoefficients] = {1,         u.x,       u.y,       u.z,       u.x * u.x,
                                                u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z, u.y * u.z};
        for (int i = 0; i < kPatchCoefficients; ++i) {
            for (int j = 0; j <= i; ++j) matrix[i][j] += row[i] * row[j];
            right[i] += row[i] * distance;
        }
        // Where each axis' derivative has its four terms, and what they are worth at u. That it
        // should have the length of 1 is what makes a distance of q, and the fit of few records firm.
        const int at[3][4] = {{1, 4, 7, 8}, {2, 5, 7, 9}, {3, 6, 8, 9}};
        const double term[3][4] = {
            {1, 2 * u.x, u.y, u.z}, {1, 2 * u.y, u.x, u.z}, {1, 2 * u.z, u.x, u.y}};
        for (int a = 0; a < 3; ++a) {
            for (int i = 0; i < 4; ++i) {
                for (int j = 0; j <= i; ++j)
                    matrix[at[a][i]][at[a][j]] += term[a][i] * term[a][j];
                right[at[a][i]] += term[a][i] * normal[a];
            }
        }
    }

    // Cholesky. A little weight on the curvatures decides what too few records leave open.
    void solve(double* c) {
        constexpr double kFlat = 0.1, kAnything = 1e-9;
        double l[kPatchCoefficients][kPatchCoefficients];
        for (int i = 0; i < kPatchCoefficients; ++i) {
            for (int j = 0; j <= i; ++j) {
                double sum = matrix[i][j];
                if (i == j) sum += i < 4 ? kAnything : kFlat;
                for (int k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
                l[i][j] = i == j ? std::sqrt(sum) : sum / l[j][j];
            }
        }
        for (int i = 0; i < kPatchCoefficients; ++i) {
            double sum = right[i];
            for (int k = 0; k < i; ++k) sum -= l[i][k] * c[k];
            c[i] = sum / l[i][i];
        }
        for (int i = kPatchCoefficients; i-- > 0;) {
            double sum = c[i];
            for (int k = i + 1; k < kPatchCoefficients; ++k) sum -= l[k][i] * c[k];
            c[i] = sum / l[i][i];
        }
    }
};

}  // namespace

void labels_from_patch(const SurfacePatch& patch, std::uint8_t* labels) {
    std::array<std::int32_t, kBrickVoxels> q;
    evaluate_distance(patch, q.data());
    for (std::size_t v = 0; v < kBrickVoxels; ++v) labels[v] = q[v] >= 0 ? patch.low : patch.high;
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
    // u becomes u + 4 along the axis; in whole steps of the coefficients nothing is lost.
    const int square = 4 + axis;
    const int cross[3][2] = {{7, 8}, {7, 9}, {8, 9}};    // the products that the axis is part of
    const int other[3][2] = {{2, 3}, {1, 3}, {1, 2}};    // and the linear terms that they add to
    const auto at = [&](int i) { return static_cast<int>(patch.c[static_cast<std::size_t>(i)]); };
    SurfacePatch out = patch;
    const auto put = [&](int i, int value) {  // wraps on nonsense, as the reader's does
        out.c[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(value);
    };
    put(0, at(0) + 2 * at(1 + axis) + 4 * at(square));
    put(1 + axis, at(1 + axis) + 4 * at(square));
    for (int n = 0; n < 2; ++n) put(other[axis][n], at(other[axis][n]) + 2 * at(cross[axis][n]));
    return out;
}

std::vector<SurfacePatch> fit_patches(const BrickLabels& labels, const BrickRecords& records) {
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
        Fit fit;
        for (std::size_t v = 0; v < kBrickVoxels; ++v) {
            if (pair[v] != wanted) continue;
            const BoundaryRecord record = unpack_boundary(records[v]);
            const double side = labels[v] == patch.low ? 1 : -1;
            const Vector3 u{static_cast<double>(v % 4) - 1.5, static_cast<double>(v / 4 % 4) - 1.5,
                            static_cast<double>(v / 16) - 1.5};
            fit.add(u, side * record.distance_vx, side * record.normal);
        }
        double c[kPatchCoefficients];
        fit.solve(c);
        for (int i = 0; i < kPatchCoefficients; ++i) {
            const double unit = i == 0 ? 32 : i < 4 ? 64 : 128;
            patch.c[static_cast<std::size_t>(i)] =
                static_cast<std::int16_t>(std::lround(std::clamp(unit * c[i], -32767.0, 32767.0)));
        }
        out.push_back(patch);
    }
    return out;
}

std::vector<SurfacePatch> find_patches(const BrickLabels& labels,
                                       const BrickRecords& records,
                                       int reach_steps) {
    std::vector<SurfacePatch> patches = fit_patches(labels, records);
    if (patches.empty()) return {};
    const bool by_side =
        patches.size() == 1 && std::all_of(labels.begin(), labels.end(), [&](std::uint8_t l) {
            return l == patches[0].low || l == patches[0].high;
        });
    std::vector<PatchValues> values(patches.size());
    for (std::size_t k = 0; k < patches.size(); ++k) evaluate(patches[k], &values[k]);
    // 0 where all is right, else about the squared steps between made and wanted; `enough` or more
    // stands for itself. Voxels that were wrong last time come first: most tries leave them so.
    std::array<std::uint8_t, kBrickVoxels> order;
    std::iota(order.begin(), order.end(), std::uint8_t{0});
    const auto wrong = [&](int enough) {
        int count = 0;
        std::size_t front = 0;
        for (std::size_t n = 0; n < kBrickVoxels && count < enough; ++n) {
            const std::size_t v = order[n];
            const int before = count;
            std::uint32_t made = kNoBoundary;
            for (std::size_t k = 0; k < patches.size(); ++k)
                made = nearer_of(made, record_at(patches[k], values[k], v, labels[v], reach_steps));
            if (by_side)
                count += (values[0].q[v] >= 0 ? patches[0].low : patches[0].high) != labels[v];
            if (made != records[v]) {
                const bool both = made != kNoBoundary && records[v] != kNoBoundary;
                for (int shift = 8; both && shift < 32; shift += 8) {
                    const int d = static_cast<std::int8_t>(made >> shift) -
                                  static_cast<std::int8_t>(records[v] >> shift);
                    count += d * d;
                }
                count += both ? 1 : 10;
            }
            if (count > before) std::swap(order[n], order[front++]);
        }
        return count;
    };
    constexpr int kSteps = 8;
    int least = wrong(INT_MAX);
    for (int step = 0; least > 0 && step < kSteps; ++step) {
        std::int16_t* best = nullptr;
        std::int16_t best_value = 0;
        std::size_t best_patch = 0;
        for (std::size_t k = 0; k < patches.size(); ++k) {
            for (std::int16_t& c : patches[k].c) {
                const std::int16_t was = c;
                for (const int change : {-1, 1}) {
                    c = static_cast<std::int16_t>(was + change);
                    evaluate(patches[k], &values[k]);
                    const int count = wrong(least);
                    if (count < least) {
                        least = count;
                        best = &c;
                        best_value = c;
                        best_patch = k;
                    }
                }
                c = was;
            }
            evaluate(patches[k], &values[k]);
        }
        if (best == nullptr) return {};
        *best = best_value;
        evaluate(patches[best_patch], &values[best_patch]);
    }
    if (least > 0) return {};
    return patches;
}

}  // namespace sonocase
