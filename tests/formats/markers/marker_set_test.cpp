// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/marker_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "formats/base/constants.h"
#include "formats/base/random.h"
#include "formats/markers/camera_model.h"

namespace sonocase {
namespace {

TEST(MarkerSet, TwoTagsFaceACameraAnywhereAboveTheBody) {
    // Directions of the camera from 15 degrees below the base up to the axis; 400 mm away at least.
    const MarkerBody body = marker_bodies()[0];
    RandomStream random(1);
    int fewest = 99, sum = 0, cube_few = 0;
    constexpr int kPoses = 20000;
    for (int i = 0; i < kPoses; ++i) {
        Vector3 towards = random.direction();
        while (towards.z < std::sin(-15 * kRadPerDeg)) towards = random.direction();
        const int facing =
            tags_facing(body, Point3{} + random.uniform(400, 900) * towards, 70 * kRadPerDeg);
        fewest = std::min(fewest, facing);
        sum += facing;
        int cube = 0;
        for (const Vector3& out : {Vector3{1, 0, 0}, Vector3{-1, 0, 0}, Vector3{0, 1, 0},
                                   Vector3{0, -1, 0}, Vector3{0, 0, 1}})
            cube += dot(out, towards) > std::cos(70 * kRadPerDeg);
        cube_few += cube < 2;
    }
    EXPECT_GE(fewest, 2);
    EXPECT_GT(static_cast<double>(sum) / kPoses, 3.2);
    // The cube for comparison: the reason for this shape.
    EXPECT_GT(cube_few, kPoses / 10);
}

TEST(MarkerSet, ABodyFitsRoundTheCubeOfItsSizeAndItsTagsFitItsFaces) {
    for (const double size : {25.0, 40.0, 56.0}) {
        MarkerSizes sizes;
        sizes.body_mm = size;
        for (const MarkerBody& body : marker_bodies(sizes)) {
            std::set<int> ids;
            for (const MarkerFace& face : body.faces) {
                ASSERT_GE(face.tag, 0);
                const MarkerTag& tag = body.tags[face.tag];
                ids.insert(tag.id);
                const Vector3 out = tag.body_from_tag * Vector3{0, 0, 1};
                const double cell = tag.edge_mm / kTagCells;
                for (const Point3& corner : tag_corners(tag)) {
                    EXPECT_NEAR(dot(corner - face.corners[0], out), 0, 1e-9);  // in the face
                    // With half a cell of white between it and each edge of the paper.
                    for (std::size_t k = 0; k < face.corners.size(); ++k) {
                        const Point3 a = face.corners[k];
                        const Point3 b = face.corners[(k + 1) % face.corners.size()];
                        const double inside = dot(cross(normalized(b - a), corner - a), out);
                        EXPECT_GT(inside, 0.49 * cell) << body.name << " tag " << tag.id;
                    }
                }
                if (body.role != MarkerRole::board) {
                    for (const Point3& corner : tag_corners(tag))
                        EXPECT_LT(distance(corner, {}), 0.5 * std::sqrt(3.0) * size);
                }
            }
            EXPECT_EQ(ids.size(), body.tags.size());
        }
    }
}

TEST(MarkerSet, NoIdIsUsedTwiceAndEachIsFound) {
    const std::vector<MarkerBody> bodies = marker_bodies();
    std::set<int> ids;
    for (std::size_t b = 0; b < bodies.size(); ++b)
        for (std::size_t t = 0; t < bodies[b].tags.size(); ++t) {
            const int id = bodies[b].tags[t].id;
            EXPECT_TRUE(ids.insert(id).second) << id;
            EXPECT_LT(id, kMarkerTagIds);
            EXPECT_EQ(find_tag(bodies, id).body, static_cast<int>(b));
            EXPECT_EQ(find_tag(bodies, id).tag, static_cast<int>(t));
        }
    EXPECT_EQ(find_tag(bodies, 60).body, -1);
}

TEST(MarkerSet, TheRulerScalesThePaperAndNotTheStick) {
    MarkerSizes small;
    small.ruler_mm = 97;
    const auto drawn = marker_bodies(), printed = marker_bodies(small);
    for (std::size_t b = 0; b < drawn.size(); ++b) {
        EXPECT_NEAR(printed[b].tags[0].edge_mm, 0.97 * drawn[b].tags[0].edge_mm, 1e-12);
        EXPECT_EQ(printed[b].body_from_tool.translation, drawn[b].body_from_tool.translation);
    }
    EXPECT_EQ(drawn[0].body_from_tool * Point3{}, (Point3{0, 0, -120}));
    EXPECT_EQ(drawn[1].body_from_tool * Point3{}, (Point3{0, 0, -150}));
}

TEST(MarkerSet, SizesOutOfRangeAreRefused) {
    EXPECT_TRUE(check_marker_sizes({}));
    for (const auto change :
         {+[](MarkerSizes& s) { s.body_mm = 10; }, +[](MarkerSizes& s) { s.ruler_mm = 50; },
          +[](MarkerSizes& s) { s.board_tag_mm = 80; },
          +[](MarkerSizes& s) { s.needle_reach_mm = std::nan(""); }}) {
        MarkerSizes sizes;
        change(sizes);
        EXPECT_FALSE(check_marker_sizes(sizes));
    }
}

TEST(CameraModel, ADirectionComesBackFromItsPixel) {
    CameraModel camera = assumed_camera(1280, 720);
    camera.k1 = -0.2, camera.k2 = 0.05, camera.k3 = -0.005, camera.p1 = 0.001, camera.p2 = -0.002;
    RandomStream random(2);
    for (int i = 0; i < 1000; ++i) {
        const Pixel seen{random.uniform(0, 1279), random.uniform(0, 719)};
        Pixel back;
        ASSERT_TRUE(project(camera, 500 * direction_at(camera, seen), back, nullptr));
        EXPECT_NEAR(back.x, seen.x, 1e-7);
        EXPECT_NEAR(back.y, seen.y, 1e-7);
    }
    Pixel unused;
    EXPECT_FALSE(project(camera, {0, 0, -100}, unused, nullptr));
}

TEST(CameraModel, DerivativesAreThoseOfDifferences) {
    CameraModel camera = assumed_camera(1280, 720);
    camera.k1 = -0.2, camera.k2 = 0.05, camera.k3 = -0.005, camera.p1 = 0.001, camera.p2 = -0.002;
    const Vector3 p{150, -90, 600};
    Pixel at;
    double j[6];
    ASSERT_TRUE(project(camera, p, at, j));
    for (int k = 0; k < 3; ++k) {
        Vector3 moved = p;
        moved[k] += 1e-4;
        Pixel then;
        ASSERT_TRUE(project(camera, moved, then, nullptr));
        EXPECT_NEAR((then.x - at.x) / 1e-4, j[k], 1e-4);
        EXPECT_NEAR((then.y - at.y) / 1e-4, j[3 + k], 1e-4);
    }
}

TEST(CameraModel, AFileReadsBackAndNonsenseIsRefused) {
    CameraSetup setup;
    setup.markers.ruler_mm = 97.5;
    setup.built = {{3, {1, -0.5, 0.25}, {0.01, 0, -0.02}}, {9, {0, 0, 1.75}, {}}};
    CameraModel& camera = setup.camera;
    camera = assumed_camera(1920, 1080);
    camera.k1 = -0.07, camera.rms_px = 0.21, camera.sigma_focal_px = 1.5, camera.pictures = 30;
    camera.camera = "USB camera", camera.date = "2026-11-26T10:00:00Z";
    const std::string text = format_camera(setup);
    const auto read = parse_camera(text, "camera.json");
    ASSERT_TRUE(read);
    EXPECT_EQ(*read, setup);
    for (const auto& [from, to] : {std::pair<std::string, std::string>{"\"focal_px\"", "\"focal\""},
                                   {"sonocase camera", "sonocase machine"},
                                   {"97.5", "9.75"},
                                   {"\"id\": 9", "\"id\": 3"},
                                   {"1.75", "17.5"},
                                   {"-0.02", "-0.32"},
                                   {"1920", "19"}}) {
        std::string broken = text;
        broken.replace(broken.find(from), from.size(), to);
        EXPECT_FALSE(parse_camera(broken, "camera.json")) << to;
    }
    for (std::size_t end = 0; end + 2 < text.size(); end += 7)
        EXPECT_FALSE(parse_camera(text.substr(0, end), "camera.json"));
    // Half the size is the same camera; another shape is not.
    const auto half = at_size(camera, 960, 540);
    ASSERT_TRUE(half);
    EXPECT_NEAR(half->fx_px, 0.5 * camera.fx_px, 1e-9);
    EXPECT_FALSE(at_size(camera, 960, 720));
}

}  // namespace
}  // namespace sonocase
