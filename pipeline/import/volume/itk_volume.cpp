// SPDX-License-Identifier: Apache-2.0

// The only file of the import that includes ITK's single-file readers.
#include <itkImageIOBase.h>
#include <itkMetaDataObject.h>
#include <itkMetaImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkObject.h>

#include <filesystem>

#include "formats/files/atomic_file.h"
#include "pipeline/base/quiet_library.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/native_volume.h"
#include "pipeline/import/volume/nifti_file.h"
#include "pipeline/import/volume/volume_file.h"
#include "pipeline/import/volume/volume_header.h"

namespace sonocase::pipeline::inline import_volume {
namespace {

itk::ImageIOBase::Pointer reader_for(const std::string& path) {
    if (has_ending(path, ".nrrd") || has_ending(path, ".nhdr"))
        return itk::NrrdImageIO::New().GetPointer();
    return itk::MetaImageIO::New().GetPointer();
}

std::string sizes_text(const itk::ImageIOBase& io) {
    std::string text;
    for (unsigned d = 0; d < io.GetNumberOfDimensions(); ++d)
        text += (d > 0 ? " x " : "") + std::to_string(io.GetDimensions(d));
    return text;
}

// ITK's sizes are those of the header that places the voxels, or its geometry is not of them.
Status check_sizes(const itk::ImageIOBase& io,
                   const Placement& placement,
                   const std::string& path) {
    for (int axis = 0; axis < 3; ++axis)
        if (io.GetDimensions(static_cast<unsigned>(axis)) !=
            static_cast<std::size_t>(placement.size[axis]))
            return Error{"volume of " + sizes_text(io) +
                             " voxels has its axes in another order than "
                             "its geometry",
                         path, "write the volume again with its geometry in the header"};
    return Done{};
}

}  // namespace

bool is_volume_file_name(const std::string& path) {
    for (const char* ending : {".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd"})
        if (has_ending(path, ending)) return true;
    return false;
}

std::string volume_stem(const std::string& path) {
    std::string name = std::filesystem::path(path).filename().string();
    for (const char* ending : {".nii.gz", ".nii", ".seg.nrrd", ".nrrd", ".nhdr", ".mha", ".mhd"}) {
        if (has_ending(name, ending))
            return name.substr(0, name.size() - std::char_traits<char>::length(ending));
    }
    return name;
}

namespace {

bool is_bzip2_nrrd(const std::string& path) {
    return (has_ending(path, ".nrrd") || has_ending(path, ".nhdr")) && is_bzip2(header_text(path));
}

std::uint64_t bytes_in(const Placement& placement, const NrrdVoxels& voxels) {
    std::uint64_t bytes = static_cast<std::uint64_t>(voxels.layers) * bytes_of(voxels.component);
    for (int axis = 0; axis < 3; ++axis) bytes *= static_cast<std::uint64_t>(placement.size[axis]);
    return bytes;
}

// ITK of Debian is built without bzip2.
Result<NativeVolume> read_bzip2_nrrd(const std::string& path,
                                     const Placement& placement,
                                     const VolumeReading& reading) {
    SONOCASE_TRY(auto voxels, nrrd_voxels(header_text(path), path));
    NativeVolume volume;
    SONOCASE_TRY_DONE(place_volume(placement, reading, path, volume));
    volume.component = voxels.component;
    volume.layers = voxels.layers;
    volume.planar = voxels.planar;
    volume.fields = std::move(voxels.fields);
    const std::uint64_t bytes = bytes_in(placement, voxels);
    if (bytes > kMaxVolumeBytes)
        return Error{"header asks for " + std::to_string(bytes >> 30) + " GB of voxels", path,
                     "check that the file is complete; export it again"};
    SONOCASE_TRY_DONE(check_room(volume, bytes, path));
    SONOCASE_TRY(const auto file, read_file(voxels.data_path));
    SONOCASE_TRY(volume.bytes, unpack_bzip2(file, voxels.voxels_at, bytes, path));
    if (voxels.swapped) swap_bytes(volume.bytes, bytes_of(volume.component));
    return volume;
}

}  // namespace

VolumeSize size_in_file_header(const std::string& path) {
    if (!check_source_file(path, "") || !check_data_files(path)) return {};
    if (is_nifti_name(path)) {
        const auto header = read_nifti_header(path, Orientation::automatic);
        if (!header) return {};
        VolumeSize size;
        size.bytes = header->voxel_bytes();
        size.voxels = size.bytes / bytes_of(header->component);
        for (int axis = 0; axis < 3; ++axis)
            size.spacing_mm[axis] = norm(header->placement.columns.column(axis));
        return size;
    }
    const auto placement = placement_in_header(path);
    if (!placement) return {};
    const Matrix3& steps = placement->columns;
    if (is_bzip2_nrrd(path)) {
        const auto voxels = nrrd_voxels(header_text(path), path);
        if (!voxels) return {};
        const std::uint64_t bytes = bytes_in(*placement, *voxels);
        return {bytes / bytes_of(voxels->component),
                bytes,
                {norm(steps.column(0)), norm(steps.column(1)), norm(steps.column(2))}};
    }
    const QuietLibrary quiet;
    itk::Object::GlobalWarningDisplayOff();
    try {
        const itk::ImageIOBase::Pointer io = reader_for(path);
        io->SetFileName(path);
        io->ReadImageInformation();
        return {static_cast<std::uint64_t>(io->GetImageSizeInPixels()),
                static_cast<std::uint64_t>(io->GetImageSizeInBytes()),
                {norm(steps.column(0)), norm(steps.column(1)), norm(steps.column(2))}};
    } catch (const std::exception&) {  // reading the voxels will report it
        return {};
    }
}

Result<NativeVolume> read_itk_volume(const std::string& path, const VolumeReading& reading) {
    const char* todo = "check that the file is complete; export it again";
    SONOCASE_TRY_DONE(check_data_files(path));
    SONOCASE_TRY(const auto placement, placement_in_header(path));
    if (has_ending(path, ".nrrd") || has_ending(path, ".nhdr")) {
        SONOCASE_TRY_DONE(check_nrrd_encoding(header_text(path), path));
    }
    if (is_bzip2_nrrd(path)) return read_bzip2_nrrd(path, placement, reading);
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
        const std::string type = io->GetComponentTypeAsString(io->GetComponentType());
        const auto component = component_called(type);
        if (!component) return Error{"voxels of type " + type, path, "expected whole numbers"};
        SONOCASE_TRY_DONE(check_sizes(*io, placement, path));

        NativeVolume volume;
        SONOCASE_TRY_DONE(place_volume(placement, reading, path, volume));
        volume.component = *component;
        volume.layers = static_cast<int>(io->GetNumberOfComponents());
        const auto bytes = static_cast<std::uint64_t>(io->GetImageSizeInBytes());
        if (bytes > kMaxVolumeBytes)
            return Error{"header asks for " + std::to_string(bytes >> 30) + " GB of voxels", path,
                         todo};
        // A file that is cut off is refused before room is made for what its header promises.
        SONOCASE_TRY_DONE(check_meta_length(path, bytes, volume.warnings));
        SONOCASE_TRY_DONE(check_nrrd_length(path, bytes, volume.warnings));
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
        return volume;
    } catch (const std::exception&) {  // its text is for programmers
        return Error{
            "the voxels cannot be read: the file is damaged, or packed in a way that is not known "
            "here",
            path, "copy it or export it again, as .nii.gz or .nrrd"};
    }
}

}  // namespace sonocase::pipeline::inline import_volume
