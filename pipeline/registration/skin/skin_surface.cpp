// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/skin/skin_surface.h"

#include <vtkCellArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkIdList.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "pipeline/base/stopwatch.h"
#include "pipeline/registration/skin/skin_field.h"

namespace sonocase::pipeline::inline registration_skin {
namespace {

struct Contour {
    std::vector<Point3> points;  // in voxels of the grid
    std::vector<std::array<std::uint32_t, 3>> triangles;
};

Contour contour(const SkinField& body) {
    vtkNew<vtkImageData> image;
    const Int3 size = body.grid.size;
    image->SetDimensions(size.x, size.y, size.z);
    image->AllocateScalars(VTK_FLOAT, 1);
    std::memcpy(image->GetScalarPointer(), body.inside.data(), body.inside.size() * sizeof(float));
    vtkNew<vtkFlyingEdges3D> edges;
    edges->SetInputData(image);
    edges->SetValue(0, 0.5);
    edges->ComputeNormalsOff();
    edges->ComputeGradientsOff();
    edges->ComputeScalarsOff();
    edges->Update();
    vtkPolyData* mesh = edges->GetOutput();
    Contour out;
    const vtkIdType points = mesh->GetNumberOfPoints();
    out.points.reserve(points);
    for (vtkIdType i = 0; i < points; ++i) {
        const double* p = mesh->GetPoint(i);
        out.points.push_back({p[0], p[1], p[2]});
    }
    vtkNew<vtkIdList> cell;
    vtkCellArray* cells = mesh->GetPolys();
    for (cells->InitTraversal(); cells->GetNextCell(cell);) {
        const auto id = [&](vtkIdType n) { return static_cast<std::uint32_t>(cell->GetId(n)); };
        if (id(0) == id(1) || id(1) == id(2) || id(2) == id(0)) continue;
        out.triangles.push_back({id(0), id(1), id(2)});
    }
    return out;
}

// Unit direction of steepest descent of the field at a point given in voxels, in the grid's frame.
Vector3 outward(const SkinField& body, Point3 voxel) {
    const Int3 size = body.grid.size;
    int first[3];
    double t[3];
    for (int a = 0; a < 3; ++a) {
        first[a] = std::clamp(static_cast<int>(voxel[a]), 0, size[a] - 2);
        t[a] = voxel[a] - first[a];
    }
    // Central differences at the eight corners, interpolated linearly.
    Vector3 gradient;
    for (int corner = 0; corner < 8; ++corner) {
        int at[3];
        double weight = 1;
        for (int a = 0; a < 3; ++a) {
            const int bit = (corner >> a) & 1;
            at[a] = first[a] + bit;
            weight *= bit ? t[a] : 1 - t[a];
        }
        for (int a = 0; a < 3; ++a) {
            int low[3] = {at[0], at[1], at[2]}, high[3] = {at[0], at[1], at[2]};
            low[a] = std::max(at[a] - 1, 0);
            high[a] = std::min(at[a] + 1, size[a] - 1);
            const double rise =
                static_cast<double>(body.inside[body.grid.index(high[0], high[1], high[2])]) -
                static_cast<double>(body.inside[body.grid.index(low[0], low[1], low[2])]);
            gradient[a] -= weight * rise / ((high[a] - low[a]) * body.grid.spacing_mm[a]);
        }
    }
    return normalized(body.grid.direction * gradient);
}

// Keeps the triangles whose three points are kept, and the points that they use.
void keep_only(const std::vector<std::uint8_t>& keep, Surface* surface) {
    std::vector<std::array<std::uint32_t, 3>> triangles;
    std::vector<std::uint8_t> used(keep.size(), 0);
    for (const auto& t : surface->triangles) {
        if (!keep[t[0]] || !keep[t[1]] || !keep[t[2]]) continue;
        triangles.push_back(t);
        for (std::uint32_t v : t) used[v] = 1;
    }
    std::vector<std::uint32_t> renumbered(keep.size(), 0);
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
        if (!used[i]) continue;
        renumbered[i] = count;
        surface->points[count] = surface->points[i];
        surface->normals[count] = surface->normals[i];
        ++count;
    }
    surface->points.resize(count);
    surface->normals.resize(count);
    for (auto& t : triangles) {
        for (auto& v : t) v = renumbered[v];
    }
    surface->triangles = std::move(triangles);
}

// Points of the largest connected parts of the mesh: the inner walls of cavities that stayed open
// in the slices are not skin.
std::vector<std::uint8_t> largest_part(const Surface& surface) {
    std::vector<std::uint32_t> parent(surface.points.size());
    for (std::size_t i = 0; i < parent.size(); ++i) parent[i] = static_cast<std::uint32_t>(i);
    const auto root = [&](std::uint32_t i) {
        while (parent[i] != i) i = parent[i] = parent[parent[i]];
        return i;
    };
    for (const auto& t : surface.triangles) {
        for (int e = 1; e < 3; ++e) {
            const std::uint32_t a = root(t[0]), b = root(t[e]);
            parent[std::max(a, b)] = std::min(a, b);
        }
    }
    std::vector<std::uint32_t> size(parent.size(), 0);
    for (std::size_t i = 0; i < parent.size(); ++i) ++size[root(static_cast<std::uint32_t>(i))];
    const std::uint32_t largest = size.empty() ? 0 : *std::max_element(size.begin(), size.end());
    std::vector<std::uint8_t> keep(parent.size(), 0);
    // A cut can divide the skin into several large pieces: keep every piece above a tenth.
    for (std::size_t i = 0; i < parent.size(); ++i) {
        keep[i] = size[root(static_cast<std::uint32_t>(i))] * 10 >= largest;
    }
    return keep;
}

std::vector<std::uint8_t> open_edge_points(const Surface& surface) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
    edges.reserve(3 * surface.triangles.size());
    for (const auto& t : surface.triangles) {
        for (std::size_t e = 0; e < 3; ++e) edges.push_back(std::minmax(t[e], t[(e + 1) % 3]));
    }
    std::sort(edges.begin(), edges.end());
    std::vector<std::uint8_t> open(surface.points.size(), 0);
    for (std::size_t i = 0; i < edges.size();) {
        std::size_t j = i + 1;
        while (j < edges.size() && edges[j] == edges[i]) ++j;
        if (j - i == 1) open[edges[i].first] = open[edges[i].second] = 1;
        i = j;
    }
    return open;
}

}  // namespace

Result<SkinSurfaceResult> extract_skin_surface(const LabelVolume& labels,
                                               const SkinSurfaceOptions& options) {
    const Stopwatch watch;
    SONOCASE_TRY(SkinField field, make_skin_field(labels, options));
    const SkinField& body = field;
    const Contour mesh = contour(body);

    SkinSurfaceResult result;
    Surface& skin = result.skin;
    skin.triangles = mesh.triangles;
    skin.points.reserve(mesh.points.size());
    skin.normals.reserve(mesh.points.size());
    for (Point3 p : mesh.points) {
        skin.points.push_back(body.grid.point_from_voxel(p));
        skin.normals.push_back(outward(body, p));
    }
    long round_view_points = 0;
    std::vector<std::uint8_t> keep = largest_part(skin);
    const Vector3 axis = body.grid.direction.column(2);
    if (body.round_view_mm > 0) {
        const double band = 1.5 * std::max(body.grid.spacing_mm.x, body.grid.spacing_mm.y);
        for (std::size_t i = 0; i < keep.size(); ++i) {
            const Vector3 from_axis = skin.points[i] - body.round_view_centre;
            const Vector3 across = from_axis - dot(from_axis, axis) * axis;
            const double r = norm(across);
            if (r > body.round_view_mm - band && dot(across, skin.normals[i]) > 0.95 * r) {
                if (keep[i]) ++round_view_points;
                keep[i] = 0;
            }
        }
    }
    keep_only(keep, &skin);

    // Counter-clockwise seen from outside, whatever the handedness of the grid.
    double agreement = 0;
    for (const auto& t : skin.triangles) {
        agreement +=
            dot(cross(skin.points[t[1]] - skin.points[t[0]], skin.points[t[2]] - skin.points[t[0]]),
                skin.normals[t[0]]);
    }
    if (agreement < 0) {
        for (auto& t : skin.triangles) std::swap(t[1], t[2]);
    }
    result.on_rim = open_edge_points(skin);

    const Grid& grid = labels.grid;
    for (int corner = 0; corner < 8; ++corner) {
        result.box.include(grid.point_from_voxel({(corner & 1) ? grid.size.x - 0.5 : -0.5,
                                                  (corner & 2) ? grid.size.y - 0.5 : -0.5,
                                                  (corner & 4) ? grid.size.z - 0.5 : -0.5}));
    }

    StageReport& report = result.report;
    report.stage = stage_names::kSurface;
    if (skin.points.size() < 100) {
        return Error{"skin surface of " + std::to_string(skin.points.size()) + " points", "",
                     "at least 100 are needed; is label 0 the outside of the body?"};
    }
    double area = 0;
    for (const auto& t : skin.triangles) {
        area += 0.5 * norm(cross(skin.points[t[1]] - skin.points[t[0]],
                                 skin.points[t[2]] - skin.points[t[0]]));
    }
    report.measures = {
        {"skin_points", static_cast<double>(skin.points.size())},
        {"skin_area_cm2", area / 100},
        {"rim_points",
         static_cast<double>(std::count(result.on_rim.begin(), result.on_rim.end(), 1))},
        {"cut_face_points", static_cast<double>(body.cut_voxels + round_view_points)},
        {"table_points", static_cast<double>(body.table_voxels)},
        {"arm_points", static_cast<double>(body.arm_voxels)},
        {"body_ml", body.body_ml},
    };
    if (body.hollow > 0.3) {
        report.warnings.push_back(
            "a third or more of the body carries no label, so that the surface may be that of "
            "organs and "
            "not the skin: give a label map that fills the body");
    }
    report.seconds = watch.seconds();
    return result;
}

}  // namespace sonocase::pipeline::inline registration_skin
