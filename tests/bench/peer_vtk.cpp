// SPDX-License-Identifier: Apache-2.0

#include "peer_vtk.h"

#include <vtkImageData.h>
#include <vtkImageReslice.h>
#include <vtkMatrix4x4.h>
#include <vtkNew.h>

#include <cstring>

namespace sonocase::bench {

struct VtkReslice::Impl {
    vtkNew<vtkImageData> volume;
    vtkNew<vtkImageReslice> reslice;
    vtkNew<vtkMatrix4x4> axes;
};

VtkReslice::VtkReslice(const CaseBundle& bundle) : impl_(std::make_unique<Impl>()) {
    const Grid& g = bundle.grid;
    impl_->volume->SetDimensions(g.size.x, g.size.y, g.size.z);
    impl_->volume->SetSpacing(g.spacing_mm.x, g.spacing_mm.y, g.spacing_mm.z);
    impl_->volume->SetOrigin(g.origin_mm.x, g.origin_mm.y, g.origin_mm.z);
    impl_->volume->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    const std::vector<std::uint8_t> dense = dense_from_bricks(bundle.label_bricks);
    std::memcpy(impl_->volume->GetScalarPointer(), dense.data(), dense.size());
    impl_->reslice->SetInputData(impl_->volume);
    impl_->reslice->SetInterpolationModeToNearestNeighbor();
    impl_->reslice->SetOutputDimensionality(2);
    impl_->reslice->SetNumberOfThreads(1);
    impl_->reslice->SetEnableSMP(false);
    impl_->reslice->SetResliceAxes(impl_->axes);
}

VtkReslice::~VtkReslice() = default;

void VtkReslice::slice(const Rigid& t, double mm_per_px, int size) {
    const Vector3 x = t.rotation.column(0), y = t.rotation.column(2), z = -t.rotation.column(1);
    for (int row = 0; row < 3; ++row) {
        impl_->axes->SetElement(row, 0, x[row]);
        impl_->axes->SetElement(row, 1, y[row]);
        impl_->axes->SetElement(row, 2, z[row]);
        impl_->axes->SetElement(row, 3, t.translation[row]);
    }
    impl_->reslice->SetOutputSpacing(mm_per_px, mm_per_px, 1);
    impl_->reslice->SetOutputOrigin(-0.5 * mm_per_px * (size - 1), 0, 0);
    impl_->reslice->SetOutputExtent(0, size - 1, 0, size - 1, 0, 0);
    impl_->reslice->Modified();
    impl_->reslice->Update();
}

}  // namespace sonocase::bench
