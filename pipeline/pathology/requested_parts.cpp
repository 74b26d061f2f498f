// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/requested_parts.h"

#include <algorithm>

namespace sonocase::pipeline {

double part_size(const PathologyRequest& request, const LesionPart& part) {
    const auto given = request.parts.find(part.name);
    return given == request.parts.end() ? part.size : given->second;
}

std::vector<std::string> pathology_labels(const PathologyRequest& request) {
    std::vector<std::string> names{request.name};
    if (const PathologyKind* kind = find_pathology_kind(request.kind))
        for (const LesionPart& part : kind->parts)
            if (part_size(request, part) > 0) names.push_back(request.name + "_" + part.name);
    return names;
}

std::vector<Tissue> pathology_tissues(std::span<const PathologyRequest> requests) {
    std::vector<Tissue> needed;
    const auto add = [&](const Tissue& tissue) {
        const bool there = std::any_of(needed.begin(), needed.end(),
                                       [&](const Tissue& t) { return t.name == tissue.name; });
        if (!there) needed.push_back(tissue);
    };
    for (const PathologyRequest& request : requests) {
        const PathologyKind* kind = find_pathology_kind(request.kind);
        if (kind == nullptr) continue;
        if (request.tissue.empty()) add(kind->tissue);
        for (const LesionPart& part : kind->parts)
            if (part_size(request, part) > 0) add(part.tissue);
    }
    return needed;
}

}  // namespace sonocase::pipeline
