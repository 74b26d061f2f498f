// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/png.h"

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>

namespace sonocase::pipeline {
namespace {

std::vector<std::uint8_t> png_of(const std::uint8_t* pixels, int width, int height, int channels) {
    vtkNew<vtkImageData> image;
    image->SetDimensions(width, height, 1);
    image->AllocateScalars(VTK_UNSIGNED_CHAR, channels);
    auto* to = static_cast<std::uint8_t*>(image->GetScalarPointer());
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(channels) * width;
    // VTK's rows run upwards.
    for (int y = 0; y < height; ++y)
        std::copy_n(pixels + y * row, row, to + (height - 1 - y) * row);
    vtkNew<vtkPNGWriter> writer;
    writer->WriteToMemoryOn();
    writer->SetInputData(image);
    writer->Write();
    vtkUnsignedCharArray* bytes = writer->GetResult();
    return {bytes->GetPointer(0), bytes->GetPointer(0) + bytes->GetNumberOfValues()};
}

}  // namespace

std::vector<std::uint8_t> png_from_grey(const std::uint8_t* pixels, int width_px, int height_px) {
    return png_of(pixels, width_px, height_px, 1);
}

std::vector<std::uint8_t> png_from_rgb(const std::uint8_t* pixels, int width_px, int height_px) {
    return png_of(pixels, width_px, height_px, 3);
}

}  // namespace sonocase::pipeline
