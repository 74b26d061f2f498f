// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>

#include "pipeline/export/export_level_sets.h"
#include "pipeline/export/nrrd_file.h"
#include "pipeline/export/segmentation_pictures.h"
#include "pipeline/import/volume/label_map.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::cubic_grid;
using sonocase::testing::norm_of;
using sonocase::testing::sample_labels;

std::string scratch(const std::string& name) {
    const auto folder = std::filesystem::temp_directory_path() / "sonocase_export_labels_test";
    std::filesystem::create_directories(folder);
    return (folder / name).string();
}

LabelVolume torso_sized() {
    Grid grid = cubic_grid(40, 8);
    LabelVolume volume = sample_labels(grid, 3, [](Point3 p) {
        return norm_of(p) > 140 ? 0 : norm_of(p) < 50 ? 2 : 1;
    });
    volume.labels[1].name = "other_fat";
    volume.labels[2].name = "liver";
    volume.labels[2].colour = {150, 70, 48};
    return volume;
}

// Read by ITK, which shares no code with the writer.
TEST(ExportSegNrrd, ReadsBackWithNamesColoursAndPlace) {
    const LabelVolume volume = torso_sized();
    const std::string path = scratch("labels.seg.nrrd");
    ASSERT_TRUE(export_seg_nrrd(volume, path));
    const auto back = import_label_map(path);
    ASSERT_TRUE(back) << back.error().message();
    const LabelVolume& read = back->labels;
    EXPECT_EQ(read.grid.size, volume.grid.size);
    // Twelve digits of text at least.
    EXPECT_NEAR(norm(read.grid.origin_mm - volume.grid.origin_mm), 0, 1e-9);
    ASSERT_EQ(read.labels.size(), 3u);
    EXPECT_EQ(read.labels[1].name, "other_fat");
    EXPECT_EQ(read.labels[2].name, "liver");
    // Four decimals of a colour in [0, 1] are exact to a step of 255.
    EXPECT_EQ(read.labels[2].colour, volume.labels[2].colour);
    EXPECT_EQ(read.voxels, volume.voxels);
}

// Whatever order of axes the reader brings, every voxel has its label at its place in the room.
TEST(ExportSegNrrd, ObliqueGridsKeepTheirPlace) {
    LabelVolume volume = torso_sized();
    volume.grid.direction = rotation_about(normalized({0.3, 1, 0.5}), 0.3) *
                            Matrix3::from_columns({0, -1, 0}, {1, 0, 0}, {0, 0, 1});
    volume.grid.spacing_mm = {7, 8, 9};
    volume.grid.origin_mm = {40, -90, 130};
    // Nothing about it is symmetric.
    for (std::size_t v = 0; v < volume.voxels.size() / 3; ++v)
        if (volume.voxels[v] == 2) volume.voxels[v] = 1;
    const std::string path = scratch("oblique.seg.nrrd");
    ASSERT_TRUE(export_seg_nrrd(volume, path));
    const auto back = import_label_map(path);
    ASSERT_TRUE(back) << back.error().message();
    const LabelVolume& read = back->labels;
    ASSERT_EQ(read.voxels.size(), volume.voxels.size());
    const Grid& g = read.grid;
    std::size_t wrong = 0;
    for (int k = 0; k < g.size.z; ++k) {
        for (int j = 0; j < g.size.y; ++j) {
            for (int i = 0; i < g.size.x; ++i) {
                const Point3 v =
                    volume.grid.voxel_from_point(g.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k}));
                const int x = static_cast<int>(std::lround(v.x)),
                          y = static_cast<int>(std::lround(v.y)),
                          z = static_cast<int>(std::lround(v.z));
                ASSERT_TRUE(volume.grid.contains(x, y, z));
                ASSERT_LT(norm(v - Point3{1.0 * x, 1.0 * y, 1.0 * z}), 1e-6);
                wrong += read.voxels[g.index(i, j, k)] != volume.voxels[volume.grid.index(x, y, z)];
            }
        }
    }
    EXPECT_EQ(wrong, 0u);
}

// The header's lines as 3D Slicer documents them for .seg.nrrd, read as text by no library of ours.
TEST(ExportSegNrrd, HeaderIsWhat3DSlicerReads) {
    LabelVolume volume = torso_sized();
    volume.labels[2].tissue = "liver";
    const std::string path = scratch("header.seg.nrrd");
    ASSERT_TRUE(export_seg_nrrd(volume, path));
    std::ifstream file(path, std::ios::binary);
    std::set<std::string> lines;
    for (std::string line; std::getline(file, line) && !line.empty();) lines.insert(line);
    for (const char* line :
         {"dimension: 3", "sizes: 40 40 40", "kinds: domain domain domain",
          "Segmentation_MasterRepresentation:=Binary labelmap",
          "Segmentation_SourceRepresentation:=Binary labelmap",
          "Segmentation_ReferenceImageExtentOffset:=0 0 0",
          "Segmentation_ContainedRepresentationNames:=Binary labelmap|", "Segment0_Name:=other_fat",
          "Segment0_LabelValue:=1", "Segment0_Layer:=0", "Segment1_ID:=liver",
          "Segment1_Name:=liver", "Segment1_LabelValue:=2", "Segment1_Layer:=0",
          "Segment1_Color:=0.5882 0.2745 0.1882", "Segment1_Tags:=sonocase.tissue:liver|"})
        EXPECT_TRUE(lines.count(line)) << line;
    EXPECT_FALSE(lines.count("Segment2_Name:=outside"));
    // Inclusive, and of the whole layer for each segment: Slicer cuts a layer to its first one's.
    EXPECT_TRUE(lines.count("Segment0_Extent:=0 39 0 39 0 39"));
    EXPECT_TRUE(lines.count("Segment1_Extent:=0 39 0 39 0 39"));
}

TEST(ExportLevelSets, WritesAndRefuses) {
    const LabelVolume volume = torso_sized();
    const std::string path = scratch("labels.vdb");
    std::filesystem::remove(path);
    const auto done = export_level_sets(volume, path);
    ASSERT_TRUE(done) << done.error().message();
    EXPECT_GT(std::filesystem::file_size(path), 1000u);
    const auto unknown = export_level_sets(volume, path, {.labels = {"livr"}});
    ASSERT_FALSE(unknown);
    EXPECT_NE(unknown.error().message().find("liver"), std::string::npos);
    LabelVolume thick = volume;
    thick.grid.spacing_mm.z = 20;
    EXPECT_FALSE(export_level_sets(thick, path));
}

// A ball of 50 mm in voxels of 8 mm, seen from its middle and from 20 mm outside of it.
TEST(SegmentationPictures, ALabelIsMissedBeyondTheReachOfSteps) {
    const LabelVolume volume = torso_sized();
    EXPECT_TRUE(label_is_within(volume, 2, 0, {19.5, 19.5, 19.5}));
    EXPECT_FALSE(label_is_within(volume, 1, 4, {19.5, 19.5, 19.5}));
    EXPECT_FALSE(label_is_within(volume, 2, 2, {19.5 + 70 / 8.0, 19.5, 19.5}));
    EXPECT_TRUE(label_is_within(volume, 2, 4, {19.5 + 70 / 8.0, 19.5, 19.5}));
    EXPECT_TRUE(label_is_within(volume, 0, 1, {-3, 0, 0}));
}

TEST(SegmentationPictures, SixPicturesAreWritten) {
    const LabelVolume volume = torso_sized();
    const std::string folder = scratch("pictures");
    std::filesystem::remove_all(folder);
    ASSERT_TRUE(write_segmentation_pictures({volume, nullptr, volume, {}}, folder));
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
        count += entry.path().extension() == ".png";
    }
    EXPECT_EQ(count, 6);
}

}  // namespace
}  // namespace sonocase::pipeline
