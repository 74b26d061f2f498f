// SPDX-License-Identifier: Apache-2.0

// The only file of the import that includes ITK's single-file readers.
#include <itkImageIOBase.h>
#include <itkMetaDataObject.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkObject.h>

#include <cmath>
#include <filesystem>

#include "pipeline/base/memory_limit.h"
#include "pipeline/base/quiet_library.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/itk_component.h"
#include "pipeline/import/volume/native_volume.h"
#include "pipeline/import/volume/volume_file.h"
#include "pipeline/import/volume/volume_header.h"

namespace sonocase::pipeline::inline import_volume {
namespace {

constexpr std::uint64_t kMaxBytes = 16ull << 30;  // no patient's volume is larger

itk::ImageIOBase::Pointer reader_for(const std::string& path) {
    const auto ends = [&](const char* ending) { return path.ends_with(ending); };
    if (ends(".nii") || ends(".nii.gz")) return itk::NiftiImageIO::New().GetPointer();
    if (ends(".nrrd") || ends(".nhdr")) return itk::NrrdImageIO::New().GetPointer();
    return itk::MetaImageIO::New().GetPointer();
}

std::string sizes_text(const itk::ImageIOBase& io) {
    std::string text;
    for (unsigned d = 0; d < io.GetNumberOfDimensions(); ++d)
        text += (d > 0 ? " x " : "") + std::to_string(io.GetDimensions(d));
    return text;
}

// ITK's NIfTI reader reports axes in metres as not orthogonal too: their matrix is nearly 0.
Error not_orthogonal(const std::string& path) {
    return {"voxel axes are not at right angles, or are not in millimetres", path,
            "write the geometry in millimetres, or resample the volume to an orthogonal grid "
            "(Slicer: Resample Image)"};
}

Result<Grid> grid_of(const itk::ImageIOBase& io, const std::string& path) {
    Grid grid;
    Matrix3 direction;
    for (int axis = 0; axis < 3; ++axis) {
        const auto unsigned_axis = static_cast<unsigned>(axis);
        const auto size = io.GetDimensions(unsigned_axis);
        if (size < 1 || size > 65535)
            return Error{"volume of " + sizes_text(io) + " voxels", path,
                         "expected 1 to 65535 per side"};
        grid.size[axis] = static_cast<std::int32_t>(size);
        grid.spacing_mm[axis] = io.GetSpacing(unsigned_axis);
        grid.origin_mm[axis] = io.GetOrigin(unsigned_axis);
        const std::vector<double> column = io.GetDirection(unsigned_axis);
        for (int row = 0; row < 3; ++row) direction(row, axis) = column[row];
        if (!(grid.spacing_mm[axis] > 0) || !std::isfinite(grid.spacing_mm[axis]) ||
            !std::isfinite(grid.origin_mm[axis]))
            return Error{"voxel size or origin is not a positive, finite number", path,
                         "write the volume again with its geometry in the header"};
    }
    // ITK uses LPS: x to the left, y to the back.
    for (int row = 0; row < 2; ++row) {
        grid.origin_mm[row] = -grid.origin_mm[row];
        for (int column = 0; column < 3; ++column) direction(row, column) = -direction(row, column);
    }
    for (int a = 0; a < 3; ++a) {
        for (int b = a; b < 3; ++b) {
            const double expected = a == b ? 1 : 0;
            if (!(std::abs(dot(direction.column(a), direction.column(b)) - expected) < 1e-3))
                return not_orthogonal(path);
        }
    }
    grid.direction = direction;
    return grid;
}

// The voxels in the file's type, and a byte for each value, must fit into memory.
Status check_room(const NativeVolume& volume, std::uint64_t bytes, const std::string& path) {
    const double values = static_cast<double>(volume.grid.voxel_count()) * volume.layers;
    const double mb = (static_cast<double>(bytes) + values) / 1e6;
    if (mb <= memory_limit_mb()) return Done{};
    return Error{text("its %.0f million voxels take %.0f MB, and there are %.0f MB", values / 1e6,
                      mb, memory_limit_mb()),
                 path, "a coarser or cropped label map, or more memory"};
}

}  // namespace

bool is_volume_file_name(const std::string& path) {
    for (const char* ending : {".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd"})
        if (path.ends_with(ending)) return true;
    return false;
}

std::string volume_stem(const std::string& path) {
    std::string name = std::filesystem::path(path).filename().string();
    for (const char* ending : {".nii.gz", ".nii", ".seg.nrrd", ".nrrd", ".nhdr", ".mha", ".mhd"}) {
        if (name.ends_with(ending))
            return name.substr(0, name.size() - std::char_traits<char>::length(ending));
    }
    return name;
}

VolumeSize size_in_file_header(const std::string& path) {
    if (!check_source_file(path, "") || !check_data_files(path)) return {};
    const QuietLibrary quiet;
    itk::Object::GlobalWarningDisplayOff();
    try {
        const itk::ImageIOBase::Pointer io = reader_for(path);
        io->SetFileName(path);
        io->ReadImageInformation();
        VolumeSize size{static_cast<std::uint64_t>(io->GetImageSizeInPixels()),
                        static_cast<std::uint64_t>(io->GetImageSizeInBytes()),
                        {}};
        if (io->GetNumberOfDimensions() >= 3)
            size.spacing_mm = {io->GetSpacing(0), io->GetSpacing(1), io->GetSpacing(2)};
        return size;
    } catch (const std::exception&) {  // reading the voxels will report it
        return {};
    }
}

Result<NativeVolume> read_itk_volume(const std::string& path) {
    const char* todo = "check that the file is complete; export it again";
    SONOCASE_TRY_DONE(check_data_files(path));
    const QuietLibrary quiet;  // the C libraries below ITK print as well as throw
    itk::Object::GlobalWarningDisplayOff();
    try {
        const itk::ImageIOBase::Pointer io = reader_for(path);
        io->SetFileName(path);
        io->ReadImageInformation();
        const unsigned dimensions = io->GetNumberOfDimensions();
        for (unsigned d = 3; d < dimensions; ++d) {
            if (io->GetDimensions(d) != 1)
                return Error{"volume of " + sizes_text(*io) + " voxels", path,
                             "expected three dimensions; export one time step"};
        }
        if (dimensions < 3)
            return Error{"an image of " + sizes_text(*io) + " pixels", path,
                         "expected a volume of three dimensions"};
        const auto component = component_of(io->GetComponentType());
        if (!component)
            return Error{"voxels of type " + io->GetComponentTypeAsString(io->GetComponentType()),
                         path, "expected whole numbers"};
        SONOCASE_TRY(auto grid, grid_of(*io, path));

        NativeVolume volume;
        volume.grid = grid;
        volume.component = *component;
        volume.layers = static_cast<int>(io->GetNumberOfComponents());
        const auto bytes = static_cast<std::uint64_t>(io->GetImageSizeInBytes());
        if (bytes > kMaxBytes)
            return Error{"header asks for " + std::to_string(bytes >> 30) + " GB of voxels", path,
                         todo};
        // A file that is cut off is refused before room is made for what its header promises.
        SONOCASE_TRY_DONE(check_nifti_length(path, bytes));
        SONOCASE_TRY_DONE(check_meta_length(path, bytes));
        SONOCASE_TRY_DONE(check_nrrd_length(path, bytes));
        SONOCASE_TRY_DONE(check_room(volume, bytes, path));
        volume.bytes.resize(bytes);
        itk::ImageIORegion region(dimensions);
        for (unsigned d = 0; d < dimensions; ++d) region.SetSize(d, io->GetDimensions(d));
        io->SetIORegion(region);
        io->Read(volume.bytes.data());

        const itk::MetaDataDictionary& dictionary = io->GetMetaDataDictionary();
        for (const std::string& key : dictionary.GetKeys()) {
            std::string value;
            if (itk::ExposeMetaData(dictionary, key, value)) volume.fields[key] = value;
        }
        if (auto warning = nifti_orientation_warning(path); !warning.empty())
            volume.warnings.push_back(std::move(warning));
        return volume;
    } catch (const itk::ExceptionObject& exception) {
        std::string what = exception.GetDescription();
        if (const auto at = what.find("): "); at != std::string::npos) what = what.substr(at + 3);
        if (what.find("orthonormal") != std::string::npos) return not_orthogonal(path);
        return Error{"cannot be read as a volume (" + what + ")", path, todo};
    } catch (const std::exception& exception) {
        return Error{std::string("cannot be read as a volume (") + exception.what() + ")", path,
                     todo};
    }
}

}  // namespace sonocase::pipeline::inline import_volume
