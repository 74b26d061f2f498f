// SPDX-License-Identifier: Apache-2.0

// One chunk of a data set: frames that share a case, an exercise, a machine, a depth and a needle.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "runtime/player/dataset/dataset_recipe.h"
#include "runtime/player/dataset/frame_draw.h"
#include "runtime/player/session/open_case.h"

namespace sonocase::runtime {

struct DatasetPlan {
    DatasetRecipe recipe;
    std::string folder;  // of the data set
    std::uint64_t seed = 1;
    std::uint64_t frames = 0;

    std::uint64_t chunks() const {
        const auto size = static_cast<std::uint64_t>(recipe.chunk);
        return (frames + size - 1) / size;
    }
    std::uint64_t first(std::uint64_t chunk) const {
        return chunk * static_cast<std::uint64_t>(recipe.chunk);
    }
    std::uint64_t last(std::uint64_t chunk) const {  // one beyond
        const std::uint64_t end = first(chunk) + static_cast<std::uint64_t>(recipe.chunk);
        return end < frames ? end : frames;
    }
    // Cases take turns.
    std::size_t case_of(std::uint64_t chunk) const {
        return static_cast<std::size_t>(chunk % recipe.cases.size());
    }
    std::string records_path(std::uint64_t chunk) const;
};

// A case of the recipe, opened.
struct DatasetSource {
    DatasetCase of;
    std::unique_ptr<OpenCase> open;
    std::unique_ptr<SkinAreas> areas;
};

// Renders a chunk and writes its files, its records last: where they are, the chunk is whole.
Status make_chunk(const DatasetPlan& plan, const DatasetSource& source, std::uint64_t chunk);

}  // namespace sonocase::runtime
