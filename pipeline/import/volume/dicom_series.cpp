// SPDX-License-Identifier: Apache-2.0

// DICOM series: headers, the order of the slices, and their pixels through ITK.

#include "pipeline/import/volume/dicom_series.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <tuple>

#include <gdcmReader.h>
#include <itkGDCMImageIO.h>
#include <itkObject.h>

#include "formats/text/number_text.h"
#include "pipeline/base/quiet_library.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/itk_component.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline::inline import_volume {

namespace {

namespace fs = std::filesystem;

const gdcm::Tag kThickness(0x18, 0x50), kSeries(0x20, 0xe), kAcquisition(0x20, 0x12),
    kNumber(0x20, 0x13), kPosition(0x20, 0x32), kOrientation(0x20, 0x37),
    kInAcquisition(0x20, 0x1002), kInSeries(0x20, 0x1209), kSamples(0x28, 2), kFrames(0x28, 8),
    kRows(0x28, 0x10), kColumns(0x28, 0x11), kBits(0x28, 0x100), kSlices(0x54, 0x81),
    kPixels(0x7fe0, 0x10);

// The bytes of an element, without the padding; empty where there is none.
std::string value_of(const gdcm::DataSet& set, const gdcm::Tag& tag) {
    if (!set.FindDataElement(tag)) return {};
    const gdcm::ByteValue* bytes = set.GetDataElement(tag).GetByteValue();
    if (bytes == nullptr) return {};
    return {bytes->GetPointer(), bytes->GetLength()};
}

std::string text_of(const gdcm::DataSet& set, const gdcm::Tag& tag) {
    std::string text = value_of(set, tag);
    while (!text.empty() && (text.back() == ' ' || text.back() == '\0')) text.pop_back();
    text.erase(0, std::min(text.find_first_not_of(' '), text.size()));
    return text;
}

// An element of 16 bits; GDCM has turned its bytes to this machine's order.
int short_of(const gdcm::DataSet& set, const gdcm::Tag& tag) {
    const std::string bytes = value_of(set, tag);
    std::uint16_t value = 0;
    if (bytes.size() >= 2) std::memcpy(&value, bytes.data(), 2);
    return value;
}

int whole_of(const gdcm::DataSet& set, const gdcm::Tag& tag) {
    double value = 0;
    if (!parse_number(text_of(set, tag), value) || !(value > 0 && value < 1e6)) return 0;
    return static_cast<int>(value);
}

// Numbers between backslashes; false unless there are as many as wanted.
bool numbers_of(const std::string& text, double* numbers, int wanted) {
    std::size_t at = 0;
    for (int n = 0; n < wanted; ++n) {
        if (at > text.size()) return false;
        const std::size_t end = std::min(text.find('\\', at), text.size());
        std::string one = text.substr(at, end - at);
        one.erase(0, std::min(one.find_first_not_of(" +"), one.size()));
        while (!one.empty() && one.back() == ' ') one.pop_back();
        if (!parse_number(one, numbers[n])) return false;
        at = end + 1;
    }
    return true;
}

DicomSlice slice_of(const gdcm::DataSet& set) {
    DicomSlice slice;
    slice.series = text_of(set, kSeries);
    slice.acquisition = text_of(set, kAcquisition);
    slice.thickness = text_of(set, kThickness);
    slice.rows = short_of(set, kRows);
    slice.columns = short_of(set, kColumns);
    slice.frames = std::max(1, whole_of(set, kFrames));
    slice.number = whole_of(set, kNumber);
    slice.declared = whole_of(set, kInSeries);
    if (slice.declared == 0) slice.declared = short_of(set, kSlices);
    if (slice.declared == 0) {
        slice.declared = whole_of(set, kInAcquisition);
        slice.declared_for_acquisition = true;
    }
    double at[3], along[6];
    slice.placed = numbers_of(text_of(set, kPosition), at, 3) &&
                   numbers_of(text_of(set, kOrientation), along, 6);
    if (slice.placed) {
        slice.position = {at[0], at[1], at[2]};
        slice.along_rows = {along[0], along[1], along[2]};
        slice.along_columns = {along[3], along[4], along[5]};
    }
    return slice;
}

// Whether the file ends before its pixels do. GDCM reads such a file and leaves the rest as zeros.
// Pixels that are compressed say so themselves.
bool is_cut_off(const gdcm::Reader& reader, const std::string& path, const DicomSlice& slice) {
    const gdcm::File& dicom = reader.GetFile();
    const gdcm::TransferSyntax syntax = dicom.GetHeader().GetDataSetTransferSyntax();
    if (syntax.IsEncapsulated() || syntax == gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian)
        return false;
    const gdcm::DataSet& set = dicom.GetDataSet();
    const std::uint64_t bits = static_cast<std::uint64_t>(slice.rows) *
                               static_cast<std::uint64_t>(slice.columns) *
                               static_cast<std::uint64_t>(std::max(1, slice.frames)) *
                               static_cast<std::uint64_t>(std::max(1, short_of(set, kSamples))) *
                               static_cast<std::uint64_t>(short_of(set, kBits));
    std::uint64_t at = reader.GetStreamCurrentPosition();
    std::ifstream file(path, std::ios::binary);
    char tag[8] = {};
    file.seekg(static_cast<std::streamoff>(at));
    if (file.read(tag, sizeof tag) && std::memcmp(tag, "\xe0\x7f\x10\x00", 4) == 0)
        at += tag[4] == 'O' ? 12 : 8;  // with its kind, or without
    std::error_code code;
    return fs::file_size(path, code) < at + bits / 8;
}

}  // namespace

std::vector<DicomSlice> read_dicom_headers(const std::string& folder) {
    std::vector<std::string> paths;
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(folder, code))
        if (entry.is_regular_file(code)) paths.push_back(entry.path().string());
    std::sort(paths.begin(), paths.end());  // a folder lists its files in no fixed order
    const QuietLibrary quiet;
    std::vector<DicomSlice> slices;
    for (const std::string& path : paths) {
        try {
            gdcm::Reader reader;
            reader.SetFileName(path.c_str());
            if (!reader.CanRead() || !reader.ReadUpToTag(kPixels, {kPixels})) continue;
            DicomSlice slice = slice_of(reader.GetFile().GetDataSet());
            slice.path = path;
            if (slice.rows < 1 || slice.columns < 1) continue;
            slice.cut_off = is_cut_off(reader, path, slice);
            slices.push_back(std::move(slice));
        } catch (const std::exception&) {  // not a file of this kind
            continue;
        }
    }
    return slices;
}

namespace {

constexpr const char* kExpected =
    "expected one complete series of CT-like slices; export the series again";
constexpr double kMaxShift = 0.05;   // of the spacing, off even places
constexpr double kSameSlice = 0.01;  // of the spacing: two slices in one place

std::string name_of(const DicomSlice& slice) {
    return std::filesystem::path(slice.path).filename().string();
}

// The slices of each stack that the folder could mean, in the order of their names.
std::map<std::string, std::vector<DicomSlice>> by_series(std::vector<DicomSlice> slices) {
    std::map<std::string, std::vector<DicomSlice>> series;
    for (DicomSlice& slice : slices)
        series[slice.series + " " + slice.thickness + " " + std::to_string(slice.rows) + " x " +
               std::to_string(slice.columns)]
            .push_back(std::move(slice));
    return series;
}

Status check_directions(const std::vector<DicomSlice>& slices) {
    const DicomSlice& first = slices.front();
    for (const DicomSlice& slice : slices) {
        if (!slice.placed) return Error{"slice does not say where it lies", slice.path, kExpected};
        if (norm(slice.along_rows - first.along_rows) > 1e-3 ||
            norm(slice.along_columns - first.along_columns) > 1e-3)
            return Error{"slice is turned against " + name_of(first), slice.path, kExpected};
    }
    return Done{};
}

// "; NAME, which lies there, is of another series" for a slice between two others; else empty.
std::string stray_between(const std::vector<DicomSlice>& others,
                          const DicomSlice& before,
                          const DicomSlice& after,
                          Vector3 normal) {
    for (const DicomSlice& other : others) {
        if (!other.placed) continue;
        const double place = dot(other.position - before.position, normal);
        const double gap = dot(after.position - before.position, normal);
        if (place > 0.1 * gap && place < 0.9 * gap)
            return "; " + name_of(other) + ", which lies there, is of another series";
    }
    return "";
}

// Errors of the spacing of slices that are in order along the normal.
Status check_spacing(const std::vector<DicomSlice>& slices,
                     const std::vector<DicomSlice>& others,
                     Vector3 normal) {
    std::vector<double> gaps;
    for (std::size_t n = 1; n < slices.size(); ++n)
        gaps.push_back(dot(slices[n].position - slices[n - 1].position, normal));
    std::vector<double> sorted = gaps;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    double step = *middle;
    if (!(step > 1e-6)) step = *std::max_element(gaps.begin(), gaps.end());
    for (std::size_t n = 0; n < gaps.size(); ++n) {
        const DicomSlice &before = slices[n], &after = slices[n + 1];
        if (!(gaps[n] > kSameSlice * step))
            return Error{"slice is there twice, in " + name_of(before) + " as well", after.path,
                         kExpected};
        if (gaps[n] < 1.5 * step) continue;
        const long missing = std::max(1L, std::lround(gaps[n] / step) - 1);
        return Error{text("%ld slice%s missing between %s and %s, %.4g mm apart where others are "
                          "%.4g",
                          missing, missing == 1 ? " is" : "s are", name_of(before).c_str(),
                          name_of(after).c_str(), gaps[n], step) +
                         stray_between(others, before, after, normal),
                     after.path, kExpected};
    }
    // Even places lie on the line from the first slice to the last.
    const double count = static_cast<double>(gaps.size());
    const Vector3 even = (slices.back().position - slices.front().position) / count;
    for (std::size_t n = 1; n < gaps.size(); ++n) {
        const Point3 place = slices.front().position + static_cast<double>(n) * even;
        const double off = distance(place, slices[n].position);
        if (off > kMaxShift * norm(even))
            return Error{
                text("slices are unevenly spaced: this one lies %.3g mm off its place", off),
                slices[n].path, kExpected};
    }
    return Done{};
}

// Slices missing at an end show in the numbers that headers declare, if they declare any.
Status check_declared(const std::vector<DicomSlice>& slices) {
    std::map<std::string, int> of_acquisition;
    for (const DicomSlice& slice : slices) ++of_acquisition[slice.acquisition];
    for (const DicomSlice& slice : slices) {
        const int found = slice.declared_for_acquisition ? of_acquisition[slice.acquisition]
                                                         : static_cast<int>(slices.size());
        if (slice.declared > found)
            return Error{text("header says that there are %d slices, and there are %d: those at an "
                              "end are missing",
                              slice.declared, found),
                         slice.path, kExpected};
    }
    return Done{};
}

// Where no header declares a number, a first slice that is not number 1 is all there is to go by.
std::string warning_of_numbers(const std::vector<DicomSlice>& slices) {
    int lowest = slices.front().number;
    for (const DicomSlice& slice : slices) {
        if (slice.declared > 0 || slice.number < 1) return "";
        lowest = std::min(lowest, slice.number);
    }
    if (lowest < 2) return "";
    return text(
        "the DICOM slices are numbered from %d: check that none is missing at the end of "
        "the body",
        lowest);
}

}  // namespace

Result<DicomStack> dicom_stack(std::vector<DicomSlice> slices, const std::string& folder) {
    auto series = by_series(std::move(slices));
    if (series.empty())
        return Error{"folder holds neither masks nor DICOM slices", folder,
                     "expected one .nii.gz (or .nrrd, .mha) mask per structure, or a DICOM series"};
    auto largest = series.begin();
    for (auto it = series.begin(); it != series.end(); ++it)
        if (it->second.size() > largest->second.size()) largest = it;
    DicomStack stack;
    stack.slices = std::move(largest->second);
    series.erase(largest);
    std::vector<DicomSlice> others;
    for (auto& [uid, of_series] : series)
        others.insert(others.end(), of_series.begin(), of_series.end());
    if (!others.empty())
        stack.warnings.push_back(
            text("folder holds %zu DICOM series; the one with the most slices (%zu) was taken, and "
                 "not %s: keep one series per folder",
                 series.size() + 1, stack.slices.size(), name_of(others.front()).c_str()));
    for (const DicomSlice& slice : stack.slices)
        if (slice.cut_off)
            return Error{"file is cut off: it ends before its pixels do", slice.path,
                         "copy or export the series again"};
    if (stack.slices.size() == 1) return stack;

    SONOCASE_TRY_DONE(check_directions(stack.slices));
    const DicomSlice& any = stack.slices.front();
    const Vector3 normal = cross(any.along_rows, any.along_columns);
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t n = 0; n < stack.slices.size(); ++n)
        order.emplace_back(dot(stack.slices[n].position - Point3{}, normal), n);
    std::sort(order.begin(), order.end());  // by place, then by name
    std::vector<DicomSlice> in_order;
    for (const auto& [place, n] : order) in_order.push_back(std::move(stack.slices[n]));
    stack.slices = std::move(in_order);
    SONOCASE_TRY_DONE(check_spacing(stack.slices, others, normal));
    SONOCASE_TRY_DONE(check_declared(stack.slices));
    if (std::string warning = warning_of_numbers(stack.slices); !warning.empty())
        stack.warnings.push_back(std::move(warning));
    return stack;
}

namespace {

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
            SONOCASE_TRY_DONE(append_slice(slice, *io, volume));
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
    SONOCASE_TRY(auto stack, dicom_stack(read_dicom_headers(folder), folder));
    try {
        return read_stack(stack, folder);
    } catch (const std::exception& exception) {
        return Error{std::string("cannot be read as a DICOM series (") + exception.what() + ")",
                     folder, kExpected};
    }
}

}  // namespace sonocase::pipeline::inline import_volume
