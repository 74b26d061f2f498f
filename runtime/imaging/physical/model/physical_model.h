// SPDX-License-Identifier: Apache-2.0

// Model `physical`: the constants that both renderers read. Distances in mm, attenuation in
// dB/cm/MHz, amplitudes relative to a homogeneous liver. docs/effects.md names the source of each.
#pragma once

#include <algorithm>
#include <cstdint>

namespace sonocase::runtime::physical {

inline constexpr double kDbPerLog2 = 6.020599913279624;  // amplitude: 20 log10(2)

// Contact: a gap of at most kMaxGapMm between the probe's face and the skin closes under pressure,
// and the shift of the tissue decays with depth.
inline constexpr double kMaxGapMm = 25;
inline constexpr double kMaxFlatGapMm = 10;  // a flat face bridges less
inline constexpr double kGapReachMm = 45;
inline constexpr double kGapStepMm = 0.5;
inline constexpr double kGapMeanMm = 2.5;  // half width of the mean under a flat face

// A beam as dark as this (log2 of its amplitude: -96 dB) counts as dead: it lights nothing below.
inline constexpr double kDeadLog2 = -16;

// Surfaces further than this from a voxel's centre have no effect in it.
inline constexpr double kSurfaceReachVx = 2.0;

// Boundary roughness and the texture that carries it. Above kSeptaFrequencyMhz fasciae show as
// smooth lines, and kFineRoughnessMm applies.
inline constexpr double kRoughnessMm = 0.28;
inline constexpr double kFineRoughnessMm = 0.1;
inline constexpr int kRoughEdge = 32;  // 128 kB: stays in the second-level cache
inline constexpr double kRoughVoxelMm = 1.4;

// Interfaces: amplitude 60 R^0.85, with the reflection coefficient R at most 0.115; specular and
// diffuse parts by angle. kDiffusePart: of surfaces that are bright at most angles; the slab sees
// them at many tilts at once.
inline constexpr double kDiffusePart = 0.5;
inline constexpr double kInterfaceGain = 60;
inline constexpr double kInterfacePower = 0.85;
inline constexpr double kMaxReflection = 0.115;

// Walls of portal veins and arteries, and half the distance between the two lines of a capsule.
inline constexpr double kVesselWall = 5, kVesselWallMm = 0.45, kCapsuleMm = 0.55;
// A capsule reflects more than the step in impedance gives (assumed).
inline constexpr double kCapsuleGain = 5, kMaxCapsule = 12, kCapsuleOnMuscle = 6;

// Refraction at fluid: a beam that grazes the wall (cosine to its normal below kEdgeCos) loses
// energy along it.
inline constexpr double kEdgeCos = 0.42;
inline constexpr double kEdgeLossLog2PerMm = 0.55;
inline constexpr double kEdgeReachMm = 1.0;

// Tails behind bone and gas.
inline constexpr double kBoneTail = 7.7, kBoneTailMm = 0.6, kBoneTailSlow = 0.1,
                        kBoneTailSlowMm = 4.5;
// What side lobes and reverberation leave in a bone's shadow: 15 to 22 grey in living bone.
inline constexpr double kBoneFloor = 0.075, kBoneFloorMm = 90;
inline constexpr double kGasTail = 1.4, kGasTailMm = 18;
// A smooth face of gas and the probe's face reflect the pulse back and forth: lines at multiples of
// the depth (A-lines), each kReverbLoss of the one before; half a line is kReverbWidth pulses wide.
inline constexpr double kReverb = 2.5, kReverbLoss = 0.42, kReverbWidth = 3;
// In fluid the pulse steepens and its harmonics are lost: attenuation in addition to the fluid's
// own, dB/cm/MHz. Without it, everything behind a full bladder would be white. A fluid that itself
// absorbs, such as blood, lets the pulse steepen less.
inline constexpr double kFluidSteepening = 0.22, kNoSteepeningFrom = 0.2;
inline double fluid_steepening(double attenuation_db_cm_mhz) {
    return kFluidSteepening * std::max(1 - attenuation_db_cm_mhz / kNoSteepeningFrom, 0.0);
}

// Haze: side lobes, relative to the mean envelope nearby.
inline constexpr int kHazeCell = 8;   // samples and beams of a cell of the mean
inline constexpr int kHazeReach = 3;  // cells to each side

inline constexpr int kHazeGrain = 3;  // samples along the beam

// TGC, dB/cm/MHz: abdominal organs for a fan, muscle and fat for a linear probe.
inline constexpr double kGainSlopeFan = 0.50, kGainSlopeLinear = 0.72;
inline constexpr double kMaxNoiseGainDb = 48;
inline constexpr double kGreyFloor = -25, kGreyCeiling = 290;  // limits before the post-filter
// t - kGreyMap t (1 - t)(1 - 2t): close to t - 0.03 sin(2 pi t), without the sine.
inline constexpr double kGreyMap = 0.31;

// Echo offsets are baked one per voxel: a random step of this many voxels (one standard deviation)
// blends them.
inline constexpr double kLookupJitter = 0.4;

inline constexpr int kMaxPersisted = 8;  // frames
inline constexpr int kMaxHazeReach = 8;  // beams to each side

// The light of a beam spreads to its neighbours on the way down: kPenumbraMm below an obstacle it
// has spread as far as the penumbra of the whole aperture. Light below kMinLight does not count.
inline constexpr double kPenumbraMm = 90, kMinLight = 1e-9;
inline constexpr int kMaxSpread = 8;  // beams to each side, from sample to sample

inline constexpr int kMaxLateral = 12;  // taps to each side
inline constexpr int kMaxAxial = 10;

// Needle: a mirror of steel, its echo by the angle between beam and shaft, by the make
// (formats/exercise/needle_makes.h).
inline constexpr double kNeedleGain = 60;
inline constexpr double kNeedleShadowLog2 = 0.9;  // behind a needle that fills the slab
inline constexpr double kNeedleTail = 0.09, kNeedleTailMm = 9;
inline constexpr double kBetweenLines = 0.35;  // of the tail, beside 1 at each line

// Fine structure, below the size of a voxel: fibres of muscle, septa of fat. Periodic cubes of echo
// offsets in quarter dB; a label's frame gives the cube's coordinates.
inline constexpr int kFineEdge = 64;
inline constexpr double kFibreAlongMm = 2.4, kFibreAcrossMm = 0.16;  // size of a cube's voxel
inline constexpr double kPennationRad = 0.2;
inline constexpr double kSeptaAlongMm = 0.8, kSeptaAcrossMm = 0.4;
// Parenchyma: a third cube, whose voxels are the same in all directions.
inline constexpr int kFibreCube = 0, kSeptaCube = 1, kParenchymaCube = 2;
inline constexpr double kParenchymaMm = 1.3;
// Nerves: a fourth cube, bundles of kNerveBundle voxels across, straight along the nerve.
inline constexpr int kNerveCube = 3;
inline constexpr int kNerveBundle = 8;
// Layers of each cube that are looked up along its strands, which hardly change on the way: small
// enough for a second-level cache, where most of the time of fine structure goes.
inline constexpr int kFineLayers[] = {16, 32, 64, 4, 16, 32};
// A pulse above kSeptaFrequencyMhz shows muscle and fat by these two cubes instead of the first
// two: strands and sheets are plates then (streak_plates.h), and the cubes are the ground between
// them.
inline constexpr int kFineMuscleCube = 4, kFineFatCube = 5;
inline constexpr double kSeptaFrequencyMhz = 6;
// Share of the slab in which labels are looked up then: a sample is too small to average many
// places.
inline constexpr double kFineLabelShare = 0.35;
// Deviation of the thickness of plates in organs and of the diaphragm (streak_plates.h,
// gas_faces.h).
inline constexpr double kStreakMm = 0.25, kDomeMm = 1.5;

// Targets and findings of an exercise are balls and ellipsoids in the anatomy; their surface is as
// rough as that of organs.
inline constexpr double kTargetReachMm = 2;
inline constexpr int kMaxTargets = 48;

}  // namespace sonocase::runtime::physical
