// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/wall_sheets.h"

#include <cmath>
#include <cstdint>
#include <span>

#include "formats/base/constants.h"
#include "runtime/imaging/core/noise.h"

namespace sonocase::runtime::physical {
namespace {

// How sheets of one kind change along their course. Deviations; turns: of the slowest wave in a
// unit of the course, some 10 mm of tissue.
struct Course {
    double rise_mm = 0, fade_db = 0, widen = 0;  // widen: log2 of the width
    double rise_turns = 0.3, fade_turns = 0.4;
};

struct Sheet {
    // db: over liver; width_mm: full width at half height in the picture at 3.5 MHz.
    double at_mm, db, width_mm;
    Course course;
    double double_mm = 0;  // > 0: a second sheet, this much deeper, kDoubleDb weaker
};

constexpr double kDoubleDb = -4;
constexpr double kMaxFadeDb = 4;      // no sheet is brighter by more than this in any place
constexpr double kCoursePerMm = 0.1;  // slope of the noise, deviation

constexpr Course kSkin{0.05, 1.5, 0.2}, kLining{0.15, 2.5, 0.3};
constexpr Course kFascia{0.9, 3, 0.5, 0.2, 0.25};    // between muscles
constexpr Course kSeptum{1.3, 5, 0.5, 0.25, 0.32};   // in fat
constexpr Course kStrand{0.4, 5.5, 0.4, 0.22, 0.5};  // of muscle, along its fascia

// Below the skin: its faces, the superficial fascia, then sheets of the fat.
constexpr Sheet kOuter[] = {
    {0.5, 2, 1.1, kSkin},       {6.2, 9.5, 1.1, kFascia}, {16.5, 5.5, 0.95, kSeptum},
    {18.4, 2.5, 0.95, kSeptum}, {27.5, 3.5, 1, kSeptum},  {35, 3, 1, kSeptum},
};
// Above the organs: the peritoneum, then the sheets of three muscles.
constexpr Sheet kInner[] = {
    {1.4, 11, 1.2, kLining},   {2.7, 4.5, 0.85, kFascia}, {6.2, 8.5, 1, kFascia},
    {7, 1, 0.95, kFascia},     {8.3, 1.5, 0.95, kFascia}, {12.6, 5.5, 0.95, kFascia},
    {18.5, 6.5, 1.1, kFascia}, {22, 3, 1.1, kFascia},
};
// Lamellae of fat and strands of muscle between them, at random distances.
constexpr double kLamellaDb = 4.5, kLamellaSpreadDb = 10;
constexpr double kLamellaApartMm = 0.7, kLamellaApartSpreadMm = 1.2;
constexpr double kLamellaMm = 0.75, kLamellaSpreadMm = 0.4;

// Sheets that a pulse of a third of the length shows: septa of fat and fasciae, thin and many.
constexpr Course kFineLining{0.1, 6, 0.15}, kFineFascia{0.2, 12, 0.15, 0.2, 0.4};
constexpr Sheet kOuterFine[] = {
    {0.5, 12, 0.9, kSkin},
    {9.5, 14, 1, kFineFascia, 1.1},
};
// The peritoneum and the sheets of three muscles.
constexpr Sheet kInnerFine[] = {
    {1.0, 18, 1.1, kFineLining},
    {4.6, 15, 1, kFineFascia, 1.0},
    {8.6, 15, 1, kFineFascia, 1.1},
    {12.6, 14, 1, kFineFascia, 1.2},
};
constexpr double kFineMhz = 6;
constexpr int kNoLimitDb = 100;

// Adds faint sheets from the first to beyond the last of `sheets`.
std::vector<Sheet> with_lamellae(std::span<const Sheet> sheets, const Course& course) {
    std::vector<Sheet> all(sheets.begin(), sheets.end());
    std::uint32_t drawn = 71 * static_cast<std::uint32_t>(sheets.size());
    const auto uniform = [&] { return (hash32(++drawn) >> 8) / 16777216.0; };
    double at_mm = sheets.front().at_mm + 3;
    while (at_mm < sheets.back().at_mm + 3) {
        const double db = kLamellaDb + kLamellaSpreadDb * (uniform() - 0.5);
        all.push_back({at_mm, db, kLamellaMm + kLamellaSpreadMm * uniform(), course});
        at_mm += kLamellaApartMm + kLamellaApartSpreadMm * uniform();
    }
    return all;
}

// What a sheet does along its course: two waves of unit deviation together.
class CourseWave {
  public:
    CourseWave(std::uint32_t seed, double turns) : turns_{turns, 2.3 * turns} {
        for (double& p : phase_) p = (hash32(++seed) >> 8) / 16777216.0;
    }
    double at(double course) const { return wave(0, course) + 0.6 * wave(1, course); }
    double slope(double course) const {
        constexpr double kStep = 0.01;
        return (at(course + kStep) - at(course - kStep)) / (2 * kStep);
    }

  private:
    double wave(int number, double course) const {
        return 1.21 * std::sin(2 * kPi * (turns_[number] * course + phase_[number]));
    }
    double turns_[2], phase_[2];
};

// layer_scale, between deviations that it was asked for: a table has thousands of them.
class LayerScale {
  public:
    explicit LayerScale(const std::function<double(double)>& exact) {
        for (int i = 0; i < kCount; ++i) at_[i] = exact(kFirstMm * std::exp2(i / kPerOctave));
    }
    double at(double mm) const {
        const double i = std::clamp(kPerOctave * std::log2(mm / kFirstMm), 0.0, kCount - 1.001);
        const int n = static_cast<int>(i);
        return at_[n] + (at_[n + 1] - at_[n]) * (i - n);
    }

  private:
    static constexpr int kCount = 48;
    static constexpr double kFirstMm = 0.02, kPerOctave = 7;  // to 2 mm
    double at_[kCount];
};

SheetTable table_of(std::span<const Sheet> sheets,
                    double scale,
                    int steps_per_mm,
                    double axial_mm,
                    const LayerScale& layer_scale) {
    double last = 0;
    for (const Sheet& s : sheets) last = std::max(last, s.at_mm + 5);
    SheetTable table;
    table.steps = static_cast<int>((last + kWallBeforeMm) * steps_per_mm);
    table.echo.assign(static_cast<std::size_t>(table.steps) * kWallCourses, 0.0f);
    // In the row of a course, from its second step to the last but one.
    const auto add = [&](float* row, double at_mm, double amplitude, double sigma) {
        const auto step = [&](double mm) {
            return std::clamp(static_cast<int>((mm + kWallBeforeMm) * steps_per_mm), 1,
                              table.steps - 1);
        };
        for (int i = step(at_mm - 4 * sigma); i < step(at_mm + 4 * sigma); ++i) {
            const double u =
                (static_cast<double>(i) / steps_per_mm - kWallBeforeMm - at_mm) / sigma;
            row[i] += static_cast<float>(amplitude * std::exp(-0.5 * u * u));
        }
    };
    std::uint32_t seed = 977 * static_cast<std::uint32_t>(sheets.size());
    for (const Sheet& s : sheets) {
        const CourseWave rise(seed += 8, s.course.rise_turns), fade(seed += 8, s.course.fade_turns),
            widen(seed += 8, s.course.fade_turns);
        for (int number = 0; number < kWallCourses; ++number) {
            const double course = (number + 0.5 - 0.5 * kWallCourses) / kCoursesPerUnit;
            const double at_mm = s.at_mm + s.course.rise_mm * rise.at(course);
            const double slope = s.course.rise_mm * rise.slope(course) * kCoursePerMm;
            const double cosine2 = 1 / (1 + slope * slope);
            const double db = s.db + std::min(s.course.fade_db * fade.at(course), kMaxFadeDb);
            // The picture shows the sheet and the pulse together.
            const double seen = s.width_mm * scale * std::exp2(s.course.widen * widen.at(course));
            const double own = std::max(seen * seen - axial_mm * axial_mm, 0.09 * seen * seen);
            const double sigma = std::sqrt(own) / kFullWidthPerSigma;
            const double amplitude =
                std::pow(10.0, db / 20) * cosine2 * cosine2 * layer_scale.at(sigma);
            float* row = table.echo.data() + static_cast<std::ptrdiff_t>(number) * table.steps;
            add(row, at_mm, amplitude, sigma);
            if (s.double_mm > 0)
                add(row, at_mm + s.double_mm, amplitude * std::pow(10.0, kDoubleDb / 20), sigma);
        }
    }
    return table;
}

}  // namespace

WallTables make_wall_tables(double frequency_mhz,
                            double axial_mm,
                            const std::function<double(double)>& layer_scale) {
    const bool fine = frequency_mhz > kFineMhz;
    const double scale = std::pow(3.5 / frequency_mhz, 0.7);
    WallTables t;
    t.steps_per_mm = fine ? 32 : 16;
    const LayerScale scales(layer_scale);
    const auto table = [&](std::span<const Sheet> sheets) {
        return table_of(sheets, scale, t.steps_per_mm, axial_mm, scales);
    };
    if (fine) {
        t.outer = table(kOuterFine);
        t.inner = table(kInnerFine);
        t.wave_mm = 0.15;
        t.max_structure_db = kNoLimitDb;
        t.node_mm = 1.25;
    } else {
        t.outer = table(with_lamellae(kOuter, kSeptum));
        t.inner = table(with_lamellae(kInner, kStrand));
        t.wave_mm = 0.25;
        t.own_wave_mm = 0.4;
        t.ground_db = 15;
        t.max_structure_db = -7;
    }
    return t;
}

}  // namespace sonocase::runtime::physical
