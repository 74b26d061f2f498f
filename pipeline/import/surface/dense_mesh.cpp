// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/surface/dense_mesh.h"

#include <vtkBinnedDecimation.h>
#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkStaticCellLocator.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

namespace sonocase::pipeline {
namespace {

constexpr double kCube_mm = 4, kLeastPart = 0.02;
constexpr vtkIdType kProbes = 20000;

std::vector<std::array<std::uint32_t, 3>> triangles_of(vtkPolyData& data) {
    std::vector<std::array<std::uint32_t, 3>> triangles;
    vtkIdType count = 0;
    const vtkIdType* ids = nullptr;
    vtkCellArray* polys = data.GetPolys();
    for (polys->InitTraversal(); polys->GetNextCell(count, ids);) {
        if (count != 3 || ids[0] == ids[1] || ids[1] == ids[2] || ids[2] == ids[0]) continue;
        triangles.push_back({static_cast<std::uint32_t>(ids[0]), static_cast<std::uint32_t>(ids[1]),
                             static_cast<std::uint32_t>(ids[2])});
    }
    return triangles;
}

// Each triangle once, however many given ones became it, in the sense of most of them; those of
// which as many face one way as the other are folds flatter than a cube.
void keep_once(std::vector<std::array<std::uint32_t, 3>>& triangles) {
    for (auto& t : triangles) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    // Both senses of a triangle stand together.
    const auto key = [](const std::array<std::uint32_t, 3>& t) {
        return std::array<std::uint32_t, 3>{t[0], std::min(t[1], t[2]), std::max(t[1], t[2])};
    };
    std::sort(triangles.begin(), triangles.end(),
              [&](const auto& a, const auto& b) { return key(a) < key(b); });
    std::size_t kept = 0;
    for (std::size_t n = 0; n < triangles.size();) {
        const auto same = key(triangles[n]);
        long sense = 0;
        for (; n < triangles.size() && key(triangles[n]) == same; ++n)
            sense += triangles[n] == same ? 1 : -1;
        if (sense == 0) continue;
        triangles[kept++] =
            sense > 0 ? same : std::array<std::uint32_t, 3>{same[0], same[2], same[1]};
    }
    triangles.resize(kept);
}

// Leaves out small parts and points without a triangle; returns how many parts.
std::size_t drop_small_parts(Surface& surface) {
    std::vector<std::uint32_t> root(surface.points.size());
    std::iota(root.begin(), root.end(), 0u);
    const auto find = [&](std::uint32_t v) {
        while (root[v] != v) v = root[v] = root[root[v]];
        return v;
    };
    for (const auto& t : surface.triangles) {
        root[find(t[1])] = find(t[0]);
        root[find(t[2])] = find(t[0]);
    }
    std::vector<std::size_t> size(surface.points.size(), 0);
    for (const auto& t : surface.triangles) ++size[find(t[0])];
    const std::size_t largest = size.empty() ? 0 : *std::max_element(size.begin(), size.end());
    const auto small = [&](std::size_t n) {
        return n > 0 && static_cast<double>(n) < kLeastPart * static_cast<double>(largest);
    };
    const auto parts = static_cast<std::size_t>(std::count_if(size.begin(), size.end(), small));
    std::erase_if(surface.triangles, [&](const auto& t) { return small(size[find(t[0])]); });
    std::vector<std::uint32_t> number(surface.points.size(), UINT32_MAX);
    std::vector<Point3> used;
    for (auto& t : surface.triangles) {
        for (std::uint32_t& v : t) {
            if (number[v] == UINT32_MAX) {
                number[v] = static_cast<std::uint32_t>(used.size());
                used.push_back(surface.points[v]);
            }
            v = number[v];
        }
    }
    surface.points = std::move(used);
    return parts;
}

void report_reduction(vtkPolyData& given,
                      vtkPolyData& reduced,
                      double scale,
                      std::size_t parts,
                      StageReport* report) {
    vtkNew<vtkStaticCellLocator> tree;
    tree->SetDataSet(&reduced);
    tree->BuildLocator();
    const vtkIdType count = given.GetNumberOfPoints(),
                    stride = std::max<vtkIdType>(1, count / kProbes);
    double square = 0, largest = 0, probes = 0;
    for (vtkIdType i = 0; i < count; i += stride, ++probes) {
        double p[3], foot[3], d2 = 0;
        vtkIdType cell = 0;
        int part = 0;
        given.GetPoint(i, p);
        tree->FindClosestPoint(p, foot, cell, part, d2);
        square += d2;
        largest = std::max(largest, std::sqrt(d2));
    }
    report->measures.push_back({"given_triangles", static_cast<double>(given.GetNumberOfPolys())});
    report->measures.push_back(
        {"reduction_rms_mm", scale * std::sqrt(square / std::max(1.0, probes))});
    report->measures.push_back({"reduction_max_mm", scale * largest});
    report->measures.push_back({"small_parts", static_cast<double>(parts)});
    if (parts > 0) {
        report->warnings.push_back(
            std::to_string(parts) +
            " small parts of the scan were left out; cut stand and floor off "
            "if they are larger");
    }
}

}  // namespace

Surface reduce_mesh(vtkPolyData& data, double scale, StageReport* report) {
    double box[6];
    data.GetBounds(box);
    vtkNew<vtkBinnedDecimation> bins;
    bins->SetInputData(&data);
    bins->SetPointGenerationModeToBinAverages();
    bins->AutoAdjustNumberOfDivisionsOff();
    // A scan in other units is refused later, for its extent; here it must only stay small.
    const auto divisions = [&](int a) {
        return static_cast<int>(
            std::clamp(std::ceil(scale * (box[2 * a + 1] - box[2 * a]) / kCube_mm), 1.0, 500.0));
    };
    bins->SetNumberOfDivisions(divisions(0), divisions(1), divisions(2));
    bins->Update();
    vtkPolyData& reduced = *bins->GetOutput();
    Surface surface;
    for (vtkIdType i = 0; i < reduced.GetNumberOfPoints(); ++i) {
        double p[3];
        reduced.GetPoint(i, p);
        surface.points.push_back({p[0], p[1], p[2]});
    }
    surface.triangles = triangles_of(reduced);
    keep_once(surface.triangles);
    const std::size_t parts = drop_small_parts(surface);
    if (report != nullptr) report_reduction(data, reduced, scale, parts, report);
    return surface;
}

}  // namespace sonocase::pipeline
