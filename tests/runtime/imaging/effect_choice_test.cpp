// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/effect_table.h"

#include <gtest/gtest.h>

#include "imaging_support.h"
#include "runtime/imaging/paper/paper_model.h"
#include "runtime/imaging/physical/model/physical_effects.h"

namespace sonocase::runtime {
namespace {

const char* const kOwn[] = {"slice", "noise", "blur"};
const char* const kOthers[] = {"haze"};

std::vector<bool> chosen(const std::vector<std::string>& names) {
    const auto choice = choose_effects(names, kOwn, kOthers);
    EXPECT_TRUE(choice.has_value());
    return choice->on;
}

TEST(EffectChoice, NamesTurnOnAndMinusTurnsOff) {
    const std::vector<bool> all{true, true, true}, none{false, false, false};
    EXPECT_EQ(chosen({}), all);
    EXPECT_EQ(chosen({"auto"}), all);
    EXPECT_EQ(chosen({"all"}), all);
    EXPECT_EQ(chosen({"none"}), none);
    EXPECT_EQ(chosen({"noise"}), (std::vector<bool>{false, true, false}));
    EXPECT_EQ(chosen({"-noise"}), (std::vector<bool>{true, false, true}));
    EXPECT_EQ(chosen({"auto", "-blur"}), (std::vector<bool>{true, true, false}));
    EXPECT_EQ(chosen({"noise", "blur", "-blur"}), (std::vector<bool>{false, true, false}));
}

TEST(EffectChoice, OnlyAllKeepsWhatCannotShow) {
    const std::vector<std::string> all{"all"}, automatic{"auto"};
    EXPECT_TRUE(choose_effects(all, kOwn, kOthers)->keep_all);
    EXPECT_FALSE(choose_effects(automatic, kOwn, kOthers)->keep_all);
}

TEST(EffectChoice, EffectsOfAnotherModelDoNothingAndUnknownOnesAreErrors) {
    EXPECT_EQ(chosen({"noise", "haze"}), (std::vector<bool>{false, true, false}));
    const std::vector<std::string> wrong{"nois"};
    const auto choice = choose_effects(wrong, kOwn, kOthers);
    ASSERT_FALSE(choice.has_value());
    EXPECT_NE(choice.error().message().find("did you mean noise?"), std::string::npos)
        << choice.error().message();
}

// Every switch belongs to one row, so that it can be turned off alone.
template <class Switches, class Table>
void expect_own_switches(const Table& table) {
    for (std::size_t i = 0; i < table.size(); ++i) {
        if (table[i].on == nullptr) continue;
        std::vector<bool> on(table.size(), true);
        on[i] = false;
        const Switches switches = switches_of<Switches>(table, on);
        for (const auto& entry : table) {
            if (entry.on != nullptr) {
                EXPECT_EQ(switches.*entry.on, &entry != &table[i]) << entry.name;
            }
        }
    }
}

TEST(EffectTables, EverySwitchBelongsToOneRow) {
    expect_own_switches<PaperEffects>(kPaperEffects);
    expect_own_switches<PhysicalEffects>(kPhysicalEffects);
}

TEST(EffectTables, CostsAddUpToTheFrameAndSkippedEffectsSayWhy) {
    for (const ImageModel model : {ImageModel::paper, ImageModel::physical}) {
        RenderOptions options;
        options.model = model;
        options.width_px = options.height_px = 64;
        options.effects = {"auto", "-noise"};
        options.host = thread_host();
        auto renderer = Renderer::create(phantom(), phantom_exercise(), options);
        ASSERT_TRUE(renderer.has_value());
        std::vector<std::uint8_t> pixels(64 * 64);
        FrameInput input;  // no needle
        renderer->render(input, pixels);
        double ms = 0;
        for (const EffectCost& cost : renderer->costs()) {
            ms += cost.ms;
            EXPECT_NE(*cost.why, '\0') << cost.name;
            EXPECT_TRUE(cost.ran || cost.ms == 0) << cost.name;
            const std::string name = cost.name, why = cost.why;
            EXPECT_EQ(why == "switched off", name == "noise") << name;
            EXPECT_EQ(why == "no needle", name == "needle") << name;
        }
        EXPECT_GT(ms, 0);
        EXPECT_EQ(renderer->costs().size(), effect_names(model).size());
    }
}

// A renderer that leaves an effect out for a while draws what one without it draws, and then again
// what it drew before.
TEST(EffectTables, AnEffectIsLeftOutAsIfItHadNeverBeenOn) {
    for (const ImageModel model : {ImageModel::paper, ImageModel::physical}) {
        RenderOptions options;
        options.model = model;
        options.width_px = options.height_px = 64;
        const auto create = [&](std::vector<std::string> effects) {
            options.effects = std::move(effects);
            auto renderer = Renderer::create(phantom(), phantom_exercise(), options);
            EXPECT_TRUE(renderer.has_value());
            return std::move(*renderer);
        };
        FrameInput input;
        input.settings.press_mm = 3;
        input.has_needle = true;
        input.needle.tip = {5, 0, 30};
        input.needle.direction = {0, 0, 1};
        std::vector<std::uint8_t> all(64 * 64), left_out(64 * 64), without(64 * 64);
        Renderer renderer = create({"auto"});
        renderer.render(input, all);
        const auto names = effect_names(model);
        for (std::size_t i = 0; i < names.size(); ++i) {
            renderer.leave_out(static_cast<int>(i));
            renderer.render(input, left_out);
            create({std::string("-") + names[i]}).render(input, without);
            EXPECT_EQ(left_out, without) << names[i];
        }
        renderer.leave_out(-1);
        renderer.render(input, left_out);
        EXPECT_EQ(left_out, all);
    }
}

}  // namespace
}  // namespace sonocase::runtime
