// SPDX-License-Identifier: Apache-2.0

// A bundle that is unpacked as frames need it shows what a complete bundle shows, wherever the
// probe is and whatever moves.
#include "formats/bundle/case_bundle.h"

#include <gtest/gtest.h>

#include <thread>

#include "formats/files/load_save.h"
#include "imaging_support.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::TemporaryFolder;

// Blocks that are not unpacked hold nonsense: records that turn everything beyond a plane into
// label 1.
StreamedBundle opened(const std::string& path) {
    auto bundle = open_bundle(path);
    EXPECT_TRUE(bundle.has_value());
    EXPECT_TRUE(bundle->blocks());
    auto& inside = const_cast<CaseBundle&>(**bundle);
    std::fill(inside.boundary.pool.begin(), inside.boundary.pool.end(), 0x40408101u);
    std::fill(inside.echo_offset.pool.begin(), inside.echo_offset.pool.end(), std::int8_t{99});
    return std::move(*bundle);
}

TEST(OpenBundle, FramesAreThoseOfTheWholeBundle) {
    const TemporaryFolder folder;
    const std::string path = folder / "phantom.sonocase";
    ASSERT_TRUE(save_bundle(phantom(), path));
    const std::uint64_t seed = 41;
    SCOPED_TRACE(seed);
    Random random(seed);
    RenderOptions options;
    options.width_px = options.height_px = 160;
    std::size_t frames_with_blocks_left = 0;
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        Exercise exercise = phantom_exercise();
        exercise.probe.shape = shape;
        exercise.probe.depth_mm = 80;
        exercise.probe.elevation_mm = shape == ProbeShape::phased ? 6 : 3;
        exercise.breathing.amplitude_mm = 12;
        exercise.breathing.direction = {0, 0.6, 0.8};
        const CaseBundle whole = *load_bundle(path);
        auto expected = Renderer::create(whole, exercise, options);
        ASSERT_TRUE(expected);
        for (int n = 0; n < 8; ++n) {
            const StreamedBundle parts = opened(path);
            auto renderer = Renderer::create(parts, exercise, options);
            ASSERT_TRUE(renderer);
            for (int frame = 0; frame < 3; ++frame) {
                FrameInput input;
                input.mannequin_from_probe = random_pose(random);
                input.time_s = random.uniform(0, 8);
                std::vector<std::uint8_t> a(160 * 160), b(160 * 160);
                EXPECT_EQ(expected->render(input, a), renderer->render(input, b));
                EXPECT_EQ(a, b) << "probe " << static_cast<int>(shape) << " pose " << n << " frame "
                                << frame;
                frames_with_blocks_left += !parts.blocks()->whole();
            }
        }
    }
    EXPECT_GT(frames_with_blocks_left, 36u);  // of 72: it was not all unpacked at once
}

TEST(OpenBundle, ReadingAheadChangesNoPixel) {
    const TemporaryFolder folder;
    const std::string path = folder / "phantom.sonocase";
    ASSERT_TRUE(save_bundle(phantom(), path));
    const CaseBundle whole = *load_bundle(path);
    const StreamedBundle parts = opened(path);
    RenderOptions options;
    options.width_px = options.height_px = 160;
    const Exercise exercise = phantom_exercise();
    auto expected = Renderer::create(whole, exercise, options);
    options.read_ahead = true;
    options.host = thread_host();
    auto renderer = Renderer::create(parts, exercise, options);
    ASSERT_TRUE(expected);
    ASSERT_TRUE(renderer);
    Random random(43);
    std::vector<std::uint8_t> a(160 * 160), b(160 * 160);
    for (int frame = 0; frame < 40; ++frame) {
        FrameInput input;
        input.mannequin_from_probe = random_pose(random);
        EXPECT_EQ(expected->render(input, a), renderer->render(input, b));
        EXPECT_EQ(a, b) << "frame " << frame;
    }
}

// The phantom ends within what is read around the plane: a probe at rest ends up with all of it.
TEST(OpenBundle, ReadsAheadRoundThePlane) {
    const TemporaryFolder folder;
    const std::string path = folder / "phantom.sonocase";
    ASSERT_TRUE(save_bundle(phantom(), path));
    RenderOptions options;
    options.width_px = options.height_px = 32;
    std::vector<std::uint8_t> pixels(32 * 32);
    for (const bool ahead : {false, true}) {
        const StreamedBundle parts = opened(path);
        options.read_ahead = ahead;
        options.host = thread_host();
        auto renderer = Renderer::create(parts, phantom_exercise(), options);
        ASSERT_TRUE(renderer);
        renderer->render({}, pixels);
        while (ahead && !parts.blocks()->whole()) std::this_thread::yield();
        EXPECT_EQ(parts.blocks()->whole(), ahead);
    }
}

TEST(OpenBundle, TheSlowRendererHasAllOfIt) {
    const TemporaryFolder folder;
    const std::string path = folder / "phantom.sonocase";
    ASSERT_TRUE(save_bundle(phantom(), path));
    const StreamedBundle parts = opened(path);
    RenderOptions options;
    options.kind = RendererKind::reference;
    options.scanlines = 16;
    options.samples = 64;
    options.width_px = options.height_px = 32;
    ASSERT_TRUE(Renderer::create(parts, phantom_exercise(), options));
    EXPECT_TRUE(parts.blocks()->whole());
}

}  // namespace
}  // namespace sonocase::runtime
