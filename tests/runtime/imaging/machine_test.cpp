// SPDX-License-Identifier: Apache-2.0

// Machines in the renderer: both renderers agree at the limits of what a machine may be, on every
// instruction set, and what a machine says shows in the picture.
#include <gtest/gtest.h>

#include <functional>

#include "formats/machine/machine.h"
#include "imaging_support.h"
#include "support/hard_case.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

RenderOptions options_of(const Machine& machine) {
    RenderOptions o;
    o.width_px = o.height_px = 128;
    o.scanlines = 64;
    o.samples = 200;
    o.machine = machine;
    return o;
}

void expect_agreement(const Exercise& exercise,
                      RenderOptions options,
                      const std::string& what,
                      const CaseBundle& bundle = phantom(),
                      double max_bias = 0.1,
                      HardCase* worst = nullptr) {
    const FrameInput input = needle_input();
    const auto fast = draw(exercise, options, input, bundle);
    options.kind = RendererKind::reference;
    const Difference d = compare(fast, draw(exercise, options, input, bundle));
    std::printf("%-24s mean %.3f bias %+.3f worst %d\n", what.c_str(), d.mean, d.bias, d.worst);
    EXPECT_LT(d.mean, 0.35) << what;
    if (worst != nullptr) worst->see(d.mean);
    EXPECT_LT(std::abs(d.bias), max_bias) << what;
    options.kind = RendererKind::fast;
    for (const std::string& simd : simd_targets()) {
        options.simd = simd;
        EXPECT_TRUE(draw(exercise, options, input, bundle) == fast) << what << ", " << simd;
    }
}

TEST(MachineInTheRenderer, BothRenderersAgreeOnEveryBuiltInMachineAndProbe) {
    for (const std::string& name : machine_names()) {
        for (const bool linear : {false, true})
            expect_agreement(linear ? phantom_linear_exercise() : phantom_exercise(),
                             options_of(*built_in_machine(name)),
                             name + (linear ? ", linear" : ""));
    }
}

TEST(MachineInTheRenderer, BothRenderersAgreeAtTheLimits) {
    const struct {
        const char* what;
        std::function<void(Machine&)> change;
    } cases[] = {
        {"gain evened out from the face on",
         [](Machine& m) {
             m.equalisation = {1, 0};
         }},
        {"contrast that varies strongly from the face on",
         [](Machine& m) {
             m.speckle_reduction = {1, 0};
         }},
        {"16 beams", [](Machine& m) { m.beam.lines = 16; }},
        {"16 looks",
         [](Machine& m) {
             m.looks = {16, 16, 30};
         }},
        {"one look near, 16 far",
         [](Machine& m) {
             m.looks = {16, 1, 60};
         }},
        {"1 MHz", [](Machine& m) { m.beam.frequency_mhz = 1; }},
        {"18 MHz", [](Machine& m) { m.beam.frequency_mhz = 18; }},
        {"thick slice", [](Machine& m) { m.beam.elevation_mm = 20; }},
        {"edge enhancement", [](Machine& m) { m.edge_enhancement = 2; }},
        {"enhanced and filtered",
         [](Machine& m) { m.edge_enhancement = 0.5, m.post_filter = true; }},
        {"power map with noise",
         [](Machine& m) {
             m.noise = {-40, false};
         }},
        {"eight frames of noise",
         [](Machine& m) {
             m.noise = {-40, false};
             m.persistence = {1, 1, 1, 1, 1, 1, 1, 1};
         }},
        {"strong grain", [](Machine& m) { m.noise.grain_db = 3; }},
        {"grain of a filtered logarithm",
         [](Machine& m) {
             m = *built_in_machine("classic");
             m.noise.grain_db = 1.3;
         }},
        {"strong reverberation",
         [](Machine& m) {
             m.haze = {10, 40, 30, -10};
         }},
        {"32 lines", [](Machine& m) { m.near_field.lines = 32, m.near_field.line_step_db = 0; }},
        {"half the face off",
         [](Machine& m) {
             m.contact = {40, 0.5};
         }},
        {"steep map", [](Machine& m) { m.grey = {GreyMap::power, 0, 255, 4, 255, 1, 120}; }},
        {"logarithm over a floor",
         [](Machine& m) { m.grey = {GreyMap::log, 20, 100, 1, 255, 1, 40}; }},
    };
    HardCase worst("fast off slow renderer at 19 limits of a machine, mean", HardCase::at_most,
                   0.35, "grey");
    for (const auto& c : cases) {
        Machine machine;
        c.change(machine);
        // Strong reverberation sums some hundred echoes of eight bits each, rounded: 0.17 darker.
        const bool sums_many = machine.haze.fraction > 1;
        expect_agreement(phantom_exercise(), options_of(machine), c.what, phantom(),
                         sums_many ? 0.2 : 0.1, &worst);
    }
}

TEST(MachineInTheRenderer, BothRenderersAgreeAtAnyDepthAndWithoutStructure) {
    Exercise exercise = phantom_exercise();
    for (const double depth_mm : {30.0, 300.0}) {
        exercise.probe.depth_mm = depth_mm;
        exercise.probe.focus_mm = 0.5 * depth_mm;
        expect_agreement(exercise, options_of({}), std::to_string(depth_mm) + " mm");
    }
    PhantomOptions plain;
    plain.voxel_mm = 2;
    plain.boundaries = plain.structure = false;
    expect_agreement(phantom_exercise(), options_of({}), "no structure", Phantom(plain).bundle());
}

// Plates, their ripples, and the grounds between them.
TEST(MachineInTheRenderer, BothRenderersAgreeOnLinearPicturesAtAnyDepthAndFrequency) {
    const auto agree = [](double depth_mm, double mhz, const CaseBundle& bundle, const char* what) {
        Exercise exercise = phantom_linear_exercise();
        exercise.probe.depth_mm = depth_mm;
        exercise.probe.focus_mm = 0.5 * depth_mm;
        exercise.probe.frequency_mhz = mhz;
        expect_agreement(exercise, options_of(*built_in_machine("modern-linear")), what, bundle);
    };
    agree(20, 9, phantom(), "20 mm");
    agree(60, 9, phantom(), "60 mm");
    agree(36, 18, phantom(), "18 MHz");
    agree(36, 6.01, phantom(), "just fine");
    PhantomOptions plain;
    plain.voxel_mm = 2;
    plain.boundaries = plain.structure = false;
    agree(36, 9, Phantom(plain).bundle(), "linear, no structure");
}

double mean_of(const std::vector<std::uint8_t>& pixels) {
    double sum = 0;
    for (const std::uint8_t p : pixels) sum += p;
    return sum / static_cast<double>(pixels.size());
}

TEST(MachineInTheRenderer, StructuresThatAMachineDoesNotShowAreLeftOut) {
    Machine bare;
    bare.structures = {false, false, false, false, true};
    RenderOptions off = options_of(Machine{});
    off.effects = {"-parenchyma", "-streaks", "-diaphragm", "-wall"};
    EXPECT_TRUE(draw(phantom_exercise(), options_of(bare), {}) ==
                draw(phantom_exercise(), off, {}));
    // classic shows none of them, and the table of effects says so.
    auto renderer =
        Renderer::create(phantom(), phantom_exercise(), options_of(*built_in_machine("classic")));
    ASSERT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> pixels(128 * 128);
    renderer->render({}, pixels);
    int none = 0;
    for (const EffectCost& cost : renderer->costs())
        none += !cost.ran && std::string(cost.why) == "the machine shows none";
    EXPECT_EQ(none, 4);
}

// It grows with the echo, leaves the level and black as they are, and stays where it is.
TEST(MachineInTheRenderer, GrainGrowsWithTheEchoAndBelongsToThePicture) {
    Machine machine = *built_in_machine("modern-linear");
    const Exercise exercise = phantom_linear_exercise();
    const auto drawn = [&](double grain_db, std::uint32_t frame) {
        machine.noise.grain_db = grain_db;
        FrameInput input;
        input.frame = frame;
        return draw(exercise, options_of(machine), input);
    };
    const auto none = drawn(0, 0), weak = drawn(1, 0), strong = drawn(2, 0);
    EXPECT_NEAR(mean_of(strong), mean_of(none), 0.03 * mean_of(none));
    double dark = 0, bright = 0, all_weak = 0, all_strong = 0;
    int darks = 0, brights = 0;
    for (std::size_t i = 0; i < none.size(); ++i) {
        const double off = strong[i] - none[i], square = off * off;
        all_strong += square;
        all_weak += (weak[i] - none[i]) * (weak[i] - none[i]);
        if (none[i] <= machine.grey.floor) {
            EXPECT_LE(off, 1);
        }
        if (none[i] > 10 && none[i] < 20) {
            dark += square;
            ++darks;
        }
        if (none[i] > 60) {
            bright += square;
            ++brights;
        }
    }
    ASSERT_GT(darks, 100);
    ASSERT_GT(brights, 100);
    EXPECT_GT(bright / brights, 6 * dark / darks);
    EXPECT_NEAR(std::sqrt(all_strong / all_weak), 2, 0.2);
    EXPECT_TRUE(drawn(2, 3) == strong);  // nothing moves while the probe is held
    RenderOptions off = options_of(machine);
    off.effects = {"-noise"};
    EXPECT_TRUE(draw(exercise, off, {}) == none);
}

TEST(MachineInTheRenderer, TheConsoleActsOnEveryMap) {
    for (const std::string& name : machine_names()) {
        const RenderOptions options = options_of(*built_in_machine(name));
        const Exercise exercise =
            name == "modern-linear" ? phantom_linear_exercise() : phantom_exercise();
        FrameInput input;
        const double plain = mean_of(draw(exercise, options, input));
        input.settings.gain_db = 10;
        EXPECT_GT(mean_of(draw(exercise, options, input)), 1.15 * plain) << name;
        input.settings.gain_db = 0;
        for (double& slider : input.settings.tgc_db) slider = -10;
        EXPECT_LT(mean_of(draw(exercise, options, input)), 0.9 * plain) << name;
        // A smaller range has more contrast from pixel to pixel.
        const auto contrast = [&](double range_db) {
            FrameInput at;
            at.settings.dynamic_range_db = range_db;
            const auto pixels = draw(exercise, options, at);
            double sum = 0;
            for (std::size_t y = 40; y < 80; ++y) {  // of liver
                for (std::size_t x = 50; x < 78; ++x)
                    sum += std::abs(int(pixels[128 * y + x]) - int(pixels[128 * y + x - 1]));
            }
            return sum;
        };
        EXPECT_GT(contrast(50), 1.1 * contrast(70)) << name;
    }
}

TEST(MachineInTheRenderer, BlackIsBlackWhereNoiseIsRejected) {
    Machine machine;
    machine.near_field.ring_level = 0;
    FrameInput input;
    input.mannequin_from_probe.translation = {0, 0, -60};  // in air: no beam touches
    auto renderer = Renderer::create(phantom(), phantom_exercise(), options_of(machine));
    ASSERT_TRUE(renderer);
    std::vector<std::uint8_t> pixels(128 * 128);
    EXPECT_EQ(renderer->render(input, pixels), FrameStatus::no_contact);
    for (const std::uint8_t p : pixels) ASSERT_TRUE(p == 0 || p == 9) << int(p);
}

// The speckle fields of `looks` are nearly independent. Since they share the weights of some three
// columns within a point spread, sixteen act as about four.
TEST(MachineInTheRenderer, MoreLooksAreSmoother) {
    PhantomOptions o;
    o.ribs = o.gas = o.vessels = o.kidney = o.layers = o.structure = false;
    o.lower = {-60, -8, -15};
    o.upper = {60, 8, 110};
    o.voxel_mm = 2;
    const CaseBundle liver = Phantom(o).bundle();
    Exercise exercise = phantom_exercise();
    exercise.probe.depth_mm = 90;
    double before = 1e9;
    for (const auto& [looks, falls] : {std::pair{1, 1.0}, {2, 0.85}, {4, 0.95}, {16, 0.98}}) {
        RenderOptions options = options_of({});
        options.width_px = options.height_px = 256;
        options.looks = looks;
        options.effects = {"-parenchyma", "-streaks"};  // speckle alone
        const auto pixels = draw(exercise, options, {}, liver);
        double sum = 0, square = 0, n = 0;
        for (int y = 110; y < 190; ++y) {
            for (int x = 98; x < 158; ++x, ++n) {
                const double v = pixels[static_cast<std::size_t>(y * 256 + x)] - 9.0;
                sum += v;
                square += v * v;
            }
        }
        const double mean = sum / n, relative = std::sqrt(square / n - mean * mean) / mean;
        std::printf("%2d looks: %.1f +- %.2f\n", looks, mean + 9, relative);
        EXPECT_NEAR(mean, Machine{}.grey.level, 5);  // e = 1 on average, whatever their number
        EXPECT_LT(relative, falls * before);
        before = relative;
    }
}

TEST(MachineInTheRenderer, AMeasuredTissueTakesItsLevel) {
    Machine machine;
    const double plain = mean_of(draw(phantom_exercise(), options_of(machine), {}));
    for (const Label& label : phantom().labels) machine.tissue_db[label.name] = 10;
    EXPECT_GT(mean_of(draw(phantom_exercise(), options_of(machine), {})), 1.3 * plain);
}

// Liver under 2 mm of skin alone, and under 20 mm of fat and muscle besides.
TEST(OpeningGain, APictureOpensInTheMiddleOfItsGreyThroughAnyWall) {
    for (const bool layers : {false, true}) {
        sonocase::testing::PhantomOptions o;
        o.ribs = o.gas = o.vessels = o.kidney = false;
        o.layers = layers;
        o.voxel_mm = 2;
        const CaseBundle bundle = Phantom(o).bundle();
        Exercise exercise = phantom_exercise();
        exercise.start_beam = {0, 0, 1};  // the script's place, or the start: on the skin
        for (const std::string& name : machine_names()) {
            RenderOptions options = options_of(*built_in_machine(name));
            options.scanlines = options.samples = 0;
            options.width_px = options.height_px = 256;
            const auto pixels = draw(exercise, options, {}, bundle);
            double sum = 0, n = 0, deep = 0, deep_n = 0;
            for (int y = 30; y < 250; ++y) {
                for (int x = 256 / 3; x < 2 * 256 / 3; ++x) {
                    const double grey = pixels[static_cast<std::size_t>(256 * y + x)];
                    if (grey < 30) continue;
                    sum += grey;
                    n += 1;
                    if (y < 190) continue;
                    deep += grey;
                    deep_n += 1;
                }
            }
            std::printf("%s, %s: %.0f, far away %.0f\n", name.c_str(),
                        layers ? "thick wall" : "thin wall", sum / n, deep / deep_n);
            EXPECT_NEAR(sum / n, 95, 15) << name << layers;
            EXPECT_NEAR(deep / deep_n, 95, 35) << name << layers;
        }
    }
}

// Where the exercise's place is not on the body there is nothing to go by.
TEST(OpeningGain, AwayFromTheBodyItIsNone) {
    Exercise exercise = phantom_exercise();
    exercise.start_probe = {0, 0, -500};
    EXPECT_TRUE(draw(exercise, options_of(Machine{}), {}) ==
                draw(phantom_exercise(), options_of(Machine{}), {}));
}

}  // namespace
}  // namespace sonocase::runtime
