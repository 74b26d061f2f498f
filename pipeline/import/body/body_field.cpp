// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/body/body_field.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "pipeline/base/parallel.h"
#include "pipeline/segmentation/distance/marked_distance.h"

namespace sonocase::pipeline::inline import_body {
namespace {

// To the surface half a voxel before the nearest marked centre, mm; 0 at marked voxels.
std::vector<float> distances(const std::vector<std::uint8_t>& marked, const Grid& grid) {
    std::vector<float> all = distance_to_marked(marked, grid.size);
    const auto mm = static_cast<float>(grid.spacing_mm.x);
    for (float& d : all) d = d > 0 ? mm * (d - 0.5f) : 0;
    return all;
}

}  // namespace

BodyField::BodyField(LabelVolume& labels) : labels_(labels) {
    for (std::size_t l = 1; l < labels.labels.size(); ++l)
        if (labels.labels[l].name == "body") body_ = static_cast<std::uint8_t>(l);
}

std::uint8_t BodyField::make(const char* name, const char* tissue) {
    for (std::size_t l = 1; l < labels_.labels.size(); ++l)
        if (labels_.labels[l].name == name) return static_cast<std::uint8_t>(l);
    std::array<std::uint8_t, 3> colour{};
    std::uint32_t hash = 2166136261u;
    for (const char* c = name; *c; ++c) hash = (hash ^ static_cast<std::uint8_t>(*c)) * 16777619u;
    for (std::size_t c = 0; c < 3; ++c)
        colour[c] = static_cast<std::uint8_t>(90 + (hash >> (8 * c)) % 160);
    labels_.labels.push_back({name, tissue, static_cast<int>(labels_.labels.size()), colour});
    return static_cast<std::uint8_t>(labels_.labels.size() - 1);
}

LabelSet BodyField::with(std::initializer_list<std::string_view> words) const {
    LabelSet bits;
    for (std::size_t l = 1; l < labels_.labels.size(); ++l)
        for (const std::string_view word : words)
            if (labels_.labels[l].name.find(word) != std::string::npos) bits.set(l);
    return bits;
}

LabelSet BodyField::all() const {
    LabelSet bits;
    for (std::size_t l = 1; l < labels_.labels.size(); ++l) bits.set(l, l != body_);
    return bits;
}

std::vector<float> BodyField::distance_to(const LabelSet& labels) const {
    std::vector<std::uint8_t> marked(labels_.voxels.size());
    for (std::size_t n = 0; n < marked.size(); ++n) marked[n] = labels[labels_.voxels[n]];
    return distances(marked, grid());
}

std::vector<float> BodyField::distance_to(const std::vector<std::uint8_t>& marked) const {
    return distances(marked, grid());
}

void BodyField::for_slices(const std::function<void(int)>& slice) const {
    parallel_for(grid().size.z, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) slice(static_cast<int>(k));
    });
}

void BodyField::paint_tube(std::uint8_t label,
                           const std::vector<Point3>& path,
                           double radius_mm,
                           const LabelSet& give_way) {
    Box3 box;
    for (const Point3 p : path) {
        box.include(p + Vector3{radius_mm, radius_mm, radius_mm});
        box.include(p - Vector3{radius_mm, radius_mm, radius_mm});
    }
    const auto within = [&](Point3 p, std::size_t) {
        if (!box.contains(p)) return false;
        for (std::size_t n = 0; n + 1 < path.size(); ++n) {
            const Vector3 along = path[n + 1] - path[n];
            const double t =
                std::clamp(dot(p - path[n], along) / std::max(1e-9, dot(along, along)), 0.0, 1.0);
            if (norm(p - (path[n] + t * along)) <= radius_mm) return true;
        }
        return path.size() == 1 && distance(p, path[0]) <= radius_mm;
    };
    paint(label, within, give_way);
}

Box3 BodyField::box_of(const LabelSet& bits) const {
    Box3 box;
    for (int k = 0; k < grid().size.z; ++k)
        for (int j = 0; j < grid().size.y; ++j)
            for (int i = 0; i < grid().size.x; ++i)
                if (bits[labels_.voxels[grid().index(i, j, k)]]) box.include(point(i, j, k));
    return box;
}

Point3 BodyField::middle_of(const LabelSet& bits) const {
    Vector3 sum;
    double count = 0;
    for (int k = 0; k < grid().size.z; ++k)
        for (int j = 0; j < grid().size.y; ++j)
            for (int i = 0; i < grid().size.x; ++i)
                if (bits[labels_.voxels[grid().index(i, j, k)]]) {
                    sum = sum + (point(i, j, k) - Point3{});
                    ++count;
                }
    return Point3{} + (1 / std::max(1.0, count)) * sum;
}

const std::vector<BodyField::Outline>& BodyField::outlines() {
    if (!outlines_.empty()) return outlines_;
    outlines_.assign(grid().size.z, {NAN, NAN, NAN, NAN, NAN});
    for_slices([&](int k) {
        double left = 1e9, right = -1e9;
        for (int j = 0; j < grid().size.y; ++j)
            for (int i = 0; i < grid().size.x; ++i)
                if (labels_.voxels[grid().index(i, j, k)] != 0) {
                    left = std::min(left, point(i, j, k).x);
                    right = std::max(right, point(i, j, k).x);
                }
        if (right < left) return;
        Outline& out = outlines_[k];
        out = {0.5 * (left + right), NAN, NAN, right, left};
        const int i = std::clamp(
            static_cast<int>(std::lround((out.middle_x - grid().origin_mm.x) / voxel_mm())), 0,
            grid().size.x - 1);
        for (int j = 0; j < grid().size.y; ++j) {
            if (labels_.voxels[grid().index(i, j, k)] == 0) continue;
            if (std::isnan(out.back_y)) out.back_y = point(i, j, k).y;
            out.front_y = point(i, j, k).y;
        }
    });
    return outlines_;
}

}  // namespace sonocase::pipeline::inline import_body
