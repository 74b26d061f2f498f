// SPDX-License-Identifier: Apache-2.0

// The literal counterpart of colour_estimate.h: I/Q samples of scatterers and noise, pulse by
// pulse, through a regression filter and the lag-one autocorrelation. Slow; for tests.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

namespace sonocase::runtime::doppler {

struct MovingPower {
    double power = 1;
    double turns = 0;         // v / (2 v_N)
    double spread_turns = 0;  // standard deviation of a Gaussian spectrum
};

struct EnsembleOptions {
    int pulses = 12, looks = 3;
    int filter_order = 1;  // of the regression; -1: no filter
    double noise = 0.01;   // power
    std::uint64_t seed = 1;
};

// Lag-one autocorrelation of one simulated cell; power: receives R0 of the same samples.
std::complex<double> simulated_lag_one(std::span<const MovingPower> parts,
                                       const EnsembleOptions& options,
                                       double* power = nullptr);

}  // namespace sonocase::runtime::doppler
