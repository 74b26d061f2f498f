// SPDX-License-Identifier: Apache-2.0

// The patches of one layer of bricks, for guessing at the next one from its neighbours; and how
// what is left of a coefficient is told. For the .cpp files of formats/ only.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/volume/surface_patch.h"

namespace sonocase::detail {

class PatchRows {
  public:
    // width, bricks: of a row and of the layer.
    PatchRows(std::size_t width, std::size_t bricks) : width_(width), first_(bricks + 1, 0) {}
    // Bricks come in order; every brick of the layer is told, with how many patches the layer has
    // up to its end.
    void close(std::size_t brick, std::size_t patches) {
        first_[brick + 1] = static_cast<std::uint32_t>(patches);
    }

    // By those of the brick to the left and of the one in front that part the same labels as
    // `patch`. known: the layer's patches so far.
    std::array<std::int16_t, kPatchCoefficients> guess(const SurfacePatch* known,
                                                       std::size_t brick,
                                                       const SurfacePatch& patch) const {
        SurfacePatch found[2]{};
        int count = 0;
        if (brick % width_ != 0) count += find(known, brick - 1, patch, 0, &found[count]);
        if (brick >= width_) count += find(known, brick - width_, patch, 1, &found[count]);
        if (count == 2) {
            for (std::size_t i = 0; i < kPatchCoefficients; ++i)
                found[0].c[i] = static_cast<std::int16_t>((found[0].c[i] + found[1].c[i]) >> 1);
        }
        return found[0].c;
    }

  private:
    int find(const SurfacePatch* patches,
             std::size_t brick,
             const SurfacePatch& patch,
             int axis,
             SurfacePatch* out) const {
        for (std::size_t p = first_[brick]; p < first_[brick + 1]; ++p) {
            if (patches[p].low != patch.low || patches[p].high != patch.high) continue;
            *out = continued(patches[p], axis);
            return 1;
        }
        return 0;
    }
    std::size_t width_;
    std::vector<std::uint32_t> first_;  // # bricks of the layer + 1
};

// Small numbers of either sign as small numbers.
inline std::uint16_t folded(std::int16_t v) {
    return static_cast<std::uint16_t>(v < 0 ? -2 * v - 1 : 2 * v);
}
inline std::int16_t unfolded(std::uint16_t v) {
    return static_cast<std::int16_t>(v & 1 ? -(v / 2) - 1 : v / 2);
}

}  // namespace sonocase::detail
