// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/label_map.h"

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

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
using testing::TinyVolume;

constexpr int kSpleen = 1, kKidneyRight = 2, kLiver = 5;

// Three boxes in RAS+ mm inside [0, 96] x [0, 64] x [0, 48], so unlike that no turning or flipping
// of the axes maps them onto themselves.
int body_at(Point3 p) {
    if (p.x < 8 || p.x > 84 || p.y < 6 || p.y > 58 || p.z < 4 || p.z > 44) return 0;
    if (p.x > 60 && p.y > 40) return kLiver;
    if (p.x < 30 && p.z < 20) return kSpleen;
    return kKidneyRight;
}

const Vector3 kExtent{96, 64, 48}, kSpacing{2, 4, 3};
const Point3 kCorner{-20, 15, 300};

int shifted_body(Point3 p) {
    return body_at(Point3{} + (p - kCorner));
}

TinyVolume ras_volume() {
    return testing::sample_in_order({0, 1, 2}, {false, false, false}, kExtent, kSpacing, kCorner,
                                    shifted_body);
}

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
    EXPECT_TRUE(imported->report.warnings.empty());
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
    EXPECT_EQ(labels[3].name, "liver");  // not in the extension: the built-in class
}

TEST(ImportLabelMap, SideTableAndGivenTableNameValues) {
    const TemporaryFolder folder;
    const std::string map = folder.write("map.nii", testing::nifti_bytes(ras_volume()));
    folder.write("map.csv", "value,name,tissue_class\n1,mystery,gas\n2,kidney_right,kidney\n");
    auto beside = import_label_map(map);
    ASSERT_TRUE(beside.has_value()) << beside.error().message();
    EXPECT_EQ(beside->labels.labels[1].name, "mystery");
    EXPECT_EQ(beside->labels.labels[1].tissue, "gas");  // of the class, as the name says nothing
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
    ASSERT_EQ(imported->report.warnings.size(), 1u);
    EXPECT_NE(imported->report.warnings[0].find("222"), std::string::npos);
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

TEST(ImportLabelMap, DicomSeriesIsReadInAnyFileOrder) {
    const TemporaryFolder folder;
    const TinyVolume volume = ras_volume();
    for (int k = 0; k < volume.size.z; ++k) {
        char name[32];
        std::snprintf(name, sizeof name, "series/s%03d.dcm", (k * 7) % volume.size.z);
        folder.write(name, testing::dicom_slice(volume, k, "1.2.3.5"));
    }
    expect_body(import_label_map(folder / "series"));
}

TEST(ImportLabelMap, MissingDicomSliceIsRefused) {
    const TemporaryFolder folder;
    const TinyVolume volume = ras_volume();
    for (int k = 0; k < volume.size.z; ++k)
        if (k != 7)
            folder.write("series/s" + std::to_string(k) + ".dcm",
                         testing::dicom_slice(volume, k, "1.2.3.5"));
    const auto imported = import_label_map(folder / "series");
    ASSERT_FALSE(imported.has_value());
    EXPECT_NE(imported.error().what.find("unevenly spaced"), std::string::npos)
        << imported.error().message();
}

// ---- bad input: one line that names the file, what was found and what to do
// -------------------------

void expect_refused(const Result<ImportedLabels>& imported,
                    const std::string& path,
                    const std::string& what) {
    ASSERT_FALSE(imported.has_value());
    const Error& error = imported.error();
    EXPECT_NE(error.where.find(path), std::string::npos) << error.message();
    EXPECT_NE(error.what.find(what), std::string::npos) << error.message();
    EXPECT_FALSE(error.expected.empty()) << error.message();
    EXPECT_EQ(error.message().find('\n'), std::string::npos) << error.message();
}

TEST(ImportLabelMapRefuses, WhatIsNotThere) {
    const TemporaryFolder folder;
    expect_refused(import_label_map(folder / "no.nii.gz"), folder / "no.nii.gz", "no such file");
}

// Without the check each of these would wait or read for ever.
TEST(ImportLabelMapRefuses, PipesAndDevicesWithoutOpeningThem) {
    const TemporaryFolder folder;
    for (const char* name :
         {"a.nii", "a.nii.gz", "a.nrrd", "a.nhdr", "a.mha", "a.mhd", "a.labels"}) {
        const std::string pipe = folder / name;
        ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
        expect_refused(import_label_map(pipe), pipe, "is a pipe");
        if (is_volume_file_name(pipe)) {
            EXPECT_EQ(voxel_bytes_in_header(pipe), 0u);
        }
        const std::string device = folder / (std::string("zero_") + name);
        std::filesystem::create_symlink("/dev/zero", device);
        expect_refused(import_label_map(device), device, "is a device");
    }
}

TEST(ImportLabelMapRefuses, PipesAndDevicesThatAHeaderRefersTo) {
    const TemporaryFolder folder;
    ASSERT_EQ(mkfifo((folder / "pipe.raw").c_str(), 0600), 0);
    std::filesystem::create_symlink("/dev/zero", folder / "zero.raw");
    const std::string meta =
        "ObjectType = Image\nNDims = 3\nDimSize = 4 4 4\nElementType = MET_UCHAR\n"
        "ElementDataFile = ";
    const std::string nrrd =
        "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nencoding: raw\ndata file: ";
    for (const auto& [data, what] :
         {std::pair{"pipe.raw", "is a pipe"}, std::pair{"zero.raw", "is a device"}}) {
        for (const auto& [name, head] :
             {std::pair{"h.mhd", meta}, std::pair{"h.nhdr", nrrd}, std::pair{"h.nrrd", nrrd}}) {
            const std::string path = folder.write(name, head + data + "\n");
            expect_refused(import_label_map(path), data, what);
            EXPECT_EQ(voxel_bytes_in_header(path), 0u);
        }
    }
    const std::string list = folder.write("l.mhd", meta + "LIST\npipe.raw\n");
    expect_refused(import_label_map(list), "raw", "is a ");
    const std::string absent = folder.write("n.nhdr", nrrd + "absent.raw\n");
    expect_refused(import_label_map(absent), absent, "is not there");
}

TEST(ImportLabelMapRefuses, FoldersThatHoldAPipe) {
    const TemporaryFolder folder;
    folder.write("slices/a.dcm", "no DICOM");
    ASSERT_EQ(mkfifo((folder / "slices/b.dcm").c_str(), 0600), 0);
    expect_refused(import_label_map(folder / "slices"), "b.dcm", "is a pipe");
    TinyVolume mask = ras_volume();
    for (auto& voxel : mask.voxels) voxel = voxel != 0;
    folder.write("masks/a.nii", testing::nifti_bytes(mask));
    ASSERT_EQ(mkfifo((folder / "masks/b.nii").c_str(), 0600), 0);
    expect_refused(import_label_map(folder / "masks"), "b.nii", "is a pipe");
}

TEST(ImportLabelMapRefuses, EveryTruncationOfEveryFormat) {
    const TemporaryFolder folder;
    const TinyVolume volume = ras_volume();
    const std::pair<const char*, std::string> files[] = {
        {"a.nii", testing::nifti_bytes(volume)},
        {"a.nii.gz", testing::gzip_bytes(testing::nifti_bytes(volume))},
        {"a.nrrd", testing::nrrd_bytes(volume)},
        {"z.nrrd", testing::nrrd_bytes(volume, "", true, /*gzip=*/true)},
        {"z.mha", testing::mha_bytes(volume, /*compressed=*/true)},
        {"a.mha", testing::mha_bytes(volume)},
    };
    for (const auto& [name, bytes] : files) {
        const std::string whole = folder.write(name, bytes);
        ASSERT_TRUE(import_label_map(whole).has_value()) << name;
        // 61 lengths spread over the file, and the last bytes one by one.
        std::vector<std::size_t> lengths;
        for (std::size_t n = 0; n < 61; ++n) lengths.push_back(bytes.size() * n / 61);
        for (std::size_t n = 1; n <= 9; ++n) lengths.push_back(bytes.size() - n);
        for (const std::size_t length : lengths) {
            const auto cut = import_label_map(folder.write(name, bytes.substr(0, length)));
            EXPECT_FALSE(cut.has_value()) << name << " cut to " << length << " of " << bytes.size();
        }
    }
}

TEST(ImportLabelMapRefuses, MapWithoutBody) {
    const TemporaryFolder folder;
    TinyVolume volume = ras_volume();
    for (auto& voxel : volume.voxels) voxel = 0;
    const std::string path = folder.write("a.nii", testing::nifti_bytes(volume));
    expect_refused(import_label_map(path), path, "no body");
}

TEST(ImportLabelMapRefuses, TwoLabelsOfOneName) {
    const TemporaryFolder folder;
    const std::string path = folder.write("a.nii", testing::nifti_bytes(ras_volume()));
    ImportOptions options;
    options.table = folder.write("t.csv", "value,name\n1,liver\n5,liver\n");
    expect_refused(import_label_map(path, options), path, "two labels are named 'liver'");
}

TEST(ImportLabelMapRefuses, ValueOfTwoNames) {
    const TemporaryFolder folder;
    const std::string path = folder.write("a.nii", testing::nifti_bytes(ras_volume()));
    ImportOptions options;
    options.table = folder.write("t.csv", "value,name\n1,liver\n1,spleen\n");
    expect_refused(import_label_map(path, options), options.table, "two names");
}

TEST(ImportLabelMapRefuses, MoreLabelsThanFit) {
    const TemporaryFolder folder;
    TinyVolume volume = ras_volume();
    for (std::size_t n = 0; n < volume.voxels.size(); ++n)
        volume.voxels[n] = static_cast<std::uint8_t>(n % 256);
    const std::string path = folder.write("a.nii", testing::nifti_bytes(volume));
    expect_refused(import_label_map(path), path, "255 labels");
}

TEST(ImportLabelMapRefuses, TorsoInMetresOrMicrometresAndNamesTheFactor) {
    const TemporaryFolder folder;
    for (const auto& [unit, factor] : {std::pair{0.001, "1000"}, {1000.0, "0.001"}}) {
        TinyVolume volume = ras_volume();
        for (int row = 0; row < 3; ++row) {
            for (int column = 0; column < 3; ++column) volume.columns(row, column) *= unit * 4;
            volume.origin[row] *= unit * 4;
        }
        const std::string path = folder.write("a.nrrd", testing::nrrd_bytes(volume));
        const auto imported = import_label_map(path);
        expect_refused(imported, path, "body is");
        EXPECT_NE(imported.error().expected.find(std::string("--scale ") + factor),
                  std::string::npos)
            << imported.error().message();
        ImportOptions options;
        options.scale = 1 / unit;
        EXPECT_TRUE(import_label_map(path, options).has_value());
    }
}

TEST(ImportLabelMapRefuses, MasksOnDifferentGrids) {
    const TemporaryFolder folder;
    folder.write("m/liver.nii", testing::nifti_bytes(ras_volume()));
    TinyVolume moved = ras_volume();
    moved.origin.x += 5;
    for (auto& voxel : moved.voxels) voxel = voxel != 0;
    folder.write("m/spleen.nii", testing::nifti_bytes(moved));
    TinyVolume first = ras_volume();
    for (auto& voxel : first.voxels) voxel = voxel != 0;
    folder.write("m/liver.nii", testing::nifti_bytes(first));
    expect_refused(import_label_map(folder / "m"), "spleen.nii", "another grid");
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
