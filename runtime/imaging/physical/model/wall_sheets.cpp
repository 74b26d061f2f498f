// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/wall_sheets.h"

#include <cmath>
#include <cstdint>
#include <span>

#include "formats/base/constants.h"
#include "runtime/imaging/core/noise.h"

namespace sonocase::runtime::physical {
namespace {

struct Sheet {
    // db: over liver; width_mm: full width at half height in the picture at 3.5 MHz.
    double at_mm, db, width_mm;
    double double_mm = 0;  // > 0: a second sheet, this much deeper, kDoubleDb weaker
};

constexpr double kDoubleDb = -4;

// Below the skin: its faces, the superficial fascia, then sheets of the fat.
constexpr Sheet kOuter[] = {
    {0.5, 2, 1.1},     {6.2, 9.5, 1.1}, {16.5, 5.5, 0.95},
    {18.4, 2.5, 0.95}, {27.5, 3.5, 1},  {35, 3, 1},
};
// Above the organs: the peritoneum, then the sheets of three muscles.
constexpr Sheet kInner[] = {
    {1.4, 11, 1.2},   {2.7, 4.5, 0.85},  {6.2, 8.5, 1},    {7, 1, 0.95},
    {8.3, 1.5, 0.95}, {12.6, 5.5, 0.95}, {18.5, 6.5, 1.1}, {22, 3, 1.1},
};
// Lamellae of fat and muscle between them, at random distances.
constexpr double kLamellaDb = 4.5, kLamellaSpreadDb = 10;
constexpr double kLamellaApartMm = 0.7, kLamellaApartSpreadMm = 1.2;
constexpr double kLamellaMm = 0.75, kLamellaSpreadMm = 0.4;

// Sheets that a pulse of a third of the length shows: septa of fat and fasciae, thin and many.
constexpr Sheet kOuterFine[] = {
    {0.5, 12, 0.9},
    {9.5, 14, 1, 1.1},
};
// The peritoneum and the sheets of three muscles.
constexpr Sheet kInnerFine[] = {
    {1.0, 18, 1.1},
    {4.6, 15, 1, 1.0},
    {8.6, 15, 1, 1.1},
    {12.6, 14, 1, 1.2},
};
constexpr double kFineMhz = 6;
constexpr int kNoLimitDb = 100;

// Adds faint sheets from the first to beyond the last of `sheets`.
void add_lamellae(std::span<const Sheet> sheets, std::vector<Sheet>& out) {
    std::uint32_t drawn = 71 * static_cast<std::uint32_t>(sheets.size());
    const auto uniform = [&] { return (hash32(++drawn) >> 8) / 16777216.0; };
    double at_mm = sheets.front().at_mm + 3;
    while (at_mm < sheets.back().at_mm + 3) {
        const double db = kLamellaDb + kLamellaSpreadDb * (uniform() - 0.5);
        out.push_back({at_mm, db, kLamellaMm + kLamellaSpreadMm * uniform()});
        at_mm += kLamellaApartMm + kLamellaApartSpreadMm * uniform();
    }
}

std::vector<Sheet> with_lamellae(std::span<const Sheet> sheets) {
    std::vector<Sheet> all(sheets.begin(), sheets.end());
    add_lamellae(sheets, all);
    return all;
}

std::vector<float> table_of(std::span<const Sheet> sheets,
                            double scale,
                            double axial_mm,
                            const std::function<double(double)>& layer_scale) {
    double last = 0;
    for (const Sheet& s : sheets) last = std::max(last, s.at_mm + 5);
    std::vector<float> table(static_cast<std::size_t>((last + kWallBeforeMm) * kWallSteps), 0.0f);
    const auto add = [&](double at_mm, double db, double width_mm) {
        // The picture shows the sheet and the pulse together.
        const double seen = width_mm * scale;
        const double own = std::max(seen * seen - axial_mm * axial_mm, 0.09 * seen * seen);
        const double sigma = std::sqrt(own) / kFullWidthPerSigma;
        const double amplitude = std::pow(10.0, db / 20) * layer_scale(sigma);
        for (std::size_t i = 0; i < table.size(); ++i) {
            const double u = (static_cast<double>(i) / kWallSteps - kWallBeforeMm - at_mm) / sigma;
            if (std::abs(u) < 4) table[i] += static_cast<float>(amplitude * std::exp(-0.5 * u * u));
        }
    };
    for (const Sheet& s : sheets) {
        add(s.at_mm, s.db, s.width_mm);
        if (s.double_mm > 0) add(s.at_mm + s.double_mm, s.db + kDoubleDb, s.width_mm);
    }
    table.front() = table.back() = 0;
    return table;
}

}  // namespace

WallTables make_wall_tables(double frequency_mhz,
                            double axial_mm,
                            const std::function<double(double)>& layer_scale) {
    const bool fine = frequency_mhz > kFineMhz;
    const double scale = std::pow(3.5 / frequency_mhz, 0.7);
    WallTables t;
    const auto table = [&](std::span<const Sheet> sheets) {
        return table_of(sheets, scale, axial_mm, layer_scale);
    };
    if (fine) {
        t.outer = table(kOuterFine);
        t.inner = table(kInnerFine);
        t.wave_mm = 0.15;
        t.max_structure_db = kNoLimitDb;
        t.strength_db = 12;
        t.node_mm = 1.25;
    } else {
        t.outer = table(with_lamellae(kOuter));
        t.inner = table(with_lamellae(kInner));
        t.wave_mm = 0.25;
        t.own_wave_mm = 0.4;
        t.ground_db = 15;
        t.max_structure_db = -7;
        t.strength_db = 4;
    }
    return t;
}

}  // namespace sonocase::runtime::physical
