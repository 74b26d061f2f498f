// SPDX-License-Identifier: Apache-2.0

// DICOM segmentation objects of every kind, alone and beside their scan, and what is wrong with
// them.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "pipeline/anatomy/anatomy_check.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/import/volume/source_contents.h"
#include "pipeline/import/volume/volume_file.h"
#include "support/paths.h"
#include "support/temporary_folder.h"
#include "three_boxes.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
using testing::TinyObject;
using testing::TinyVolume;

// Frames of 49 x 17 pixels are no whole number of bytes.
TinyVolume odd_volume() {
    return testing::sample_in_order({0, 1, 2}, {false, false, false}, {98, 68, 48}, kSpacing,
                                    kCorner, shifted_body);
}

const char* name_at(Point3 p) {
    const int value = shifted_body(p);
    return value == kLiver         ? "liver"
           : value == kSpleen      ? "spleen"
           : value == kKidneyRight ? "kidney right"
                                   : "outside";
}

class DicomSegmentation : public ::testing::Test {
  protected:
    DicomSegmentation() {
        object_.segments = {{1, "liver", {kLiver}, "Liver"},
                            {2, "spleen", {kSpleen}, ""},
                            {3, "kidney right", {kKidneyRight}, ""}};
        object_.between_mm = object_.thickness_mm = kSpacing.z;
    }
    std::string write(const std::string& name = "seg.dcm") const {
        return folder_.write(name, testing::dicom_object(volume_, object_));
    }
    Result<ImportedLabels> imported() const { return import_label_map(write()); }
    // Every voxel has the name that `expected` gives its place, and none is missing.
    void expect_body(const Result<ImportedLabels>& imported,
                     const std::function<const char*(Point3)>& expected = name_at) const {
        ASSERT_TRUE(imported) << imported.error().message();
        const LabelVolume& labels = imported->labels;
        std::size_t inside = 0, wanted = 0, n = 0;
        for (int k = 0; k < labels.grid.size.z; ++k)
            for (int j = 0; j < labels.grid.size.y; ++j)
                for (int i = 0; i < labels.grid.size.x; ++i, ++n) {
                    const Point3 p =
                        labels.grid.point_from_voxel({double(i), double(j), double(k)});
                    ASSERT_EQ(labels.labels[labels.voxels[n]].name, expected(p)) << p.x << p.y;
                    inside += labels.voxels[n] != 0;
                }
        for (int k = 0; k < volume_.size.z; ++k)
            for (int j = 0; j < volume_.size.y; ++j)
                for (int i = 0; i < volume_.size.x; ++i)
                    wanted += expected(volume_.position(i, j, k)) != std::string("outside");
        EXPECT_EQ(inside, wanted);
        for (int axis = 0; axis < 3; ++axis)
            EXPECT_NEAR(labels.grid.spacing_mm[axis], kSpacing[axis], 1e-9);
    }
    static bool warns(const Result<ImportedLabels>& imported, const std::string& what) {
        const auto& all = imported->report.warnings;
        return std::any_of(all.begin(), all.end(), [&](const std::string& warning) {
            return warning.find(what) != std::string::npos;
        });
    }
    static std::string note(const Result<ImportedLabels>& imported, const std::string& name) {
        for (const Note& note : imported->report.notes)
            if (note.name == name) return note.text;
        return "";
    }
    static void expect_refused(const Result<ImportedLabels>& imported, const std::string& what) {
        ASSERT_FALSE(imported.has_value());
        const std::string message = imported.error().message();
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        EXPECT_NE(message.find(what), std::string::npos) << message;
        EXPECT_FALSE(imported.error().expected.empty()) << message;
    }

    TemporaryFolder folder_{/*in_memory=*/true};
    TinyVolume volume_ = odd_volume();
    TinyObject object_;
};

TEST_F(DicomSegmentation, OfEveryKindIsReadWithNamesAtItsPlace) {
    for (const char* kind : {"BINARY", "FRACTIONAL", "LABELMAP"}) {
        for (const bool reversed : {false, true}) {
            for (const bool all_frames : {false, true}) {
                SCOPED_TRACE(kind);
                object_.kind = kind;
                object_.reversed = reversed;
                object_.all_frames = all_frames;
                const auto result = imported();
                expect_body(result);
                EXPECT_NE(note(result, "source").find(kind), std::string::npos);
                EXPECT_NE(note(result, "codes").find("liver: Liver (SCT 10200004)"),
                          std::string::npos);
                EXPECT_EQ(size_in_headers(folder_ / "seg.dcm").voxels,
                          result->labels.voxels.size());
            }
        }
    }
}

// Slices lie along any axis of the body, and run either way.
TEST_F(DicomSegmentation, OfEveryOrientationIsRead) {
    for (const auto& order : {std::array{0, 1, 2}, std::array{1, 2, 0}, std::array{2, 1, 0}}) {
        for (int flips = 0; flips < 8; ++flips) {
            volume_ = testing::sample_in_order({order[0], order[1], order[2]},
                                               {flips % 2 > 0, flips / 2 % 2 > 0, flips > 3},
                                               {98, 68, 48}, kSpacing, kCorner, shifted_body);
            object_.between_mm = object_.thickness_mm = kSpacing[order[2]];
            expect_body(imported());
        }
    }
}

TEST_F(DicomSegmentation, OfSixteenBitsWithGapsInItsNumbersIsRead) {
    object_.kind = "LABELMAP";
    object_.segments[0].number = 300;
    object_.segments[2].number = 40000;
    object_.bits = 16;
    expect_body(imported());
    object_.kind = "BINARY";
    expect_body(imported());
}

TEST_F(DicomSegmentation, OfCompressedFramesIsReadAndRefusedWhereTheyAreDamaged) {
    const struct {
        const char *kind, *packing;
        int bits;
    } kKinds[] = {{"FRACTIONAL", "run lengths", 8},
                  {"LABELMAP", "run lengths", 8},
                  {"LABELMAP", "run lengths", 16},
                  {"BINARY", "deflate", 1},
                  {"LABELMAP", "deflate", 16}};
    for (const auto& [kind, packing, bits] : kKinds) {
        SCOPED_TRACE(kind);
        object_.kind = kind;
        object_.packing = packing;
        object_.bits = bits;
        expect_body(imported());
        const std::string bytes = testing::dicom_object(volume_, object_);
        // The last fragment's end is its delimiter and, before it, at most a byte of padding.
        for (const std::size_t cut : {1, 8, 9, 40, 200})
            expect_refused(
                import_label_map(folder_.write("seg.dcm", bytes.substr(0, bytes.size() - cut))),
                "cut off");
        for (std::size_t at = bytes.size() / 2; at < bytes.size(); at += 7) {
            std::string changed = bytes;
            changed[at] = static_cast<char>(~changed[at]);
            const auto result = import_label_map(folder_.write("seg.dcm", changed));
            EXPECT_TRUE(result || !result.error().expected.empty());
        }
    }
}

TEST_F(DicomSegmentation, OfFractionsIsInsideFromHalfOn) {
    object_.kind = "FRACTIONAL";
    object_.maximum = 100;
    object_.inside = 50;
    object_.outside = 49;
    const auto result = imported();
    expect_body(result);
    EXPECT_NE(note(result, "fractional").find("from 50 of 100"), std::string::npos);
}

// A writer that took 0 and 1 for fractions of 255.
TEST_F(DicomSegmentation, OfFractionsThatNowhereReachHalfIsRefusedByTheLargest) {
    object_.kind = "FRACTIONAL";
    object_.inside = 1;
    const auto result = imported();
    ASSERT_FALSE(result);
    const std::string message = result.error().message();
    EXPECT_NE(message.find("MaximumFractionalValue 255: the largest value is 1"), std::string::npos)
        << message;
    EXPECT_NE(message.find("needs MaximumFractionalValue 1"), std::string::npos) << message;
}

TEST_F(DicomSegmentation, WithSegmentsThatOverlapGivesVoxelsToTheSmaller) {
    object_.segments = {{1, "kidney right", {kLiver, kSpleen, kKidneyRight}, ""},
                        {2, "liver", {kLiver}, ""},
                        {3, "spleen", {kSpleen}, ""}};
    const auto result = imported();
    expect_body(result);
    const auto both = std::count_if(volume_.voxels.begin(), volume_.voxels.end(),
                                    [](int v) { return v == kLiver || v == kSpleen; });
    EXPECT_TRUE(warns(result, std::to_string(both) + " voxels lie in more than one segment"));
    EXPECT_TRUE(warns(result, "'kidney right' and 'liver'"));
}

TEST_F(DicomSegmentation, WithoutSomeFramesIsEmptyThere) {
    object_.without = {5, 6, 10};
    for (const char* kind : {"BINARY", "FRACTIONAL", "LABELMAP"}) {
        object_.kind = kind;
        expect_body(imported(), [&](Point3 p) {
            const auto k = std::lround((p.z - kCorner.z) / kSpacing.z);
            return k == 5 || k == 6 || k == 10 ? "outside" : name_at(p);
        });
    }
}

TEST_F(DicomSegmentation, WhoseStepIsGivenWronglyOrNotAtAllTakesThePositions) {
    object_.between_mm = 5;
    const auto wrong = imported();
    expect_body(wrong);
    EXPECT_TRUE(warns(wrong, "lie 3 mm apart by their positions, and 5 mm"));
    object_.between_mm = 1;  // a default: the thickness shows that no frame is missing
    const auto fallback = imported();
    expect_body(fallback);
    EXPECT_TRUE(warns(fallback, "and 1 mm by SpacingBetweenSlices"));
    object_.thickness_mm = 1;  // no frame has a neighbour, all lie evenly
    expect_body(imported());
    object_.between_mm = 0;
    object_.thickness_mm = 1.25;  // slices may be thinner than they lie apart
    const auto thin = imported();
    expect_body(thin);
    EXPECT_TRUE(warns(thin, "1.25 mm thick"));
}

TEST_F(DicomSegmentation, NamesWhatItLacks) {
    object_.segments.push_back({9, "ghost", {}, ""});
    object_.segments[0].label = "Segment_1";  // the type's meaning says more
    object_.segments[0].meaning = "liver";
    object_.segments[1].label = "liver";
    const auto result = imported();
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_TRUE(warns(result, "without a voxel are left out: 'ghost'"));
    EXPECT_TRUE(warns(result, "two segments"));
    EXPECT_EQ(result->labels.labels[1].name, "liver");
    EXPECT_EQ(result->labels.labels[2].name, "liver_2");
    object_.kind = "LABELMAP";
    object_.segments.pop_back();
    std::string bytes = testing::dicom_object(volume_, object_);
    // The third segment's number in the table, not in the pixels.
    const std::size_t at = bytes.find("kidney right");
    bytes.at(at - 10) = 77;
    const auto unnamed = import_label_map(folder_.write("seg.dcm", bytes));
    ASSERT_TRUE(unnamed) << unnamed.error().message();
    EXPECT_TRUE(warns(unnamed, "holds the values 3, which it does not name"));
}

TEST_F(DicomSegmentation, IsFoundBesideItsScanAndInSubfolders) {
    for (int k = 0; k < volume_.size.z; ++k)
        folder_.write("study/ct/s" + std::to_string(k),
                      testing::dicom_slice(volume_, k, "1.2.3.5"));
    write("study/seg/a.dcm");
    TinyObject report = object_;
    report.modality = "PR";
    const auto result = import_label_map(folder_ / "study");
    expect_body(result);
    EXPECT_NE(note(result, "scan").find("16 x CT"), std::string::npos);
    write("study/seg/b.dcm");  // a copy
    expect_body(import_label_map(folder_ / "study"));
    object_.thickness_mm = 2;
    write("study/seg/b.dcm");
    expect_refused(import_label_map(folder_ / "study"), "2 DICOM segmentations");
    // The series alone is read as it was, from sub-folders too.
    std::filesystem::remove_all(folder_ / "study/seg");
    const auto series = import_label_map(folder_ / "study");
    ASSERT_TRUE(series) << series.error().message();
    EXPECT_EQ(series->labels.grid.size, volume_.size);
}

TEST_F(DicomSegmentation, IsNamedByCodesWhereItsLabelsSayNothingHere) {
    object_.segments = {{1, "Organ 5 AI", {kLiver}, "Leber"},
                        {2, "Milz", {kSpleen}, "Milz", "78961009"},
                        {3, "Niere", {kKidneyRight}, "Niere", "64033007", "24028007"}};
    const auto coded = imported();
    ASSERT_TRUE(coded) << coded.error().message();
    const auto name_of = [](const Result<ImportedLabels>& result, std::size_t n) {
        return result ? result->labels.labels.at(n).name : "";
    };
    EXPECT_EQ(name_of(coded, 1), "liver");
    EXPECT_EQ(name_of(coded, 2), "spleen");
    EXPECT_EQ(name_of(coded, 3), "kidney_right");
    EXPECT_EQ(note(coded, "named_by_code"),
              "'Organ 5 AI' is liver, 'Milz' is spleen, 'Niere' is kidney_right");
    // As it is written here, and by the code where the label is a number.
    object_.segments[0].label = "Liver";
    object_.segments[1].label = "Segment_2";
    object_.segments[2] = {3, "Kidney Right", {kKidneyRight}, "Niere", "64033007", "24028007"};
    for (std::size_t n = 1; n <= 3; ++n) EXPECT_EQ(name_of(imported(), n), name_of(coded, n));
    EXPECT_EQ(note(imported(), "named_by_code"), "'Milz' is spleen");
    // A part or a tumour with the code of its organ, two of one code, a side that nobody says.
    object_.segments = {{1, "liver tumor", {kLiver}, "Liver"},
                        {2, "Niere", {kSpleen}, "Niere", "64033007"},
                        {3, "kidney left", {kKidneyRight}, "Niere", "64033007", "24028007"}};
    const auto labelled = imported();
    ASSERT_TRUE(labelled) << labelled.error().message();
    for (std::size_t n = 0; n < 3; ++n) {
        std::string label = object_.segments[n].label;
        EXPECT_EQ(name_of(labelled, n + 1), label);
    }
    object_.segments[0].label = "Abschnitt A";
    object_.segments[1] = {2, "Abschnitt B", {kSpleen}, "Leber"};
    EXPECT_EQ(name_of(imported(), 1), "Abschnitt A");
}

// One file for each organ, as some programs write them, each with its own frames alone.
TEST_F(DicomSegmentation, OfOneFileForEachOrganIsOne) {
    const auto all = object_.segments;
    const auto write_each = [&](const std::string& folder) {
        for (const auto& segment : all) {
            object_.segments = {segment};
            object_.segments.front().number = 1;
            write(folder + "/" + segment.label + ".dcm");
        }
    };
    write_each("seg");
    const auto result = import_label_map(folder_ / "seg");
    expect_body(result);
    EXPECT_NE(note(result, "source").find("3 DICOM segmentations"), std::string::npos);
    EXPECT_EQ(size_in_headers(folder_ / "seg").voxels, result->labels.voxels.size());
    const auto contents = contents_of(folder_ / "seg");
    ASSERT_TRUE(contents) << contents.error().message();
    EXPECT_EQ(contents->labels_kind, "3 DICOM segmentations");
    // The smaller lies over the larger.
    object_.segments = {{1, "body", {kLiver, kSpleen, kKidneyRight}, ""}};
    write("seg/a.dcm");
    const auto over = import_label_map(folder_ / "seg");
    expect_body(over);
    EXPECT_TRUE(warns(over, "voxels lie in more than one DICOM segmentation"));
    std::filesystem::remove(folder_ / "seg/a.dcm");
    // Of another frame of reference, or off the lattice.
    object_.segments = {{1, "colon", {kLiver}, ""}};
    object_.frame_of_reference = "1.2.3.99";
    write("seg/z.dcm");
    expect_refused(import_label_map(folder_ / "seg"), "are of two frames of reference");
    object_.frame_of_reference = "1.2.3.7";
    volume_.origin.x += 0.7;
    write("seg/z.dcm");
    expect_refused(import_label_map(folder_ / "seg"), "lie on two lattices");
    volume_.origin.x -= 0.7;
    object_.segments[0].label = "liver";
    write("seg/z.dcm");
    expect_refused(import_label_map(folder_ / "seg"), "liver.dcm and z.dcm both hold 'liver'");
}

TEST_F(DicomSegmentation, OrMasksBesideSlicesAreTheirLabels) {
    testing::DicomCounts counts;
    counts.is_signed = true;
    for (std::size_t n = 0; n < volume_.voxels.size(); ++n)
        counts.values.push_back(static_cast<std::int16_t>(n % 1000 - 500));
    const auto write_slices = [&](const std::string& folder, const std::string& series, int first) {
        for (int k = first; k < volume_.size.z; ++k)
            folder_.write(folder + "/s" + std::to_string(k),
                          testing::dicom_slice(volume_, k, series, counts));
    };
    const auto mask = [&](int label) {
        TinyVolume one = volume_;
        for (std::uint8_t& voxel : one.voxels) voxel = voxel == label ? 1 : 0;
        return testing::nifti_bytes(one);
    };
    write_slices("w/DICOM/CT", "1.2.3.5", 0);
    folder_.write("w/segmentations/liver.nii", mask(kLiver));
    folder_.write("w/segmentations/spleen.nii", mask(kSpleen));
    const auto masks = contents_of(folder_ / "w");
    ASSERT_TRUE(masks) << masks.error().message();
    EXPECT_EQ(masks->labels, folder_ / "w/segmentations");
    EXPECT_EQ(masks->scan, folder_ / "w/DICOM/CT");
    EXPECT_EQ(masks->scan_kind, "16 CT slices");
    // In the folder of the slices, one of which is missing.
    write_slices("flat", "1.2.3.5", 0);
    std::filesystem::remove(folder_ / "flat/s7");
    folder_.write("flat/segmentation.nii", testing::nifti_bytes(volume_));
    const auto flat = contents_of(folder_ / "flat");
    ASSERT_TRUE(flat) << flat.error().message();
    EXPECT_EQ(flat->labels, folder_ / "flat/segmentation.nii");
    EXPECT_EQ(flat->scan, folder_ / "flat");
    EXPECT_EQ(flat->scan_kind, "15 CT slices");
    // Beside a segmentation: the stack that it lies in, and its count.
    write_slices("two/abdomen", "1.2.3.5", 1);
    write("two/seg.dcm");
    volume_.origin.z += 200;
    write_slices("two/thorax", "1.2.3.6", 0);
    volume_.origin.z -= 200;
    const auto two = contents_of(folder_ / "two");
    ASSERT_TRUE(two) << two.error().message();
    EXPECT_EQ(two->scan_kind, "15 CT slices");
    ASSERT_EQ(two->left_out.size(), 1u);
    EXPECT_EQ(two->left_out[0], "16 x CT from s0, another series");
    EXPECT_EQ(two->shear_deg, 0);
    // A tilted gantry is said before anything is read.
    volume_.columns(1, 2) = 0.53;
    write_slices("tilt", "1.2.3.5", 0);
    const auto tilt = contents_of(folder_ / "tilt");
    ASSERT_TRUE(tilt) << tilt.error().message();
    EXPECT_NEAR(tilt->shear_deg, 10, 0.1);
}

TEST_F(DicomSegmentation, ThatIsDamagedIsRefused) {
    const struct {
        std::string position, what;
    } kPositions[] = {{"nan\\0\\0", "frame 1: ImagePositionPatient is 'nan\\0\\0'"},
                      {"inf\\0\\0", "not 3 finite numbers"},
                      {"1\\2", "not 3 finite numbers"},
                      {"7\\0\\0", "no whole number of pixels"}};
    for (const auto& [position, what] : kPositions) {
        object_.first_position = position;
        expect_refused(imported(), what);
    }
    object_.first_position = "";
    object_.segments.push_back({1, "again", {}, ""});
    expect_refused(imported(), "two segments have the number 1");
    object_.segments.pop_back();
    object_.kind = "SURFACE";
    expect_refused(imported(), "unknown type");
}

TEST_F(DicomSegmentation, ThatIsCutOffIsRefusedAtEveryLength) {
    for (const char* kind : {"BINARY", "LABELMAP"}) {
        object_.kind = kind;
        const std::string bytes = testing::dicom_object(volume_, object_);
        for (std::size_t n = 0; n < 150; ++n) {
            const std::size_t length =
                n < 12 ? bytes.size() - n - 1 - (bytes.size() % 2) : bytes.size() * n / 150;
            const auto cut = import_label_map(folder_.write("cut.dcm", bytes.substr(0, length)));
            EXPECT_FALSE(cut.has_value()) << kind << " " << length << " of " << bytes.size();
        }
    }
}

// No change of a byte crashes, and none gives an error of several lines or a library's name.
TEST_F(DicomSegmentation, WithAnyByteChangedIsReadOrRefused) {
    const std::string bytes = testing::dicom_object(volume_, object_);
    std::size_t refused = 0;
    const std::size_t head = bytes.find("kidney right") + 400;
    for (std::size_t at = 132; at < head; at += 3) {
        std::string changed = bytes;
        changed[at] = static_cast<char>(changed[at] ^ (1 << (at % 8)));
        const auto result = import_label_map(folder_.write("seg.dcm", changed));
        if (result) continue;
        ++refused;
        const std::string message = result.error().message();
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        EXPECT_EQ(message.find("gdcm"), std::string::npos) << message;
    }
    EXPECT_GT(refused, 20u);
}

TEST_F(DicomSegmentation, OfContoursOrReportsIsRefusedByName) {
    object_.kind = "CT";
    object_.modality = "RTSTRUCT";
    expect_refused(import_label_map(write("rt/rtss.dcm")), "RTSTRUCT");
    expect_refused(import_label_map(folder_ / "rt"), "RTSTRUCT");
    // Slices that are labels themselves are read beside it, as a file or in a folder of its own.
    for (int k = 0; k < volume_.size.z; ++k)
        folder_.write("rt/ct/s" + std::to_string(k), testing::dicom_slice(volume_, k, "1.2.3.5"));
    const auto beside = import_label_map(folder_ / "rt");
    ASSERT_TRUE(beside) << beside.error().message();
    EXPECT_EQ(beside->labels.grid.size, volume_.size);
    ASSERT_FALSE(beside->report.warnings.empty());
    EXPECT_NE(beside->report.warnings[0].find(
                  "the contours of the structure set (RTSTRUCT) are not read"),
              std::string::npos)
        << beside->report.warnings[0];
    object_.modality = "PT";
    write("pet/a.dcm");
    expect_refused(import_label_map(folder_ / "pet"), "1 PT (a.dcm)");
    // Beside label slices they are named and left out.
    for (int k = 0; k < volume_.size.z; ++k)
        folder_.write("pet/s" + std::to_string(k), testing::dicom_slice(volume_, k, "1.2.3.5"));
    const auto result = import_label_map(folder_ / "pet");
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_TRUE(warns(result, "left out of the DICOM folder: 1 PT"));
}

// GDCM reads beyond the end of such frames.
TEST_F(DicomSegmentation, OrScanOfCompressedFramesIsReadOrRefused) {
    object_.kind = "CT";
    object_.packing = "run lengths";
    const auto whole = imported();
    ASSERT_TRUE(whole) << whole.error().message();
    EXPECT_EQ(whole->labels.grid.size, volume_.size);
    const std::string bytes = testing::dicom_object(volume_, object_);
    std::size_t refused = 0;
    for (std::size_t at = bytes.size() / 2; at < bytes.size(); at += 5) {
        std::string changed = bytes;
        changed[at] = static_cast<char>(changed[at] ^ 0x55);
        refused += !import_label_map(folder_.write("seg.dcm", changed)).has_value();
    }
    EXPECT_GT(refused, 10u);
}

// An enhanced CT whose frames hold label values.
TEST_F(DicomSegmentation, OrScanOfSeveralFramesLiesWhereItsFramesSay) {
    object_.kind = "CT";
    object_.between_mm = 0;
    for (const bool reversed : {false, true}) {
        object_.reversed = reversed;
        const auto result = imported();
        ASSERT_TRUE(result) << result.error().message();
        EXPECT_EQ(result->labels.grid.size, volume_.size);
        EXPECT_LT(distance(result->labels.grid.origin_mm, volume_.origin), 1e-9);
        for (std::size_t n = 0; n < volume_.voxels.size(); ++n)
            ASSERT_EQ(result->labels.labels[result->labels.voxels[n]].source_value,
                      volume_.voxels[n]);
    }
    object_.without = {7};
    expect_refused(imported(), "1 slice is missing between frame 9 of seg.dcm and frame 8");
    object_.reversed = false;
    expect_refused(imported(), "1 slice is missing between frame 7 of seg.dcm and frame 8");
    object_.without.clear();
    object_.first_position = "nan\\0\\0";
    expect_refused(imported(), "ImagePositionPatient is 'nan");
    object_.first_position = "";
    object_.placed_by_header = true;
    const auto guessed = imported();
    ASSERT_TRUE(guessed) << guessed.error().message();
    EXPECT_TRUE(warns(guessed, "places only the first of its 16 frames"));
    EXPECT_LT(distance(guessed->labels.grid.origin_mm, volume_.origin), 1e-9);
    EXPECT_NEAR(guessed->labels.grid.spacing_mm.z, kSpacing.z, 1e-9);
    object_.thickness_mm = 0;
    expect_refused(imported(), "not how far apart they are");
}

// Objects of another program (dcmqi), with the same as NRRD.
TEST(DicomSegmentationOfDcmqi, IsItsLabelMap) {
    const std::string folder = std::string(SONOCASE_DATA) + "/dicom_seg";
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << "shared/data/dicom_seg is absent";
    const TemporaryFolder own;
    std::filesystem::create_directories(own / "study");
    for (const auto& entry : std::filesystem::directory_iterator(folder + "/ct"))
        std::filesystem::copy(entry.path(), own / "study");
    std::filesystem::copy(folder + "/liver.dcm", own / "study");
    const std::pair<std::string, std::string> pairs[] = {
        {folder + "/liver.dcm", folder + "/liver_seg.nrrd"},
        {own / "study", folder + "/liver_seg.nrrd"},
        {folder + "/small/label.seg", folder + "/small/label.nrrd"}};
    for (const auto& [seg, truth] : pairs) {
        const auto read = read_label_layers(seg), wanted = read_label_layers(truth);
        ASSERT_TRUE(read) << read.error().message();
        ASSERT_TRUE(wanted) << wanted.error().message();
        EXPECT_EQ(read->grid.size, wanted->grid.size);
        // Positions of six decimal places.
        EXPECT_LT(distance(read->grid.origin_mm, wanted->grid.origin_mm), 1e-4);
        for (int axis = 0; axis < 3; ++axis)
            EXPECT_NEAR(read->grid.spacing_mm[axis], wanted->grid.spacing_mm[axis], 1e-5);
        EXPECT_EQ(read->values, wanted->values);
        EXPECT_EQ(read->layers, wanted->layers);
        EXPECT_TRUE(is_known_structure(read->fields.at("Segment0_Name")));
    }
}

}  // namespace
}  // namespace sonocase::pipeline
