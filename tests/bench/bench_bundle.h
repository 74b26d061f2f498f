// SPDX-License-Identifier: Apache-2.0

// The case that the frame benchmarks render, and a probe that jumps over it.
#pragma once

#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::bench {

// The bundle named by the environment variable SONOCASE_BENCH_BUNDLE; without it
// scenarios/real-torso cooked from the shared data at its own voxel size; without that data the
// analytic torso. Made once.
const CaseBundle& bench_bundle();
const std::string& bench_bundle_name();

// Probe poses on the skin, all round the front and flanks, each aimed at the middle of the body
// with a random turn: neighbours in the list lie far apart, so that no frame finds its data in
// cache.
const std::vector<Rigid>& bench_poses();

}  // namespace sonocase::bench
