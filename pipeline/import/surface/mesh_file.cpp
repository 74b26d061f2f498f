// SPDX-License-Identifier: Apache-2.0

// Mesh files through VTK.
#include <vtkCallbackCommand.h>
#include <vtkCellArray.h>
#include <vtkCleanPolyData.h>
#include <vtkNew.h>
#include <vtkOBJReader.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSTLReader.h>
#include <vtkTriangleFilter.h>
#include <vtkTypeInt64Array.h>
#include <vtkXMLPolyDataReader.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string_view>

#include "pipeline/base/delimited_text.h"
#include "pipeline/base/quiet_library.h"
#include "pipeline/import/surface/dense_mesh.h"
#include "pipeline/import/surface/ply_file.h"
#include "pipeline/import/surface/surface_readers.h"

namespace sonocase::pipeline {
namespace {

// VTK reports by events; the first error's text, without VTK's own file and line.
void keep_first_error(vtkObject*, unsigned long, void* client, void* data) {
    auto& kept = *static_cast<std::string*>(client);
    if (!kept.empty() || data == nullptr) return;
    kept = static_cast<const char*>(data);
    if (const auto at = kept.find("): "); at != std::string::npos) kept = kept.substr(at + 3);
    while (!kept.empty() && std::isspace(static_cast<unsigned char>(kept.back()))) kept.pop_back();
}

template <class Reader>
vtkSmartPointer<vtkPolyData> read_with(
    const std::string& path,
    std::string* error,
    const std::function<void(Reader&)>& set_up = [](Reader&) {}) {
    vtkNew<vtkCallbackCommand> observer;
    observer->SetCallback(keep_first_error);
    observer->SetClientData(error);
    vtkNew<Reader> reader;
    reader->AddObserver("ErrorEvent", observer);
    reader->SetFileName(path.c_str());
    set_up(*reader.Get());
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

// VTK accepts a binary STL file of any length; the file's header says how long it must be.
bool binary_stl_is_cut_off(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    char head[84];
    if (!file.read(head, sizeof head)) return false;  // the reader reports what is wrong
    char text[512];
    file.read(text, sizeof text);
    const bool ascii =
        std::string_view(head, 5) == "solid" &&
        std::all_of(head, head + sizeof head, [](char c) { return c >= 9 && c < 127; }) &&
        std::all_of(text, text + file.gcount(), [](char c) { return c >= 9 && c < 127; });
    if (ascii) return false;
    std::uint32_t triangles = 0;
    std::memcpy(&triangles, head + 80, sizeof triangles);
    return std::filesystem::file_size(path) < 84 + 50ull * triangles;
}

std::uint64_t stl_triangles(const std::string& path) {
    std::error_code code;
    const auto bytes = std::filesystem::file_size(path, code);
    return code ? 0 : bytes / 50;  // of the binary form; the text form takes five times as many
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
    surface.points.reserve(static_cast<std::size_t>(data.GetNumberOfPoints()));
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

Result<Surface> read_mesh_file(const std::string& path, double scale, StageReport* report) {
    const char* todo = "check that the file is complete; export it again";
    const std::string ending = lower_case(std::filesystem::path(path).extension().string());
    const QuietLibrary quiet;
    std::string error;
    vtkSmartPointer<vtkPolyData> data;
    try {
        if (ending == ".ply") {
            auto file = read_ply_file(path);
            if (!file) return file.error();
            if (file->ends.empty()) {
                Surface cloud{file->points, file->normals, {}};
                for (Vector3& normal : cloud.normals) normal = normalized(normal);
                return cloud;
            }
            data = polygons_of(std::move(*file));
        } else if (ending == ".stl") {
            if (binary_stl_is_cut_off(path)) return Error{"STL file is cut off", path, todo};
            // The merging of a dense scan's corners is left to its reduction.
            const bool merge = stl_triangles(path) <= kDenseTriangles;
            data = read_with<vtkSTLReader>(path, &error,
                                           [&](vtkSTLReader& reader) { reader.SetMerging(merge); });
        } else if (ending == ".obj") {
            data = read_with<vtkOBJReader>(path, &error);
        } else {
            data = read_with<vtkXMLPolyDataReader>(path, &error);
        }
        if (!error.empty() || data == nullptr)
            return Error{"cannot be read as a mesh (" + error + ")", path, todo};
        if (data->GetNumberOfPolys() == 0 && data->GetNumberOfStrips() == 0)
            return surface_of(*data);

        if (data->GetNumberOfPolys() > static_cast<vtkIdType>(kDenseTriangles))
            return reduced(*data, scale, report);
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
        return surface_of(*clean->GetOutput());
    } catch (const std::exception& exception) {
        return Error{std::string("cannot be read as a mesh (") + exception.what() + ")", path,
                     todo};
    }
}

}  // namespace sonocase::pipeline
