// SPDX-License-Identifier: Apache-2.0

// Where the beams of a probe run in the scan plane, and which beam sample each pixel shows.
//
// Scan plane: the probe frame's x (lateral) and z (depth), mm, origin at the middle of the probe's
// face. Beam l of L, l in [0, L), leaves beam_origin(l) along beam_direction(l); sample k of S lies
// at depth (k + 1/2) * step_mm along it. Fractional beams and samples are allowed everywhere.
// Linear: parallel beams over the face. Curvilinear: beams fan out from the centre of the face's
// curvature. Phased: the same with radius 0, so that the sector's tip is the origin.
// Constant time except make_*; nothing fails.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/exercise/exercise.h"

namespace sonocase::runtime {

struct PlanePoint {
    double x = 0, z = 0;
};

struct ScanGeometry {
    bool fan = true;
    double radius_mm = 0;    // fan: radius of the probe's face
    double half_extent = 0;  // fan: half the opening angle, rad; linear: half the face, mm
    double depth_mm = 0;
    int scanlines = 0, samples = 0;
    double step_mm = 0;    // along a beam
    double line_step = 0;  // between beams: rad (fan) or mm (linear)
    int width_px = 0, height_px = 0;
    double mm_per_px = 0, origin_x_px = 0, origin_y_px = 0;  // pixel of the plane's origin
    struct Beam {
        PlanePoint origin, direction;
    };
    std::vector<Beam> beams;  // # scanlines

    PlanePoint beam_origin(double line) const;
    PlanePoint beam_direction(double line) const;  // unit
    PlanePoint point(double line, double sample) const;
    PlanePoint pixel_centre(int column, int row) const;
    // Fractional beam and sample of a point; true if it lies inside the scanned area.
    bool locate(PlanePoint p, double& line, double& sample) const;
};

// Samples of a beam, within its depth, that lie within `reach_mm` of a point of the plane; empty if
// none does.
struct SampleRange {
    int begin = 0, end = 0;
};
SampleRange samples_near(const ScanGeometry& geometry, int line, PlanePoint p, double reach_mm);

// Fits the scanned area into the picture with a margin of 2 %.
ScanGeometry make_scan_geometry(
    const Probe& probe, int scanlines, int samples, int width_px, int height_px);

// One horizontal run of pixels inside the scanned area; their table entries follow one another.
struct PixelRun {
    std::int32_t row = 0, begin = 0, end = 0;
    std::uint32_t entry = 0;
};

// Appends the runs of rows [row_begin, row_end), whose entries count from 0, and calls
// visit(line, sample) for each of their pixels in the same order.
template <class Visit>
void visit_scanned_pixels(const ScanGeometry& g,
                          int row_begin,
                          int row_end,
                          std::vector<PixelRun>& runs,
                          const Visit& visit) {
    std::uint32_t entry = 0;
    for (int row = row_begin; row < row_end; ++row) {
        bool open = false;
        for (int column = 0; column < g.width_px; ++column) {
            double line = 0, sample = 0;
            const bool inside = g.locate(g.pixel_centre(column, row), line, sample);
            if (inside && !open) runs.push_back({row, column, column, entry});
            open = inside;
            if (!inside) continue;
            runs.back().end = column + 1;
            ++entry;
            visit(line, sample);
        }
    }
}

// Per pixel inside the scanned area: the beam sample at its upper left, and bilinear weights / 256.
struct ScanConversionTable {
    std::vector<PixelRun> runs;         // by row, then from the left
    std::vector<std::uint32_t> offset;  // sample * stride + line
    std::vector<std::uint16_t> weight;  // low byte across beams, high byte along them
};

// stride: values per row of beam samples. Cost: 15 ms for 512 x 512 pixels, in two jobs.
ScanConversionTable make_scan_conversion_table(JobRunner& jobs,
                                               const ScanGeometry& geometry,
                                               int stride);

}  // namespace sonocase::runtime
