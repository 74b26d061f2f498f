// SPDX-License-Identifier: Apache-2.0

// The kinds of pathology: shape, parts, and the acoustic figures of each with their source.
//
// docs/pathology.md shows every kind in both image models. "(a)" in a source marks an assumption.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/volume/tissue.h"
#include "pipeline/pathology/pathology.h"

namespace sonocase::pipeline {

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

// The tissues that these requests need and that the table lacks, once each.
std::vector<Tissue> pathology_tissues(std::span<const PathologyRequest> requests);

// Thickness, count or share of a part: the request's, else the kind's. 0: the part is left out.
double part_size(const PathologyRequest& request, const LesionPart& part);

}  // namespace sonocase::pipeline
