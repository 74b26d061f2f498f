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

#include "runtime/imaging/physical/model/node_spacing.h"
#include "runtime/imaging/physical/model/physical_frame.h"

namespace sonocase::runtime::physical {

inline constexpr float kNoFace = 1e9f;
inline constexpr int kFaceHalvings = 4;    // of the stretch between two nodes
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

// Per beam, # lines.
struct GasFaces {
    std::vector<float> depth_mm;       // kNoFace: none
    std::vector<float> dome_mm, peak;  // of the diaphragm; kNoFace, 0: none
    std::vector<float> cosine;         // of the beam to the face, in the plane
    bool any_dome = false;
};

// The face of beam nodes.line(node). Two neighbouring nodes of gas along the beam make a face, so
// that gas thinner than their distance, at most 2.5 mm, may be missed; bone before it hides it.
// gap_mm: of the beam; negative: air. Plain and exact; physical/fast/node_lattice.h searches
// sixteen at once.
FaceNode find_face(const PhysicalScene& scene,
                   const ScanGeometry& geometry,
                   const NodeSpacing& nodes,
                   const PhysicalFrame& frame,
                   const BreathingField* breathing,
                   double gap_mm,
                   int node);
// Peak of the diaphragm at a place of it, before the cosine.
float dome_peak(const PhysicalScene& scene, Point3 voxel);

// faces: # spacing.nodes(), changed. Fills every beam that `out` has room for.
void join_faces(const ScanGeometry& geometry,
                const NodeSpacing& spacing,
                std::span<FaceNode> faces,
                GasFaces& out);

}  // namespace sonocase::runtime::physical
