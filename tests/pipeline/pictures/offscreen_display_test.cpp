// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/offscreen_display.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <utility>

namespace sonocase::pipeline {
namespace {

std::string display_name() {
    const char* display = std::getenv("DISPLAY");
    return display ? display : "";
}

TEST(OffscreenDisplay, NamesAServerWhileItLivesAndRestoresTheEnvironment) {
    for (const char* before : {"", ":64999"}) {  // none, and one that does not answer
        if (*before)
            setenv("DISPLAY", before, 1);
        else
            unsetenv("DISPLAY");
        {
            Result<OffscreenDisplay> display = OffscreenDisplay::open();
            if (!display) GTEST_SKIP() << display.error().message();
            EXPECT_EQ(display_name()[0], ':');
            EXPECT_NE(display_name(), before);
            // A second one finds the first; the moved-from object ends nothing.
            const Result<OffscreenDisplay> second = OffscreenDisplay::open();
            ASSERT_TRUE(second);
            const OffscreenDisplay moved(std::move(*display));
            EXPECT_NE(display_name(), before);
        }
        EXPECT_EQ(display_name(), before);
    }
}

}  // namespace
}  // namespace sonocase::pipeline
