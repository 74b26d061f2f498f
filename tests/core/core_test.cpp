// SPDX-License-Identifier: Apache-2.0

// A program that links sonocase::core and nothing else of ours: bytes in, pixels and scores out.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/scoring/session_score.h"
#include "runtime/imaging/renderer.h"
#include "sonocase/version.h"
#include "support/small_case.h"

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

TEST(Core, RefusesBytesThatAreNoBundle) {
    std::vector<std::uint8_t> bytes = write_bundle(testing::small_case());
    bytes.resize(bytes.size() / 2);
    EXPECT_FALSE(read_bundle(bytes, "cut"));
    EXPECT_FALSE(read_bundle({}, "empty"));
}

TEST(Core, SaysItsVersion) {
    EXPECT_STRNE(SONOCASE_VERSION, "");
    EXPECT_GE(SONOCASE_CORE_API, 1);
}

}  // namespace
}  // namespace sonocase
