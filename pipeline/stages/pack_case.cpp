// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/pack_case.h"

#include <algorithm>
#include <cmath>

#include "formats/exercise/exercise.h"
#include "formats/scoring/free_fluid.h"
#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/preview_picture.h"
#include "pipeline/stages/exercise_frame.h"

namespace sonocase::pipeline::inline stages {
namespace {

template <class T>
double brick_bytes(const BrickVolume<T>& bricks) {
    return static_cast<double>(bricks.table.size() * 4 +
                               (bricks.uniform.size() + bricks.pool.size()) * sizeof(T));
}

// Palette index at a point of `mannequin`; 0 outside the grid.
int label_at(const LabelVolume& volume, Point3 point) {
    const Point3 v = volume.grid.voxel_from_point(point);
    if (!(std::abs(v.x) < 1e6) || !(std::abs(v.y) < 1e6) || !(std::abs(v.z) < 1e6)) return 0;
    const int i = static_cast<int>(std::lround(v.x)), j = static_cast<int>(std::lround(v.y)),
              k = static_cast<int>(std::lround(v.z));
    return volume.grid.contains(i, j, k) ? volume.voxels[volume.grid.index(i, j, k)] : 0;
}

void check_exercise(const Exercise& exercise,
                    const LabelVolume& volume,
                    std::vector<std::string>* warnings) {
    std::vector<std::string> names;
    for (const Label& label : volume.labels) names.push_back(label.name);
    const auto has = [&](const std::string& name) {
        return std::find(names.begin(), names.end(), name) != names.end();
    };
    const auto check_place = [&](const std::string& what, const Target& target) {
        const std::string start = exercise.name + ": " + what + " '" + target.name + "' ";
        const int label = label_at(volume, target.centre);
        const std::string& found = names[label];
        if (!target.inside.empty() && !has(target.inside))
            warnings->push_back(start + "is to lie in '" + target.inside +
                                "', which this case lacks; " + suggest_name(target.inside, names));
        else if (!target.inside.empty() && found != target.inside)
            warnings->push_back(start + "lies in '" + found + "' and not in '" + target.inside +
                                "'; move it");
        else if (label == 0)
            warnings->push_back(start + "lies outside the body; move it");
    };
    for (const Target& target : exercise.targets) check_place("target", target);
    for (const Finding& finding : exercise.findings) check_place("finding", finding.lesion);
    for (const std::string& name : exercise.no_go)
        if (!has(name))
            warnings->push_back(exercise.name + ": no-go label '" + name + "' is not in this case");
}

// What a procedure's conditions may name.
std::vector<std::string> region_names(const Exercise& exercise, const LabelVolume& volume) {
    std::vector<std::string> names;
    for (const Target& target : exercise.targets) names.push_back(target.name);
    for (const Finding& finding : exercise.findings) names.push_back(finding.lesion.name);
    for (std::size_t l = 1; l < volume.labels.size(); ++l) names.push_back(volume.labels[l].name);
    return names;
}

// The first line that holds the name in quotes, from 1.
long line_of(const std::string& toml, const std::string& name) {
    const std::size_t at = std::min(toml.find('"' + name + '"'), toml.size());
    return 1 + std::count(toml.begin(), toml.begin() + static_cast<std::ptrdiff_t>(at), '\n');
}

Status check_free_fluid(const Exercise& exercise,
                        const LabelVolume& volume,
                        const std::string& name,
                        const std::string& toml) {
    for (const FreeFluid& fluid : exercise.free_fluids) {
        const std::string where = name + ".toml:" + std::to_string(line_of(toml, fluid.lies_in));
        const FreeFluidPlace place(
            fluid, [&](Point3 p) { return label_at(volume, p); }, volume.labels);
        if (place.label() < 0) {
            std::vector<std::string> names;
            for (std::size_t l = 1; l < volume.labels.size(); ++l)
                names.push_back(volume.labels[l].name);
            return Error{"free fluid lies in '" + fluid.lies_in + "', which the case lacks", where,
                         suggest_name(fluid.lies_in, names)};
        }
        const double max_ml = fluid.ml * (1 + fluid.ml_spread);
        if (max_ml > place.capacity_ml())
            return Error{number_text(max_ml, 4) + " ml of '" + fluid.name + "' do not fit", where,
                         "'" + fluid.lies_in + "' has " + number_text(place.capacity_ml(), 4) +
                             " ml there: lower ml, or raise half_mm"};
    }
    return Done{};
}

// Rounds to 1/4096 mm, and normals to as many digits: finer than any use of a skin needs, and the
// numbers compress to half the size.
Surface rounded(Surface surface) {
    const auto round = [](auto& v) {
        for (int axis = 0; axis < 3; ++axis) v[axis] = std::round(4096 * v[axis]) / 4096;
    };
    for (Point3& p : surface.points) round(p);
    for (Vector3& n : surface.normals) round(n);
    return surface;
}

}  // namespace

Surface mapped_surface(const Surface& surface, const Registration& registration) {
    Surface mapped = surface;
    for (std::size_t i = 0; i < surface.points.size(); ++i) {
        mapped.points[i] = mannequin_from_ct(registration, surface.points[i]);
        if (surface.normals.empty() || !surface.triangles.empty()) continue;
        // Normals go with the inverse transpose; its cofactors need no inverse.
        const Matrix3 j = jacobian(registration, surface.points[i]);
        const Vector3 n = surface.normals[i];
        mapped.normals[i] = normalized(n.x * cross(j.column(1), j.column(2)) +
                                       n.y * cross(j.column(2), j.column(0)) +
                                       n.z * cross(j.column(0), j.column(1)));
    }
    if (!surface.triangles.empty()) add_vertex_normals(mapped);
    return mapped;
}

Result<PackResult> pack_case(const PackInput& input) {
    PackResult result;
    CaseBundle& bundle = result.bundle;
    StageReport& report = result.report;
    report.stage = stage_names::kPack;
    report.version = kPackVersion;
    const LabelVolume& volume = input.cooked;
    for (const Label& label : input.palette) {
        const bool known = std::any_of(input.tissues.begin(), input.tissues.end(),
                                       [&](const Tissue& t) { return t.name == label.tissue; });
        if (!known)
            return Error{"label '" + label.name + "' is of tissue '" + label.tissue +
                             "', which the tissue table lacks",
                         "pack", "cook the textures for this label map"};
    }
    bundle.manifest.case_name = input.case_name;
    bundle.manifest.recipe = input.recipe_text;
    bundle.grid = volume.grid;
    bundle.labels = input.palette;
    bundle.tissues = input.tissues;
    bundle.exercises = input.exercises;
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(volume.voxels, volume.grid.size);
    bundle.echo_offset = input.echo_offset;
    bundle.boundary = input.boundary;
    if (input.region != nullptr) bundle.region = *input.region;
    bundle.textures = input.textures.textures;
    bundle.speckle = input.textures.speckle;
    if (input.ct_skin != nullptr && input.registration != nullptr) {
        bundle.patient_skin = rounded(mapped_surface(*input.ct_skin, *input.registration));
        bundle.skin_unfitted = input.skin_unfitted;
    }
    bundle.mannequin_skin = input.mannequin;
    bundle.flow = input.flow;
    bundle.preview_png = png_of(preview_picture(volume));

    for (EmbeddedExercise& embedded : bundle.exercises) {
        const std::string written = embedded.toml;
        SONOCASE_TRY(auto framed, strip_frame(embedded.toml, embedded.name));
        embedded.toml = framed.toml;
        if (framed.in_ct) {
            if (input.registration == nullptr)
                return Error{"the exercise is written in the frame 'ct'", embedded.name,
                             "give the registration that carries it to the mannequin"};
            SONOCASE_TRY(auto mapped,
                         exercise_to_mannequin(framed.toml, embedded.name, *input.registration));
            embedded.toml = std::move(mapped);
        }
        SONOCASE_TRY(auto aimed, targets_from_key(embedded.toml, embedded.name, input.key));
        embedded.toml = std::move(aimed);
        SONOCASE_TRY(auto exercise, parse_exercise(embedded.toml, embedded.name));
        if (const std::string region = unknown_region(exercise, volume.labels); !region.empty())
            return Error{"the procedure names a region '" + region + "' that the case lacks",
                         embedded.name + ".toml:" + std::to_string(line_of(written, region)),
                         suggest_name(region, region_names(exercise, volume))};
        SONOCASE_TRY_DONE(check_free_fluid(exercise, volume, embedded.name, written));
        check_exercise(exercise, volume, &report.warnings);
    }
    const auto voxels = static_cast<double>(volume.grid.voxel_count());
    report.measures = {
        {"voxels", voxels},
        {"labels", static_cast<double>(volume.labels.size() - 1)},
        {"tissues", static_cast<double>(bundle.tissues.size() - 1)},
        {"exercises", static_cast<double>(bundle.exercises.size())},
        {"label_mb", brick_bytes(bundle.label_bricks) / 1e6},
        {"boundary_mb", brick_bytes(bundle.boundary) / 1e6},
        {"echo_mb", brick_bytes(bundle.echo_offset) / 1e6},
    };
    if (bundle.region) {
        report.measures.push_back(
            {"region_voxels", static_cast<double>(bundle.region->grid.voxel_count())});
        report.measures.push_back({"region_mb", (brick_bytes(bundle.region->label_bricks) +
                                                 brick_bytes(bundle.region->boundary)) /
                                                    1e6});
    }
    return result;
}

}  // namespace sonocase::pipeline::inline stages
