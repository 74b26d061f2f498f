// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/structure_scene.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

struct Sums {
    std::int64_t count = 0;
    std::int64_t first[3] = {0, 0, 0};
    std::int64_t second[6] = {0, 0, 0, 0, 0, 0};  // xx yy zz xy xz yz
    Int3 lower{1 << 30, 1 << 30, 1 << 30}, upper{-1, -1, -1};
};

StructureRole role_of(const Tissue& tissue) {
    if (tissue.kind != TissueKind::soft) return StructureRole::none;
    if (tissue.name == "liver") return StructureRole::liver;
    if (tissue.name == "kidney_cortex") return StructureRole::kidney;
    if (tissue.name == "muscle") return StructureRole::muscle;
    if (tissue.name == "fat") return StructureRole::fat;
    if (tissue.name == "bowel") return StructureRole::bowel;
    return StructureRole::plain;
}

}  // namespace

std::vector<LabelFacts> label_facts(const LabelVolume& labels,
                                    const std::vector<const Tissue*>& tissue_of) {
    const Int3 size = labels.grid.size;
    const std::size_t palette = labels.labels.size();
    std::vector<std::vector<Sums>> slices(static_cast<std::size_t>(size.z));
    parallel_for(slices.size(), 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            std::vector<Sums>& sums = slices[k];
            sums.resize(palette);
            for (int j = 0; j < size.y; ++j) {
                const std::uint8_t* row =
                    labels.voxels.data() + labels.grid.index(0, j, static_cast<int>(k));
                for (int i = 0; i < size.x;) {  // runs of one label
                    int end_i = i + 1;
                    while (end_i < size.x && row[end_i] == row[i]) ++end_i;
                    if (row[i] != 0 && row[i] < palette) {
                        Sums& s = sums[row[i]];
                        const std::int64_t n = end_i - i, a = i, b = end_i - 1;
                        const std::int64_t x = (a + b) * n / 2;
                        const auto squares = [](std::int64_t m) {
                            return m * (m + 1) * (2 * m + 1) / 6;
                        };
                        const std::int64_t kk = static_cast<std::int64_t>(k);
                        s.count += n;
                        s.first[0] += x;
                        s.first[1] += n * j;
                        s.first[2] += n * kk;
                        s.second[0] += squares(b) - (a > 0 ? squares(a - 1) : 0);
                        s.second[1] += n * j * j;
                        s.second[2] += n * kk * kk;
                        s.second[3] += x * j;
                        s.second[4] += x * kk;
                        s.second[5] += n * j * kk;
                        s.lower = {std::min(s.lower.x, i), std::min(s.lower.y, j),
                                   std::min(s.lower.z, static_cast<int>(k))};
                        s.upper = {std::max(s.upper.x, end_i - 1), std::max(s.upper.y, j),
                                   std::max(s.upper.z, static_cast<int>(k))};
                    }
                    i = end_i;
                }
            }
        }
    });
    std::vector<LabelFacts> facts(palette);
    for (std::size_t l = 0; l < palette; ++l) {
        Sums t;
        for (const std::vector<Sums>& slice : slices) {
            const Sums& s = slice[l];
            t.count += s.count;
            for (int a = 0; a < 3; ++a) t.first[a] += s.first[a];
            for (int a = 0; a < 6; ++a) t.second[a] += s.second[a];
            t.lower = {std::min(t.lower.x, s.lower.x), std::min(t.lower.y, s.lower.y),
                       std::min(t.lower.z, s.lower.z)};
            t.upper = {std::max(t.upper.x, s.upper.x), std::max(t.upper.y, s.upper.y),
                       std::max(t.upper.z, s.upper.z)};
        }
        LabelFacts& f = facts[l];
        f.tissue = tissue_of[l];
        f.role = l == 0 ? StructureRole::none : role_of(*f.tissue);
        f.count = t.count;
        f.lower = t.lower;
        f.upper = t.upper;
        if (t.count == 0) {
            f.role = StructureRole::none;
            continue;
        }
        const auto n = static_cast<double>(t.count);
        const double m[3] = {static_cast<double>(t.first[0]) / n,
                             static_cast<double>(t.first[1]) / n,
                             static_cast<double>(t.first[2]) / n};
        f.mean = {m[0], m[1], m[2]};
        Eigen::Matrix3d c;
        c(0, 0) = static_cast<double>(t.second[0]) / n - m[0] * m[0];
        c(1, 1) = static_cast<double>(t.second[1]) / n - m[1] * m[1];
        c(2, 2) = static_cast<double>(t.second[2]) / n - m[2] * m[2];
        c(0, 1) = c(1, 0) = static_cast<double>(t.second[3]) / n - m[0] * m[1];
        c(0, 2) = c(2, 0) = static_cast<double>(t.second[4]) / n - m[0] * m[2];
        c(1, 2) = c(2, 1) = static_cast<double>(t.second[5]) / n - m[1] * m[2];
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(c);
        for (int a = 0; a < 3; ++a) {
            const Eigen::Vector3d v = eigen.eigenvectors().col(2 - a);
            f.axes(0, a) = v[0];
            f.axes(1, a) = v[1];
            f.axes(2, a) = v[2];
            f.spread[a] = std::sqrt(std::max(eigen.eigenvalues()[2 - a], 0.0));
        }
    }
    return facts;
}

Kidney find_kidney(const LabelVolume& labels, const LabelFacts& facts, int label) {
    const double voxel_mm = labels.grid.spacing_mm.x;
    const int margin = static_cast<int>(std::ceil(16 / voxel_mm));
    const int step = std::max(1, static_cast<int>(std::lround(1.6 / voxel_mm)));
    Kidney kidney;
    kidney.label = label;
    const Int3 size = labels.grid.size;
    const Int3 lower{facts.lower.x - margin, facts.lower.y - margin, facts.lower.z - margin};
    const Int3 extent{facts.upper.x + margin - lower.x + 1, facts.upper.y + margin - lower.y + 1,
                      facts.upper.z + margin - lower.z + 1};
    const auto is_kidney = [&](int i, int j, int k) {
        i = std::clamp(i + lower.x, 0, size.x - 1);  // a cut kidney goes on beyond the grid
        j = std::clamp(j + lower.y, 0, size.y - 1);
        k = std::clamp(k + lower.z, 0, size.z - 1);
        return labels.voxels[labels.grid.index(i, j, k)] == label;
    };
    // Hull: closing by a ball of 11 mm, as two distance transforms on the coarse samples.
    const CoarseField to_kidney =
        distance_inside(extent, step, [&](int i, int j, int k) { return !is_kidney(i, j, k); });
    const auto ball = static_cast<float>(11 / voxel_mm);
    const auto dilated = [&](int i, int j, int k) {
        return to_kidney.at(static_cast<float>(i), static_cast<float>(j), static_cast<float>(k)) <
               ball;
    };
    CoarseField depth = distance_inside(extent, step, dilated);
    for (float& d : depth.value) d = std::max(d - ball, 0.f);
    // shift of half a voxel: samples are voxel centres, the surface lies between them
    kidney.depth = {lower,
                    {lower.x + extent.x - 1, lower.y + extent.y - 1, lower.z + extent.z - 1},
                    std::move(depth)};
    std::int64_t hull = 0, filled = 0;
    Vector3 hilum{0, 0, 0};
    double hilum_weight = 0;
    const CoarseField& d = kidney.depth.field;
    for (int k = 0; k < d.size.z; ++k) {
        for (int j = 0; j < d.size.y; ++j) {
            for (int i = 0; i < d.size.x; ++i) {
                const float v = d.value[d.index(i, j, k)];
                kidney.deepest = std::max(kidney.deepest, static_cast<double>(v));
                if (v < 1.5f * static_cast<float>(step)) continue;
                ++hull;
                if (is_kidney(i * step, j * step, k * step)) {
                    ++filled;
                } else {
                    hilum = hilum + Vector3{static_cast<double>(lower.x + i * step),
                                            static_cast<double>(lower.y + j * step),
                                            static_cast<double>(lower.z + k * step)};
                    hilum_weight += 1;
                }
            }
        }
    }
    kidney.solid =
        hull > 0 && static_cast<double>(hull - filled) < 0.03 * static_cast<double>(hull);
    kidney.centre = facts.mean;
    const Vector3 along = facts.axes.column(0);
    Vector3 towards =
        hilum_weight > 0 ? (1 / hilum_weight) * hilum - facts.mean : facts.axes.column(2);
    towards = towards - dot(towards, along) * along;
    if (norm(towards) < 0.5) towards = facts.axes.column(2);
    towards = normalized(towards);
    kidney.axes = Matrix3::from_columns(along, towards, cross(along, towards));
    kidney.half_length = 1.9 * facts.spread.x;
    return kidney;
}

float kidney_offset_db(const Kidney& kidney, float voxel_mm, int i, int j, int k, float noise) {
    const float depth = kidney.depth.at(i, j, k) * voxel_mm + 0.9f * noise;  // a wavy border
    const auto deepest = static_cast<float>(kidney.deepest) * voxel_mm;
    const Vector3 p =
        Vector3{static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)} -
        kidney.centre;
    const double along = dot(p, kidney.axes.column(0)) * voxel_mm;
    const double a = dot(p, kidney.axes.column(1)), b = dot(p, kidney.axes.column(2));
    const auto ramp = [](float x) { return std::clamp(x, 0.f, 1.f); };
    if (kidney.solid) {
        // the sinus drawn inside: the deepest third, open towards the hilum
        const float shift = a > 0 ? 0.10f * deepest : 0.f;
        const float sinus = ramp((depth + shift - 0.66f * deepest) / 1.5f + 0.5f);
        if (sinus >= 1) return 11;
        if (sinus > 0) return 11 * sinus;
    }
    const float cortex = std::min(7.f, 0.34f * deepest);
    const float reach = std::max(std::min(kidney.solid ? 0.62f * deepest : 20.f, 20.f), cortex + 1);
    const float s =
        (depth - cortex) / (reach - cortex);  // 0 at the base of a pyramid, 1 at its tip
    if (s <= -0.15f || s >= 1.1f) return 0;
    // Rows of pyramids about 17 mm apart along the kidney, five round it, staggered.
    const double row = along / 17.0;
    const double row_index = std::floor(row);
    const double stagger = 0.5 * (static_cast<long>(row_index) & 1);
    double turn = std::atan2(b, a) / 6.283185307179586 * 5 + stagger;
    turn -= std::floor(turn);
    const double du = (row - row_index - 0.5), dv = turn - 0.5;
    const auto across = static_cast<float>(std::sqrt(du * du + dv * dv));
    const float half_width = 0.44f * (1 - 0.62f * ramp(s)) + 0.05f * noise;
    const float inside = ramp((half_width - across) / 0.10f + 0.5f);
    const float ends = ramp((s + 0.12f) / 0.18f) * ramp((1.08f - s) / 0.15f);
    return -5.f * inside * ends;
}

Vector3 MuscleDirections::at(int label, float i, float j, float k) const {
    const FibreField& f = fields[static_cast<std::size_t>(label)];
    if (!f.sheet || skin_depth == nullptr) return f.axis;
    const Vector3 inward = skin_depth->gradient(i, j, k);
    const Vector3 round = cross(up, inward);
    const double size = norm(round);
    if (size < 0.2) return f.axis;  // on the medial axis, or where the skin faces up
    constexpr double kSlant = 0.5;  // radians from the horizontal: between the three layers' own
    return std::cos(kSlant) / size * round + std::sin(kSlant) * up;
}

MuscleDirections find_muscle_directions(const LabelVolume& labels,
                                        const std::vector<LabelFacts>& facts,
                                        const CoarseField* skin_depth) {
    MuscleDirections out;
    out.skin_depth = skin_depth;
    out.fields.resize(facts.size());
    // The spine tells where up is; else the longest axis of all bone; else k.
    Vector3 sum{0, 0, 0};
    Vector3 lowest{}, highest{};
    double vertebrae = 0;
    for (std::size_t l = 1; l < facts.size(); ++l) {
        const std::string& name = labels.labels[l].name;
        if (facts[l].count == 0 || name.rfind("vertebra", 0) != 0) continue;
        if (vertebrae == 0 || norm(facts[l].mean - lowest) > norm(highest - lowest)) {
            if (vertebrae == 0) lowest = facts[l].mean;
            highest = facts[l].mean;
        }
        vertebrae += 1;
    }
    if (vertebrae >= 2 && norm(highest - lowest) > 1) {
        sum = normalized(highest - lowest);
        out.up = sum.z < 0 ? -sum : sum;
    }
    for (std::size_t l = 1; l < facts.size(); ++l) {
        if (facts[l].role != StructureRole::muscle) continue;
        FibreField& f = out.fields[l];
        f.label = static_cast<int>(l);
        f.axis = facts[l].axes.column(0);
        if (f.axis.z < 0) f.axis = -f.axis;
        // A belly of muscle is longer than wide; what wraps the body has a spread like the body's.
        f.sheet = facts[l].spread.x < 1.6 * facts[l].spread.y && skin_depth != nullptr;
    }
    return out;
}

}  // namespace sonocase::pipeline
