// SPDX-License-Identifier: Apache-2.0

// Labels of a cooked volume against the truth at every voxel.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/segmentation/cooked_grid.h"

namespace sonocase::pipeline::testing {

inline constexpr std::uint8_t kNoTruth = 255;

// `label_at` at the preimage of each voxel of `grid`; kNoTruth where that is outside the CT.
inline std::vector<std::uint8_t> truth_on(const Grid& grid,
                                          const Registration& registration,
                                          const Grid& ct_grid,
                                          const std::function<std::uint8_t(Point3)>& label_at) {
    const InverseMap inverse_map(with_voxel_rim(registration, ct_grid));
    std::vector<std::uint8_t> truth(grid.voxel_count(), kNoTruth);
    parallel_for(static_cast<std::size_t>(grid.size.z), 1, [&](std::size_t begin, std::size_t end) {
        const auto nx = static_cast<std::size_t>(grid.size.x);
        std::vector<float> x(nx), y(nx), z(nx);
        std::vector<MapStatus> status(nx);
        for (std::size_t k = begin; k < end; ++k) {
            for (int j = 0; j < grid.size.y; ++j) {
                const Point3 start =
                    grid.point_from_voxel({0, static_cast<double>(j), static_cast<double>(k)});
                inverse_map.invert_row(start, {grid.spacing_mm.x, 0, 0}, grid.size.x, x.data(),
                                       y.data(), z.data(), status.data());
                const std::size_t row = grid.index(0, j, static_cast<int>(k));
                for (std::size_t i = 0; i < nx; ++i) {
                    if (status[i] == MapStatus::ok) truth[row + i] = label_at({x[i], y[i], z[i]});
                }
            }
        }
    });
    return truth;
}

// Over the labels of the truth except outside (0); shares are fractions of 1.
struct LabelScore {
    double dice = 0;           // mean over labels
    double wrong = 0;          // voxels, of all that have a truth
    double volume_change = 0;  // mean over labels, absolute
    int lost = 0, labels = 0;
};

inline LabelScore score_labels(const LabelVolume& volume, const std::vector<std::uint8_t>& truth) {
    std::vector<double> ours(256), theirs(256), both(256);
    double wrong = 0, count = 0;
    for (std::size_t v = 0; v < truth.size(); ++v) {
        if (truth[v] == kNoTruth) continue;
        const std::uint8_t a = volume.voxels[v], b = truth[v];
        ours[a] += 1;
        theirs[b] += 1;
        (a == b ? both[a] : wrong) += 1;
        count += 1;
    }
    LabelScore score;
    for (std::size_t l = 1; l < kNoTruth; ++l) {
        if (theirs[l] == 0) continue;
        score.dice += 2 * both[l] / (ours[l] + theirs[l]);
        score.volume_change += std::abs(ours[l] / theirs[l] - 1);
        score.lost += ours[l] == 0;
        ++score.labels;
    }
    score.dice /= score.labels;
    score.volume_change /= score.labels;
    score.wrong = wrong / count;
    return score;
}

}  // namespace sonocase::pipeline::testing
