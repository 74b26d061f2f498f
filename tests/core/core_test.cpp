// SPDX-License-Identifier: Apache-2.0

// A program that links sonocase::core and nothing else of ours: bytes in, pixels and scores out.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/calibration/calibration.h"
#include "formats/exercise/exercise.h"
#include "formats/recording/sequence.h"
#include "formats/scoring/session_score.h"
#include "runtime/imaging/renderer.h"
#include "sonocase/version.h"
#include "support/small_case.h"

#if !defined(__SANITIZE_ADDRESS__)
// Stands in for the C++ library's: whatever throws ends the program, and the test with it.
[[noreturn]] void end_at_throw(void*, void*, void (*)(void*)) asm("__cxa_throw");
[[noreturn]] void end_at_throw(void*, void*, void (*)(void*)) {
    std::fputs("an exception was thrown\n", stderr);
    std::abort();
}
#endif

namespace sonocase {
namespace {

constexpr int kEdgePx = 128;

std::vector<std::uint8_t> picture_of(CaseView bundle) {
    const Result<Exercise> exercise = parse_exercise(bundle->exercises[0].toml, "scan");
    EXPECT_TRUE(exercise);
    runtime::RenderOptions options;
    options.width_px = options.height_px = kEdgePx;
    auto renderer = runtime::Renderer::create(bundle, *exercise, options);
    EXPECT_TRUE(renderer);
    runtime::FrameInput input;
    input.mannequin_from_probe = {Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}),
                                  {0, 0, 60}};
    std::vector<std::uint8_t> pixels(kEdgePx * kEdgePx);
    EXPECT_EQ(renderer->render(input, pixels), runtime::FrameStatus::rendered);
    return pixels;
}

TEST(Core, ReadsABundleAndRendersAFrame) {
    const std::vector<std::uint8_t> bytes = write_bundle(testing::small_case());
    const Result<CaseBundle> bundle = read_bundle(bytes, "small");
    ASSERT_TRUE(bundle) << bundle.error().message();
    const std::vector<std::uint8_t> pixels = picture_of(*bundle);
    int bright = 0;
    for (const std::uint8_t p : pixels) bright += p > 40;
    EXPECT_GT(bright, kEdgePx * kEdgePx / 20);
}

TEST(Core, AStreamedBundleShowsTheSame) {
    const std::vector<std::uint8_t> bytes = write_bundle(testing::small_case());
    const Result<CaseBundle> whole = read_bundle(bytes, "small");
    auto streamed = stream_bundle(RawVector<std::uint8_t>(bytes.begin(), bytes.end()), "small");
    ASSERT_TRUE(whole);
    ASSERT_TRUE(streamed);
    EXPECT_EQ(picture_of(*streamed), picture_of(*whole));
}

TEST(Core, ScoresASession) {
    const CaseBundle bundle = testing::small_case();
    const Result<Exercise> exercise = parse_exercise(bundle.exercises[0].toml, "scan");
    ASSERT_TRUE(exercise);
    Session session;
    for (int n = 0; n < 100; ++n) {
        SessionSample sample;
        sample.time_s = 0.05 * n;
        sample.frame = n;
        sample.probe_ok = true;
        session.samples.push_back(sample);
    }
    const CaseAnatomy anatomy(bundle);
    const SessionScore score = score_session(session, *exercise, &anatomy, bundle.labels);
    EXPECT_FALSE(score.metrics.empty());
}

// An exception would end this program (end_at_throw).
TEST(Core, RefusesBadBytesWithoutAnException) {
    const std::vector<std::uint8_t> bytes = write_bundle(testing::small_case());
    for (std::size_t n = 0; n < bytes.size(); n += 1 + bytes.size() / 200)
        EXPECT_FALSE(read_bundle(std::span(bytes).first(n), "cut")) << n;
    const auto refuses = [](auto change) {
        CaseBundle bundle = testing::small_case();
        change(bundle);
        EXPECT_FALSE(read_bundle(write_bundle(bundle), "forged"));
    };
    refuses([](CaseBundle& b) { b.label_bricks.pool[5] = 200; });
    refuses([](CaseBundle& b) { b.grid.size = {60000, 60000, 60000}; });
    refuses([](CaseBundle& b) { b.grid.size = {1000, 1000, 1000}; });
    refuses([](CaseBundle& b) { b.labels[1].tissue = "cheese"; });
    refuses([](CaseBundle& b) { b.speckle.edge = 512; });
}

TEST(Core, RefusesBadTextWithoutAnException) {
    for (const char* json : {"", "{", "[1]", "{\"version\": 1e999}", "{\"a\": \"\xff\"}", "nul"}) {
        EXPECT_FALSE(parse_calibration(json, "text")) << json;
    }
    const std::string deep(100000, '[');
    EXPECT_FALSE(parse_calibration("{\"a\": " + deep, "text"));
    for (const char* toml : {"name = ", "[[[", "name = 1", "probe = 3", "x = 1e999"})
        EXPECT_FALSE(parse_exercise(toml, "text")) << toml;
    const std::string_view recording = "ObjectType = Image\nNDims = 3\nDimSize = 1 1 -4\n";
    const auto* first = reinterpret_cast<const std::uint8_t*>(recording.data());
    for (std::size_t n = 0; n <= recording.size(); ++n)
        EXPECT_FALSE(read_sequence({first, n}, "text")) << n;
}

TEST(Core, SaysItsVersion) {
    EXPECT_STRNE(SONOCASE_VERSION, "");
    EXPECT_GE(SONOCASE_CORE_API, 1);
}

}  // namespace
}  // namespace sonocase
