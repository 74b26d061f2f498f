// SPDX-License-Identifier: Apache-2.0

// "What am I looking at": the name of what a pixel of the picture shows, and outlines with names of
// all that it shows. From the same truth as `sonoplay --truth` writes.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/body_axes.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/truth/frame_truth.h"

namespace sonocase::runtime::inline player_app {

struct TissueName {
    double column = 0, row = 0;  // where it may stand in the picture
    std::string words;
};

class TissueNames {
  public:
    // bundle, exercise, options: of the engine whose frames are shown; the bundle must outlive
    // this. Errors: those of TruthRenderer::create. Cost: some ms, and body_axes().
    static Result<TissueNames> create(CaseView bundle,
                                      const Exercise& exercise,
                                      const RenderOptions& options);

    // Empty outside the scanned area and outside the body. Cost: microseconds.
    std::string at(const FrameInput& input, int column, int row);
    // rgb: # 3 * pixels, the picture; edges between labels are painted white. Names of what covers
    // at least 0.15 % of the picture. Cost: that of a truth frame.
    std::vector<TissueName> outline(const FrameInput& input, std::span<std::uint8_t> rgb);

    int width_px() const { return width_px_; }
    int height_px() const { return height_px_; }

  private:
    TissueNames(TruthRenderer truth, CaseView bundle, int width_px, int height_px)
        : truth_(std::move(truth)),
          bundle_(bundle),
          axes_(body_axes(*bundle)),
          width_px_(width_px),
          height_px_(height_px) {}
    // The name of what lies there.
    std::string words(int label, Point3 rest) const;

    TruthRenderer truth_;
    CaseView bundle_;
    BodyAxes axes_;
    int width_px_, height_px_;
    std::vector<std::uint8_t> labels_;
};

}  // namespace sonocase::runtime::inline player_app
