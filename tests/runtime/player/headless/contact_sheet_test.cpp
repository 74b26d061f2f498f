// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/frame_files.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cstdio>
#include <cstring>
#include <string>

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

TEST(ContactSheet, WritesTheCaptionIntoTheCornerWhereItFits) {
    ContactSheet sheet(1, 80, 40);
    const std::vector<std::uint8_t> grey(80 * 40, 100);
    sheet.add(0, grey, "1");
    const std::string path = ::testing::TempDir() + "caption.png";
    ASSERT_TRUE(sheet.write(path));
    png_image image;
    std::memset(&image, 0, sizeof image);
    image.version = PNG_IMAGE_VERSION;
    ASSERT_TRUE(png_image_begin_read_from_file(&image, path.c_str()));
    image.format = PNG_FORMAT_GRAY;
    std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
    ASSERT_TRUE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr));
    // The digit 1 in a black field of 5 x 7 pixels at the lower left.
    std::string drawn;
    for (int y = 13; y < 20; ++y) {
        for (int x = 0; x < 5; ++x)
            drawn += pixels[static_cast<std::size_t>(40 * y + x)] > 200 ? '#' : '.';
        drawn += '\n';
    }
    EXPECT_EQ(drawn, ".....\n..#..\n.##..\n..#..\n..#..\n.###.\n.....\n");
    EXPECT_EQ(pixels[40 * 13 + 5], 100);
    ContactSheet narrow(1, 16, 40);
    narrow.add(0, grey,
               "123456789");  // too long: left out, and nothing beyond the frame is touched
    EXPECT_TRUE(narrow.write(path));
}

TEST(ContactSheet, OneFrameIsASheetOfOne) {
    ContactSheet sheet(1, 8, 8);
    sheet.add(0, std::vector<std::uint8_t>(64, 9));
    EXPECT_TRUE(sheet.write(::testing::TempDir() + "one.png"));
}

// libpng reads the text back, its checksum included.
TEST(ContactSheet, CarriesWhoseAnatomyItShows) {
    ContactSheet sheet(1, 8, 8);
    sheet.add(0, std::vector<std::uint8_t>(64, 9));
    const std::string path = ::testing::TempDir() + "credits.png",
                      text = "Katy B\xc3\xb6rner, CC BY";
    ASSERT_TRUE(sheet.write(path, text));
    std::FILE* file = std::fopen(path.c_str(), "rb");
    ASSERT_NE(file, nullptr);
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_init_io(png, file);
    png_read_info(png, info);
    png_textp texts = nullptr;
    int count = 0;
    png_get_text(png, info, &texts, &count);
    ASSERT_EQ(count, 1);
    EXPECT_STREQ(texts[0].key, "Copyright");
    EXPECT_EQ(texts[0].text, text);
    EXPECT_EQ(png_get_image_width(png, info), 4u);
    png_destroy_read_struct(&png, &info, nullptr);
    std::fclose(file);
}

}  // namespace
}  // namespace sonocase::runtime
