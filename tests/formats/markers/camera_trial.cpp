// SPDX-License-Identifier: Apache-2.0

// camera_trial WIDTH PIXELS TAGS: how far from the truth one camera sees the probe's face, and what
// a picture of one body costs, with pictures of that width, so many pixels of each tag that its
// pattern is laid over (0: corners by lines along the edges, as the library has them), and no more
// than so many tags. For `sonocase tradeoff --suite camera`.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "formats/base/constants.h"
#include "formats/markers/detect/tag_detector.h"
#include "support/marker_video.h"

namespace {

using namespace sonocase;

double area_px(const SeenTag& tag) {
    double twice = 0;
    for (int k = 0; k < 4; ++k) {
        const Pixel a = tag.corners[k], b = tag.corners[(k + 1) % 4];
        twice += a.x * b.y - a.y * b.x;
    }
    return std::abs(twice);
}

int measure(int width, int pixels, std::size_t most_tags) {
    auto detector = TagDetector::create();
    if (!detector) {
        std::fprintf(stderr, "%s\n", detector.error().message().c_str());
        return 1;
    }
    constexpr int kPictures = 60;
    const int height = width * 9 / 16;
    const CameraModel camera = assumed_camera(width, height);
    const std::vector<MarkerBody> bodies = marker_bodies();
    const MarkerBody& body = bodies[0];
    const Point3 face = body.body_from_tool * Point3{};
    testing::MarkerVideo video(camera);
    RandomStream random(6);
    double square = 0, seconds = 0;
    int good = 0;
    for (int i = 0; i < kPictures; ++i) {
        const double elevation = random.uniform(35, 75) * kRadPerDeg;
        const double s = std::sin(elevation), c = std::cos(elevation);
        const Vector3 forward{0, c, -s}, right{1, 0, 0};
        const Matrix3 table =
            transpose(Matrix3::from_columns(right, cross(forward, right), forward));
        const Matrix3 held = rotation_about({1, 0, 0}, random.uniform(-40, 40) * kRadPerDeg) *
                             rotation_about({0, 1, 0}, random.uniform(-40, 40) * kRadPerDeg) *
                             rotation_about({0, 0, 1}, random.uniform(-kPi, kPi));
        const Vector3 ray =
            direction_at(camera, {width * random.uniform(0.15, 0.85), height * 0.5});
        const Rigid truth{table * held, 600 / norm(ray) * ray};
        // The lens is the same, whatever the pixels.
        testing::VideoOptions options;
        options.defocus_px = 0.8 * width / 1280;
        const std::vector<std::uint8_t> grey =
            video.take({testing::still_body(body, truth)}, 0.03 * i, options);
        Pixel middle;
        project(camera, truth.translation, middle, nullptr);
        const int reach = width / 12;
        const int x = static_cast<int>(middle.x), y = static_cast<int>(middle.y);
        const std::clock_t start = std::clock();
        const GreyPicture picture{grey.data(), width, height, width};
        std::vector<SeenTag> tags;
        detector->read(picture, {x - reach, y - reach, x + reach, y + reach}, width > 1280 ? 2 : 1,
                       tags);
        std::sort(tags.begin(), tags.end(),
                  [](const SeenTag& a, const SeenTag& b) { return area_px(a) > area_px(b); });
        if (tags.size() > most_tags) tags.resize(most_tags);
        std::vector<TagSight> sights;
        for (SeenTag& tag : tags) {
            if (pixels > 0) {
                if (!fit_tag(picture, tag, pixels)) continue;
            } else {
                constexpr double kEdgeSigmaPx = 0.2;
                for (int k = 0; k < 8; ++k) tag.whitening[9 * k] = 1 / kEdgeSigmaPx;
            }
            const TagPlace place = find_tag(bodies, tag.id);
            if (place.body == 0) sights.push_back({&body.tags[place.tag], &tag});
        }
        const auto pose = find_body_pose(camera, sights, nullptr);
        seconds += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
        // Where two poses fit alike the follower knows better: they are not compared.
        constexpr double kMargin = 30;
        if (!pose || !(pose->margin > kMargin)) continue;
        const double off = distance(pose->camera_from_body * face, truth * face);
        square += off * off;
        ++good;
    }
    std::printf("{\"error\": %.6g, \"seconds\": %.6g, \"note\": \"%d of %d poses sure\"}\n",
                good > 0 ? std::sqrt(square / good) : std::nan(""), seconds / kPictures, good,
                kPictures);
    return 0;
}

}  // namespace

int main(int count, char** words) {
    if (count != 4) {
        std::fprintf(stderr, "usage: camera_trial WIDTH PIXELS TAGS\n");
        return 2;
    }
    return measure(std::clamp(std::atoi(words[1]), 480, 3840), std::atoi(words[2]),
                   static_cast<std::size_t>(std::max(1, std::atoi(words[3]))));
}
