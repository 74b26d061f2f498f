// SPDX-License-Identifier: Apache-2.0

// What the controls of a renderer and of its console may be set to: the same for the options of
// sonoplay, for recipes of data sets and for the Python package.
#pragma once

namespace sonocase::runtime {

template <class T>
struct Limits {
    T min, max;
};

// Of a renderer; 0 is the model's own number, or the machine's.
inline constexpr Limits<int> kScanlineLimits{8, 2048}, kSampleLimits{16, 4096}, kLookLimits{1, 16};
inline constexpr Limits<int> kThreadLimits{1, 256};

inline constexpr Limits<double> kGainDbLimits{-60, 60}, kDynamicRangeDbLimits{20, 120};
inline constexpr Limits<double> kPressMmLimits{0, 40};
inline constexpr Limits<double> kDentMmLimits{0, 50};  // as given; tissue gives way by less

// Of DopplerSettings, in its order. A part of the face, and a depth of the deepest probe.
inline constexpr Limits<double> kFacePartLimits{0, 1}, kDepthMmLimits{0, 500};
inline constexpr Limits<double> kSteerDegLimits{-30, 30};
inline constexpr Limits<double> kScaleCmSLimits{1, 500}, kSpectralScaleCmSLimits{1, 1000};
inline constexpr Limits<double> kBaselineLimits{-0.9, 0.9}, kWallFilterLimits{0, 0.5};
inline constexpr Limits<double> kDopplerGainDbLimits{-30, 30}, kPriorityLimits{0, 1};
inline constexpr Limits<int> kEnsembleLimits{4, 16}, kPersistenceLimits{1, 4};
inline constexpr Limits<double> kGateMmLimits{0.5, 30}, kAngleDegLimits{-80, 80};
inline constexpr Limits<double> kDiameterMmLimits{0, 60};  // 0: not measured
inline constexpr Limits<int> kGatePointLimits{8, 1024};

}  // namespace sonocase::runtime
