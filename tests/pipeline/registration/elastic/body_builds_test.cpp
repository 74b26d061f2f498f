// SPDX-License-Identifier: Apache-2.0

// A patient on mannequins of another build: the skin is reached, organs keep their volume, the map
// is proven one to one; and where the residual warp suffices, its map is kept to the last bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <tuple>

#include "formats/base/constants.h"
#include "pipeline/base/parallel.h"
#include "pipeline/import/mesh/surface_file.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/registration/map/map_proofs.h"
#include "pipeline/registration/map/registration.h"
#include "support/fit_report.h"
#include "support/hard_case.h"
#include "support/paths.h"
#include "support/torso_builds.h"
#include "support/warped_skin.h"
#include "support/whole_sets.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;

RegisterOptions hints(const BuiltMannequin& mannequin) {
    RegisterOptions options;
    options.up = mannequin.head;
    options.landmarks = mannequin.landmarks;
    return options;
}

// 95th percentile of the distances from the true surface to the mapped skin, within 20 mm of a
// reading. Where the patient ends nothing can be compared.
double rim_error_mm(const BuiltMannequin& mannequin, const RegisterResult& result) {
    const SkinSurfaceResult& skin = torso_patient().skin;
    const Surface mapped = mapped_skin(skin.skin, result.registration, Point3{});
    const PointIndex readings(mannequin.sweep.points), places(mapped.points);
    std::vector<double> off;
    for (const Point3 p : mannequin.truth.points) {
        double d2 = 0;
        readings.nearest(p, &d2);
        if (d2 > 20 * 20) continue;
        const std::uint32_t v = places.nearest(p);
        if (skin.on_rim[v]) continue;
        off.push_back(std::abs(dot(p - mapped.points[v], mapped.normals[v])));
    }
    std::sort(off.begin(), off.end());
    return off.empty() ? -1 : off[off.size() * 95 / 100];
}

class BodyBuilds : public ::testing::TestWithParam<std::tuple<Build, std::uint64_t>> {};

TEST_P(BodyBuilds, AreReachedAndOrgansKept) {
    const auto [build, seed] = GetParam();
    const BuiltMannequin mannequin = built_mannequin(build, seed, usual_sweep(build));
    const auto result = register_surfaces(
        {torso_patient().skin, mannequin.sweep, &torso_patient().labels}, hints(mannequin));
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_LE(result->fit.median_mm, 0.75);
    EXPECT_LE(result->fit.p95_mm, 2.7);
    std::optional<HardCase> off, kept;  // figures of one of the fifteen bodies
    if (build == Build::belly && seed == 1) {
        off.emplace("readings of a body with a belly to its skin, 95 %", HardCase::at_most, 2.7,
                    "mm");
        kept.emplace("volume of its organs, off", HardCase::at_most, 0.08, "");
        off->see(result->fit.p95_mm);
    }
    EXPECT_GE(result->fit.coverage, 0.6);
    EXPECT_GE(measure(*result, "min_det_jacobian"), 0.2);
    EXPECT_GT(measure(*result, "least_minor"), 0);
    EXPECT_LE(rim_error_mm(mannequin, *result), 5);
    for (const OrganChange& c : result->organs) {
        if (c.label != "liver" && c.label != "spleen" && !c.label.starts_with("kidney_")) continue;
        EXPECT_NEAR(c.volume_ratio, 1, 0.08) << c.label;
        if (kept) kept->see(std::abs(c.volume_ratio - 1));
        if (c.label == "liver") {
            EXPECT_LE(c.shape_change, 0.2);
        }
    }
    const OrganChange bones =
        joint_change(result->organs, "bones", [](std::string_view t) { return t == "bone"; });
    EXPECT_NEAR(bones.volume_ratio, 1, 0.08);
    EXPECT_NE(note(*result, "path"), "quadratic");
    // The inverse leads back.
    const InverseMap inverse_map(result->registration);
    Random random(5);
    for (int n = 0; n < 500; ++n) {
        const Point3 p{random.uniform(-100, 100), random.uniform(-60, 60),
                       random.uniform(-120, 120)};
        Point3 back;
        ASSERT_EQ(inverse_map.invert(mannequin_from_ct(result->registration, p), &back),
                  MapStatus::ok);
        EXPECT_LT(distance(back, p), 1e-3);
    }
}
INSTANTIATE_TEST_SUITE_P(All,
                         BodyBuilds,
                         ::testing::ValuesIn(half_of_pairs<Build, std::uint64_t>(
                             {std::begin(kBuilds), std::end(kBuilds)}, {1, 2, 3})),
                         [](const auto& one) {
                             return build_name(std::get<0>(one.param)) +
                                    std::to_string(std::get<1>(one.param));
                         });

TEST(ElasticPath, GivesTheSameBytesForAnyNumberOfThreads) {
    const BuiltMannequin mannequin = built_mannequin(Build::wide, 2, usual_sweep(Build::wide));
    RegisterOptions options = hints(mannequin);
    options.path = "elastic";
    options.elastic.rounds = 5;
    const auto fit = [&](int threads) {
        const ThreadLimit limit(threads);
        auto r = register_surfaces({torso_patient().skin, mannequin.sweep, &torso_patient().labels},
                                   options);
        for (StageReport& report : r->registration.reports) {
            report.seconds = 0;
            std::erase_if(report.measures,
                          [](const Measure& m) { return m.name.ends_with("seconds"); });
        }
        return format_registration(r->registration);
    };
    EXPECT_EQ(fit(1), fit(2));
}

TEST(ElasticPath, AFoldingFitIsRefusedOrRepaired) {
    const BuiltMannequin mannequin = built_mannequin(Build::gaunt, 1, usual_sweep(Build::gaunt));
    RegisterOptions options = hints(mannequin);
    options.path = "elastic";
    options.elastic.stiffness = 0.01;
    options.elastic.barrier = 0;
    options.elastic.bending = 1e-6;
    const auto result = register_surfaces(
        {torso_patient().skin, mannequin.sweep, &torso_patient().labels}, options);
    ASSERT_TRUE(result) << result.error().message();
    HardCase folding("det J after the repair", HardCase::at_least, 0.2, "");
    folding.see(measure(*result, "min_det_jacobian"));
    HardCase one("least minor after the repair", HardCase::at_least, 0, "");
    one.see(measure(*result, "least_minor"));
}

TEST(ElasticPath, WithoutLabelsTheBodyIsOneTissue) {
    const BuiltMannequin mannequin = built_mannequin(Build::belly, 3, usual_sweep(Build::belly));
    RegisterOptions options = hints(mannequin);
    options.path = "elastic";
    const auto none = register_surfaces({torso_patient().skin, mannequin.sweep}, options);
    ASSERT_TRUE(none) << none.error().message();
    LabelVolume plain = torso_patient().labels;
    for (std::uint8_t& v : plain.voxels) v = v != 0;
    plain.labels.resize(2);
    plain.labels[1] = {"body", "soft_tissue"};
    const auto one = register_surfaces({torso_patient().skin, mannequin.sweep, &plain}, options);
    ASSERT_TRUE(one) << one.error().message();
    HardCase skin("readings to skin without labels, 95 %", HardCase::at_most, 2.7, "mm");
    for (const auto* r : {&none, &one}) {
        EXPECT_EQ(note(**r, "path"), "elastic");
        skin.see((*r)->fit.p95_mm);
        EXPECT_GT(measure(**r, "least_minor"), 0);
    }
    EXPECT_TRUE(none->organs.empty());
    EXPECT_EQ(one->organs.size(), 1u);
}

TEST(ElasticPath, HardSweepsGiveAProvenMapOrAReason) {
    struct Case {
        const char* name;
        BuildSweep plan;
        double lowest, highest;  // share of the height that is read
    };
    BuildSweep lifted, usual;
    lifted.outliers = 0.05;
    const Case cases[] = {{"5 % lift-off", lifted, 0, 1},
                          {"lower half of a mannequin", usual, 0, 0.5},
                          {"upper two thirds", usual, 0.33, 1}};
    HardCase skin("readings to skin of hard sweeps, 95 %", HardCase::at_most, 3.5, "mm");
    for (const Case& c : cases) {
        SCOPED_TRACE(c.name);
        BuiltMannequin mannequin = built_mannequin(Build::belly, 2, c.plan);
        std::vector<double> height;
        for (Point3 p : mannequin.sweep.points) height.push_back(dot(p - Point3{}, mannequin.head));
        std::vector<double> sorted = height;
        std::sort(sorted.begin(), sorted.end());
        const double low = sorted[static_cast<std::size_t>(c.lowest * 1999)],
                     high = sorted[static_cast<std::size_t>(c.highest * 1999)];
        Surface part;
        for (std::size_t i = 0; i < height.size(); ++i) {
            if (height[i] >= low && height[i] <= high)
                part.points.push_back(mannequin.sweep.points[i]);
        }
        const auto result = register_surfaces({torso_patient().skin, part, &torso_patient().labels},
                                              hints(mannequin));
        ASSERT_TRUE(result) << result.error().message();
        EXPECT_GE(measure(*result, "min_det_jacobian"), 0.2);
        EXPECT_GT(measure(*result, "least_minor"), 0);
        EXPECT_LE(result->fit.median_mm, 1);
        skin.see(result->fit.p95_mm);
    }
}

TEST(ElasticPath, HugeDifferencesAreReachedWithProofOrRefusedInOneSentence) {
    const BuiltMannequin mannequin = built_mannequin(Build::huge, 1, {});
    const auto result = register_surfaces(
        {torso_patient().skin, mannequin.sweep, &torso_patient().labels}, hints(mannequin));
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_GT(measure(*result, "least_minor"), 0);
    HardCase folding("det J, bodies 60 to 90 mm apart", HardCase::at_least, 0.2, "");
    folding.see(measure(*result, "min_det_jacobian"));
    if (note(*result, "path") != "quadratic") {
        EXPECT_LE(result->fit.median_mm, 1.5);
        EXPECT_LE(result->fit.p95_mm, 6);
    } else {
        int told = 0;
        for (const std::string& w : result->report.warnings)
            told += w.find("differ by more than the map can close") != std::string::npos;
        EXPECT_EQ(told, 1);
    }
}

const ImportedLabels* shared_labels() {
    static const std::optional<ImportedLabels> read = []() -> std::optional<ImportedLabels> {
        const std::string path = SONOCASE_DATA "/ct/labels.nii.gz";
        if (!std::filesystem::exists(path)) return std::nullopt;
        auto labels = import_label_map(path);
        if (!labels) return std::nullopt;
        return std::move(*labels);
    }();
    return read ? &*read : nullptr;
}

TEST(SharedPair, KeepsTheResidualWarpAndTheElasticOneIsCloser) {
    if (!shared_labels()) GTEST_SKIP() << "no " SONOCASE_DATA;
    const LabelVolume& labels = shared_labels()->labels;
    const auto skin = extract_skin_surface(labels);
    const auto sweep = import_surface(SONOCASE_DATA "/mannequin/sweep.csv");
    ASSERT_TRUE(skin);
    ASSERT_TRUE(sweep);
    RegisterOptions options;
    const auto kept = register_surfaces({*skin, *sweep, &labels}, options);
    options.path = "residual";
    const auto residual = register_surfaces({*skin, *sweep, &labels}, options);
    options.path = "elastic";
    const auto elastic = register_surfaces({*skin, *sweep, &labels}, options);
    ASSERT_TRUE(kept && residual && elastic);
    EXPECT_EQ(note(*kept, "path"), "residual");
    EXPECT_EQ(kept->registration.residual.control_mm, residual->registration.residual.control_mm);
    EXPECT_EQ(kept->registration.quadratic.coefficients,
              residual->registration.quadratic.coefficients);
    EXPECT_EQ(note(*elastic, "path"), "elastic");
    EXPECT_LE(elastic->fit.median_mm, 0.6);
    EXPECT_LE(elastic->fit.p95_mm, 1.9);
    EXPECT_GE(measure(*elastic, "min_det_jacobian"), 0.45);
    EXPECT_GT(measure(*elastic, "least_minor"), 0);
}

// 95th percentile of how far apart two maps carry places inside the body.
double apart_mm(const LabelVolume& labels, const Registration& a, const Registration& b) {
    std::vector<double> off;
    for (std::size_t n = 0; n < labels.voxels.size(); n += 499) {
        if (labels.voxels[n] == 0) continue;
        const int i = static_cast<int>(n % labels.grid.size.x),
                  j = static_cast<int>(n / labels.grid.size.x % labels.grid.size.y),
                  k = static_cast<int>(n / labels.grid.size.x / labels.grid.size.y);
        const Point3 p = labels.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
        off.push_back(distance(mannequin_from_ct(a, p), mannequin_from_ct(b, p)));
    }
    std::sort(off.begin(), off.end());
    return off[off.size() * 95 / 100];
}

// For a hidden quadratic the residual warp is kept, even where it changes organs by more than a
// body of another build would.
TEST(SharedPair, AKnownQuadraticIsNotTakenForAnotherBuild) {
    if (!shared_labels()) GTEST_SKIP() << "no " SONOCASE_DATA;
    const LabelVolume& labels = shared_labels()->labels;
    const auto skin = extract_skin_surface(labels);
    ASSERT_TRUE(skin);
    HardCase off("interior of a known quadratic, off, 95 %", HardCase::at_most, 3, "mm");
    for (const std::uint64_t seed : {2, 4}) {
        Random random(seed);
        const Registration truth = random_quadratic_map(skin->box, skin->skin, random, 9);
        const Surface sweep = sweep_of(skin->skin, truth, random);
        const auto kept = register_surfaces({*skin, sweep, &labels});
        ASSERT_TRUE(kept);
        EXPECT_NE(note(*kept, "path"), "elastic") << note(*kept, "path_reason");
        off.see(apart_mm(labels, kept->registration, truth));
    }
}

// What a case teaches must not depend on chance: on a seed, or on where the search begins. One
// other seed, and other starts; with SONOCASE_SEEDS=20 seeds 2 to 20.
class AnySeed : public ::testing::TestWithParam<const char*> {};

TEST_P(AnySeed, GivesTheSameMap) {
    const std::string which = GetParam();
    const TorsoPatient* patient = &torso_patient();
    TorsoPatient shared;
    Surface sweep;
    RegisterOptions options;
    if (which == "shared") {
        if (!shared_labels()) GTEST_SKIP() << "no " SONOCASE_DATA;
        shared.labels = shared_labels()->labels;
        shared.skin = *extract_skin_surface(shared.labels);
        patient = &shared;
        sweep = *import_surface(SONOCASE_DATA "/mannequin/sweep.csv");
    } else if (which == "quadratic") {
        Random random(2);
        const Registration truth =
            random_quadratic_map(patient->skin.box, patient->skin.skin, random, 9);
        sweep = sweep_of(patient->skin.skin, truth, random);
    } else {
        const Build build = which == "belly" ? Build::belly : Build::gaunt;
        const BuiltMannequin mannequin = built_mannequin(build, 1, usual_sweep(build));
        sweep = mannequin.sweep;
        options.up = mannequin.head;
    }
    const auto fit = [&](std::uint64_t seed, int starts) {
        options.seed = seed;
        options.rigid.starts = starts;
        const auto fitted = register_surfaces({patient->skin, sweep, &patient->labels}, options);
        EXPECT_TRUE(fitted);
        return fitted ? fitted->registration : Registration{};
    };
    const Registration first = fit(1, 96);
    const char* given = std::getenv("SONOCASE_SEEDS");
    const int seeds = given ? std::atoi(given) : 2;
    const std::vector<int> all_starts =
        given ? std::vector{102, 111, 120, 130, 140, 150, 171, 192} : std::vector{102};
    for (const int starts : all_starts) {
        const double off = apart_mm(patient->labels, fit(1, starts), first);
        // Other starts may come to rest elsewhere in the same basin: 0.41 mm apart on the shared
        // pair.
        EXPECT_LE(off, 0.5) << starts << " starts";
        if (given) std::printf("%s, %d starts: %.3f mm\n", which.c_str(), starts, off);
    }
    for (int seed = 2; seed <= seeds; ++seed) {
        const double off =
            apart_mm(patient->labels, fit(static_cast<std::uint64_t>(seed), 96), first);
        EXPECT_LE(off, 0.5) << "seed " << seed;
        if (given) std::printf("%s, seed %d: %.3f mm\n", which.c_str(), seed, off);
    }
}
INSTANTIATE_TEST_SUITE_P(All,
                         AnySeed,
                         ::testing::Values("shared", "quadratic", "belly", "gaunt"),
                         [](const auto& one) { return std::string(one.param); });

// y = ((R + y) cos(a x), -(R + y) sin(a x), z): det J = a (R + y) > 0 everywhere, and more than one
// turn over the box.
TEST(OneToOneProof, ASpiralPassesTheFoldProofAndFailsThisOne) {
    Registration spiral;
    spiral.ct_box.include(Point3{-200, -60, -60});
    spiral.ct_box.include(Point3{200, 60, 60});
    spiral.quadratic = QuadraticMap::from_rigid({}, {}, 200);
    DisplacementGrid& grid = spiral.residual;
    grid.spacing_mm = 10;
    grid.origin_mm = spiral.ct_box.lower;
    grid.size = {43, 15, 15};
    const double turn = 2 * kPi * 1.2 / 400;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i) {
                const Vector3 p =
                    (grid.origin_mm - Point3{}) + 10.0 * Vector3{i - 1.0, j - 1.0, k - 1.0};
                const double r = 100 + p.y;
                grid.control_mm.push_back(
                    {-r * std::sin(-turn * p.x) - p.x, r * std::cos(-turn * p.x) - p.y, 0});
            }
        }
    }
    const FoldProof fold = prove_no_fold(spiral);
    HardCase folding("det J of a spiral, which passes", HardCase::at_least, 0.2, "");
    folding.see(fold.min_bound);
    const OneToOneProof proof = prove_one_to_one(spiral);
    EXPECT_FALSE(proof.proven());
    HardCase minor("its least minor, which does not", HardCase::at_most, 0, "");
    minor.see(proof.min_minor());
    // Correct: two places have one image.
    const InverseMap inverse_map(spiral);
    Point3 back;
    const Point3 place{-190, 0, 0};
    ASSERT_EQ(inverse_map.invert(mannequin_from_ct(spiral, place), &back), MapStatus::ok);
    const Point3 other{place.x + 400 / 1.2, 0, 0};
    EXPECT_LT(distance(mannequin_from_ct(spiral, place), mannequin_from_ct(spiral, other)), 2);
}

TEST(OneToOneProof, NeverLiesAboveASampleOfTheMinors) {
    HardCase above("bound above a sample", HardCase::at_most, 1e-12, "");
    HardCase below("bound below the least sample", HardCase::at_most, 0.1, "");
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        SCOPED_TRACE(seed);
        Random random(seed);
        Registration r;
        r.ct_box.include(Point3{-100, -80, -90});
        r.ct_box.include(Point3{100, 80, 90});
        const Rigid pose = random.rigid(50);
        r.quadratic = QuadraticMap::from_rigid(pose, {}, 100);
        for (auto& row : r.quadratic.coefficients) {
            for (std::size_t c = 4; c < 10; ++c) row[c] += random.uniform(-3, 3);
        }
        r.residual.spacing_mm = 40;
        r.residual.origin_mm = {-100, -80, -100};
        r.residual.size = {8, 7, 8};
        for (int i = 0; i < 8 * 7 * 8; ++i)
            r.residual.control_mm.push_back(
                {2 * random.gaussian(), 2 * random.gaussian(), 2 * random.gaussian()});
        const OneToOneProof proof = prove_one_to_one(r);
        EXPECT_TRUE(proof.proven());
        // The proof holds for any two points.
        double smallest = 1e9;
        for (int n = 0; n < 20000; ++n) {
            const auto place = [&] {
                return Point3{random.uniform(-100, 100), random.uniform(-80, 80),
                              random.uniform(-90, 90)};
            };
            const Point3 a = place(), b = place();
            const Vector3 image = mannequin_from_ct(r, a) - mannequin_from_ct(r, b);
            smallest = std::min(smallest, dot(image, pose.rotation * (a - b)) / dot(a - b, a - b));
        }
        // The mean Jacobian's rotation is that of the pose within a few hundredths.
        EXPECT_GT(smallest, 0);
        for (std::size_t m = 0; m < 3; ++m) {
            above.see(std::max(0.0, proof.min_bound[m] - proof.min_sample[m]));
            below.see(proof.min_sample[m] - proof.min_bound[m]);
        }
    }
}

}  // namespace
}  // namespace sonocase::pipeline
