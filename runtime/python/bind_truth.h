// SPDX-License-Identifier: Apache-2.0

// The truth of frames as Python holds it.
#pragma once

#include <vector>

#include "array_values.h"
#include "formats/exercise/exercise.h"
#include "formats/volume/label_volume.h"
#include "runtime/imaging/truth/frame_truth.h"

namespace sonocase::python {

// Arrays for the planes of `count` frames, of shape (count, height, width), or (height, width)
// where count is 0. Named as TruthPlanes; those that are not asked for stay None.
struct TruthArrays {
    NewArray<std::uint8_t> labels, needle, shadowed, lesions;
    NewArray<float> skin_depth_mm, rest_mm;  // rest_mm: with an axis of 3 more

    // names: of planes; raises ValueError for another one.
    static TruthArrays make(const std::vector<std::string>& names,
                            py::ssize_t count,
                            py::ssize_t height,
                            py::ssize_t width);
    // The planes of frame n; area: pixels of a frame.
    runtime::TruthPlanes planes(std::size_t n, std::size_t area) const;
};

// What the probe does to the tissue; `vein_open` is None where there is no vein.
py::dict press_of(const runtime::PressReport& press);

// What is said about a frame as a whole.
py::dict facts_of(const runtime::FrameTruth& truth,
                  const std::vector<Label>& labels,
                  const Exercise& exercise);

}  // namespace sonocase::python
