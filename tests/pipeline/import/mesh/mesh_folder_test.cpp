// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/mesh_folder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "pipeline/import/body/body_rules.h"
#include "pipeline/import/mesh/mesh_shapes.h"
#include "pipeline/import/mesh/node_table.h"
#include "pipeline/import/mesh/surface_file.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::ball_mesh;
using testing::GlbNode;

class MeshFolder : public ::testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::path(::testing::TempDir()) /
                  ::testing::UnitTest::GetInstance()->current_test_info()->name();
        fs::remove_all(folder_);
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    // GLB is in metres.
    void write(const std::string& file, std::vector<GlbNode> nodes) {
        for (GlbNode& node : nodes)
            for (Point3& p : node.surface.points) p = {p.x / 1000, p.y / 1000, p.z / 1000};
        const auto bytes = testing::glb_of(nodes);
        std::ofstream(folder_ / file, std::ios::binary)
            .write(reinterpret_cast<const char*>(bytes.data()),
                   static_cast<std::streamsize>(bytes.size()));
    }
    Result<MeshBody> read(const std::string& table, MeshOptions options = {}) {
        std::ofstream(folder_ / "nodes.csv") << table;
        options.voxel_mm = 2;
        return read_meshes(folder_.string(), (folder_ / "nodes.csv").string(), options);
    }
    std::string refusal(const std::string& table, MeshOptions options = {}) {
        const auto body = read(table, options);
        return body ? "read" : body.error().message();
    }
    fs::path folder_;
};

TEST_F(MeshFolder, MakesSolidsInRasWithNamesAndAttribution) {
    write("a.glb", {{"organ_a", ball_mesh({30, 10, 20}, 25, 60), ""},
                    {"ligament", ball_mesh({0, 0, 0}, 5), ""}});
    const auto body = read(
        "# attribution: By somebody.\nnode,label,role\norgan_*,liver,organ\n"
        "ligament,,skip\n");
    ASSERT_TRUE(body) << body.error().message();
    ASSERT_EQ(body->solids.size(), 1u);
    EXPECT_EQ(body->attribution, "By somebody.");
    ASSERT_FALSE(body->report.notes.empty());
    EXPECT_NE(body->report.notes[0].text.find("y to the head"), std::string::npos);
    const double ml = static_cast<double>(body->solids[0].mask.count()) * 0.008;
    EXPECT_NEAR(ml / (4.0 / 3 * 3.14159 * 15.625), 1, 0.005);
    // x to the left, y to the head, z to the front become (-30, 20, 10).
    const VoxelMask& mask = body->solids[0].mask;
    const Point3 middle = body->grid.point_from_voxel({mask.first.x + 0.5 * (mask.size.x - 1),
                                                       mask.first.y + 0.5 * (mask.size.y - 1),
                                                       mask.first.z + 0.5 * (mask.size.z - 1)});
    EXPECT_LT(distance(middle, {-30, 20, 10}), 2);
}

TEST_F(MeshFolder, ListsNodesWithoutARowAndRefusesSheets) {
    write("a.glb",
          {{"organ_a", ball_mesh({0, 0, 0}, 40), ""}, {"stray", ball_mesh({0, 0, 0}, 5), ""}});
    EXPECT_NE(refusal("organ_a,liver,organ\n").find("stray"), std::string::npos);
    write("a.glb", {{"organ_a", testing::without_top(ball_mesh({0, 0, 0}, 60), 0), ""}});
    EXPECT_NE(refusal("organ_a,liver,organ\n", {.cap_mm = 200}).find("opening"), std::string::npos);
    EXPECT_NE(refusal("organ_a,liver,orgen\n").find("did you mean 'organ'"), std::string::npos);
}

// One file with an object for each organ is one node: a row for it would weld them into one.
TEST_F(MeshFolder, SaysThatObjectsOfAFileAreNotToldApart) {
    std::ofstream(folder_ / "all.obj") << "o liver\nv 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 50\n"
                                          "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
                                          "o spleen\nv 90 0 0\nv 120 0 0\nv 90 30 0\nv 90 0 30\n"
                                          "f 5 7 6\nf 5 6 8\nf 6 7 8\nf 7 5 8\n";
    const std::string said = refusal("node,label,role\nliver,liver,organ\nspleen,spleen,organ\n");
    EXPECT_NE(said.find("all.obj holds 2 objects"), std::string::npos) << said;
}

TEST_F(MeshFolder, SaysThatTheUnitIsWrong) {
    write("a.glb", {{"a", ball_mesh({0, 0, 0}, 0.1), ""}});
    EXPECT_NE(refusal("a,liver,organ\n").find("these look like metres: give --scale 1000"),
              std::string::npos);
    write("a.glb", {{"a", ball_mesh({0, 0, 0}, 200000), ""}});
    EXPECT_NE(refusal("a,liver,organ\n").find("look like millimetres: give --scale 0.001"),
              std::string::npos);
    write("a.glb", {{"a", ball_mesh({0, 0, 0}, 20000), ""}});
    EXPECT_NE(refusal("a,liver,organ\n").find("look like centimetres: give --scale 0.01"),
              std::string::npos);
}

TEST_F(MeshFolder, WarnsOfTwoFilesOfOneOrgan) {
    write("a.glb", {{"a", ball_mesh({0, 0, 0}, 40), ""}});
    write("b.glb", {{"a", ball_mesh({10, 0, 0}, 40), ""}});
    const auto body = read("a,liver,organ\n");
    ASSERT_TRUE(body);
    ASSERT_FALSE(body->report.warnings.empty());
    EXPECT_NE(body->report.warnings[0].find("2 files"), std::string::npos);
}

// Balls as OBJ: `comment` above the vertices.
std::string obj_of(const Surface& ball, const std::string& comment) {
    std::string out = comment + "\n";
    for (const Point3 p : ball.points)
        out += "v " + std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) +
               "\n";
    for (const auto& t : ball.triangles)
        out += "f " + std::to_string(t[0] + 1) + " " + std::to_string(t[1] + 1) + " " +
               std::to_string(t[2] + 1) + "\n";
    return out;
}

TEST_F(MeshFolder, HonoursLpsAndAsksWhereFilesDisagree) {
    const auto put = [&](const char* name, Point3 middle, const char* comment) {
        std::ofstream(folder_ / name) << obj_of(ball_mesh(middle, 25), comment);
    };
    const auto middle_of_liver = [](const MeshBody& body) {
        const VoxelMask& mask = body.solids[0].mask;
        return body.grid.point_from_voxel({mask.first.x + 0.5 * (mask.size.x - 1),
                                           mask.first.y + 0.5 * (mask.size.y - 1),
                                           mask.first.z + 0.5 * (mask.size.z - 1)});
    };
    const auto note = [](const MeshBody& body) {
        for (const Note& n : body.report.notes)
            if (n.name == "axes") return n.text;
        return std::string("none");
    };
    const std::string table = "liver,liver,organ\nspleen,spleen,organ\n";
    put("liver.obj", {-60, -20, 30}, "# SPACE=LPS");
    put("spleen.obj", {60, -20, 30}, "# SPACE=LPS");
    auto body = read(table);
    ASSERT_TRUE(body) << body.error().message();
    EXPECT_LT(distance(middle_of_liver(*body), {60, 20, 30}), 2);
    EXPECT_NE(note(*body).find("LPS"), std::string::npos);
    // One file that says nothing: asked, and the option that is named mends it.
    put("spleen.obj", {60, -20, 30}, "# nothing");
    EXPECT_NE(refusal(table).find("--axes lps"), std::string::npos) << refusal(table);
    body = read(table, {.axes = Axes::lps});
    ASSERT_TRUE(body) << body.error().message();
    EXPECT_LT(distance(middle_of_liver(*body), {60, 20, 30}), 2);
    put("liver.obj", {-60, -20, 30}, "# nothing");
    body = read(table);
    ASSERT_TRUE(body);
    EXPECT_LT(distance(middle_of_liver(*body), {-60, -20, 30}), 2);
    EXPECT_NE(note(*body).find("does not say"), std::string::npos);
}

TEST_F(MeshFolder, AGlbIsASurfaceToo) {
    write("skin.glb", {{"skin", ball_mesh({30, 10, 20}, 100), ""}});
    const auto skin = import_surface((folder_ / "skin.glb").string());
    ASSERT_TRUE(skin) << skin.error().message();
    Box3 box;
    for (const Point3 p : skin->points) box.include(p);
    // In mm; x to the left, y to the head, z to the front become (-30, 20, 10).
    EXPECT_LT(distance(box.lower + 0.5 * box.extent(), {-30, 20, 10}), 0.01);
    EXPECT_NEAR(box.extent().z, 200, 1);
    const auto told = import_surface((folder_ / "skin.glb").string(), {.axes = Axes::ras});
    ASSERT_TRUE(told);
    Box3 other;
    for (const Point3 p : told->points) other.include(p);
    EXPECT_LT(distance(other.lower + 0.5 * other.extent(), {30, 10, 20}), 0.01);
}

TEST(NodeTable, BlendsAFrameAlongItsAxis) {
    const auto table = parse_node_table(
        "a,b,organ\nx.glb,y 0: 1 0 1 0 1 0,frame\n"
        "x.glb,y 100: 1 10 1 0 2 0,frame\n",
        "nodes.csv");
    ASSERT_TRUE(table) << table.error().message();
    EXPECT_EQ(table->placed("x.glb", {1, 0, 1}), (Point3{1, 0, 1}));
    EXPECT_EQ(table->placed("x.glb", {1, 50, 1}), (Point3{6, 50, 1.5}));
    EXPECT_EQ(table->placed("x.glb", {1, 200, 1}), (Point3{11, 200, 2}));
    EXPECT_EQ(table->placed("y.glb", {1, 50, 1}), (Point3{1, 50, 1}));
}

TEST(BodyRules, LeaveNothingUnnamed) {
    LabelVolume labels;
    labels.grid.size = {80, 60, 90};
    labels.grid.spacing_mm = {4, 4, 4};
    labels.grid.origin_mm = {-160, -120, 0};
    labels.labels = {{"outside", "outside", 0, {}},
                     {"body", "soft_tissue", 1, {}},
                     {"liver", "liver", 2, {}},
                     {"spleen", "spleen", 3, {}}};
    for (int k = 0; k < 90; ++k)
        for (int j = 0; j < 60; ++j)
            for (int i = 0; i < 80; ++i) {
                const Point3 p = labels.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                const bool body = p.x * p.x / (150 * 150) + p.y * p.y / (105 * 105) < 1;
                const bool liver = norm(p - Point3{60, 20, 200}) < 60;
                const bool spleen = norm(p - Point3{-80, -30, 220}) < 30;
                labels.voxels.push_back(spleen ? 3 : liver ? 2 : body ? 1 : 0);
            }
    StageReport report;
    fill_body(labels, {}, report);
    std::vector<std::size_t> count(labels.labels.size(), 0);
    for (const std::uint8_t v : labels.voxels) ++count[v];
    EXPECT_EQ(count[1], 0u);
    EXPECT_NEAR(static_cast<double>(count[2]), 14137, 300);  // the liver keeps its voxels
    const auto of = [&](const char* name) {
        for (std::size_t l = 0; l < labels.labels.size(); ++l)
            if (labels.labels[l].name == name) return count[l];
        return std::size_t{0};
    };
    for (const char* name : {"skin", "ribs", "vertebrae", "lung_right", "lung_left", "diaphragm",
                             "visceral_fat", "subcutaneous_fat", "muscle_wall"})
        EXPECT_GT(of(name), 50u) << name;
    ASSERT_FALSE(report.notes.empty());
    EXPECT_NE(report.notes.back().text.find("by rule"), std::string::npos);
}

// A trunk of 240 mm; arms beside it up to 200 mm, joined with it above.
TEST(BodyRules, ArmsEndAtTheArmpit) {
    LabelVolume labels;
    labels.grid.size = {100, 40, 70};
    labels.grid.spacing_mm = {4, 4, 4};
    labels.grid.origin_mm = {-198, -78, 0};
    labels.labels = {{"outside", "outside", 0, {}}, {"body", "soft_tissue", 1, {}}};
    for (int k = 0; k < 70; ++k)
        for (int j = 0; j < 40; ++j)
            for (int i = 0; i < 100; ++i) {
                const Point3 p = labels.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                const bool trunk = std::abs(p.x) < 120 && std::abs(p.y) < 70;
                const bool arm = std::abs(p.x) > 140 && std::abs(p.x) < 190 && std::abs(p.y) < 30;
                const bool shoulder = p.z > 200 && std::abs(p.x) < 190 && std::abs(p.y) < 40;
                labels.voxels.push_back(trunk || arm || shoulder ? 1 : 0);
            }
    StageReport report;
    fill_body(labels, {}, report);
    double farthest = 0;
    std::size_t trunk = 0;
    for (int k = 0; k < 70; ++k)
        for (int j = 0; j < 40; ++j)
            for (int i = 0; i < 100; ++i) {
                if (labels.voxels[labels.grid.index(i, j, k)] == 0) continue;
                const Point3 p = labels.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                farthest = std::max(farthest, std::abs(p.x));
                trunk += std::abs(p.x) < 120;
            }
    EXPECT_LE(farthest, 122);           // the trunk and 3 mm, in voxels of 4
    EXPECT_EQ(trunk, 60u * 34u * 70u);  // all of it
}

}  // namespace
}  // namespace sonocase::pipeline
