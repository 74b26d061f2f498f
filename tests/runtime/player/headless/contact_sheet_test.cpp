// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/contact_sheet.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cstring>

namespace sonocase::runtime {
namespace {

TEST(ContactSheet, HoldsFirstAndLastFrameInTheirPlaces) {
    ContactSheet sheet(40, 16, 10);
    for (int i = 0; i < 40; ++i) {
        sheet.add(i, std::vector<std::uint8_t>(160, static_cast<std::uint8_t>(5 * i)));
    }
    const std::string path = ::testing::TempDir() + "sheet.png";
    ASSERT_TRUE(sheet.write(path));
    png_image image;
    std::memset(&image, 0, sizeof image);
    image.version = PNG_IMAGE_VERSION;
    ASSERT_TRUE(png_image_begin_read_from_file(&image, path.c_str()));
    EXPECT_EQ(image.width, 4u * 8);
    EXPECT_EQ(image.height, 3u * 5);
    image.format = PNG_FORMAT_GRAY;
    std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
    ASSERT_TRUE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr));
    EXPECT_EQ(pixels.front(), 0);
    EXPECT_EQ(pixels.back(), 5 * 39);
}

TEST(ContactSheet, OneFrameIsASheetOfOne) {
    ContactSheet sheet(1, 8, 8);
    sheet.add(0, std::vector<std::uint8_t>(64, 9));
    EXPECT_TRUE(sheet.write(::testing::TempDir() + "one.png"));
}

}  // namespace
}  // namespace sonocase::runtime
