// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/matching/map_skin.h"

#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/map_evaluator.h"

namespace sonocase::pipeline {

MappedSkin map_skin(const SkinModel& skin, Point3 target_origin, const Registration& registration) {
    const MapEvaluator evaluate(registration);
    const Vector3 shift_in = skin.origin - evaluate.ct_centre();
    const Vector3 shift_out = evaluate.mannequin_centre() - target_origin;
    MappedSkin mapped;
    mapped.points.resize(skin.points.size());
    mapped.normals.resize(skin.points.size());
    parallel_for(skin.points.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const MapSample s = evaluate((skin.points[i] - Point3{}) + shift_in);
            mapped.points[i] = Point3{} + (s.value + shift_out);
            mapped.normals[i] = normalized(transpose(inverse(s.jacobian)) * skin.normals[i]);
        }
    });
    mapped.index = PointIndex(mapped.points);
    return mapped;
}

}  // namespace sonocase::pipeline
