// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/fine_structure.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/noise/periodic_noise.h"
#include "runtime/imaging/physical/model/physical_model.h"
#include "runtime/imaging/simd/gather_slack.h"
#include "runtime/imaging/simd/parallel_halves.h"

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
    double elongation = 1;  // spread along it over the next
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

// Mean power 1, as quarter dB. Powers are looked up: in steps of 1/64 dB, from kLeast on.
void store(const RawVector<float>& db, std::int8_t* out) {
    constexpr float kLeast = -8, kMost = 24, kSteps = 64;
    std::vector<std::uint32_t> met(static_cast<std::size_t>((kMost - kLeast) * kSteps) + 1);
    for (const float v : db)
        ++met[static_cast<std::size_t>((std::clamp(v, kLeast, kMost) - kLeast) * kSteps + 0.5f)];
    double power = 0;
    for (std::size_t i = 0; i < met.size(); ++i)
        power += met[i] * std::pow(10.0, (kLeast + static_cast<double>(i) / kSteps) / 10);
    const auto mean = static_cast<float>(10 * std::log10(power / static_cast<double>(db.size())));
    for (std::size_t i = 0; i < db.size(); ++i) {
        constexpr float kAbove = 127.5f;  // what is cast is above 0: rounded, not cut
        const float quarters = std::clamp(4 * (db[i] - mean), -127.0f, 127.0f);
        out[i] = static_cast<std::int8_t>(static_cast<int>(quarters + kAbove) - 127);
    }
}

std::vector<std::int8_t> make_cubes() {
    const std::size_t cube = static_cast<std::size_t>(kFineEdge) * kFineEdge * kFineEdge;
    std::vector<std::int8_t> cubes(2 * cube + kGatherSlack);
    const RawVector<float> a = smooth_periodic_noise(kFineEdge, 2, 21),
                           b = smooth_periodic_noise(kFineEdge, 5, 22),
                           c = smooth_periodic_noise(kFineEdge, 5, 23);
    RawVector<float> db(cube);
    // Fibres: sparse bright strands on dark ground.
    for (std::size_t i = 0; i < cube; ++i)
        db[i] = -5 + 13 * std::clamp(a[i] + 0.3f * c[i] - 0.35f, 0.0f, 1.9f);
    store(db, cubes.data());
    // Septa: thin sheets where a smooth field crosses zero, torn here and there.
    for (std::size_t i = 0; i < cube; ++i) {
        constexpr float kNothing = 20;  // e to the minus of it
        const float off = b[i] / 0.11f, square = off * off;
        db[i] = -4;
        if (square < kNothing)
            db[i] += 18 * static_cast<float>(std::exp(-static_cast<double>(square))) *
                     std::clamp(0.45f + 0.7f * c[i], 0.0f, 1.3f);
    }
    store(db, cubes.data() + cube);
    return cubes;
}

}  // namespace

const std::vector<std::int8_t>& fine_cubes() {
    static const std::vector<std::int8_t> cubes = make_cubes();
    return cubes;
}

FineStructure make_fine_structure(const CaseBundle& bundle) {
    FineStructure f;
    f.cubes = fine_cubes();
    f.frames.resize(bundle.labels.size());
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    std::vector<int> kind(bundle.labels.size(), -1);
    std::vector<bool> spine(bundle.labels.size(), false);
    bool any = false;
    for (std::size_t l = 1; l < kind.size(); ++l) {
        if (tissue_of[l] < 0) continue;
        const std::string& tissue = bundle.tissues[static_cast<std::size_t>(tissue_of[l])].name;
        kind[l] = tissue == "muscle" ? 0 : tissue == "fat" ? 1 : -1;
        any = any || kind[l] >= 0;
        spine[l] = bundle.labels[l].name.rfind("vertebra", 0) == 0;
    }
    if (!any) return f;

    // One voxel of a brick speaks for it.
    const BrickVolume<std::uint8_t>& labels = bundle.label_bricks;
    const Int3 n = brick_count(labels.size);
    std::vector<std::vector<Moments>> parts(2, std::vector<Moments>(bundle.labels.size()));
    parallel_halves(static_cast<std::size_t>(n.z), [&](std::size_t half, std::size_t begin,
                                                       std::size_t end) {
        std::vector<Moments>& moments = parts[half];
        const auto row = static_cast<std::size_t>(n.x), layer = row * static_cast<std::size_t>(n.y);
        for (std::size_t index = begin * layer; index < end * layer; ++index) {
            const std::uint32_t entry = labels.table[index];
            const std::size_t label =
                entry & kUniformBrick
                    ? labels.uniform[entry & ~kUniformBrick]
                    : labels.pool[static_cast<std::size_t>(entry) * kBrickVoxels + 42];
            if (kind[label] != 0 && !spine[label]) continue;
            add(moments[label], Vector3{4.0 * static_cast<double>(index % row),
                                        4.0 * static_cast<double>(index % layer / row),
                                        4.0 * static_cast<double>(index / layer)});
        }
    });
    // Sums of whole numbers: the same however they are parted.
    std::vector<Moments> moments(bundle.labels.size());
    Moments all_spine;
    for (const std::vector<Moments>& part : parts) {
        for (std::size_t l = 0; l < part.size(); ++l)
            add(spine[l] ? all_spine : moments[l], part[l]);
    }
    const Vector3 up = longest_axis(all_spine).direction;
    const double voxel = bundle.grid.spacing_mm.x;
    for (std::size_t l = 1; l < kind.size(); ++l) {
        if (kind[l] < 0) continue;
        FineFrame& frame = f.frames[l];
        frame.cube = kind[l];
        Vector3 along = up;
        if (kind[l] == 0) {
            const Axis own = longest_axis(moments[l]);
            if (own.elongation > 1.6) along = own.direction;
        }
        Vector3 a =
            normalized(cross(along, std::abs(along.x) < 0.7 ? Vector3{1, 0, 0} : Vector3{0, 1, 0}));
        const Vector3 b = cross(along, a);
        if (kind[l] == 0) {  // strands run into their sheet at an angle
            const Vector3 straight = along;
            along = std::cos(kPennationRad) * straight + std::sin(kPennationRad) * a;
            a = std::cos(kPennationRad) * a - std::sin(kPennationRad) * straight;
        }
        const double across_mm = kind[l] == 0 ? kFibreAcrossMm : kSeptaAcrossMm;
        const double along_mm = kind[l] == 0 ? kFibreAlongMm : kSeptaAlongMm;
        const std::array<Vector3, 3> rows{(voxel / along_mm) * along, (voxel / across_mm) * a,
                                          (voxel / across_mm) * b};
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c)
                frame.cube_from_voxel[static_cast<std::size_t>(3 * r + c)] =
                    static_cast<float>(rows[static_cast<std::size_t>(r)][c]);
        }
    }
    return f;
}

}  // namespace sonocase::runtime
