// SPDX-License-Identifier: Apache-2.0

// Where the layers of the body wall run: two smooth distances on a coarse grid. They give sheets
// that the label volume does not show a place that belongs to the tissue.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime {

// What is known at a point: mm below the skin (negative outside), mm outside the organs (negative
// inside), and two noises of unit deviation: the wave of a sheet (correlated over 8 mm) and its
// strength (5 mm).
struct LayerPoint {
    double depth = 0, above_organs = 0, wave = 0, strength = 0;
};

// Distances are clamped to [-kLayerBandMm, kLayerFarMm].
inline constexpr double kLayerFarMm = 60, kLayerBandMm = 8;

class TissueLayers {
  public:
    bool empty() const { return cells_.empty(); }

    // Interpolates between the centres of cells of about 6 mm; takes the nearest cell beyond the
    // volume. Neither allocates nor throws. Cost: 15 ns.
    LayerPoint at(Point3 voxel) const noexcept;
    double depth_at(Point3 voxel) const noexcept;  // at().depth alone, for half the cost

    // What at() reads, for vectorised look-ups. Per cell, side by side: depth and above_organs in
    // 1 / kDistanceUnit mm, wave and strength in 1 / kNoiseUnit; x fastest.
    static constexpr double kDistanceUnit = 256, kNoiseUnit = 4096;
    const std::int16_t* cells() const { return cells_.front().data(); }
    Int3 size() const { return size_; }
    double cells_per_voxel() const { return cells_per_voxel_; }

  private:
    friend TissueLayers make_tissue_layers(const CaseBundle& bundle, JobRunner& jobs);

    // The lowest of the eight cells around a place, steps to the others, shares of the higher ones.
    struct Around {
        const std::array<std::int16_t, 4>* lowest;
        std::ptrdiff_t sx, sy, sz;
        float x, y, z;

        const std::array<std::int16_t, 4>& corner(int number) const {
            return lowest[(number & 1 ? sx : 0) + (number & 2 ? sy : 0) + (number & 4 ? sz : 0)];
        }
        static float share(int number, float x, float y, float z) {
            return (number & 1 ? x : 1 - x) * (number & 2 ? y : 1 - y) * (number & 4 ? z : 1 - z);
        }
    };
    Around around(Point3 voxel) const noexcept;

    Int3 size_{0, 0, 0};
    double cells_per_voxel_ = 1;
    std::vector<std::array<std::int16_t, 4>> cells_;
};

// Two surfaces are smoothed over 18 mm: the skin, and the hull of the organs (soft tissue that is
// not wall, bile, urine, gas and lung). Where they are plane, the distances are exact to about a
// millimetre and smooth along them. A bundle whose labels are all outside gives layers without
// depth. Cost: 25 ms for a torso.
TissueLayers make_tissue_layers(const CaseBundle& bundle, JobRunner& jobs);

}  // namespace sonocase::runtime
