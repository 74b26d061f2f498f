// SPDX-License-Identifier: Apache-2.0

// What is fetched next of a case that arrives in segments: what the last picture lacked, then the
// blocks round the probe, then the rest.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime::inline web {

// Segments that follow each other, fetched by one request.
struct SegmentRun {
    std::uint32_t first = 0, count = 0;
    friend bool operator==(const SegmentRun&, const SegmentRun&) = default;
};

class LoadPlan {
  public:
    LoadPlan() = default;
    explicit LoadPlan(std::size_t segments) : asked_(segments, 0) {}

    // bundle: of stream_bundle_in_parts(). Returns runs in the order of the file, without the
    // segments that a run before had. What the last picture lacked comes at once; of the rest at
    // most `max_segments` segments. centre: a place of the picture, frame `mannequin`. Empty:
    // everything is there or asked for.
    std::vector<SegmentRun> next(const StreamedBundle& bundle,
                                 Point3 centre,
                                 std::size_t max_segments);
    // The run's segments did not all come: those that are missing will be given again.
    void ask_again(SegmentRun run);

  private:
    std::vector<std::uint8_t> asked_;  // of each segment
};

}  // namespace sonocase::runtime::inline web
