// SPDX-License-Identifier: Apache-2.0

// Where a frame's beams first meet gas, smoothed over neighbouring beams, so that what a face of
// gas draws is as smooth as the face: lines behind it (effect gas_ring_down), and the diaphragm
// between an organ and the lung (effect diaphragm).
//
// Diaphragm, at distance q from it (negative before it), times Row::interface_scale:
//     peak (exp(-(q / s)^2 / 2) + 0.12 exp(-|q| / 3.5 mm)),  s = 1.2 mm before, 1.5 mm behind
//     peak = kDomeAmplitude (0.4 + 0.6 cos^2) 10^(2.5 dB strength / 20)
// kDomeShare of it is added to the surfaces' echo, times Tables::dome_scale, and kDomeShare to the
// scatterers'. Light is kept
// for kDomeReachMm behind it and then gone: black. Source: recipe 10 of the living sweep.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "runtime/imaging/physical/model/physical_frame.h"

namespace sonocase::runtime::physical {

inline constexpr float kNoFace = 1e9f;
inline constexpr int kFaceEvery = 4;       // beams between those that are looked at
inline constexpr double kFaceStepMm = 2;   // gas thinner than this may be missed
inline constexpr double kFaceJoinMm = 12;  // neighbours further apart are two faces
inline constexpr double kDomeFromMm = 25;  // nearer to the face lung lies under the wall
inline constexpr double kFaceLightMm = 2;  // the light that a face gets: so far before it
inline constexpr double kDomeAmplitude = 3.6, kDomeStrengthDb = 2.5, kDomeShare = 0.55;
inline constexpr double kDomeBeforeMm = 1.2, kDomeBehindMm = 1.5;
inline constexpr double kDomeTail = 0.12, kDomeTailMm = 3.5;
inline constexpr double kDomeReachMm = 8;
inline constexpr double kDomeGasDb = 8;  // scatterers of the lung count as those of an organ

// One beam's face: depth along the beam (kNoFace: none).
struct FaceNode {
    float depth_mm = kNoFace;
    float peak = 0;  // of the diaphragm, before the cosine; 0: another face of gas
};

inline std::size_t face_node_count(const ScanGeometry& geometry) {
    return static_cast<std::size_t>((geometry.scanlines - 1) / kFaceEvery + 2);
}

// Per beam, # lines.
struct GasFaces {
    std::vector<float> depth_mm;       // kNoFace: none
    std::vector<float> dome_mm, peak;  // of the diaphragm; kNoFace, 0: none
    std::vector<float> cosine;         // of the beam to the face, in the plane
    bool any_dome = false;
};

// gap_mm: of the beam; negative: air. Cost: 1 us.
FaceNode find_face(const PhysicalScene& scene,
                   const ScanGeometry& geometry,
                   const PhysicalFrame& frame,
                   const BreathingField* breathing,
                   double gap_mm,
                   int line);

// nodes: of beams 0, kFaceEvery, 2 kFaceEvery and so on, changed; the last at or beyond the last
// beam. Fills every beam that `faces` has room for.
void join_faces(const ScanGeometry& geometry, std::span<FaceNode> nodes, GasFaces& faces);

}  // namespace sonocase::runtime::physical
