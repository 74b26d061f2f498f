// SPDX-License-Identifier: Apache-2.0

// Needles of all makes, turned through the angles in frames and measured as van de Berg et al.
// measured pictures (formats/exercise/needle_makes.h): contrast to noise of shaft and tip.
#include "formats/exercise/needle_makes.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <numeric>

#include "imaging_support.h"

namespace sonocase::runtime {
namespace {

constexpr int kRecordings = 4;    // of each angle, in other speckle; water has none
constexpr double kMiddleMm = 30;  // depth of the middle of the shaft
constexpr double kAheadMm = 14;   // of the tip before that middle
constexpr double kShaftMm = 6;    // of the shaft to each side of the middle that is measured
constexpr double kTipMm = 1;      // of the tip

// Gain at which tissue has the grey of a picture as it opens (98; docs/effects.md, compression): in
// this scene time gain exceeds the tissue's loss. Where it is higher, the mirror is white far off
// its middle, which widens the lobe, and contrast to noise is half of the measured one.
constexpr double kTissueGainDb = -3;
// In water, what sound no longer loses down to the shaft and back is taken off, so that the needle
// is as bright as in tissue: 2 (0.50 - 0.23) dB/cm/MHz, 3 cm, 8 MHz.
constexpr double kWaterGainDb = kTissueGainDb - 13;

Exercise linear_exercise(const NeedleMake& make) {
    Exercise e = sonocase::testing::phantom_linear_exercise();
    e.probe.width_mm = 50;
    e.probe.depth_mm = 55;
    e.probe.focus_mm = 30;
    e.needle.make = &make;
    e.needle.diameter_mm = make.diameter_mm;
    return e;
}

double median(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    const std::size_t n = v.size();
    return n % 2 == 1 ? v[n / 2] : 0.5 * (v[n / 2 - 1] + v[n / 2]);
}

struct Point {
    double off_deg;               // of the shaft from the right angle to the beams
    double shaft, towards, away;  // contrast to noise
    double around, deviation;     // grey of what surrounds it
};

struct Curve {
    double peak = 0, width_deg = 0, floor = 0, towards = 0, away = 0;
    double around = 0;      // grey of what surrounds the needle
    double around_cnr = 0;  // the same above black, in its own deviations
};

// Grey along a stretch: the brightest of a band as wide as the needle.
std::vector<double> grey_along(const std::vector<std::uint8_t>& picture,
                               const Renderer::Layout& layout,
                               Point3 from,
                               Point3 to,
                               double half_mm) {
    const Vector3 way = to - from, along = normalized(way);
    const Vector3 across{-along.z, 0, along.x};
    std::vector<double> grey;
    const int steps = std::max(2, static_cast<int>(norm(way) / layout.mm_per_px));
    const int side = static_cast<int>(half_mm / layout.mm_per_px);
    for (int i = 0; i < steps; ++i)
        for (int j = -side; j <= side; ++j) {
            const Point3 p = from + (i + 0.5) / steps * way + j * layout.mm_per_px * across;
            const int x = static_cast<int>(layout.origin_x_px + p.x / layout.mm_per_px);
            const int y = static_cast<int>(layout.origin_y_px + p.z / layout.mm_per_px);
            if (x < 0 || y < 0 || x > 511 || y > 511) continue;
            grey.push_back(picture[static_cast<std::size_t>(y) * 512 + x]);
        }
    return grey;
}

double mean(const std::vector<double>& v) {
    return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}

double deviation(const std::vector<double>& v) {
    const double m = mean(v);
    double sum = 0;
    for (const double x : v) sum += (x - m) * (x - m);
    return std::sqrt(sum / static_cast<double>(v.size()));
}

std::vector<Point> turn_needle(const CaseBundle& bundle,
                               const Exercise& exercise,
                               double gain_db,
                               int recordings = kRecordings) {
    auto renderer = Renderer::create(bundle, exercise, {});
    EXPECT_TRUE(renderer.has_value());
    const double half = 0.5;
    const auto input_of = [&](int n) {
        FrameInput input;
        input.mannequin_from_probe.translation = {2.0 * n, 3.0 * n, 0};
        input.frame = static_cast<std::uint32_t>(n);
        input.settings.gain_db = gain_db;
        return input;
    };
    std::vector<std::uint8_t> with(512 * 512);
    std::vector<std::vector<std::uint8_t>> without(static_cast<std::size_t>(recordings), with);
    for (int n = 0; n < recordings; ++n)
        renderer->render(input_of(n), without[static_cast<std::size_t>(n)]);
    std::vector<Point> curve;
    for (double off = -65; off <= 65; off += std::abs(off) < 20 ? 2.5 : 5) {
        const double a = off * kRadPerDeg;
        const Vector3 axis{std::cos(a), 0, std::sin(a)};
        const Point3 middle{0, 0, kMiddleMm};
        std::vector<double> shaft, tips[2], levels, spreads;
        for (int n = 0; n < recordings; ++n) {
            FrameInput input = input_of(n);
            input.has_needle = true;
            const Point3 tip = middle + kAheadMm * axis;
            input.needle.tip = input.mannequin_from_probe * tip;
            input.needle.direction = axis;
            const Vector3 up{std::sin(a), 0, -std::cos(a)};
            const auto around = grey_along(without[static_cast<std::size_t>(n)], renderer->layout(),
                                           middle - kShaftMm * axis, middle + kShaftMm * axis, 3);
            const double level = mean(around), spread = deviation(around);
            const auto contrast = [&](Point3 from, Point3 to) {
                return (mean(grey_along(with, renderer->layout(), from, to, half)) - level) /
                       spread;
            };
            for (int away = 0; away < 2; ++away) {
                input.needle.bevel = away ? -up : up;
                renderer->render(input, with);
                tips[away].push_back(contrast(tip - kTipMm * axis, tip));
            }
            shaft.push_back(contrast(middle - kShaftMm * axis, middle + kShaftMm * axis));
            levels.push_back(level);
            spreads.push_back(spread);
        }
        curve.push_back({off, median(shaft), median(tips[0]), median(tips[1]), median(levels),
                         median(spreads)});
    }
    return curve;
}

// The figures that the source's table gives: see needle_makes.h.
Curve figures(const std::vector<Point>& points) {
    Curve c;
    std::size_t top = 0;
    std::vector<double> off_mirror, towards, away;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i].shaft > points[top].shaft) top = i;
        const double off = std::abs(points[i].off_deg);
        if (off >= 30 && off <= 55) off_mirror.push_back(points[i].shaft);
        if (off >= 25) {
            towards.push_back(points[i].towards);
            away.push_back(points[i].away);
        }
    }
    c.peak = points[top].shaft;
    c.around = points[top].around;
    c.around_cnr = c.around / points[top].deviation;
    const double floor = median(off_mirror), half = 0.5 * (floor + c.peak);
    c.floor = floor / c.peak;
    c.towards = median(towards) / c.peak;
    c.away = median(away) / c.peak;
    const auto edge = [&](int step) {
        for (int i = static_cast<int>(top); i + step >= 0 && i + step < int(points.size());
             i += step) {
            const Point &in = points[i], &out = points[i + step];
            if (out.shaft < half)
                return in.off_deg +
                       (in.shaft - half) / (in.shaft - out.shaft) * (out.off_deg - in.off_deg);
        }
        return step * 90.0;
    };
    c.width_deg = edge(1) - edge(-1);
    return c;
}

const CaseBundle& tissue() {
    static const CaseBundle bundle = liver_alone({-60, -40, -10}, {60, 60, 80}, 1);
    return bundle;
}

CaseBundle water() {
    CaseBundle bundle = tissue();
    for (Tissue& t : bundle.tissues) {
        if (t.kind == TissueKind::outside) continue;
        t.kind = TissueKind::fluid;
        t.echo_db = -60;
        t.attenuation_db_cm_mhz = 0.01;
        t.structure_db = 0;
    }
    return bundle;
}

void report(const char* where, const NeedleMake& make, const Curve& c, double floor) {
    std::printf(
        "%-7s %-9s grey %5.1f  peak %5.1f  width %5.1f (%2.0f)  floor %.2f (%.2f)  tip %.2f (%.2f) "
        "%.2f (%.2f)\n",
        where, make.name, c.around, c.peak, c.width_deg, make.measured_width_deg, c.floor, floor,
        c.towards, make.measured_tip_towards, c.away, make.measured_tip_away);
}

TEST(NeedleMakes, ShowInTissueAsMeasured) {
    for (const NeedleMake& make : needle_makes()) {
        const Curve c = figures(turn_needle(tissue(), linear_exercise(make), kTissueGainDb));
        report("tissue", make, c, make.measured_floor);
        EXPECT_NEAR(c.around, 98, 12) << "not the grey of a picture as it opens";
        if (make.measured_width_deg > 0) {
            EXPECT_NEAR(c.width_deg, make.measured_width_deg, 3) << make.name;
        }
        EXPECT_NEAR(c.floor, make.measured_floor, 0.08) << make.name;
        EXPECT_NEAR(c.towards, make.measured_tip_towards, 0.25 * make.measured_tip_towards)
            << make.name;
        // A tip that is hardly above its surroundings: within a twentieth of the peak.
        EXPECT_NEAR(c.away, make.measured_tip_away, std::max(0.25 * make.measured_tip_away, 0.05))
            << make.name;
    }
}

// Nothing is fitted in water: the lobe is the needle's own. Its floor is not: in tissue contrast
// counts from the tissue's grey, in water from black. With P the measured contrast to noise of the
// peak, f the measured floor and T the tissue above black, all in deviations of the tissue, the
// needle off its mirror has f P + T of P + T.
double floor_in_water(const NeedleMake& make, double tissue_cnr) {
    struct Peak {
        const char* make;
        double cnr;
    };
    static constexpr Peak kMeasured[] = {{"chiba", 12.7},   {"trocar", 12.4},  {"rod", 10.2},
                                         {"nitinol", 12.0}, {"ablation", 9.9}, {"notched", 9.9}};
    for (const Peak& peak : kMeasured)
        if (std::string_view(make.name) == peak.make)
            return (make.measured_floor * peak.cnr + tissue_cnr) / (peak.cnr + tissue_cnr);
    ADD_FAILURE() << make.name << " has no measured peak";
    return 0;
}

TEST(NeedleMakes, ShowInWaterAsMeasured) {
    const CaseBundle bundle = water();
    // The tissue's grey and its deviation do not depend on the make.
    const Exercise first = linear_exercise(needle_makes().front());
    const double tissue_cnr = figures(turn_needle(tissue(), first, kTissueGainDb, 1)).around_cnr;
    for (const NeedleMake& make : needle_makes()) {
        const Curve c = figures(turn_needle(bundle, linear_exercise(make), kWaterGainDb, 1));
        const double floor = floor_in_water(make, tissue_cnr);
        report("water", make, c, floor);
        EXPECT_LT(c.around, 10) << "water is not black";
        if (make.measured_width_deg > 0) {
            EXPECT_NEAR(c.width_deg, make.measured_width_deg, 4) << make.name;
        }
        EXPECT_NEAR(c.floor, floor, 0.12) << make.name;
    }
}

TEST(NeedleMakes, AreFoundByName) {
    for (const NeedleMake& make : needle_makes()) EXPECT_EQ(find_needle_make(make.name), &make);
    EXPECT_EQ(find_needle_make("knitting"), nullptr);
    const auto given = parse_exercise("name = \"a\"\n[needle]\nmake = \"notched\"\n", "a.toml");
    ASSERT_TRUE(given.has_value());
    EXPECT_TRUE(given->needle.make->echogenic);
    EXPECT_EQ(needle_diameter_mm(given->needle), given->needle.make->diameter_mm);
    const auto gauged =
        parse_exercise("name = \"a\"\n[needle]\nmake = \"notched\"\ngauge = 22\n", "a.toml");
    ASSERT_TRUE(gauged.has_value());
    EXPECT_NEAR(needle_diameter_mm(gauged->needle), 0.717, 1e-9);
}

}  // namespace
}  // namespace sonocase::runtime
