// SPDX-License-Identifier: Apache-2.0

// "What am I looking at", against what is known of the small case: a vessel across muscle.
#include "runtime/player/app/tissue_names.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "runtime/engine/scan_engine.h"
#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

struct Scene {
    CaseBundle bundle = testing::small_case();
    RenderOptions options;
    FrameInput input;
    Scene() {
        options.model = ImageModel::paper;
        options.width_px = 200;
        options.height_px = 160;
        // The middle of the face on the skin above the vessel, looking down at it.
        input.mannequin_from_probe.rotation =
            Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1});
        input.mannequin_from_probe.translation = {0, 0, 60};
    }
};

TEST(TissueNames, SayWhatAPixelShows) {
    Scene scene;
    auto names = TissueNames::create(scene.bundle, testing::small_exercise(), scene.options);
    ASSERT_TRUE(names) << names.error().message();
    const auto renderer = Renderer::create(scene.bundle, testing::small_exercise(), scene.options);
    ASSERT_TRUE(renderer);
    const Renderer::Layout layout = renderer->layout();
    const auto at = [&](double x_mm, double z_mm) {
        return names->at(scene.input,
                         static_cast<int>(layout.origin_x_px + x_mm / layout.mm_per_px),
                         static_cast<int>(layout.origin_y_px + z_mm / layout.mm_per_px));
    };
    EXPECT_EQ(at(0, 35), "Vessel");  // its middle: 25 mm above the axis, 60 less 25 deep
    EXPECT_EQ(at(0, 20), "Muscle");
    EXPECT_EQ(at(0, 50), "Muscle");
    EXPECT_EQ(names->at(scene.input, 0, 0), "");  // beside the sector
    EXPECT_EQ(names->at(scene.input, -1, 5), "");
    EXPECT_EQ(names->at(scene.input, 5, 160), "");
}

TEST(TissueNames, OutlineTheVesselAndNameBoth) {
    Scene scene;
    auto names = TissueNames::create(scene.bundle, testing::small_exercise(), scene.options);
    ASSERT_TRUE(names);
    std::vector<std::uint8_t> rgb(3 * 200 * 160, 7);
    const std::vector<TissueName> found = names->outline(scene.input, rgb);
    ASSERT_EQ(found.size(), 2u);
    EXPECT_EQ(found[0].words, "Muscle");
    EXPECT_EQ(found[1].words, "Vessel");
    for (const TissueName& name : found)
        EXPECT_EQ(names->at(scene.input, static_cast<int>(name.column), static_cast<int>(name.row)),
                  name.words);
    // A circle of 6 mm radius: some 2 pi r / pixel edge pixels, no more than twice that.
    const auto white = std::count(rgb.begin(), rgb.end(), 255) / 3;
    const auto rest = std::count(rgb.begin(), rgb.end(), 7) / 3;
    EXPECT_EQ(white + rest, 200 * 160);
    EXPECT_GT(white, 20);
    EXPECT_LT(white, 200);
}

}  // namespace
}  // namespace sonocase::runtime
