// SPDX-License-Identifier: Apache-2.0

// The headers of DICOM files, without their pixels.
#include <gdcmReader.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>

#include "formats/text/number_text.h"
#include "pipeline/base/quiet_library.h"
#include "pipeline/import/volume/dicom_stack.h"

namespace sonocase::pipeline {
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
    std::string value(bytes->GetPointer(), bytes->GetLength());
    return value;
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

}  // namespace sonocase::pipeline
