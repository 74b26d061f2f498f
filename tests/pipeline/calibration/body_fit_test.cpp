// SPDX-License-Identifier: Apache-2.0

// Corners as a camera would give them, without pictures.

#include "pipeline/calibration/body_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/constants.h"
#include "formats/base/random.h"
#include "support/hard_case.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::HardCase;

constexpr double kNoisePx = 0.05;

std::vector<BuiltTag> askew(const MarkerBody& drawn) {
    RandomStream random(7);
    std::vector<BuiltTag> tags;
    for (const MarkerTag& tag : drawn.tags)
        tags.push_back({tag.id, random.uniform(0.5, 2) * random.direction(),
                        random.uniform(0.5, 3) * kRadPerDeg * random.direction()});
    return tags;
}

struct Scene {
    CameraModel camera = assumed_camera(1280, 720);
    MarkerBody drawn = marker_bodies()[0], built;
    Scene() {
        std::vector<MarkerBody> bodies = marker_bodies();
        place_tags_as_built(bodies, askew(drawn));
        built = bodies[0];
    }
    // turn_deg: of the body about its axis, all in all; 0: it stands.
    std::vector<MarkerView> turning(int count, double turn_deg, double noise_px = kNoisePx) const {
        RandomStream random(3);
        std::vector<MarkerView> views;
        for (int i = 0; i < count; ++i) {
            const double part = static_cast<double>(i) / count;
            const double lean = turn_deg > 0 ? random.uniform(10, 80) * kRadPerDeg : 0.6;
            const Rigid pose{rotation_about({0, 0, 1}, turn_deg > 0 ? random.uniform(-3, 3) : 0) *
                                 rotation_about({1, 0, 0}, lean) * rotation_about({1, 0, 0}, kPi) *
                                 rotation_about({0, 0, 1}, part * turn_deg * kRadPerDeg),
                             {0, 0, 350}};
            views.push_back(view(pose, random, noise_px));
        }
        return views;
    }
    MarkerView view(const Rigid& pose, RandomStream& random, double noise_px) const {
        MarkerView view;
        const Point3 eye = inverse(pose) * Point3{};
        for (const MarkerTag& tag : built.tags) {
            const Vector3 towards = normalized(eye - tag.body_from_tag * Point3{});
            if (dot(towards, tag.body_from_tag * Vector3{0, 0, 1}) < 0.34) continue;
            SeenTag seen;
            seen.id = tag.id;
            const std::array<Point3, 4> corners = tag_corners(tag);
            for (int k = 0; k < 4; ++k) {
                project(camera, pose * corners[k] - Point3{}, seen.corners[k], nullptr);
                // Three throws are nearly normal; each has a third of the variance of one.
                for (double* at : {&seen.corners[k].x, &seen.corners[k].y})
                    for (int n = 0; n < 3; ++n) *at += noise_px * random.uniform(-1, 1);
            }
            for (int k = 0; k < 8; ++k) seen.whitening[9 * k] = 1 / kNoisePx;
            view.tags.push_back(seen);
        }
        return view;
    }
};

TEST(BodyFit, TagsAreFoundWhereTheyWereGluedAndTheirErrorsAreTold) {
    const Scene scene;
    const BodyFit fit = fit_body(scene.turning(50, 1080), scene.drawn, scene.camera);
    ASSERT_EQ(fit.problem, "");
    EXPECT_LT(fit.rms_px, 2 * kNoisePx);
    EXPECT_GT(fit.drawn_rms_px, 10 * kNoisePx);
    HardCase turned("turn of tags glued askew, off", HardCase::at_most, 0.3, "degrees");
    // The frame of the body is free: distances between tags and angles between them are compared.
    std::vector<MarkerBody> found{scene.drawn};
    std::vector<BuiltTag> tags;
    for (const TagOfBody& tag : fit.tags) tags.push_back(tag.built);
    place_tags_as_built(found, tags);
    for (std::size_t a = 0; a < tags.size(); ++a)
        for (std::size_t b = 0; b < a; ++b) {
            const auto between = [&](const MarkerBody& body) {
                return inverse(body.tags[a].body_from_tag) * body.tags[b].body_from_tag;
            };
            const Rigid is = between(found[0]), was = between(scene.built);
            const double sigma_mm = std::hypot(fit.tags[a].sigma_mm, fit.tags[b].sigma_mm);
            const double sigma_deg = std::hypot(fit.tags[a].sigma_deg, fit.tags[b].sigma_deg);
            const double off_deg =
                kDegPerRad * rotation_angle(transpose(is.rotation) * was.rotation);
            turned.see(off_deg);
            // The turn of the tag that is looked from moves the other one by its distance.
            const double arm = norm(was.translation) * fit.tags[a].sigma_deg * kRadPerDeg;
            // Four standard deviations: of 28 pairs none is beyond.
            EXPECT_LT(off_deg, 4 * sigma_deg);
            EXPECT_LT(norm(is.translation - was.translation), 4 * std::hypot(sigma_mm, arm));
            EXPECT_LT(sigma_mm, 0.2);
        }
}

TEST(BodyFit, RefusesWhatTheViewsDoNotDetermine) {
    const Scene scene;
    const auto said = [&](const std::vector<MarkerView>& views) {
        return fit_body(views, scene.drawn, scene.camera).problem;
    };
    EXPECT_NE(said({}).find("from 0 sides"), std::string::npos);
    // It stands, for however long.
    EXPECT_NE(said(scene.turning(60, 0)).find("from 1 sides"), std::string::npos);
    // One side is never shown.
    EXPECT_NE(said(scene.turning(60, 90)).find("is seen beside another in"), std::string::npos);
    // Another camera's file, or a body that bends.
    EXPECT_NE(said(scene.turning(40, 1080, 1.5)).find("corners are off"), std::string::npos);
    // Corners that a blurred picture leaves uncertain.
    std::vector<MarkerView> blurred = scene.turning(17, 1080, 0.4);
    for (MarkerView& view : blurred)
        for (SeenTag& tag : view.tags)
            for (double& w : tag.whitening) w *= 0.05;
    EXPECT_NE(said(blurred).find("is not determined"), std::string::npos) << said(blurred);
}

}  // namespace
}  // namespace sonocase::pipeline
