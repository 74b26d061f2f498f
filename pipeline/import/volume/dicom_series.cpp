// SPDX-License-Identifier: Apache-2.0

// DICOM files and folders: headers, the order of the slices, and their pixels through ITK.

#include "pipeline/import/volume/dicom_series.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <tuple>

#include <gdcmBitmap.h>
#include <gdcmReader.h>
#include <itkGDCMImageIO.h>
#include <itkObject.h>

#include "formats/base/constants.h"
#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "pipeline/base/quiet_library.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/dicom_frames.h"
#include "pipeline/import/volume/dicom_segmentation.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline::inline import_volume {

namespace {

namespace fs = std::filesystem;

DicomSlice slice_of(const DicomSet& set) {
    DicomSlice slice;
    slice.instance = text_of(set, kTagInstance);
    slice.series = text_of(set, kTagSeries);
    slice.acquisition = text_of(set, kTagAcquisition);
    slice.moment = text_of(set, kTagMoment);
    slice.modality = text_of(set, kTagModality);
    slice.description = text_of(set, kTagDescription);
    slice.frame_of_reference = text_of(set, kTagFrameOfReference);
    slice.patient = text_of(set, kTagPatient);
    slice.rows = short_of(set, kTagRows);
    slice.columns = short_of(set, kTagColumns);
    slice.file_frames = std::max(1, whole_of(set, kTagFrames));
    slice.frames = frames_of(set, slice.file_frames);
    slice.number = whole_of(set, kTagNumber);
    slice.declared = whole_of(set, kTagInSeries);
    if (slice.declared == 0) slice.declared = short_of(set, kTagSlices);
    if (slice.declared == 0) {
        slice.declared = whole_of(set, kTagInAcquisition);
        slice.declared_for_acquisition = true;
    }
    return slice;
}

// Whether the file ends before its pixels do. GDCM reads such a file and leaves the rest as zeros.
bool is_cut_off(const DicomHeader& header) {
    const auto count = [&](DicomTag tag) {
        return static_cast<std::uint64_t>(std::max(1, short_of(header.set, tag)));
    };
    const std::uint64_t bits =
        count(kTagRows) * count(kTagColumns) * count(kTagSamples) * count(kTagBits) *
        static_cast<std::uint64_t>(std::max(1, whole_of(header.set, kTagFrames)));
    return !header.has_pixels || header.cut_off((bits + 7) / 8);
}

bool is_one_of(const std::string& text, std::initializer_list<const char*> texts) {
    return std::any_of(texts.begin(), texts.end(), [&](const char* one) { return text == one; });
}

DicomObject object_of(const DicomSet& set, const std::string& path) {
    DicomObject object;
    object.path = path;
    object.modality = text_of(set, kTagModality);
    object.frame_of_reference = text_of(set, kTagFrameOfReference);
    object.patient = text_of(set, kTagPatient);
    const std::vector<DicomSet> series = items_of(set, kTagReferencedSeries);
    if (series.empty()) return object;
    object.series = text_of(series.front(), kTagSeries);
    for (const DicomSet& image : items_of(series.front(), kTagReferencedImages))
        object.images.push_back(text_of(image, kTagReferencedInstance));
    return object;
}

// The box of the pixels' centres of frames, where they are placed.
void include_frame(const DicomFrame& frame, int rows, int columns, Box3& box) {
    if (!frame.placed() || !frame.fault.empty()) return;
    const Vector3 right = (columns - 1) * frame.column_spacing_mm * frame.along_rows,
                  down = (rows - 1) * frame.row_spacing_mm * frame.along_columns;
    for (const Vector3 corner : {Vector3{}, right, down, right + down})
        box.include(frame.position + corner);
}

DicomPixels pixels_of(const DicomHeader& header) {
    const DicomSet& set = header.set;
    DicomPixels pixels;
    pixels.at = header.pixels_at;
    pixels.bits = short_of(set, kTagBits);
    pixels.stored = short_of(set, kTagStored);
    pixels.is_signed = short_of(set, kTagSigned) == 1;
    DicomSet rescaling = set;
    bool rescaled_by_frame = false;
    for (const DicomTag tag : {kTagShared, kTagPerFrame})
        if (const auto groups = items_of(set, tag); !groups.empty())
            if (const auto items = items_of(groups.front(), kTagTransformation); !items.empty()) {
                rescaled_by_frame = true;
                rescaling = items.front();
            }
    bool numbers = true;
    for (const auto& [tag, value] :
         {std::pair{kTagSlope, &pixels.slope}, std::pair{kTagIntercept, &pixels.intercept}})
        if (const std::string text = text_of(rescaling, tag); !text.empty())
            numbers = numbers && parse_number(text, *value) && std::isfinite(*value);
    if (const auto padding = shorts_of(set, kTagPadding); !padding.empty()) {
        auto limit = shorts_of(set, kTagPaddingLimit);
        if (limit.empty()) limit = padding;
        const auto stored = [&](std::uint16_t value) {
            return pixels.is_signed ? static_cast<std::int16_t>(value) : int{value};
        };
        std::tie(pixels.low, pixels.high) =
            std::minmax({stored(padding.front()), stored(limit.front())});
        pixels.padded = true;
    }
    // JPEG of the first two processes knows no other way.
    pixels.lossy =
        text_of(set, kTagLossy) == "01" ||
        is_one_of(header.transfer_syntax, {"1.2.840.10008.1.2.4.50", "1.2.840.10008.1.2.4.51"});
    pixels.run_lengths = header.packed && header.transfer_syntax == "1.2.840.10008.1.2.5";
    pixels.sound = (pixels.bits == 8 || pixels.bits == 16 || pixels.bits == 32) &&
                   pixels.stored >= 1 && pixels.stored <= pixels.bits &&
                   short_of(set, kTagHighBit) == pixels.stored - 1 &&
                   short_of(set, kTagSamples) <= 1 && short_of(set, kTagSigned) <= 1 && numbers;
    pixels.plain = pixels.sound && pixels.bits <= 16 && header.packed == pixels.run_lengths &&
                   !header.inflated && !set.big_endian && !rescaled_by_frame;
    return pixels;
}

// Puts one file where it belongs.
void add_file(const std::string& path, DicomFolder& folder) {
    const auto header = read_dicom_header(path);
    if (!header) {
        if (is_dicom_file(path)) folder.damaged.push_back(path);
        return;
    }
    const DicomSet& set = header->set;
    const std::string type = text_of(set, kTagSopClass);
    DicomObject object = object_of(set, path);
    if (type.starts_with("1.2.840.10008.5.1.4.1.1.66.") || object.modality == "SEG") {
        object.cut_off = is_cut_off(*header);
        for (const DicomFrame& frame : frames_of(set, std::max(1, whole_of(set, kTagFrames)))) {
            include_frame(frame, short_of(set, kTagRows), short_of(set, kTagColumns), object.box);
            object.normal = frame.normal();
        }
        folder.segmentations.push_back(std::move(object));
        return;
    }
    if (type == "1.2.840.10008.5.1.4.1.1.481.3" || object.modality == "RTSTRUCT") {
        folder.structure_sets.push_back(std::move(object));
        return;
    }
    const bool has_pixels = short_of(set, kTagRows) > 0 && short_of(set, kTagColumns) > 0;
    if (!has_pixels && is_one_of(object.modality, {"CT", "MR"})) {
        folder.damaged.push_back(path);
        return;
    }
    const bool localizer = text_of(set, kTagImageType).find("LOCALIZER") != std::string::npos;
    if (!has_pixels || localizer ||
        is_one_of(object.modality, {"PT", "NM", "RTDOSE", "RTIMAGE", "US", "XA", "CR", "DX"})) {
        if (localizer) object.modality += " localizer";
        if (!object.modality.empty()) folder.others.push_back(std::move(object));
        return;
    }
    DicomSlice slice = slice_of(set);
    slice.path = path;
    slice.cut_off = is_cut_off(*header);
    slice.pixels = pixels_of(*header);
    folder.slices.push_back(std::move(slice));
}

// Whether two files hold the same bytes.
bool are_copies(const std::string& a, const std::string& b) {
    std::error_code code;
    if (fs::file_size(a, code) != fs::file_size(b, code) || code) return false;
    const auto one = read_file(a), other = read_file(b);
    return one && other && *one == *other;
}

// Where several series or examinations lie here, the scan stays that the segmentation names as its
// own, or that shares its frame of reference.
void set_aside_other_scans(DicomFolder& folder) {
    const auto is_of = [&](std::string DicomSlice::*of_slice, std::string DicomObject::*of_labels) {
        return [&folder, of_slice, of_labels](const DicomSlice& slice) {
            return std::any_of(folder.segmentations.begin(), folder.segmentations.end(),
                               [&](const DicomObject& s) {
                                   return !(s.*of_labels).empty() &&
                                          s.*of_labels == slice.*of_slice;
                               });
        };
    };
    const auto keep = [&](const auto& theirs) {
        const auto rest = std::stable_partition(folder.slices.begin(), folder.slices.end(), theirs);
        if (rest == folder.slices.begin()) return false;
        folder.other_slices.assign(std::make_move_iterator(rest),
                                   std::make_move_iterator(folder.slices.end()));
        folder.slices.erase(rest, folder.slices.end());
        return true;
    };
    if (!keep(is_of(&DicomSlice::series, &DicomObject::series)))
        keep(is_of(&DicomSlice::frame_of_reference, &DicomObject::frame_of_reference));
}

}  // namespace

DicomFolder read_dicom_headers(const std::string& path) {
    std::vector<std::string> paths;
    std::error_code code;
    if (!fs::is_directory(path, code)) {
        paths.push_back(path);
    } else {
        for (auto it = fs::recursive_directory_iterator(
                 path, fs::directory_options::skip_permission_denied, code);
             !code && it != fs::recursive_directory_iterator(); it.increment(code)) {
            std::error_code of_entry;
            if (it->is_regular_file(of_entry)) paths.push_back(it->path().string());
        }
    }
    std::sort(paths.begin(), paths.end());  // a folder lists its files in no fixed order
    DicomFolder folder;
    for (const std::string& file : paths) add_file(file, folder);
    // Beside a CT, captured screens and the like are no labels.
    const auto& slices = folder.slices;
    const auto is_scan = [](const DicomSlice& s) { return is_one_of(s.modality, {"CT", "MR"}); };
    if (std::any_of(slices.begin(), slices.end(), is_scan)) {
        for (const DicomSlice& slice : slices)
            if (!is_scan(slice) && !slice.modality.empty())
                folder.others.push_back({slice.path, slice.modality, slice.frame_of_reference});
        std::erase_if(folder.slices, [&](const DicomSlice& slice) {
            return !is_scan(slice) && !slice.modality.empty();
        });
    }
    auto& labels = folder.segmentations;
    for (std::size_t n = 0; n < labels.size(); ++n)
        labels.erase(
            std::remove_if(
                labels.begin() + static_cast<std::ptrdiff_t>(n) + 1, labels.end(),
                [&](const DicomObject& other) { return are_copies(labels[n].path, other.path); }),
            labels.end());
    set_aside_other_scans(folder);
    return folder;
}

std::vector<std::string> paths_of(const std::vector<DicomObject>& objects) {
    std::vector<std::string> paths;
    for (const DicomObject& object : objects) paths.push_back(object.path);
    return paths;
}

std::string objects_text(const std::vector<DicomObject>& objects, bool named) {
    std::map<std::string, std::vector<std::string>> names;
    for (const DicomObject& object : objects)
        names[object.modality].push_back(fs::path(object.path).filename().string());
    std::string text;
    for (const auto& [modality, files] : names)
        text += (text.empty() ? "" : ", ") + std::to_string(files.size()) + " " + modality +
                (named ? " (" + files.front() + (files.size() > 1 ? ", ...)" : ")") : "");
    return text;
}

namespace {

constexpr const char* kSliceExpected =
    "expected one complete series of CT-like slices; export the series again";
constexpr double kMaxShift = 0.05;   // of the spacing, off even places
constexpr double kSameSlice = 0.01;  // of the spacing: two slices in one place

std::string name_of(const DicomSlice& slice) {
    const std::string file = fs::path(slice.path).filename().string();
    return slice.of_frame == 0 ? file : "frame " + std::to_string(slice.of_frame) + " of " + file;
}

// Removes slices that are there already: of one SOP Instance UID and place and, of labels, of the
// same bytes. Returns how many.
std::size_t drop_copies(std::vector<DicomSlice>& slices, bool scan) {
    std::map<std::string, const DicomSlice*> first;
    std::vector<DicomSlice> kept;
    kept.reserve(slices.size());
    for (DicomSlice& slice : slices) {
        if (!slice.instance.empty()) {
            const auto [other, is_new] = first.emplace(slice.instance, nullptr);
            if (!is_new &&
                distance(other->second->place().position, slice.place().position) < 1e-3 &&
                (scan || are_copies(other->second->path, slice.path)))
                continue;
            kept.push_back(std::move(slice));
            other->second = &kept.back();
        } else {
            kept.push_back(std::move(slice));
        }
    }
    const std::size_t dropped = slices.size() - kept.size();
    slices = std::move(kept);
    return dropped;
}

// The slices of each stack that the folder could mean, in the order of their names.
std::map<std::string, std::vector<DicomSlice>> by_series(std::vector<DicomSlice> slices) {
    std::map<std::string, std::vector<DicomSlice>> series;
    for (DicomSlice& slice : slices)
        series[slice.series + " " + number_text(slice.place().thickness_mm, 4) + " " +
               std::to_string(slice.rows) + " x " + std::to_string(slice.columns)]
            .push_back(std::move(slice));
    return series;
}

// Every slice says where it lies, in numbers, and has the directions and pixels of the first.
Status check_places(const std::vector<DicomSlice>& slices) {
    const DicomFrame& first = slices.front().place();
    for (const DicomSlice& slice : slices) {
        const DicomFrame& place = slice.place();
        const std::string of = slice.of_frame > 0 ? name_of(slice) + ": " : "";
        if (!place.fault.empty()) return Error{of + place.fault, slice.path, kSliceExpected};
        if (!place.placed())
            return Error{of + "slice does not say where it lies", slice.path, kSliceExpected};
        if (!(place.row_spacing_mm > 0))
            return Error{of + "slice does not say how large its pixels are", slice.path,
                         kSliceExpected};
        if (norm(place.along_rows - first.along_rows) > 1e-3 ||
            norm(place.along_columns - first.along_columns) > 1e-3)
            return Error{of + "slice is turned against " + name_of(slices.front()), slice.path,
                         kSliceExpected};
        if (std::abs(place.row_spacing_mm / first.row_spacing_mm - 1) > 1e-3 ||
            std::abs(place.column_spacing_mm / first.column_spacing_mm - 1) > 1e-3)
            return Error{of + text("pixels of %.4g x %.4g mm among slices of %.4g x %.4g mm",
                                   place.column_spacing_mm, place.row_spacing_mm,
                                   first.column_spacing_mm, first.row_spacing_mm),
                         slice.path, kSliceExpected};
    }
    return Done{};
}

// "; NAME, which lies there, is of another series" for a slice between two others; else empty.
std::string stray_between(const std::vector<DicomSlice>& others,
                          const DicomSlice& before,
                          const DicomSlice& after,
                          Vector3 normal) {
    for (const DicomSlice& other : others) {
        if (!other.place().placed()) continue;
        const Point3 from = before.place().position;
        const double place = dot(other.place().position - from, normal);
        const double gap = dot(after.place().position - from, normal);
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
        gaps.push_back(dot(slices[n].place().position - slices[n - 1].place().position, normal));
    std::vector<double> sorted = gaps;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    double step = *middle;
    if (!(step > 1e-6)) step = *std::max_element(gaps.begin(), gaps.end());
    for (std::size_t n = 0; n < gaps.size(); ++n) {
        const DicomSlice &before = slices[n], &after = slices[n + 1];
        if (!(gaps[n] > kSameSlice * step))
            return Error{"slice is there twice, in " + name_of(before) + " as well", after.path,
                         kSliceExpected};
        if (gaps[n] < 1.5 * step) continue;
        const long missing = std::max(1L, std::lround(gaps[n] / step) - 1);
        return Error{text("%ld slice%s missing between %s and %s, %.4g mm apart where others are "
                          "%.4g",
                          missing, missing == 1 ? " is" : "s are", name_of(before).c_str(),
                          name_of(after).c_str(), gaps[n], step) +
                         stray_between(others, before, after, normal),
                     after.path, kSliceExpected};
    }
    // Even places lie on the line from the first slice to the last.
    const double count = static_cast<double>(gaps.size());
    const Point3 start = slices.front().place().position;
    const Vector3 even = (slices.back().place().position - start) / count;
    for (std::size_t n = 1; n < gaps.size(); ++n) {
        const Point3 place = start + static_cast<double>(n) * even;
        const double off = distance(place, slices[n].place().position);
        if (off > kMaxShift * norm(even))
            return Error{
                text("slices are unevenly spaced: this one lies %.3g mm off its place", off),
                slices[n].path, kSliceExpected};
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
                         slice.path, kSliceExpected};
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

// What headers say of the distance of slices against their places, which hold.
std::string warning_of_thickness(const DicomFrame& slice, double step_mm) {
    if (slice.between_mm > 0 && std::abs(slice.between_mm / step_mm - 1) > 0.01)
        return text(
            "the DICOM slices lie %.4g mm apart by their positions, and %.4g mm by "
            "SpacingBetweenSlices: the positions were taken; check that none is missing",
            step_mm, slice.between_mm);
    if (slice.thickness_mm > 0 && step_mm > 1.5 * slice.thickness_mm)
        return text(
            "the DICOM slices are %.4g mm thick and lie %.4g mm apart: check that none is "
            "missing",
            slice.thickness_mm, step_mm);
    return "";
}

// A file with all frames as one slice for each.
Status split_frames(DicomStack& stack) {
    for (const DicomSlice& slice : stack.slices)
        if (stack.slices.size() > 1 && slice.frames.size() > 1)
            return Error{"holds several slices", slice.path,
                         "expected one slice in each file, or one file with all of them"};
    DicomSlice whole = std::move(stack.slices.front());
    std::vector<DicomFrame> frames = std::move(whole.frames);
    DicomFrame& first = frames.front();
    const std::size_t placed = static_cast<std::size_t>(std::count_if(
        frames.begin(), frames.end(), [](const DicomFrame& f) { return f.has_position; }));
    if (placed == 1 && first.placed() && first.fault.empty()) {
        const double step = first.between_mm > 0 ? first.between_mm : first.thickness_mm;
        if (!(step > 0))
            return Error{"says where the first of its frames lies, and not how far apart they are",
                         whole.path, kSliceExpected};
        for (std::size_t n = 1; n < frames.size(); ++n) {
            frames[n].position = first.position + static_cast<double>(n) * step * first.normal();
            frames[n].has_position = true;
        }
        stack.warnings.push_back(text(
            "the DICOM file places only the first of its %zu frames: the others were "
            "taken to follow it every %.4g mm (%s) along (%.3g, %.3g, %.3g); check that the "
            "body is not upside down",
            frames.size(), step, first.between_mm > 0 ? "SpacingBetweenSlices" : "SliceThickness",
            -first.normal().x, -first.normal().y, first.normal().z));
    }
    whole.number = 0;
    stack.slices.clear();
    for (DicomFrame& frame : frames) {
        stack.slices.push_back(whole);
        stack.slices.back().frames = {std::move(frame)};
        stack.slices.back().of_frame = static_cast<int>(stack.slices.size());
    }
    return Done{};
}

std::size_t count_of(const std::vector<DicomSlice>& slices) {
    std::size_t count = 0;
    for (const DicomSlice& slice : slices) count += slice.frames.size();
    return count;
}

// "70 x CT": reports go into cases, which name no file and no description, as both may name the
// patient.
std::string count_text(const std::vector<DicomSlice>& slices) {
    return std::to_string(count_of(slices)) + " x " + slices.front().modality;
}

std::string series_text(const std::vector<DicomSlice>& slices) {
    const DicomSlice& first = slices.front();
    return count_text(slices) + " from " + name_of(first) +
           (first.description.empty() ? "" : ", '" + first.description + "'");
}

// How well slices fit labels: images that these refer to, tenths of their box that lie in the
// slices', and whether both run the same way.
using Fit = std::tuple<std::size_t, int, bool>;
Fit fit_of(const std::vector<DicomSlice>& slices, const std::vector<DicomObject>& labels) {
    Box3 box, wanted;
    std::vector<std::string> images;
    bool parallel = false;
    for (const DicomSlice& slice : slices)
        for (const DicomFrame& frame : slice.frames)
            include_frame(frame, slice.rows, slice.columns, box);
    for (const DicomObject& object : labels) {
        images.insert(images.end(), object.images.begin(), object.images.end());
        if (object.box.empty()) continue;
        wanted.include(object.box.lower);
        wanted.include(object.box.upper);
        parallel = parallel || std::abs(dot(object.normal, slices.front().place().normal())) > 0.99;
    }
    std::sort(images.begin(), images.end());
    const auto referred = std::count_if(slices.begin(), slices.end(), [&](const DicomSlice& s) {
        return std::binary_search(images.begin(), images.end(), s.instance);
    });
    double share = box.empty() || wanted.empty() ? 0 : 1;
    for (int axis = 0; axis < 3; ++axis) {
        constexpr double kHalfMm = 0.5;  // one slice has a length as well
        const double all = wanted.upper[axis] - wanted.lower[axis] + 2 * kHalfMm;
        const double both = std::min(wanted.upper[axis], box.upper[axis]) -
                            std::max(wanted.lower[axis], box.lower[axis]) + 2 * kHalfMm;
        if (share > 0) share *= std::max(0.0, both) / all;
    }
    return {static_cast<std::size_t>(referred), static_cast<int>(std::lround(10 * share)),
            parallel};
}

bool are_like(const DicomFrame& a, const DicomFrame& b) {
    return norm(a.along_rows - b.along_rows) < 1e-3 &&
           norm(a.along_columns - b.along_columns) < 1e-3 &&
           std::abs(a.row_spacing_mm / b.row_spacing_mm - 1) < 1e-3 &&
           std::abs(a.column_spacing_mm / b.column_spacing_mm - 1) < 1e-3;
}

// Sets aside slices unlike most of the others: a scout, a page of text.
void set_aside_turned(DicomStack& stack) {
    std::vector<std::pair<const DicomFrame*, std::size_t>> kinds;
    for (const DicomSlice& slice : stack.slices) {
        const DicomFrame& place = slice.place();
        if (!place.fault.empty()) return;
        if (!place.placed() || !(place.row_spacing_mm > 0)) continue;
        const auto kind = std::find_if(kinds.begin(), kinds.end(),
                                       [&](const auto& k) { return are_like(*k.first, place); });
        if (kind == kinds.end())
            kinds.emplace_back(&place, 1);
        else
            ++kind->second;
    }
    for (const auto& [place, count] : kinds) {
        const std::size_t odd = stack.slices.size() - count;
        if (odd == 0 || 2 * count <= stack.slices.size()) continue;
        const DicomFrame like = *place;
        std::erase_if(stack.slices, [&](const DicomSlice& slice) {
            return !slice.place().placed() || !are_like(like, slice.place());
        });
        stack.warnings.push_back(
            text("%zu slice%s of the scan %s turned against the others, %s pixels of another size "
                 "or %s nowhere, and %s left out (a scout?)",
                 odd, odd == 1 ? "" : "s", odd == 1 ? "is" : "are", odd == 1 ? "has" : "have",
                 odd == 1 ? "lies" : "lie", odd == 1 ? "was" : "were"));
        return;
    }
}

double height_of(const DicomSlice& slice, Vector3 normal) {
    return dot(slice.place().position - Point3{}, normal);
}

// By place, then by number, then by name.
void sort_slices(std::vector<DicomSlice>& slices, bool by_number) {
    const Vector3 normal = slices.front().place().normal();
    std::vector<std::tuple<double, int, std::size_t>> order;
    for (std::size_t n = 0; n < slices.size(); ++n) {
        // Places that differ by rounding are one.
        const double height = height_of(slices[n], normal);
        order.emplace_back(by_number ? std::round(height * 100) : height,
                           by_number ? slices[n].number : 0, n);
    }
    std::sort(order.begin(), order.end());
    std::vector<DicomSlice> in_order;
    for (const auto& [place, number, n] : order) in_order.push_back(std::move(slices[n]));
    slices = std::move(in_order);
}

// Of a scan whose slices lie several in one place: one phase.
void choose_phase(DicomStack& stack, const StackUse& use) {
    auto& slices = stack.slices;
    sort_slices(slices, true);
    const Vector3 normal = slices.front().place().normal();
    const auto in_one_place = [&](const DicomSlice& a, const DicomSlice& b) {
        return std::abs(height_of(a, normal) - height_of(b, normal)) < 0.01;
    };
    std::vector<std::size_t> turn;  // of each slice among those of its place
    std::size_t phases = 1, last = 0;
    bool all = true;
    for (std::size_t n = 0; n < slices.size(); ++n) {
        const bool again = n > 0 && in_one_place(slices[n - 1], slices[n]);
        turn.push_back(again ? turn.back() + 1 : 0);
        phases = std::max(phases, turn.back() + 1);
        if (n > 0 && !again) {
            all = all && (last == 0 || turn[n - 1] + 1 == last);
            last = turn[n - 1] + 1;
        }
    }
    if (phases == 1) return;
    all = all && turn.back() + 1 == last;
    using Groups = std::map<std::string, std::vector<DicomSlice>>;
    const auto grouped = [&](const auto& key) {
        Groups groups;
        for (std::size_t n = 0; n < slices.size(); ++n) {
            auto& group = groups[key(n)];
            if (!group.empty() && in_one_place(group.back(), slices[n])) return Groups{};
            group.push_back(slices[n]);
        }
        return groups.size() == phases ? groups : Groups{};
    };
    const char* how = "Acquisition Number";
    Groups groups = grouped([&](std::size_t n) { return slices[n].acquisition; });
    if (groups.empty()) {
        how = "Temporal Position";
        groups = grouped([&](std::size_t n) { return slices[n].moment; });
    }
    if (groups.empty()) {
        how = "the numbers of their frames";
        groups = grouped([&](std::size_t n) { return slices[n].place().phase; });
    }
    if (groups.empty() && all) {
        how = "the order of their numbers";
        groups = grouped([&](std::size_t n) { return std::to_string(turn[n]); });
    }
    if (groups.empty()) return;  // reported as slices that are there twice
    // The first: by the least number, then by the frame.
    const auto before = [](const DicomSlice& a, const DicomSlice& b) {
        return std::tie(a.number, a.of_frame) < std::tie(b.number, b.of_frame);
    };
    const auto fit = [&](const std::vector<DicomSlice>& group) {
        const auto [referred, share, parallel] = fit_of(group, use.labels);
        return std::pair{referred, share};
    };
    auto best = groups.begin();
    bool labels_tell = false;
    for (auto it = std::next(best); it != groups.end(); ++it) {
        const auto a = fit(it->second), b = fit(best->second);
        labels_tell = labels_tell || a != b;
        if (a > b ||
            (a == b && before(*std::min_element(it->second.begin(), it->second.end(), before),
                              *std::min_element(best->second.begin(), best->second.end(), before))))
            best = it;
    }
    stack.warnings.push_back(text(
        "the scan holds %zu phases in one place, told apart by %s: %s was taken, with %zu "
        "slices; to take another, give a folder that holds it alone",
        phases, how, labels_tell ? "that which the segmentation lies in or refers to" : "the first",
        best->second.size()));
    std::vector<DicomSlice> taken = std::move(best->second);
    slices = std::move(taken);
}

// Of a scan in order, slices that alone are missing between two others.
void fill_gaps(DicomStack& stack) {
    auto& slices = stack.slices;
    if (slices.size() < 4) return;
    const Vector3 normal = slices.front().place().normal();
    std::vector<double> gaps;
    for (std::size_t n = 1; n < slices.size(); ++n)
        gaps.push_back(height_of(slices[n], normal) - height_of(slices[n - 1], normal));
    std::vector<double> sorted = gaps;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    std::vector<DicomSlice> filled;
    std::size_t missing = 0;
    double first_at = 0;
    for (std::size_t n = 0; n < slices.size(); ++n) {
        filled.push_back(slices[n]);
        if (n == gaps.size() || std::abs(gaps[n] / *middle - 2) > 2 * kMaxShift) continue;
        DicomSlice between = slices[n];
        DicomFrame& place = between.frames.front();
        place.position = place.position + (slices[n + 1].place().position - place.position) / 2;
        between.between = true;
        if (missing++ == 0) first_at = height_of(between, normal);
        filled.push_back(std::move(between));
    }
    if (missing == 0 || 10 * missing > slices.size()) return;
    slices = std::move(filled);
    stack.warnings.push_back(
        text("%zu slice%s of the scan %s missing between two others, the first at %.4g mm along "
             "the stack: the mean of its neighbours was taken; export the series again if it can "
             "be had whole",
             missing, missing == 1 ? "" : "s", missing == 1 ? "is" : "are", first_at));
}

// Puts the slices in order. Errors: see dicom_stack.
Status order_stack(DicomStack& stack, const StackUse& use) {
    for (const DicomSlice& slice : stack.slices)
        if (slice.cut_off)
            return Error{"file is cut off: it ends before its pixels do", slice.path,
                         "copy or export the series again"};
    if (count_of(stack.slices) > stack.slices.size()) {
        SONOCASE_TRY_DONE(split_frames(stack));
    }
    const Status declared = check_declared(stack.slices);
    if (use.scan) set_aside_turned(stack);
    SONOCASE_TRY_DONE(check_places(stack.slices));
    if (stack.slices.size() == 1) return Done{};
    if (use.scan) choose_phase(stack, use);
    sort_slices(stack.slices, false);
    const std::size_t there = stack.slices.size();
    if (use.scan) fill_gaps(stack);
    const DicomFrame& first = stack.slices.front().place();
    SONOCASE_TRY_DONE(check_spacing(stack.slices, stack.others, first.normal()));
    if (stack.slices.size() == there) {
        SONOCASE_TRY_DONE(declared);
    }
    const double step = dot(stack.slices.back().place().position - first.position, first.normal()) /
                        static_cast<double>(stack.slices.size() - 1);
    for (std::string warning :
         {warning_of_numbers(stack.slices), warning_of_thickness(first, step)})
        if (!warning.empty()) stack.warnings.push_back(std::move(warning));
    return Done{};
}

}  // namespace

std::vector<std::string> series_texts(std::vector<DicomSlice> slices) {
    std::vector<std::string> texts;
    for (const auto& [uid, of_series] : by_series(std::move(slices)))
        texts.push_back(series_text(of_series));
    return texts;
}

Result<DicomStack> dicom_stack(std::vector<DicomSlice> slices,
                               const std::string& folder,
                               const StackUse& use) {
    DicomStack stack;
    if (const std::size_t copies = drop_copies(slices, use.scan); copies > 0)
        stack.warnings.push_back(text("%zu DICOM slice%s there twice: the copy was left out",
                                      copies, copies == 1 ? " is" : "s are"));
    auto series = by_series(std::move(slices));
    if (series.empty())
        return Error{"folder holds neither masks nor DICOM images", folder,
                     "expected one .nii.gz (or .nrrd, .mha) mask per structure, a DICOM "
                     "segmentation or a DICOM series"};
    const auto rank = [&](const std::vector<DicomSlice>& of) {
        return std::pair{fit_of(of, use.labels), count_of(of)};
    };
    auto best = series.begin();
    bool labels_tell = false;
    for (auto it = std::next(best); it != series.end(); ++it) {
        const auto a = rank(it->second), b = rank(best->second);
        labels_tell = labels_tell || a.first != b.first;
        if (a > b) best = it;
    }
    stack.slices = std::move(best->second);
    series.erase(best);
    std::string counts, list = series_text(stack.slices);
    for (auto& [uid, of_series] : series) {
        counts += (counts.empty() ? "" : ", ") + count_text(of_series);
        list += "; " + series_text(of_series);
        stack.others.insert(stack.others.end(), of_series.begin(), of_series.end());
    }
    if (!series.empty())
        stack.warnings.push_back(
            "folder holds " + std::to_string(series.size() + 1) + " DICOM series; the one " +
            (labels_tell ? "that the segmentation lies in" : "with the most slices") +
            " was taken (" + count_text(stack.slices) + "), and not " + counts +
            ": to take another, give a folder that holds it alone");
    if (const auto ordered = order_stack(stack, use); !ordered) {
        Error error = ordered.error();
        if (!series.empty())
            error.what += " (of " + std::to_string(series.size() + 1) + " series: " + list + ")";
        return error;
    }
    return stack;
}

namespace {

std::string size_text(const itk::ImageIOBase& io) {
    return std::to_string(io.GetDimensions(0)) + " x " + std::to_string(io.GetDimensions(1)) +
           " pixels";
}

// How far the last slice lies beside the first (a tilted gantry), in DICOM's axes.
Vector3 slide_of(const DicomStack& stack) {
    const DicomFrame &first = stack.slices.front().place(), &last = stack.slices.back().place();
    const Vector3 all = last.position - first.position, normal = first.normal();
    return all - dot(all, normal) * normal;
}

// The lattice of the stack: its third axis is the normal of the slices. Slices that slide over one
// another are squared about the middle of the body where that moves none by a tenth of a voxel.
Result<Grid> grid_of(const DicomStack& stack, const std::string& path, NativeVolume& volume) {
    const DicomFrame &first = stack.slices.front().place(), &last = stack.slices.back().place();
    const auto count = static_cast<double>(stack.slices.size());
    const double height = dot(last.position - first.position, first.normal());
    double step = count > 1 ? height / (count - 1) : first.thickness_mm;
    if (!(step > 0)) step = first.between_mm;
    if (!(step > 0))
        return Error{"one slice that does not say how thick it is", path, kSliceExpected};
    const Vector3 slide = slide_of(stack);
    const double off = norm(slide);
    const double voxel = std::min({first.row_spacing_mm, first.column_spacing_mm, step});
    Point3 origin = first.position;
    if (off > 1e-3 * voxel && off <= 0.2 * voxel) {
        volume.notes.push_back(
            {"shear", text("slices slide by %.3g mm over the stack: squared, with an error of "
                           "%.3g mm at either end",
                           off, off / 2)});
        origin = origin + slide / 2;
    }
    return ras_grid(origin, first, step,
                    {stack.slices.front().columns, stack.slices.front().rows,
                     static_cast<std::int32_t>(stack.slices.size())});
}

}  // namespace

double shear_deg(const DicomStack& stack) {
    if (stack.slices.size() < 2) return 0;
    const DicomFrame &first = stack.slices.front().place(), &last = stack.slices.back().place();
    const double off = norm(slide_of(stack)),
                 height = dot(last.position - first.position, first.normal()),
                 step = height / static_cast<double>(stack.slices.size() - 1);
    if (off <= 0.2 * std::min({first.row_spacing_mm, first.column_spacing_mm, step})) return 0;
    return std::atan2(off, height) * 180 / kPi;
}

namespace {

// Whether the slices slide by more than can be squared: an error, or a warning if they are to be
// resampled.
Result<bool> is_sheared(const DicomStack& stack,
                        const Grid& grid,
                        bool resample,
                        const std::string& path,
                        std::vector<std::string>& warnings) {
    const double degrees = shear_deg(stack);
    const Vector3 spacing = grid.spacing_mm;
    if (!(degrees > 0)) return false;
    const std::string what = text(
        "slices are sheared against their stack by %.3g degrees (a tilted gantry): the last lies "
        "%.4g mm beside the first",
        degrees, norm(slide_of(stack)));
    if (!resample)
        return Error{what, path,
                     std::string(kResampleShear) +
                         "resample the series to an orthogonal grid "
                         "first"};
    warnings.push_back(what + text("; each slice was moved by whole pixels, to within %.2g mm",
                                   std::hypot(spacing.x, spacing.y) / 2));
    return true;
}

// Moves each slice by the whole pixels that it slides by, on a grid with room for all.
void unshear(const DicomStack& stack, NativeVolume& volume) {
    const DicomFrame& first = stack.slices.front().place();
    const Vector3 slide = slide_of(stack);
    const Grid old = volume.grid;
    const auto shift = [&](int k, int axis) {
        const Vector3 along = axis == 0 ? first.along_rows : first.along_columns;
        return static_cast<int>(std::lround(dot(slide, along) / old.spacing_mm[axis] * k /
                                            std::max(1, old.size.z - 1)));
    };
    int low[2] = {0, 0};
    for (int axis = 0; axis < 2; ++axis) {
        const int last = shift(old.size.z - 1, axis);
        low[axis] = std::min(0, last);
        volume.grid.size[axis] += std::abs(last);
    }
    volume.grid.origin_mm = old.point_from_voxel({double(low[0]), double(low[1]), 0});
    const auto row = static_cast<std::size_t>(old.size.x),
               rows = static_cast<std::size_t>(old.size.y);
    const std::size_t bytes = volume.bytes.size() / old.voxel_count();
    std::vector<std::byte> moved(volume.grid.voxel_count() * bytes);
    for (int k = 0; k < old.size.z; ++k) {
        const auto right = static_cast<std::size_t>(shift(k, 0) - low[0]),
                   down = static_cast<std::size_t>(shift(k, 1) - low[1]);
        for (std::size_t j = 0; j < rows; ++j) {
            const std::size_t from = (static_cast<std::size_t>(k) * rows + j) * row;
            const std::size_t to =
                (static_cast<std::size_t>(k) * static_cast<std::size_t>(volume.grid.size.y) + j +
                 down) *
                    static_cast<std::size_t>(volume.grid.size.x) +
                right;
            std::memcpy(moved.data() + to * bytes, volume.bytes.data() + from * bytes, row * bytes);
        }
    }
    volume.bytes = std::move(moved);
}

// Reads one slice to the end of the volume, which begins with the first and takes its type.
Status append_slice(const DicomSlice& slice, itk::GDCMImageIO& io, NativeVolume& volume) {
    const auto component = component_called(io.GetComponentTypeAsString(io.GetComponentType()));
    if (!component || io.GetNumberOfComponents() != 1)
        return Error{"pixels that are not one whole number each", slice.path, kSliceExpected};
    if (!volume.bytes.empty() && *component != volume.component)
        return Error{"pixels of another type than in the slices before", slice.path,
                     kSliceExpected};
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

// The frames of the stack, in its order, from all of their file.
void pick_frames(const DicomStack& stack, NativeVolume& volume) {
    const std::size_t bytes =
        volume.bytes.size() / static_cast<std::size_t>(stack.slices.front().file_frames);
    std::vector<std::byte> sorted(bytes * stack.slices.size());
    for (std::size_t n = 0; n < stack.slices.size(); ++n)
        std::memcpy(
            sorted.data() + n * bytes,
            volume.bytes.data() + static_cast<std::size_t>(stack.slices[n].of_frame - 1) * bytes,
            bytes);
    volume.bytes = std::move(sorted);
}

// What a scan's slices need after reading: padding becomes air, and slices that are in no file the
// mean of their neighbours. scaled: the values are Hounsfield units already.
template <class T>
void finish_slices(const DicomStack& stack, bool scaled, NativeVolume& volume) {
    constexpr double kAirHu = -1000;
    T* voxels = reinterpret_cast<T*>(volume.bytes.data());
    const std::size_t count = volume.grid.voxel_count() / stack.slices.size();
    const auto clamped = [](double value) {
        return static_cast<T>(std::clamp(std::round(value),
                                         static_cast<double>(std::numeric_limits<T>::lowest()),
                                         static_cast<double>(std::numeric_limits<T>::max())));
    };
    for (std::size_t n = 0; n < stack.slices.size(); ++n) {
        const DicomPixels& pixels = stack.slices[n].pixels;
        if (!pixels.padded || stack.slices[n].modality != "CT" || !(pixels.slope > 0)) continue;
        const double slope = scaled ? pixels.slope : 1, intercept = scaled ? pixels.intercept : 0;
        const double low = slope * pixels.low + intercept - 0.5 * slope,
                     high = slope * pixels.high + intercept + 0.5 * slope;
        const T air = clamped(scaled ? kAirHu : (kAirHu - pixels.intercept) / pixels.slope);
        for (T* v = voxels + n * count; v != voxels + (n + 1) * count; ++v)
            if (const auto value = static_cast<double>(*v); value > low && value < high) *v = air;
    }
    for (std::size_t n = 0; n < stack.slices.size(); ++n) {
        if (!stack.slices[n].between) continue;
        const T *before = voxels + (n - 1) * count, *after = voxels + (n + 1) * count;
        for (std::size_t v = 0; v < count; ++v)
            voxels[n * count + v] =
                clamped((static_cast<double>(before[v]) + static_cast<double>(after[v])) / 2);
    }
}

void finish_scan(const DicomStack& stack, bool scaled, NativeVolume& volume) {
    switch (volume.component) {
        case Component::u8: return finish_slices<std::uint8_t>(stack, scaled, volume);
        case Component::i8: return finish_slices<std::int8_t>(stack, scaled, volume);
        case Component::u16: return finish_slices<std::uint16_t>(stack, scaled, volume);
        case Component::i16: return finish_slices<std::int16_t>(stack, scaled, volume);
        case Component::u32: return finish_slices<std::uint32_t>(stack, scaled, volume);
        case Component::i32: return finish_slices<std::int32_t>(stack, scaled, volume);
        case Component::f32: return finish_slices<float>(stack, scaled, volume);
        case Component::f64: return finish_slices<double>(stack, scaled, volume);
        case Component::u64:
        case Component::i64: break;  // DICOM has none
    }
}

// Reads pixels that are stored as they are or as run lengths, without GDCM, which ends the program
// at some damaged files.
Status read_plain_pixels(const DicomStack& stack, NativeVolume& volume) {
    const DicomSlice& first = stack.slices.front();
    const DicomPixels& kind = first.pixels;
    const std::size_t pixels =
        static_cast<std::size_t>(first.rows) * static_cast<std::size_t>(first.columns);
    const std::size_t bytes = pixels * static_cast<std::size_t>(kind.bits / 8);
    if (kind.bits == 8)
        volume.component = kind.is_signed ? Component::i8 : Component::u8;
    else
        volume.component = kind.is_signed ? Component::i16 : Component::u16;
    volume.slope = kind.slope;
    volume.intercept = kind.intercept;
    volume.bytes.resize(bytes * stack.slices.size());
    std::vector<std::string> fragments;
    std::string unpacked;  // the file that they are of
    for (std::size_t n = 0; n < stack.slices.size(); ++n) {
        const DicomSlice& slice = stack.slices[n];
        if (slice.between) continue;
        std::byte* to = volume.bytes.data() + n * bytes;
        const auto frame = static_cast<std::size_t>(std::max(0, slice.of_frame - 1));
        if (kind.run_lengths) {
            if (slice.path != unpacked) {
                const auto header = read_dicom_header(slice.path);
                fragments =
                    header ? read_dicom_fragments(slice.path, *header) : std::vector<std::string>{};
                unpacked = slice.path;
            }
            if (frame >= fragments.size() ||
                !unpack_dicom_runs(fragments[frame], pixels,
                                   static_cast<std::size_t>(kind.bits / 8),
                                   reinterpret_cast<char*>(to)))
                return Error{"the compressed pixels are damaged", slice.path,
                             "export the series again"};
        } else {
            std::ifstream file(slice.path, std::ios::binary);
            file.seekg(static_cast<std::streamoff>(slice.pixels.at + frame * bytes));
            if (!file.read(reinterpret_cast<char*>(to), static_cast<std::streamsize>(bytes)))
                return Error{"cannot be read", slice.path, "check that it may be read"};
        }
        if (kind.stored == kind.bits) continue;
        const int unused = kind.bits - kind.stored;  // upper bits, which may hold anything
        for (std::size_t p = 0; p < bytes; p += static_cast<std::size_t>(kind.bits / 8)) {
            std::uint16_t value = 0;
            std::memcpy(&value, to + p, static_cast<std::size_t>(kind.bits / 8));
            const auto raised = static_cast<std::uint16_t>(value << (16 - kind.bits + unused));
            const int lowered = kind.is_signed ? static_cast<std::int16_t>(raised) : raised;
            value = static_cast<std::uint16_t>(lowered >> (16 - kind.bits + unused));
            std::memcpy(to + p, &value, static_cast<std::size_t>(kind.bits / 8));
        }
    }
    return Done{};
}

Result<NativeVolume> read_stack(const DicomStack& stack,
                                bool resample_shear,
                                bool scan,
                                const std::string& path) {
    NativeVolume volume;
    volume.warnings = stack.warnings;
    const auto lossy = std::find_if(stack.slices.begin(), stack.slices.end(),
                                    [](const DicomSlice& s) { return s.pixels.lossy; });
    if (lossy != stack.slices.end() && !scan)
        return Error{"the pixels were compressed with loss (JPEG), which changes label values",
                     lossy->path, "export the labels again, without compression"};
    if (lossy != stack.slices.end())
        volume.warnings.push_back(
            "the pixels of the scan were compressed with loss (JPEG): its Hounsfield units are "
            "those of the copy; where the archive has it without loss, take that");
    SONOCASE_TRY(volume.grid, grid_of(stack, path, volume));
    SONOCASE_TRY(const bool sheared,
                 is_sheared(stack, volume.grid, resample_shear, path, volume.warnings));
    const DicomSlice& first = stack.slices.front();
    if (std::all_of(stack.slices.begin(), stack.slices.end(), [&](const DicomSlice& slice) {
            return slice.rows == first.rows && slice.columns == first.columns &&
                   slice.pixels.is_like(first.pixels);
        })) {
        SONOCASE_TRY_DONE(read_plain_pixels(stack, volume));
        if (scan) finish_scan(stack, false, volume);
        if (sheared) unshear(stack, volume);
        return volume;
    }
    const bool one_file = first.of_frame > 0;
    for (const DicomSlice& slice : stack.slices) {
        if (one_file && &slice != &first) break;
        if (slice.between) {  // is filled in below
            volume.bytes.resize(volume.bytes.size() + static_cast<std::size_t>(slice.rows) *
                                                          static_cast<std::size_t>(slice.columns) *
                                                          bytes_of(volume.component));
            continue;
        }
        if (!slice.pixels.sound)
            return Error{"pixels that are not one whole number each", slice.path, kSliceExpected};
        try {
            const auto io = itk::GDCMImageIO::New();
            io->SetFileName(slice.path);
            io->ReadImageInformation();
            const std::size_t frames =
                io->GetNumberOfDimensions() > 2 ? std::size_t(io->GetDimensions(2)) : 1;
            if (int(io->GetDimensions(0)) != slice.columns ||
                int(io->GetDimensions(1)) != slice.rows ||
                frames != static_cast<std::size_t>(one_file ? slice.file_frames : 1))
                return Error{"slice of " + size_text(*io) + " where its header says " +
                                 std::to_string(slice.columns) + " x " + std::to_string(slice.rows),
                             slice.path, kSliceExpected};
            if (volume.bytes.empty() && !one_file)
                volume.bytes.reserve(stack.slices.size() *
                                     static_cast<std::size_t>(io->GetImageSizeInBytes()));
            SONOCASE_TRY_DONE(append_slice(slice, *io, volume));
        } catch (const std::exception&) {
            return Error{
                "the pixels cannot be read: the file is damaged, or packed in a way that "
                "is not known here",
                slice.path, "export the series again, without compression"};
        }
    }
    if (one_file) pick_frames(stack, volume);
    if (scan) finish_scan(stack, true, volume);
    if (sheared) unshear(stack, volume);
    return volume;
}

Error damaged(const std::string& path) {
    return {
        "cannot be read as DICOM: the file is damaged, cut off, or packed in a way that is not "
        "known here",
        path, "copy it or export it again, without compression"};
}

// Beside segmentations: that they belong to the scan there.
void check_scan(const std::vector<DicomObject>& segmentations,
                const std::vector<DicomSlice>& slices,
                NativeVolume& volume) {
    if (slices.empty()) return;
    bool their_series = true, their_frame = true;
    for (const DicomObject& segmentation : segmentations) {
        const auto any = [&](std::string DicomSlice::*of, const std::string& wanted) {
            return wanted.empty() ||
                   std::any_of(slices.begin(), slices.end(),
                               [&](const DicomSlice& s) { return s.*of == wanted; });
        };
        their_series = their_series && any(&DicomSlice::series, segmentation.series);
        their_frame =
            their_frame && (any(&DicomSlice::frame_of_reference, segmentation.frame_of_reference) ||
                            std::any_of(slices.begin(), slices.end(), [](const DicomSlice& s) {
                                return s.frame_of_reference.empty();
                            }));
    }
    if (!their_frame)
        volume.warnings.push_back(
            "the DICOM segmentation has another frame of reference than the scan beside it: it is "
            "of another examination, or was moved; check that they belong together");
    else if (!their_series)
        volume.warnings.push_back(
            "the DICOM segmentation was drawn on a series that is not the one beside it: check "
            "that they belong together");
    volume.notes.push_back({"scan",
                            "the labels are those of the DICOM segmentation; the slices "
                            "beside it (" +
                                count_text(slices) + ") hold none and were left out"});
}

// The distance of the slices on which the segmentation was drawn; 0: not known.
double scan_step_mm(const DicomObject& segmentation, std::vector<DicomSlice> slices) {
    std::erase_if(slices,
                  [&](const DicomSlice& slice) { return slice.series != segmentation.series; });
    const auto stack = dicom_stack(std::move(slices), segmentation.path, {true, {segmentation}});
    if (!stack || stack->slices.size() < 2) return 0;
    const DicomFrame &first = stack->slices.front().place(), &last = stack->slices.back().place();
    return dot(last.position - first.position, first.normal()) /
           static_cast<double>(stack->slices.size() - 1);
}

// Whether the voxels are few different numbers, as those of labels are and those of a scan are not.
bool hold_labels(const NativeVolume& volume) {
    constexpr std::size_t kMaxLabels = 160;  // a scan of 8 bits has some 250 different values
    const bool is_signed = volume.component == Component::i8 || volume.component == Component::i16;
    std::vector<bool> seen(1 << 16, false);
    std::size_t count = 0;
    const std::size_t bytes = bytes_of(volume.component);
    if (bytes > 2) return false;
    for (std::size_t at = 0; at + bytes <= volume.bytes.size(); at += bytes) {
        std::uint16_t value = 0;
        std::memcpy(&value, volume.bytes.data() + at, bytes);
        if (seen[value]) continue;
        seen[value] = true;
        const int stored = !is_signed   ? value
                           : bytes == 1 ? static_cast<std::int8_t>(value)
                                        : static_cast<std::int16_t>(value);
        if (volume.slope * stored + volume.intercept < 0) return false;
        if (++count > kMaxLabels) return false;
    }
    return true;
}

Result<NativeVolume> read_slices(const DicomFolder& folder,
                                 bool resample_shear,
                                 const std::string& path) {
    SONOCASE_TRY(auto stack, dicom_stack(folder.slices, path));
    if (!folder.others.empty())
        stack.warnings.push_back("left out of the DICOM folder: " +
                                 objects_text(folder.others, false));
    return read_stack(stack, resample_shear, false, path);
}

// One file holds a whole stack, or is no stack.
Status check_one_file(const DicomFolder& folder, const std::string& path) {
    std::error_code code;
    if (fs::is_directory(path, code)) return Done{};
    if (folder.slices.empty()) return damaged(path);
    if (folder.slices.front().frames.size() == 1)
        return Error{"one DICOM slice of a series", path, "give the folder of the series"};
    return Done{};
}

Result<NativeVolume> read_headed(const DicomFolder& folder,
                                 bool resample_shear,
                                 const std::string& path) {
    if (!folder.segmentations.empty()) {
        for (const DicomObject& segmentation : folder.segmentations)
            if (segmentation.cut_off)
                return Error{"file is cut off: it ends before its pixels do", segmentation.path,
                             "copy or export it again"};
        SONOCASE_TRY(auto volume, read_dicom_segmentations(
                                      paths_of(folder.segmentations),
                                      scan_step_mm(folder.segmentations.front(), folder.slices),
                                      resample_shear));
        check_scan(folder.segmentations, folder.slices, volume);
        std::vector<DicomObject> others = folder.others;
        others.insert(others.end(), folder.structure_sets.begin(), folder.structure_sets.end());
        for (const std::string& file : folder.damaged) others.push_back({file, "damaged"});
        if (!others.empty())
            volume.notes.push_back({"left_out", "of the folder: " + objects_text(others, false)});
        return volume;
    }
    if (!folder.structure_sets.empty()) {
        // Slices that are labels themselves need none.
        if (auto slices = read_slices(folder, resample_shear, path);
            slices && hold_labels(*slices)) {
            slices->warnings.push_back(
                "the contours of the structure set (RTSTRUCT) are not read: the labels are the "
                "values of the slices beside it");
            return slices;
        }
        return Error{"a DICOM structure set (RTSTRUCT): contours, which are not read",
                     folder.structure_sets.front().path,
                     "expected voxels: make a DICOM segmentation or masks of it, in 3D Slicer with "
                     "SlicerRT, or: plastimatch convert --input FILE --referenced-ct SERIES "
                     "--output-prefix masks --prefix-format nrrd"};
    }
    if (!folder.damaged.empty()) return damaged(folder.damaged.front());
    if (folder.slices.empty() && !folder.others.empty())
        return Error{"holds no labels: " + objects_text(folder.others), path,
                     "expected a DICOM segmentation, or slices whose pixels are label values"};
    SONOCASE_TRY_DONE(check_one_file(folder, path));
    return read_slices(folder, resample_shear, path);
}

}  // namespace

Result<bool> slices_hold_labels(const DicomFolder& folder, const std::string& path) {
    const QuietLibrary quiet;
    itk::Object::GlobalWarningDisplayOff();
    try {
        SONOCASE_TRY_DONE(check_one_file(folder, path));
        // What is wrong with labels may be harmless in a scan.
        const auto labels = read_slices(folder, true, path);
        if (labels) return hold_labels(*labels);
        SONOCASE_TRY(const auto stack, dicom_stack(folder.slices, path, {true}));
        SONOCASE_TRY(const auto scan, read_stack(stack, true, true, path));
        if (hold_labels(scan)) return labels.error();
        return false;
    } catch (const std::exception&) {
        return damaged(path);
    }
}

bool unpack_dicom_pixels(
    const std::string& path, int columns, int rows, int frames, int bits, char* to) {
    const QuietLibrary quiet;
    try {
        gdcm::Reader reader;
        reader.SetFileName(path.c_str());
        const gdcm::Tag pixels(0x7fe0, 0x10);
        if (!reader.CanRead() || !reader.Read()) return false;
        const gdcm::File& file = reader.GetFile();
        if (!file.GetDataSet().FindDataElement(pixels)) return false;
        const auto depth = static_cast<std::uint16_t>(bits);
        gdcm::Bitmap bitmap;
        bitmap.SetNumberOfDimensions(3);
        bitmap.SetDimension(0, static_cast<unsigned>(columns));
        bitmap.SetDimension(1, static_cast<unsigned>(rows));
        bitmap.SetDimension(2, static_cast<unsigned>(frames));
        bitmap.SetPixelFormat(
            gdcm::PixelFormat(1, depth, depth, static_cast<std::uint16_t>(depth - 1), 0));
        bitmap.SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
        bitmap.SetTransferSyntax(file.GetHeader().GetDataSetTransferSyntax());
        bitmap.SetDataElement(file.GetDataSet().GetDataElement(pixels));
        const auto bytes = static_cast<std::uint64_t>(columns) * static_cast<std::uint64_t>(rows) *
                           static_cast<std::uint64_t>(frames) *
                           static_cast<std::uint64_t>(bits / 8);
        return bitmap.GetBufferLength() == bytes && bitmap.GetBuffer(to);
    } catch (const std::exception&) {
        return false;
    }
}

VolumeSize size_in_dicom(const std::string& path) {
    const DicomFolder folder = read_dicom_headers(path);
    if (!folder.segmentations.empty()) return size_in_segmentations(paths_of(folder.segmentations));
    const auto stack = dicom_stack(folder.slices, path, {true});
    VolumeSize size;
    if (!stack) return size;
    for (const DicomSlice& slice : stack->slices)
        size.voxels +=
            static_cast<std::uint64_t>(slice.rows) * static_cast<std::uint64_t>(slice.columns);
    size.bytes = 2 * size.voxels;  // CT and most others have two bytes per voxel
    return size;
}

Result<NativeVolume> read_dicom_scan(const std::string& path, bool resample_shear) {
    const QuietLibrary quiet;
    itk::Object::GlobalWarningDisplayOff();
    try {
        const DicomFolder folder = read_dicom_headers(path);
        if (folder.slices.empty()) return Error{"holds no slices of a scan", path, "expected a CT"};
        SONOCASE_TRY_DONE(check_one_file(folder, path));
        SONOCASE_TRY(const auto stack,
                     dicom_stack(folder.slices, path, {true, folder.segmentations}));
        return read_stack(stack, resample_shear, true, path);
    } catch (const std::exception&) {
        return damaged(path);
    }
}

Result<NativeVolume> read_dicom(const std::string& path, bool resample_shear) {
    const QuietLibrary quiet;
    itk::Object::GlobalWarningDisplayOff();
    if (lower_case(fs::path(path).filename().string()) == "dicomdir")
        return Error{"is the index of a disc (DICOMDIR), which holds no voxels", path,
                     "give the folder of the series or of the segmentation"};
    try {
        return read_headed(read_dicom_headers(path), resample_shear, path);
    } catch (const std::exception&) {
        return damaged(path);
    }
}

}  // namespace sonocase::pipeline::inline import_volume
