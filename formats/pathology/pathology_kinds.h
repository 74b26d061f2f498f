// SPDX-License-Identifier: Apache-2.0

// The kinds of pathology: shape, parts, and the acoustic figures of each with their source.
//
// docs/pathology.md shows every kind in both image models. "(assumed)" in a source marks a figure
// that is an assumption.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/volume/tissue.h"

namespace sonocase {

enum class LesionShape { ellipsoid, tube, pool, swell };

// Where a part of a lesion lies, relative to the lesion's surface.
enum class PartPlace {
    shell,   // around it, `size` mm thick
    rim,     // inside it, `size` mm thick
    core,    // inside it, the same shape at `size` of its radius
    debris,  // inside it, the lowest `size` of its height
    septa,   // inside it, `size` sheets of 1 mm
    gas,     // inside it, `size` bubbles of 2 mm at its top
};

struct LesionPart {
    std::string name;  // the label is NAME_part
    PartPlace place;
    double size;
    Tissue tissue;
};

struct PathologyKind {
    std::string name;
    LesionShape shape = LesionShape::ellipsoid;
    bool settles = false;  // lies lowest in its host, as a stone does
    double elongation = 1.3, roughness = 0.1, aspect = 1;  // aspect: of the long axis
    Tissue tissue;
    std::vector<LesionPart> parts;
    std::string about;
};

std::span<const PathologyKind> pathology_kinds();
const PathologyKind* find_pathology_kind(std::string_view name);  // null: none of that name
std::vector<std::string> pathology_kind_names();

// True for the kinds that a player can draw anew in each attempt: soft or fluid ellipsoids whose
// parts are shells and cores of soft tissue.
bool drawn_per_attempt(const PathologyKind& kind);
std::vector<std::string> kinds_drawn_per_attempt();  // their names

}  // namespace sonocase
