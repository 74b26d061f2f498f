// SPDX-License-Identifier: Apache-2.0

// What a picture's truth needs to know of its geometry, made once: the runs of scanned pixels, and
// each pixel's ray and depth. And the needle's plane.
#pragma once

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

}  // namespace sonocase::runtime
