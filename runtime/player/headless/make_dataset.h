// SPDX-License-Identifier: Apache-2.0

// Whole data sets: frames at random poses with their truth, in any number of shards.
//
//     DIR/dataset.json        recipe, seed, cases with their palettes: written first
//     DIR/frames/*.png        format png: image_N, labels_N, needle_N, shadow_N, depth_N
//     DIR/arrays/*.npy        format npy: images_C and so on, one array per chunk
//     DIR/records/C.jsonl     one line per frame of chunk C, written when the chunk is whole
//     DIR/manifest.jsonl      all records, written by the shard that finds all chunks whole
//
// The same bytes for the same recipe and seed, whatever the shards and wherever they were
// interrupted: a run goes on with the chunks that have no records.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "formats/base/result.h"

namespace sonocase::runtime::inline player_headless {

struct DatasetArguments {
    std::string recipe;  // file
    std::string out;     // folder
    std::uint64_t frames = 0;
    std::uint64_t seed = 1;
    int shard = 1, shards = 1;  // this one, from 1, of so many
};

// progress: called after each chunk of this shard with how many of its chunks are done and how many
// there are. Errors: a recipe or a case that cannot be used, a folder that holds another data set,
// a file that cannot be written; nothing half-written is left.
Status make_dataset(const DatasetArguments& arguments,
                    const std::function<void(std::uint64_t, std::uint64_t)>& progress = {});

}  // namespace sonocase::runtime::inline player_headless
