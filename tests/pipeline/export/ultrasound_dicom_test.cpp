// SPDX-License-Identifier: Apache-2.0

// A session's pictures as ultrasound DICOM, read back by another toolkit (DCMTK).
#include "pipeline/export/ultrasound_dicom.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "formats/files/load_save.h"
#include "support/hard_case.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::read_text;
using sonocase::testing::run_command;
using sonocase::testing::TemporaryFolder;

UltrasoundFilm film(int channels, std::vector<double> times_s) {
    UltrasoundFilm film;
    film.width_px = 33;  // odd: a frame of an odd number of bytes
    film.height_px = 21;
    film.picture_height_px = 15;
    film.channels = channels;
    film.times_s = std::move(times_s);
    film.mm_per_px = 0.25;
    film.origin_x_px = 16;
    film.origin_y_px = 3;
    film.case_name = "J\xE4nsen\\torso";  // what may not stand in a name
    film.started = "2026-01-02T03:04:05Z";
    for (std::size_t i = 0; i < film.times_s.size() * film.frame_bytes(); ++i)
        film.pixels.push_back(static_cast<std::uint8_t>((7 * i + i / 31) % 251));
    return film;
}

std::string dump(const std::string& file) {
    const auto result = run_command("dcmdump --print-all " + file);
    EXPECT_EQ(result.status, 0) << result.error;
    EXPECT_EQ(result.error.find("E:"), std::string::npos) << result.error;
    EXPECT_EQ(result.error.find("W:"), std::string::npos) << result.error;
    return result.out;
}

TEST(UltrasoundDicom, IsReadBackByAnotherToolkitWithItsPixelsTimesAndScale) {
    const TemporaryFolder folder;
    const std::string file = folder / "film.dcm";
    const UltrasoundFilm wanted = film(1, {0.5, 0.6, 0.85});
    ASSERT_TRUE(write_ultrasound_dicom(wanted, file));
    const std::string text = dump(file);
    for (const char* line :
         {"=UltrasoundMultiframeImageStorage", "[US]", "(0028,0008) IS [3]",
          "(0018,1065) DS [0\\100\\250]", "(0028,0009) AT (0018,1065)", "[MONOCHROME2]",
          "(0018,6024) US 3", "(0018,602c) FD 0.025", "(0018,6020) SL 16", "(0018,6022) SL 3",
          "(0018,601c) UL 32", "(0018,601e) UL 14", "(0008,0020) DA [20260102]", "[J_nsen_torso"})
        EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
    // Every frame, byte for byte, by the other toolkit's own reading.
    for (int i = 0; i < 3; ++i) {
        const std::string picture = folder / ("frame" + std::to_string(i) + ".pgm");
        const auto result = run_command("dcm2pnm --write-raw-pnm --frame " + std::to_string(i + 1) +
                                        " " + file + " " + picture);
        ASSERT_EQ(result.status, 0) << result.error;
        const std::string bytes = read_text(picture);
        ASSERT_GE(bytes.size(), wanted.frame_bytes());
        const std::string pixels = bytes.substr(bytes.size() - wanted.frame_bytes());
        EXPECT_TRUE(std::equal(
            pixels.begin(), pixels.end(),
            wanted.pixels.begin() + static_cast<std::ptrdiff_t>(i * wanted.frame_bytes()),
            [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; }))
            << i;
    }
}

TEST(UltrasoundDicom, ColourAtAnEvenRateHasOneFrameTime) {
    const TemporaryFolder folder;
    const std::string file = folder / "film.dcm";
    UltrasoundFilm wanted = film(3, {0, 0.04, 0.08, 0.12});
    wanted.mm_per_px = 0;  // not known
    ASSERT_TRUE(write_ultrasound_dicom(wanted, file));
    const std::string text = dump(file);
    for (const char* line : {"[RGB]", "(0018,1063) DS [40", "(0028,0008) IS [4]",
                             "(0028,0002) US 3", "(0028,0006) US 0"})
        EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
    EXPECT_EQ(text.find("(0018,6011)"), std::string::npos);
    const auto result = run_command("dcm2pnm --write-raw-pnm " + file + " " + (folder / "a.ppm"));
    ASSERT_EQ(result.status, 0) << result.error;
    const std::string bytes = read_text(folder / "a.ppm");
    ASSERT_GE(bytes.size(), wanted.frame_bytes());
    EXPECT_EQ(static_cast<std::uint8_t>(bytes[bytes.size() - wanted.frame_bytes() + 5]),
              wanted.pixels[5]);
}

TEST(UltrasoundDicom, TheSameFilmGivesTheSameBytesAndAnotherAnotherIdentifier) {
    const TemporaryFolder folder;
    ASSERT_TRUE(write_ultrasound_dicom(film(1, {0, 1}), folder / "a.dcm"));
    ASSERT_TRUE(write_ultrasound_dicom(film(1, {0, 1}), folder / "b.dcm"));
    ASSERT_TRUE(write_ultrasound_dicom(film(1, {0, 2}), folder / "c.dcm"));
    EXPECT_EQ(read_text(folder / "a.dcm"), read_text(folder / "b.dcm"));
    EXPECT_NE(read_text(folder / "a.dcm"), read_text(folder / "c.dcm"));
    EXPECT_EQ(uid_from_hex("0000000000000000000000000000000a"), "2.25.10");
    EXPECT_EQ(uid_from_hex("ffffffffffffffffffffffffffffffff"),
              "2.25.340282366920938463463374607431768211455");
    EXPECT_EQ(uid_from_hex("00"), "2.25.0");
}

TEST(UltrasoundFilm, IsThatOfThePicturesBesideTheRecording) {
    const TemporaryFolder folder;
    Sequence session, pictures;
    session.transforms = {"ProbeToReference"};
    session.fields = {{"SonocaseCase", "torso"}};
    session.frames.resize(2);
    for (SequenceFrame& frame : session.frames) frame.poses.resize(1);
    ASSERT_TRUE(save_sequence(session, folder / "x.igs.mha"));
    EXPECT_FALSE(film_of_session(folder / "x.igs.mha"));  // without pictures
    pictures.width = 4;
    pictures.height = 2;
    for (int i = 0; i < 4; ++i) {
        SequenceFrame frame;
        frame.timestamp_s = i == 2 ? 0.5 : i;  // one out of order
        frame.fields = {{"MmPerPx", i == 3 ? "0.5" : "0.25"}, {"OriginXPx", "2"}};
        pictures.frames.push_back(frame);
        for (int p = 0; p < 8; ++p)
            pictures.pixels.push_back(static_cast<std::uint8_t>(10 * i + p));
    }
    ASSERT_TRUE(save_sequence(pictures, folder / "x.frames.igs.mha", true));
    const auto film = film_of_session(folder / "x.igs.mha");
    ASSERT_TRUE(film) << film.error().message();
    EXPECT_EQ(film->times_s, (std::vector<double>{0, 1}));  // neither out of order nor rescaled
    sonocase::testing::HardCase taken("of two pictures of another scale or out of order, taken",
                                      sonocase::testing::HardCase::at_most, 0, "");
    taken.see(static_cast<double>(film->times_s.size()) - 2);
    EXPECT_EQ(film->mm_per_px, 0.25);
    EXPECT_EQ(film->origin_x_px, 2);
    EXPECT_EQ(film->pixels.size(), 16u);
    EXPECT_EQ(film->pixels[8], 10);
    EXPECT_FALSE(film_of_session(folder / "nothing.igs.mha"));
    folder.write("empty/readme", "");
    EXPECT_FALSE(film_of_session(folder / "empty"));
    folder.write("bad/frame_00000.png", "no picture");
    EXPECT_FALSE(film_of_session(folder / "bad"));
}

}  // namespace
}  // namespace sonocase::pipeline
