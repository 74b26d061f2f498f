// SPDX-License-Identifier: Apache-2.0

// Each refusal of a label map, a table of names, a folder of masks or of DICOM files, and what its
// advice leads to: the advice is followed, and the input is read.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <vector>

#include "pipeline/import/volume/label_map.h"
#include "support/temporary_folder.h"
#include "three_boxes.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
using testing::TinyVolume;
using Read = std::function<Result<ImportedLabels>()>;

template <class T>
std::string with(std::string bytes, std::size_t at, T value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
    return bytes;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

// The map as NIfTI of another type of voxels.
template <class T>
std::string nifti_of(std::int16_t datatype, const std::function<T(std::size_t, int)>& value) {
    const TinyVolume volume = ras_volume();
    std::string bytes = with(with(testing::nifti_bytes(volume), 70, datatype), 72,
                             static_cast<std::int16_t>(8 * sizeof(T)));
    bytes.resize(352);
    for (std::size_t n = 0; n < volume.voxels.size(); ++n) {
        const T v = value(n, volume.voxels[n]);
        bytes.append(reinterpret_cast<const char*>(&v), sizeof v);
    }
    return bytes;
}

class Advice : public ::testing::Test {
  protected:
    // The words of the refusal and of its advice, and what the advice says to do.
    void expect(const char* what, const char* advice, const Read& given, const Read& mended) {
        SCOPED_TRACE(what);
        const auto refused = given();
        ASSERT_FALSE(refused.has_value());
        const Error& error = refused.error();
        const std::string message = error.message();
        EXPECT_NE(error.what.find(what), std::string::npos) << message;
        EXPECT_NE(error.expected.find(advice), std::string::npos) << message;
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        for (const char* foreign : {"itk", "ITK", "vnl", "gdcm", "GDCM", "exception", "nrrdLoad"})
            EXPECT_EQ(message.find(foreign), std::string::npos) << message;
        const auto read = mended();
        EXPECT_TRUE(read.has_value()) << read.error().message();
    }
    Read map(const std::string& name, const std::string& bytes, ImportOptions options = {}) {
        return [=, this] { return import_label_map(folder_.write(name, bytes), options); };
    }
    Read at(const std::string& path, ImportOptions options = {}) {
        return [=] { return import_label_map(path, options); };
    }
    // The map with a table of this name and text.
    Read table(const std::string& name, const std::string& text) {
        return [=, this] {
            ImportOptions options;
            options.table = folder_.write(name, text);
            return import_label_map(folder_.write("map.nii", good_), options);
        };
    }
    void series(const std::string& name, const std::string& uid = "1.2.3.5", int without = -1) {
        for (int k = 0; k < volume_.size.z; ++k)
            if (k != without)
                folder_.write(name + "/s" + std::to_string(k),
                              testing::dicom_slice(volume_, k, uid));
    }
    testing::TinyObject segmentation() const {
        testing::TinyObject object;
        object.segments = {{1, "spleen", {kSpleen}, ""}, {2, "kidney right", {kKidneyRight}, ""}};
        object.between_mm = object.thickness_mm = kSpacing.z;
        return object;
    }

    const TinyVolume volume_ = ras_volume();
    const std::string good_ = testing::nifti_bytes(volume_);
    const TemporaryFolder folder_{/*in_memory=*/true};
};

TEST_F(Advice, OfFilesLeadsToFilesThatAreRead) {
    expect("not a known volume file name", ".nii", map("map.vol", good_), map("map.nii", good_));
    expect("an Analyze or NIfTI pair", ".nii.gz", map("map.img", good_),
           map("map.nii.gz", testing::gzip_bytes(good_)));
    expect("packed with gzip twice", "gunzip",
           map("g.nii.gz", testing::gzip_bytes(testing::gzip_bytes(good_))),
           map("g.nii.gz", testing::gzip_bytes(good_)));
    expect("it is an NRRD file", ".nrrd", map("n.nii", testing::nrrd_bytes(volume_)),
           map("n.nrrd", testing::nrrd_bytes(volume_)));
    std::string damaged = testing::gzip_bytes(good_);
    damaged[damaged.size() - 6] ^= 0x55;  // the checksum
    expect("damaged compression", "copy or export it again", map("d.nii.gz", damaged),
           map("d.nii.gz", testing::gzip_bytes(good_)));
    expect("file is empty", "export it again", map("e.nii", ""), map("e.nii", good_));
    expect("no such file", "check the path", at(folder_ / "mpa.nii"), at(folder_ / "map.nii"));
    expect("holds", "copy or export it again", map("c.nii", good_.substr(0, 900)),
           map("c.nii", good_));
    expect("NIfTI", "copy or export it again", map("c.nii", std::string(400, 'x')),
           map("c.nii", good_));
    for (const char* name : {"c.nrrd", "c.mha"}) {
        const std::string bytes =
            name[2] == 'n' ? testing::nrrd_bytes(volume_) : testing::mha_bytes(volume_);
        expect("", "export it again", map(name, bytes.substr(0, bytes.size() - 9)),
               map(name, bytes));
    }
    expect("a pointer of Git LFS", "git lfs pull",
           map("l.nii.gz", "version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 9\n"),
           map("l.nii.gz", testing::gzip_bytes(good_)));
    expect("is a web page", "download the file itself",
           map("w.nii.gz", "\n<!DOCTYPE html><html>Sign in</html>"),
           map("w.nii.gz", testing::gzip_bytes(good_)));
    expect("is a zip archive", "unpack it", map("z.nrrd", "PK\x03\x04" + std::string(60, 'x')),
           map("z.nrrd", testing::nrrd_bytes(volume_)));
    const auto longer = import_label_map(folder_.write("b.nii", good_ + good_.substr(352)));
    ASSERT_TRUE(longer);  // voxels of two bytes under a header of one, say
    ASSERT_FALSE(longer->report.warnings.empty());
    EXPECT_NE(longer->report.warnings[0].find("12288 bytes more than its header asks for"),
              std::string::npos)
        << longer->report.warnings[0];
    expect("every voxel is 0", "the right file",
           map("z.nii", nifti_of<std::uint8_t>(2, [](std::size_t, int) { return 0; })),
           map("z.nii", good_));
}

TEST_F(Advice, OfVoxelsLeadsToLabels) {
    const auto floats = [](float inside) {
        return nifti_of<float>(16, [=](std::size_t, int label) {
            return label == kLiver ? inside : static_cast<float>(label);
        });
    };
    expect("such as 4.5", "a label map", map("f.nii", floats(4.5f)), map("f.nii", floats(4)));
    expect("is not a number (NaN)", "write 0 in their place",
           map("f.nii", floats(std::numeric_limits<float>::quiet_NaN())), map("f.nii", floats(0)));
    expect("as large as 3000000000", "number them anew", map("f.nii", floats(3e9f)),
           map("f.nii", floats(7)));
    const auto many = [](int most) {
        return nifti_of<std::int16_t>(4, [=](std::size_t n, int label) {
            return static_cast<std::int16_t>(label == 0 ? 0 : 1 + n % most);
        });
    };
    ImportOptions nameless;
    nameless.names = "none";
    expect("more than 255 labels", "merge or drop labels", map("m.nii", many(300), nameless),
           map("m.nii", many(200), nameless));
    expect("voxels of NIfTI type 128", "whole numbers, one per voxel",
           map("t.nii", with(good_, 70, std::int16_t{128})), map("t.nii", good_));
}

TEST_F(Advice, OfGeometryLeadsToAGeometry) {
    TinyVolume slanted = volume_;
    slanted.columns(0, 2) = 1;
    const std::string slant = testing::nifti_bytes(slanted);
    ImportOptions resample;
    resample.reading.resample_shear = true;
    expect("not at right angles", "--resample-shear", map("s.nii", slant),
           map("s.nii", slant, resample));

    TinyVolume metres = volume_;
    for (double& entry : metres.columns.m) entry /= 1000;
    const std::string small = with(testing::nifti_bytes(metres), 123, std::uint8_t{0});
    expect("0.078 x 0.052 x 0.039 mm", "write the file in millimetres", map("u.nii", small),
           map("u.nii", good_));

    ImportOptions qform;
    qform.reading.orientation = Orientation::qform;
    expect("there is no qform", "--orientation qform asks for it", map("q.nii", good_, qform),
           map("q.nii", good_));
    expect("spans no volume", "", map("q.nii", with(good_, 280, 0.0f)), map("q.nii", good_));
    expect("(dim)", "1 to 65535", map("d.nii", with(good_, 46, std::int16_t{0})),
           map("d.nii", good_));
    expect("an image of", "three dimensions", map("d.nii", with(good_, 40, std::int16_t{2})),
           map("d.nii", good_));
    const std::string two_steps =
        with(with(good_, 40, std::int16_t{4}), 48, std::int16_t{2}) + good_.substr(352);
    expect("2 channels", "export one time step", map("t.nii", two_steps),
           map("t.nii", with(two_steps, 48, std::int16_t{1})));

    const std::string nrrd = testing::nrrd_bytes(volume_);
    const std::string sizes = "sizes: 48 16 16";
    const auto changed = [&](const std::string& from, const std::string& to) {
        return map("n.nrrd", replaced(nrrd, from, to));
    };
    const Read whole = map("n.nrrd", nrrd);
    expect("sizes", "with its geometry", changed(sizes, "sizes: 48 16 nan"), whole);
    expect("sizes of the header holds 0", "1 to 65535", changed(sizes, "sizes: 48 16 0"), whole);
    expect("an image of", "three dimensions",
           changed("space: left-posterior-superior\nsizes: 48 16 16\nspace directions:",
                   "sizes: 48 16\ncomment:"),
           whole);
    expect("space directions of the header are 4", "with its geometry",
           changed("\nkinds:", " (0,0,3)\nkinds:"), whole);
    expect("names the unit", "in millimetres",
           map("n.nrrd", testing::nrrd_bytes(volume_,
                                             "space units: \"furlong\" \"furlong\" "
                                             "\"furlong\"\n")),
           whole);
    expect("differ between axes", "with its geometry",
           map("n.nrrd", testing::nrrd_bytes(volume_, "space units: \"mm\" \"mm\" \"cm\"\n")),
           whole);
    const auto detached = [&](const char* name, const std::string& header) {
        return [=, this] { return import_label_map(folder_.write(name, header)); };
    };
    const std::string head = replaced(nrrd.substr(0, nrrd.find("\n\n") + 1), "encoding: raw\n",
                                      "encoding: raw\ndata file: voxels.raw\n");
    expect("voxels.raw is not there", "keep the two together", detached("h.nhdr", head), [&] {
        folder_.write("voxels.raw", nrrd.substr(nrrd.find("\n\n") + 2));
        return import_label_map(folder_ / "h.nhdr");
    });

    const std::string mha = testing::mha_bytes(volume_);
    expect("ElementSpacing of the header holds 0", "above 0",
           map("m.mha", replaced(mha, "ElementSpacing = 2", "ElementSpacing = 0")),
           map("m.mha", mha));
    expect("is of length 2 and not 1", "sizes in ElementSpacing",
           map("m.mha", replaced(mha, "TransformMatrix = -1", "TransformMatrix = -2")),
           map("m.mha", mha));
}

TEST_F(Advice, OfTablesLeadsToNames) {
    const std::string good = "value,name\n1,spleen\n2,kidney_right\n5,liver\n";
    const Read named = table("t.csv", good);
    expect("label table is empty", "value,name", table("t.csv", "\n"), named);
    expect("no columns 'value' and 'name'", "value,name", table("t.csv", "organ,size\nliver,3\n"),
           named);
    expect("'one' is not a label value", "a whole number",
           table("t.csv", replaced(good, "1,spleen", "one,spleen")), named);
    expect("value 5 has no name", "value,name", table("t.csv", replaced(good, "5,liver", "5,")),
           named);
    expect("numbers in place of names", "value,name", table("t.csv", "1,7\n2,8\n5,9\n"), named);
    expect("has two names", "each value one row", table("t.csv", good + "5,spleen_2\n"), named);
    expect("two labels are named 'spleen'", "its own name",
           table("t.csv", replaced(good, "liver", "spleen")), named);
    expect("is named 'outside'", "rename it", table("t.csv", replaced(good, "liver", "outside")),
           named);
    expect("unknown tissue_class 'livr'", "did you mean 'liver'",
           table("t.csv", "value,name,tissue_class\n1,spleen,\n2,kidney_right,\n5,mass,livr\n"),
           table("t.csv", "value,name,tissue_class\n1,spleen,\n2,kidney_right,\n5,mass,liver\n"));
    expect("UTF-16", "CSV UTF-8",
           table("t.csv", std::string("\xFF\xFE"
                                      "1\0,\0a\0",
                                      8)),
           named);
    expect("not UTF-8", "CSV UTF-8",
           table("t.csv", replaced(good, "liver",
                                   "Gr\xF6\xDF"
                                   "e")),
           table("t.csv", replaced(good, "liver", "Größe")));
    expect("row of 4 cells under 3 names", "in quotation marks",
           table("t.csv", "name,value,note\nleft, lung,1,x\n"),
           table("t.csv", "name,value,note\n\"left, lung\",1,x\n"));
    expect("is a spreadsheet", "as CSV UTF-8", table("t.xlsx", "PK\x03\x04" + std::string(60, 'x')),
           named);
    expect("is a web page", "download", table("t.csv", "<!DOCTYPE html>\n<html>"), named);
    expect("", "labels", table("t.json", "{\"labels\": {}}"),
           table("t.json", "{\"labels\": {\"liver\": 5, \"spleen\": 1, \"kidney_right\": 2}}"));
    expect("region of several values", "one value for each name",
           table("t.json", "{\"labels\": {\"liver\": [5, 1]}}"),
           table("t.json", "{\"labels\": {\"liver\": 5, \"spleen\": 1}}"));
    ImportOptions wrong, right;
    wrong.names = "amso";
    right.names = "amos";
    expect("'amso' is no numbering", "did you mean 'amos'", map("n.nii", good_, wrong),
           map("n.nii", good_, right));
}

TEST_F(Advice, OfFoldersOfMasksLeadsToMasks) {
    const auto mask = [&](int value) {
        return testing::nifti_bytes(
            testing::sample_in_order({0, 1, 2}, {false, false, false}, kExtent, kSpacing, kCorner,
                                     [=](Point3 p) { return shifted_body(p) == value ? 1 : 0; }));
    };
    folder_.write("m/liver.nii", mask(kLiver));
    folder_.write("m/spleen.nii", good_);
    expect("mask holds 4 different values", "by its own path", at(folder_ / "m"),
           at(folder_ / "m/spleen.nii"));
    folder_.write("m/spleen.nii", with(mask(kSpleen), 292, -19.0f));
    expect("lies on another grid than", "resample all masks to one grid", at(folder_ / "m"), [&] {
        folder_.write("m/spleen.nii", mask(kSpleen));
        return import_label_map(folder_ / "m");
    });
    folder_.write("m/spleen.nii.gz", testing::gzip_bytes(mask(kSpleen)));
    expect("two masks are named 'spleen': spleen.nii and spleen.nii.gz", "keep one of them",
           at(folder_ / "m"), [&] {
               std::filesystem::remove(folder_ / "m/spleen.nii.gz");
               return import_label_map(folder_ / "m");
           });
    const auto lifted = testing::nifti_bytes(
        testing::sample_in_order({0, 1, 2}, {false, false, false}, kExtent, kSpacing, kCorner,
                                 [](Point3 p) { return shifted_body(p) == kSpleen ? 2 : 1; }));
    folder_.write("m/spleen.nii", lifted);
    expect("holds the values 1 and 2 and no 0", "write 0 in the place", at(folder_ / "m"), [&] {
        folder_.write("m/spleen.nii", mask(kSpleen));
        return import_label_map(folder_ / "m");
    });
    // What macOS leaves in a folder beside each file is no mask, and no volume.
    folder_.write("m/._spleen.nii", "\x00\x05\x16\x07");
    EXPECT_TRUE(import_label_map(folder_ / "m"));
    folder_.write("empty/readme.txt", "no volume");
    expect("holds neither masks nor DICOM images", "mask per structure", at(folder_ / "empty"),
           at(folder_ / "m"));
}

TEST_F(Advice, OfDicomLeadsToLabels) {
    series("ct");
    expect("one DICOM slice of a series", "give the folder", at(folder_ / "ct/s3"),
           at(folder_ / "ct"));
    series("gap", "1.2.3.5", 5);
    expect("1 slice is missing between", "one complete series", at(folder_ / "gap"), [&] {
        series("gap");
        return import_label_map(folder_ / "gap");
    });
    testing::TinyObject other = segmentation();
    other.thickness_mm = 2;
    folder_.write("two/a.dcm", testing::dicom_object(volume_, other));
    folder_.write("two/b.dcm", testing::dicom_object(volume_, segmentation()));
    expect("2 DICOM segmentations", "one of them by its own path", at(folder_ / "two"),
           at(folder_ / "two/b.dcm"));
    testing::TinyObject contours = segmentation();
    contours.kind = "CT";
    contours.modality = "RTSTRUCT";
    folder_.write("rt/a.dcm", testing::dicom_object(volume_, contours));
    TinyVolume scan = volume_;
    for (std::size_t n = 0; n < scan.voxels.size(); ++n)
        scan.voxels[n] = static_cast<std::uint8_t>(n * 37);
    for (int k = 0; k < volume_.size.z; ++k)
        folder_.write("rt/s" + std::to_string(k), testing::dicom_slice(scan, k, "1.2.3.5"));
    // Its slices are those of the scan: their values are no labels.
    expect("RTSTRUCT", "a DICOM segmentation or masks of it", at(folder_ / "rt"), [&] {
        folder_.write("rt/seg.dcm", testing::dicom_object(volume_, segmentation()));
        return import_label_map(folder_ / "rt");
    });
    expect("the index of a disc (DICOMDIR)", "the folder of the series",
           map("disc/DICOMDIR", std::string(128, '\0') + "DICM"), at(folder_ / "ct"));
    contours.modality = "PT";
    folder_.write("pet/a.dcm", testing::dicom_object(volume_, contours));
    expect("holds no labels: 1 PT", "a DICOM segmentation", at(folder_ / "pet"), [&] {
        folder_.write("pet/seg.dcm", testing::dicom_object(volume_, segmentation()));
        return import_label_map(folder_ / "pet");
    });
    testing::TinyObject empty = segmentation();
    empty.segments[1].number = 1;
    expect("two segments have the number 1", "",
           map("n.dcm", testing::dicom_object(volume_, empty)),
           map("n.dcm", testing::dicom_object(volume_, segmentation())));
    TinyVolume slanted = volume_;
    slanted.columns(0, 2) = 1;
    for (int k = 0; k < volume_.size.z; ++k)
        folder_.write("tilt/s" + std::to_string(k), testing::dicom_slice(slanted, k, "1.2.3.5"));
    ImportOptions resample;
    resample.reading.resample_shear = true;
    expect("", "--resample-shear", at(folder_ / "tilt"), at(folder_ / "tilt", resample));
}

}  // namespace
}  // namespace sonocase::pipeline
