// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/physical_textures.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/core/noise.h"
#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/physical/model/physical_model.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

std::uint32_t signed_byte(double v) {
    return static_cast<std::uint32_t>(
               static_cast<std::int32_t>(std::lround(std::clamp(v, -127.0, 127.0)))) &
           0xFFu;
}

constexpr double kGlintMean = 0.156;  // gives the mean amplitude of a glint of deviation 0.75

std::vector<std::uint32_t> make_rough_surfaces() {
    const RawVector<float> rough = smooth_periodic_noise(kRoughEdge, 2, 11),
                           glint = smooth_periodic_noise(kRoughEdge, 2, 12),
                           phase = smooth_periodic_noise(kRoughEdge, 3, 13);
    std::vector<std::uint32_t> out(rough.size());
    for (std::size_t i = 0; i < rough.size(); ++i) {
        const double p = 0.9 * static_cast<double>(phase[i]);
        out[i] = signed_byte(32 * static_cast<double>(rough[i])) |
                 signed_byte(32 * 1.4426950408889634 *
                             (kGlintMean + 0.5 * static_cast<double>(glint[i])))
                     << 8 |
                 signed_byte(127 * std::cos(p)) << 16 | signed_byte(127 * std::sin(p)) << 24;
    }
    return out;
}

// Offsets of mean power 1, in quarter dB. Powers are taken from a table: steps of 1/64 dB from
// kMin on.
void store(const RawVector<float>& db, std::int8_t* out) {
    constexpr float kMin = -8, kMax = 24, kSteps = 64;
    std::vector<std::uint32_t> met(static_cast<std::size_t>((kMax - kMin) * kSteps) + 1);
    for (const float v : db)
        ++met[static_cast<std::size_t>((std::clamp(v, kMin, kMax) - kMin) * kSteps + 0.5f)];
    double power = 0;
    for (std::size_t i = 0; i < met.size(); ++i)
        power += met[i] * std::pow(10.0, (kMin + static_cast<double>(i) / kSteps) / 10);
    const auto mean = static_cast<float>(10 * std::log10(power / static_cast<double>(db.size())));
    for (std::size_t i = 0; i < db.size(); ++i) {
        constexpr float kAbove = 127.5f;  // makes the number positive, so that the cast rounds
        const float quarters = std::clamp(4 * (db[i] - mean), -127.0f, 127.0f);
        const auto at = static_cast<int>(i);
        constexpr int kIn = kFineEdge - 1;
        out[fine_index(at & kIn, at / kFineEdge & kIn, at / (kFineEdge * kFineEdge))] =
            static_cast<std::int8_t>(static_cast<int>(quarters + kAbove) - 127);
    }
}

// Echo of parenchyma at middle scale: 1.4 dB over 6 mm, 0.6 dB over 1.3 mm whose depth itself
// varies over 6 mm, and shading of 1.5 dB over 26 mm. A tracked sweep of a living liver has 2 and
// 3.2 dB (docs/realism.md), which hide a lesion: it is to be found.
void make_parenchyma(std::int8_t* out) {
    const RawVector<float> fine = smooth_periodic_noise(kFineEdge, 0, 31),
                           depth = smooth_periodic_noise(kFineEdge, 2, 32),
                           middle = smooth_periodic_noise(kFineEdge, 2, 33),
                           shading = smooth_periodic_noise(kFineEdge, 10, 34);
    RawVector<float> db(fine.size());
    for (std::size_t i = 0; i < db.size(); ++i)
        db[i] = 1.4f * middle[i] +
                0.6f * static_cast<float>(std::exp(0.3 * static_cast<double>(depth[i]))) * fine[i] +
                1.5f * shading[i];
    store(db, out);
}

// Honeycomb: dark bundles in bright sheaths. A bundle's middle lies at a random place in its cell
// of the cross-section; between the two nearest middles there is a sheath.
void make_nerve(std::int8_t* out) {
    constexpr int kCells = kFineEdge / kNerveBundle;
    const auto wrapped = [](int d) { return (d + 3 * kFineEdge / 2) % kFineEdge - kFineEdge / 2; };
    std::vector<std::pair<int, int>> middles;
    for (std::uint32_t c = 0; c < kCells * kCells; ++c) {
        const std::uint32_t h = hash32(c + 51);
        middles.emplace_back(
            static_cast<int>(c % kCells) * kNerveBundle + static_cast<int>(h & 7),
            static_cast<int>(c / kCells) * kNerveBundle + static_cast<int>(h >> 8 & 7));
    }
    RawVector<float> db(kFineEdge * kFineEdge * kFineEdge);
    for (int v = 0; v < kFineEdge; ++v) {
        for (int u = 0; u < kFineEdge; ++u) {
            double nearest = 1e9, next = 1e9;
            for (const auto& [x, y] : middles) {
                const int dx = wrapped(u - x), dy = wrapped(v - y);
                const double away = std::sqrt(static_cast<double>(dx * dx + dy * dy));
                next = std::min(next, std::max(away, nearest));
                nearest = std::min(nearest, away);
            }
            const auto sheath = static_cast<float>(std::clamp(1.6 - (next - nearest), 0.0, 1.0));
            for (int along = 0; along < kFineEdge; ++along)
                db[along + kFineEdge * (u + kFineEdge * v)] = -6 + 15 * sheath;
        }
    }
    store(db, out);
}

std::vector<std::int8_t> make_cubes() {
    const std::size_t cube = kFineEdge * kFineEdge * kFineEdge;
    std::vector<std::int8_t> cubes(6 * cube + kGatherSlack);
    const RawVector<float> a = smooth_periodic_noise(kFineEdge, 2, 21),
                           b = smooth_periodic_noise(kFineEdge, 5, 22),
                           c = smooth_periodic_noise(kFineEdge, 5, 23);
    RawVector<float> db(cube);
    // Fibres: sparse bright strands on dark ground.
    for (std::size_t i = 0; i < cube; ++i)
        db[i] = -4 + 10 * std::clamp(a[i] + 0.3f * c[i] - 0.55f, 0.0f, 1.9f);
    store(db, cubes.data());
    // Septa: thin sheets where a smooth field crosses zero, torn here and there. Those that show
    // as lines are sheets of the wall (wall_sheets.h); these are faint.
    for (std::size_t i = 0; i < cube; ++i) {
        constexpr float kNothing = 20;  // exp(-20) does not show
        const float off = b[i] / 0.11f, square = off * off;
        db[i] = -4;
        if (square < kNothing)
            db[i] += 7 * static_cast<float>(std::exp(-static_cast<double>(square))) *
                     std::clamp(0.45f + 0.7f * c[i], 0.0f, 1.3f);
    }
    store(db, cubes.data() + cube);
    make_parenchyma(cubes.data() + 2 * cube);
    make_nerve(cubes.data() + kNerveCube * cube);
    // The ground between plates: uneven over some tenths of a millimetre and over some millimetres.
    for (std::size_t i = 0; i < cube; ++i)
        db[i] = 7 * std::clamp(a[i] + 0.3f * c[i] - 0.35f, 0.0f, 1.9f) + 1.5f * b[i];
    store(db, cubes.data() + kFineMuscleCube * cube);
    for (std::size_t i = 0; i < cube; ++i) db[i] = 1.5f * a[i] + 2 * b[i];
    store(db, cubes.data() + kFineFatCube * cube);
    return cubes;
}

}  // namespace

PhysicalTextures physical_textures() {
    return {make_rough_surfaces(), make_cubes(), normal_levels()};
}

}  // namespace sonocase::runtime
