// SPDX-License-Identifier: Apache-2.0

// Draws the poses of a data set's frames. Frame n of a seed is the same whatever was drawn before
// it, on any machine: additions, multiplications and square roots alone.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/random.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/engine/skin.h"
#include "runtime/imaging/renderer.h"
#include "runtime/player/headless/dataset_recipe.h"

namespace sonocase::runtime::inline player_headless {

// The stream of random numbers that belongs to one place (a frame, a chunk) of one purpose.
class Draw : public RandomStream {
  public:
    Draw(std::uint64_t seed, std::uint64_t purpose, std::uint64_t place);
    double in(const Range& range) { return uniform(range.low, range.high); }
};

// sin(x) for |x| <= pi, to 1e-9, the same bits everywhere.
double plain_sine(double x);
double plain_cosine(double x);

// Triangles of the patient's skin with the sums of their areas, for an even draw.
struct SkinAreas {
    explicit SkinAreas(const Surface& skin);
    std::vector<double> sums;  // # triangles
};

struct DrawnFrame {
    FrameInput input;
    bool on_skin =
        false;  // false: no skin was found, and the probe stands where the exercise begins
};

// exercise: with the chunk's probe and needle. Cost: some thousand look-ups of the skin.
DrawnFrame draw_frame(const DatasetRecipe& recipe,
                      const CaseBundle& bundle,
                      const SkinAreas& areas,
                      const Exercise& exercise,
                      std::uint64_t seed,
                      std::uint64_t frame);

}  // namespace sonocase::runtime::inline player_headless
