// SPDX-License-Identifier: Apache-2.0

// What a picture's truth needs to know of its geometry, made once: the runs of scanned pixels, and
// each pixel's ray and depth. And the needle's plane.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/needle/needle_chord.h"
#include "runtime/imaging/scan/scan_geometry.h"
#include "runtime/imaging/truth/truth_rows.h"

namespace sonocase::runtime {

class TruthPixels {
  public:
    explicit TruthPixels(const ScanGeometry& geometry);

    int rays() const { return rays_; }
    float rays_per_px_at_face() const { return rays_per_px_at_face_; }
    // Calls work(run, offset of the run's first pixel in a plane) for every run.
    template <class Work>
    void for_each_run(const Work& work) const {
        for (const PixelRun& run : runs_) {
            const TruthRun of{run.row, run.begin, run.end - run.begin, ray_.data() + run.entry,
                              r_mm_.data() + run.entry};
            work(of, static_cast<std::size_t>(run.row) * static_cast<std::size_t>(width_px_) +
                         static_cast<std::size_t>(run.begin));
        }
    }
    bool scanned(int column, int row) const;
    // Sets the pixels outside the scanned area, which no run visits.
    template <class T>
    void set_outside(std::span<T> plane, T value) const {
        std::size_t at = 0;
        for_each_run([&](const TruthRun& run, std::size_t begin) {
            std::fill(plane.data() + at, plane.data() + begin, value);
            at = begin + static_cast<std::size_t>(run.count);
        });
        std::fill(plane.data() + at, plane.data() + plane.size(), value);
    }

  private:
    int width_px_ = 0, rays_ = 0;
    float rays_per_px_at_face_ = 0;
    std::vector<PixelRun> runs_;      // by row, then from the left
    std::vector<std::uint16_t> ray_;  // per scanned pixel, and slack for a vector
    std::vector<float> r_mm_;
};

// 1 where the slab shows the needle's shaft, 2 within tip_mm of its tip, 0 elsewhere.
void needle_plane(const ScanGeometry& geometry,
                  const TruthPixels& pixels,
                  const NeedleShape& needle,
                  double tip_mm,
                  std::span<std::uint8_t> plane);

// Mirrors each row of a plane; an empty one stays so.
template <class T>
void flip_rows(std::span<T> plane, std::size_t width) {
    for (std::size_t at = 0; at < plane.size(); at += width)
        std::reverse(plane.begin() + static_cast<std::ptrdiff_t>(at),
                     plane.begin() + static_cast<std::ptrdiff_t>(at + width));
}

}  // namespace sonocase::runtime
