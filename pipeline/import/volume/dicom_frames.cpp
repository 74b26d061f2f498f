// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/dicom_frames.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "formats/text/number_text.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_volume {
namespace {

const gdcm::Tag kThickness(0x18, 0x50), kBetween(0x18, 0x88), kPosition(0x20, 0x32),
    kOrientation(0x20, 0x37), kPlanePosition(0x20, 0x9113), kPlaneOrientation(0x20, 0x9116),
    kPixelSpacing(0x28, 0x30), kPixelMeasures(0x28, 0x9110), kSegmentIdentification(0x62, 0xa),
    kReferencedSegment(0x62, 0xb), kShared(0x5200, 0x9229), kPerFrame(0x5200, 0x9230);

// Reads numbers between backslashes. False where there is no such element; one that does not hold
// as many finite numbers as wanted becomes the fault.
bool numbers_of(const gdcm::DataSet& set,
                const gdcm::Tag& tag,
                const char* name,
                double* numbers,
                int wanted,
                std::string& fault) {
    const std::string text = text_of(set, tag);
    if (text.empty()) return false;
    std::size_t at = 0;
    for (int n = 0; n < wanted; ++n) {
        const std::size_t end = std::min(text.find('\\', at), text.size());
        const bool there = at <= text.size();
        if (!there || !parse_number(text.substr(at, end - at), numbers[n]) ||
            !std::isfinite(numbers[n])) {
            if (fault.empty())
                fault = sonocase::pipeline::text("%s is '%.60s', and not %d finite number%s", name,
                                                 text.c_str(), wanted, wanted == 1 ? "" : "s");
            return false;
        }
        at = end + 1;
    }
    return true;
}

void read_measures(const gdcm::DataSet& set, DicomFrame& frame) {
    double spacing[2];
    if (numbers_of(set, kPixelSpacing, "PixelSpacing", spacing, 2, frame.fault)) {
        frame.row_spacing_mm = spacing[0];
        frame.column_spacing_mm = spacing[1];
        if (!(spacing[0] > 0 && spacing[1] > 0) && frame.fault.empty())
            frame.fault = "PixelSpacing is '" + text_of(set, kPixelSpacing) + "', and not positive";
    }
    numbers_of(set, kThickness, "SliceThickness", &frame.thickness_mm, 1, frame.fault);
    numbers_of(set, kBetween, "SpacingBetweenSlices", &frame.between_mm, 1, frame.fault);
    frame.between_mm = std::abs(frame.between_mm);  // negative in some objects of nuclear medicine
}

void read_position(const gdcm::DataSet& set, DicomFrame& frame) {
    double at[3];
    if (!numbers_of(set, kPosition, "ImagePositionPatient", at, 3, frame.fault)) return;
    frame.position = {at[0], at[1], at[2]};
    frame.has_position = true;
}

void read_orientation(const gdcm::DataSet& set, DicomFrame& frame) {
    double along[6];
    if (!numbers_of(set, kOrientation, "ImageOrientationPatient", along, 6, frame.fault)) return;
    frame.along_rows = {along[0], along[1], along[2]};
    frame.along_columns = {along[3], along[4], along[5]};
    const double rows = norm(frame.along_rows), columns = norm(frame.along_columns);
    if (!(std::abs(rows - 1) < 0.01 && std::abs(columns - 1) < 0.01 &&
          std::abs(dot(frame.along_rows, frame.along_columns)) < 0.01)) {
        if (frame.fault.empty())
            frame.fault = "ImageOrientationPatient is '" + text_of(set, kOrientation) +
                          "', and not two unit vectors at right angles";
        return;
    }
    // Rounding in the file: exactly orthonormal again.
    frame.along_rows = frame.along_rows / rows;
    const Vector3 across =
        frame.along_columns - dot(frame.along_columns, frame.along_rows) * frame.along_rows;
    frame.along_columns = across / norm(across);
    frame.has_orientation = true;
}

// What one item of functional groups says of a frame.
void read_group(const gdcm::DataSet& group, DicomFrame& frame) {
    const auto with = [&](const gdcm::Tag& tag, auto read) {
        const DicomItems items = items_of(group, tag);
        if (items && items->GetNumberOfItems() > 0)
            read(items->GetItem(1).GetNestedDataSet(), frame);
    };
    with(kPixelMeasures, read_measures);
    with(kPlanePosition, read_position);
    with(kPlaneOrientation, read_orientation);
    with(kSegmentIdentification, [](const gdcm::DataSet& set, DicomFrame& to) {
        to.segment = short_of(set, kReferencedSegment);
    });
}

}  // namespace

std::string text_of(const gdcm::DataSet& set, const gdcm::Tag& tag) {
    if (!set.FindDataElement(tag)) return {};
    const gdcm::ByteValue* bytes = set.GetDataElement(tag).GetByteValue();
    if (bytes == nullptr) return {};
    std::string text(bytes->GetPointer(), bytes->GetLength());
    while (!text.empty() && (text.back() == ' ' || text.back() == '\0')) text.pop_back();
    text.erase(0, std::min(text.find_first_not_of(' '), text.size()));
    return text;
}

// GDCM has turned the bytes to this machine's order.
int short_of(const gdcm::DataSet& set, const gdcm::Tag& tag) {
    if (!set.FindDataElement(tag)) return 0;
    const gdcm::ByteValue* bytes = set.GetDataElement(tag).GetByteValue();
    std::uint16_t value = 0;
    if (bytes != nullptr && bytes->GetLength() >= sizeof value)
        std::memcpy(&value, bytes->GetPointer(), sizeof value);
    return value;
}

int whole_of(const gdcm::DataSet& set, const gdcm::Tag& tag) {
    double value = 0;
    if (!parse_number(text_of(set, tag), value) || !(value >= 1 && value < 1e6)) return 0;
    return static_cast<int>(value);
}

DicomItems items_of(const gdcm::DataSet& set, const gdcm::Tag& tag) {
    if (!set.FindDataElement(tag)) return nullptr;
    return set.GetDataElement(tag).GetValueAsSQ();
}

std::vector<DicomFrame> frames_of(const gdcm::DataSet& set, int frames) {
    DicomFrame common, own;
    read_measures(set, common);
    read_orientation(set, common);
    read_position(set, own);
    const DicomItems shared = items_of(set, kShared), each = items_of(set, kPerFrame);
    if (shared && shared->GetNumberOfItems() > 0)
        read_group(shared->GetItem(1).GetNestedDataSet(), common);
    std::vector<DicomFrame> result(static_cast<std::size_t>(frames), common);
    const std::size_t given = each ? each->GetNumberOfItems() : 0;
    for (std::size_t n = 0; n < std::min(result.size(), given); ++n)
        read_group(each->GetItem(n + 1).GetNestedDataSet(), result[n]);
    // Its own element places the first frame of an object, and no other.
    if (!result.front().has_position) {
        result.front().position = own.position;
        result.front().has_position = own.has_position;
        if (result.front().fault.empty()) result.front().fault = own.fault;
    }
    return result;
}

}  // namespace sonocase::pipeline::inline import_volume
