// SPDX-License-Identifier: Apache-2.0

#include <map>
#include <memory>

#include "pipeline/base/stopwatch.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/tradeoff/boundary_error.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {
namespace {

LabelVolume labels_of(const CaseBundle& bundle) {
    return {bundle.grid, dense_from_bricks(bundle.label_bricks), bundle.labels};
}

Settings settings_of(const Preset& preset) {
    Settings settings;
    for (const auto& [option, value] : preset.settings) settings.push_back({option, value});
    return settings;
}

}  // namespace

std::vector<NamedSettings> preset_points(const StageTable& table) {
    std::vector<NamedSettings> named;
    for (const Preset& preset : table.presets)
        named.push_back({TrialRole::preset, preset.name, settings_of(preset),
                         "coarse voxels and textures show in the picture, not in this mean"});
    return named;
}

Suite case_suite(const AnalyticBody& body, const std::string& body_name) {
    Suite suite;
    suite.name = "case";
    suite.title = "The whole case";
    suite.body = body_name;
    suite.error_name = "mean displacement of surfaces";
    suite.error_unit = "mm";
    suite.truth =
        "The whole chain runs from sampled CT and noisy readings of the mannequin to the cooked "
        "volume, which is compared at 200,000 random points with the analytic anatomy under the "
        "known warp. The fit of the skin cannot see motion inside the body, so this error is "
        "larger than that of resampling alone.";
    suite.knobs = knobs_of(built_in_stages(), suite.name);
    suite.named = preset_points(built_in_stages());
    suite.measure = [body](const Settings& settings) -> Result<Measured> {
        SONOCASE_TRY(auto recipe, embedded_recipe());
        recipe.inputs.torso.body = body;
        SONOCASE_TRY_DONE(apply_settings(settings, recipe.settings));
        const double before = processor_seconds();
        SONOCASE_TRY(const auto cooked, cook_case(recipe));
        const double seconds = processor_seconds() - before;
        const BoundaryError error = measure_boundary_error(cooked.bundle, recipe.inputs.torso);
        return Measured{error.displaced_mm, seconds,
                        std::to_string(error.lost_labels) + " labels lost"};
    };
    return suite;
}

Suite own_case_suite(const Recipe& recipe) {
    struct State {
        Recipe recipe;
        LabelVolume finest;
        BrickVolume<std::uint32_t> finest_boundary;
    };
    auto state = std::make_shared<State>();
    state->recipe = recipe;
    Suite suite;
    suite.name = "case";
    suite.title = "The whole case";
    suite.body = recipe.name;
    suite.error_name = "mean displacement of surfaces against the finest setting";
    suite.error_unit = "mm";
    suite.truth =
        "No truth is known for this case, so each setting is compared with the preset accurate at "
        "200,000 points of a fixed lattice. Errors that all settings share do not show.";
    suite.knobs = knobs_of(built_in_stages(), suite.name);
    suite.named = preset_points(built_in_stages());
    suite.measure = [state](const Settings& settings) -> Result<Measured> {
        const auto cook = [&](const Settings& with) -> Result<CookResult> {
            Recipe own = state->recipe;
            SONOCASE_TRY_DONE(apply_settings(with, own.settings));
            return cook_case(own);
        };
        if (state->finest.voxels.empty()) {
            SONOCASE_TRY(auto made, cook(settings_of(*built_in_stages().find_preset("accurate"))));
            state->finest = labels_of(made.bundle);
            state->finest_boundary =
                static_cast<const BrickVolume<std::uint32_t>&>(made.bundle.boundary);
        }
        const double before = processor_seconds();
        SONOCASE_TRY(const auto made, cook(settings));
        const double seconds = processor_seconds() - before;
        const LabelVolume volume = labels_of(made.bundle);
        std::map<std::string, int> finest_index;
        for (std::size_t i = 0; i < state->finest.labels.size(); ++i) {
            finest_index[state->finest.labels[i].name] = static_cast<int>(i);
        }
        const Grid& grid = state->finest.grid;
        const Box3 box = grid.bounds();
        const Vector3 e = box.extent();
        const double step = std::cbrt(e.x * e.y * e.z / 200000);
        constexpr double kSegmentMm = 0.5;
        std::size_t count = 0, wrong = 0, crossings = 0;
        for (double z = box.lower.z; z < box.upper.z; z += step) {
            for (double y = box.lower.y; y < box.upper.y; y += step) {
                for (double x = box.lower.x; x < box.upper.x; x += step) {
                    const Point3 p{x, y, z};
                    const int here = label_at_point(state->finest, state->finest_boundary, p);
                    // The three axes in turn stand in for random directions.
                    const Vector3 along{count % 3 == 0 ? kSegmentMm : 0,
                                        count % 3 == 1 ? kSegmentMm : 0,
                                        count % 3 == 2 ? kSegmentMm : 0};
                    crossings +=
                        label_at_point(state->finest, state->finest_boundary, p + along) != here;
                    const auto& name =
                        volume.labels[label_at_point(volume, made.bundle.boundary, p)].name;
                    const auto found = finest_index.find(name);
                    wrong += found == finest_index.end() || found->second != here;
                    ++count;
                }
            }
        }
        const double area_per_mm3 =
            2 * static_cast<double>(crossings) / static_cast<double>(count) / kSegmentMm;
        const double displaced =
            static_cast<double>(wrong) / static_cast<double>(count) / area_per_mm3;
        return Measured{displaced, seconds, ""};
    };
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
