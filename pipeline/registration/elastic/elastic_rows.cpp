// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/elastic/elastic_rows.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/elastic/elastic_strain.h"
#include "pipeline/registration/fit/matching.h"

namespace sonocase::pipeline::inline registration_elastic {

namespace {

constexpr int kNeighbours = 36;
constexpr double kSharpestCurvature = 1 / 40.0;  // per mm; a sharper patch is noise

}  // namespace

RimPatches::RimPatches(const TargetSurface& target, std::span<const std::uint32_t> readings)
    : target_(target), patch_of_(target.points.size(), -1) {
    std::vector<std::uint32_t> rim;
    for (const std::uint32_t j : readings) {
        if (!target.on_rim[j] || target.lifted[j]) continue;
        patch_of_[j] = static_cast<std::int32_t>(rim.size());
        rim.push_back(j);
    }
    patches_.resize(rim.size());
    parallel_for(rim.size(), 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const std::uint32_t j = rim[n];
            Patch& patch = patches_[n];
            patch.u = any_perpendicular(target.normals[j]);
            patch.v = cross(target.normals[j], patch.u);
            const auto near = target.index.nearest(target.points[j], kNeighbours);
            Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
            Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
            int used = 0;
            for (const std::uint32_t i : near) {
                if (target.lifted[i] || dot(target.normals[i], target.normals[j]) < 0.3) continue;
                const Vector3 d = target.points[i] - target.points[j];
                // Scaled by 30 mm, so that the columns are of one size.
                const double a = dot(d, patch.u) / kReachMm, b = dot(d, patch.v) / kReachMm;
                Eigen::Matrix<double, 6, 1> row;
                row << 1, a, b, a * a, a * b, b * b;
                const double w = 1 / (1 + a * a + b * b);
                normal += w * row * row.transpose();
                right += w * dot(d, target.normals[j]) * row;
                ++used;
            }
            if (used < 12) continue;
            // A little weight on small curvature keeps one-sided neighbourhoods determined.
            for (int m = 3; m < 6; ++m) normal(m, m) += 0.02;
            const Eigen::Matrix<double, 6, 1> c = normal.ldlt().solve(right);
            for (int m = 0; m < 6; ++m) {
                patch.c[m] = c[m] / (m == 0 ? 1 : m < 3 ? kReachMm : kReachMm * kReachMm);
            }
            patch.good = std::isfinite(c.sum()) &&
                         std::abs(patch.c[3]) + std::abs(patch.c[4]) + std::abs(patch.c[5]) <
                             kSharpestCurvature;
        }
    });
}

RimPatches::NearestPoint RimPatches::nearest_point(std::uint32_t reading, Point3 p) const {
    NearestPoint nearest;
    const std::int32_t n = patch_of_[reading];
    if (n < 0 || !patches_[n].good) return nearest;
    const Patch& patch = patches_[n];
    const Vector3 normal = target_.normals[reading], d = p - target_.points[reading];
    const double a = dot(d, patch.u), b = dot(d, patch.v);
    if (a * a + b * b > kReachMm * kReachMm) return nearest;
    const double* c = patch.c;
    const double height = c[0] + c[1] * a + c[2] * b + c[3] * a * a + c[4] * a * b + c[5] * b * b;
    const double slope_a = c[1] + 2 * c[3] * a + c[4] * b, slope_b = c[2] + c[4] * a + 2 * c[5] * b;
    nearest.normal = normalized(normal - (slope_a * patch.u + slope_b * patch.v));
    nearest.gap_mm = (dot(d, normal) - height) * dot(nearest.normal, normal);
    nearest.found = true;
    return nearest;
}

namespace {

constexpr double kEdgeMm = 8;
constexpr double kMinCosine = 0.3, kTableLossMm = 10;
constexpr std::size_t kBlocks = 4;  // of rows, each summed by itself: fixed, whatever the threads

Lanes lanes_of(Vector3 v) {
    return Lanes{static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), 0};
}

Vector3 vector_of(Lanes v) {
    return {static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])};
}

std::vector<std::uint8_t> points_near_edge(const SkinModel& skin) {
    std::vector<std::uint8_t> near(skin.on_rim);
    std::vector<Point3> edge;
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
        if (skin.on_rim[i]) edge.push_back(skin.points[i]);
    }
    if (edge.empty()) return near;
    const PointIndex index(edge);
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
        double d2 = 0;
        index.nearest(skin.points[i], &d2);
        if (d2 < kEdgeMm * kEdgeMm) near[i] = 1;
    }
    return near;
}

// A pair of points that may be counterparts.
struct Pair {
    std::uint32_t skin = 0, reading = 0;
    double gap_mm = 0;
    Vector3 normal;
    double weight = 1;
    bool found = false;
};

}  // namespace

ElasticRows::ElasticRows(const SkinModel& skin,
                         const TargetSurface& target,
                         std::vector<std::uint32_t> readings,
                         std::span<const Correspondence> landmarks,
                         double landmark_weight,
                         const DisplacementGrid& grid)
    : skin_(skin),
      target_(target),
      readings_(std::move(readings)),
      landmarks_(landmarks.begin(), landmarks.end()),
      landmark_weight_(landmark_weight),
      near_edge_(points_near_edge(skin)),
      rim_(target, readings_) {
    grid_.size = grid.size;
    grid_.origin_mm = grid.origin_mm;
    grid_.spacing_mm = grid.spacing_mm;
    for (int n = 0; n < 64; ++n) offset_[n] = footprint_offset(grid_, n);
}

void ElasticRows::add_row(
    std::uint32_t skin, Vector3 normal, double gap_mm, double weight, double loss_mm) {
    Row row;
    row.at = spline_footprint(grid_, skin_.origin + (skin_.points[skin] - Point3{}));
    row.normal = normal;
    row.gap_mm = gap_mm;
    row.weight = weight;
    row.loss_mm2 = loss_mm * loss_mm;
    const double root = std::sqrt(weight / (1 + gap_mm * gap_mm / row.loss_mm2));
    row.scaled = lanes_of(root * normal);
    rows_.push_back(row);
}

void ElasticRows::match(const Registration& map, const GapOptions& options) {
    const MappedSkin mapped = map_skin(skin_, target_.origin, map);
    const double farthest2 = options.farthest_mm * options.farthest_mm;
    const double loss_mm = options.loss_mm;
    std::vector<Pair> pairs(readings_.size());
    parallel_for(pairs.size(), 128, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const std::uint32_t j = readings_[n];
            double d2 = 0;
            const std::uint32_t i = mapped.index.nearest(target_.points[j], &d2);
            if (d2 > farthest2 || near_edge_[i]) continue;
            if (dot(mapped.normals[i], target_.normals[j]) < kMinCosine) continue;
            const double gap = dot(mapped.normals[i], mapped.points[i] - target_.points[j]);
            const double aside = std::sqrt(std::max(0.0, d2 - gap * gap));
            if (aside > std::max(8.0, 0.7 * std::abs(gap) + 4)) continue;
            pairs[n] = {i, j, gap, mapped.normals[i], 1, true};
        }
    });
    rows_.clear();
    const auto count = [&] {
        return std::max<double>(
            1, static_cast<double>(std::count_if(pairs.begin(), pairs.end(),
                                                 [](const Pair& p) { return p.found; })));
    };
    double weight = 1 / count();
    for (const Pair& p : pairs) {
        if (p.found) add_row(p.skin, p.normal, p.gap_mm, weight, loss_mm);
    }
    from_readings_ = rows_.size();
    pairs.assign((skin_.points.size() + options.skin_stride - 1) / options.skin_stride, {});
    parallel_for(pairs.size(), 128, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const auto i = static_cast<std::uint32_t>(n * options.skin_stride);
            if (near_edge_[i]) continue;
            double d2 = 0;
            const std::uint32_t j = target_.index.nearest(mapped.points[i], &d2);
            if (d2 > farthest2 || target_.lifted[j]) continue;
            if (dot(mapped.normals[i], target_.normals[j]) < kMinCosine) continue;
            const double gap = dot(target_.normals[j], mapped.points[i] - target_.points[j]);
            const double aside = std::sqrt(std::max(0.0, d2 - gap * gap));
            if (aside <= (target_.on_rim[j] ? 0.35 : 1.0) * 1.2 * target_.spacing_mm) {
                pairs[n] = {i, j, gap, target_.normals[j], 1, true};
                continue;
            }
            const RimPatches::NearestPoint nearest = rim_.nearest_point(j, mapped.points[i]);
            if (!nearest.found) continue;
            const double faded = 1 - aside / RimPatches::kReachMm;
            pairs[n] = {i, j, nearest.gap_mm, nearest.normal, options.rim_weight * faded, true};
        }
    });
    weight = options.skin_weight / count();
    for (const Pair& p : pairs) {
        if (p.found) add_row(p.skin, p.normal, p.gap_mm, weight * p.weight, loss_mm);
    }
    if (target_.table.found) {
        std::vector<std::uint8_t> matched(skin_.points.size(), 0);
        for (const Pair& p : pairs) matched[p.skin] |= p.found;
        add_table_rows(mapped, options, matched);
    }
    marks_.clear();
    for (const Correspondence& c : landmarks_) {
        const Point3 ct = skin_.origin + (c.skin - Point3{});
        const Point3 place = target_.origin + (c.place - Point3{});
        marks_.push_back({spline_footprint(grid_, ct), mannequin_from_ct(map, ct) - place, {}});
    }
}

// These rows are one-sided: nothing pulls the skin down to the table. The weight is that of a mean
// over all skin that faces it, so that the last few points behind it do not pull like a whole back.
void ElasticRows::add_table_rows(const MappedSkin& mapped,
                                 const GapOptions& options,
                                 const std::vector<std::uint8_t>& matched) {
    const Table& table = target_.table;
    std::vector<std::uint32_t> behind;
    std::size_t facing = 0;
    for (std::size_t i = 0; i < mapped.points.size(); i += options.skin_stride) {
        if (near_edge_[i] || dot(mapped.normals[i], table.normal) > -kMinCosine) continue;
        ++facing;
        if (!matched[i] && dot(table.normal, mapped.points[i] - table.place) < 0)
            behind.push_back(static_cast<std::uint32_t>(i));
    }
    for (const std::uint32_t i : behind) {
        add_row(i, table.normal, dot(table.normal, mapped.points[i] - table.place),
                options.table_weight / static_cast<double>(facing), kTableLossMm);
    }
}

void ElasticRows::project(std::span<const Lanes> along) {
    const auto at = [&](const SplineFootprint& f) {
        Lanes sum = kNoLanes;
        for (std::size_t w = 0; w < 64; ++w) sum += f.weight[w] * along[f.first + offset_[w]];
        return vector_of(sum);
    };
    for (Row& row : rows_) row.along_mm = dot(row.normal, at(row.at));
    for (Mark& mark : marks_) mark.along = at(mark.at);
}

double ElasticRows::energy(double step) const {
    double sum = 0;
    for (const Row& row : rows_) {
        const double scale2 = row.loss_mm2;
        const double gap = row.gap_mm + step * row.along_mm;
        sum += row.weight * scale2 * natural_log(1 + gap * gap / scale2);
    }
    for (const Mark& mark : marks_) {
        const Vector3 off = mark.offset + step * mark.along;
        sum += landmark_weight_ * dot(off, off);
    }
    return sum;
}

void ElasticRows::add_gradient(std::span<Lanes> gradient, std::span<Lanes> diagonal) const {
    for (const Row& row : rows_) {
        const double pull = row.weight * row.gap_mm / (1 + row.gap_mm * row.gap_mm / row.loss_mm2);
        const Lanes g = lanes_of(pull * row.normal);
        for (std::size_t w = 0; w < 64; ++w) {
            const float f = row.at.weight[w];
            gradient[row.at.first + offset_[w]] += f * g;
            diagonal[row.at.first + offset_[w]] += f * f * row.scaled * row.scaled;
        }
    }
    const float lm = static_cast<float>(landmark_weight_);
    for (const Mark& mark : marks_) {
        const Lanes g = lanes_of(landmark_weight_ * mark.offset);
        for (std::size_t w = 0; w < 64; ++w) {
            const float f = mark.at.weight[w];
            gradient[mark.at.first + offset_[w]] += f * g;
            diagonal[mark.at.first + offset_[w]] += f * f * lm * Lanes{1, 1, 1, 0};
        }
    }
}

void ElasticRows::add_curvature(std::span<const Lanes> in, std::span<Lanes> out) const {
    sums_.resize(kBlocks);
    parallel_for(kBlocks, 1, [&](std::size_t first, std::size_t last) {
        for (std::size_t block = first; block < last; ++block) {
            std::vector<Lanes>& sum = sums_[block];
            sum.assign(out.size(), kNoLanes);
            const std::size_t end = rows_.size() * (block + 1) / kBlocks;
            for (std::size_t n = rows_.size() * block / kBlocks; n < end; ++n) {
                const Row& row = rows_[n];
                const Lanes* from = in.data() + row.at.first;
                Lanes at = kNoLanes;
                for (std::size_t w = 0; w < 64; ++w) at += row.at.weight[w] * from[offset_[w]];
                const Lanes along = at * row.scaled;
                const Lanes push = ((along[0] + along[1]) + along[2]) * row.scaled;
                Lanes* to = sum.data() + row.at.first;
                for (std::size_t w = 0; w < 64; ++w) to[offset_[w]] += row.at.weight[w] * push;
            }
        }
    });
    for (const std::vector<Lanes>& sum : sums_) {
        for (std::size_t i = 0; i < out.size(); ++i) out[i] += sum[i];
    }
    const float lm = static_cast<float>(landmark_weight_);
    for (const Mark& mark : marks_) {
        Lanes at = kNoLanes;
        for (std::size_t w = 0; w < 64; ++w)
            at += mark.at.weight[w] * in[mark.at.first + offset_[w]];
        for (std::size_t w = 0; w < 64; ++w)
            out[mark.at.first + offset_[w]] += lm * mark.at.weight[w] * at;
    }
}

}  // namespace sonocase::pipeline::inline registration_elastic
