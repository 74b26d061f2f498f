// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/session_recorder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <thread>

#include "formats/files/load_save.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

namespace fs = std::filesystem;

using testing::TemporaryFolder;

RecordedFrame frame(int i) {
    testing::Random random(static_cast<std::uint64_t>(i) + 1);
    RecordedFrame f;
    f.time_s = i / 120.0;
    f.frame = i;
    f.probe_ok = true;
    f.needle_ok = i % 10 != 0;
    f.mannequin_from_probe = random.rigid(100);
    f.mannequin_from_needle = random.rigid(100);
    f.mannequin_from_drawn = random.rigid(100);
    if (i == 3) std::snprintf(f.settings.data(), f.settings.size(), "gain_db=2");
    return f;
}

Result<Session> load(const std::string& path) {
    const auto sequence = load_sequence(path);
    if (!sequence) return sequence.error();
    return session_from_sequence(*sequence, guess_names(*sequence), path);
}

TEST(SessionRecorder, WritesFramesEventsSettingsAndPictures) {
    const TemporaryFolder folder(/*in_memory=*/true);
    Exercise exercise;
    exercise.targets.resize(1);
    exercise.targets[0].name = "lesion";
    SessionHeader header;
    header.case_name = "demo";
    header.trainee = "Ada";
    auto recorder = SessionRecorder::start(folder / "s.igs.mha", header, exercise, {});
    ASSERT_TRUE(recorder) << recorder.error().message();
    const std::vector<std::uint8_t> picture(16 * 8, 77);
    for (int i = 0; i < 500; ++i) {
        std::vector<LiveEvent> events;
        if (i == 100) events.push_back({LiveEventKind::target_hit, 0, 1.5, frame(i).time_s, i});
        if (i == 200)
            events.push_back({LiveEventKind::needle_exit, 1, 40, frame(i).time_s - 0.25, i});
        (*recorder)->push(frame(i), events);
        if (i == 100) (*recorder)->push_picture(i, frame(i).time_s, "target_hit", 16, 8, picture);
    }
    ASSERT_TRUE((*recorder)->finish());
    EXPECT_EQ((*recorder)->status().frames_written, 500u);
    EXPECT_EQ((*recorder)->status().problem, "");
    const auto s = load(folder / "s.igs.mha");
    ASSERT_TRUE(s) << s.error().message();
    EXPECT_EQ(s->header.trainee, "Ada");
    ASSERT_EQ(s->samples.size(), 500u);
    for (int i = 0; i < 500; ++i) {
        const SessionSample& sample = s->samples[static_cast<std::size_t>(i)];
        EXPECT_EQ(sample.time_s, frame(i).time_s);
        EXPECT_EQ(sample.needle_ok, i % 10 != 0);
        EXPECT_EQ(sample.mannequin_from_probe, frame(i).mannequin_from_probe);  // to the last bit
    }
    EXPECT_EQ(s->samples[3].settings, "gain_db=2");
    ASSERT_EQ(s->events.size(), 2u);
    EXPECT_EQ(s->events[0].name, "target_hit");
    EXPECT_EQ(detail_value(s->events[0].detail, "name"), "lesion");
    EXPECT_NEAR(s->events[1].time_s, 200 / 120.0 - 0.25, 1e-9);
    const auto pictures = load_sequence(folder / "s.frames.igs.mha");
    ASSERT_TRUE(pictures) << pictures.error().message();
    ASSERT_EQ(pictures->frames.size(), 1u);
    EXPECT_EQ(pictures->pixels, picture);
    EXPECT_EQ(pictures->frames[0].number, 100);
}

// The process is killed at any moment; its clock runs in real time, at 500 frames per second.
TEST(SessionRecorder, KilledWhileItRunsLosesAtMostTheLastSecond) {
    const TemporaryFolder folder(/*in_memory=*/true);
    testing::Random random(5);
    for (int run = 0; run < 6; ++run) {
        const std::string path = folder / ("s" + std::to_string(run) + ".igs.mha");
        int ends[2];
        ASSERT_EQ(::pipe(ends), 0);
        const pid_t child = ::fork();
        if (child == 0) {
            auto recorder = SessionRecorder::start(path, {}, {}, {});
            const auto start = std::chrono::steady_clock::now();
            for (int i = 0; recorder;) {
                const double now_s =
                    std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
                if (now_s < i / 500.0) {
                    std::this_thread::yield();
                    continue;
                }
                RecordedFrame f = frame(i++);
                f.time_s = now_s;
                (*recorder)->push(f, {});
                if (::write(ends[1], &now_s, sizeof now_s) != sizeof now_s) ::_exit(1);
            }
            ::_exit(0);
        }
        ::close(ends[1]);
        const double until_s = random.uniform(0.6, 2.2);
        double told_s = 0, last_s = 0;
        while (told_s < until_s) {
            ASSERT_EQ(::read(ends[0], &told_s, sizeof told_s), static_cast<ssize_t>(sizeof told_s));
            last_s = told_s;
        }
        ::kill(child, SIGKILL);
        while (::read(ends[0], &told_s, sizeof told_s) == static_cast<ssize_t>(sizeof told_s))
            last_s = told_s;
        ::close(ends[0]);
        ::waitpid(child, nullptr, 0);
        const auto s = load(path);
        ASSERT_TRUE(s) << s.error().message();
        ASSERT_FALSE(s->samples.empty());
        EXPECT_LT(last_s - s->samples.back().time_s, 1.0) << run;
    }
}

TEST(SessionRecorder, AFullDiskIsToldAndLosesNothingThatWasThere) {
    const TemporaryFolder folder(/*in_memory=*/true);
    const std::string path = folder / "s.igs.mha";
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    auto recorder = SessionRecorder::start(path, {}, {}, {});
    ASSERT_TRUE(recorder);
    for (int i = 0; i < 50; ++i) (*recorder)->push(frame(i), {});
    while ((*recorder)->status().frames_written < 50) std::this_thread::yield();
    const rlimit small{fs::file_size(path) + 1000, before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    for (int i = 50; i < 90; ++i) (*recorder)->push(frame(i), {});
    while ((*recorder)->status().problem.empty()) std::this_thread::yield();
    EXPECT_NE((*recorder)->status().problem.find("not being recorded"), std::string::npos);
    EXPECT_EQ(load(path)->samples.size(), 50u);
    // Room again: nothing is missing.
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
    for (int i = 90; i < 100; ++i) (*recorder)->push(frame(i), {});
    EXPECT_TRUE((*recorder)->finish());
    std::signal(SIGXFSZ, handler);
    EXPECT_EQ(load(path)->samples.size(), 100u);
    EXPECT_EQ((*recorder)->status().problem, "");
}

TEST(SessionRecorder, AFolderThatIsNotThereIsAnErrorAtOnce) {
    const auto recorder = SessionRecorder::start("/no/such/folder/s.igs.mha", {}, {}, {});
    ASSERT_FALSE(recorder);
    EXPECT_NE(recorder.error().message().find("/no/such/folder"), std::string::npos);
}

TEST(SessionRecorder, PicturesLieBesideTheSession) {
    EXPECT_EQ(pictures_path("a/b.igs.mha"), "a/b.frames.igs.mha");
    EXPECT_EQ(pictures_path("b.mha"), "b.frames.igs.mha");
    EXPECT_EQ(pictures_path("b"), "b.frames.igs.mha");
}

}  // namespace
}  // namespace sonocase::runtime
