// SPDX-License-Identifier: Apache-2.0

// sonoplay dataset RECIPE.toml -o DIR --frames N [--seed S] [--shard I/N]
#pragma once

namespace sonocase::runtime {

// argv[0]: "sonoplay dataset". Returns the exit status: 0 done, 1 failed with one line, 2 wrong
// usage.
int run_dataset_command(int argc, char** argv);

}  // namespace sonocase::runtime
