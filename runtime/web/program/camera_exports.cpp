// SPDX-License-Identifier: Apache-2.0

// The page's second program, which is fetched when a camera is chosen: pictures of printed markers
// in, poses of probe and needle out. It runs in a worker: runtime/web/page/camera_worker.js is the
// other side.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/markers/detect/camera_poses.h"

#define SONOCASE_EXPORT(name) extern "C" __attribute__((export_name(#name)))

using namespace sonocase;

namespace {

// Order of what follow() leaves for each tool; camera_worker.js reads it in the same order. After
// it come 16 numbers: rows of world_from_face or world_from_needle.
enum ToolValue { kStatus, kSigmaMm, kTags, kTwoPoses, kRows, kToolValueCount = kRows + 16 };

struct Camera {
    std::string text;
    std::vector<std::uint8_t> grey, colours;
    int width_px = 0, height_px = 0;
    KnownCamera known;
    std::optional<CameraPoses> poses;
    std::array<double, 2 * kToolValueCount> values{};
};
Camera camera;

// The sentence as a page translates it: its format and each argument on a line of its own.
void say(const Message& message) {
    camera.text = std::string(message.format());
    for (const Message& argument : message.arguments()) camera.text += '\n' + argument;
}
int answer(const Error& error) {
    say(error.where.empty() && error.expected.empty() ? error.what : Message(error.message()));
    return 0;
}

}  // namespace

SONOCASE_EXPORT(text) const char* text() {
    return camera.text.data();
}
SONOCASE_EXPORT(text_bytes) std::size_t text_bytes() {
    return camera.text.size();
}
SONOCASE_EXPORT(reserve_text) char* reserve_text(std::size_t bytes) {
    camera.text.resize(bytes);
    return camera.text.data();
}

// text(): what `sonocase calibrate` wrote, line break, its name. Functions that can fail return 0
// and leave the reason in text().
SONOCASE_EXPORT(use_setup) int use_setup() {
    const std::size_t end = camera.text.rfind('\n');
    const std::string name = end == std::string::npos ? "" : camera.text.substr(end + 1);
    Result<CameraSetup> setup = parse_camera(std::string_view(camera.text).substr(0, end), name);
    if (!setup) return answer(setup.error());
    camera.known = {*std::move(setup), true};
    return 1;
}
// Pictures of this size follow.
SONOCASE_EXPORT(begin) int begin(int width_px, int height_px) {
    camera.poses.reset();
    Result<CameraPoses> made = CameraPoses::create(camera.known, width_px, height_px);
    if (!made) return answer(made.error());
    camera.poses.emplace(*std::move(made));
    camera.width_px = width_px, camera.height_px = height_px;
    return 1;
}
// Where the next picture goes: at least its grey values row by row; bytes: with what a video's
// picture has behind them.
SONOCASE_EXPORT(grey) std::uint8_t* grey(std::size_t bytes) {
    camera.grey.resize(bytes);
    return camera.grey.data();
}
// Grey values of a video are often 16 to 235; a tag is read in either form, darkness is not.
SONOCASE_EXPORT(widen) void widen() {
    std::uint8_t* p = camera.grey.data();
    const int count = camera.width_px * camera.height_px;
    for (int i = 0; i < count; ++i) {
        const int wide = ((p[i] - 16) * 298 + 128) >> 8;  // 255 / 219
        p[i] = static_cast<std::uint8_t>(wide < 0 ? 0 : wide > 255 ? 255 : wide);
    }
}
// The same picture in colour instead: red, green, blue and something else, or with blue first.
SONOCASE_EXPORT(colours) std::uint8_t* colours() {
    camera.colours.resize(std::size_t{4} * camera.width_px * camera.height_px);
    return camera.colours.data();
}
SONOCASE_EXPORT(take_colours) void take_colours(int blue_first) {
    const std::size_t count = camera.colours.size() / 4;
    camera.grey.resize(count);
    const int first = blue_first ? 29 : 77, third = blue_first ? 77 : 29;  // of 256 (BT.601)
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint8_t* c = camera.colours.data() + 4 * i;
        camera.grey[i] = static_cast<std::uint8_t>((first * c[0] + 150 * c[1] + third * c[2]) >> 8);
    }
}

// Times in seconds on one clock: of the exposure, and now. Leaves poses of the exposure in
// values(), and in text() what is wrong.
SONOCASE_EXPORT(follow) void follow(double time_s, double now_s) {
    const FollowerPicture& seen = camera.poses->follow(
        {camera.grey.data(), camera.width_px, camera.height_px, camera.width_px}, time_s, now_s);
    say(camera.poses->message());
    for (int tool = 0; tool < 2; ++tool) {
        const MarkerReading& reading = seen.tools[tool];
        double* v = camera.values.data() + tool * kToolValueCount;
        v[kStatus] = static_cast<double>(reading.status);
        v[kSigmaMm] = reading.sigma_mm;
        v[kTags] = reading.tags;
        v[kTwoPoses] = reading.two_poses;
    }
}
// The poses of the last picture, as they should be at a time; once for each picture.
SONOCASE_EXPORT(poses_at) const double* poses_at(double at_s) {
    for (int tool = 0; tool < 2; ++tool) {
        const MarkerRole role = tool == 0 ? MarkerRole::probe : MarkerRole::needle;
        const Rigid pose =
            camera.poses->pose_at(role, at_s) * camera.poses->body(role).body_from_tool;
        double* rows = camera.values.data() + tool * kToolValueCount + kRows;
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) rows[4 * r + c] = pose.rotation(r, c);
        rows[3] = pose.translation.x, rows[7] = pose.translation.y, rows[11] = pose.translation.z;
        rows[12] = rows[13] = rows[14] = 0, rows[15] = 1;
    }
    return camera.values.data();
}
SONOCASE_EXPORT(value_count) int value_count() {
    return static_cast<int>(camera.values.size());
}
