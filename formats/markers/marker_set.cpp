// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/marker_set.h"

#include <cassert>
#include <cmath>

#include "formats/base/constants.h"

namespace sonocase {
namespace {

// The inner 6 x 6 cells of tags 0 to 63 of the family 36h11, row by row from the top left, white as
// 1, the first cell in the highest of 36 bits. The family is that of AprilTag 2; a test compares
// them with the library's own.
constexpr std::uint64_t kCells[kMarkerTagIds] = {
    0xd5d628584, 0xd97f18b49, 0xdd280910e, 0xe479e9c98, 0xebcbca822, 0xf31dab3ac, 0x056a5d085,
    0x10652e1d4, 0x22b1dfead, 0x265ad0472, 0x34fe91b86, 0x3ff962cd5, 0x43a25329a, 0x474b4385f,
    0x4e9d243e9, 0x5246149ae, 0x5997f5538, 0x683bb6c4c, 0x6be4a7211, 0x7e3158eea, 0x81da494af,
    0x858339a74, 0x8cd51a5fe, 0x9f21cc2d7, 0xa2cabc89c, 0xadc58d9eb, 0xb16e7dfb0, 0xb8c05eb3a,
    0xd25ef139d, 0xd607e1962, 0xe4aba3076, 0x2dde6a3da, 0x43d40c678, 0x5620be351, 0x64c47fa65,
    0x686d7002a, 0x6c16605ef, 0x6fbf50bb4, 0x8d06d39dc, 0x9f53856b5, 0xadf746dc9, 0xbc9b084dd,
    0xd290aa77b, 0xd9e28b305, 0xe4dd5c454, 0xfad2fe6f2, 0x181a8151a, 0x26be42c2e, 0x2e10237b8,
    0x405cd5491, 0x7742eab1c, 0x85e6ac230, 0x8d388cdba, 0x9f853ea93, 0xc41ea2445, 0xcf1973594,
    0x14a34a333, 0x31eacd15b, 0x6c79d2dab, 0x73cbb3935, 0x89c155bd3, 0x8d6a46198, 0x91133675d,
    0xa708d89fb};

constexpr int kProbeFirstId = 0, kNeedleFirstId = kBodySides + 1,
              kBoardFirstId = 2 * kBodySides + 2;
// Below the lower edges paper goes on, so that no dark hand touches a tag's white margin.
constexpr double kSkirt = 0.2;  // of a side's height

MarkerBody frustum(
    MarkerRole role, const char* name, int first_id, double body_mm, double reach_mm) {
    const BodyDrawing d = body_drawing(body_mm);
    MarkerBody body;
    body.role = role;
    body.name = name;
    // Points of a tool lie below the body, and both tools' z runs down its axis.
    body.body_from_tool = {Matrix3::diagonal({1, -1, -1}), {0, 0, -reach_mm}};
    const double half = kPi / kBodySides;
    const double top_radius = d.side_mm / (2 * std::tan(half));  // to the middle of an edge
    const double middle_radius = top_radius + 0.5 * d.side_mm * std::sin(kSideLean_rad);
    const double cos_lean = std::cos(kSideLean_rad), sin_lean = std::sin(kSideLean_rad);
    const double skirt_mm = kSkirt * d.side_mm;
    std::vector<Point3> top;
    for (int k = 0; k < kBodySides; ++k) {
        const double turn_rad = 2 * kPi * k / kBodySides;
        const double c = std::cos(turn_rad), s = std::sin(turn_rad);
        MarkerTag tag;
        tag.id = first_id + k;
        tag.edge_mm = d.side_tag_mm;
        const Vector3 out{cos_lean * c, cos_lean * s, sin_lean};
        const Vector3 up{-sin_lean * c, -sin_lean * s, cos_lean};
        const Vector3 right = cross(up, out);
        tag.body_from_tag = {Matrix3::from_columns(right, up, out),
                             {middle_radius * c, middle_radius * s, 0}};
        MarkerFace face;
        face.tag = k;
        const auto at = [&](double x, double y) { return tag.body_from_tag * Point3{x, y, 0}; };
        const double low = -0.5 * d.side_mm - skirt_mm, high = 0.5 * d.side_mm;
        const double low_half = (middle_radius - low * sin_lean) * std::tan(half);
        face.corners = {at(-low_half, low), at(low_half, low), at(0.5 * d.side_mm, high),
                        at(-0.5 * d.side_mm, high)};
        top.push_back(face.corners[2]);
        body.tags.push_back(tag);
        body.faces.push_back(std::move(face));
    }
    MarkerTag tag;
    tag.id = first_id + kBodySides;
    tag.edge_mm = d.top_tag_mm;
    tag.body_from_tag.translation = {0, 0, 0.5 * d.height_mm};
    body.tags.push_back(tag);
    body.faces.push_back({top, kBodySides});
    return body;
}

MarkerBody board(const MarkerSizes& sizes) {
    MarkerBody body;
    body.role = MarkerRole::board;
    body.name = "board";
    const double pitch_mm = board_pitch_mm(sizes);
    for (int row = 0; row < kBoardRows; ++row)
        for (int column = 0; column < kBoardColumns; ++column) {
            MarkerTag tag;
            tag.id = kBoardFirstId + row * kBoardColumns + column;
            tag.edge_mm = sizes.board_tag_mm;
            tag.body_from_tag.translation = {(column - 0.5 * (kBoardColumns - 1)) * pitch_mm,
                                             (0.5 * (kBoardRows - 1) - row) * pitch_mm, 0};
            const double h = 0.5 * pitch_mm;
            const Point3 middle = tag.body_from_tag * Point3{};
            body.faces.push_back({{middle + Vector3{-h, -h, 0}, middle + Vector3{h, -h, 0},
                                   middle + Vector3{h, h, 0}, middle + Vector3{-h, h, 0}},
                                  static_cast<int>(body.tags.size())});
            body.tags.push_back(tag);
        }
    return body;
}

Status in_range(const char* what, double value, double low, double high) {
    if (value >= low && value <= high) return Done{};
    char text[160], range[80];
    std::snprintf(text, sizeof text, "%s of %g mm", what, value);
    std::snprintf(range, sizeof range, "it lies between %g and %g mm", low, high);
    return Error{text, "markers", range};
}

}  // namespace

bool tag_cell_is_white(int id, int row, int column) {
    assert(id >= 0 && id < kMarkerTagIds);
    if (row < 1 || row > 6 || column < 1 || column > 6) return false;
    return kCells[id] >> (35 - ((row - 1) * 6 + column - 1)) & 1;
}

std::array<Point3, 4> tag_corners(const MarkerTag& tag) {
    const double h = 0.5 * tag.edge_mm;
    return {tag.body_from_tag * Point3{-h, -h, 0}, tag.body_from_tag * Point3{h, -h, 0},
            tag.body_from_tag * Point3{h, h, 0}, tag.body_from_tag * Point3{-h, h, 0}};
}

Status check_marker_sizes(const MarkerSizes& sizes) {
    SONOCASE_TRY_DONE(in_range("a body", sizes.body_mm, 25, 56));
    SONOCASE_TRY_DONE(in_range("a reach of the probe", sizes.probe_reach_mm, 20, 400));
    SONOCASE_TRY_DONE(in_range("a reach of the needle", sizes.needle_reach_mm, 20, 400));
    SONOCASE_TRY_DONE(in_range("a tag of the board", sizes.board_tag_mm, 15, 34));
    return in_range("a ruler that should be 100 mm,", sizes.ruler_mm, 90, 110);
}

BodyDrawing body_drawing(double body_mm) {
    // In the sphere round a cube of edge body_mm: radius of the lower corners and half the height.
    const double half = kPi / kBodySides;
    const double lower_radius =
        (1 / (2 * std::tan(half)) + std::sin(kSideLean_rad)) / std::cos(half);
    const double half_height = 0.5 * std::cos(kSideLean_rad);
    BodyDrawing d;
    d.side_mm = 0.5 * std::sqrt(3.0) * body_mm / std::hypot(lower_radius, half_height);
    d.lower_mm = d.side_mm * (1 + 2 * std::sin(kSideLean_rad) * std::tan(half));
    d.height_mm = d.side_mm * std::cos(kSideLean_rad);
    d.side_tag_mm = d.side_mm * kTagCells / (kTagCells + 1.0);  // half a cell of white all round
    d.top_tag_mm = 1.25 * d.side_tag_mm;  // its corners stay a cell within those of the top
    return d;
}

double board_pitch_mm(const MarkerSizes& sizes) {
    return 1.375 * sizes.board_tag_mm;
}

std::vector<MarkerBody> marker_bodies(const MarkerSizes& sizes) {
    const double scale = sizes.ruler_mm / 100;
    MarkerSizes printed = sizes;
    printed.board_tag_mm *= scale;
    std::vector<MarkerBody> bodies;
    bodies.push_back(frustum(MarkerRole::probe, "probe", kProbeFirstId, sizes.body_mm * scale,
                             sizes.probe_reach_mm));
    bodies.push_back(frustum(MarkerRole::needle, "needle", kNeedleFirstId, sizes.body_mm * scale,
                             sizes.needle_reach_mm));
    bodies.push_back(board(printed));
    return bodies;
}

void place_tags_as_built(std::vector<MarkerBody>& bodies, std::span<const BuiltTag> tags) {
    for (const BuiltTag& built : tags) {
        const TagPlace place = find_tag(bodies, built.id);
        if (place.body < 0) continue;
        MarkerBody& body = bodies[place.body];
        Rigid& body_from_tag = body.tags[place.tag].body_from_tag;
        const double angle = norm(built.turned_rad);
        Rigid drawn_from_built{{}, built.moved_mm};
        if (angle > 0) drawn_from_built.rotation = rotation_about(built.turned_rad / angle, angle);
        const Rigid drawn = body_from_tag;
        body_from_tag = drawn * drawn_from_built;
        for (MarkerFace& face : body.faces) {
            if (face.tag != place.tag) continue;
            for (Point3& corner : face.corners) corner = body_from_tag * (inverse(drawn) * corner);
        }
    }
}

TagPlace find_tag(const std::vector<MarkerBody>& bodies, int id) {
    for (std::size_t b = 0; b < bodies.size(); ++b)
        for (std::size_t t = 0; t < bodies[b].tags.size(); ++t)
            if (bodies[b].tags[t].id == id) return {static_cast<int>(b), static_cast<int>(t)};
    return {};
}

int tags_facing(const MarkerBody& body, Point3 camera_body, double max_obliquity_rad) {
    int count = 0;
    for (const MarkerTag& tag : body.tags) {
        const Vector3 towards = normalized(camera_body - tag.body_from_tag * Point3{});
        if (dot(towards, tag.body_from_tag * Vector3{0, 0, 1}) >= std::cos(max_obliquity_rad))
            ++count;
    }
    return count;
}

}  // namespace sonocase
