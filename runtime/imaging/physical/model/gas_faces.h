// SPDX-License-Identifier: Apache-2.0

// Where a frame's beams first meet gas (effects gas_ring_down and diaphragm), and the lattice of
// beams and samples on which this and other smooth things are worked out.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "runtime/imaging/physical/model/physical_frame.h"
#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime::physical {

inline constexpr int kMaxNodeSamples = 32;

// The lattice of a frame's beams on which smooth things are worked out (the faces of gas, the
// layers of the wall), linear in between: every few beams and the last one, every few samples.
struct NodeSpacing {
    int beams = 4, samples = 8;
    int scanlines = 192;
    double step_mm = 0.3;

    int nodes() const { return std::max((scanlines - 2) / beams + 2, 2); }
    int line(int node) const { return std::min(node * beams, scanlines - 1); }
    double r_mm(int row) const { return (row * samples + 0.5) * step_mm; }
    // The node before a beam, and the beam's part of the way to the next.
    int node_of(int line) const { return std::min(line / beams, nodes() - 2); }
    float part(int line_number) const {
        const int node = node_of(line_number), from = line(node), to = line(node + 1);
        return to > from ? std::min(static_cast<float>(line_number - from) /
                                        static_cast<float>(to - from),
                                    1.0f)
                         : 0;
    }
};

// Where there are few beams, they are far apart and each is a node.
inline NodeSpacing node_spacing(const ScanGeometry& g, const Tables& t) {
    return {g.scanlines < 88 ? 1 : 4,
            std::clamp(static_cast<int>(t.wall.node_mm / g.step_mm), 1, kMaxNodeSamples),
            g.scanlines, g.step_mm};
}

// Faces of gas are smoothed over neighbouring beams, so that what a face draws is as smooth as the
// face: lines behind it (effect gas_ring_down), and the diaphragm between an organ and the lung
// (effect diaphragm).
//
// Diaphragm, at distance q from it (negative before it), times Row::interface_scale:
//     peak (exp(-(q / s)^2 / 2) + 0.12 exp(-|q| / 3.5 mm)),  s = 1.2 mm before, 1.5 mm behind
//     peak = kDomeAmplitude (0.4 + 0.6 cos^2) 10^(2.5 dB strength / 20)
// kDomeShare of it is added to the surfaces' echo, times Tables::dome_scale, and kDomeShare to the
// scatterers'. The figures are fitted to a tracked sweep of a living liver (docs/realism.md).
//
// The diaphragm is a mirror: what a beam shows behind it lies as far before it, on the same beam
// (mirrored_mm()), kMirrorDb weaker from kMirrorMm behind the line on. That the beam turns aside
// where it meets the diaphragm at a slant is left out.

inline constexpr float kNoFace = 1e9f;
inline constexpr int kFaceHalvings = 4;    // halvings of the stretch between two nodes
inline constexpr double kFaceJoinMm = 12;  // neighbours further apart are two faces
inline constexpr double kDomeFromMm = 25;  // lung nearer to the probe lies under the wall
inline constexpr double kFaceLightMm = 2;  // a face gets the light this far before it
inline constexpr double kDomeAmplitude = 3.6, kDomeStrengthDb = 2.5, kDomeShare = 0.55;
inline constexpr double kDomeBeforeMm = 1.2, kDomeBehindMm = 1.5;
inline constexpr double kDomeTail = 0.12, kDomeTailMm = 3.5;
inline constexpr double kDomeReachMm = 8;
inline constexpr double kDomeGasDb = 8;      // scatterers of the lung count as those of an organ
inline constexpr double kDomeClearMm = 2.5;  // labels waver: gas before it takes no light there
inline constexpr double kMirrorMm = 3, kMirrorDb = -14;

// A lung's dirty shadow comes in streaks, at most kLungStreakDb to both sides, that are noise of
// its tissue: they slide along the chest wall when it breathes. Where air of a pneumothorax lies
// before it nothing slides, the shadow is fainter, and lines of reverberation fade more slowly (a).
inline constexpr double kLungStreakMm = 4, kLungStreakDb = 12;
inline constexpr double kAirTailDb = -7, kAirReverbLoss = 0.62, kAirEdgeMm = 5;
// Its grain changes as the lung slides: it is that of two fields at kLungGrainMm from each other,
// mixed by where between them the lung has come. An M-line of a lung that slides is sand.
inline constexpr double kLungGrainMm = 0.4;  // assumed; the echoes have gone to and fro many times
struct LungGrain {
    std::uint32_t field = 1;  // this one and the next, as `frame` of noise_start()
    float weight[2] = {1, 0};
};
LungGrain lung_grain(const PhysicalFrame& frame);

// What is added to a depth to find where its tissue lies: 0 before the diaphragm.
inline double mirrored_mm(double dome_mm, double r_mm) {
    return 2 * std::min(dome_mm - r_mm, 0.0);
}

// One beam's face: depth along the beam (kNoFace: none).
struct FaceNode {
    float depth_mm = kNoFace;
    float peak = 0;  // peak of the diaphragm, before the cosine; 0: another face of gas
    float tail = 1;  // amplitude of the dirty shadow
    float air = 0;   // 1: a pneumothorax before the lung
    bool lung = false;
};

// Per beam, # lines.
struct GasFaces {
    std::vector<float> depth_mm;       // kNoFace: none
    std::vector<float> dome_mm, peak;  // depth and peak of the diaphragm; kNoFace, 0: none
    std::vector<float> cosine;         // of the angle between beam and face, in the plane
    std::vector<float> tail;           // amplitude of the dirty shadow
    std::vector<float> reverb_loss;    // amplitude of a line of reverberation over the one before
    std::vector<float> slides;         // 1: a lung that no air covers; else 0
    bool any_dome = false, any_slides = false;

    void resize(std::size_t lines) {
        for (auto* per_beam : {&depth_mm, &dome_mm, &peak, &cosine, &tail, &reverb_loss, &slides})
            per_beam->assign(lines, 0.0f);
    }
};

// Finds the face of beam nodes.line(node). Two neighbouring nodes of gas along the beam make a
// face, so that gas thinner than their distance, at most 2.5 mm, may be missed; bone before it
// hides it. gap_mm: gap of the beam; negative: air. Plain and exact; physical/fast/node_lattice.h
// searches sixteen at once.
FaceNode find_face(const PhysicalScene& scene,
                   const ScanGeometry& geometry,
                   const NodeSpacing& nodes,
                   const PhysicalFrame& frame,
                   const BreathingField* breathing,
                   double gap_mm,
                   int node);
// What a lung whose surface lies at `voxel` shows behind it: FaceNode::tail, air and lung.
void show_lung(const PhysicalScene& scene,
               const PhysicalFrame& frame,
               Point3 voxel,
               FaceNode& face);
// Peak of the diaphragm at one of its places, before the cosine.
float dome_peak(const PhysicalScene& scene, Point3 voxel);

// faces: # spacing.nodes(), changed. Fills every beam that `out` has room for.
void join_faces(const ScanGeometry& geometry,
                const NodeSpacing& spacing,
                std::span<FaceNode> faces,
                GasFaces& out);

}  // namespace sonocase::runtime::physical
