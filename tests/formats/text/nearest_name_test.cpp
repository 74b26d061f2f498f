// SPDX-License-Identifier: Apache-2.0

#include "formats/text/nearest_name.h"

#include <gtest/gtest.h>

namespace sonocase {
namespace {

TEST(EditDistance, KnownPairs) {
    EXPECT_EQ(edit_distance("", ""), 0);
    EXPECT_EQ(edit_distance("", "abc"), 3);
    EXPECT_EQ(edit_distance("kitten", "sitting"), 3);
    EXPECT_EQ(edit_distance("voxel_mm", "voxle_mm"), 1);  // a swap is one edit
    EXPECT_EQ(edit_distance("preset", "presets"), 1);
}

TEST(EditDistance, IsSymmetric) {
    for (const char* a : {"labels", "lables", "surface", "x", ""})
        for (const char* b : {"labels", "seed", "surf", "yx"})
            EXPECT_EQ(edit_distance(a, b), edit_distance(b, a)) << a << " " << b;
}

TEST(NearestName, FindsTheTypoAndRefusesTheStranger) {
    const std::vector<std::string> names{"labels", "surface", "ultrasound", "up"};
    EXPECT_EQ(nearest_name("lables", names), "labels");
    EXPECT_EQ(nearest_name("surfaces", names), "surface");
    EXPECT_EQ(nearest_name("pu", names), "up");
    EXPECT_EQ(nearest_name("mannequin", names), "");
    EXPECT_EQ(nearest_name("anything", {}), "");
}

TEST(SuggestName, NamesTheNearestOrAllValidOnes) {
    const std::vector<std::string> names{"labels", "surface"};
    EXPECT_EQ(suggest_name("label", names), "did you mean 'labels'?");
    EXPECT_EQ(suggest_name("mannequin", names), "valid here: labels, surface");
    const std::vector<std::string> titles{"Analytic torso, procedures", "Neck"};
    EXPECT_EQ(suggest_name("femoral", titles), "valid here: 'Analytic torso, procedures', Neck");
}

TEST(SuggestName, TheMistypedOptionIsNamed) {
    const std::vector<std::string> known{"--labels", "--out", "-o", "--mesh"};
    const auto of = [&](std::vector<std::string> words) { return unknown_option(words, known); };
    EXPECT_EQ(of({"--lables", "x"}), "--lables is no option; did you mean --labels?");
    EXPECT_EQ(unknown_option(std::vector<std::string>{"--labls"},
                             std::vector<std::string>{"--table", "-l", "--out"}),
              "--labls is no option");  // two of five letters differ
    EXPECT_EQ(of({"--labls"}), "--labls is no option; did you mean --labels?");
    EXPECT_EQ(of({"--out=a", "--voxel=3"}), "--voxel is no option");
    EXPECT_EQ(of({"--labels", "--", "--lables"}), "");
    EXPECT_EQ(of({"-5", "-o", "--mesh"}), "");
}

}  // namespace
}  // namespace sonocase
