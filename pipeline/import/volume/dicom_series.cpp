// SPDX-License-Identifier: Apache-2.0

// The only file of the import that includes ITK's DICOM reader.
#include <itkGDCMImageIO.h>
#include <itkObject.h>

#include <cmath>

#include "pipeline/base/quiet_library.h"
#include "pipeline/import/volume/dicom_stack.h"
#include "pipeline/import/volume/itk_component.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline {
namespace {

constexpr const char* kExpected =
    "expected one complete series of CT-like slices; export the series again";

std::string size_text(const itk::ImageIOBase& io) {
    return std::to_string(io.GetDimensions(0)) + " x " + std::to_string(io.GetDimensions(1)) +
           " pixels";
}

// Placement by the first slice; the third axis and its spacing lead to the last one.
Grid grid_of(const itk::ImageIOBase& first, Point3 last, int slices) {
    Grid grid;
    Vector3 step = last - Point3{first.GetOrigin(0), first.GetOrigin(1), first.GetOrigin(2)};
    const int frames = first.GetNumberOfDimensions() > 2 ? int(first.GetDimensions(2)) : 1;
    grid.size = {int(first.GetDimensions(0)), int(first.GetDimensions(1)), slices * frames};
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<unsigned>(axis);
        const bool through = axis == 2 && slices > 1;
        grid.spacing_mm[axis] = through ? norm(step) / (slices - 1) : first.GetSpacing(a);
        const double sign = axis < 2 ? -1 : 1;  // LPS to RAS
        grid.origin_mm[axis] = sign * first.GetOrigin(a);
        for (unsigned column = 0; column < 3; ++column)
            grid.direction(axis, static_cast<int>(column)) =
                sign * (column == 2 && slices > 1 ? step[axis] / norm(step)
                                                  : first.GetDirection(column)[a]);
    }
    return grid;
}

// Reads one slice to the end of the volume, which begins with the first and takes its type.
Status append_slice(const DicomSlice& slice, itk::GDCMImageIO& io, NativeVolume& volume) {
    const auto component = component_of(io.GetComponentType());
    if (!component || io.GetNumberOfComponents() != 1)
        return Error{"pixels that are not one whole number each", slice.path, kExpected};
    if (!volume.bytes.empty() && *component != volume.component)
        return Error{"pixels of another type than in the slices before", slice.path, kExpected};
    const auto bytes = static_cast<std::size_t>(io.GetImageSizeInBytes());
    const std::size_t at = volume.bytes.size();
    volume.component = *component;
    volume.bytes.resize(at + bytes);
    itk::ImageIORegion region(io.GetNumberOfDimensions());
    for (unsigned d = 0; d < io.GetNumberOfDimensions(); ++d)
        region.SetSize(d, io.GetDimensions(d));
    io.SetIORegion(region);
    io.Read(volume.bytes.data() + at);
    return Done{};
}

Result<NativeVolume> read_stack(const DicomStack& stack, const std::string& folder) {
    NativeVolume volume;
    volume.warnings = stack.warnings;
    const auto slices = stack.slices.size();
    itk::GDCMImageIO::Pointer first;
    Point3 last;
    for (const DicomSlice& slice : stack.slices) {
        try {
            const auto io = itk::GDCMImageIO::New();
            io->SetFileName(slice.path);
            io->ReadImageInformation();
            if (!first) {
                first = io;
                volume.bytes.reserve(slices * static_cast<std::size_t>(io->GetImageSizeInBytes()));
            }
            if (slices > 1 && io->GetNumberOfDimensions() > 2 && io->GetDimensions(2) != 1)
                return Error{"holds several slices", slice.path,
                             "expected one slice in each file, or one file with all of them"};
            if (io->GetDimensions(0) != first->GetDimensions(0) ||
                io->GetDimensions(1) != first->GetDimensions(1))
                return Error{"slice of " + size_text(*io) + " among those of " + size_text(*first),
                             slice.path, kExpected};
            if (auto status = append_slice(slice, *io, volume); !status) return status.error();
            last = {io->GetOrigin(0), io->GetOrigin(1), io->GetOrigin(2)};
        } catch (const itk::ExceptionObject& exception) {
            return Error{
                std::string("cannot be read as a DICOM slice (") + exception.GetDescription() + ")",
                slice.path, kExpected};
        }
    }
    volume.grid = grid_of(*first, last, static_cast<int>(slices));
    for (int a = 0; a < 3; ++a)
        for (int b = a + 1; b < 3; ++b)
            if (std::abs(dot(volume.grid.direction.column(a), volume.grid.direction.column(b))) >
                1e-3)
                return Error{"slices are sheared against their stack (tilted gantry)", folder,
                             "resample the series to an orthogonal grid first"};
    return volume;
}

}  // namespace

Result<NativeVolume> read_dicom_series(const std::string& folder) {
    const QuietLibrary quiet;
    itk::Object::GlobalWarningDisplayOff();
    auto stack = dicom_stack(read_dicom_headers(folder), folder);
    if (!stack) return stack.error();
    try {
        return read_stack(*stack, folder);
    } catch (const std::exception& exception) {
        return Error{std::string("cannot be read as a DICOM series (") + exception.what() + ")",
                     folder, kExpected};
    }
}

}  // namespace sonocase::pipeline
