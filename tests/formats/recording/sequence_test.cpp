// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/sequence.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase {
namespace {

using Bytes = std::vector<std::uint8_t>;

Sequence example(int frames, int width, int height) {
    testing::Random random(2);
    Sequence s;
    s.transforms = {"ProbeToTracker", "NeedleToTracker"};
    s.fields = {{"SonocaseSession", "first try"}, {"UltrasoundImageType", "BRIGHTNESS"}};
    s.width = width;
    s.height = height;
    for (int i = 0; i < frames; ++i) {
        SequenceFrame f;
        f.number = 100 + i;
        f.timestamp_s = 0.0333 * i;
        f.unfiltered_timestamp_s = 0.0333 * i + 0.001;
        f.image_ok = i % 4 != 1;
        f.poses = {{true, matrix_from_rigid(random.rigid(200))},
                   {i % 3 != 0, matrix_from_rigid(random.rigid(200))}};
        if (i == 2) f.fields = {{"Event", "needle entry"}};
        s.frames.push_back(f);
        for (int p = 0; p < width * height; ++p)
            s.pixels.push_back(static_cast<std::uint8_t>(i * 31 + p));
    }
    return s;
}

void expect_same(const Sequence& a, const Sequence& b) {
    EXPECT_EQ(a.transforms, b.transforms);
    EXPECT_EQ(std::tie(a.width, a.height, a.depth, a.channels, a.element),
              std::tie(b.width, b.height, b.depth, b.channels, b.element));
    EXPECT_EQ(a.pixels, b.pixels);
    EXPECT_EQ(a.spacing_mm, b.spacing_mm);
    for (const SequenceField& f : b.fields) {
        EXPECT_NE(std::find(a.fields.begin(), a.fields.end(), f), a.fields.end()) << f.name;
    }
    ASSERT_EQ(a.frames.size(), b.frames.size());
    for (std::size_t i = 0; i < a.frames.size(); ++i) {
        const SequenceFrame &x = a.frames[i], &y = b.frames[i];
        EXPECT_EQ(
            std::tie(x.number, x.timestamp_s, x.unfiltered_timestamp_s, x.image_ok, x.fields),
            std::tie(y.number, y.timestamp_s, y.unfiltered_timestamp_s, y.image_ok, y.fields));
        ASSERT_EQ(x.poses.size(), y.poses.size());
        for (std::size_t t = 0; t < x.poses.size(); ++t) {
            EXPECT_EQ(x.poses[t].ok, y.poses[t].ok) << i;
            EXPECT_EQ(x.poses[t].to_from, y.poses[t].to_from);
        }
    }
}

TEST(Sequence, BothFormsComeBackAsTheyWereCompressedOrNot) {
    for (const SequenceForm form : {SequenceForm::mha, SequenceForm::nrrd}) {
        for (const bool compress : {false, true}) {
            for (const int edge : {1, 13}) {
                const Sequence s = example(11, edge, edge + 2);
                const auto back = read_sequence(write_sequence(s, form, compress), "s");
                ASSERT_TRUE(back) << back.error().message();
                expect_same(*back, s);
            }
        }
    }
}

TEST(Sequence, VolumesColourAndWideElementsComeBack) {
    for (const SequenceForm form : {SequenceForm::mha, SequenceForm::nrrd}) {
        Sequence s = example(3, 4, 5);
        s.depth = 2;
        s.channels = 3;
        s.element = "MET_SHORT";
        s.spacing_mm = {0.5, 0.25, 2};
        s.pixels.assign(3 * s.frame_bytes(), 7);
        const auto back = read_sequence(write_sequence(s, form), "s");
        ASSERT_TRUE(back) << back.error().message();
        expect_same(*back, s);
    }
}

TEST(Sequence, ReadsWhatOthersWrite) {
    const std::string text =
        "ObjectType = Image\r\nNDims = 3\r\nAnatomicalOrientation = RAI\r\nBinaryData = True\r\n"
        "BinaryDataByteOrderMSB = False\r\nCompressedData = False\r\nDimSize = 1 1 "
        "2\r\nElementType = MET_UCHAR\r\n"
        "DefaultFrameTransformName = ProbeToTrackerTransform\r\n"
        "Seq_Frame0000_ProbeToTrackerTransformStatus = INVALID\r\n"
        "Seq_Frame0000_ProbeToTrackerTransform = 1 0 0 10 0 1 0 20 0 0 1 30 0 0 0 1\r\n"
        "Seq_Frame0000_Timestamp = 1.5\r\n"
        "Seq_Frame0001_Timestamp = 2\r\nSeq_Frame0001_StylusToTrackerTransform = 2 0 0 0 0 2 0 0 0 "
        "0 2 0 0 0 0 1\r\n"
        "Seq_Frame0001_StylusToTrackerTransformStatus = OK\r\n"
        "ElementDataFile = LOCAL\r\nab";
    const auto s = read_sequence(Bytes(text.begin(), text.end()), "s");
    ASSERT_TRUE(s) << s.error().message();
    ASSERT_EQ(s->frames.size(), 2u);
    EXPECT_EQ(s->transforms, (std::vector<std::string>{"ProbeToTracker", "StylusToTracker"}));
    EXPECT_FALSE(s->frames[0].poses[0].ok);  // the status came before the matrix
    EXPECT_EQ(s->frames[0].poses[0].to_from[7], 20);
    EXPECT_EQ(s->frames[0].poses[0].to_from[15], 1);
    EXPECT_FALSE(s->frames[0].poses[1].ok);  // not there
    EXPECT_TRUE(s->frames[1].poses[1].ok);
    EXPECT_FALSE(rigid_from_matrix(s->frames[1].poses[1].to_from));  // scales by two
    EXPECT_TRUE(rigid_from_matrix(s->frames[0].poses[0].to_from));
    EXPECT_EQ(s->pixels, (Bytes{'a', 'b'}));
}

TEST(Sequence, PosesThatAreNoNumbersAreLostAndCounted) {
    std::string text = "ObjectType = Image\nNDims = 3\nDimSize = 1 1 4\nElementType = MET_UCHAR\n";
    const char* nothing[] = {"", "-1.#IND ", "nan ", "-nan(ind) "};
    for (int i = 0; i < 4; ++i) {
        const std::string frame = "Seq_Frame000" + std::to_string(i) + "_";
        std::string matrix = "1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1";
        if (i > 0) {
            matrix.clear();
            for (int k = 0; k < 15; ++k) matrix += nothing[i];
            matrix += "1";
        }
        text += frame + "NeedleToTrackerTransform = " + matrix + "\n" + frame +
                "NeedleToTrackerTransformStatus = OK\n" + frame +
                "ProbeToTrackerTransform = 1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1\n";
    }
    text += "ElementDataFile = LOCAL\nabcd";
    const auto s = read_sequence(Bytes(text.begin(), text.end()), "s");
    ASSERT_TRUE(s) << s.error().message();
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(rigid_from_matrix(s->frames[i].poses[0].to_from).has_value(), i == 0);
        EXPECT_TRUE(rigid_from_matrix(s->frames[i].poses[1].to_from));
    }
    ASSERT_EQ(s->notes.size(), 1u);
    EXPECT_EQ(s->notes[0], "3 poses that are no numbers count as lost.");
    text.replace(text.find("-1.#IND"), 7, "-1.#WHAT");
    EXPECT_FALSE(read_sequence(Bytes(text.begin(), text.end()), "s"));
}

TEST(Sequence, FramesBeyondTheSizeAreDropped) {
    std::string text(
        reinterpret_cast<const char*>(write_sequence(example(5, 1, 1), SequenceForm::mha).data()),
        write_sequence(example(5, 1, 1), SequenceForm::mha).size());
    const std::string from = "DimSize = 1 1 5", to = "DimSize = 1 1 3";
    text.replace(text.find(from), from.size(), to);
    const auto s = read_sequence(Bytes(text.begin(), text.end()), "s");
    ASSERT_TRUE(s) << s.error().message();
    EXPECT_EQ(s->frames.size(), 3u);
}

TEST(Sequence, EveryTruncationIsAnError) {
    for (const SequenceForm form : {SequenceForm::mha, SequenceForm::nrrd}) {
        for (const bool compress : {false, true}) {
            const Bytes file = write_sequence(example(3, 2, 2), form, compress);
            for (std::size_t n = 0; n < file.size(); ++n) {
                // gzip ends with a length of four bytes that zlib wants whole as well.
                EXPECT_FALSE(read_sequence(std::span(file).first(n), "cut")) << n;
            }
        }
    }
}

TEST(Sequence, DamagedBytesNeverCrash) {
    for (const SequenceForm form : {SequenceForm::mha, SequenceForm::nrrd}) {
        Bytes file = write_sequence(example(3, 2, 2), form, true);
        for (std::size_t i = 0; i < file.size(); ++i) {
            for (const int change : {0x01, 0x10, 0x80, 0xFF}) {
                file[i] = static_cast<std::uint8_t>(file[i] ^ change);
                (void)read_sequence(file, "damaged");
                file[i] = static_cast<std::uint8_t>(file[i] ^ change);
            }
        }
    }
}

TEST(Sequence, HugeClaimsAreRefusedBeforeAllocation) {
    const auto with = [](const std::string& size, const std::string& more) {
        const std::string text = "ObjectType = Image\nNDims = 3\nDimSize = " + size +
                                 "\nElementType = MET_UCHAR\n" + more +
                                 "Seq_Frame0000_Timestamp = 1\nElementDataFile = LOCAL\n0123456789";
        return read_sequence(Bytes(text.begin(), text.end()), "s").has_value();
    };
    EXPECT_TRUE(with("2 5 1", ""));
    EXPECT_FALSE(with("60000 60000 1", ""));
    EXPECT_FALSE(with("60000 60000 1", "CompressedData = True\n"));
    EXPECT_FALSE(with("1 1 900000000", ""));
    EXPECT_FALSE(with("1 1 -1", ""));
    EXPECT_FALSE(with("1 1 1 1 1 1 1", ""));
    EXPECT_FALSE(with("0 1 1", ""));
    EXPECT_FALSE(with("1e300 1 1", ""));
    EXPECT_FALSE(with("", ""));
}

TEST(Sequence, ValuesCannotSmuggleLines) {
    Sequence s = example(2, 1, 1);
    s.frames[0].fields = {{"Event name", "a\nSeq_Frame0001_Timestamp = 99"}};
    const auto back = read_sequence(write_sequence(s, SequenceForm::mha), "s");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->frames[1].timestamp_s, s.frames[1].timestamp_s);
    EXPECT_EQ(back->frames[0].fields.at(0).name, "Event_name");
}

TEST(Sequence, NoFramesIsASequenceToo) {
    Sequence s;
    const auto back = read_sequence(write_sequence(s, SequenceForm::mha), "s");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_TRUE(back->frames.empty());
}

// A header that was written before the last frames: what it does not state is left out, and said.
TEST(Sequences, FramesBeyondTheStatedNumberAreSaid) {
    std::string text = "ObjectType = Image\nNDims = 3\nDimSize = 0 0 3\nElementType = MET_UCHAR\n";
    for (int i = 0; i < 5; ++i) {
        const std::string frame = "Seq_Frame000" + std::to_string(i) + "_";
        text += frame + "ProbeToTrackerTransform = 1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1\n" + frame +
                "Timestamp = " + std::to_string(i) + "\n";
    }
    text += "ElementDataFile = LOCAL\n";
    const auto read =
        read_sequence({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "s");
    ASSERT_TRUE(read) << read.error().message();
    EXPECT_EQ(read->frames.size(), 3u);
    ASSERT_EQ(read->notes.size(), 1u);
    EXPECT_EQ(read->notes[0], "2 frames beyond the 3 that the header states are left out.");
}

}  // namespace
}  // namespace sonocase
