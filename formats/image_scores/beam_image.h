// SPDX-License-Identifier: Apache-2.0

// B-mode pictures in beam space, where realism is scored: rows are depths, columns are scan lines.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sonocase {

// Where a scan lies in a picture. Pixel centres are whole numbers, x to the right, y down.
// Fan: lines leave the apex, depth 0 is at `radius_mm` from it, line i of n lies at
// (-half_angle + (i + 1/2) 2 half_angle / n) from straight down. Linear: half_angle_rad is 0,
// (apex_x_px, apex_y_px) is the middle of the face, and lines run straight down.
struct ScanPlace {
    double mm_per_px = 1;
    double apex_x_px = 0, apex_y_px = 0;
    double radius_mm = 0;       // of the probe's face; linear: 0
    double half_angle_rad = 0;  // 0: linear
    double width_mm = 0;        // linear: of the face
    double depth_mm = 0;        // from the face

    bool fan() const { return half_angle_rad > 0; }
};

struct BeamImage {
    int samples = 0, lines = 0;
    double sample_mm = 0.35;
    double radius_mm = 0;  // of the probe's face; linear: 0
    double line_step = 0;  // fan: radians; linear: mm
    bool fan = true;
    std::vector<float> grey;  // # samples * lines, row by row from the face down, [0, 255]

    std::size_t index(int sample, int line) const {
        return static_cast<std::size_t>(sample) * static_cast<std::size_t>(lines) +
               static_cast<std::size_t>(line);
    }
    float at(int sample, int line) const { return grey[index(sample, line)]; }
    double depth_mm(int sample) const { return (sample + 0.5) * sample_mm; }
    double pitch_mm(int sample) const {  // between lines, at a depth
        return fan ? (radius_mm + depth_mm(sample)) * line_step : line_step;
    }
    int sample_of(double mm) const { return static_cast<int>(mm / sample_mm); }
};

// Grid of the scores: 256 lines; a sample per 0.35 mm of a fan, per 0.1 mm of a linear scan.
inline constexpr int kScoreLines = 256;
inline constexpr double kFanSampleMm = 0.35, kLinearSampleMm = 0.1;

// The scan's grid without grey. sample_mm 0: that of the scores.
BeamImage beam_grid(const ScanPlace& place, int lines = kScoreLines, double sample_mm = 0);

struct PixelPoint {
    double x_px = 0, y_px = 0;
};
PixelPoint pixel_of(const ScanPlace& place, const BeamImage& grid, double sample, double line);

struct BeamPoint {
    double sample = 0, line = 0;  // whole numbers at the grid's own samples
};
BeamPoint beam_of(const ScanPlace& place, const BeamImage& grid, PixelPoint pixel);
// Whether a point lies within half a sample and half a line of the grid.
bool in_grid(const BeamImage& grid, BeamPoint point);
double grey_at(const BeamImage& image, BeamPoint point);  // bilinear

// Samples a picture on the beams: bilinear, the nearest pixel beyond the edge. `pixels`:
// # width * height, rows from the top down. Cost: 1 ms per 130,000 samples.
BeamImage beam_from_picture(std::span<const std::uint8_t> pixels,
                            int width_px,
                            int height_px,
                            const ScanPlace& place,
                            int lines = kScoreLines,
                            double sample_mm = 0);

// The picture that the lines give; `outside` beyond the scan. Bilinear.
std::vector<std::uint8_t> picture_from_beam(const BeamImage& image,
                                            const ScanPlace& place,
                                            int width_px,
                                            int height_px,
                                            std::uint8_t outside = 0);

}  // namespace sonocase
