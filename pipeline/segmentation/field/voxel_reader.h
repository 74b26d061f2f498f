// SPDX-License-Identifier: Apache-2.0

// Reads a label field at single points: the label there, and the boundary record of the surface
// near it. Internal to sample_label_field.cpp.
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
    std::size_t first = 0, second = 0;  // of the contest
    float gap = 1e9f;                   // score of the second less that of the first
};

inline TopTwo standing_of(const float* score, std::size_t count) {
    TopTwo c;
    float best = 1e30f, next = 1e30f;
    for (std::size_t i = 0; i < count; ++i) {
        if (score[i] < best) {
            next = best;
            c.second = c.first;
            best = score[i];
            c.first = i;
        } else if (score[i] < next) {
            next = score[i];
            c.second = i;
        }
    }
    c.gap = next - best;
    return c;
}

// What a voxel of the grid comes to.
struct VoxelRead {
    std::uint8_t label = 0;
    std::uint32_t record = kNoBoundary;
};

// Reads single voxels: all that does not change from one to the next.
class VoxelReader {
  public:
    // A voxel of the grid in the field's frame, mm, at most: maps stretch by less than 1.5.
    static float stretched_mm(const Grid& grid) {
        return static_cast<float>(1.5 * grid.spacing_mm.x);
    }
    // How far a surface within the band may be there.
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

    // The map says nothing further out than half a voxel beyond its last ones.
    bool beyond(const float* v) const {
        bool out_of = false;
        for (std::size_t a = 0; a < 3; ++a)
            out_of = out_of || v[a] < -rim_[a] || v[a] > last_[a] + rim_[a];
        return out_of;
    }

    // At a place of the nodes. slope(): d(node) / d(voxel of the grid) there, asked for near
    // surfaces alone.
    template <class Slope>
    VoxelRead operator()(const float* v, const Slope& slope) const {
        std::array<int, 3> near;
        float apart = 0;  // squared
        for (std::size_t a = 0; a < 3; ++a) {
            near[a] = static_cast<int>(std::clamp(v[a] + 0.5f, 0.0f, last_[a]));
            const float d = h_[a] * (v[a] - static_cast<float>(near[a]));
            apart += d * d;
        }
        const std::size_t node = nodes_.index(near[0], near[1], near[2]);
        const float spare = field_.node_margin_mm(node) - reach_mm_;
        if (spare > 0 && spare * spare > apart) return {field_.node_label(node)};

        const LabelField::Position at = field_.locate(v[0], v[1], v[2]);
        if (at.contest == nullptr) return {at.block->labels[0]};
        std::array<float, 256> score;
        field_.scores(at, score.data());
        const auto& labels = at.contest->labels;
        const TopTwo standing = standing_of(score.data(), labels.size());
        const std::uint8_t own = labels[standing.first], second = labels[standing.second];
        VoxelRead read{own};
        if (band_vx_ <= 0 || standing.gap > reach_mm_ * field_.slope(own, second)) return read;
        const Matrix3& m = slope();
        BoundaryRecord record{second};
        if (!find_plane(at, v, m, own, &record)) return read;
        if (third_may_lie_beyond(at, score.data(), standing, record.distance_vx)) {
            // Labels tie where they meet: the second is whoever lies beyond.
            const std::uint8_t other = winner(foot(v, m, record, kBeyond_vx), score.data());
            if (other != own && other != second && holds(at, other)) {
                record.second_label = other;
                if (!find_plane(at, v, m, own, &record)) return read;
            }
        }
        record.distance_vx = std::max(record.distance_vx, 0.0);
        read.record = pack_boundary(record);
        return read;
    }

  private:
    static constexpr double kBeyond_vx = 0.3;

    static std::size_t place(const LabelField::Position& at, std::uint8_t label) {
        const auto& labels = at.contest->labels;
        return static_cast<std::size_t>(std::find(labels.begin(), labels.end(), label) -
                                        labels.begin());
    }
    static bool holds(const LabelField::Position& at, std::uint8_t label) {
        return place(at, label) < at.contest->labels.size();
    }

    // Whether a third label can overtake the second on the way to the surface's other side.
    bool third_may_lie_beyond(const LabelField::Position& at,
                              const float* score,
                              const TopTwo& standing,
                              double distance_vx) const {
        const auto way_mm =
            static_cast<float>(std::max(distance_vx, 0.0) + kBeyond_vx) * stretched_mm_;
        const auto& labels = at.contest->labels;
        for (std::size_t c = 0; c < labels.size(); ++c) {
            if (c == standing.first || c == standing.second) continue;
            if (score[c] - score[standing.second] <=
                way_mm * field_.slope(labels[standing.second], labels[c]))
                return true;
        }
        return false;
    }

    std::uint8_t winner(const LabelField::Position& at, float* score) const {
        if (at.contest == nullptr) return at.block->labels[0];
        field_.scores(at, score);
        return at.contest->labels[standing_of(score, at.contest->labels.size()).first];
    }

    // The place `more` voxels behind the foot of a plane.
    LabelField::Position foot(const float* v,
                              const Matrix3& m,
                              const BoundaryRecord& r,
                              double more) const {
        const Vector3 back = m * ((r.distance_vx + more) * r.normal);
        return field_.locate(v[0] - static_cast<float>(back.x), v[1] - static_cast<float>(back.y),
                             v[2] - static_cast<float>(back.z));
    }

    // f, which is zero on the surface of the two labels (LabelField::difference), and its gradient
    // per voxel of the grid.
    double rise(const LabelField::Position& at,
                const Matrix3& m,
                std::uint8_t own,
                std::uint8_t second,
                Vector3* gradient) const {
        const auto n = field_.difference(at, place(at, own), place(at, second));
        for (int b = 0; b < 3; ++b)
            (*gradient)[b] = n[0] * m(0, b) + n[1] * m(1, b) + n[2] * m(2, b);
        return n[3];
    }

    // The plane to record->second_label: by f and its gradient at the voxel; then once more at the
    // foot of the plane found, because f bends near thin structures. False: none within the band.
    bool find_plane(const LabelField::Position& at,
                    const float* v,
                    const Matrix3& m,
                    std::uint8_t own,
                    BoundaryRecord* record) const {
        Vector3 g;
        const double f = rise(at, m, own, record->second_label, &g);
        const double steep = norm(g);
        // The scores part by at least 1 mm a mm; much less means no surface here.
        if (!(steep > flat_)) return false;
        record->distance_vx = f / steep;
        if (record->distance_vx > band_vx_ + 0.5) return false;
        record->normal = g / steep;
        const LabelField::Position there = foot(v, m, *record, 0);
        if (there.contest != nullptr && holds(there, own) && holds(there, record->second_label)) {
            Vector3 g2;
            const double f2 = rise(there, m, own, record->second_label, &g2);
            const double steep2 = norm(g2);
            if (steep2 > 0.5 * steep) {
                record->distance_vx += std::clamp(f2 / steep2, -0.5, 0.5);
                record->normal = g2 / steep2;
            }
        }
        return record->distance_vx <= band_vx_;
    }

    const LabelField& field_;
    const Grid& nodes_;
    double band_vx_;
    double flat_;  // slopes of f per voxel of the grid that are none
    float stretched_mm_, reach_mm_;
    std::array<float, 3> h_, last_, rim_;
};

}  // namespace sonocase::pipeline
