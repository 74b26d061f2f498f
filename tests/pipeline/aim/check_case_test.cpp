// SPDX-License-Identifier: Apache-2.0

// Ten planted faults, each named, and none where there is none.
#include "pipeline/check/check_case.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/aim/plain_case.h"

namespace sonocase::pipeline {
namespace {

using testing::plain_case;
using testing::repaint;

bool names(const CaseBundle& bundle, const std::string& fault) {
    const CheckResult result = check_case(bundle);
    return std::any_of(result.faults.begin(), result.faults.end(),
                       [&](const Fault& f) { return f.name == fault; });
}

CaseBundle with_exercise(const std::string& from, const std::string& to) {
    CaseBundle bundle = plain_case();
    std::string& toml = bundle.exercises[0].toml;
    const std::size_t at = toml.find(from);
    EXPECT_NE(at, std::string::npos);
    toml.replace(at, from.size(), to);
    return bundle;
}

TEST(CheckCase, FindsNothingWrongWithAPlainCase) {
    const CheckResult result = check_case(plain_case());
    for (const Fault& fault : result.faults) ADD_FAILURE() << fault.name << ": " << fault.what;
    ASSERT_EQ(result.targets.size(), 1u);
    EXPECT_TRUE(result.targets[0].needle);
}

TEST(CheckCase, OrganMissing) {
    CaseBundle bundle = plain_case();
    repaint(bundle, [](Point3, int label) { return label == 4 ? 2 : label; });
    EXPECT_TRUE(names(bundle, "organ-missing"));
}

TEST(CheckCase, SidesSwapped) {
    CaseBundle bundle = plain_case();
    for (Label& label : bundle.labels) {
        if (label.name == "kidney_right")
            label.name = "kidney_left";
        else if (label.name == "kidney_left")
            label.name = "kidney_right";
    }
    EXPECT_TRUE(names(bundle, "sides-swapped"));
}

TEST(CheckCase, WrongUnit) {
    CaseBundle bundle = plain_case();
    bundle.grid.spacing_mm = {0.4, 0.4, 0.4};
    EXPECT_TRUE(names(bundle, "wrong-unit"));
}

TEST(CheckCase, VesselBroken) {
    CaseBundle bundle = plain_case();
    repaint(bundle,
            [](Point3 p, int label) { return label == 7 && p.z > 150 && p.z < 170 ? 2 : label; });
    EXPECT_TRUE(names(bundle, "vessel-broken"));
}

TEST(CheckCase, TargetInBone) {
    EXPECT_TRUE(
        names(with_exercise("centre = [60, 20, 330]", "centre = [0, -62, 200]"), "target-in-bone"));
}

TEST(CheckCase, TargetElsewhere) {
    // Where it is, but meant for another organ.
    const CheckResult result =
        check_case(with_exercise("inside = \"liver\"", "inside = \"kidney_left\""));
    ASSERT_EQ(result.faults.size(), 1u);
    EXPECT_EQ(result.faults[0].name, "target-elsewhere");
    EXPECT_NE(result.faults[0].what.find("not in 'kidney_left'"), std::string::npos);
}

TEST(CheckCase, AMarkOfTargetsWithoutATargetCannotBePassed) {
    CaseBundle bundle = plain_case();
    std::string& toml = bundle.exercises[0].toml;
    const std::size_t from = toml.find("[[targets]]"), to = toml.find("\n[", from + 1);
    toml.erase(from, to == std::string::npos ? to : to - from);
    EXPECT_FALSE(names(bundle, "not-passable"));
    toml += "\n[[pass_marks]]\nmetric = \"final_tip_to_target_mm\"\nat_most = 3\n";
    EXPECT_TRUE(names(bundle, "not-passable"));
}

TEST(CheckCase, Unreachable) {
    CaseBundle bundle = plain_case();
    repaint(bundle, [](Point3 p, int label) {  // a shell of bone round the target
        const double r = distance(p, {60, 20, 330});
        return r > 20 && r < 30 ? 9 : label;
    });
    EXPECT_TRUE(names(bundle, "unreachable"));
}

TEST(CheckCase, NotPassable) {
    CaseBundle bundle = plain_case();
    bundle.exercises[0].toml += "[[pass_marks]]\nmetric = \"time_in_tissue_s\"\nat_most = 1\n";
    EXPECT_TRUE(names(bundle, "not-passable"));
}

TEST(CheckCase, CountsRibsThatHaveOneLabelOrMany) {
    CaseBundle bundle = plain_case();
    const CheckResult none = check_case(bundle);
    EXPECT_EQ(none.ribs_right + none.ribs_left, 0);
    // Five bars on the right, four on the left, in a label of their own, and one across.
    bundle.labels.push_back({"ribs", "bone", 13, {}});
    repaint(bundle, [](Point3 p, int label) {
        if (label != 2 || p.y > 20) return label;
        const int n = static_cast<int>(std::floor((p.z - 300) / 25));
        const bool bar = p.z - 300 - 25 * n < 9 && n >= 0;
        const double outside = std::hypot(p.x / 150, p.y / 100);
        if (!bar || outside < 0.85 || outside > 0.93) return label;
        if (p.x > 60 && n < 5) return 13;
        if (p.x < -60 && n < 4) return 13;
        return label;
    });
    const CheckResult ribs = check_case(bundle);
    EXPECT_EQ(ribs.ribs_right, 5);
    EXPECT_EQ(ribs.ribs_left, 4);
    CaseBundle many = plain_case();
    many.labels[10].name = "rib_right_7";
    many.labels[11].name = "rib_left_7";
    const CheckResult named = check_case(many);
    EXPECT_EQ(named.ribs_right, 1);
    EXPECT_EQ(named.ribs_left, 1);
}

TEST(CheckCase, SweepInAir) {
    EXPECT_TRUE(
        names(with_exercise("probe = [60, 100, 330]", "probe = [60, 300, 330]"), "sweep-in-air"));
}

TEST(CheckCase, Fold) {
    CaseBundle bundle = plain_case();
    bundle.manifest.stages[0].measures[0].value = -0.2;
    EXPECT_TRUE(names(bundle, "fold"));
}

TEST(CheckCase, LabelRenamed) {
    CaseBundle bundle = plain_case();
    bundle.labels[3].name = "lever";
    EXPECT_TRUE(names(bundle, "label-renamed"));
    CaseBundle other = plain_case();
    std::swap(other.labels[3].name, other.labels[4].name);
    EXPECT_TRUE(names(other, "label-renamed"));
}

TEST(CheckCase, TextureMissing) {
    CaseBundle bundle = plain_case();
    bundle.textures.clear();
    EXPECT_TRUE(names(bundle, "texture-missing"));
}

// Planes and a table where the fit reports what it does not know; neither where nothing was fitted.
TEST(CheckCase, ThePageShowsWhatTheFitDoesNotKnow) {
    CaseBundle bundle = plain_case();
    const auto page = [&] { return check_page(bundle, CheckResult{}); };
    const std::string plain = page();
    EXPECT_EQ(plain.find("What is not known"), std::string::npos);
    StageReport fit;
    fit.stage = stage_names::kWarp;
    fit.groups = {{"unknown_p90_mm", {{"liver", 11.2}, {"spleen", 4.1}}},
                  {"unknown_p90_with_two_landmarks_mm", {{"liver", 3.4}, {"spleen", 4}}}};
    bundle.manifest.stages.push_back(fit);
    const std::string shown = page();
    EXPECT_NE(shown.find("What is not known"), std::string::npos);
    EXPECT_NE(shown.find("Two landmarks far apart would bring liver from 11.2 to 3.4 mm"),
              std::string::npos);
    const auto pictures = [](const std::string& text) {
        int n = 0;
        for (std::size_t at = 0; (at = text.find("<img", at)) != std::string::npos; ++at) ++n;
        return n;
    };
    EXPECT_EQ(pictures(shown), pictures(plain) + 3);
}

TEST(CheckCase, ThePageAndTheJsonNameTheFault) {
    CaseBundle bundle = plain_case();
    bundle.manifest.case_name = "<plain>";
    bundle.textures.clear();
    const CheckResult result = check_case(bundle);
    const std::string page = check_page(bundle, result);
    EXPECT_NE(page.find("texture-missing"), std::string::npos);
    EXPECT_NE(page.find("&lt;plain&gt;"), std::string::npos);
    EXPECT_NE(check_json(bundle, result).find("\"texture-missing\""), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
