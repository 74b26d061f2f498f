// SPDX-License-Identifier: Apache-2.0

// Difficult examples: a correct texture or an error that says why not.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <set>
#include <string>

#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/texture/example_image.h"
#include "pipeline/texture/read_example.h"
#include "pipeline/texture/synthetic_examples.h"
#include "pipeline/texture/texture_bank.h"
#include "pipeline/texture/texture_quality.h"
#include "support/paths.h"

namespace sonocase::pipeline {
namespace {

class Folder : public ::testing::Test {
  protected:
    void SetUp() override {
        path_ =
            std::filesystem::temp_directory_path() / ("texture_test_" + std::to_string(::getpid()));
        std::filesystem::create_directories(path_);
    }
    void TearDown() override { std::filesystem::remove_all(path_); }

    // Netpbm: the simplest files with 8 and 16 bits, grey and colour.
    std::string write_netpbm(const std::string& name,
                             int width,
                             int height,
                             int top,
                             int channels,
                             const std::function<int(int x, int y, int c)>& value) {
        const std::string file = (path_ / name).string();
        std::ofstream out(file, std::ios::binary);
        out << (channels == 1 ? "P5" : "P6") << "\n"
            << width << " " << height << "\n"
            << top << "\n";
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                for (int c = 0; c < channels; ++c) {
                    const int v = value(x, y, c);
                    if (top > 255) out.put(static_cast<char>(v >> 8));
                    out.put(static_cast<char>(v & 255));
                }
        return file;
    }
    std::filesystem::path path_;
};

double used_share(const ExampleImage& image) {
    double used = 0;
    for (std::size_t i = 0; i < image.count(); ++i) used += image.used(i);
    return used / static_cast<double>(image.count());
}

TEST_F(Folder, EightAndSixteenBitsReadTheSame) {
    const ExampleImage e = synthetic_example("liver", 40, 30);
    const auto grey = [&](int x, int y) { return static_cast<int>(e.grey[e.index(x, y)]); };
    const auto eight = read_example(
        write_netpbm("a.pgm", 40, 30, 255, 1, [&](int x, int y, int) { return grey(x, y); }));
    const auto sixteen = read_example(write_netpbm(
        "b.pgm", 40, 30, 65535, 1, [&](int x, int y, int) { return 257 * grey(x, y); }));
    std::vector<std::string> notes;
    const auto twelve = read_example(
        write_netpbm("c.pgm", 40, 30, 65535, 1, [&](int x, int y, int) { return 16 * grey(x, y); }),
        {}, &notes);
    ASSERT_TRUE(eight && sixteen && twelve);
    EXPECT_FALSE(notes.empty());
    for (std::size_t i = 0; i < eight->count(); ++i) {
        EXPECT_NEAR(eight->grey[i], e.grey[i], 0.01);
        EXPECT_NEAR(sixteen->grey[i], e.grey[i], 0.01);
        EXPECT_NEAR(twelve->grey[i], e.grey[i], 0.6);  // 255 * 16 is not quite 4095
    }
}

TEST_F(Folder, ColourBecomesLuminanceAndMarkersAreLeftOut) {
    const ExampleImage e = synthetic_example("liver", 60, 50);
    std::vector<std::string> notes;
    const auto read = read_example(write_netpbm("a.ppm", 60, 50, 255, 3,
                                                [&](int x, int y, int c) {
                                                    if (x < 6 && y < 5)
                                                        return c == 1 ? 255 : 0;  // a green marker
                                                    return static_cast<int>(e.grey[e.index(x, y)]);
                                                }),
                                   {}, &notes);
    ASSERT_TRUE(read);
    EXPECT_NEAR(used_share(*read), 1 - 30.0 / 3000, 1e-9);
    EXPECT_NEAR(read->grey[read->index(30, 30)], e.grey[e.index(30, 30)], 0.01);
    EXPECT_EQ(notes.size(), 1u);
}

TEST_F(Folder, RectangleAndMask) {
    const std::string file =
        write_netpbm("a.pgm", 32, 24, 255, 1, [](int x, int y, int) { return x + 4 * y; });
    ReadExampleOptions options;
    options.rectangle = PixelRectangle{4, 6, 10, 8};
    const auto part = read_example(file, options);
    ASSERT_TRUE(part);
    EXPECT_EQ(part->width, 10);
    EXPECT_EQ(part->grey[part->index(2, 3)], 6 + 4 * 9);
    options.rectangle = PixelRectangle{30, 0, 10, 8};
    EXPECT_FALSE(read_example(file, options));
    options.rectangle = PixelRectangle{2147483647, 0, 2147483647, 8};
    EXPECT_FALSE(read_example(file, options));
    options.rectangle.reset();
    options.mask_path =
        write_netpbm("m.pgm", 32, 24, 255, 1, [](int x, int, int) { return x < 8 ? 255 : 0; });
    const auto masked = read_example(file, options);
    ASSERT_TRUE(masked);
    EXPECT_NEAR(used_share(*masked), 0.25, 1e-9);
    options.mask_path = write_netpbm("n.pgm", 31, 24, 255, 1, [](int, int, int) { return 255; });
    EXPECT_FALSE(read_example(file, options));
}

TEST_F(Folder, MissingTruncatedAndForeignFilesAreRefusedByName) {
    const auto missing = read_example((path_ / "no.png").string());
    ASSERT_FALSE(missing);
    EXPECT_NE(missing.error().message().find("no.png"), std::string::npos);
    const std::string text = (path_ / "text.png").string();
    std::ofstream(text) << "this is not a picture";
    ASSERT_FALSE(read_example(text));
    EXPECT_EQ(read_example(text).error().message().find('\n'), std::string::npos);
    const std::string whole =
        write_netpbm("a.pgm", 64, 64, 255, 1, [](int x, int y, int) { return x ^ y; });
    std::filesystem::resize_file(whole, 900);
    EXPECT_FALSE(read_example(whole));
    const auto folder = read_example(path_.string());
    ASSERT_FALSE(folder);
    EXPECT_NE(folder.error().message().find("a folder; expected an image"), std::string::npos);
}

Result<SolidTextureResult> learn(const ExampleImage& example, int edge = 32) {
    TextureSpec spec;
    spec.name = "t";
    spec.edge = edge;
    spec.examples = {example};
    return make_solid_texture(spec);
}

ExampleImage filled(int width, int height, const std::function<double(int, int)>& grey) {
    ExampleImage e{"made", width, height, {}, {}};
    e.grey.resize(e.count());
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) e.grey[e.index(x, y)] = static_cast<float>(grey(x, y));
    return e;
}

TEST(HardExample, ConstantImageIsRefused) {
    const auto made = learn(filled(40, 40, [](int, int) { return 77; }));
    ASSERT_FALSE(made);
    EXPECT_NE(made.error().message().find("constant"), std::string::npos);
    EXPECT_NE(made.error().message().find("77"), std::string::npos);
}

TEST(HardExample, NothingButARampIsRefused) {
    EXPECT_FALSE(learn(filled(40, 40, [](int, int y) { return 2 * y; })));
}

TEST(HardExample, TwoLevelsStayTwoLevels) {
    const auto made = learn(filled(48, 48, [](int x, int y) {
        return uniform_at(3, static_cast<std::uint64_t>(x / 3 + 50 * (y / 2))) < 0.3 ? 200 : 40;
    }));
    ASSERT_TRUE(made);
    std::set<int> levels(made->texture.voxels.begin(), made->texture.voxels.end());
    EXPECT_EQ(levels.size(), 2u);
    EXPECT_FALSE(made->warnings.empty());
}

TEST(HardExample, EightByEightIsJustEnoughAndLessIsRefused) {
    const ExampleImage small = synthetic_example("liver", 8, 8);
    EXPECT_TRUE(learn(small));
    TextureSpec spec;
    spec.name = "t";
    spec.mode = TextureMode::pyramid;
    spec.edge = 32;
    spec.examples = {small};
    const auto pyramid = make_solid_texture(spec);
    ASSERT_TRUE(pyramid);
    EXPECT_FALSE(pyramid->warnings.empty());
    ExampleImage masked = synthetic_example("liver", 40, 40);
    masked.use.assign(masked.count(), 0);
    for (std::size_t i = 0; i < 63; ++i) masked.use[i] = 1;
    const auto refused = learn(masked);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message().find("63"), std::string::npos);
}

TEST(HardExample, SaturationIsSaidAndKept) {
    const ExampleImage e = synthetic_example("liver", 80, 60);
    ExampleImage bright = e;
    for (float& g : bright.grey) g = std::min(255.f, 255.f + 3 * (g - 120));
    const auto made = learn(bright);
    ASSERT_TRUE(made);
    ASSERT_FALSE(made->warnings.empty());
    EXPECT_NE(made->warnings[0].find("clipped"), std::string::npos);
    // Stretched threefold, one level of grey holds 3 % of the pixels, and the texture's code may
    // put it half a level lower.
    EXPECT_LT(distance_between(*made, prepare_example(bright)->image).ks, 0.045);
}

TEST(HardExample, NotFinitePixelsAreLeftOut) {
    ExampleImage e = synthetic_example("liver", 60, 60);
    for (std::size_t i = 0; i < 300; ++i) {
        e.grey[7 * i] = i % 2 ? std::numeric_limits<float>::quiet_NaN()
                              : std::numeric_limits<float>::infinity();
    }
    const auto made = learn(e);
    ASSERT_TRUE(made);
    EXPECT_TRUE(std::isfinite(made->grey_mean) && std::isfinite(made->grey_sd));
    EXPECT_FALSE(made->warnings.empty());
    for (float& g : e.grey) g = std::numeric_limits<float>::quiet_NaN();
    EXPECT_FALSE(learn(e));
}

TEST(HardExample, FrameAndTextBurntInDoNotEnterTheTexture) {
    const ExampleImage clean = synthetic_example("liver", 120, 100);
    ExampleImage marked = clean;
    for (int x = 0; x < 120; ++x)
        marked.grey[marked.index(x, 0)] = marked.grey[marked.index(x, 99)] = 0;
    for (int x = 20; x < 100; ++x) marked.grey[marked.index(x, 15)] = 255;  // a ruler
    for (int c = 0; c < 6; ++c)                                             // letters
        for (int y = 40; y < 52; ++y) {
            marked.grey[marked.index(30 + 9 * c, y)] = 255;
            marked.grey[marked.index(31 + 9 * c, y)] = 255;
            if (y == 45) {
                for (int x = 0; x < 6; ++x) marked.grey[marked.index(30 + 9 * c + x, y)] = 255;
            }
        }
    const auto prepared = prepare_example(marked);
    ASSERT_TRUE(prepared);
    ASSERT_FALSE(prepared->warnings.empty());
    EXPECT_NE(prepared->warnings[0].find("burnt in"), std::string::npos);
    EXPECT_GT(used_share(prepared->image), 0.8);
    const auto plain = prepare_example(clean);
    EXPECT_NEAR(prepared->mean, plain->mean, 1.5);
    EXPECT_NEAR(prepared->sd, plain->sd, 1.0);
    // and a clean image loses nothing
    EXPECT_EQ(used_share(plain->image), 1);
    EXPECT_TRUE(plain->warnings.empty());
}

TEST(HardExample, DepthRampComesOffAndTheGrainStays) {
    const ExampleImage e = synthetic_example("liver", 120, 100);
    ExampleImage ramp = e;
    for (int y = 0; y < 100; ++y)
        for (int x = 0; x < 120; ++x)
            ramp.grey[ramp.index(x, y)] += static_cast<float>(0.9 * (y - 50));
    const auto flat = prepare_example(e), levelled = prepare_example(ramp);
    ASSERT_TRUE(flat && levelled);
    EXPECT_NEAR(levelled->trend_grey - flat->trend_grey, 0.9 * 99, 2);
    EXPECT_NEAR(levelled->sd / flat->sd, 1, 0.03);
    // a linear display: the ramp multiplies, and the spread is evened out too
    ExampleImage gain = e;
    for (int y = 0; y < 100; ++y)
        for (int x = 0; x < 120; ++x)
            gain.grey[gain.index(x, y)] *= static_cast<float>(0.4 + 1.2 * y / 99);
    const auto even = prepare_example(gain);
    ASSERT_TRUE(even);
    EXPECT_GT(even->spread_ratio, 2.5);
    const auto half_sd = [](const ExampleImage& image, int from, int to) {
        double n = 0, sum = 0, square = 0;
        for (int y = from; y < to; ++y)
            for (int x = 0; x < image.width; ++x) {
                const double g = image.grey[image.index(x, y)];
                n += 1, sum += g, square += g * g;
            }
        return std::sqrt(square / n - sum * sum / n / n);
    };
    EXPECT_NEAR(half_sd(even->image, 0, 50) / half_sd(even->image, 50, 100), 1, 0.2);
}

TEST(SharedPatches, MeetTheBars) {
    const std::string folder = std::string(SONOCASE_DATA) + "/ultrasound/patches";
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
        const auto example = read_example(entry.path().string());
        ASSERT_TRUE(example);
        TextureSpec spec;
        spec.name = entry.path().stem().string();
        spec.third_axis = ThirdAxis::along;
        spec.examples = {*example};
        const auto a = assess_texture(spec);
        ASSERT_TRUE(a) << spec.name;
        const TextureQuality& q = a->quality;
        EXPECT_LE(q.distance.ks, 0.03) << spec.name;
        constexpr double width = 0.10;
        EXPECT_NEAR(q.texture.along / q.example.along, 1, width) << spec.name;
        EXPECT_NEAR(q.texture.across / q.example.across, 1, width) << spec.name;
        EXPECT_NEAR(q.texture.ratio() / q.example.ratio(), 1, 0.15) << spec.name;
        EXPECT_LE(q.seam_score, 2) << spec.name;
        ASSERT_TRUE(a->has_held_back) << spec.name;
        EXPECT_LE(a->held_back.ks, 1.5 * q.floor.ks) << spec.name;
        EXPECT_LE(a->held_back.grain, 1.5 * q.floor.grain) << spec.name;
    }
}

// Names of the textures of the tissue table.
std::set<std::string> wanted_textures() {
    std::set<std::string> wanted;
    for (const Tissue& t : built_in_tissues()) {
        if (!t.texture.empty()) wanted.insert(t.texture);
    }
    return wanted;
}

TEST(TextureBank, EveryTextureOfTheTableOnceWithoutRealPatches) {
    TextureBankOptions options;
    options.edge = 16;
    const auto bank = build_texture_bank(built_in_tissues(), options);
    ASSERT_TRUE(bank);
    std::set<std::string> made;
    for (const SolidTexture& t : bank->textures) made.insert(t.name);
    EXPECT_EQ(made, wanted_textures());
    EXPECT_EQ(bank->textures.size(), wanted_textures().size());
}

TEST(TextureBank, EveryTextureOfTheTableOnceFromRealPatches) {
    TextureBankOptions options;
    options.edge = 16;
    options.example_folder = std::string(SONOCASE_DATA) + "/ultrasound";
    if (!std::filesystem::exists(options.example_folder))
        GTEST_SKIP() << "no " << options.example_folder;
    const auto bank = build_texture_bank(built_in_tissues(), options);
    ASSERT_TRUE(bank);
    EXPECT_EQ(bank->textures.size(), wanted_textures().size());
    EXPECT_EQ(bank->report.measures[1].value, 0) << "every texture has a real stand-in";
}

}  // namespace
}  // namespace sonocase::pipeline
