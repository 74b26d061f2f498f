// SPDX-License-Identifier: Apache-2.0

// Folders of DICOM slices: complete ones, and what a failed export leaves.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string_view>

#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/import/volume/native_volume.h"
#include "support/temporary_folder.h"
#include "three_boxes.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
using testing::TinyVolume;

class DicomFolder : public ::testing::Test {
  protected:
    static std::string name_of(int k) {
        char name[32];
        std::snprintf(name, sizeof name, "s%04d.dcm", k);
        return name;
    }
    void write(const std::string& name, int k, const std::string& series = "1.2.3.5") {
        folder_.write("series/" + name, testing::dicom_slice(volume_, k, series, declared_));
    }
    void write_all() {
        for (int k = 0; k < volume_.size.z; ++k) write(name_of(k), k);
    }
    void remove(int k) { std::filesystem::remove(folder_ / ("series/" + name_of(k))); }
    Result<ImportedLabels> imported() const { return import_label_map(folder_ / "series"); }
    // One line that names the file and the fault.
    void expect_refused(const std::string& file, const std::string& what) const {
        const auto result = imported();
        ASSERT_FALSE(result.has_value());
        const std::string message = result.error().message();
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        EXPECT_NE(message.find(file), std::string::npos) << message;
        EXPECT_NE(message.find(what), std::string::npos) << message;
    }

    TemporaryFolder folder_{/*in_memory=*/true};
    TinyVolume volume_ = ras_volume();
    testing::DicomCounts declared_;
};

TEST_F(DicomFolder, IsReadInAnyFileOrder) {
    for (int k = 0; k < volume_.size.z; ++k) write(name_of(k * 7 % volume_.size.z), k);
    const auto result = imported();
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_EQ(result->labels.grid.size, volume_.size);
    EXPECT_LT(distance(result->labels.grid.origin_mm, volume_.origin), 1e-9);
    for (std::size_t n = 0; n < volume_.voxels.size(); ++n) {
        const int value = result->labels.labels[result->labels.voxels[n]].source_value;
        ASSERT_EQ(value, volume_.voxels[n]) << n;
    }
    EXPECT_TRUE(std::none_of(result->report.warnings.begin(), result->report.warnings.end(),
                             [](const std::string& w) { return w.find("DICOM") < w.size(); }));
}

// Who is in the scan stays in the scan: neither the map nor the report repeats it.
TEST_F(DicomFolder, ThatNamesItsPatientLeavesNoTraceOfTheName) {
    declared_.person = "DOE^JANE";
    declared_.description = "Abdomen DOE";
    const std::string place = "DOE JANE/CT DOE/";
    const auto write_to = [&](const std::string& series, int k) {
        folder_.write(place + series + " DOE " + name_of(k),
                      testing::dicom_slice(volume_, k, series, declared_));
    };
    for (int k = 0; k < volume_.size.z; ++k) write_to("1.2.3.5", k);
    write_to("1.2.3.6", 7);
    testing::TinyObject report;
    report.kind = "CT";
    report.modality = "PR";
    folder_.write(place + "DOE.dcm", testing::dicom_object(volume_, report));
    const auto result = import_label_map(folder_ / "DOE JANE");
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_GE(result->report.warnings.size(), 2u);  // of the other series, of what is left out
    std::string told;
    for (const std::string& warning : result->report.warnings) told += warning;
    for (const Note& note : result->report.notes) told += note.name + note.text;
    for (const Label& label : result->labels.labels) told += label.name;
    EXPECT_EQ(told.find("DOE"), std::string::npos) << told;
    ASSERT_TRUE(save_label_file({"ct", result->labels, {}, {}, {}}, folder_ / "map.labels"));
    const auto bytes = read_file(folder_ / "map.labels");
    ASSERT_TRUE(bytes);
    const std::string_view name = "DOE";
    EXPECT_EQ(std::search(bytes->begin(), bytes->end(), name.begin(), name.end()), bytes->end());
}

// Slices 0.7 mm apart do not lie at whole numbers, and scanners round their positions.
TEST_F(DicomFolder, OfUnroundAndRoundedSpacingIsRead) {
    for (const double spacing : {0.7, 0.703125, 1.0 / 3}) {
        volume_ = testing::sample_in_order(
            {0, 1, 2}, {false, false, false}, {96, 64, 30}, {2, 4, spacing}, {-20.1, 15.3, 300.7},
            [](Point3 p) { return p.z > 302 && p.z < 328 ? kLiver : 0; });
        volume_.columns(2, 2) = spacing;
        for (const double round_to : {0.0, 0.01}) {
            declared_.round_to_mm = round_to;
            std::filesystem::remove_all(folder_ / "series");
            write_all();
            const auto result = imported();
            ASSERT_TRUE(result) << result.error().message();
            EXPECT_NEAR(result->labels.grid.spacing_mm.z, spacing, 1e-3);
        }
    }
}

TEST_F(DicomFolder, WithASliceMissingIsRefused) {
    write_all();
    remove(7);
    expect_refused("s0008.dcm", "1 slice is missing between s0006.dcm and s0008.dcm");
}

TEST_F(DicomFolder, WithASliceTwiceIsRefused) {
    write_all();
    declared_.instance = "1.2.3.5.99";
    write("z-copy.dcm", 7);
    expect_refused("z-copy.dcm", "there twice, in s0007.dcm");
    // Labels of one identity that differ: which are they?
    declared_.instance = "1.2.3.5.8";
    volume_.voxels.assign(volume_.voxels.size(), kLiver);
    write("z-copy.dcm", 7);
    expect_refused("z-copy.dcm", "there twice, in s0007.dcm");
}

TEST_F(DicomFolder, WithCopiesOfFilesIsReadOnceWithAWarning) {
    write_all();
    for (int k = 0; k < volume_.size.z; ++k) write("z" + name_of(k), k);
    const auto result = imported();
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_EQ(result->labels.grid.size, volume_.size);
    ASSERT_FALSE(result->report.warnings.empty());
    EXPECT_EQ(result->report.warnings[0], "16 DICOM slices are there twice: the copy was left out");
}

TEST_F(DicomFolder, WithASliceOfAnotherSeriesInPlaceOfItsOwnIsRefused) {
    write_all();
    write(name_of(7), 7, "1.2.3.6");
    expect_refused("s0008.dcm", "s0007.dcm, which lies there, is of another series");
}

TEST_F(DicomFolder, WithASliceOfAnotherSeriesBesideItsOwnIsReadWithAWarning) {
    write_all();
    write("other.dcm", 7, "1.2.3.6");
    const auto result = imported();
    ASSERT_TRUE(result) << result.error().message();
    ASSERT_FALSE(result->report.warnings.empty());
    EXPECT_NE(result->report.warnings[0].find("2 DICOM series"), std::string::npos);
    EXPECT_NE(result->report.warnings[0].find("not 1 x CT: to take another"), std::string::npos);
    EXPECT_EQ(result->labels.grid.size.z, volume_.size.z);
}

// A slice missing at an end leaves even spacing: only a header can tell.
TEST_F(DicomFolder, WithItsLastSliceMissingIsRefusedWhereAHeaderCounts) {
    const int last = volume_.size.z - 1;
    for (const bool in_acquisition : {true, false}) {
        declared_ = {};
        (in_acquisition ? declared_.in_acquisition : declared_.in_series) = volume_.size.z;
        write_all();
        EXPECT_TRUE(imported().has_value());
        remove(last);
        expect_refused("s0000.dcm", "says that there are 16 slices, and there are 15");
    }
    declared_ = {};
    write_all();
    remove(last);
    EXPECT_TRUE(imported().has_value());
}

TEST_F(DicomFolder, WithoutItsFirstSliceIsReadWithAWarning) {
    write_all();
    remove(0);
    const auto result = imported();
    ASSERT_TRUE(result) << result.error().message();
    ASSERT_FALSE(result->report.warnings.empty());
    EXPECT_NE(result->report.warnings[0].find("numbered from 2"), std::string::npos);
}

TEST_F(DicomFolder, WithASliceOffItsPlaceOrTurnedOrCutOffIsRefused) {
    write_all();
    volume_.origin.z += 0.6;  // a fifth of the spacing
    write(name_of(5), 5);
    volume_.origin.z -= 0.6;
    expect_refused("s0005.dcm", "unevenly spaced");
    TinyVolume turned = volume_;
    turned.columns(0, 0) = 0;
    turned.columns(2, 0) = 2;
    folder_.write("series/" + name_of(5), testing::dicom_slice(turned, 5, "1.2.3.5"));
    expect_refused("s0005.dcm", "turned against s0000.dcm");
    const std::string whole = testing::dicom_slice(volume_, 5, "1.2.3.5");
    for (const std::size_t bytes : {1, 2, 13, 100, 1000}) {
        folder_.write("series/" + name_of(5), whole.substr(0, whole.size() - bytes));
        expect_refused("s0005.dcm", "cut off");
    }
}

// Bits above those that are stored may hold anything.
TEST_F(DicomFolder, OfTwelveBitsIsReadWithoutWhatLiesAboveThem) {
    declared_.stored_bits = 12;
    for (const bool is_signed : {false, true}) {
        declared_.is_signed = is_signed;
        write_all();
        const auto result = imported();
        ASSERT_TRUE(result) << result.error().message();
        for (std::size_t n = 0; n < volume_.voxels.size(); ++n)
            ASSERT_EQ(result->labels.labels[result->labels.voxels[n]].source_value,
                      volume_.voxels[n]);
    }
    // A value below 0 of two bits is one of 16.
    volume_.voxels.assign(volume_.voxels.size(), 3);
    declared_.stored_bits = 2;
    write_all();
    const auto native = read_dicom(folder_ / "series");
    ASSERT_TRUE(native) << native.error().message();
    EXPECT_EQ(*reinterpret_cast<const std::int16_t*>(native->bytes.data()), -1);
}

// "3" and "3.0" are one thickness.
TEST_F(DicomFolder, WithOneThicknessWrittenInTwoWaysIsOneSeries) {
    write_all();
    declared_.thickness = "3.0000";
    write(name_of(4), 4);
    const auto result = imported();
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_TRUE(result->report.warnings.empty() ||
                result->report.warnings[0].find("DICOM") == std::string::npos);
    EXPECT_EQ(result->labels.grid.size, volume_.size);
}

TEST_F(DicomFolder, WithNumbersThatAreNotFiniteIsRefused) {
    write_all();
    for (const char* position : {"nan\\0\\0", "0\\inf\\0", "0\\0", "a\\b\\c", "1e999\\0\\0"}) {
        declared_.position = position;
        write(name_of(5), 5);
        expect_refused("s0005.dcm", "and not 3 finite numbers");
    }
    declared_.position = "";
    declared_.thickness = "nan";
    write_all();
    expect_refused("s0000.dcm", "SliceThickness is 'nan', and not 1 finite number");
}

// A tilted gantry: slices that slide over one another.
TEST_F(DicomFolder, ThatIsShearedIsSquaredBelowATenthOfAVoxelAndRefusedBeyond) {
    volume_.columns(1, 2) = 0.02;  // 0.3 mm over the stack, and voxels of 4 mm
    write_all();
    const auto result = imported();
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_LT(distance(result->labels.grid.origin_mm, volume_.origin + Vector3{0, 0.15, 0}), 1e-6);
    EXPECT_NEAR(result->labels.grid.spacing_mm.z, 3, 1e-9);
    const auto& notes = result->report.notes;
    EXPECT_TRUE(std::any_of(notes.begin(), notes.end(), [](const Note& note) {
        return note.name == "shear" && note.text.find("0.15 mm at either end") != std::string::npos;
    }));
    volume_.columns(1, 2) = 0.53;
    write_all();
    expect_refused("series", "sheared against their stack by 10 degrees");
    // Moved by whole pixels: every voxel within half a pixel of where its slice lies.
    const auto native = read_dicom(folder_ / "series", true);
    ASSERT_TRUE(native) << native.error().message();
    EXPECT_EQ(native->grid.size.y, volume_.size.y + 2);
    const auto* voxels = reinterpret_cast<const std::uint16_t*>(native->bytes.data());
    std::size_t inside = 0, n = 0;
    for (int k = 0; k < native->grid.size.z; ++k)
        for (int j = 0; j < native->grid.size.y; ++j)
            for (int i = 0; i < native->grid.size.x; ++i, ++n) {
                if (voxels[n] == 0) continue;
                ++inside;
                const Point3 p = native->grid.point_from_voxel({double(i), double(j), double(k)});
                const Vector3 from = p - volume_.position(0, 0, k);
                const int across = static_cast<int>(std::lround(from.x / 2)),
                          down = static_cast<int>(std::lround(from.y / 4));
                EXPECT_LE(distance(p, volume_.position(across, down, k)), 2 + 1e-9);
                ASSERT_EQ(voxels[n], volume_.voxels[static_cast<std::size_t>(
                                         (k * volume_.size.y + down) * volume_.size.x + across)]);
            }
    EXPECT_EQ(inside,
              volume_.voxels.size() - static_cast<std::size_t>(std::count(
                                          volume_.voxels.begin(), volume_.voxels.end(), 0)));
}

TEST_F(DicomFolder, WhoseSlicesAreThinnerThanTheyLieApartIsReadWithAWarning) {
    declared_.thickness = "1.5";
    write_all();
    const auto result = imported();
    ASSERT_TRUE(result) << result.error().message();
    ASSERT_FALSE(result->report.warnings.empty());
    EXPECT_NE(result->report.warnings[0].find("1.5 mm thick and lie 3 mm apart"),
              std::string::npos);
}

// What is harmless in a scan, which fills in the body: said, and read.
class DicomScan : public DicomFolder {
  protected:
    DicomScan() {
        declared_.is_signed = true;
        for (std::size_t n = 0; n < volume_.voxels.size(); ++n)
            declared_.values.push_back(static_cast<std::int16_t>(
                volume_.voxels[n] == 0 ? -1000 : 10 * static_cast<int>(n / slice())));
    }
    std::size_t slice() const {
        return static_cast<std::size_t>(volume_.size.x) * static_cast<std::size_t>(volume_.size.y);
    }
    // The scan, which warns in these words.
    ScanVolume scan(const std::string& words, const std::string& name = "series") const {
        const auto read = read_scan(folder_ / name);
        EXPECT_TRUE(read) << read.error().message();
        if (!read) return {};
        std::string all;
        for (const std::string& warning : read->warnings) all += warning + "\n";
        EXPECT_NE(all.find(words), std::string::npos) << all;
        EXPECT_EQ(all.find(".dcm"), std::string::npos) << all;
        return *read;
    }
};

TEST_F(DicomScan, OfTwoPhasesIsTheFirstOrThatOfTheLabels) {
    const auto bright = [&](int by) {
        auto phase = declared_;
        for (std::int16_t& value : phase.values) value = static_cast<std::int16_t>(value + by);
        return phase;
    };
    for (const std::string tag : {"acquisition", "moment", "numbers"}) {
        SCOPED_TRACE(tag);
        std::filesystem::remove_all(folder_ / "series");
        for (const int phase : {2, 1}) {
            auto of_phase = bright(phase == 2 ? 100 : 0);
            if (tag == "acquisition") of_phase.acquisition = std::to_string(phase);
            if (tag == "moment") of_phase.moment = std::to_string(phase);
            for (int k = 0; k < volume_.size.z; ++k) {
                of_phase.instance = "1.2.3." + std::to_string(1000 * phase + k);
                folder_.write("series/" + std::to_string(phase) + name_of(k),
                              testing::dicom_slice(volume_, k, "1.2.3.5", of_phase));
            }
        }
        const ScanVolume first = scan("2 phases in one place");
        EXPECT_EQ(first.grid.size, volume_.size);
        EXPECT_EQ(first.values, declared_.values);
    }
    EXPECT_FALSE(imported().has_value());  // labels are not several
}

TEST_F(DicomScan, WithAScoutAmongItsSlicesIsReadWithoutIt) {
    write_all();
    TinyVolume turned = volume_;
    turned.columns(0, 0) = 0;
    turned.columns(2, 0) = 2;
    declared_.instance = "1.2.3.5.99";
    folder_.write("series/a.dcm", testing::dicom_slice(turned, 0, "1.2.3.5", declared_));
    EXPECT_EQ(scan("1 slice of the scan is turned").values, declared_.values);
}

TEST_F(DicomScan, WithASliceMissingHasTheMeanOfItsNeighbours) {
    write_all();
    remove(7);
    EXPECT_EQ(scan("1 slice of the scan is missing").values, declared_.values);
    remove(8);
    const auto two = read_scan(folder_ / "series");
    ASSERT_FALSE(two);
    EXPECT_NE(two.error().message().find("2 slices are missing"), std::string::npos);
}

TEST_F(DicomScan, CompressedWithLossIsReadWithAWarning) {
    declared_.lossy = true;
    write_all();
    EXPECT_EQ(scan("compressed with loss").values, declared_.values);
    expect_refused("s0000.dcm", "compressed with loss");
}

TEST_F(DicomScan, HasAirWhereItIsPadded) {
    declared_.padding = {-3024, -2000};
    declared_.values[0] = -3024;
    declared_.values[1] = -2500;
    declared_.values[2] = -2000;
    declared_.values[3] = -1999;
    write_all();
    auto expected = declared_.values;
    expected[0] = expected[1] = expected[2] = -1000;
    EXPECT_EQ(scan("").values, expected);
    // Of unsigned numbers, as -2000 in 16 bits.
    declared_.is_signed = false;
    declared_.padding = {63536};
    declared_.values.assign(volume_.voxels.size(), 40);
    declared_.values[5] = static_cast<std::int16_t>(63536);
    write_all();
    expected.assign(volume_.voxels.size(), 40);
    expected[5] = 0;  // the least that such numbers hold
    EXPECT_EQ(scan("").values, expected);
}

// A thorax of more slices than the abdomen that was segmented.
TEST_F(DicomScan, OfTwoSeriesIsThatInWhichTheSegmentationLies) {
    TinyVolume above = volume_;
    above.origin.z += 200;
    for (int k = 0; k < volume_.size.z; ++k) {
        write(name_of(k), k, "1.2.3.6");
        if (k > 0) write("t" + name_of(k), k, "1.2.3.5");
    }
    for (int k = 0; k < volume_.size.z; ++k)
        folder_.write("series/" + name_of(k), testing::dicom_slice(above, k, "1.2.3.6", declared_));
    EXPECT_EQ(scan("the one with the most slices was taken (16 x CT), and not 15 x CT").grid.size.z,
              16);
    testing::TinyObject labels;
    labels.segments = {{1, "liver", {kLiver}, ""}, {2, "spleen", {kSpleen}, ""}};
    labels.between_mm = kSpacing.z;
    folder_.write("series/seg.dcm", testing::dicom_object(volume_, labels));
    const ScanVolume taken =
        scan("the one that the segmentation lies in was taken (15 x CT), and not 16 x CT");
    EXPECT_EQ(taken.grid.size.z, 15);
    EXPECT_LT(taken.grid.origin_mm.z, 350);
    // An error lists the series.
    std::filesystem::remove(folder_ / "series/ts0007.dcm");
    std::filesystem::remove(folder_ / "series/ts0008.dcm");
    const auto faulty = read_scan(folder_ / "series");
    ASSERT_FALSE(faulty);
    EXPECT_NE(faulty.error().message().find("(of 2 series: 13 x CT from ts0001.dcm; 16 x CT from "
                                            "s0000.dcm)"),
              std::string::npos)
        << faulty.error().message();
}

// Like a large clinical export: 3,000 slices, one wrong. Reading the headers takes about a second.
TEST_F(DicomFolder, OfThreeThousandSlicesNamesTheOneThatIsWrong) {
    volume_ = testing::sample_in_order({0, 1, 2}, {false, false, false}, {96, 64, 300},
                                       {12, 8, 0.1}, kCorner, shifted_body);
    ASSERT_EQ(volume_.size.z, 3000);
    declared_.in_acquisition = 3000;
    write_all();
    const auto whole = imported();
    ASSERT_TRUE(whole) << whole.error().message();
    EXPECT_EQ(whole->labels.grid.size.z, 3000);
    declared_.instance = "1.2.3.5.9999";
    write("t1500.dcm", 1500);
    declared_.instance = "";
    expect_refused("t1500.dcm", "there twice, in s1500.dcm");
    std::filesystem::remove(folder_ / "series/t1500.dcm");
    remove(1500);
    expect_refused("s1501.dcm", "1 slice is missing between s1499.dcm and s1501.dcm");
    write(name_of(1500), 1500, "1.2.3.6");
    expect_refused("s1501.dcm", "s1500.dcm, which lies there, is of another series");
    write(name_of(1500), 1500);
    remove(2999);
    expect_refused("s0000.dcm", "says that there are 3000 slices, and there are 2999");
}

}  // namespace
}  // namespace sonocase::pipeline
