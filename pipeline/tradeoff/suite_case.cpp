// SPDX-License-Identifier: Apache-2.0

#include <map>
#include <memory>

#include "formats/registration/registration_json.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/tradeoff/boundary_error.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

LabelVolume labels_of(const CaseBundle& bundle) {
    return {bundle.grid, dense_from_bricks(bundle.label_bricks), bundle.labels};
}

double seconds_of(const CookResult& cooked) {
    double sum = 0;
    for (const StageRun& run : cooked.stages) sum += run.report.seconds;
    return sum;
}

std::vector<NamedSettings> preset_points() {
    std::vector<NamedSettings> named;
    for (const std::string& preset : preset_names()) {
        Settings settings;
        for (const PresetSetting& p : preset_settings(preset)) settings.push_back({p.key, p.value});
        named.push_back({TrialRole::preset, preset, settings});
    }
    return named;
}

const std::vector<Knob>& case_knobs() {
    static const std::vector<Knob> knobs{
        {"resample.voxel_mm",
         {"3", "2", "1.5", "1", "0.75"},
         "1",
         "mm",
         "edge of the cooked voxels",
         "surfaces between voxels",
         "once finer than the fit of the skin, voxels buy nothing more"},
        {"surface.working_mm",
         {"8", "5", "3", "2"},
         "3",
         "mm",
         "voxel to which the body is averaged for its skin",
         "the skin that is fitted",
         "the readings of the mannequin, not the skin, set the error"},
    };
    return knobs;
}

}  // namespace

Status apply_settings(const Settings& settings, StageOptions& options) {
    for (const Setting& s : settings) {
        const std::size_t dot = s.key.find('.');
        const OptionKey* key = dot == std::string::npos
                                   ? nullptr
                                   : find_option_key(s.key.substr(0, dot), s.key.substr(dot + 1));
        if (key == nullptr)
            return Error{"no option '" + s.key + "'", "tradeoff", "see docs/accuracy.md"};
        if (const Status status = set_option(*key, s.value, options, "tradeoff"); !status)
            return status;
    }
    return Done{};
}

Suite case_suite(const AnalyticBody& body, const std::string& body_name) {
    Suite suite;
    suite.name = "case";
    suite.title = "The whole case";
    suite.body = body_name;
    suite.error_name = "mean displacement of surfaces";
    suite.error_unit = "mm";
    suite.truth =
        "The whole chain from sampled CT and noisy readings of the mannequin to the cooked volume, "
        "compared at "
        "200,000 random points with the analytic anatomy under the known warp. The fit of the skin "
        "cannot see "
        "motion inside the body, so this is larger than the error of resampling alone.";
    suite.knobs = case_knobs();
    suite.named = preset_points();
    suite.measure = [body](const Settings& settings) -> Result<Measured> {
        auto recipe = embedded_recipe();
        if (!recipe) return recipe.error();
        recipe->inputs.torso.body = body;
        if (const Status s = apply_settings(settings, recipe->options); !s) return s.error();
        const auto cooked = cook_case(*recipe);
        if (!cooked) return cooked.error();
        const BoundaryError error = measure_boundary_error(cooked->bundle, recipe->inputs.torso);
        return Measured{error.displaced_mm, seconds_of(*cooked),
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
        "No truth is known for this case: each setting is compared, at 200,000 points of a fixed "
        "lattice, with the "
        "preset accurate. What all settings have in common does not show.";
    suite.knobs = case_knobs();
    suite.named = preset_points();
    suite.measure = [state](const Settings& settings) -> Result<Measured> {
        const auto cook = [&](const Settings& with) -> Result<CookResult> {
            Recipe own = state->recipe;
            if (const Status s = apply_settings(with, own.options); !s) return s.error();
            return cook_case(own);
        };
        if (state->finest.voxels.empty()) {
            Settings finest;
            for (const PresetSetting& p : preset_settings("accurate"))
                finest.push_back({p.key, p.value});
            auto made = cook(finest);
            if (!made) return made.error();
            state->finest = labels_of(made->bundle);
            state->finest_boundary = made->bundle.boundary;
        }
        const auto made = cook(settings);
        if (!made) return made.error();
        const LabelVolume volume = labels_of(made->bundle);
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
                    // Lattice directions stand for random ones: the three axes in turn.
                    const Vector3 along{count % 3 == 0 ? kSegmentMm : 0,
                                        count % 3 == 1 ? kSegmentMm : 0,
                                        count % 3 == 2 ? kSegmentMm : 0};
                    crossings +=
                        label_at_point(state->finest, state->finest_boundary, p + along) != here;
                    const auto& name =
                        volume.labels[label_at_point(volume, made->bundle.boundary, p)].name;
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
        return Measured{displaced, seconds_of(*made), ""};
    };
    return suite;
}

}  // namespace sonocase::pipeline
