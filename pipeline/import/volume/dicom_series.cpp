// SPDX-License-Identifier: Apache-2.0

// The only file of the import that includes ITK's DICOM reader.
#include <itkGDCMImageIO.h>
#include <itkGDCMSeriesFileNames.h>
#include <itkImageSeriesReader.h>
#include <itkMetaDataObject.h>
#include <itkObject.h>

#include <cmath>
#include <cstring>

#include "pipeline/base/quiet_library.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline {

Result<NativeVolume> read_dicom_series(const std::string& folder) {
    using Image = itk::Image<std::int32_t, 3>;
    const char* todo = "expected one complete series of CT-like slices; export the series again";
    const QuietLibrary quiet;
    itk::Object::GlobalWarningDisplayOff();
    try {
        const auto names = itk::GDCMSeriesFileNames::New();
        names->SetUseSeriesDetails(true);
        names->SetDirectory(folder);
        const std::vector<std::string> series = names->GetSeriesUIDs();
        if (series.empty())
            return Error{
                "folder holds neither masks nor DICOM slices", folder,
                "expected one .nii.gz (or .nrrd, .mha) mask per structure, or a DICOM series"};
        std::vector<std::string> files;
        for (const std::string& uid : series) {
            const std::vector<std::string> candidate = names->GetFileNames(uid);
            if (candidate.size() > files.size()) files = candidate;
        }
        const auto io = itk::GDCMImageIO::New();
        const auto reader = itk::ImageSeriesReader<Image>::New();
        reader->SetImageIO(io);
        reader->SetFileNames(files);
        reader->ForceOrthogonalDirectionOff();
        reader->Update();
        const Image& image = *reader->GetOutput();

        NativeVolume volume;
        if (series.size() > 1)
            volume.warnings.push_back("folder holds " + std::to_string(series.size()) +
                                      " DICOM series; the one with the most slices (" +
                                      std::to_string(files.size()) +
                                      ") was taken: keep one series per folder");
        double deviation = 0;
        if (itk::ExposeMetaData(image.GetMetaDataDictionary(), "ITK_non_uniform_sampling_deviation",
                                deviation))
            return Error{"slices are unevenly spaced, by up to " + std::to_string(deviation) +
                             " mm: some may be missing or there twice",
                         folder, todo};
        volume.component = Component::i32;
        const auto size = image.GetLargestPossibleRegion().GetSize();
        for (int axis = 0; axis < 3; ++axis) {
            const auto a = static_cast<unsigned>(axis);
            const double sign = axis < 2 ? -1 : 1;  // LPS to RAS
            volume.grid.size[axis] = static_cast<std::int32_t>(size[a]);
            volume.grid.spacing_mm[axis] = image.GetSpacing()[a];
            volume.grid.origin_mm[axis] = sign * image.GetOrigin()[a];
            for (unsigned column = 0; column < 3; ++column)
                volume.grid.direction(axis, static_cast<int>(column)) =
                    sign * image.GetDirection()(a, column);
        }
        for (int a = 0; a < 3; ++a)
            for (int b = a + 1; b < 3; ++b)
                if (std::abs(dot(volume.grid.direction.column(a),
                                 volume.grid.direction.column(b))) > 1e-3)
                    return Error{"slices are sheared against their stack (tilted gantry)", folder,
                                 "resample the series to an orthogonal grid first"};
        volume.bytes.resize(volume.grid.voxel_count() * sizeof(std::int32_t));
        std::memcpy(volume.bytes.data(), image.GetBufferPointer(), volume.bytes.size());
        return volume;
    } catch (const itk::ExceptionObject& exception) {
        std::string what = exception.GetDescription();
        return Error{"cannot be read as a DICOM series (" + what + ")", folder, todo};
    } catch (const std::exception& exception) {
        return Error{std::string("cannot be read as a DICOM series (") + exception.what() + ")",
                     folder, todo};
    }
}

}  // namespace sonocase::pipeline
