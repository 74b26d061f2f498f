// SPDX-License-Identifier: Apache-2.0

// Scenes, poses and sizes at the limits of what is allowed, with both models: they render, agree
// with the slow renderer, and look as they must.
#include <gtest/gtest.h>

#include <cmath>

#include "imaging_support.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

RenderOptions options_of(ImageModel model, int size = 128) {
    RenderOptions o;
    o.model = model;
    o.width_px = o.height_px = size;
    o.scanlines = 64;
    o.samples = 160;
    return o;
}

std::vector<std::uint8_t> picture(const CaseBundle& bundle,
                                  RenderOptions options,
                                  const FrameInput& input,
                                  RendererKind kind = RendererKind::fast,
                                  const Exercise& exercise = phantom_exercise()) {
    options.kind = kind;
    auto renderer = Renderer::create(bundle, exercise, options);
    EXPECT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(options.width_px) *
                                     options.height_px);
    EXPECT_NE(renderer->render(input, pixels), FrameStatus::held_bad_pose);
    return pixels;
}

// Both renderers' mean difference, limits as in the models' own tests: model `physical` differs by
// rounding alone, model `paper` by where it samples the texture.
void expect_agreement(const CaseBundle& bundle,
                      ImageModel model,
                      const FrameInput& input,
                      const std::string& what,
                      const Exercise& exercise = phantom_exercise()) {
    const RenderOptions o = options_of(model);
    const Difference d = compare(picture(bundle, o, input, RendererKind::fast, exercise),
                                 picture(bundle, o, input, RendererKind::reference, exercise));
    EXPECT_LT(d.mean, model == ImageModel::paper ? 5.5 : 0.5) << what;
    EXPECT_LT(std::abs(d.bias), model == ImageModel::paper ? 1.0 : 0.15) << what;
}

// Every voxel of the phantom's grid in one label.
CaseBundle filled_with(std::uint8_t label) {
    PhantomOptions options;
    options.voxel_mm = 2;
    options.boundaries = options.structure = false;
    CaseBundle b = Phantom(options).bundle();
    const std::vector<std::uint8_t> labels(b.grid.voxel_count(), label);
    b.label_bricks = bricks_from_dense<std::uint8_t>(labels, b.grid.size);
    return b;
}

double mean_of(const std::vector<std::uint8_t>& pixels) {
    double sum = 0;
    for (const std::uint8_t p : pixels) sum += p;
    return sum / static_cast<double>(pixels.size());
}

constexpr ImageModel kModels[] = {ImageModel::paper, ImageModel::physical};

TEST(HardCases, PosesOutsideOnFacesAndThroughCorners) {
    const Vector3 shifts[] = {{1e6, 0, 0},      // nothing near
                              {0, 0, -500},     // behind the body
                              {0.5, 0.5, 0.5},  // the plane runs along voxel faces
                              {0, 30, 0},       // along the volume's own side
                              {90, 30, 170},    // through its last corner
                              {-90.5, 0, 0}};   // the middle beam along its first face
    for (const ImageModel model : kModels) {
        for (const Vector3& shift : shifts) {
            FrameInput input = needle_input();
            input.mannequin_from_probe.translation = shift;
            expect_agreement(phantom(), model, input, std::to_string(shift.x));
        }
    }
}

TEST(HardCases, BadPosesHoldTheFrameOfBothModels) {
    std::vector<Rigid> bad(5);
    bad[0].translation.x = NAN;
    bad[1].translation.z = INFINITY;
    bad[2].rotation = Matrix3::diagonal({1, 1, 1.01});
    bad[3].rotation = Matrix3::diagonal({1, 1, -1});
    bad[4].rotation(0, 1) = NAN;
    for (const ImageModel model : kModels) {
        auto renderer = Renderer::create(phantom(), phantom_exercise(), options_of(model));
        ASSERT_TRUE(renderer.has_value());
        std::vector<std::uint8_t> pixels(128 * 128, 99);
        const std::vector<std::uint8_t> before = pixels;
        for (const Rigid& pose : bad) {
            FrameInput input;
            input.mannequin_from_probe = pose;
            EXPECT_EQ(renderer->render(input, pixels), FrameStatus::held_bad_pose);
            EXPECT_EQ(pixels, before);
        }
    }
}

TEST(HardCases, SkippingWhatCannotShowNeverChangesAPixel) {
    for (const ImageModel model : kModels) {
        for (std::uint64_t seed = 1; seed <= 10; ++seed) {
            Random random(seed);
            FrameInput input = needle_input();
            input.mannequin_from_probe = random_pose(random);
            if (seed % 2) input.needle.tip = random.point(80);
            RenderOptions pruned, all;
            pruned.model = all.model = model;
            all.effects = {"all"};
            pruned.width_px = pruned.height_px = all.width_px = all.height_px = 256;
            EXPECT_TRUE(draw(phantom_exercise(), pruned, input) ==
                        draw(phantom_exercise(), all, input))
                << seed;
        }
    }
}

TEST(HardCases, NeedlesInEveryAwkwardPlace) {
    struct Case {
        const char* what;
        Point3 tip;
        Vector3 direction;
        double slab_mm, length_mm;
    };
    const Case cases[] = {{"in the plane", {10, 0, 60}, {0.6, 0, 0.8}, 0, 150},
                          {"normal to the plane", {10, 5, 60}, {0, 1, 0}, 0, 150},
                          {"along the beam", {0, 0, 60}, {0, 0, 1}, 0, 150},
                          {"no slab", {10, 0, 60}, {0.6, 0, 0.8}, 1e-12, 150},
                          {"shorter than a voxel", {10, 0, 60}, {0.6, 0, 0.8}, 0, 0.2},
                          {"no length", {10, 0, 60}, {0.6, 0, 0.8}, 0, 0}};
    for (const ImageModel model : kModels) {
        for (const Case& c : cases) {
            Exercise exercise = phantom_exercise();
            exercise.needle.slab_mm = c.slab_mm;
            exercise.needle.length_mm = c.length_mm;
            FrameInput input;
            input.has_needle = true;
            input.needle = {c.tip, normalized(c.direction)};
            expect_agreement(phantom(), model, input, c.what, exercise);
        }
    }
}

TEST(HardCases, NeedleTipOnAPixelCentreLightsThatPixel) {
    for (const ImageModel model : kModels) {
        RenderOptions o = options_of(model);
        // Without attenuation the gain would lift the tissue over the needle.
        o.effects = {"needle", "attenuation"};
        o.scanlines = o.samples = 512;  // finer than the needle
        auto renderer = Renderer::create(phantom(), phantom_exercise(), o);
        const auto layout = renderer->layout();
        const std::size_t column = 70, row = 60;
        FrameInput input;
        const auto without = picture(phantom(), o, input);
        input.has_needle = true;
        input.needle.tip = {(static_cast<double>(column) - layout.origin_x_px) * layout.mm_per_px,
                            0, (static_cast<double>(row) - layout.origin_y_px) * layout.mm_per_px};
        input.needle.direction = normalized({0.8, 0, 0.6});
        const auto with = picture(phantom(), o, input);
        // The tip's pixel, and the one up the shaft; nothing a few shafts' widths ahead.
        EXPECT_GT(with[row * 128 + column], without[row * 128 + column]);
        EXPECT_GT(with[(row - 1) * 128 + column - 1], without[(row - 1) * 128 + column - 1]);
        EXPECT_EQ(with[row * 128 + column + 3], without[row * 128 + column + 3]);
    }
}

TEST(HardCases, ABundleOfOneLabel) {
    for (const ImageModel model : kModels) {
        expect_agreement(filled_with(Phantom::liver), model, needle_input(), "liver");
        // Nothing but outside: the probe touches nothing.
        const CaseBundle outside = filled_with(Phantom::outside);
        auto renderer = Renderer::create(outside, phantom_exercise(), options_of(model));
        ASSERT_TRUE(renderer.has_value());
        std::vector<std::uint8_t> pixels(128 * 128);
        const FrameStatus status = renderer->render({}, pixels);
        if (model == ImageModel::physical) {
            EXPECT_EQ(status, FrameStatus::no_contact);
        }
    }
}

TEST(HardCases, EveryVoxelShadows) {
    for (const std::uint8_t label : {Phantom::bone, Phantom::gas}) {
        const CaseBundle bundle = filled_with(label);
        for (const ImageModel model : kModels) {
            expect_agreement(bundle, model, {}, "all shadow");
            const auto dark = picture(bundle, options_of(model), {});
            const auto light = picture(filled_with(Phantom::liver), options_of(model), {});
            const std::vector<std::uint8_t> below(dark.begin() + 96 * 128, dark.end()),
                usual(light.begin() + 96 * 128, light.end());
            EXPECT_LT(mean_of(below), 0.5 * mean_of(usual)) << int(label);
        }
    }
}

TEST(HardCases, ATextureOfOneValueIsAPictureOfOneGrey) {
    CaseBundle bundle = filled_with(Phantom::liver);
    for (SolidTexture& t : bundle.textures) std::fill(t.voxels.begin(), t.voxels.end(), 90);
    RenderOptions o = options_of(ImageModel::paper);
    o.effects = {"texture"};
    int darkest = 255, lightest = 0;
    for (const std::uint8_t p :
         picture(bundle, o, {}, RendererKind::fast, phantom_linear_exercise())) {
        if (p == 0) continue;  // beyond the scanned area
        darkest = std::min<int>(darkest, p);
        lightest = std::max<int>(lightest, p);
    }
    EXPECT_GT(lightest, 0);
    EXPECT_EQ(darkest, lightest);
    expect_agreement(bundle, ImageModel::paper, {}, "flat texture");
}

// Light is gone after a sample: what is left is the near field, the needle's mirror excepted, and
// the receiver's own noise.
TEST(HardCases, AttenuationThatLeavesNothing) {
    CaseBundle bundle = filled_with(Phantom::liver);
    for (Tissue& t : bundle.tissues) t.attenuation_db_cm_mhz = 1e4;
    expect_agreement(bundle, ImageModel::physical, {}, "black");
    RenderOptions o = options_of(ImageModel::physical);
    o.effects = {"-noise", "-near_field"};
    const auto pixels = picture(bundle, o, {});
    const std::vector<std::uint8_t> below(pixels.begin() + 64 * 128, pixels.end());
    EXPECT_EQ(*std::max_element(below.begin(), below.end()), 9);  // the machine's own black
}

TEST(HardCases, FromOnePixelToSixteenMillion) {
    for (const ImageModel model : kModels) {
        for (const int size : {1, 2, 3, 17}) {
            const RenderOptions o = options_of(model, size);
            const auto fast = picture(phantom(), o, {});
            // Single pixels of the literal model are single texture cells: nothing to compare.
            if (model == ImageModel::paper) continue;
            EXPECT_LT(compare(fast, picture(phantom(), o, {}, RendererKind::reference)).mean, 1.5)
                << size;
        }
        // The same beams, finer: the middle four of eight by eight pixels surround the centre of
        // the coarse one, and bilinear grey is nearly linear over half a pixel.
        const auto coarse = picture(phantom(), options_of(model, 512), needle_input());
        const auto fine = picture(phantom(), options_of(model, 4096), needle_input());
        double sum = 0;
        for (std::size_t row = 0; row < 512; ++row) {
            for (std::size_t column = 0; column < 512; ++column) {
                const std::size_t at = (8 * row + 3) * 4096 + 8 * column + 3;
                const double middle =
                    (fine[at] + fine[at + 1] + fine[at + 4096] + fine[at + 4097]) / 4.0;
                sum += std::abs(middle - coarse[row * 512 + column]);
            }
        }
        EXPECT_LT(sum / (512 * 512), 1.0);
    }
}

TEST(HardCases, FewBeamsAndSamples) {
    for (const ImageModel model : kModels) {
        for (const int lines : {1, 2, 17}) {
            RenderOptions o = options_of(model);
            o.scanlines = o.samples = lines;
            const Difference d =
                compare(picture(phantom(), o, needle_input()),
                        picture(phantom(), o, needle_input(), RendererKind::reference));
            if (model == ImageModel::physical) {
                EXPECT_LT(d.mean, 1.0) << lines;
            }
        }
    }
}

}  // namespace
}  // namespace sonocase::runtime
