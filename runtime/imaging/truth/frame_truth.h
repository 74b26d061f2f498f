// SPDX-License-Identifier: Apache-2.0

// The truth beside a picture: what each pixel shows, and what the frame as a whole shows.
//
//     auto truth = TruthRenderer::create(bundle, exercise, options);  // the same as the Renderer's
//     truth->render(input, planes);                    // the FrameInput of the frame
//
// A pixel shows the tissue at its place in the middle of the scan plane, after the contact that
// closes a gap to the skin, the probe and the needle that press it and the breathing that moves it
// (where these effects are on), on the side of the surface where that place lies in its voxel. The
// beam's thickness, the roughness of surfaces and the point spread, which blur the picture, are
// left out.
//
// Part of the portable core: no files, no clock, no thread; render() neither throws nor allocates.
// Source and limits: docs/python.md.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

// The caller's planes, # width * height each, row by row from the top; an empty one is left out and
// costs nothing. Pixels outside the scanned area hold 0, and NaN where numbers are real.
struct TruthPlanes {
    std::span<std::uint8_t> labels;    // palette index; 0: outside the body
    std::span<std::uint8_t> needle;    // 0: none, 1: shaft, 2: tip (its last kTipLengthMm)
    std::span<std::uint8_t> shadowed;  // 1: the beam met bone or gas before (`paper`: casts_shadow)
    // Distance along the beam from where it enters the body to the tissue that the pixel shows.
    // Negative in the gel before the body. NaN where the beam finds no body within 30 mm.
    std::span<float> skin_depth_mm;
    // 1 + the number in shown_lesions() of the lesion that the pixel shows; 0: none, or model
    // `paper`, or effect `targets` is off.
    std::span<std::uint8_t> lesions = {};
    // Where the tissue that the pixel shows lies at rest, frame `mannequin`, x y z. NaN outside the
    // scanned area and where a beam that does not touch is in air.
    std::span<std::array<float, 3>> rest_mm = {};
};
inline constexpr double kTipLengthMm = 2;

struct TargetTruth {
    Point3 centre;          // where it is now, frame `mannequin`
    double plane_mm = 0;    // distance of the centre to the scan plane, along the probe's y
    bool in_image = false;  // its ball meets the plane inside the scanned area
    double tip_mm = 0;      // distance of the needle's tip to the centre; NaN without a needle
};

struct FrameTruth {
    bool posed = false;          // false: the pose was not rigid, and everything else is empty
    Rigid mannequin_from_probe;  // as pressed, and where bone holds it
    PressReport press;
    double time_s = 0;
    std::array<std::uint32_t, 256> pixels_of_label{};           // in the scanned area
    std::array<std::uint32_t, 256> shadowed_pixels_of_label{};  // 0 without the plane `shadowed`
    std::vector<std::uint32_t> pixels_of_lesion;  // # shown_lesions(); 0 without the plane
    double mm2_per_px = 0;
    int beams_touching = 0, beams = 0;  // all touch unless model `physical` has effect contact on

    bool has_needle = false;
    NeedlePose needle;          // as drawn; its dent is 0 without effect deformation
    Point3 tip_probe;           // frame `probe`: y is the distance to the scan plane
    bool tip_in_plane = false;  // inside the slab that the needle shows in, and the scanned area
    double needle_in_image_mm = 0;  // length of the shaft that lies in the slab and the image
    // What shows of them, by formats/scoring/sight.h: as the scores count it.
    bool tip_visible = false;
    double needle_visible_mm = 0;
    int tip_label = 0;                 // tissue that the tip is in; 0: outside the body
    std::vector<TargetTruth> targets;  // one per target of the exercise
    int nearest_target = -1;           // nearest to the tip; -1: no needle or no target
};

// One pixel: what it shows and where that lies.
struct PixelTruth {
    bool scanned = false;  // false: outside the scanned area
    int label = 0;
    Point3 shown;  // where the tissue is now, frame `mannequin`
    Point3 rest;   // where it lies in the bundle
    double skin_depth_mm = 0;
};

class TruthRenderer {
  public:
    // The bundle must outlive the truth. exercise, options: those of the Renderer whose frames it
    // describes. Errors: a bundle without labels; an unknown effect. Cost: some ms.
    static Result<TruthRenderer> create(CaseView bundle,
                                        const Exercise& exercise,
                                        const RenderOptions& options);
    ~TruthRenderer();
    TruthRenderer(TruthRenderer&&) noexcept;
    TruthRenderer& operator=(TruthRenderer&&) noexcept;

    // A pose that is not rigid leaves the planes as they were. renderer: one of the same bundle,
    // exercise and options. If its last frame was of this input, what it found for that frame (how
    // the probe presses, where the beams touch) is not looked for again; the bytes are the same.
    // Cost: docs/python.md.
    const FrameTruth& render(const FrameInput& input,
                             const TruthPlanes& planes,
                             const Renderer* renderer = nullptr);

    // The same for one pixel, in double precision and one step after the other. column, row: in the
    // picture as it is shown, also where it is flipped. Cost: microseconds.
    PixelTruth at(const FrameInput& input, int column, int row);

  private:
    struct Impl;
    explicit TruthRenderer(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace sonocase::runtime
