// SPDX-License-Identifier: Apache-2.0

// Which poses of a recording rest on one point, before any of them is trusted: robust searches by
// random samples. Same poses and seed, same answer on every machine. Internal to
// formats/calibration.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/calibration/solve/pivot_system.h"

namespace sonocase::calibrate {

// Deterministic stream of indices, the same on every platform (splitmix64).
class IndexStream {
  public:
    explicit IndexStream(std::uint64_t seed) : state_(seed) {}
    std::size_t below(std::size_t count) {
        state_ += 0x9e3779b97f4a7c15ull;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
        z ^= z >> 31;
        return static_cast<std::size_t>(z % count);
    }

  private:
    std::uint64_t state_;
};

// Tip of the least-trimmed-squares fit: the one with the smallest mean square residual over the
// better half of the poses (random triples, then concentration steps). False if no triple
// determines a tip. Positions must be centred beforehand.
bool search_tip(std::span<const Pose> poses, int trials, std::uint64_t seed, Vector3* tip);

// Groups of successive poses, each resting on its own point, that share one tip; empty if none.
std::vector<PoseGroup> search_rests(std::span<const Pose> poses, std::uint64_t seed);

// Maximal runs of at least min_poses during which the tip stays within radius_mm of its mean.
std::vector<PoseGroup> runs_at_rest(std::span<const Pose> poses,
                                    Vector3 tip,
                                    double radius_mm,
                                    std::size_t min_poses);

}  // namespace sonocase::calibrate
