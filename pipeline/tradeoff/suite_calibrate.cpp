// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <random>

#include "formats/base/constants.h"
#include "formats/calibration/point.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {
namespace {

const Vector3 kTip{-17.8, 1.1, -156.9};
constexpr int kDraws = 25;

// A tool that rests on its tip and is tilted over a cone, read with uniform noise of +-1 mm.
std::vector<Pose> recording(int poses, double cone_rad, double outliers, std::uint64_t seed) {
    std::mt19937_64 engine(seed);
    const auto uniform = [&](double low, double high) {
        return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
    };
    std::vector<Pose> rows;
    for (int i = 0; i < poses; ++i) {
        const double around = uniform(-kPi, kPi), tilt = 0.5 * cone_rad * std::sqrt(uniform(0, 1));
        const Matrix3 r = rotation_about({std::cos(around), std::sin(around), 0}, tilt) *
                          rotation_about({0, 0, 1}, uniform(-kPi, kPi));
        Vector3 t = Vector3{100, -50, 400} - r * kTip;
        const double wild = uniform(0, 1) < outliers ? 40 : 1;
        for (int a = 0; a < 3; ++a) t[a] += wild * uniform(-1, 1);
        rows.push_back({i, i / 60.0, true, {r, t}});
    }
    return rows;
}

Result<Measured> measure_point(const Settings& settings) {
    int poses = 100, trials = PointOptions{}.trials;
    double cone_deg = 60, outliers = 0.1;
    bool paper = false;
    for (const Setting& s : settings) {
        if (s.key == "calibrate.poses") poses = std::stoi(s.value);
        if (s.key == "calibrate.cone_deg") cone_deg = std::stod(s.value);
        if (s.key == "calibrate.trials") trials = std::stoi(s.value);
        if (s.key == "calibrate.solver") paper = s.value == "paper";
    }
    std::vector<double> errors;
    double seconds = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
        const auto rows = recording(poses, cone_deg * kPi / 180, outliers,
                                    100 + static_cast<std::uint64_t>(draw));
        PointOptions options;
        options.rests = RestSearch::one;
        options.trials = trials;
        const Stopwatch watch;
        Vector3 tip;
        if (paper) {
            tip = fit_point_paper(rows);
        } else {
            tip = fit_point(rows, options).tip_mm;
        }
        seconds += watch.seconds() / kDraws;
        errors.push_back(norm(tip - kTip));
    }
    std::sort(errors.begin(), errors.end());
    return Measured{errors[errors.size() / 2], seconds, ""};
}

}  // namespace

Suite calibrate_suite() {
    Suite suite;
    suite.name = "calibrate";
    suite.title = "Probe point";
    suite.body = "synthetic-recordings";
    suite.error_name = "tip error, median of 25 recordings";
    suite.error_unit = "mm";
    suite.truth =
        "A tool 158 mm long pivots on its tip over a cone of 60 degrees. Its readings have uniform "
        "noise of +-1 mm, and one reading in ten is off by up to 40 mm. Seconds are those of the "
        "fit; taking the readings costs the user another 1/60 s each.";
    suite.knobs = {
        {"calibrate.poses",
         {"10", "30", "100", "300", "1000"},
         "100",
         "",
         "readings taken",
         "noise of the readings; falls as one over the square root",
         ""},
        {"calibrate.cone_deg",
         {"10", "20", "40", "60", "90"},
         "60",
         "degrees",
         "full angle of the cone over which the tool is tilted",
         "how well the tip is determined",
         "tilting further costs the fit no time",
         "a wider cone is hard for the hand, though not for the fit"},
        {"calibrate.trials",
         {"10", "50", "100", "400", "1600"},
         "400",
         "",
         "random starts of the robust fit",
         "the chance that outliers win",
         "with one outlier in ten, few starts are enough",
         "one reading in ten is off here, but a hand that slips spoils a third of the readings"},
    };
    suite.named = {
        {TrialRole::paper,
         "paper, eq. (13), 30 readings",
         {{"calibrate.solver", "paper"}, {"calibrate.poses", "30"}}},
        {TrialRole::peer, "plain least squares, 100 readings", {{"calibrate.solver", "paper"}}}};
    suite.measure = measure_point;
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
