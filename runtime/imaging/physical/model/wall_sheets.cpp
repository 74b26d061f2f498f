// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/wall_sheets.h"

#include <cmath>
#include <span>

namespace sonocase::runtime::physical {
namespace {

struct Sheet {
    double at_mm, db, width_mm;  // over liver; full width at half height in the picture at 3.5 MHz
    double double_mm = 0;        // > 0: a second sheet, so much deeper, kDoubleDb weaker
};

constexpr double kDoubleDb = -4;

// Below the skin: its two faces, then sheets of the fat.
constexpr Sheet kOuter[] = {
    {0.8, 9, 1.1},        {2.8, 8, 1.0}, {7.0, 10, 1.2, 1.4}, {12.4, 9, 1.1},
    {17.8, 10, 1.4, 1.7}, {25, 8, 1.3},  {33, 8, 1.4},
};
// Above the organs: the peritoneum, then the sheets of three muscles.
constexpr Sheet kInner[] = {
    {1.4, 18, 1.5}, {4.6, 12, 1.2, 1.3}, {8.6, 12, 1.3}, {12.6, 11, 1.3, 1.5}, {17, 8, 1.2},
};
// What a pulse of a third of the length shows: septa of fat and fasciae, thin and many.
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

std::vector<float> table_of(std::span<const Sheet> sheets,
                            double scale,
                            double axial_mm,
                            const std::function<double(double)>& layer_scale) {
    const double last = sheets.back().at_mm + 5;
    std::vector<float> table(static_cast<std::size_t>((last + kWallBeforeMm) * kWallSteps), 0.0f);
    const auto add = [&](double at_mm, double db, double width_mm) {
        // The picture shows the sheet and the pulse together.
        constexpr double kFwhmPerSigma = 2.3548200450309493;
        const double seen = width_mm * scale;
        const double own = std::max(seen * seen - axial_mm * axial_mm, 0.09 * seen * seen);
        const double sigma = std::sqrt(own) / kFwhmPerSigma;
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
    t.outer =
        table_of(fine ? std::span<const Sheet>(kOuterFine) : kOuter, scale, axial_mm, layer_scale);
    t.inner =
        table_of(fine ? std::span<const Sheet>(kInnerFine) : kInner, scale, axial_mm, layer_scale);
    if (fine) {
        t.wave_mm = 0.15;
        t.strength_db = 12;
        t.node_mm = 1.25;
    }
    return t;
}

}  // namespace sonocase::runtime::physical
