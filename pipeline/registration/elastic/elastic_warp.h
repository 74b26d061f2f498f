// SPDX-License-Identifier: Apache-2.0

// The elastic warp: a cubic B-spline displacement, added to the quadratic like the residual warp,
// that closes gaps of some 50 mm while bones and organs keep their volume. It minimises over the
// control points
//
//     gaps at the skin + strain energy of a hyperelastic body with the patient's own tissues
//         + bending 50^4 mean |Hessian d|^2 + landmark_weight sum |y(l) - p|^2
//
// by rounds of matching and one Gauss-Newton step each, from stiff to soft. Not in the paper; the
// energy is that of elastic_strain.h, the annealing that of non-rigid ICP (Amberg et al. 2007).
// A global turn costs nothing, so that a start turned by some ten degrees heals.
#pragma once

#include <span>

#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"
#include "pipeline/registration/elastic/elastic_rows.h"
#include "pipeline/registration/elastic/elastic_strain.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_elastic {

struct ElasticOptions {
    double spacing_mm = 30;  // of control points, >= 10
    double stiffness = 1;    // of all tissues; 0.33 follows the readings closer, 1 keeps organs
    double barrier = 30;     // against det J < barrier_det, mm^2
    double barrier_det = 0.6;
    double bending = 0.0005;
    double rim = 6;       // weight of the surface extrapolated beyond the last readings; 0: none
    int rounds = 12;      // of matching; twice as many where `far`
    bool far = false;     // start from farther: bodies that differ by more than 50 mm
    int iterations = 30;  // of conjugate gradients in each
    int readings = 4000;  // at most so many of them are used
    int skin_queries = 2500;
};

struct ElasticFit {
    int rounds = 0;                // that moved
    int iterations = 0;            // of conjugate gradients
    double strain_mm2 = 0;         // of the last round
    double gaps_mm2 = 0;           // likewise, robust
    double min_det = 0;            // sampled
    std::size_t counterparts = 0;  // readings matched in the last round
};

struct ElasticInput {
    const SkinModel& skin;
    const TargetSurface& target;
    std::span<const std::uint32_t> readings;
    std::span<const Correspondence> landmarks;
    double landmark_weight = 0.02;
    const LabelVolume* labels = nullptr;  // of the patient; null: one tissue
};

// registration  quadratic, and ct_box set; a residual on the same grid is a warm start that is only
//               refined. Its residual is replaced; det J is sampled, not proven.
// Same bytes for any number of threads. Cost: 0.6 s on two cores.
ElasticFit fit_elastic(const ElasticInput& input,
                       const ElasticOptions& options,
                       Registration* registration,
                       const Progress& progress = {});

}  // namespace sonocase::pipeline::inline registration_elastic
