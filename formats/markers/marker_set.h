// SPDX-License-Identifier: Apache-2.0

// Printed markers that one camera follows: a body for the probe, a body for the needle, and a
// board for the table or the mannequin. This is the one description of them; sheets are printed,
// poses are fitted and test pictures are rendered from it.
//
// A body is a truncated pyramid with seven sides: its sides lean inwards by 25 degrees, so that a
// camera anywhere above sees at least two tags, within 70 degrees of head-on, and mostly four (the
// tests prove it over random poses; of a cube's tags one or none is seen in a quarter of them).
// Seven is the smallest number of sides for which this holds.
//
// Frame of a body: origin in the middle of its axis, z along the axis out of the top, x through the
// middle of side 0; mm. Frame of the board: origin in its middle, x right, y up, z out of the
// paper. Frame of a tag: the same as the board's, of its own square. Tags are of the family 36h11
// (Wang and Olson, AprilTag 2, IROS 2016).
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase {

inline constexpr int kTagCells = 8;       // along an edge of the black square, its border included
inline constexpr int kMarkerTagIds = 64;  // ids 0 .. 63 may be used
// Whether a cell of a tag is white: row 0 at the top, as it is read. id in [0, kMarkerTagIds).
bool tag_cell_is_white(int id, int row, int column);

struct MarkerTag {
    int id = 0;
    double edge_mm = 0;  // of the black square
    Rigid body_from_tag;
};
// Corners of the black square in the frame of the tag: lower left, lower right, upper right, upper
// left; edge k runs from corner k to corner k + 1.
std::array<Point3, 4> tag_corners(const MarkerTag& tag);  // in the frame of the body

// A flat piece of white paper, seen from outside, its corners anticlockwise; in the frame of the
// body. `tag` counts in MarkerBody::tags; -1: none.
struct MarkerFace {
    std::vector<Point3> corners;
    int tag = -1;
};

enum class MarkerRole : std::uint8_t { probe, needle, board };

struct MarkerBody {
    MarkerRole role = MarkerRole::board;
    std::string name;  // "probe", "needle", "board"
    std::vector<MarkerTag> tags;
    std::vector<MarkerFace> faces;
    // The tool as it is mounted: the frame `probe` or `needle`; the identity for the board.
    Rigid body_from_tool;
};

struct MarkerSizes {
    // Edge of the cube round which a body's own sphere fits; bodies of 40 mm are about 67 mm wide.
    double body_mm = 40;
    double probe_reach_mm = 120;   // from the middle of the body to the probe's face
    double needle_reach_mm = 150;  // from the middle of the body to the needle's tip
    double board_tag_mm = 32;      // edge of a black square
    // How long the ruler of 100 mm is on the paper: a printer that fits pages changes all lengths.
    double ruler_mm = 100;
    bool operator==(const MarkerSizes&) const = default;
};

inline constexpr int kBodySides = 7;
inline constexpr double kSideLean_rad = 25 * kRadPerDeg;
inline constexpr int kBoardColumns = 4, kBoardRows = 5;

// Errors: a size out of range; a ruler that is off by more than a tenth was measured wrongly.
Status check_marker_sizes(const MarkerSizes& sizes);

// Lengths of a body as it is drawn, before the ruler is allowed for.
struct BodyDrawing {
    double side_mm = 0;    // height of a side along its slope, and its upper edge
    double lower_mm = 0;   // lower edge of a side
    double height_mm = 0;  // from base to top
    double side_tag_mm = 0, top_tag_mm = 0;
};
BodyDrawing body_drawing(double body_mm);
double board_pitch_mm(const MarkerSizes& sizes);  // from tag to tag

// What is in front of the camera: probe (ids 0 to 7), needle (8 to 15), board (16 to 35), in this
// order. Sizes have passed check_marker_sizes(); tags and faces are those of the paper as printed,
// the reach of a tool is not scaled by the ruler.
std::vector<MarkerBody> marker_bodies(const MarkerSizes& sizes = {});

// A tag where it was found to be glued, in the frame of the tag as it is drawn.
struct BuiltTag {
    int id = 0;
    Vector3 moved_mm;
    Vector3 turned_rad;  // rotation vector about the tag's middle
    bool operator==(const BuiltTag&) const = default;
};
inline constexpr double kMaxTagMoved_mm = 10, kMaxTagTurned_rad = 15 * kRadPerDeg;
// Moves tags of `bodies`, each with its face. Ids that no body has are left out.
void place_tags_as_built(std::vector<MarkerBody>& bodies, std::span<const BuiltTag> tags);

// Which body an id belongs to, and which of its tags it is; body -1: none.
struct TagPlace {
    int body = -1, tag = -1;
};
TagPlace find_tag(const std::vector<MarkerBody>& bodies, int id);

// The tags that face a camera at camera_body, in the frame of the body, with their surface within
// max_obliquity_rad of head-on.
int tags_facing(const MarkerBody& body, Point3 camera_body, double max_obliquity_rad);

}  // namespace sonocase
