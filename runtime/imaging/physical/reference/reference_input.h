// SPDX-License-Identifier: Apache-2.0

// What all steps of the reference renderer read.
#pragma once

#include "runtime/imaging/physical/model/physical_frame.h"

namespace sonocase::runtime {

struct ReferenceInput {
    const PhysicalScene& scene;
    const ScanGeometry& geometry;
    const physical::Tables& tables;
    const PhysicalNoise& noise;
    const PhysicalFrame& frame;

    // Sample k of beam l in a plane of # samples x scanlines, row by row.
    std::size_t at(int k, int l) const {
        return static_cast<std::size_t>(k) * geometry.scanlines + l;
    }
    std::size_t count() const {
        return static_cast<std::size_t>(geometry.samples) * geometry.scanlines;
    }
    const physical::Row& row(int k) const { return tables.rows[k]; }

    // Noise of unit deviation for beam l in a row of a tile. number: the frame's; 0 where the noise
    // belongs to the scene and not to the frame.
    double draw(const std::vector<std::int8_t>& tile,
                NoiseUse use,
                std::uint32_t number,
                int k,
                int l) const {
        return tile[noise_start(frame.seed, use, number, k) + static_cast<std::uint32_t>(l)] / 32.0;
    }
};

}  // namespace sonocase::runtime
