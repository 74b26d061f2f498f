// SPDX-License-Identifier: Apache-2.0

// What a scanner's colour processor makes of a cell: the lag-one autocorrelation of an ensemble of
// N pulses after the wall filter, averaged over K looks, and from it velocity and power (Kasai et
// al., IEEE TSU 32:458, 1985).
//
// No pulse is simulated. Let R0 be the power that the filter lets through, R1 its lag-one
// autocorrelation, gamma = |R1| / R0, g_k = gamma^(k^2) (a Gaussian spectrum), e = r0 noise / R0
// with r0, r1 what the filter leaves of white noise at lags 0 and 1, M = N - 1, w_k = (M - |k|) /
// M^2 for |k| < M. The estimate of a Gaussian process has the moments
//
//     V_ss = (1 - gamma^2) / 2 * 1/L,   1/L = sum_k w_k gamma^(2 k^2) / K,   V_nn = e^2 / (2 M K),
//     V_re, V_im = e (1 + (M - 1)(1 +- g_2)) / (M^2 K)
//
// and is drawn with them from four normals n0..n3:
//
//     T = max(0, 1 - c + sqrt(c) n0)^3,  c = 1 / (9 max(L, 1))         (power: Wilson and Hilferty)
//     z = g_1 T + sqrt(T V_re + V_nn) n1 + i sqrt(T (V_ss + V_im) + V_nn) n2
//     v = v_N / pi arg(z R1 / |R1| + r1 noise / R0),   power = R0 (T + e (1 + n3 / sqrt(N K)))
//
// Aliasing, bias towards v_N after the filter, and noise that turns uniform follow by themselves.
// ensemble_reference.h has the pulses; docs/flow.md says how far they agree.
#pragma once

#include <array>
#include <cmath>

#include "runtime/imaging/doppler/doppler_maths.h"

namespace sonocase::runtime::doppler {

inline constexpr int kMaxPulses = 16;
inline constexpr float kLooks = 3;  // the processor averages them along the beam

// Power gain of the wall filter on a velocity of `turns` = v / (2 v_N), wrapped or not; it is one
// half at cut_off, a part of v_N in (0, 1). Close to a regression filter of first order.
struct WallFilter {
    explicit WallFilter(double cut_off);
    float gain(float sine_of_half_turn) const {  // |sin(pi v / (2 v_N))|
        const float x = sine_of_half_turn * per_sine_, square = x * x, fourth = square * square;
        return fourth / (1 + fourth);
    }

  private:
    float per_sine_;
};

struct Ensemble {
    explicit Ensemble(int pulses);
    int pulses;
    float r0, r1;  // what a regression of first order leaves of white noise at lags 0 and 1
};

struct ColourEstimate {
    float turns = 0;  // v / (2 v_N), [-1/2, 1/2]
    float power = 0;
};

inline ColourEstimate estimate_colour(
    const Ensemble& ensemble, float r0, float re, float im, float noise, const float n[4]) {
    ColourEstimate out;
    if (!(r0 > 1e-12f)) {  // noise alone
        out.turns = turns_of(n[2], n[1] + 2 * ensemble.r1 / ensemble.r0);
        out.power = noise * ensemble.r0 *
                    (1 + n[3] / std::sqrt(static_cast<float>(ensemble.pulses) * kLooks));
        return out;
    }
    const float size = std::sqrt(re * re + im * im), per = 1 / r0;
    float gamma = size * per;
    gamma = gamma < 1 ? gamma : 1;
    const auto m = static_cast<float>(ensemble.pulses - 1);
    // gamma^(2 k^2), from k to k + 1 by gamma^(4 k + 2).
    const float g2 = gamma * gamma, g4 = g2 * g2;
    float term = 1, step = g2, sum = m;
    for (int k = 1; k < ensemble.pulses - 1; ++k) {
        term *= step;
        step *= g4;
        sum += 2 * (m - static_cast<float>(k)) * term;
    }
    const float one_over_l = sum / (m * m * kLooks), e = ensemble.r0 * noise * per;
    const float v_ss = 0.5f * (1 - g2) * one_over_l, v_nn = e * e / (2 * m * kLooks);
    const float share = e / (m * m * kLooks);
    const float v_im = share * (1 + (m - 1) * (1 - g4)), v_re = share * (1 + (m - 1) * (1 + g4));
    const float c = (one_over_l < 1 ? one_over_l : 1) / 9;
    float root = 1 - c + std::sqrt(c) * n[0];
    root = root > 0 ? root : 0;
    const float t = root * root * root;
    const float zr = gamma * t + std::sqrt(t * v_re + v_nn) * n[1],
                zi = std::sqrt(t * (v_ss + v_im) + v_nn) * n[2];
    const float cosine = size > 0 ? re / size : 1, sine = size > 0 ? im / size : 0;
    out.turns =
        turns_of(zr * sine + zi * cosine, zr * cosine - zi * sine + ensemble.r1 * noise * per);
    out.power = r0 * (t + e * (1 + n[3] / std::sqrt(static_cast<float>(ensemble.pulses) * kLooks)));
    return out;
}

}  // namespace sonocase::runtime::doppler
