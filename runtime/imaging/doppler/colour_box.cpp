// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/colour_box.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"

namespace sonocase::runtime::doppler {
namespace {

constexpr double kMaxSteerDeg = 30;

}  // namespace

ColourBox::Beam ColourBox::beam(double line) const {
    const double at = (line + 0.5) * line_step - half_extent;
    if (fan) return {0, std::sin(at), std::cos(at)};
    return {at, 0, 1};
}

PlanePoint ColourBox::direction(double line) const {
    if (fan) {
        const double at = (line + 0.5) * line_step - half_extent;
        return {std::sin(at), std::cos(at)};
    }
    const double length = std::sqrt(1 + steer_tan * steer_tan);
    return {steer_tan / length, 1 / length};
}

double ColourBox::line_of(PlanePoint p) const {
    const double at = fan ? std::atan2(p.x, p.z + radius_mm) : p.x - p.z * steer_tan;
    return (at + half_extent) / line_step - 0.5;
}

ColourBox colour_box(const ScanGeometry& geometry, const DopplerSettings& s) {
    ColourBox box;
    box.fan = geometry.fan;
    box.radius_mm = geometry.radius_mm;
    box.half_extent = geometry.half_extent;
    box.line_step = 2 * geometry.half_extent / kColourLines;
    box.row_mm = geometry.depth_mm / kColourRows;
    if (!geometry.fan)
        box.steer_tan =
            std::tan(setting_within(s.steer_deg, -kMaxSteerDeg, kMaxSteerDeg, 0) * kPi / 180);
    const double left = setting_within(s.box_left, 0, 1, 0),
                 right = setting_within(s.box_right, 0, 1, 1);
    const double top = setting_within(s.box_top_mm, 0, geometry.depth_mm, 0),
                 bottom = setting_within(s.box_bottom_mm, 0, geometry.depth_mm, geometry.depth_mm);
    box.first_line = static_cast<int>(std::lround(left * kColourLines));
    box.lines = static_cast<int>(std::lround(right * kColourLines)) - box.first_line;
    box.first_row = static_cast<int>(std::lround(top / box.row_mm));
    box.rows = static_cast<int>(std::lround(bottom / box.row_mm)) - box.first_row;
    return box;
}

ColourPixels::ColourPixels(const ScanGeometry& geometry) : geometry_(geometry) {
    cell_.resize(static_cast<std::size_t>(geometry.width_px) * geometry.height_px);
    pixels_.resize(cell_.size());
    first_.resize(kColourLines * kColourRows + 1);
    steer(0);
}

void ColourPixels::steer(double steer_tan) {
    if (made_ && (geometry_.fan || steer_tan == steer_tan_)) return;
    made_ = true;
    steer_tan_ = steer_tan;
    const double per_line = kColourLines / (2 * geometry_.half_extent),
                 per_row = kColourRows / geometry_.depth_mm;
    // Where each pixel lies, 1/256 of a cell; -1: not scanned.
    const auto place = [&](std::size_t pixel, std::int32_t& line_at, std::int32_t& row_at) {
        const auto width = static_cast<std::size_t>(geometry_.width_px);
        const PlanePoint p = geometry_.pixel_centre(static_cast<int>(pixel % width),
                                                    static_cast<int>(pixel / width));
        double line = 0, sample = 0;
        if (!geometry_.locate(p, line, sample)) return false;
        double across = p.x - p.z * steer_tan, r = p.z;
        if (geometry_.fan) {
            across = std::atan2(p.x, p.z + geometry_.radius_mm);
            r = std::hypot(p.x, p.z + geometry_.radius_mm) - geometry_.radius_mm;
        }
        const double l = (across + geometry_.half_extent) * per_line - 0.5, k = r * per_row - 0.5;
        if (l < -0.5 || l > kColourLines - 0.5) return false;
        // Half a cell at the ends shows the first and the last one.
        line_at =
            std::clamp(static_cast<std::int32_t>(std::lround(256 * l)), 0, 256 * kColourLines - 1);
        row_at =
            std::clamp(static_cast<std::int32_t>(std::lround(256 * k)), 0, 256 * kColourRows - 1);
        return true;
    };
    // Pixels are counted first and then put in order: all pixels of a cell one after another.
    std::fill(first_.begin(), first_.end(), 0u);
    std::int32_t line = 0, row = 0;
    for (std::size_t i = 0; i < cell_.size(); ++i) {
        cell_[i] = -1;
        if (!place(i, line, row)) continue;
        // The fractions are kept beside the cell: 16 bits of each.
        const std::size_t cell = cell_of(line >> 8, row >> 8);
        cell_[i] = static_cast<std::int32_t>(cell) << 16 | (line & 255) << 8 | (row & 255);
        ++first_[cell + 1];
    }
    for (std::size_t c = 0; c + 1 < first_.size(); ++c) first_[c + 1] += first_[c];
    for (std::size_t i = 0; i < cell_.size(); ++i) {
        if (cell_[i] < 0) continue;
        const auto cell = static_cast<std::size_t>(cell_[i] >> 16);
        pixels_[first_[cell]++] = {static_cast<std::uint32_t>(i),
                                   static_cast<std::uint8_t>(cell_[i] >> 8 & 255),
                                   static_cast<std::uint8_t>(cell_[i] & 255)};
    }
    for (std::size_t c = first_.size() - 1; c > 0; --c) first_[c] = first_[c - 1];
    first_[0] = 0;
}

}  // namespace sonocase::runtime::doppler
