// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/label_map.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "pipeline/import/volume/volume_file.h"
#include "pipeline/import/volume_files.h"
#include "support/paths.h"
#include "support/temporary_folder.h"
#include "three_boxes.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
using testing::TinyVolume;

std::string name_at(const LabelVolume& labels, Point3 p) {
    const Point3 v = labels.grid.voxel_from_point(p);
    const int i = static_cast<int>(std::lround(v.x)), j = static_cast<int>(std::lround(v.y)),
              k = static_cast<int>(std::lround(v.z));
    if (!labels.grid.contains(i, j, k)) return "beyond";
    return labels.labels[labels.voxels[labels.grid.index(i, j, k)]].name;
}

// Every voxel of the imported volume carries the label that the body has at its position.
void expect_body(const Result<ImportedLabels>& imported) {
    ASSERT_TRUE(imported.has_value()) << imported.error().message();
    const LabelVolume& labels = imported->labels;
    EXPECT_EQ(labels.grid.size, (Int3{48, 16, 16}));
    for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(labels.grid.direction(axis, axis), 1, 1e-6) << "axis " << axis;
    std::size_t n = 0, wrong = 0;
    for (int k = 0; k < labels.grid.size.z; ++k)
        for (int j = 0; j < labels.grid.size.y; ++j)
            for (int i = 0; i < labels.grid.size.x; ++i, ++n) {
                const Point3 p = labels.grid.point_from_voxel({double(i), double(j), double(k)});
                wrong += labels.labels[labels.voxels[n]].source_value != shifted_body(p);
            }
    EXPECT_EQ(wrong, 0u);
}

TEST(ImportLabelMap, EveryAxisOrderAndFlipOfEveryFormatGivesTheSameBody) {
    const TemporaryFolder folder;
    int number = 0;
    int order[3] = {0, 1, 2};
    do {
        for (int flips = 0; flips < 8; ++flips) {
            const bool flip[3] = {(flips & 1) != 0, (flips & 2) != 0, (flips & 4) != 0};
            const TinyVolume volume =
                testing::sample_in_order(order, flip, kExtent, kSpacing, kCorner, shifted_body);
            const std::string stem = "v" + std::to_string(number++);
            expect_body(
                import_label_map(folder.write(stem + ".nii", testing::nifti_bytes(volume))));
            expect_body(
                import_label_map(folder.write(stem + ".nrrd", testing::nrrd_bytes(volume))));
            expect_body(import_label_map(
                folder.write(stem + "r.nrrd", testing::nrrd_bytes(volume, "", /*lps=*/false))));
            expect_body(import_label_map(folder.write(stem + ".mha", testing::mha_bytes(volume))));
        }
    } while (std::next_permutation(order, order + 3));
    EXPECT_EQ(number, 48);
}

TEST(ImportLabelMap, ObliqueAxesKeepTheirTiltAndTheBodyItsPlace) {
    const TemporaryFolder folder;
    const Matrix3 turn = rotation_about(normalized({1, 2, 3}), 0.4);
    Matrix3 columns;
    for (int axis = 0; axis < 3; ++axis)
        for (int row = 0; row < 3; ++row) columns(row, axis) = 2 * turn(row, axis);
    const auto ball = [](Point3 p) { return distance(p, {10, 20, 30}) < 25 ? kLiver : 0; };
    const Point3 origin = Point3{10, 20, 30} - turn * Vector3{40, 40, 40};
    const TinyVolume volume = testing::sample({40, 40, 40}, columns, origin, ball);
    const auto imported = import_label_map(folder.write("t.nii", testing::nifti_bytes(volume)));
    ASSERT_TRUE(imported.has_value()) << imported.error().message();
    std::size_t n = 0, wrong = 0;
    for (int k = 0; k < 40; ++k)
        for (int j = 0; j < 40; ++j)
            for (int i = 0; i < 40; ++i, ++n) {
                const Point3 p =
                    imported->labels.grid.point_from_voxel({double(i), double(j), double(k)});
                // Positions in a NIfTI header are single precision: 1e-5 mm at the ball's rim.
                if (std::abs(distance(p, {10, 20, 30}) - 25) < 1e-3) continue;
                wrong += (imported->labels.voxels[n] != 0) != (ball(p) != 0);
            }
    EXPECT_EQ(wrong, 0u);
}

TEST(ImportLabelMap, NamesAndTissuesOfTotalSegmentatorAreBuiltIn) {
    const TemporaryFolder folder;
    const auto imported = import_label_map(
        folder.write("a.nii.gz", testing::gzip_bytes(testing::nifti_bytes(ras_volume()))));
    ASSERT_TRUE(imported.has_value()) << imported.error().message();
    const auto& labels = imported->labels.labels;
    ASSERT_EQ(labels.size(), 4u);
    EXPECT_EQ(labels[0].name, "outside");
    EXPECT_EQ(labels[1].name, "spleen");
    EXPECT_EQ(labels[2].name, "kidney_right");
    EXPECT_EQ(labels[3].name, "liver");
    EXPECT_EQ(labels[3].tissue, "liver");
    EXPECT_EQ(labels[3].source_value, kLiver);
    // Nothing but the numbers says so, and these three fit other numberings as well.
    ASSERT_EQ(imported->report.warnings.size(), 1u);
    EXPECT_NE(imported->report.warnings[0].find("TotalSegmentator v2 total (1 spleen"),
              std::string::npos);
}

TEST(ImportLabelMap, HeaderExtensionNamesValues) {
    const TemporaryFolder folder;
    const std::string xml =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?> <CaretExtension><VolumeInformation Index=\"0\">"
        "<LabelTable>"
        "<Label Key=\"1\" Red=\"0.5\" Green=\"0.25\" Blue=\"1.0\" "
        "Alpha=\"1\"><![CDATA[uterus]]></Label>\n"
        "<Label Key=\"2\" Red=\"1\" Green=\"0\" Blue=\"0\" Alpha=\"1\">fat &amp; skin</Label>"
        "</LabelTable></VolumeInformation></CaretExtension>";
    const auto imported =
        import_label_map(folder.write("a.nii", testing::nifti_bytes(ras_volume(), xml)));
    expect_body(imported);
    const auto& labels = imported->labels.labels;
    EXPECT_EQ(labels[1].name, "uterus");
    EXPECT_EQ(labels[1].colour, (std::array<std::uint8_t, 3>{128, 64, 255}));
    EXPECT_EQ(labels[2].name, "fat & skin");
    // Not in the extension, which shows that TotalSegmentator did not number the values.
    EXPECT_EQ(labels[3].name, "label_5");
}

TEST(ImportLabelMap, SideTableAndGivenTableNameValues) {
    const TemporaryFolder folder;
    const std::string map = folder.write("map.nii", testing::nifti_bytes(ras_volume()));
    folder.write("map.csv",
                 "value,name,tissue_class\n1,stomach_content,gas\n2,kidney_right,kidney\n");
    auto beside = import_label_map(map);
    ASSERT_TRUE(beside.has_value()) << beside.error().message();
    EXPECT_EQ(beside->labels.labels[1].name, "stomach_content");
    EXPECT_EQ(beside->labels.labels[1].tissue, "gas");  // the class wins over the name
    ImportOptions options;
    options.table = folder.write("other.csv", "1;first\n2;second\n5;third\n");
    auto given = import_label_map(map, options);
    ASSERT_TRUE(given.has_value()) << given.error().message();
    EXPECT_EQ(given->labels.labels[1].name, "first");
    EXPECT_EQ(given->labels.labels[3].name, "third");
}

TEST(ImportLabelMap, UnnamedValuesAreKeptAndToldOf) {
    const TemporaryFolder folder;
    TinyVolume volume = ras_volume();
    for (auto& voxel : volume.voxels)
        if (voxel == kSpleen) voxel = 222;
    const auto imported = import_label_map(folder.write("a.nii", testing::nifti_bytes(volume)));
    ASSERT_TRUE(imported.has_value());
    EXPECT_EQ(imported->labels.labels.back().name, "label_222");
    ASSERT_EQ(imported->report.warnings.size(), 2u);
    EXPECT_NE(imported->report.warnings[1].find("222"), std::string::npos);
}

// Left and right are then what the reader assumes.
TEST(ImportLabelMap, NiftiWithoutOrientationIsReadWithAWarning) {
    const TemporaryFolder folder;
    std::string bytes = testing::nifti_bytes(ras_volume());
    const auto oriented = import_label_map(folder.write("a.nii", bytes));
    ASSERT_TRUE(oriented.has_value());
    bytes[252] = bytes[253] = bytes[254] = bytes[255] = 0;  // qform_code, sform_code
    for (const char* name : {"b.nii", "b.nii.gz"}) {
        const bool packed = std::string(name).ends_with(".gz");
        const auto imported =
            import_label_map(folder.write(name, packed ? testing::gzip_bytes(bytes) : bytes));
        ASSERT_TRUE(imported.has_value()) << imported.error().message();
        const auto& warnings = imported->report.warnings;
        ASSERT_EQ(warnings.size(), oriented->report.warnings.size() + 1);
        const auto told = std::find_if(warnings.begin(), warnings.end(), [](const auto& w) {
            return w.find("right and left may be exchanged") != std::string::npos;
        });
        EXPECT_NE(told, warnings.end());
    }
}

TEST(ImportLabelMap, SegmentsOfSlicerKeepNamesColoursAndLayers) {
    const TemporaryFolder folder;
    // Two layers: the liver in the first, a vessel inside it and a cyst in the second.
    TinyVolume volume = ras_volume();
    std::vector<std::uint8_t> layered;
    std::size_t n = 0;
    for (int k = 0; k < volume.size.z; ++k)
        for (int j = 0; j < volume.size.y; ++j)
            for (int i = 0; i < volume.size.x; ++i, ++n) {
                layered.push_back(volume.voxels[n] != 0 ? 1 : 0);
                layered.push_back(volume.voxels[n] != 0 && i == 20 ? 1
                                  : volume.voxels[n] && i == 30    ? 2
                                                                   : 0);
            }
    volume.voxels = layered;
    volume.layers = 2;
    const auto imported = import_label_map(folder.write(
        "s.seg.nrrd",
        testing::nrrd_bytes(
            volume,
            "Segment0_Name:=liver\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n"
            "Segment0_Color:=1 0.5 0\n"
            "Segment1_Name:=my vessel\nSegment1_LabelValue:=1\nSegment1_Layer:=1\n"
            "Segment2_Name:=kidney_cyst_left\nSegment2_LabelValue:=2\nSegment2_Layer:=1\n")));
    ASSERT_TRUE(imported.has_value()) << imported.error().message();
    const auto& labels = imported->labels.labels;
    ASSERT_EQ(labels.size(), 4u);
    EXPECT_EQ(name_at(imported->labels, kCorner + Vector3{40, 32, 24}), "my vessel");
    EXPECT_EQ(name_at(imported->labels, kCorner + Vector3{60, 32, 24}), "kidney_cyst_left");
    EXPECT_EQ(name_at(imported->labels, kCorner + Vector3{50, 32, 24}), "liver");
    for (const Label& label : labels)
        if (label.name == "liver") {
            EXPECT_EQ(label.colour, (std::array<std::uint8_t, 3>{255, 128, 0}));
        }
}

TEST(ImportLabelMap, FolderOfMasksIsOneMapAndSmallStructuresWin) {
    const TemporaryFolder folder;
    for (const auto& [name, value] : {std::pair{"liver", kLiver}, {"spleen", kSpleen}}) {
        TinyVolume mask = ras_volume();
        for (auto& voxel : mask.voxels) voxel = voxel == value;
        folder.write(std::string("masks/") + name + ".nii.gz",
                     testing::gzip_bytes(testing::nifti_bytes(mask)));
    }
    TinyVolume rest = ras_volume();  // overlaps both
    for (auto& voxel : rest.voxels) voxel = voxel != 0;
    folder.write("masks/kidney_right.nii.gz", testing::gzip_bytes(testing::nifti_bytes(rest)));
    TinyVolume absent = ras_volume();
    for (auto& voxel : absent.voxels) voxel = 0;
    folder.write("masks/pancreas.nii.gz", testing::gzip_bytes(testing::nifti_bytes(absent)));
    const auto imported = import_label_map(folder / "masks");
    expect_body(imported);
    EXPECT_EQ(imported->labels.labels.size(), 4u);
    ASSERT_EQ(imported->report.warnings.size(), 1u);
    EXPECT_NE(imported->report.warnings[0].find("more than one structure"), std::string::npos);
}

TEST(ImportLabelMap, RealSegmentationHasItsPublishedVolumes) {
    const std::string path = std::string(SONOCASE_DATA) + "/ct/labels.nii.gz";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is absent";
    const auto imported = import_label_map(path);
    ASSERT_TRUE(imported.has_value()) << imported.error().message();
    EXPECT_EQ(imported->labels.labels.size(), 68u);
    std::size_t liver = 0;
    for (const std::uint8_t voxel : imported->labels.voxels)
        liver += imported->labels.labels[voxel].name == "liver";
    EXPECT_EQ(liver, 41692u);  // ct/labels.csv
    EXPECT_EQ(name_at(imported->labels, {66.6, 185.3, 392.3}), "liver");
}

}  // namespace
}  // namespace sonocase::pipeline
