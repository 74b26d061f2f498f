// SPDX-License-Identifier: Apache-2.0

// What goes between the window's thread and the scan thread: controls one way, frames the other.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/doppler/colour_image.h"
#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/imaging/doppler/spectral_strip.h"

namespace sonocase::runtime::inline player_session {

// Pixels of the strip below the picture, and the time that it shows.
inline constexpr int kStripWidth = 768, kStripHeight = 192;

// What a frame shows in a Doppler mode, beside its grey picture.
struct DopplerFrame {
    DopplerMode mode = DopplerMode::off;
    bool has_flow = false;            // the bundle says where blood flows
    std::vector<std::uint8_t> rgb;    // # 3 * pixels of the picture; empty: it is grey
    std::vector<std::uint8_t> strip;  // # kStripWidth * kStripHeight; empty: none
    doppler::SpectralMeasures measures;
    doppler::GateContent gate;
    doppler::ColourReport colour;
};

inline constexpr double kCineSeconds = 20;
inline constexpr double kCineRate = 60;  // frames per second that are kept
inline constexpr double kIdleRate = 40;  // frames per second while no pose arrives
inline constexpr int kMaxEffects = 48;

// What the window asks for; taken over between two frames.
struct ScanControls {
    ImageSettings settings;
    SensorAssignment assignment;
    bool frozen = false;
    bool resting = false;  // the picture is not on the screen: only new poses are rendered
    bool sound = false;    // of the spectral mode
    int cine_back = 0;     // frames back from the newest kept one while frozen
};

// One finished frame, with all that the window shows about it.
struct ScanFrame {
    std::vector<std::uint8_t> pixels;
    int width_px = 0, height_px = 0;
    FrameStatus status = FrameStatus::no_contact;
    FrameRecord record;
    ProcedureView procedure;  // of the exercise's procedure; where it has none, empty
    DopplerFrame doppler;
    TrackerReading reading;
    Renderer::Layout layout;
    GainLaw gain_law;
    double depth_mm = 0, focus_mm = 0;
    Renderer::Accuracy accuracy;
    std::array<EffectCost, kMaxEffects> costs{};
    int cost_count = 0;
    SensorVerdict probe_verdict = SensorVerdict::absent, needle_verdict = SensorVerdict::absent;
    SensorVerdict reference_verdict = SensorVerdict::absent;
    double rendered_s = 0;  // when finished, session clock
    double frame_ms = 0;
    bool waiting = false;  // for the first reading of the tracker: the picture is black
    bool frozen = false;
    int cine_frames = 0;    // that are kept
    int cine_back = 0;      // frames back from the newest; frozen
    double cine_age_s = 0;  // time from the frame shown to the newest one
    double pose_to_pixel_median_ms = 0, pose_to_pixel_p99_ms = 0;
    double frames_per_s = 0;
    std::uint64_t number = 0;
};

}  // namespace sonocase::runtime::inline player_session
