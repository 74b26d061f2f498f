// SPDX-License-Identifier: Apache-2.0

// Samples a label field at single points: the label there, and the boundary record of the surface
// near it. Internal to sampled_field.cpp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "formats/volume/boundary_record.h"
#include "pipeline/segmentation/field/label_field.h"

namespace sonocase::pipeline {

struct TopTwo {                         // the two best labels at a point
    std::size_t first = 0, second = 0;  // indices of candidates
    float gap = 1e9f;                   // score of the second minus that of the first
};

inline TopTwo top_two(const float* score, std::size_t count) {
    TopTwo top;
    float best = 1e30f, next = 1e30f;
    for (std::size_t i = 0; i < count; ++i) {
        if (score[i] < best) {
            next = best;
            top.second = top.first;
            best = score[i];
            top.first = i;
        } else if (score[i] < next) {
            next = score[i];
            top.second = i;
        }
    }
    top.gap = next - best;
    return top;
}

// Label and packed boundary record of a voxel of the grid.
struct VoxelSample {
    std::uint8_t label = 0;
    std::uint32_t record = kNoBoundary;
};

// Samples voxels; holds what is the same for all of them.
class VoxelReader {
  public:
    // Largest size of a voxel of the grid in the field's frame, mm: maps stretch by less than 1.5.
    static float stretched_mm(const Grid& grid) {
        return static_cast<float>(1.5 * grid.spacing_mm.x);
    }
    // Largest distance there, mm, of a surface within the band.
    static float reach_mm(double band_vx, const Grid& grid) {
        return static_cast<float>(band_vx) * stretched_mm(grid);
    }

    VoxelReader(const LabelField& field, const Grid& grid, double band_vx)
        : field_(field),
          nodes_(field.nodes()),
          band_vx_(band_vx),
          flat_(0.2 * grid.spacing_mm.x),
          stretched_mm_(stretched_mm(grid)),
          reach_mm_(reach_mm(band_vx, grid)) {
        for (int a = 0; a < 3; ++a) {
            const auto u = static_cast<std::size_t>(a);
            h_[u] = static_cast<float>(nodes_.spacing_mm[a]);
            last_[u] = static_cast<float>(nodes_.size[a] - 1);
            rim_[u] = 0.5f * static_cast<float>(a == 2 ? field.factor() : 1) + 1e-3f;
        }
    }

    // Nodes along k from the first voxel of a brick up to which the reader looks for the others:
    // the diagonal of the brick, the band and what lies behind the foot.
    float reach_nodes(double band_vx) const {
        return (5.2f + static_cast<float>(band_vx) + 0.5f + static_cast<float>(kBeyond_vx)) *
                   stretched_mm_ / h_[2] +
               2;
    }

    // Whether a point in node coordinates lies more than half a voxel outside the label map, where
    // the map holds no information.
    bool beyond(const float* v) const {
        bool out_of = false;
        for (std::size_t a = 0; a < 3; ++a)
            out_of = out_of || v[a] < -rim_[a] || v[a] > last_[a] + rim_[a];
        return out_of;
    }

    // v        point in node coordinates
    // slope()  d(node) / d(voxel of the grid) there; called only near surfaces
    template <class Slope>
    VoxelSample operator()(const float* v, const Slope& slope) const {
        std::array<int, 3> near;
        float apart_sq = 0;
        for (std::size_t a = 0; a < 3; ++a) {
            near[a] = static_cast<int>(std::clamp(v[a] + 0.5f, 0.0f, last_[a]));
            const float d = h_[a] * (v[a] - static_cast<float>(near[a]));
            apart_sq += d * d;
        }
        const std::size_t node = nodes_.index(near[0], near[1], near[2]);
        const float spare = field_.node_margin_mm(node) - reach_mm_;
        if (spare > 0 && spare * spare > apart_sq) return {field_.node_label(node)};

        const LabelField::Position at = field_.locate(v[0], v[1], v[2]);
        if (at.candidates == nullptr) return {at.block->labels[0]};
        std::array<float, 256> score;
        field_.scores(at, score.data());
        const auto& labels = at.candidates->labels;
        const TopTwo top = top_two(score.data(), labels.size());
        const std::uint8_t own = labels[top.first], second = labels[top.second];
        VoxelSample sample{own};
        if (band_vx_ <= 0 || top.gap > reach_mm_ * field_.slope(own, second)) return sample;
        const Matrix3& m = slope();
        BoundaryRecord record{second};
        if (!find_plane(at, v, m, own, &record)) return sample;
        if (third_may_lie_beyond(at, score.data(), top, record.distance_vx)) {
            // Scores tie where three labels meet: the second label is the one beyond the surface.
            const std::uint8_t other = winner(foot(v, m, record, kBeyond_vx), score.data());
            if (other != own && other != second && holds(at, other)) {
                record.second_label = other;
                if (!find_plane(at, v, m, own, &record)) return sample;
            }
        }
        record.distance_vx = std::max(record.distance_vx, 0.0);
        sample.record = pack_boundary(record);
        return sample;
    }

  private:
    static constexpr double kBeyond_vx = 0.3;

    static std::size_t place(const LabelField::Position& at, std::uint8_t label) {
        const auto& labels = at.candidates->labels;
        return static_cast<std::size_t>(std::find(labels.begin(), labels.end(), label) -
                                        labels.begin());
    }
    static bool holds(const LabelField::Position& at, std::uint8_t label) {
        return place(at, label) < at.candidates->labels.size();
    }

    // Whether a third label can be better than the second on the other side of the surface.
    bool third_may_lie_beyond(const LabelField::Position& at,
                              const float* score,
                              const TopTwo& top,
                              double distance_vx) const {
        const auto path_mm =
            static_cast<float>(std::max(distance_vx, 0.0) + kBeyond_vx) * stretched_mm_;
        const auto& labels = at.candidates->labels;
        for (std::size_t c = 0; c < labels.size(); ++c) {
            if (c == top.first || c == top.second) continue;
            if (score[c] - score[top.second] <=
                path_mm * field_.slope(labels[top.second], labels[c]))
                return true;
        }
        return false;
    }

    std::uint8_t winner(const LabelField::Position& at, float* score) const {
        if (at.candidates == nullptr) return at.block->labels[0];
        field_.scores(at, score);
        return at.candidates->labels[top_two(score, at.candidates->labels.size()).first];
    }

    // The point `more` voxels behind the foot of a plane.
    LabelField::Position foot(const float* v,
                              const Matrix3& m,
                              const BoundaryRecord& r,
                              double more) const {
        const Vector3 back = m * ((r.distance_vx + more) * r.normal);
        return field_.locate(v[0] - static_cast<float>(back.x), v[1] - static_cast<float>(back.y),
                             v[2] - static_cast<float>(back.z));
    }

    // f of LabelField::difference, which is zero on the surface between the two labels, and its
    // gradient per voxel of the grid.
    double difference(const LabelField::Position& at,
                      const Matrix3& m,
                      std::uint8_t own,
                      std::uint8_t second,
                      Vector3* gradient) const {
        const auto n = field_.difference(at, place(at, own), place(at, second));
        for (int b = 0; b < 3; ++b)
            (*gradient)[b] = n[0] * m(0, b) + n[1] * m(1, b) + n[2] * m(2, b);
        return n[3];
    }

    // Plane of the surface to record->second_label, from f and its gradient at the voxel, improved
    // once at the foot of that plane, because f is curved near thin structures. False: no surface
    // within the band.
    bool find_plane(const LabelField::Position& at,
                    const float* v,
                    const Matrix3& m,
                    std::uint8_t own,
                    BoundaryRecord* record) const {
        Vector3 g;
        const double f = difference(at, m, own, record->second_label, &g);
        const double slope_vx = norm(g);
        // Scores separate by at least 1 mm per mm; much less means that no surface is near.
        if (!(slope_vx > flat_)) return false;
        record->distance_vx = f / slope_vx;
        if (record->distance_vx > band_vx_ + 0.5) return false;
        record->normal = g / slope_vx;
        const LabelField::Position there = foot(v, m, *record, 0);
        if (there.candidates != nullptr && holds(there, own) &&
            holds(there, record->second_label)) {
            Vector3 g2;
            const double f2 = difference(there, m, own, record->second_label, &g2);
            const double slope2_vx = norm(g2);
            if (slope2_vx > 0.5 * slope_vx) {
                record->distance_vx += std::clamp(f2 / slope2_vx, -0.5, 0.5);
                record->normal = g2 / slope2_vx;
            }
        }
        return record->distance_vx <= band_vx_;
    }

    const LabelField& field_;
    const Grid& nodes_;
    double band_vx_;
    double flat_;  // gradients of f, per voxel of the grid, up to which no surface is near
    float stretched_mm_, reach_mm_;
    std::array<float, 3> h_, last_, rim_;
};

}  // namespace sonocase::pipeline
