// SPDX-License-Identifier: Apache-2.0

// Finds printed tags in a grey picture with libapriltag, and refines their corners.
//
// The library is opened when the first detector is made, so that a player that follows another
// tracker needs neither it nor its memory. One detector serves one thread. No files, no clock.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/markers/tag_fit.h"

namespace sonocase {

struct TagFindings {
    std::vector<SeenTag> tags;  // by id; each id once
    std::vector<int> twice;     // ids that were seen in two places, which are left out of `tags`
    int unrefined = 0;  // tags that were read but could not be laid over the picture: left out
};

class TagDetector {
  public:
    // Error: the library is not installed.
    static Result<TagDetector> create();
    TagDetector(TagDetector&&) noexcept;
    TagDetector& operator=(TagDetector&&) noexcept;
    ~TagDetector();

    // The whole picture, quads on every second pixel. Cost: 4 to 8 ms for 1280 x 720.
    TagFindings find(const GreyPicture& picture);
    // The number of tags that are seen once the picture is mirrored: a camera that shows its user
    // as a mirror does.
    int count_mirrored(const GreyPicture& picture);

  private:
    struct State;
    explicit TagDetector(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace sonocase
