// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include "pipeline/registration/map/registration.h"
#include "support/random.h"

namespace sonocase {
namespace {

Registration example(std::uint64_t seed) {
    testing::Random random(seed);
    Registration r;
    r.mannequin_from_ct = random.rigid(300);
    r.quadratic = QuadraticMap::from_rigid(r.mannequin_from_ct, random.point(100), 217.3);
    for (auto& row : r.quadratic.coefficients) row[7] = random.uniform(-1, 1);
    r.residual.size = {4, 5, 6};
    r.residual.origin_mm = random.point(100);
    r.residual.spacing_mm = 33.3;
    for (int i = 0; i < 120; ++i) r.residual.control_mm.push_back(random.direction());
    r.ct_box = {{-100, -90, -80}, {100, 90, 1.0 / 3}};
    r.min_det_jacobian = 0.37;
    r.reports = {{"warp", 1, 2, {{"skin_rms_mm", 1.25}}, {}, {}, {"Sparse."}}};
    return r;
}

TEST(RegistrationFile, ComesBackBitForBit) {
    const Registration r = example(4);
    const auto back = parse_registration(format_registration(r), "r.json");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->mannequin_from_ct, r.mannequin_from_ct);
    EXPECT_EQ(back->quadratic.coefficients, r.quadratic.coefficients);
    EXPECT_EQ(back->quadratic.centre_mm, r.quadratic.centre_mm);
    EXPECT_EQ(back->residual.control_mm, r.residual.control_mm);
    EXPECT_EQ(back->ct_box.upper, r.ct_box.upper);
    EXPECT_EQ(back->min_det_jacobian, r.min_det_jacobian);
    EXPECT_EQ(back->reports, r.reports);
    const Point3 p{12, -34, 5};
    EXPECT_EQ(mannequin_from_ct(*back, p), mannequin_from_ct(r, p));
    EXPECT_EQ(format_registration(*back), format_registration(r));
}

TEST(RegistrationFile, WithoutResidualAndBox) {
    Registration r;
    const auto back = parse_registration(format_registration(r), "r.json");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_TRUE(back->residual.empty());
    EXPECT_TRUE(back->ct_box.empty());
}

TEST(RegistrationFile, EveryTruncationIsAnError) {
    const std::string text = format_registration(example(5));
    for (std::size_t n = 0; n + 2 < text.size(); n += 3) {
        EXPECT_FALSE(parse_registration(text.substr(0, n), "cut")) << n;
    }
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

TEST(RegistrationFile, WrongContentsAreNamed) {
    const std::string text = format_registration(example(6));
    const auto fault = [&](const std::string& from, const std::string& to) {
        const auto r = parse_registration(replaced(text, from, to), "r.json");
        return r ? std::string("accepted") : r.error().message();
    };
    EXPECT_NE(fault("\"version\": 1", "\"version\": 2").find("newer"), std::string::npos);
    EXPECT_NE(fault("sonocase registration", "other").find("sonocase register"), std::string::npos);
    EXPECT_NE(fault("\"scale_mm\": 217.3", "\"scale_mm\": 0").find("quadratic.scale_mm"),
              std::string::npos);
    EXPECT_NE(fault("\"spacing_mm\": 33.3", "\"spacing_mm\": -1").find("residual.spacing_mm"),
              std::string::npos);
    EXPECT_NE(fault("\"spacing_mm\": 33.3", "\"spacing_mm\": 1e999").find("r.json"),
              std::string::npos);
    EXPECT_NE(fault("\"quadratic\"", "\"quadr\"").find("quadratic"), std::string::npos);
}

TEST(RegistrationFile, BadTextIsRefused) {
    for (const char* json : {"", "{", "[1]", "{\"version\": 1e999}", "{\"a\": \"\xff\"}", "nul"})
        EXPECT_FALSE(parse_registration(json, "text")) << json;
    const std::string deep(100000, '[');
    EXPECT_FALSE(parse_registration("{\"a\": " + deep, "text"));
}

}  // namespace
}  // namespace sonocase
