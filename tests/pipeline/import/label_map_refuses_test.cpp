// SPDX-License-Identifier: Apache-2.0

// Bad input to import: one line that names the file, what was found and what to do.
#include "pipeline/import/volume/label_map.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "pipeline/import/volume/volume_file.h"
#include "support/temporary_folder.h"
#include "three_boxes.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
using testing::TinyVolume;

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
            EXPECT_EQ(size_in_headers(pipe).bytes, 0u);
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
            EXPECT_EQ(size_in_headers(path).bytes, 0u);
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

TEST(ImportLabelMapRefuses, SlantedAxesAndSaysWhatToDo) {
    const TemporaryFolder folder;
    TinyVolume slanted = ras_volume();
    slanted.columns(1, 2) = 0.3 * slanted.columns(2, 2);  // the tilt of a gantry
    for (const auto& [name, bytes] : {std::pair{"a.nii", testing::nifti_bytes(slanted)},
                                      {"a.nrrd", testing::nrrd_bytes(slanted)},
                                      {"a.mha", testing::mha_bytes(slanted)}}) {
        const std::string path = folder.write(name, bytes);
        const auto imported = import_label_map(path);
        expect_refused(imported, path, "not at right angles");
        EXPECT_NE(imported.error().expected.find("--resample-shear"), std::string::npos);
        ImportOptions options;  // the advice works
        options.reading.resample_shear = true;
        EXPECT_TRUE(import_label_map(path, options).has_value()) << name;
    }
}

TEST(ImportLabelMapRefuses, TorsoInMetresOrMicrometresAndNamesTheFactor) {
    const TemporaryFolder folder;
    for (const auto& [unit, factor] : {std::pair{0.001, "1000"}, {1000.0, "0.001"}}) {
        TinyVolume volume = ras_volume();
        for (int row = 0; row < 3; ++row) {
            for (int column = 0; column < 3; ++column) volume.columns(row, column) *= unit * 4;
            volume.origin[row] *= unit * 4;
        }
        for (const auto& [name, bytes] : {std::pair{"a.nrrd", testing::nrrd_bytes(volume)},
                                          {"a.nii", testing::nifti_bytes(volume)},
                                          {"a.mha", testing::mha_bytes(volume)}}) {
            const std::string path = folder.write(name, bytes);
            const auto imported = import_label_map(path);
            expect_refused(imported, path, "body is");
            EXPECT_NE(imported.error().expected.find(std::string("--scale ") + factor),
                      std::string::npos)
                << imported.error().message();
            ImportOptions options;
            options.scale = 1 / unit;
            options.names = "none";  // the boxes are no organs
            EXPECT_TRUE(import_label_map(path, options).has_value());
        }
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

}  // namespace
}  // namespace sonocase::pipeline
