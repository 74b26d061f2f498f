// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "runtime/imaging/renderer.h"
#include "runtime/player/ui/window_picture.h"
#include "support/paths.h"

namespace sonocase::runtime {
namespace {

// docs/effects.md shows every effect that can be left out beside a picture without it.
TEST(EffectPictures, ShowTheEffectOnTheLeftAlone) {
    for (const ImageModel model : {ImageModel::paper, ImageModel::physical}) {
        for (const std::string name : effect_names(model)) {
            if (name == "slice" || name == "compression" || name == "scan_conversion") continue;
            const std::string path = std::string(SONOCASE_SOURCE "/docs/pictures/effects/") +
                                     (model == ImageModel::paper ? "paper-" : "physical-") + name +
                                     ".png";
            const auto both = sonocase::testing::load_picture(path);
            ASSERT_EQ(both.width, 604) << path;
            int differ = 0;
            const auto grey = [&](int x, int y) { return both.rgb[3 * (y * 604 + x)]; };
            for (int y = 0; y < both.height; ++y)
                for (int x = 0; x < 300; ++x)
                    differ += std::abs(grey(x, y) - grey(x + 304, y)) >= 4;
            // Four grey in some 200 places of 90,000 are what an eye finds when it looks for it.
            EXPECT_GT(differ, 200) << path;
        }
    }
}

}  // namespace
}  // namespace sonocase::runtime
