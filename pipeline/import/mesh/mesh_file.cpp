// SPDX-License-Identifier: Apache-2.0

// Mesh files through VTK. A scan of millions of triangles is reduced to what a fit needs.
#include "pipeline/import/mesh/mesh_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numeric>
#include <string_view>
#include <vector>

#include <vtkBinnedDecimation.h>
#include <vtkCallbackCommand.h>
#include <vtkCellArray.h>
#include <vtkCleanPolyData.h>
#include <vtkFieldData.h>
#include <vtkFloatArray.h>
#include <vtkNew.h>
#include <vtkOBJReader.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStaticCellLocator.h>
#include <vtkStringArray.h>
#include <vtkTriangleFilter.h>
#include <vtkTypeInt64Array.h>
#include <vtkXMLPolyDataReader.h>

#include "formats/base/stage_report.h"
#include "formats/files/atomic_file.h"
#include "formats/volume/surface.h"
#include "pipeline/base/quiet_library.h"
#include "pipeline/base/text.h"
#include "pipeline/import/mesh/glb_file.h"
#include "pipeline/import/mesh/polygon_file.h"

namespace sonocase::pipeline::inline import_mesh {
namespace {

constexpr std::size_t kDenseTriangles = 400000;  // a mesh of more is reduced
constexpr double kCubeMm = 4, kMinPart = 0.02;
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

// Keeps each triangle once, however many given ones became it, in the sense of most of them. If as
// many face one way as the other, they are a fold flatter than a cube, and are left out.
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
        return n > 0 && static_cast<double>(n) < kMinPart * static_cast<double>(largest);
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
        double p[3], nearest[3], d2 = 0;
        vtkIdType cell = 0;
        int part = 0;
        given.GetPoint(i, p);
        tree->FindClosestPoint(p, nearest, cell, part, d2);
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

// The vertices in each cube of 4 mm become one at their mean (vtkBinnedDecimation), which lies
// within 4^2 / (24 R) of a surface of radius R: 0.02 mm on a body. Parts of less than 2 % of the
// largest part's triangles are left out: dust, the feet of a stand, specks of the floor.
//
// report  measures given_triangles, reduction_rms_mm and reduction_max_mm: distances of 20,000
//         given vertices from the reduced mesh (vtkStaticCellLocator), and small_parts; may be null
// data    triangles alone
// scale   mm per unit of data
//
// Cost: 0.4 us per triangle, and 60 bytes.
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
            std::clamp(std::ceil(scale * (box[2 * a + 1] - box[2 * a]) / kCubeMm), 1.0, 500.0));
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

// VTK reports by events: keeps the text of the first error, without VTK's own file and line.
void keep_first_error(vtkObject*, unsigned long, void* client, void* data) {
    auto& kept = *static_cast<std::string*>(client);
    if (!kept.empty() || data == nullptr) return;
    kept = static_cast<const char*>(data);
    if (const auto at = kept.find("): "); at != std::string::npos) kept = kept.substr(at + 3);
    while (!kept.empty() && std::isspace(static_cast<unsigned char>(kept.back()))) kept.pop_back();
}

template <class Reader>
vtkSmartPointer<vtkPolyData> read_with(const std::string& path, std::string* error) {
    vtkNew<vtkCallbackCommand> observer;
    observer->SetCallback(keep_first_error);
    observer->SetClientData(error);
    vtkNew<Reader> reader;
    reader->AddObserver("ErrorEvent", observer);
    reader->SetFileName(path.c_str());
    reader->Update();
    vtkSmartPointer<vtkPolyData> data = reader->GetOutput();
    return data;
}

// Takes the file's arrays one by one: a dense scan is held once.
vtkSmartPointer<vtkPolyData> polygons_of(PolygonFile file) {
    vtkNew<vtkPoints> points;
    points->SetDataTypeToDouble();
    points->SetNumberOfPoints(static_cast<vtkIdType>(file.points.size()));
    for (std::size_t i = 0; i < file.points.size(); ++i) {
        const Point3 p = file.points[i];
        points->SetPoint(static_cast<vtkIdType>(i), p.x, p.y, p.z);
    }
    file.points = {};
    vtkNew<vtkTypeInt64Array> offsets, corners;
    offsets->SetNumberOfValues(static_cast<vtkIdType>(file.ends.size()) + 1);
    offsets->SetValue(0, 0);
    for (std::size_t i = 0; i < file.ends.size(); ++i)
        offsets->SetValue(static_cast<vtkIdType>(i) + 1, static_cast<vtkIdType>(file.ends[i]));
    file.ends = {};
    corners->SetNumberOfValues(static_cast<vtkIdType>(file.corners.size()));
    for (std::size_t i = 0; i < file.corners.size(); ++i)
        corners->SetValue(static_cast<vtkIdType>(i), file.corners[i]);
    vtkNew<vtkCellArray> polygons;
    polygons->SetData(offsets, corners);
    auto data = vtkSmartPointer<vtkPolyData>::New();
    data->SetPoints(points);
    data->SetPolys(polygons);
    return data;
}

// Takes the corners; each triangle has its own.
vtkSmartPointer<vtkPolyData> triangles_of(const std::vector<float>& corners) {
    vtkNew<vtkFloatArray> values;
    values->SetNumberOfComponents(3);
    values->SetNumberOfTuples(static_cast<vtkIdType>(corners.size() / 3));
    std::copy(corners.begin(), corners.end(), values->GetPointer(0));
    vtkNew<vtkPoints> points;
    points->SetData(values);
    vtkNew<vtkTypeInt64Array> offsets, ids;
    const auto count = static_cast<vtkIdType>(corners.size() / 9);
    offsets->SetNumberOfValues(count + 1);
    ids->SetNumberOfValues(3 * count);
    for (vtkIdType n = 0; n <= count; ++n) offsets->SetValue(n, 3 * n);
    for (vtkIdType n = 0; n < 3 * count; ++n) ids->SetValue(n, n);
    vtkNew<vtkCellArray> polygons;
    polygons->SetData(offsets, ids);
    auto data = vtkSmartPointer<vtkPolyData>::New();
    data->SetPoints(points);
    data->SetPolys(polygons);
    return data;
}

// VTK's readers pass on what the file says.
bool names_no_vertex(vtkPolyData& data) {
    for (vtkCellArray* cells : {data.GetPolys(), data.GetStrips()}) {
        if (cells == nullptr) continue;
        vtkIdType count = 0;
        const vtkIdType* ids = nullptr;
        for (cells->InitTraversal(); cells->GetNextCell(count, ids);)
            for (vtkIdType n = 0; n < count; ++n)
                if (ids[n] < 0 || ids[n] >= data.GetNumberOfPoints()) return true;
    }
    return false;
}

// The numbers behind the "v" of an OBJ's vertex.
std::vector<double> vertex_numbers(const std::string& line) {
    std::vector<double> numbers;
    const char* at = line.c_str() + 1;
    for (char* end = nullptr; numbers.size() < 8; at = end) {
        const double number = std::strtod(at, &end);
        if (end == at) break;
        numbers.push_back(number);
    }
    return numbers;
}

// The comments of an OBJ, whichever line they stand in. VTK takes "1,5" for 1 and leaves weights
// out, and says nothing: coordinates are looked at here.
Result<Axes> axes_of_obj(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    Axes axes = Axes::unsaid;
    int number = 0;
    bool first = true, weights = false;
    for (std::string line; std::getline(file, line);) {
        ++number;
        if (line.starts_with("v ") && (first || weights)) {
            const std::vector<double> numbers = vertex_numbers(line);
            weights = numbers.size() == 4;
            first = false;
            if (weights && numbers[3] != 1)
                return Error{
                    "a vertex has a fourth number, a weight, that is not 1: " + line.substr(0, 60),
                    path + ":" + std::to_string(number),
                    "expected x, y and z alone: export it again without weights"};
        }
        if (line.starts_with("v ") && line.find(',') != std::string::npos)
            return Error{"a vertex has a comma among its numbers: " + line.substr(0, 40),
                         path + ":" + std::to_string(number),
                         "write decimal points: choose English as language of the program that "
                         "exports it"};
        if (!line.starts_with("#")) continue;
        SONOCASE_TRY(const Axes said, axes_said(line, path));
        if (said != Axes::unsaid) axes = said;
    }
    return axes;
}

Result<Axes> axes_of_fields(vtkPolyData& data, const std::string& path) {
    vtkFieldData* fields = data.GetFieldData();
    auto* space = fields == nullptr
                      ? nullptr
                      : vtkStringArray::SafeDownCast(fields->GetAbstractArray("SPACE"));
    if (space == nullptr || space->GetNumberOfValues() < 1) return Axes::unsaid;
    return axes_said("SPACE=" + std::string(space->GetValue(0)), path);
}

// A dense mesh is reduced before anything is made of its single triangles.
Surface reduced(vtkPolyData& data, double scale, StageReport* report) {
    vtkPolyData* triangles = &data;
    vtkNew<vtkTriangleFilter> cut;
    if (data.GetNumberOfStrips() > 0 || data.GetPolys()->GetMaxCellSize() > 3) {
        cut->SetInputData(&data);
        cut->PassVertsOff();
        cut->PassLinesOff();
        cut->Update();
        triangles = cut->GetOutput();
    }
    return reduce_mesh(*triangles, scale, report);
}

Surface surface_of(vtkPolyData& data) {
    Surface surface;
    surface.points.reserve(data.GetNumberOfPoints());
    for (vtkIdType i = 0; i < data.GetNumberOfPoints(); ++i) {
        double p[3];
        data.GetPoint(i, p);
        surface.points.push_back({p[0], p[1], p[2]});
    }
    if (vtkCellArray* polys = data.GetPolys()) {
        vtkIdType count = 0;
        const vtkIdType* ids = nullptr;
        for (polys->InitTraversal(); polys->GetNextCell(count, ids);)
            if (count == 3)
                surface.triangles.push_back({static_cast<std::uint32_t>(ids[0]),
                                             static_cast<std::uint32_t>(ids[1]),
                                             static_cast<std::uint32_t>(ids[2])});
    }
    if (vtkDataArray* normals = data.GetPointData()->GetNormals();
        normals != nullptr && surface.triangles.empty()) {
        for (vtkIdType i = 0; i < data.GetNumberOfPoints(); ++i) {
            double n[3];
            normals->GetTuple(i, n);
            surface.normals.push_back(normalized({n[0], n[1], n[2]}));
        }
    }
    return surface;
}

}  // namespace

bool is_mesh_file(const std::string& path) {
    const std::string ending = lower_case(std::filesystem::path(path).extension().string());
    return ending == ".glb" || ending == ".stl" || ending == ".ply" || ending == ".obj" ||
           ending == ".vtp" || (ending == ".vtk" && is_vtk_surface(path));
}

namespace {

// All nodes of a GLB as one surface.
Result<PolygonFile> read_gltf(const std::string& path, Axes told, StageReport* report) {
    SONOCASE_TRY(const auto bytes, read_file(path));
    std::vector<std::string> aside;
    SONOCASE_TRY(auto nodes, read_glb(bytes, path, &aside));
    if (!aside.empty() && report != nullptr)
        report->warnings.push_back(std::to_string(aside.size()) +
                                   " nodes are not in the file's scene and were left out: " +
                                   aside[0] + (aside.size() > 1 ? ", ..." : ""));
    PolygonFile file;
    for (const MeshNode& node : nodes) {
        const auto base = static_cast<std::uint32_t>(file.points.size());
        for (const Point3 p : node.surface.points) file.points.push_back(ras_from_gltf(p, told));
        for (const auto& t : node.surface.triangles) {
            for (const std::uint32_t corner : t) file.corners.push_back(base + corner);
            file.ends.push_back(file.corners.size());
        }
    }
    return file;
}

// Empty `error`: read.
Result<vtkSmartPointer<vtkPolyData>> read_polygons(const std::string& path,
                                                   const std::string& ending,
                                                   Axes told,
                                                   StageReport* report,
                                                   MeshFile& out) {
    if (ending == ".stl") {
        SONOCASE_TRY(const auto file, read_stl_file(path));
        out.axes = file.axes;
        return triangles_of(file.corners);
    }
    if (ending == ".obj" || ending == ".vtp") {
        std::string error;
        const bool obj = ending == ".obj";
        auto data = obj ? read_with<vtkOBJReader>(path, &error)
                        : read_with<vtkXMLPolyDataReader>(path, &error);
        // The reader's own text is for programmers.
        if (!error.empty() || data == nullptr)
            error = obj ? "cannot be read as OBJ: the file is damaged or of another kind"
                        : "cannot be read as VTP: the file is damaged or of another kind";
        else if (names_no_vertex(*data))
            error = "a polygon names a vertex that does not exist";
        if (!error.empty()) return Error{error, path, kExportMeshAgain};
        SONOCASE_TRY(out.axes, obj ? axes_of_obj(path) : axes_of_fields(*data, path));
        return data;
    }
    if (ending == ".glb") out.unit_mm = 1000;
    SONOCASE_TRY(auto file, ending == ".ply"   ? read_ply_file(path)
                            : ending == ".vtk" ? read_vtk_file(path)
                                               : read_gltf(path, told, report));
    out.axes = file.axes;
    if (!file.ends.empty()) return polygons_of(std::move(file));
    out.surface = {std::move(file.points), std::move(file.normals), {}};
    for (Vector3& normal : out.surface.normals) normal = normalized(normal);
    return vtkSmartPointer<vtkPolyData>();
}

}  // namespace

Result<MeshFile> read_mesh_file(const std::string& path,
                                double scale,
                                Axes told,
                                StageReport* report) {
    const std::string ending = lower_case(std::filesystem::path(path).extension().string());
    const QuietLibrary quiet;
    MeshFile out;
    try {
        SONOCASE_TRY(auto data, read_polygons(path, ending, told, report, out));
        if (data == nullptr) return out;
        if (data->GetNumberOfPolys() == 0 && data->GetNumberOfStrips() == 0) {
            out.surface = surface_of(*data);
            return out;
        }
        if (data->GetNumberOfPolys() > static_cast<vtkIdType>(kDenseTriangles)) {
            out.surface = reduced(*data, scale * out.unit_mm, report);
            return out;
        }
        vtkNew<vtkTriangleFilter> triangles;
        triangles->SetInputData(data);
        triangles->PassVertsOff();
        triangles->PassLinesOff();
        // Merges coincident vertices and drops those without a triangle.
        vtkNew<vtkCleanPolyData> clean;
        clean->SetInputConnection(triangles->GetOutputPort());
        clean->PointMergingOn();
        clean->ToleranceIsAbsoluteOn();
        clean->SetAbsoluteTolerance(0);
        clean->ConvertPolysToLinesOff();
        clean->ConvertLinesToPointsOff();
        clean->Update();
        out.surface = surface_of(*clean->GetOutput());
        return out;
    } catch (const std::exception&) {
        return Error{"cannot be read as a mesh: the file is damaged", path, kExportMeshAgain};
    }
}

}  // namespace sonocase::pipeline::inline import_mesh
