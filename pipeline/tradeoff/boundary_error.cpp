// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/boundary_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "formats/volume/boundary_record.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline tradeoff {

std::uint8_t label_at_point(const LabelVolume& volume,
                            const BrickVolume<std::uint32_t>& boundary,
                            Point3 point) {
    const Point3 v = volume.grid.voxel_from_point(point);
    const int i = static_cast<int>(std::lround(v.x)), j = static_cast<int>(std::lround(v.y)),
              k = static_cast<int>(std::lround(v.z));
    if (!volume.grid.contains(i, j, k)) return 0;
    const std::uint8_t own = volume.voxels[volume.grid.index(i, j, k)];
    if (boundary.table.empty()) return own;
    const std::uint32_t packed = boundary.at(i, j, k);
    if (packed == kNoBoundary) return own;
    const BoundaryRecord record = unpack_boundary(packed);
    const double d = record.distance_vx + dot(record.normal, Vector3{v.x - i, v.y - j, v.z - k});
    return d >= 0 ? own : record.second_label;
}

BoundaryError measure_boundary_error(const LabelVolume& cooked,
                                     const BrickVolume<std::uint32_t>& boundary,
                                     const Registration& truth,
                                     const AnalyticBody& body,
                                     int points,
                                     const Box3* within) {
    // The cooked palette may have fewer labels or another order: labels are compared by name.
    const std::vector<Label> palette = analytic_torso_labels();
    std::map<std::string, int> analytic_index;
    for (std::size_t i = 0; i < palette.size(); ++i)
        analytic_index[palette[i].name] = static_cast<int>(i);
    std::vector<int> analytic_of(cooked.labels.size(), -1);
    for (std::size_t i = 0; i < cooked.labels.size(); ++i) {
        const auto found = analytic_index.find(cooked.labels[i].name);
        if (found != analytic_index.end()) analytic_of[i] = found->second;
    }
    if (!analytic_of.empty()) analytic_of[0] = 0;

    constexpr double kSegmentMm = 0.5;
    struct Tally {
        std::size_t all = 0, inside = 0, wrong = 0, crossings = 0;
    };
    // One tally and one random engine per block of points: the same for any number of threads.
    constexpr int kBlock = 2000;
    std::vector<Tally> tallies((points + kBlock - 1) / kBlock);
    const Box3 box = truth.ct_box;
    parallel_for(tallies.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
            std::mt19937_64 engine(977 + b);
            const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
            Tally& tally = tallies[b];
            for (int n = 0; n < kBlock; ++n) {
                const double ux = uniform(), uy = uniform(), uz = uniform();
                const Vector3 e = box.extent();
                const Point3 ct = box.lower + Vector3{ux * e.x, uy * e.y, uz * e.z};
                const double cosine = 2 * uniform() - 1, angle = 6.283185307179586 * uniform();
                const double sine = std::sqrt(1 - cosine * cosine);
                const Point3 place = mannequin_from_ct(truth, ct);
                if (within != nullptr && !within->contains(place)) continue;
                ++tally.all;
                const int here = analytic_torso_label(ct, body);
                const Vector3 step =
                    kSegmentMm * Vector3{sine * std::cos(angle), sine * std::sin(angle), cosine};
                tally.crossings += analytic_torso_label(ct + step, body) != here;
                const int seen = label_at_point(cooked, boundary, place);
                tally.inside += here != 0;
                tally.wrong += analytic_of[seen] != here;
            }
        }
    });
    Tally sum;
    for (const Tally& t : tallies) {
        sum.all += t.all;
        sum.inside += t.inside;
        sum.wrong += t.wrong;
        sum.crossings += t.crossings;
    }
    const double count = static_cast<double>(std::max<std::size_t>(sum.all, 1));
    const double area_per_mm3 = 2 * static_cast<double>(sum.crossings) / count / kSegmentMm;
    BoundaryError error;
    error.wrong_share =
        static_cast<double>(sum.wrong) / static_cast<double>(std::max<std::size_t>(sum.inside, 1));
    error.displaced_mm = static_cast<double>(sum.wrong) / count / area_per_mm3;
    std::array<bool, 256> present{};
    for (const std::uint8_t v : cooked.voxels) present[v] = true;
    for (std::size_t i = 1; i < cooked.labels.size(); ++i) error.lost_labels += !present[i];
    return error;
}

BoundaryError measure_boundary_error(const CaseBundle& bundle, const AnalyticInput& torso) {
    const LabelVolume cooked{bundle.grid, dense_from_bricks(bundle.label_bricks), bundle.labels};
    return measure_boundary_error(cooked, bundle.boundary,
                                  analytic_torso_truth(torso.mannequin.strength, torso.body),
                                  torso.body);
}

}  // namespace sonocase::pipeline::inline tradeoff
