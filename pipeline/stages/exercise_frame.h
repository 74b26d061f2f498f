// SPDX-License-Identifier: Apache-2.0

// Exercises written in the patient's frame.
//
// An author plans targets and paths on the CT, in Slicer's RAS millimetres, long before a mannequin
// is fitted. `frame = "ct"` at the head of an exercise says that all its positions and directions
// are in that frame; cooking carries them through the fit. Without it they are in `mannequin`.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline stages {

// The exercise as parse_exercise reads it, with the line of `frame` blanked so that the lines of
// errors stay right. in_ct: whether it said "ct". Errors: text that is not TOML; a frame that is
// neither "ct" nor "mannequin".
struct FramedExercise {
    std::string toml;
    bool in_ct = false;
};
Result<FramedExercise> strip_frame(std::string_view toml, const std::string& where);

// A lesion of the answer key that exercises may aim at.
struct KeyTarget {
    std::string name;
    Point3 centre;
    double radius_mm = 5;
    bool by_default = false;  // a target of every exercise that has none of its own
};

// A target with `pathology = "NAME"` gets its centre and radius from the key, look "none" and
// inside NAME where it says nothing else; an exercise without targets, unless it is a scan, gets
// those that are targets by default. The text is returned unchanged where there is nothing to do.
// Errors: a name that the key lacks.
Result<std::string> targets_from_key(const std::string& stripped_toml,
                                     const std::string& where,
                                     const std::vector<KeyTarget>& key);

// The same exercise in `mannequin`, as new TOML. A point goes through the map. A probe's beam aims
// at where the map carries the anatomy in its middle; its lateral axis is turned by the Jacobian at
// the skin. A needle in the scan plane (within 1 mm and 1 degree) is put into the mapped plane.
Result<std::string> exercise_to_mannequin(const std::string& stripped_toml,
                                          const std::string& where,
                                          const Registration& registration);

}  // namespace sonocase::pipeline::inline stages
