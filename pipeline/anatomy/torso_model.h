// SPDX-License-Identifier: Apache-2.0

// The model of a human torso that anatomy_check.h compares label maps with: where structures lie in
// an adult, how much that varies, and how large they are.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::pipeline::inline anatomy {

// Place of one structure, in mm from the middle of the vertebra L3: x to the right, y to the front,
// z to the head, of an adult of 175 cm.
struct ModelStructure {
    std::string name;    // "kidney_right"
    std::string family;  // structures whose names are easily exchanged: "kidney", "rib", "vertebra"
    int side = 0;        // 1 right, -1 left, 0: no side
    Vector3 at, spread;  // mean and standard deviation
    double half_mm = 0;  // half of its greatest extent
    Vector3 length;      // of rods that spread as far along x, y and z
    double min_ml = 0, usual_ml = 0, max_ml = 0;  // limits over all ages and most diseases
    double spread_ln = 0;                         // standard deviation of ln(volume) in adults
    double shape_ln = 0.28;  // of ln(length), beside what the volume's spread leaves
    int other = -1;          // index of the same structure on the other side
};

// All structures; a paired one is there twice. The same object at every call. Thread-safe.
std::span<const ModelStructure> torso_model();

// Index of the structure that a name means: "kidney_left", "Left kidney", "L kidney",
// "vertebrae_L5". -1: none.
int model_structure(std::string_view name);

// The name of TotalSegmentator v2 "total" that a name spells otherwise: "Liver", "right kidney",
// "Kidney-RT" and "Adrenal gland (L)" have one. No synonyms: "hepar" and "ileum" have none. Empty:
// none.
std::string standard_name(std::string_view name);

// A label of the whole body or its skin, whose box is the body's.
bool is_body_name(std::string_view name);

}  // namespace sonocase::pipeline::inline anatomy
