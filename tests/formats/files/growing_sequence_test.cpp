// SPDX-License-Identifier: Apache-2.0

#include "formats/files/growing_sequence.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;

using testing::TemporaryFolder;

Sequence head() {
    Sequence s;
    s.transforms = {"ProbeToMannequin", "NeedleToMannequin"};
    s.fields = {{"SonocaseSession", "1"}};
    return s;
}

SequenceFrame frame(int i) {
    testing::Random random(static_cast<std::uint64_t>(i));
    SequenceFrame f;
    f.number = i;
    f.timestamp_s = f.unfiltered_timestamp_s = i / 60.0;
    f.poses = {{true, matrix_from_rigid(random.rigid(100))},
               {i % 5 != 0, matrix_from_rigid(random.rigid(100))}};
    if (i % 11 == 0) f.fields = {{"Event", "e" + std::to_string(i)}};
    return f;
}

void expect_frames(const Sequence& s, std::size_t from = 0) {
    for (std::size_t i = from; i < s.frames.size(); ++i) {
        const SequenceFrame expected = frame(static_cast<int>(i));
        ASSERT_EQ(s.frames[i].timestamp_s, expected.timestamp_s);
        ASSERT_EQ(s.frames[i].poses[0].to_from, expected.poses[0].to_from);
        ASSERT_EQ(s.frames[i].poses[1].ok, expected.poses[1].ok);
        ASSERT_EQ(s.frames[i].fields, expected.fields);
    }
}

TEST(GrowingSequence, IsWholeAfterEveryBatchAndEndsAsASequenceWrittenAtOnce) {
    const TemporaryFolder folder;
    auto file = GrowingSequence::create(folder / "s.igs.mha", head());
    ASSERT_TRUE(file) << file.error().message();
    EXPECT_EQ(load_sequence(folder / "s.igs.mha")->frames.size(), 0u);
    int count = 0;
    for (const int batch : {1, 7, 30, 1, 200, 0, 64}) {
        std::vector<SequenceFrame> frames;
        for (int i = 0; i < batch; ++i) frames.push_back(frame(count++));
        ASSERT_TRUE(file->append(frames));
        const auto s = load_sequence(folder / "s.igs.mha");
        ASSERT_TRUE(s) << s.error().message();
        ASSERT_EQ(s->frames.size(), static_cast<std::size_t>(count));
        expect_frames(*s);
        for (const std::uint8_t p : s->pixels) ASSERT_EQ(p, 0);
        EXPECT_NE(
            std::find(s->fields.begin(), s->fields.end(), SequenceField{"SonocaseSession", "1"}),
            s->fields.end());
    }
}

// The process is killed without warning while it records; the pipe reports how far it had come.
TEST(GrowingSequence, KilledAt200RandomMomentsEveryFileOpensAndHoldsEveryCommittedBatch) {
    const TemporaryFolder folder(/*in_memory=*/true);
    testing::Random random(77);
    for (int run = 0; run < 200; ++run) {
        const std::string path = folder / ("s" + std::to_string(run) + ".igs.mha");
        int ends[2];
        ASSERT_EQ(::pipe(ends), 0);
        const pid_t child = ::fork();
        if (child == 0) {
            auto file = GrowingSequence::create(path, head());
            for (int n = 0; file && n < 4000; n += 10) {
                std::vector<SequenceFrame> batch;
                for (int i = 0; i < 10; ++i) batch.push_back(frame(n + i));
                if (!file->append(batch)) ::_exit(1);
                if (::write(ends[1], "x", 1) != 1) ::_exit(1);
            }
            ::_exit(0);
        }
        ::close(ends[1]);
        const int commits = static_cast<int>(random.uniform(0, 40));
        char byte = 0;
        for (int i = 0; i < commits; ++i) ASSERT_EQ(::read(ends[0], &byte, 1), 1);
        // A little work of random length, so that the signal falls anywhere within a batch.
        volatile double sink = 0;
        for (int i = 0; i < random.uniform(0, 200000); ++i) sink = sink + i;
        ::kill(child, SIGKILL);
        int more = 0;
        while (::read(ends[0], &byte, 1) == 1) ++more;
        ::close(ends[0]);
        ::waitpid(child, nullptr, 0);
        if (!fs::exists(path)) {
            EXPECT_EQ(commits + more, 0);
            continue;
        }
        const auto s = load_sequence(path);
        ASSERT_TRUE(s) << run << ": " << s.error().message();
        const auto told = static_cast<std::size_t>(10 * (commits + more));
        ASSERT_GE(s->frames.size(), told);
        ASSERT_LE(s->frames.size(), told + 10);
        expect_frames(*s);
    }
}

// Any state that a power cut can leave between two flushes: the part of the file behind the end
// line is old, new or torn anywhere, as long as the end line is the old one.
TEST(GrowingSequence, TornTextBehindTheEndLineDoesNotShow) {
    const TemporaryFolder folder;
    const std::string path = folder / "s.igs.mha";
    auto file = GrowingSequence::create(path, head());
    std::vector<SequenceFrame> first, second;
    for (int i = 0; i < 20; ++i) first.push_back(frame(i));
    for (int i = 20; i < 40; ++i) second.push_back(frame(i));
    ASSERT_TRUE(file->append(first));
    const auto old_bytes = *read_file(path);
    ASSERT_TRUE(file->append(second));
    const auto new_bytes = *read_file(path);
    const std::string end_line = "ElementDataFile = LOCAL\n";
    const auto found =
        std::search(old_bytes.begin(), old_bytes.end(), end_line.begin(), end_line.end());
    const auto keep = static_cast<std::size_t>(found - old_bytes.begin()) + end_line.size();
    EXPECT_EQ((keep - end_line.size()) % 64, 0u);
    for (std::size_t written = keep; written <= new_bytes.size(); written += 97) {
        auto torn = old_bytes;
        torn.resize(new_bytes.size(), 0);
        std::copy(new_bytes.begin() + static_cast<std::ptrdiff_t>(keep),
                  new_bytes.begin() + static_cast<std::ptrdiff_t>(written),
                  torn.begin() + static_cast<std::ptrdiff_t>(keep));
        const auto s = read_sequence(torn, "torn");
        ASSERT_TRUE(s) << written << ": " << s.error().message();
        ASSERT_EQ(s->frames.size(), 20u);
    }
    // After the first of the two last writes: all text there, the number of frames still the old
    // one.
    auto half = new_bytes;
    const std::string key = "DimSize = 1 1 ";
    const auto digits = std::search(half.begin(), half.end(), key.begin(), key.end()) +
                        static_cast<int>(key.size());
    const std::string old_count = "0000000020";
    std::copy(old_count.begin(), old_count.end(), digits);
    const auto s = read_sequence(half, "half");
    ASSERT_TRUE(s) << s.error().message();
    EXPECT_EQ(s->frames.size(), 20u);
}

TEST(GrowingSequence, AFullDiskKeepsWhatIsThereAndGoesOnWhenThereIsRoom) {
    const TemporaryFolder folder;
    const std::string path = folder / "s.igs.mha";
    auto file = GrowingSequence::create(path, head());
    std::vector<SequenceFrame> first, second;
    for (int i = 0; i < 20; ++i) first.push_back(frame(i));
    for (int i = 20; i < 60; ++i) second.push_back(frame(i));
    ASSERT_TRUE(file->append(first));
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{fs::file_size(path) + 3000, before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    const Status full = file->append(second);
    const auto kept = load_sequence(path);
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    ASSERT_FALSE(full);
    EXPECT_NE(full.error().message().find("kept"), std::string::npos);
    ASSERT_TRUE(kept) << kept.error().message();
    EXPECT_EQ(kept->frames.size(), 20u);
    ASSERT_TRUE(file->append(second));
    const auto all = load_sequence(path);
    ASSERT_TRUE(all) << all.error().message();
    EXPECT_EQ(all->frames.size(), 60u);
    expect_frames(*all);
}

TEST(GrowingSequence, ErrorsNameThePath) {
    const auto file = GrowingSequence::create("/no/such/folder/s.igs.mha", head());
    ASSERT_FALSE(file);
    EXPECT_NE(file.error().message().find("/no/such/folder/s.igs.mha"), std::string::npos);
}

}  // namespace
}  // namespace sonocase
