// SPDX-License-Identifier: Apache-2.0

// Registration against known truth: the real CT's own skin carried by random poses and quadratics.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "formats/base/constants.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/registration/register_surfaces.h"
#include "support/hard_case.h"
#include "support/paths.h"
#include "support/warped_skin.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::HardCase;

using sonocase::testing::Random;
using sonocase::testing::SweepPlan;
using sonocase::testing::SweptPart;

struct Patient {
    SkinSurfaceResult skin;
    std::vector<Point3> inside;
};

// The CT patient; null where the data are absent.
const Patient* patient() {
    static const std::optional<Patient> read = []() -> std::optional<Patient> {
        const std::string path = SONOCASE_DATA "/ct/labels.nii.gz";
        if (!std::filesystem::exists(path)) return std::nullopt;
        const auto labels = import_label_map(path);
        if (!labels) return std::nullopt;
        Patient p{std::move(*extract_skin_surface(labels->labels)), {}};
        const Grid& grid = labels->labels.grid;
        for (int k = 2; k < grid.size.z; k += 6) {
            for (int j = 2; j < grid.size.y; j += 6) {
                for (int i = 2; i < grid.size.x; i += 6) {
                    if (labels->labels.voxels[grid.index(i, j, k)] != 0)
                        p.inside.push_back(grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k}));
                }
            }
        }
        return p;
    }();
    return read ? &*read : nullptr;
}

#define NEEDS_PATIENT() \
    if (patient() == nullptr) GTEST_SKIP() << "no " SONOCASE_DATA "/ct"

struct TargetError {
    double mean = 0, p95 = 0;
};
TargetError target_error(const Registration& fitted, const Registration& truth) {
    std::vector<double> error;
    for (Point3 p : patient()->inside)
        error.push_back(distance(mannequin_from_ct(fitted, p), mannequin_from_ct(truth, p)));
    std::sort(error.begin(), error.end());
    TargetError t;
    for (double e : error) t.mean += e / static_cast<double>(error.size());
    t.p95 = error[error.size() * 95 / 100];
    return t;
}

Registration rigid_part(const Registration& fitted) {
    Registration rigid = fitted;
    rigid.residual = {};
    rigid.quadratic = QuadraticMap::from_rigid(fitted.mannequin_from_ct, {}, 200);
    return rigid;
}

double measure(const RegisterResult& r, const std::string& name) {
    for (const Measure& m : r.report.measures) {
        if (m.name == name) return m.value;
    }
    ADD_FAILURE() << name;
    return -1;
}

std::string warnings_of(const RegisterResult& r) {
    std::string all;
    for (const std::string& w : r.report.warnings) all += w + "\n";
    return all;
}

struct Fitted {
    Registration truth;
    RegisterResult result;
};
Fitted fit(std::uint64_t seed,
           double mean_mm,
           const SweepPlan& plan,
           RegisterOptions options = {}) {
    Random random(seed);
    Fitted f;
    f.truth =
        testing::random_quadratic_map(patient()->skin.box, patient()->skin.skin, random, mean_mm);
    const Surface sweep = testing::sweep_of(patient()->skin.skin, f.truth, random, plan);
    auto result = register_surfaces({patient()->skin, sweep}, options);
    EXPECT_TRUE(result) << result.error().message();
    if (result) f.result = std::move(*result);
    return f;
}

TEST(KnownMap, TheInsideComesBackAndTheInverseClosesTheLoop) {
    NEEDS_PATIENT();
    for (std::uint64_t seed : {1, 2}) {
        SCOPED_TRACE(::testing::Message() << "seed " << seed);
        const Fitted f = fit(seed, 9, {});
        const TargetError error = target_error(f.result.registration, f.truth);
        const TargetError rigid = target_error(rigid_part(f.result.registration), f.truth);
        EXPECT_LT(error.mean, 1.2);
        EXPECT_LT(error.p95, 2.2);
        EXPECT_LT(error.mean, rigid.mean);
        EXPECT_LT(f.result.fit.rms_mm, 0.8);  // 0.7 of noise
        EXPECT_GT(f.result.fit.coverage, 0.95);
        EXPECT_GT(f.result.registration.min_det_jacobian, 0.2);
        const InverseMap inverse_map(f.result.registration);
        for (Point3 p : patient()->inside) {
            Point3 back;
            ASSERT_EQ(inverse_map.invert(mannequin_from_ct(f.result.registration, p), &back),
                      MapStatus::ok);
            EXPECT_LT(distance(back, p), 1e-3);
        }
    }
}

TEST(KnownMap, TheFrontHalfAloneStaysWithinTwoMillimetres) {
    NEEDS_PATIENT();
    HardCase inside("interior error, front half read, mean", HardCase::at_most, 2, "mm");
    SweepPlan front;
    front.part = SweptPart::front;
    const Fitted f = fit(3, 9, front);
    const TargetError error = target_error(f.result.registration, f.truth);
    inside.see(error.mean);
    EXPECT_LT(error.mean, target_error(rigid_part(f.result.registration), f.truth).mean);
    EXPECT_NE(warnings_of(f.result).find("cover only"), std::string::npos) << warnings_of(f.result);
}

// With a sweep of the front of a body unlike the patient's, the map may be upside down or slide
// along the body. A head direction about 12 degrees off and one landmark low on the body, touched
// to 5 mm, settle both.
TEST(KnownMap, HeadDirectionAndALowLandmarkPlaceAFrontSweep) {
    NEEDS_PATIENT();
    for (const std::uint64_t seed : {11, 12, 13, 14}) {
        SCOPED_TRACE(::testing::Message() << "seed " << seed);
        Random random(seed);
        const Registration truth =
            testing::random_quadratic_map(patient()->skin.box, patient()->skin.skin, random, 14);
        SweepPlan front;
        front.part = SweptPart::front;
        const Surface sweep = testing::sweep_of(patient()->skin.skin, truth, random, front);
        const Vector3 head = truth.mannequin_from_ct.rotation * Vector3{0, 0, 1};
        const Vector3 across = truth.mannequin_from_ct.rotation * Vector3{0.6, 0.8, 0};
        RegisterOptions options;
        options.up = normalized(head + 0.2 * across);
        const auto lowest = *std::min_element(patient()->skin.skin.points.begin(),
                                              patient()->skin.skin.points.end(),
                                              [](Point3 a, Point3 b) { return a.z < b.z; });
        options.landmarks = {{"low", lowest, mannequin_from_ct(truth, lowest) + 5 * across}};
        const auto fitted = register_surfaces({patient()->skin, sweep}, options);
        ASSERT_TRUE(fitted) << fitted.error().message();
        const Registration& map = fitted->registration;
        EXPECT_GT(dot(map.mannequin_from_ct.rotation * Vector3{0, 0, 1}, head), 0.9);
        Vector3 offset;
        for (const Point3 p : patient()->inside)
            offset = offset + (1.0 / static_cast<double>(patient()->inside.size())) *
                                  (mannequin_from_ct(map, p) - mannequin_from_ct(truth, p));
        EXPECT_LT(norm(offset - dot(offset, head) * head), 10);
        RecordProperty("lateral_mm", std::to_string(norm(offset - dot(offset, head) * head)));
    }
}

TEST(KnownMap, OneSideGivesNumbersAndAWarning) {
    NEEDS_PATIENT();
    SweepPlan side;
    side.part = SweptPart::one_side;
    const Fitted f = fit(4, 9, side);
    EXPECT_NE(warnings_of(f.result).find("cover only"), std::string::npos);
    EXPECT_GT(f.result.registration.min_det_jacobian, 0.2);
    HardCase ratio("interior error over the rigid pose's, one side read", HardCase::at_most, 1, "");
    ratio.see(target_error(f.result.registration, f.truth).mean /
              target_error(rigid_part(f.result.registration), f.truth).mean);
}

TEST(KnownMap, GrossOutliersAreLeftOutAndCounted) {
    NEEDS_PATIENT();
    SweepPlan lifted;
    lifted.lift_off_share = 0.05;
    const Fitted f = fit(5, 9, lifted);
    HardCase inside("interior error, 5 % lift-offs, mean", HardCase::at_most, 1.2, "mm");
    inside.see(target_error(f.result.registration, f.truth).mean);
    // About a hundred are expected. Readings less than 8 mm and two deviations off their
    // neighbours' plane, such as those beside another lift-off, are left to the robust loss.
    EXPECT_GT(measure(f.result, "readings_lifted_off"), 50);
}

// A third of the readings is of a hand beside the belly: too many to be the tail of a residual.
TEST(KnownMap, ReadingsOfAHandAreNamed) {
    NEEDS_PATIENT();
    Random random(6);
    const Registration truth =
        testing::random_quadratic_map(patient()->skin.box, patient()->skin.skin, random, 9);
    Surface sweep = testing::sweep_of(patient()->skin.skin, truth, random, {});
    const std::size_t own = sweep.points.size();
    const Box3& box = patient()->skin.box;
    const Point3 hand{box.centre().x + 40, box.upper.y + 70, box.centre().z};
    for (std::size_t n = 0; n < own / 2; ++n) {
        const Vector3 d = normalized(
            Vector3{random.gaussian(), random.gaussian(), random.gaussian()} + Vector3{1e-9, 0, 0});
        sweep.points.push_back(
            mannequin_from_ct(truth, hand + Vector3{45 * d.x, 35 * d.y, 90 * d.z}));
    }
    const auto fitted = register_surfaces({patient()->skin, sweep}, {});
    ASSERT_TRUE(fitted) << fitted.error().message();
    HardCase inside("interior error, a third of the readings of a hand, mean", HardCase::at_most,
                    1.5, "mm");
    inside.see(target_error(fitted->registration, truth).mean);
    EXPECT_GT(measure(*fitted, "readings_off_skin"), 0.4 * static_cast<double>(own));
    EXPECT_NE(warnings_of(*fitted).find("a hand"), std::string::npos) << warnings_of(*fitted);
    EXPECT_EQ(warnings_of(*fitted).find("same part"), std::string::npos);
}

// Readings of a body of another size, and those of the patient's own: alone the former are said.
TEST(KnownMap, ABodyOfAnotherSizeIsNamedByItsSize) {
    NEEDS_PATIENT();
    HardCase told("of 3 bodies of .55, 1 and 1.5 times the size, said wrongly", HardCase::at_most,
                  0, "");
    int wrong = 0;
    for (const double scale : {0.55, 1.0, 1.5}) {
        Random random(7);
        Registration same;
        same.quadratic = QuadraticMap::from_rigid(Rigid{}, {}, 200);
        Surface sweep = testing::sweep_of(patient()->skin.skin, same, random, {});
        for (Point3& p : sweep.points) p = Point3{} + scale * (p - Point3{});
        RegisterOptions options;
        options.up = Vector3{0, 0, 1};
        const auto aligned = align_surfaces({patient()->skin, sweep}, options);
        ASSERT_TRUE(aligned) << aligned.error().message();
        const bool said = warnings_of(*aligned).find("times as wide") != std::string::npos;
        EXPECT_EQ(said, scale != 1.0) << scale << ": " << warnings_of(*aligned);
        wrong += said != (scale != 1.0);
    }
    told.see(wrong);
}

TEST(KnownMap, ARigidCopyIsNotBent) {
    NEEDS_PATIENT();
    const Fitted f = fit(6, 0, {});
    // The pose of 2,000 readings with 0.7 mm of noise, and of a map that has 30 parameters more.
    HardCase inside("interior error of a rigid copy, mean", HardCase::at_most, 0.3, "mm");
    inside.see(target_error(f.result.registration, f.truth).mean);
}

TEST(KnownMap, FewNoisyReadingsAreNoWorseThanTheRigidAnswer) {
    NEEDS_PATIENT();
    SweepPlan poor;
    poor.points = 60;
    poor.noise_mm = 4;
    const Fitted f = fit(7, 1, poor);
    const double rigid = target_error(rigid_part(f.result.registration), f.truth).mean;
    HardCase ratio("interior error over the rigid pose's, 60 readings", HardCase::at_most, 1.15,
                   "");
    ratio.see(target_error(f.result.registration, f.truth).mean / rigid);
    EXPECT_NE(warnings_of(f.result).find("readings"), std::string::npos);
}

TEST(KnownMap, AHalfTurnAboutAnyAxisIsFound) {
    NEEDS_PATIENT();
    HardCase inside("interior error after a half turn, mean", HardCase::at_most, 0.2, "mm");
    for (int axis = 0; axis < 3; ++axis) {
        Vector3 a;
        a[axis] = 1;
        const Rigid turn{rotation_about(a, kPi), {}};
        Surface turned;
        for (std::size_t i = 0; i < patient()->skin.skin.points.size(); i += 9)
            turned.points.push_back(turn * patient()->skin.skin.points[i]);
        const auto result = register_surfaces({patient()->skin, turned});
        ASSERT_TRUE(result);
        Registration truth = result->registration;
        truth.residual = {};
        truth.quadratic = QuadraticMap::from_rigid(turn, {}, 200);
        inside.see(target_error(result->registration, truth).mean);
    }
}

TEST(KnownMap, FramesAKilometreAwayAreFittedLikeNearOnes) {
    NEEDS_PATIENT();
    Random random(8);
    Registration truth =
        testing::random_quadratic_map(patient()->skin.box, patient()->skin.skin, random, 9);
    for (auto& row : truth.quadratic.coefficients) row[0] += 1e6;
    const Surface sweep = testing::sweep_of(patient()->skin.skin, truth, random);
    const auto result = register_surfaces({patient()->skin, sweep});
    ASSERT_TRUE(result) << result.error().message();
    HardCase inside("interior error, frame 1e6 mm away, mean", HardCase::at_most, 1.2, "mm");
    inside.see(target_error(result->registration, truth).mean);
}

TEST(KnownMap, AMirroredSweepIsRecognised) {
    NEEDS_PATIENT();
    Random random(9);
    const Registration truth =
        testing::random_quadratic_map(patient()->skin.box, patient()->skin.skin, random, 4);
    Surface sweep = testing::sweep_of(patient()->skin.skin, truth, random);
    for (Point3& p : sweep.points) p.x = -p.x;
    const auto result = register_surfaces({patient()->skin, sweep});
    ASSERT_TRUE(result);
    EXPECT_NE(warnings_of(*result).find("mirror image"), std::string::npos) << warnings_of(*result);
    HardCase fits("misfit in the mirror over that of a left-handed sweep", HardCase::at_most, 0.943,
                  "");
    fits.see(measure(*result, "mirror_score_mm") / measure(*result, "pose_score_mm"));
}

TEST(KnownMap, LandmarksInTheWrongPlaceAreNamed) {
    NEEDS_PATIENT();
    Random random(10);
    const Registration truth =
        testing::random_quadratic_map(patient()->skin.box, patient()->skin.skin, random, 9);
    const Surface sweep = testing::sweep_of(patient()->skin.skin, truth, random);
    RegisterOptions options;
    for (int n = 0; n < 4; ++n) {
        const auto& points = patient()->skin.skin.points;
        const Point3 ct = points[points.size() * static_cast<std::size_t>(2 * n + 1) / 8];
        options.landmarks.push_back({"mark" + std::to_string(n), ct, mannequin_from_ct(truth, ct)});
    }
    options.landmarks[2].mannequin = options.landmarks[2].mannequin + Vector3{0, 28, 0};
    const auto result = register_surfaces({patient()->skin, sweep}, options);
    ASSERT_TRUE(result);
    EXPECT_NE(warnings_of(*result).find("'mark2'"), std::string::npos) << warnings_of(*result);
    EXPECT_EQ(warnings_of(*result).find("'mark0'"), std::string::npos) << warnings_of(*result);
    // A hint that is 28 mm wrong must not spoil what the readings say.
    HardCase inside("interior error, a landmark 28 mm off, mean", HardCase::at_most, 1.5, "mm");
    inside.see(target_error(result->registration, truth).mean);
}

TEST(KnownMap, AMapOnTheVergeOfFoldingIsAnsweredByOneThatDoesNot) {
    NEEDS_PATIENT();
    // y_x = x + x^2 / (2 L) about the middle has det J = 1 + x / L: 0.05 at the far left face.
    Registration truth;
    const Box3 box = patient()->skin.box;
    truth.ct_box = box;
    truth.quadratic = QuadraticMap::from_rigid({}, box.centre(), 200);
    const double length = 0.5 * box.extent().x / 0.95;
    truth.quadratic.coefficients[0][4] = 200.0 * 200.0 / (2 * length);
    Random random(11);
    const Surface sweep = testing::sweep_of(patient()->skin.skin, truth, random);
    const auto result = register_surfaces({patient()->skin, sweep});
    ASSERT_TRUE(result);
    // Such a map doubles one half of the body and flattens the other: the result must be
    // complete, lie nearer to the readings than the rigid one, and not fold.
    HardCase folding("det J of the answer to a map with 0.05", HardCase::at_least, 0.2, "");
    folding.see(result->registration.min_det_jacobian);
    HardCase ratio("rms of its readings over the rigid pose's", HardCase::at_most, 1, "");
    ratio.see(result->fit.rms_mm / result->rigid_fit.rms_mm);
    for (Point3 p : patient()->inside)
        ASSERT_TRUE(std::isfinite(norm(mannequin_from_ct(result->registration, p) - Point3{})));
}

}  // namespace
}  // namespace sonocase::pipeline
