// SPDX-License-Identifier: Apache-2.0

// The colour box: which cells it has, where they lie in the scan plane, and which pixels show
// which cell.
//
// Cells are kColourLines across the whole face and kColourRows over the whole depth; the box is a
// part of them. A fan's lines leave its face at right angles; a linear probe's are parallel and may
// be steered, so that the box becomes a parallelogram.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/core/scan_geometry.h"

namespace sonocase::runtime::doppler {

inline constexpr int kColourLines = 96, kColourRows = 128;

struct ColourBox {
    int first_line = 0, lines = 0, first_row = 0, rows = 0;  // cells
    double steer_tan = 0;
    bool fan = true;
    double line_step = 0, row_mm = 0;  // rad or mm between lines; mm along a line
    double half_extent = 0, radius_mm = 0;

    // Fractional lines and rows of the whole grid; 0 at the middle of the first cell.
    PlanePoint point(double line, double row) const { return on(beam(line), row); }
    // The same for many rows of one line.
    struct Beam {
        double across, sine, cosine;  // across: mm from the middle; 0 for a fan
    };
    Beam beam(double line) const;
    PlanePoint on(const Beam& beam, double row) const {
        const double r = (row + 0.5) * row_mm;
        if (fan) return {(radius_mm + r) * beam.sine, (radius_mm + r) * beam.cosine - radius_mm};
        return {beam.across + r * steer_tan, r};
    }
    PlanePoint direction(double line) const;  // unit, into the body
    double line_of(PlanePoint p) const;       // the line through a point
    bool empty() const { return lines <= 0 || rows <= 0; }
};

// Settings out of range are replaced by the nearest ones that make sense.
ColourBox colour_box(const ScanGeometry& geometry, const DopplerSettings& settings);

// Which pixels show a cell: those between its middle and the middles of the next line and the next
// row, with the fractions in between. Worked out once per geometry and steering angle, so that
// painting touches those pixels alone.
class ColourPixels {
  public:
    ColourPixels(const ScanGeometry& geometry);

    // Recomputes for another steering angle; nothing for a fan. Cost: 3 ms for 512 x 512 pixels.
    void steer(double steer_tan);

    struct Pixel {
        std::uint32_t index;               // in the picture
        std::uint8_t line_part, row_part;  // beyond the cell's middle, 1/256 of a cell
    };
    // A cell of the whole grid. What lies before the middle of the first line or row is shown as
    // if it were there.
    std::span<const Pixel> of(int line, int row) const {
        const std::size_t cell = cell_of(line, row);
        return {pixels_.data() + first_[cell], first_[cell + 1] - first_[cell]};
    }

  private:
    static std::size_t cell_of(int line, int row) { return row * kColourLines + line; }
    ScanGeometry geometry_;
    double steer_tan_ = 0;
    bool made_ = false;
    std::vector<Pixel> pixels_;
    std::vector<std::uint32_t> first_;  // per cell: index of its first pixel; and the end
    std::vector<std::int32_t> cell_;    // per pixel of the picture; -1: not scanned
};

}  // namespace sonocase::runtime::doppler
