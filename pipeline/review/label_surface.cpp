// SPDX-License-Identifier: Apache-2.0

#include "pipeline/review/label_surface.h"

#include <vtkCellArray.h>
#include <vtkDiscreteFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkWindowedSincPolyDataFilter.h>

#include <algorithm>
#include <cstdint>

namespace sonocase::pipeline {

Surface label_surface(const CaseBundle& bundle, const std::vector<bool>& chosen, int step) {
    const Int3 size = bundle.grid.size;
    // A layer of zeros around closes surfaces at the border of the volume.
    const int nx = size.x / step + 2, ny = size.y / step + 2, nz = size.z / step + 2;
    vtkNew<vtkImageData> image;
    image->SetDimensions(nx, ny, nz);
    image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    auto* to = static_cast<std::uint8_t*>(image->GetScalarPointer());
    std::fill(to, to + static_cast<std::ptrdiff_t>(nx) * ny * nz, std::uint8_t{0});
    const double voxel = bundle.grid.spacing_mm.x;
    image->SetSpacing(step * voxel, step * voxel, step * voxel);
    const Point3 o = bundle.grid.origin_mm;
    image->SetOrigin(o.x - step * voxel, o.y - step * voxel, o.z - step * voxel);
    bool any = false;
    for (int k = 0; k * step < size.z; ++k) {
        for (int j = 0; j * step < size.y; ++j) {
            std::uint8_t* row = to + static_cast<std::ptrdiff_t>(nx) *
                                         (j + 1 + static_cast<std::ptrdiff_t>(ny) * (k + 1));
            for (int i = 0; i * step < size.x; ++i) {
                const bool in = chosen[bundle.label_bricks.at(i * step, j * step, k * step)];
                if (i + 1 < nx && j + 1 < ny && k + 1 < nz) row[i + 1] = in;
                any = any || in;
            }
        }
    }
    if (!any) return {};
    vtkNew<vtkDiscreteFlyingEdges3D> edges;
    edges->SetInputData(image);
    edges->SetValue(0, 1);
    vtkNew<vtkWindowedSincPolyDataFilter> smooth;
    smooth->SetInputConnection(edges->GetOutputPort());
    smooth->SetNumberOfIterations(20);
    smooth->SetPassBand(0.05);
    smooth->NormalizeCoordinatesOn();
    smooth->Update();
    vtkPolyData& mesh = *smooth->GetOutput();
    Surface surface;
    for (vtkIdType i = 0; i < mesh.GetNumberOfPoints(); ++i) {
        double p[3];
        mesh.GetPoint(i, p);
        surface.points.push_back({p[0], p[1], p[2]});
    }
    vtkIdType count = 0;
    const vtkIdType* ids = nullptr;
    vtkCellArray* polygons = mesh.GetPolys();
    for (polygons->InitTraversal(); polygons->GetNextCell(count, ids);) {
        surface.triangles.push_back({static_cast<std::uint32_t>(ids[0]),
                                     static_cast<std::uint32_t>(ids[1]),
                                     static_cast<std::uint32_t>(ids[2])});
    }
    return surface;
}

}  // namespace sonocase::pipeline
