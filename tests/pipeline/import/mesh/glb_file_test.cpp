// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/glb_file.h"

#include <gtest/gtest.h>

#include "pipeline/import/mesh/mesh_shapes.h"
#include "support/hard_case.h"

namespace sonocase::pipeline {
namespace {

using testing::ball_mesh;
using testing::glb_of;

std::string refusal(const std::vector<std::uint8_t>& bytes) {
    const auto nodes = read_glb(bytes, "x.glb");
    return nodes ? "read" : nodes.error().message();
}

TEST(GlbFile, KeepsNamesPointsAndTransforms) {
    const auto nodes = read_glb(glb_of({{"VH_F_liver", ball_mesh({1, 2, 3}, 4),
                                         "\"translation\":[10,0,0],\"scale\":[2,2,2]"},
                                        {"spleen", ball_mesh({0, 0, 0}, 1), ""}}),
                                "x.glb");
    ASSERT_TRUE(nodes) << nodes.error().message();
    ASSERT_EQ(nodes->size(), 2u);
    EXPECT_EQ((*nodes)[0].name, "VH_F_liver");
    EXPECT_EQ((*nodes)[1].name, "spleen");
    const Point3 top = (*nodes)[0].surface.points[0];  // (1, 2, 7), doubled, moved
    EXPECT_NEAR(top.x, 12, 1e-5);
    EXPECT_NEAR(top.y, 4, 1e-5);
    EXPECT_NEAR(top.z, 14, 1e-5);
}

TEST(GlbFile, TakesTheNodesOfItsScene) {
    const auto bytes = glb_of({{"liver", ball_mesh({0, 0, 0}, 1, 6), ""},
                               {"draft", ball_mesh({5, 0, 0}, 1, 6), ""},
                               {"group", ball_mesh({0, 0, 9}, 1, 6), "\"children\":[0]"}},
                              "\"scene\":1,\"scenes\":[{\"nodes\":[1]},{\"nodes\":[2]}]");
    std::vector<std::string> aside;
    const auto nodes = read_glb(bytes, "x.glb", &aside);
    ASSERT_TRUE(nodes) << nodes.error().message();
    ASSERT_EQ(nodes->size(), 2u);
    EXPECT_EQ((*nodes)[0].name, "liver");
    EXPECT_EQ((*nodes)[1].name, "group");
    EXPECT_EQ(aside, (std::vector<std::string>{"draft"}));
}

TEST(GlbFile, NamesOfMeshesCountWhereNodesHaveNone) {
    const Surface ball = ball_mesh({0, 0, 0}, 1, 6);
    const auto nodes = read_glb(
        glb_of({{"", ball, "", "liver"}, {"spleen", ball, "", "Mesh.001"}, {"", ball, ""}}),
        "x.glb");
    ASSERT_TRUE(nodes) << nodes.error().message();
    ASSERT_EQ(nodes->size(), 3u);
    EXPECT_EQ((*nodes)[0].name, "liver");
    EXPECT_EQ((*nodes)[1].name, "spleen");
    EXPECT_EQ((*nodes)[2].name, "node_2");
}

TEST(GlbFile, ReadsStripsAndFansAndLeavesLinesAside) {
    Surface corners;  // a square, and triples of the indices 0 1 2, 3 0 1
    corners.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
    corners.triangles = {{0, 1, 2}, {3, 3, 0}};
    std::vector<std::string> aside;
    const auto nodes = read_glb(glb_of({{"strip", corners, "", "", 5},
                                        {"fan", corners, "", "", 6},
                                        {"lines", corners, "", "", 1}}),
                                "x.glb", &aside);
    ASSERT_TRUE(nodes) << nodes.error().message();
    ASSERT_EQ(nodes->size(), 2u);
    using Triangles = std::vector<std::array<std::uint32_t, 3>>;
    EXPECT_EQ((*nodes)[0].surface.triangles, (Triangles{{0, 1, 2}, {2, 1, 3}}));
    EXPECT_EQ((*nodes)[1].surface.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_EQ(aside, (std::vector<std::string>{"lines"}));
}

TEST(GlbFile, EveryTruncationIsRefusedInOneLine) {
    const auto whole = glb_of({{"a", ball_mesh({0, 0, 0}, 1, 6), ""}});
    int read = 0;
    for (std::size_t n = 0; n < whole.size(); n += 7) {
        const auto nodes = read_glb(std::span(whole).first(n), "x.glb");
        read += nodes.has_value();
        if (!nodes) {
            EXPECT_EQ(nodes.error().message().find('\n'), std::string::npos);
        }
    }
    testing::HardCase cut("of files cut off anywhere, read", testing::HardCase::at_most, 0, "");
    cut.see(read);
}

TEST(GlbFile, RefusesWhatItCannotRead) {
    const Surface ball = ball_mesh({0, 0, 0}, 1, 6);
    EXPECT_NE(refusal(glb_of({{"a", ball, ""}},
                             "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]"))
                  .find("without compression"),
              std::string::npos);
    // Those of looks alone leave the surface where it is.
    EXPECT_EQ(
        refusal(glb_of({{"a", ball, ""}}, "\"extensionsRequired\":[\"KHR_texture_transform\"]")),
        "read");
    EXPECT_NE(refusal(glb_of({{"a", ball, "\"skin\":0"}})).find("'a' is bent by bones"),
              std::string::npos);
    EXPECT_NE(refusal(glb_of({{"a", ball, "\"weights\":[0,0.5]"}})).find("by shape keys"),
              std::string::npos);
    EXPECT_EQ(refusal(glb_of({{"a", ball, "\"weights\":[0,0]"}})), "read");
    EXPECT_NE(refusal({1, 2, 3}).find("not a binary glTF"), std::string::npos);
    EXPECT_NE(refusal(glb_of({{"a", ball, "\"children\":[0]"}})).find("child"), std::string::npos);
    Surface wrong = ball;
    wrong.triangles[0][0] = 100000;
    EXPECT_NE(refusal(glb_of({{"a", wrong, ""}})).find("corner"), std::string::npos);
    Surface nan = ball;
    nan.points[3].y = NAN;
    EXPECT_NE(refusal(glb_of({{"a", nan, ""}})).find("not a number"), std::string::npos);
}

// Changes the description byte by byte: each time there is a message or a result, never a crash.
TEST(GlbFile, SurvivesChangedBytes) {
    const auto whole = glb_of({{"a", ball_mesh({0, 0, 0}, 1, 4), ""}});
    int refused = 0;
    for (std::size_t n = 0; n < std::min<std::size_t>(whole.size(), 900); ++n)
        for (const int value : {0, 57, 255}) {
            auto bytes = whole;
            bytes[n] = static_cast<std::uint8_t>(value);
            refused += !read_glb(bytes, "x.glb");
        }
    EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace sonocase::pipeline
