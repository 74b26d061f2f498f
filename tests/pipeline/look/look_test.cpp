// SPDX-License-Identifier: Apache-2.0

// sonocase look on clips that are not as one would wish.
#include "pipeline/look/look.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/machine/machine.h"
#include "formats/text/json_reader.h"
#include "look_clip.h"
#include "pipeline/look/look_frames.h"
#include "pipeline/look/look_page.h"
#include "support/hard_case.h"
#include "support/paths.h"
#include "support/run_command.h"

namespace sonocase::pipeline {
namespace {

using namespace testing;
using sonocase::testing::TemporaryFolder;

void expect_refusal(const LookInput& input,
                    const LookOptions& options,
                    const std::vector<std::string>& says) {
    const auto result = measure_look_of(input, options);
    ASSERT_FALSE(result);
    const std::string message = result.error().message();
    EXPECT_EQ(message.find('\n'), std::string::npos);
    for (const std::string& word : says)
        EXPECT_NE(message.find(word), std::string::npos) << message;
}

LookOptions deep(double mm) {
    LookOptions options;
    options.depth_mm = mm;
    return options;
}

TEST(Look, OneFrameIsEnoughAndSaysWhatItCannotTell) {
    const TemporaryFolder folder(true);
    LookInput input;
    input.frames = write_clip(folder, Machine{}, clip_fan(), 1);
    const auto r = measure_look_of(input, deep(135));
    ASSERT_TRUE(r) << r.error().message();
    EXPECT_EQ(r->real.frames, 1);
    EXPECT_GT(r->real.patches, 3);
    EXPECT_FALSE(r->real.moves);
    bool told = false;
    for (const std::string& kept : r->fit.kept) told = told || kept.find("lines") != kept.npos;
    EXPECT_TRUE(told);
    const auto again = parse_machine(machine_toml(r->fit.machine), "look.toml");
    ASSERT_TRUE(again) << again.error().message();
    EXPECT_EQ(*again, r->fit.machine);
}

TEST(Look, TenThousandFramesAreMeasuredEvenlySpread) {
    const TemporaryFolder folder(true);
    const auto paths = write_clip(folder, Machine{}, clip_fan(), 4);
    LookInput input;
    for (int i = 0; i < 10000; ++i) input.frames.push_back(paths[static_cast<std::size_t>(i % 4)]);
    LookOptions options = deep(135);
    options.frames = 6;
    const auto r = measure_look_of(input, options);
    ASSERT_TRUE(r) << r.error().message();
    EXPECT_EQ(r->frames_given, 10000u);
    sonocase::testing::HardCase read("pictures read of ten thousand, six asked for",
                                     sonocase::testing::HardCase::at_most, 6, "");
    read.see(r->real.frames);
    const auto indices = spread_indices(10000, 6);
    EXPECT_EQ(indices.front(), 0u);
    EXPECT_EQ(indices[3], 5000u);
    EXPECT_EQ(spread_indices(3, 120), (std::vector<std::size_t>{0, 1, 2}));
}

TEST(Look, BurntInTextChangesNoScore) {
    const TemporaryFolder folder(true);
    const auto clean = write_clip(folder, Machine{}, clip_fan(), 4);
    LookInput with;
    for (int i = 0; i < 4; ++i) {
        auto grey = clip_frame(Machine{}, clip_fan(), static_cast<std::uint64_t>(11 + i));
        for (int n = 0; n < 6; ++n) {  // a line of text across the parenchyma
            for (int y = 200; y < 212; ++y) {
                for (int x = 0; x < 3; ++x)
                    grey[static_cast<std::size_t>(y * kClipWidth + 220 + 14 * n + x)] = 240;
            }
        }
        with.frames.push_back(write_grey(folder, "text_" + std::to_string(i) + ".png", grey));
    }
    const auto a = measure_look_of({clean, "", {}}, deep(135));
    const auto b = measure_look_of(with, deep(135));
    ASSERT_TRUE(a && b);
    EXPECT_LT(b->real.patches, a->real.patches);  // those under the text are left out
    sonocase::testing::HardCase mean("mean grey under burnt-in text, off",
                                     sonocase::testing::HardCase::at_most, 0.6, "grey");
    mean.see(std::abs(b->real.texture.mean - a->real.texture.mean));
    EXPECT_NEAR(b->real.texture.local_sd, a->real.texture.local_sd, 0.4);
    EXPECT_NEAR(b->real.texture.local_kurtosis, a->real.texture.local_kurtosis, 0.3);
}

TEST(Look, WhatCannotBeMeasuredIsRefusedInOneLine) {
    const TemporaryFolder folder(true);
    const auto frame = write_clip(folder, Machine{}, clip_fan(), 1).front();
    expect_refusal({{folder / "missing.png"}, "", {}}, {}, {"missing.png", "no such file"});
    expect_refusal({{frame}, "", {}}, {}, {"--depth-mm", "--geometry"});
    const std::string text = folder.write("note.png", "this is not a picture");
    expect_refusal({{text}, "", {}}, deep(135), {"note.png", "expected PNG"});
    const std::string small =
        write_grey(folder, "small.png", std::vector<std::uint8_t>(64 * 64, 30), 64, 64);
    expect_refusal({{frame, small}, "", {}}, deep(135), {"small.png", "64 x 64", "one size"});
    const std::string black =
        write_grey(folder, "black.png", std::vector<std::uint8_t>(kClipWidth * kClipHeight, 0));
    expect_refusal({{black}, "", {}}, deep(135), {"black"});
    const TemporaryFolder empty(true);
    expect_refusal({{empty.path()}, "", {}}, deep(135), {"no .png"});
    const std::string geometry = folder.write("g.json", "{\"kind\": \"fan\"}");
    expect_refusal({{frame}, geometry, {}}, {}, {"g.json", "mm_per_px"});
    expect_refusal({{frame}, "", {{0, 0, 8, 8, "liver"}}}, deep(135), {"0,0,8,8", "in the scan"});
}

TEST(Look, BlackFramesAmongOthersDoNoHarm) {
    const TemporaryFolder folder(true);
    LookInput input;
    input.frames = write_clip(folder, Machine{}, clip_fan(), 2);
    input.frames.push_back(
        write_grey(folder, "black.png", std::vector<std::uint8_t>(kClipWidth * kClipHeight, 0)));
    const auto r = measure_look_of(input, deep(135));
    ASSERT_TRUE(r) << r.error().message();
    EXPECT_GT(r->real.patches, 3);
    EXPECT_TRUE(std::isfinite(r->real.texture.mean));
}

TEST(Look, ThePageAndTheJsonHoldEveryScore) {
    const TemporaryFolder folder(true);
    LookInput input;
    input.frames = write_clip(folder, Machine{}, clip_fan(), 2);
    LookOptions options = deep(135);
    options.name = "ward <3>";
    const auto r = measure_look_of(input, options);
    ASSERT_TRUE(r) << r.error().message();
    const std::string page = look_page(*r), text = look_json(*r);
    EXPECT_EQ(page.find("ward <3>"), std::string::npos);
    EXPECT_NE(page.find("ward &lt;3&gt;"), std::string::npos);
    EXPECT_EQ(page.find("{{"), std::string::npos);
    EXPECT_EQ(page.find(">nan"), std::string::npos);
    detail::JsonFault fault{"json", {}};
    detail::Json json;
    ASSERT_TRUE(detail::parse_json(text, json, fault));
    for (const char* key :
         {"machine", "scan", "frames", "patches", "looks", "scores", "kept", "warnings"})
        EXPECT_TRUE(json.contains(key)) << key;
    EXPECT_EQ(json["scores"].size(), r->scores.size());
    for (const LookScore& score : r->scores)
        EXPECT_NE(page.find(std::string(score.limits.title).substr(0, 12)), std::string::npos);
}

TEST(Look, TheVerbWritesAMachineAndRefusesWrongUsage) {
    const TemporaryFolder folder(true);
    write_clip(folder, Machine{}, clip_fan(), 2);
    const std::string verb = SONOCASE_BIN "/sonocase look " + folder.path();
    const auto done =
        sonocase::testing::run_command(verb + " --depth-mm 135 --json --page " + folder.path() +
                                       "/page -o " + folder / "ward.toml");
    EXPECT_EQ(done.status, 0) << done.error;
    EXPECT_NE(done.out.find("\"scores\""), std::string::npos);
    const auto machine = parse_machine(sonocase::testing::read_text(folder / "ward.toml"), "ward");
    ASSERT_TRUE(machine) << machine.error().message();
    EXPECT_EQ(machine->name, "ward");
    EXPECT_TRUE(std::filesystem::exists(folder / "page/look.html"));
    const auto none = sonocase::testing::run_command(verb + " -o " + folder / "no.toml");
    EXPECT_EQ(none.status, 1);
    EXPECT_FALSE(std::filesystem::exists(folder / "no.toml"));
    const auto wrong = sonocase::testing::run_command(
        verb + " --depth-mm 135 --rectangle 1,2,3 -o " + folder / "no.toml");
    EXPECT_EQ(wrong.status, 2);
    EXPECT_NE(wrong.error.find("x,y,width,height"), std::string::npos) << wrong.error;
}

}  // namespace
}  // namespace sonocase::pipeline
