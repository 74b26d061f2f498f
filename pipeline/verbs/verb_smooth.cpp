// SPDX-License-Identifier: Apache-2.0

// sonocase smooth: takes the steps out of a label volume.
#include <CLI/CLI.hpp>

#include "pipeline/base/parallel.h"
#include "pipeline/command_line/command_line.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/export/segmentation_pictures.h"
#include "pipeline/segmentation/smooth_labels.h"
#include "pipeline/verbs/label_files.h"

namespace sonocase::pipeline {

int verb_smooth(int argc, char** argv) {
    CLI::App app("Smooth all labels of a volume, each at its own volume");
    std::string labels, out;
    SmoothOptions options;
    CommonOptions common;
    app.add_option("labels,--labels", labels, "Labels: .labels or any label map")
        ->type_name("FILE")
        ->required();
    app.add_option("-o,--output", out,
                   "Where to write: OUT.labels, or OUT.seg.nrrd for other tools")
        ->type_name("OUT")
        ->required();
    app.add_option("--method", options.method, "All labels at once, or eq. (10) per label")
        ->check(CLI::IsMember({"joint", "level_set"}))
        ->capture_default_str();
    const char* const joint = "Method joint";
    app.add_option("--sigma-vx", options.sigma_vx, "Smoothing, voxels")
        ->check(CLI::Range(0.0, 4.0))
        ->capture_default_str()
        ->group(joint);
    app.add_option("--detail-vx", options.detail_vx, "Smoothing of what that would wipe out")
        ->check(CLI::Range(0.0, 4.0))
        ->capture_default_str()
        ->group(joint);
    app.add_option("--passes", options.iterations, "Times over")
        ->check(CLI::Range(1, 20))
        ->capture_default_str()
        ->group(joint);
    app.add_option("--volume-iterations", options.volume_iterations,
                   "Newton steps that keep each label's volume; 0: not kept")
        ->check(CLI::Range(0, 50))
        ->capture_default_str()
        ->group(joint);
    app.add_option("--record-band-vx", options.record_band_vx,
                   "Reach of the boundary records, voxels; 0: none")
        ->check(CLI::Range(0.0, 2.6))
        ->capture_default_str()
        ->group(joint);
    const char* const level_set = "Method level_set";
    app.add_option("--k0", options.level_set.k0, "K0 of eq. (10), 1/mm^2")
        ->check(CLI::Range(1e-3, 100.0))
        ->capture_default_str()
        ->group(level_set);
    app.add_option("--iterations", options.level_set.iterations, "Steps of eq. (10)")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str()
        ->group(level_set);
    app.add_option("--time-step", options.level_set.time_step,
                   "Time step of eq. (10); 0: 0.8 of the limit of stability")
        ->capture_default_str()
        ->group(level_set);
    app.add_option("--closest-point", options.level_set.closest_point,
                   "Curvature at the nearest point of the surface")
        ->capture_default_str()
        ->group(level_set);
    std::string pictures;
    app.add_option("--pictures", pictures, "Folder for before and after in three planes")
        ->type_name("DIR");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(common.threads);
    auto input = load_any_labels(labels);
    if (!input) return fail("smooth", input.error());
    Result<SmoothResult> result = Error{};
    {
        ProgressBar bar(common);
        result = smooth_labels(input->volume, options, bar.progress());
    }
    if (!result) return fail("smooth", result.error());
    print_warnings("smooth", result->report);
    LabelFile file{
        input->frame, std::move(result->volume), std::move(result->boundary), {}, input->reports};
    file.reports.push_back(result->report);
    if (!pictures.empty()) {
        const auto status = write_segmentation_pictures(
            {input->volume, nullptr, file.volume, file.boundary}, pictures);
        if (!status) return fail("smooth", status.error());
    }
    if (auto status = save_any_labels(file, out); !status) return fail("smooth", status.error());
    if (auto status = write_report(common, result->report); !status)
        return fail("smooth", status.error());
    return kDone;
}

}  // namespace sonocase::pipeline
