// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/dicom_stack.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <tuple>

#include "pipeline/base/line_text.h"

namespace sonocase::pipeline {
namespace {

constexpr const char* kExpected =
    "expected one complete series of CT-like slices; export the series again";
constexpr double kLargestShift = 0.05;  // of the spacing, off even places
constexpr double kSameSlice = 0.01;     // of the spacing: two slices in one place

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

// "; C, which lies between them, is of another series", where there is such a slice.
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
        if (off > kLargestShift * norm(even))
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

    if (auto status = check_directions(stack.slices); !status) return status.error();
    const DicomSlice& any = stack.slices.front();
    const Vector3 normal = cross(any.along_rows, any.along_columns);
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t n = 0; n < stack.slices.size(); ++n)
        order.emplace_back(dot(stack.slices[n].position - Point3{}, normal), n);
    std::sort(order.begin(), order.end());  // by place, then by name
    std::vector<DicomSlice> in_order;
    for (const auto& [place, n] : order) in_order.push_back(std::move(stack.slices[n]));
    stack.slices = std::move(in_order);
    if (auto status = check_spacing(stack.slices, others, normal); !status) return status.error();
    if (auto status = check_declared(stack.slices); !status) return status.error();
    if (std::string warning = warning_of_numbers(stack.slices); !warning.empty())
        stack.warnings.push_back(std::move(warning));
    return stack;
}

}  // namespace sonocase::pipeline
