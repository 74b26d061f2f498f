// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/fine_structure.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/core/host.h"
#include "runtime/imaging/physical/model/physical_model.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

struct Moments {
    double count = 0;
    Vector3 sum;
    std::array<double, 6> square{};  // xx yy zz xy xz yz
};

void add(Moments& m, Vector3 p) {
    m.count += 1;
    m.sum = m.sum + p;
    const std::array<double, 6> s{p.x * p.x, p.y * p.y, p.z * p.z, p.x * p.y, p.x * p.z, p.y * p.z};
    for (std::size_t i = 0; i < 6; ++i) m.square[i] += s[i];
}

void add(Moments& m, const Moments& part) {
    m.count += part.count;
    m.sum = m.sum + part.sum;
    for (std::size_t i = 0; i < 6; ++i) m.square[i] += part.square[i];
}

struct Axis {
    Vector3 direction{0, 0, 1};
    double elongation = 1;  // spread along it over spread along the next longest
};

// Longest axis by power iteration on the covariance, then the next one by deflation.
Axis longest_axis(const Moments& m) {
    if (m.count < 8) return {};
    const Vector3 c = m.sum / m.count;
    const auto q = [&](std::size_t i) { return m.square[i] / m.count; };
    Matrix3 v;
    v(0, 0) = q(0) - c.x * c.x;
    v(1, 1) = q(1) - c.y * c.y;
    v(2, 2) = q(2) - c.z * c.z;
    v(0, 1) = v(1, 0) = q(3) - c.x * c.y;
    v(0, 2) = v(2, 0) = q(4) - c.x * c.z;
    v(1, 2) = v(2, 1) = q(5) - c.y * c.z;
    const auto top = [](const Matrix3& a, Vector3 start) {
        Vector3 x = start;
        for (int i = 0; i < 60; ++i) {
            const Vector3 y = a * x;
            if (!(norm(y) > 1e-12)) break;
            x = normalized(y);
        }
        return x;
    };
    const Vector3 first = top(v, normalized(Vector3{0.31, 0.52, 0.79}));
    const double l1 = dot(first, v * first);
    Matrix3 rest = v;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) rest(i, j) -= l1 * first[i] * first[j];
    }
    const Vector3 second = top(rest, normalized(cross(first, Vector3{0.79, -0.31, 0.52})));
    const double l2 = dot(second, v * second);
    return {first, l2 > 1e-9 ? std::sqrt(l1 / l2) : 10.0};
}

constexpr int kFibres = 0, kSepta = 1, kNeither = -1;

bool is_parenchyma(const std::string& tissue) {
    return tissue == "liver" || tissue == "spleen" || tissue == "kidney_cortex" ||
           tissue == "pancreas" || tissue == "gland" || tissue == "heart_muscle";
}

struct Kinds {
    std::vector<int> cube;    // # labels: kFibres, kSepta or kNeither
    std::vector<bool> spine;  // # labels: a vertebra
};

Kinds kinds_of_labels(const CaseBundle& bundle) {
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    Kinds kinds{std::vector<int>(bundle.labels.size(), kNeither),
                std::vector<bool>(bundle.labels.size(), false)};
    for (std::size_t l = 1; l < bundle.labels.size(); ++l) {
        if (tissue_of[l] < 0) continue;
        const std::string& tissue = bundle.tissues[tissue_of[l]].name;
        kinds.cube[l] = tissue == "muscle"      ? kFibres
                        : tissue == "fat"       ? kSepta
                        : is_parenchyma(tissue) ? kParenchymaCube
                        : tissue == "nerve"     ? kNerveCube
                                                : kNeither;
        kinds.spine[l] = bundle.labels[l].name.rfind("vertebra", 0) == 0;
    }
    return kinds;
}

struct LabelMoments {
    std::vector<Moments> own;  // # labels
    Moments spine;
};

// Moments of muscles and of the spine, in voxels; one voxel stands for its brick.
LabelMoments moments_of_labels(const CaseBundle& bundle, const Kinds& kinds, JobRunner& jobs) {
    const BrickVolume<std::uint8_t>& labels = bundle.label_bricks;
    const Int3 n = brick_count(labels.size);
    std::vector<std::vector<Moments>> parts(2, std::vector<Moments>(bundle.labels.size()));
    parallel_halves(jobs, n.z, [&](std::size_t half, std::size_t begin, std::size_t end) {
        std::vector<Moments>& moments = parts[half];
        const std::size_t row = n.x, layer = row * n.y;
        for (std::size_t index = begin * layer; index < end * layer; ++index) {
            const std::uint32_t entry = labels.table[index];
            const std::size_t label =
                entry & kUniformBrick
                    ? labels.uniform[entry & ~kUniformBrick]
                    : labels.pool[static_cast<std::size_t>(entry) * kBrickVoxels + 42];
            if (kinds.cube[label] != kFibres && kinds.cube[label] != kNerveCube &&
                !kinds.spine[label])
                continue;
            const std::size_t i = index % row, j = index % layer / row, k = index / layer;
            add(moments[label], Vector3{4.0 * static_cast<double>(i), 4.0 * static_cast<double>(j),
                                        4.0 * static_cast<double>(k)});
        }
    });
    // These are sums of whole numbers, which do not depend on how they are divided.
    LabelMoments sums{std::vector<Moments>(bundle.labels.size()), {}};
    for (const std::vector<Moments>& part : parts) {
        for (std::size_t l = 0; l < part.size(); ++l)
            add(kinds.spine[l] ? sums.spine : sums.own[l], part[l]);
    }
    return sums;
}

// Parenchyma has the same grain in all directions, about axes that no organ or probe is likely to
// follow.
FineFrame frame_of_parenchyma(double voxel_mm) {
    FineFrame frame;
    frame.cube = kParenchymaCube;
    const Matrix3 turn =
        rotation_about(normalized(Vector3{0.36, 0.48, 0.8}), 0.7) * rotation_about({0, 0, 1}, 0.55);
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c)
            frame.cube_from_voxel[3 * r + c] =
                static_cast<float>(voxel_mm / kParenchymaMm * turn(r, c));
    }
    return frame;
}

// along: unit vector along fibres or lobules.
FineFrame frame_along(Vector3 along, int cube, double voxel_mm) {
    FineFrame frame;
    frame.cube = cube;
    Vector3 a =
        normalized(cross(along, std::abs(along.x) < 0.7 ? Vector3{1, 0, 0} : Vector3{0, 1, 0}));
    const Vector3 b = cross(along, a);
    if (cube == kFibres) {  // strands run into their sheet at an angle
        const Vector3 straight = along;
        along = std::cos(kPennationRad) * straight + std::sin(kPennationRad) * a;
        a = std::cos(kPennationRad) * a - std::sin(kPennationRad) * straight;
    }
    const double across_mm = cube == kSepta ? kSeptaAcrossMm : kFibreAcrossMm;
    const double along_mm = cube == kSepta ? kSeptaAlongMm : kFibreAlongMm;
    const std::array<Vector3, 3> rows{(voxel_mm / along_mm) * along, (voxel_mm / across_mm) * a,
                                      (voxel_mm / across_mm) * b};
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c)
            frame.cube_from_voxel[3 * r + c] = static_cast<float>(rows[r][c]);
    }
    return frame;
}

}  // namespace

FineStructure ground_of(FineStructure structure) {
    for (FineFrame& f : structure.frames) {
        if (f.cube == kFibreCube) f.cube = kFineMuscleCube;
        if (f.cube == kSeptaCube) f.cube = kFineFatCube;
    }
    return structure;
}

FineStructure make_fine_structure(const CaseBundle& bundle, JobRunner& jobs) {
    FineStructure f;
    f.frames.resize(bundle.labels.size());
    const Kinds kinds = kinds_of_labels(bundle);
    if (std::all_of(kinds.cube.begin(), kinds.cube.end(), [](int k) { return k == kNeither; }))
        return f;
    const LabelMoments moments = moments_of_labels(bundle, kinds, jobs);
    const Vector3 up = longest_axis(moments.spine).direction;
    for (std::size_t l = 1; l < kinds.cube.size(); ++l) {
        if (kinds.cube[l] == kNeither) continue;
        if (kinds.cube[l] == kParenchymaCube) {
            f.frames[l] = frame_of_parenchyma(bundle.grid.spacing_mm.x);
            continue;
        }
        Vector3 along = up;
        if (kinds.cube[l] == kFibres || kinds.cube[l] == kNerveCube) {
            const Axis own = longest_axis(moments.own[l]);
            if (own.elongation > 1.6) along = own.direction;
        }
        f.frames[l] = frame_along(along, kinds.cube[l], bundle.grid.spacing_mm.x);
    }
    return f;
}

}  // namespace sonocase::runtime
