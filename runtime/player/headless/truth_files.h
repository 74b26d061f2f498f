// SPDX-License-Identifier: Apache-2.0

// The truth of a run's frames as files of one folder (--truth): labels_00000.png and so on, and one
// line of JSON per frame in truth.jsonl. docs/python.md lists the keys.
#pragma once

#include <memory>
#include <string>

#include "formats/base/result.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/truth/frame_truth.h"

namespace sonocase::runtime::inline player_headless {

// One frame's facts as a line of JSON without its end of line, always the same bytes for the same
// facts. frame: its number in the run.
std::string truth_json(const FrameTruth& truth,
                       int frame,
                       FrameStatus status,
                       const std::vector<Label>& labels,
                       const Exercise& exercise);

// Writes the planes of a frame as `folder/KIND_name.png`: labels (16 bits, palette index), needle,
// shadow, lesions (8 bits), depth (16 bits, hundredths of a millimetre below the skin; 0: none).
struct TruthPlaneBuffers {
    TruthPlaneBuffers(int width, int height);
    TruthPlanes planes();
    Status write(const std::string& folder, const std::string& name) const;

    int width_px, height_px;
    std::vector<std::uint8_t> labels, needle, shadowed, lesions;
    std::vector<float> skin_depth_mm;
};

class TruthFiles {
  public:
    // Makes the folder. The bundle must outlive this object. Errors: it cannot be made; those of
    // TruthRenderer::create.
    static Result<std::unique_ptr<TruthFiles>> in(const std::string& folder,
                                                  CaseView bundle,
                                                  const ScanEngine& engine);

    // ms: time of the truth alone, without its files.
    Status add(int frame, const FrameInput& input, FrameStatus status, double& ms);
    Status finish();  // writes truth.jsonl

  private:
    TruthFiles(std::string folder, CaseView bundle, TruthRenderer truth, const ScanEngine& engine);

    std::string folder_;
    CaseView bundle_;
    TruthRenderer truth_;
    const ScanEngine& engine_;
    TruthPlaneBuffers buffers_;
    std::string lines_;
};

}  // namespace sonocase::runtime::inline player_headless
