// SPDX-License-Identifier: Apache-2.0

// Places on a skin that a person can find on another one as well: candidates for the rows of a
// landmark file.
//
//     rightmost, leftmost, front_most, hindmost   the farthest point, mean of those of the
//              0.2 % farthest, at least five, that lie within 25 mm of it
//     crotch   where the body, going down, ceases to be as deep on its midline as beside it, and
//              goes on on both sides; to a slice of 15 mm
//     navel    the deepest dimple of the front's midline, at least 1.5 mm below the quadratic
//              surface through the skin round it
// Extremes lie where a body is round, and are good to a centimetre or two along it; crotch and
// navel are distinct places. A place that a body does not show is left out: nothing is guessed by
// proportion.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/volume/surface.h"

namespace sonocase::pipeline::inline registration {

struct LandmarkCandidate {
    std::string name;
    Point3 place;     // frame of the surface
    std::string how;  // "dimple of 4.1 mm"
};

// up, front: of the patient in the surface's frame; front is made perpendicular to up. Vertices of
// a mesh or readings alike; fewer than 100 have no candidates. Cost: 20 ms per 10,000 points.
std::vector<LandmarkCandidate> landmark_candidates(const Surface& skin, Vector3 up, Vector3 front);

// Colour of a candidate in the picture and its name, by its place in the list.
struct CandidateColour {
    const char* name;
    std::array<std::uint8_t, 3> rgb;
};
CandidateColour candidate_colour(const std::string& candidate);

// PNG: each surface from the front and from its right, candidates as discs.
struct CandidateView {
    const Surface* skin = nullptr;
    Vector3 up, front;
    std::vector<LandmarkCandidate> candidates;
};
std::vector<std::uint8_t> landmark_picture(const std::vector<CandidateView>& views);

// Rows of a landmark file for the candidates that both lists have: name,ct_x,ct_y,ct_z,x,y,z.
std::string landmark_rows(const std::vector<LandmarkCandidate>& ct,
                          const std::vector<LandmarkCandidate>& mannequin);

}  // namespace sonocase::pipeline::inline registration
