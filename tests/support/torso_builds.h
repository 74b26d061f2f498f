// SPDX-License-Identifier: Apache-2.0

// The analytic torso as a patient, and mannequins of other builds made from its skin.
#pragma once

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/registration/register_surfaces.h"
#include "support/body_builds.h"

namespace sonocase::testing {

inline constexpr Build kBuilds[] = {Build::belly, Build::wide, Build::slim, Build::pear,
                                    Build::gaunt};

struct TorsoPatient {
    LabelVolume labels;
    pipeline::SkinSurfaceResult skin;
};

inline const TorsoPatient& torso_patient() {
    static const TorsoPatient patient = [] {
        TorsoPatient p;
        p.labels = pipeline::sample_analytic_torso(pipeline::analytic_torso_grid({3, 3, 3}));
        p.skin = *pipeline::extract_skin_surface(p.labels);
        return p;
    }();
    return patient;
}

// In a random frame of the tracker.
struct BuiltMannequin {
    Surface truth;  // mesh
    Surface sweep;
    Vector3 head, back;
    std::vector<pipeline::Landmark> landmarks;  // navel and pubis
};

inline BuiltMannequin built_mannequin(Build build, std::uint64_t seed, const BuildSweep& plan) {
    using namespace sonocase::pipeline;
    AnalyticMannequinOptions mesh;
    mesh.mesh = true;
    mesh.points = 12000;
    const Surface base = analytic_torso_mannequin(mesh);
    const Registration standard = analytic_torso_truth();
    const Matrix3& turn = standard.mannequin_from_ct.rotation;
    const BodyAxes axes{mannequin_from_ct(standard, {}), -turn.column(0), turn.column(1),
                        turn.column(2)};
    Random random(100 * seed + 7);
    BuiltMannequin out;
    out.truth = built_surface(base, axes, build, seed);
    out.sweep = sweep_of_build(out.truth, axes, plan, random);
    const Rigid pose = random.rigid(200);
    for (Point3& p : out.truth.points) p = pose * p;
    for (Point3& p : out.sweep.points) p = pose * p;
    out.head = pose * axes.head;
    out.back = -(pose * axes.front);
    for (const AnalyticLandmark& mark : analytic_torso_landmarks(9, 0, mesh)) {
        if (mark.name != "navel" && mark.name != "pubis") continue;
        Surface place;
        place.points = {mark.mannequin};
        out.landmarks.push_back(
            {mark.name, mark.ct, pose * built_surface(place, axes, build, seed).points[0]});
    }
    return out;
}

}  // namespace sonocase::testing
