// SPDX-License-Identifier: Apache-2.0

// What a fit says of its own error, against errors that are known: bodies carried by maps whose
// inside is known, swept wholly or in part, with and without landmarks.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "pipeline/registration/fit/point_index.h"
#include "support/fit_report.h"
#include "support/hard_case.h"
#include "support/torso_builds.h"
#include "support/warped_skin.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;

struct Body {
    LabelVolume labels;
    SkinSurfaceResult skin;
    std::map<std::string, std::vector<Point3>> organs;  // about 60 points of each
};

Body body_of(const AnalyticBody& shape) {
    Body b;
    b.labels = sample_analytic_torso(analytic_torso_grid({3, 3, 3}), shape);
    b.skin = *extract_skin_surface(b.labels);
    const Grid& grid = b.labels.grid;
    std::vector<std::size_t> voxels(256, 0), seen(256, 0);
    for (const std::uint8_t v : b.labels.voxels) ++voxels[v];
    std::size_t n = 0;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i) {
                const std::uint8_t v = b.labels.voxels[n++];
                const std::size_t stride = 1 + voxels[v] / 60;
                if (v == 0 || seen[v]++ % stride != stride / 2) continue;
                b.organs[b.labels.labels[v].name].push_back(
                    grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k}));
            }
        }
    }
    return b;
}

// The standard torso, a slighter one, a heavier one: on their maps the factors were calibrated.
// Then three bodies that they are judged on.
const Body& body(std::size_t which) {
    static std::map<std::size_t, Body> bodies;
    constexpr struct {
        double width, depth, belly_mm;
    } kShapes[] = {{1, 1, 12},      {0.85, 0.9, 12}, {1.15, 1.2, 30},
                   {0.95, 1.15, 5}, {1.1, 0.85, 20}, {0.8, 0.8, 0}};
    const auto found = bodies.find(which);
    if (found != bodies.end()) return found->second;
    AnalyticBody shape;
    shape.width_scale = kShapes[which].width;
    shape.depth_scale = kShapes[which].depth;
    shape.belly_mm = kShapes[which].belly_mm;
    return bodies.emplace(which, body_of(shape)).first->second;
}

// A quadratic, and before it, in every second case, a skin of another build that fades with depth:
// fat takes the difference, as the organs stay.
struct KnownTruth {
    Registration quadratic;
    const Body* patient = nullptr;
    bool built = false;
    Build build = Build::belly;
    double amplitude = 0, fade_mm = 60, shift_mm = 0;
    Point3 centre;
    PointIndex index;

    Point3 operator()(Point3 x) const {
        if (built) {
            const Vector3 d = x - centre;
            const double r = std::max(1e-6, std::hypot(d.x, d.y));
            const std::uint32_t n = index.nearest(x);
            const Vector3 e = x - patient->skin.skin.points[n];
            const double depth = dot(e, patient->skin.skin.normals[n]) < 0 ? norm(e) : 0;
            const double offset = amplitude *
                                  build_offset_mm(build, d.y / r, d.x / r, d.z, shift_mm) *
                                  std::exp(-depth * depth / (fade_mm * fade_mm));
            x = x + offset * Vector3{d.x / r, d.y / r, 0};
        }
        return mannequin_from_ct(quadratic, x);
    }
};

struct KnownCase {
    KnownTruth truth;
    Surface sweep;
    RegisterOptions options;
};

// Which bodies and builds: those of the calibration, or others.
enum class Kind { calibrated, others };

KnownCase known_case(int n, std::uint64_t seed = 1, Kind kind = Kind::calibrated) {
    KnownCase c;
    Random random(1000 * seed + static_cast<std::uint64_t>(n));
    KnownTruth& truth = c.truth;
    const bool others = kind == Kind::others;
    truth.patient = &body(static_cast<std::size_t>(n % 3 + (others ? 3 : 0)));
    const SkinSurfaceResult& skin = truth.patient->skin;
    const double means[] = {4, 9, 14};
    truth.quadratic = random_quadratic_map(skin.box, skin.skin, random, means[(n / 5) % 3]);
    truth.centre = skin.box.centre();
    truth.index = PointIndex(skin.skin.points);
    if (n % 2 == 1) {
        const struct {
            Build build;
            double largest_mm;
        } builds[] = {{others ? Build::pregnant : Build::belly, others ? 75.0 : 45.0},
                      {Build::wide, 30},
                      {others ? Build::huge : Build::slim, others ? 90.0 : 25.0},
                      {Build::pear, 40},
                      {Build::gaunt, 50}};
        const auto& [build, largest_mm] = builds[(n / 2) % 5];
        truth.built = true;
        truth.build = build;
        truth.fade_mm = random.uniform(50, 100);
        // Slopes below 0.55: space does not fold.
        truth.amplitude =
            random.uniform(0.3, 1) * std::min(1.0, 0.55 * truth.fade_mm / (0.86 * largest_mm));
        truth.shift_mm = random.uniform(-20, 20);
    }
    const int part = (n / 3) % 4, counts[] = {500, 2000, 1000, 1500};
    const double noise_mm = 0.5 + 0.5 * (n % 3);
    const Box3 box = skin.box;
    const AreaSampler sampler(skin.skin);
    while (static_cast<int>(c.sweep.points.size()) < counts[n % 4]) {
        const auto [p, facing, corner] = sampler.draw(random);
        if (part == 1 && p.y < truth.centre.y) continue;                    // the front
        if (part == 2 && p.z < box.lower.z + box.extent().z / 3) continue;  // upper two thirds
        const Vector3 noise{random.gaussian(), random.gaussian(), random.gaussian()};
        c.sweep.points.push_back(truth(p) + noise_mm * noise);
    }
    const auto error = [&](double size) {
        return size * Vector3{random.gaussian(), random.gaussian(), random.gaussian()};
    };
    c.options.up =
        normalized(truth.quadratic.mannequin_from_ct.rotation * Vector3{0, 0, 1} + error(0.1));
    if ((n / 2) % 2 == 1) {
        for (const double height : {0.55, 0.12}) {
            const double z = box.lower.z + height * box.extent().z;
            const auto front = std::max_element(
                skin.skin.points.begin(), skin.skin.points.end(), [&](Point3 a, Point3 b) {
                    const auto score = [&](Point3 p) {
                        return p.y - 3 * std::abs(p.z - z) - 3 * std::abs(p.x - truth.centre.x);
                    };
                    return score(a) < score(b);
                });
            c.options.landmarks.push_back({"mark" + std::to_string(c.options.landmarks.size()),
                                           *front, truth(*front) + error(3)});
        }
    }
    return c;
}

// Root mean square over a structure.
double error_mm(const KnownCase& c, const Registration& map, const std::string& label) {
    const std::vector<Point3>& points = c.truth.patient->organs.at(label);
    double sum = 0;
    for (Point3 p : points) {
        const Vector3 d = mannequin_from_ct(map, p) - c.truth(p);
        sum += dot(d, d);
    }
    return std::sqrt(sum / static_cast<double>(points.size()));
}

struct Held {
    int turned = 0;  // cases that lie the other way round, which is said and not counted
    int structures = 0, median = 0, p90 = 0, p95 = 0, covariance90 = 0, refits90 = 0;
    std::vector<double> errors_mm, said_mm;
};

// Fits one case and counts the structures whose error lies within what was said.
void count(int n,
           const char* uncertainty,
           Held* held,
           std::uint64_t seed = 1,
           Kind kind = Kind::calibrated) {
    KnownCase c = known_case(n, seed, kind);
    c.options.uncertainty = uncertainty;
    const Body& patient = *c.truth.patient;
    const auto fitted = register_surfaces({patient.skin, c.sweep, &patient.labels}, c.options);
    ASSERT_TRUE(fitted) << fitted.error().message();
    if (std::getenv("SONOCASE_SHOW")) {
        std::printf("case %d, score %.2f mm, coverage %.2f, of the skin %.2f\n", n,
                    measure(*fitted, "pose_score_mm"), fitted->fit.coverage,
                    fitted->fit.skin_coverage);
        for (const RunnerUp& r : fitted->runners_up)
            std::printf("  or %s, score %.2f mm, coverage %.2f\n", r.described.c_str(), r.score_mm,
                        r.coverage);
    }
    // What is said of places holds for the pose that was taken. Where a body has no front or no
    // head that its skin would show, the fit must say that.
    const Matrix3& truth = c.truth.quadratic.mannequin_from_ct.rotation;
    if (rotation_angle(transpose(truth) * fitted->registration.mannequin_from_ct.rotation) > 1.5) {
        ++held->turned;
        const auto is_untold = [](const Note& note) {
            return (note.name == "head" || note.name == "front") && !note.text.starts_with("right");
        };
        EXPECT_TRUE(
            std::any_of(fitted->report.notes.begin(), fitted->report.notes.end(), is_untold))
            << "case " << n << ": head " << note(*fitted, "head") << "; front "
            << note(*fitted, "front");
        return;
    }
    // Gaps go together where the true map is no quadratic.
    const double design_effect = measure(*fitted, "gap_design_effect");
    if (!c.truth.built) {
        EXPECT_LT(design_effect, 2.5) << "case " << n;  // of 60 known quadratics at most 2.01
    } else if (c.truth.build == Build::belly) {
        EXPECT_GT(design_effect, 2) << "case " << n;
    }
    for (const OrganUnknown& u : fitted->unknown) {
        const double error = error_mm(c, fitted->registration, u.label);
        ++held->structures;
        held->median += error <= u.median_mm;
        held->p90 += error <= u.p90_mm;
        held->p95 += error <= u.p95_mm;
        held->covariance90 += error <= u.covariance.p90_mm;
        held->refits90 += error <= u.refits.p90_mm;
        held->errors_mm.push_back(error);
        held->said_mm.push_back(u.p90_mm);
        if (std::getenv("SONOCASE_SHOW"))
            std::printf("case %d %s %s: error %.2f, said %.2f %.2f, covariance %.2f, refits %.2f\n",
                        n, c.truth.built ? build_name(c.truth.build).c_str() : "quadratic",
                        u.label.c_str(), error, u.median_mm, u.p90_mm, u.covariance.p90_mm,
                        u.refits.p90_mm);
    }
}

// Four of the sixty, which are structures of two quadratics and of two bellies: of so few the share
// that is held lies within a quarter of the 90 % that are said.
TEST(FitUnknown, HoldsTheErrorOfKnownMaps) {
    Held held;
    for (const int n : {1, 2, 8, 11}) count(n, "off", &held);
    EXPECT_GT(held.structures, 40);
    HardCase share("share of structures within what 90 % are said to be, four fits",
                   HardCase::at_least, 0.65, "");
    share.see(static_cast<double>(held.p90) / held.structures);
    EXPECT_LE(held.median, held.p90);
}

// A slim mannequin read from the front, its head direction a little off: the right pose then fits
// worse than one that has slid 290 mm along the body and keeps 7 % of the readings.
TEST(FitUnknown, APoseThatHasSlidOffItsReadingsIsNotTaken) {
    const KnownCase c = known_case(5, 2);
    const auto aligned = align_surfaces({c.truth.patient->skin, c.sweep}, c.options);
    ASSERT_TRUE(aligned);
    HardCase reached("share of readings that the pose taken reaches", HardCase::at_least, 0.5, "");
    reached.see(measure(*aligned, "rigid_coverage"));
}

// The only fit that the search finds has slid along the body: its residuals are small, and what it
// says of its error must not be.
TEST(FitUnknown, AFitThatHasSlidOffItsReadingsKnowsHowFarTheyAre) {
    const KnownCase c = known_case(33, 2, Kind::others);
    const auto fitted =
        register_surfaces({c.truth.patient->skin, c.sweep, &c.truth.patient->labels}, c.options);
    ASSERT_TRUE(fitted) << fitted.error().message();
    EXPECT_LT(fitted->fit.coverage, 0.5);
    EXPECT_LT(fitted->fit.skin_coverage, 0.5);
    // The head is given rightly, and the search found a better fit the other way.
    EXPECT_TRUE(note(*fitted, "head").starts_with("not told")) << note(*fitted, "head");
    HardCase slid("error of any structure over the 90 % said of it, slid off the readings",
                  HardCase::at_most, 1, "");
    for (const OrganUnknown& u : fitted->unknown)
        slid.see(error_mm(c, fitted->registration, u.label) / u.p90_mm);
}

// A mannequin of another build, read all round, fits 11 % better with its front to the back.
TEST(FitUnknown, AFrontThatFitsATenthBetterIsNotCalledRight) {
    const KnownCase c = known_case(9, 2, Kind::others);
    const auto aligned = align_surfaces({c.truth.patient->skin, c.sweep}, c.options);
    ASSERT_TRUE(aligned);
    EXPECT_TRUE(note(*aligned, "front").starts_with("not told by the skin"))
        << note(*aligned, "front");
}

TEST(FitUnknown, TheLargerOfTwoWaysIsSaid) {
    KnownCase c = known_case(4);
    c.options.uncertainty = "on";
    c.options.refits = 3;
    const Body& patient = *c.truth.patient;
    const auto fitted = register_surfaces({patient.skin, c.sweep, &patient.labels}, c.options);
    ASSERT_TRUE(fitted) << fitted.error().message();
    ASSERT_FALSE(fitted->unknown.empty());
    for (const OrganUnknown& u : fitted->unknown) {
        EXPECT_GT(u.covariance.p90_mm, 0) << u.label;
        EXPECT_GT(u.refits.p90_mm, 0) << u.label;
        EXPECT_EQ(u.p90_mm, std::max(u.covariance.p90_mm, u.refits.p90_mm)) << u.label;
        EXPECT_LT(u.median_mm, u.p90_mm) << u.label;
        EXPECT_LT(u.p90_mm, u.p95_mm) << u.label;
        if (c.options.landmarks.empty()) {
            EXPECT_GT(u.p90_with_landmarks_mm, 0) << u.label;
        }
    }
    // The map itself does not depend on it.
    c.options.uncertainty = "off";
    const auto plain = register_surfaces({patient.skin, c.sweep, &patient.labels}, c.options);
    ASSERT_TRUE(plain);
    EXPECT_EQ(plain->registration.residual.control_mm, fitted->registration.residual.control_mm);
}

// Sixty fits with known truth: nine in ten structures lie within what is said of nine in ten. Fits
// of one body share their error, so that the share of sixty is known to some 4 %.
void calibration(const char* uncertainty, Kind kind) {
    const char* given = std::getenv("SONOCASE_CALIBRATION_SEED");
    const std::uint64_t seed = given ? std::strtoull(given, nullptr, 10) : 1;
    const char* one = std::getenv("SONOCASE_CALIBRATION_CASE");
    Held held;
    for (int n = 0; n < 60; ++n)
        if (!one || n == std::atoi(one)) count(n, uncertainty, &held, seed, kind);
    const auto share = [&](int part) { return 100.0 * part / std::max(1, held.structures); };
    const auto median = [](std::vector<double> v) {
        if (v.empty()) return 0.0;
        std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
        return v[v.size() / 2];
    };
    std::printf(
        "%d cases turned, and said so; %d structures, median error %.1f mm, said %.1f mm (90 %%); "
        "held by the median %.1f %%, 90 %%: %.1f %%, 95 %%: %.1f %%; the covariance alone (90 %%) "
        "%.1f %%, the refits alone %.1f %%\n",
        held.turned, held.structures, median(held.errors_mm), median(held.said_mm),
        share(held.median), share(held.p90), share(held.p95), share(held.covariance90),
        share(held.refits90));
    EXPECT_GE(share(held.p90), 85);
    EXPECT_LE(share(held.p90), 95);
}

// Turned front to back this body fits 3 % worse after the warp and 5 % better before it.
TEST(FitUnknown, ABodyThatFitsAlmostAsWellTheOtherWayRoundLiesAsItDoes) {
    const KnownCase c = known_case(13, 2, Kind::others);
    const auto fitted = align_surfaces({c.truth.patient->skin, c.sweep}, c.options);
    ASSERT_TRUE(fitted) << fitted.error().message();
    const Matrix3& truth = c.truth.quadratic.mannequin_from_ct.rotation;
    EXPECT_LT(rotation_angle(transpose(truth) * fitted->registration.mannequin_from_ct.rotation),
              0.5);
    EXPECT_TRUE(note(*fitted, "front").starts_with("not told")) << note(*fitted, "front");
}

// The measurements behind docs/numerics.md: run with --gtest_also_run_disabled_tests.
// SONOCASE_CALIBRATION_SEED  another sixty maps and sweeps; 1 by default
// SONOCASE_CALIBRATION_CASE  one of them alone
// SONOCASE_SHOW=1            error of each structure, and what was said of it
TEST(FitUnknown, DISABLED_CalibrationOfSixtyFits) {
    calibration("on", Kind::calibrated);
}

// The head direction of those, as it is and with its sign turned, without landmarks.
TEST(FitUnknown, DISABLED_HeadsOfSixtyOtherBodies) {
    const char* given = std::getenv("SONOCASE_CALIBRATION_SEED");
    const std::uint64_t seed = given ? std::strtoull(given, nullptr, 10) : 1;
    const char* one = std::getenv("SONOCASE_CALIBRATION_CASE");
    int alarms = 0, right = 0, named = 0, called_right = 0;
    for (int n = 0; n < 60; ++n) {
        if (one && n != std::atoi(one)) continue;
        KnownCase c = known_case(n, seed, Kind::others);
        c.options.landmarks.clear();
        for (const double sign : {1.0, -1.0}) {
            c.options.up = sign * *c.options.up;
            const auto aligned = align_surfaces({c.truth.patient->skin, c.sweep}, c.options);
            ASSERT_TRUE(aligned);
            const std::string said = note(*aligned, "head");
            (sign > 0 ? alarms : named) += said.starts_with("wrong");
            (sign > 0 ? right : called_right) += said.starts_with("right");
            std::printf("case %d, %s: %s\n", n, sign > 0 ? "right" : "turned", said.c_str());
        }
    }
    std::printf(
        "of 60 right heads %d called right, %d wrong; of 60 turned ones %d named, %d called "
        "right\n",
        right, alarms, named, called_right);
    EXPECT_EQ(alarms, 0);
}

TEST(FitUnknown, DISABLED_SixtyFitsOfOtherBodies) {
    calibration("on", Kind::others);
}

}  // namespace
}  // namespace sonocase::pipeline
