// SPDX-License-Identifier: Apache-2.0

// What is done with a cooked case: exported, inspected, validated, its exercises carried into the
// mannequin's frame.
#include <gtest/gtest.h>

#include "coarse_case.h"
#include "formats/exercise/exercise.h"
#include "pipeline/export/export_files.h"
#include "pipeline/export/inspect_case.h"
#include "pipeline/import/mesh/surface_file.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/stages/exercise_frame.h"

namespace sonocase::pipeline {
namespace {

using testing::coarse_recipe;
using testing::shared_cache;
using testing::TemporaryFolder;

TEST(ExportCase, VolumesAndSurfacesComeBackThroughImport) {
    const TemporaryFolder folder;
    const auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    const CaseBundle& bundle = cooked->bundle;
    ASSERT_TRUE(export_case(bundle, folder.path()).has_value());
    const auto labels = import_label_map(folder / "labels.seg.nrrd");
    ASSERT_TRUE(labels.has_value()) << labels.error().message();
    EXPECT_EQ(labels->labels.grid.size, bundle.grid.size);
    EXPECT_LT(distance(labels->labels.grid.origin_mm, bundle.grid.origin_mm), 1e-9);
    const auto dense = dense_from_bricks(bundle.label_bricks);
    std::size_t wrong = 0;
    for (std::size_t n = 0; n < dense.size(); ++n)
        wrong +=
            labels->labels.labels[labels->labels.voxels[n]].name != bundle.labels[dense[n]].name;
    EXPECT_EQ(wrong, 0u);
    for (const Label& label : labels->labels.labels)
        for (const Label& own : bundle.labels)
            if (label.name == own.name) {
                EXPECT_EQ(label.colour, own.colour) << label.name;
            }
    const auto mannequin = import_surface(folder / "mannequin.ply");
    ASSERT_TRUE(mannequin.has_value());
    ASSERT_EQ(mannequin->points.size(), bundle.mannequin_skin.points.size());
    for (std::size_t i = 0; i < mannequin->points.size(); ++i)  // float coordinates
        EXPECT_LT(distance(mannequin->points[i], bundle.mannequin_skin.points[i]), 1e-4);
}

TEST(InspectCase, VolumesAreThoseOfTheDenseVoxels) {
    const auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    const CaseBundle& bundle = cooked->bundle;
    std::vector<double> ml(bundle.labels.size(), 0);
    for (const std::uint8_t voxel : dense_from_bricks(bundle.label_bricks))
        ml[voxel] += bundle.grid.voxel_volume_mm3() / 1000;
    const LabelVolumes volumes = label_volumes(bundle);
    for (std::size_t i = 0; i < ml.size(); ++i)
        EXPECT_NEAR(volumes.ml[i], ml[i], 1e-9 * (1 + ml[i])) << bundle.labels[i].name;
}

TEST(ValidateCase, FindsWhatTheReaderCannot) {
    auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    const CaseBundle good = cooked->bundle;
    const auto errors = [](const CaseBundle& bundle) {
        std::string all;
        for (const Finding& finding : validate_case(bundle))
            if (finding.error) all += finding.text + "\n";
        return all;
    };
    EXPECT_EQ(errors(good), "");
    CaseBundle bad = good;
    bad.labels[2].name = bad.labels[1].name;
    EXPECT_NE(errors(bad).find("two labels"), std::string::npos);
    bad = good;
    bad.textures.clear();
    EXPECT_NE(errors(bad).find("missing texture"), std::string::npos);
    bad = good;
    for (Point3& p : bad.mannequin_skin.points) p.x += 5000;
    EXPECT_NE(errors(bad).find("frames are mixed up"), std::string::npos);
    bad = good;
    bad.exercises[0].toml = "name = \"x\"\n[[targets]]\ncentre = [0, 0, 9000]\n";
    EXPECT_NE(errors(bad).find("outside the body"), std::string::npos);
    bad = good;
    ASSERT_FALSE(bad.boundary.pool.empty());
    for (std::uint32_t& record : bad.boundary.pool) record = (record & ~0xFFu) | 200u;
    EXPECT_NE(errors(bad).find("beyond the palette"), std::string::npos);
}

TEST(ExerciseFrame, PositionsGoThroughTheMapAndTheNeedleStaysInThePlane) {
    const auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    const auto exercise = parse_exercise(cooked->bundle.exercises[0].toml, "aim");
    ASSERT_TRUE(exercise.has_value()) << exercise.error().message();
    const Registration truth = analytic_torso_truth();
    EXPECT_LT(distance(exercise->targets[0].centre, mannequin_from_ct(truth, {80, 20, 70})), 1e-3);
    EXPECT_EQ(exercise->findings[0].lesion.centre, exercise->targets[0].centre);
    const SweepKey& key = exercise->sweeps[0].keys[0];
    EXPECT_LT(distance(key.probe, mannequin_from_ct(truth, {80, 130, 70})), 1e-3);
    const Vector3 normal = cross(key.beam, key.lateral);
    EXPECT_LT(std::abs(dot(key.needle_tip - key.probe, normal)), 2e-3);
    EXPECT_LT(std::abs(dot(key.needle_direction, normal)), 1e-5);
    // The plane passes where the anatomy in its middle went, 70 mm deep.
    EXPECT_LT(std::abs(dot(mannequin_from_ct(truth, {80, 60, 70}) - key.probe, normal)), 0.05);
    EXPECT_TRUE(cooked->stages.back().report.warnings.empty());  // the target lies in the liver
}

// The plane in which an exercise begins goes through the map as the plane of a script's key does.
TEST(ExerciseFrame, TheFirstPlaneIsThatOfAKeyAtTheSamePlace) {
    const std::string place = "probe = [80, 130, 70]\n", towards = "beam = [0, -1, 0]\n",
                      along = "lateral = [0.6, 0, 0.8]\n";
    const auto mapped = exercise_to_mannequin(
        "name = \"a\"\nkind = \"scan\"\nstart_" + place + "start_" + towards + "start_" + along +
            "[[sweeps]]\nname = \"still\"\n[[sweeps.keys]]\ntime_s = 0\n" + place + towards + along,
        "a.toml", analytic_torso_truth());
    ASSERT_TRUE(mapped) << mapped.error().message();
    const auto exercise = parse_exercise(*mapped, "a.toml");
    ASSERT_TRUE(exercise) << exercise.error().message();
    const SweepKey& key = exercise->sweeps[0].keys[0];
    const Rigid start = start_pose(*exercise);
    EXPECT_LT(norm(start.rotation.column(2) - key.beam), 1e-4);
    EXPECT_LT(norm(start.rotation.column(0) - key.lateral), 1e-4);
    // Where none is given, it lies across the patient, whose right is at the picture's left.
    const auto plain = exercise_to_mannequin("name = \"a\"\nstart_" + place + "start_" + towards,
                                             "a.toml", analytic_torso_truth());
    ASSERT_TRUE(plain) << plain.error().message();
    const auto of_patient = parse_exercise(*plain, "a.toml");
    ASSERT_TRUE(of_patient) << of_patient.error().message();
    const Point3 skin = mannequin_from_ct(analytic_torso_truth(), {80, 130, 70});
    const Vector3 left = mannequin_from_ct(analytic_torso_truth(), {79, 130, 70}) - skin;
    EXPECT_GT(dot(start_pose(*of_patient).rotation.column(0), normalized(left)), 0.98);
    // A beam along that direction has another.
    const auto along_x =
        exercise_to_mannequin("name = \"a\"\nstart_" + place + "start_beam = [-1, 0, 0]\n",
                              "a.toml", analytic_torso_truth());
    ASSERT_TRUE(along_x) << along_x.error().message();
    EXPECT_TRUE(parse_exercise(*along_x, "a.toml"));
}

TEST(ExerciseFrame, FramesAreStrippedInPlaceAndStrangersRefused) {
    const auto framed = strip_frame("name = \"a\"\nframe = \"ct\"\ntitle = \"b\"\n", "a.toml");
    ASSERT_TRUE(framed.has_value());
    EXPECT_TRUE(framed->in_ct);
    EXPECT_EQ(framed->toml, "name = \"a\"\n\ntitle = \"b\"\n");
    const auto plain = strip_frame("name = \"a\"\n", "a.toml");
    EXPECT_FALSE(plain->in_ct);
    const auto wrong = strip_frame("name = \"a\"\nframe = \"world\"\n", "a.toml");
    ASSERT_FALSE(wrong.has_value());
    EXPECT_EQ(wrong.error().where, "a.toml:2");
}

}  // namespace
}  // namespace sonocase::pipeline
