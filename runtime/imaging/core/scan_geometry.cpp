// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/scan_geometry.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/imaging/core/host.h"

namespace sonocase::runtime {

PlanePoint ScanGeometry::beam_direction(double line) const {
    if (!fan) return {0, 1};
    const double angle = -half_extent + (line + 0.5) * line_step;
    return {std::sin(angle), std::cos(angle)};
}

PlanePoint ScanGeometry::beam_origin(double line) const {
    if (!fan) return {-half_extent + (line + 0.5) * line_step, 0};
    const PlanePoint d = beam_direction(line);
    return {radius_mm * d.x, radius_mm * d.z - radius_mm};
}

PlanePoint ScanGeometry::point(double line, double sample) const {
    const PlanePoint o = beam_origin(line), d = beam_direction(line);
    const double r = (sample + 0.5) * step_mm;
    return {o.x + r * d.x, o.z + r * d.z};
}

PlanePoint ScanGeometry::pixel_centre(int column, int row) const {
    return {(column - origin_x_px) * mm_per_px, (row - origin_y_px) * mm_per_px};
}

bool ScanGeometry::locate(PlanePoint p, double& line, double& sample) const {
    double across = p.x, r = p.z;
    if (fan) {
        across = std::atan2(p.x, p.z + radius_mm);
        r = std::hypot(p.x, p.z + radius_mm) - radius_mm;
    }
    line = (across + half_extent) / line_step - 0.5;
    sample = r / step_mm - 0.5;
    return line >= -0.5 && line <= scanlines - 0.5 && sample >= -0.5 && sample <= samples - 0.5;
}

SampleRange samples_near(const ScanGeometry& g, int line, PlanePoint p, double reach_mm) {
    const auto& [o, d] = g.beams[static_cast<std::size_t>(line)];
    const double x = p.x - o.x, z = p.z - o.z, along = x * d.x + z * d.z;
    const double beside2 = std::max(x * x + z * z - along * along, 0.0);
    if (!(beside2 <= reach_mm * reach_mm)) return {};
    const double half = std::sqrt(reach_mm * reach_mm - beside2);
    const auto sample = [&](double r) {
        return static_cast<int>(std::clamp(r / g.step_mm, -1.0, g.samples + 1.0));
    };
    const int begin = std::max(sample(along - half) - 1, 0),
              end = std::min(sample(along + half) + 1, g.samples);
    return begin < end ? SampleRange{begin, end} : SampleRange{};
}

ScanGeometry make_scan_geometry(
    const Probe& probe, int scanlines, int samples, int width_px, int height_px) {
    ScanGeometry g;
    g.fan = probe.shape != ProbeShape::linear;
    g.radius_mm = probe.shape == ProbeShape::curvilinear ? probe.radius_mm : 0;
    g.half_extent = 0.5 * (g.fan ? probe.field_of_view_rad : probe.width_mm);
    g.depth_mm = probe.depth_mm;
    g.scanlines = scanlines;
    g.samples = samples;
    g.step_mm = probe.depth_mm / samples;
    g.line_step = 2 * g.half_extent / scanlines;
    g.width_px = width_px;
    g.height_px = height_px;

    for (int l = 0; l < scanlines; ++l) g.beams.push_back({g.beam_origin(l), g.beam_direction(l)});

    double half_width = g.half_extent, top = 0, bottom = g.depth_mm;
    if (g.fan) {
        const double reach = g.radius_mm + g.depth_mm;
        const double quarter = std::acos(0.0);
        half_width = g.half_extent < quarter ? reach * std::sin(g.half_extent) : reach;
        const double low =
            std::min(g.radius_mm * std::cos(g.half_extent), reach * std::cos(g.half_extent));
        top = low - g.radius_mm;
    }
    constexpr double kMargin = 1.04;  // 2 % on each side
    g.mm_per_px = kMargin * std::max(2 * half_width / width_px, (bottom - top) / height_px);
    g.origin_x_px = 0.5 * (width_px - 1);
    g.origin_y_px = 0.5 * (height_px - 1) - 0.5 * (top + bottom) / g.mm_per_px;
    return g;
}

namespace {

// Rows [begin, end).
ScanConversionTable conversion_of_rows(const ScanGeometry& g, int stride, int begin, int end) {
    ScanConversionTable table;
    const auto parts = [](double part) {
        return std::min(static_cast<int>(part * 256 + 0.5), 255);
    };
    visit_scanned_pixels(g, begin, end, table.runs, [&](double line, double sample) {
        line = std::clamp(line, 0.0, g.scanlines - 1.0);
        sample = std::clamp(sample, 0.0, g.samples - 1.0);
        const int l = static_cast<int>(line), k = static_cast<int>(sample);
        // One byte each: the error is at most 1/256 of the step between neighbours.
        table.offset.push_back(static_cast<std::uint32_t>(k) * static_cast<std::uint32_t>(stride) +
                               static_cast<std::uint32_t>(l));
        table.weight.push_back(
            static_cast<std::uint16_t>(parts(line - l) | parts(sample - k) << 8));
    });
    return table;
}

}  // namespace

ScanConversionTable make_scan_conversion_table(JobRunner& jobs, const ScanGeometry& g, int stride) {
    ScanConversionTable halves[2];
    parallel_halves(jobs, g.height_px, [&](std::size_t half, std::size_t begin, std::size_t end) {
        halves[half] =
            conversion_of_rows(g, stride, static_cast<int>(begin), static_cast<int>(end));
    });
    ScanConversionTable& table = halves[0];
    for (PixelRun& run : halves[1].runs)
        run.entry += static_cast<std::uint32_t>(table.offset.size());
    const auto append = [](auto& to, const auto& from) {
        to.insert(to.end(), from.begin(), from.end());
    };
    append(table.runs, halves[1].runs);
    append(table.offset, halves[1].offset);
    append(table.weight, halves[1].weight);
    return std::move(table);
}

}  // namespace sonocase::runtime
