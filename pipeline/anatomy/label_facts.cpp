// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/label_facts.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline anatomy {
namespace {

// Sums over the voxels of a label; exact, because they are integers.
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

// Adds the run of one label from voxel (first, j, k) to voxel (last, j, k).
void add_run(int first, int last, int j, int k, Sums* s) {
    const std::int64_t n = last + 1 - first, a = first, b = last;
    const std::int64_t x = (a + b) * n / 2;
    const auto squares = [](std::int64_t m) { return m * (m + 1) * (2 * m + 1) / 6; };
    const std::int64_t kk = k;
    s->count += n;
    s->first[0] += x;
    s->first[1] += n * j;
    s->first[2] += n * kk;
    s->second[0] += squares(b) - (a > 0 ? squares(a - 1) : 0);
    s->second[1] += n * j * j;
    s->second[2] += n * kk * kk;
    s->second[3] += x * j;
    s->second[4] += x * kk;
    s->second[5] += n * j * kk;
    s->lower = {std::min(s->lower.x, first), std::min(s->lower.y, j), std::min(s->lower.z, k)};
    s->upper = {std::max(s->upper.x, last), std::max(s->upper.y, j), std::max(s->upper.z, k)};
}

// The sums of each label over one slice. # palette
std::vector<Sums> slice_sums(const LabelVolume& labels, int k) {
    const Int3 size = labels.grid.size;
    std::vector<Sums> sums(labels.labels.size());
    for (int j = 0; j < size.y; ++j) {
        const std::uint8_t* row = labels.voxels.data() + labels.grid.index(0, j, k);
        for (int i = 0; i < size.x;) {
            int end = i + 1;
            while (end < size.x && row[end] == row[i]) ++end;
            if (row[i] != 0 && row[i] < sums.size()) add_run(i, end - 1, j, k, &sums[row[i]]);
            i = end;
        }
    }
    return sums;
}

void add(const Sums& s, Sums* total) {
    total->count += s.count;
    for (int a = 0; a < 3; ++a) total->first[a] += s.first[a];
    for (int a = 0; a < 6; ++a) total->second[a] += s.second[a];
    for (int a = 0; a < 3; ++a) {
        total->lower[a] = std::min(total->lower[a], s.lower[a]);
        total->upper[a] = std::max(total->upper[a], s.upper[a]);
    }
}

// Mean, principal axes and spread from the sums; count > 0.
void set_shape(const Sums& t, LabelFacts* facts) {
    const auto n = static_cast<double>(t.count);
    const double m[3] = {static_cast<double>(t.first[0]) / n, static_cast<double>(t.first[1]) / n,
                         static_cast<double>(t.first[2]) / n};
    facts->mean = {m[0], m[1], m[2]};
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
        facts->axes(0, a) = v[0];
        facts->axes(1, a) = v[1];
        facts->axes(2, a) = v[2];
        facts->spread[a] = std::sqrt(std::max(eigen.eigenvalues()[2 - a], 0.0));
    }
}

}  // namespace

std::vector<LabelFacts> label_facts(const LabelVolume& labels,
                                    const std::vector<const Tissue*>& tissue_of) {
    const std::size_t palette = labels.labels.size();
    std::vector<std::vector<Sums>> slices(labels.grid.size.z);
    parallel_for(slices.size(), 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k)
            slices[k] = slice_sums(labels, static_cast<int>(k));
    });
    std::vector<LabelFacts> facts(palette);
    for (std::size_t l = 0; l < palette; ++l) {
        Sums total;
        for (const std::vector<Sums>& slice : slices) add(slice[l], &total);
        LabelFacts& f = facts[l];
        f.tissue = tissue_of[l];
        f.count = total.count;
        f.lower = total.lower;
        f.upper = total.upper;
        if (total.count == 0) continue;
        f.role = l == 0 ? StructureRole::none : role_of(*f.tissue);
        set_shape(total, &f);
    }
    return facts;
}

}  // namespace sonocase::pipeline::inline anatomy
