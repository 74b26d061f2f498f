// SPDX-License-Identifier: Apache-2.0

// sonocase resample: labels of the patient become cubic voxels in the mannequin's frame.
#include <CLI/CLI.hpp>

#include "formats/files/registration_file.h"
#include "formats/registration/registration_json.h"
#include "pipeline/base/parallel.h"
#include "pipeline/command_line/command_line.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/export/segmentation_pictures.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/verbs/label_files.h"

namespace sonocase::pipeline {

int verb_resample(int argc, char** argv) {
    CLI::App app("Carry a label map through the fitted map into cubic voxels, and smooth it");
    std::string labels, fit, out;
    ResampleOptions options;
    CommonOptions common;
    app.add_option("labels,--labels", labels, "Labels in the ct frame: .labels or any label map")
        ->type_name("FILE")
        ->required();
    app.add_option("--registration", fit, "The fit, as register writes it")
        ->type_name("REG.json")
        ->required();
    app.add_option("-o,--output", out,
                   "Where to write: OUT.labels, or OUT.seg.nrrd for other tools")
        ->type_name("OUT")
        ->required();
    app.add_option("--voxel-mm", options.voxel_mm, "Edge of the cubic voxels, mm")
        ->check(CLI::Range(0.2, 10.0))
        ->capture_default_str();
    app.add_option("--margin-mm", options.margin_mm, "Air kept round the body, mm")
        ->check(CLI::Range(0.0, 50.0))
        ->capture_default_str();
    app.add_option("--method", options.method, "How labels go through the map")
        ->check(CLI::IsMember({"shape", "nearest", "paper"}))
        ->capture_default_str();
    const char* const shape = "Method shape";
    app.add_option("--sigma-vx", options.sigma_vx, "Smoothing, voxels of the map in the plane")
        ->check(CLI::Range(0.0, 4.0))
        ->capture_default_str()
        ->group(shape);
    app.add_option("--detail-vx", options.detail_vx, "Smoothing of what that would wipe out")
        ->check(CLI::Range(0.0, 4.0))
        ->capture_default_str()
        ->group(shape);
    app.add_option("--sigma-slices", options.sigma_slices,
                   "Smoothing along thick slices, slices; 0: as in the plane")
        ->check(CLI::Range(0.0, 2.0))
        ->capture_default_str()
        ->group(shape);
    app.add_option("--volume-iterations", options.volume_iterations,
                   "Newton steps that keep each label's volume; 0: not kept")
        ->check(CLI::Range(0, 50))
        ->capture_default_str()
        ->group(shape);
    app.add_option("--record-band-vx", options.record_band_vx,
                   "Reach of the boundary records, voxels; 0: none")
        ->check(CLI::Range(0.0, 2.6))
        ->capture_default_str()
        ->group(shape);
    app.add_option("--block-vx", options.block_vx,
                   "Edge of the blocks that distances are kept in, nodes; time and memory alone")
        ->check(CLI::IsMember({4, 8, 16}))
        ->capture_default_str()
        ->group(shape);
    const char* const paper = "Method paper";
    app.add_option("--k0", options.level_set.k0, "K0 of eq. (10), 1/mm^2")
        ->check(CLI::Range(1e-3, 100.0))
        ->capture_default_str()
        ->group(paper);
    app.add_option("--iterations", options.level_set.iterations, "Steps of eq. (10)")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str()
        ->group(paper);
    std::string pictures;
    app.add_option("--pictures", pictures, "Folder for before and after in three planes")
        ->type_name("DIR");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(common.threads);
    auto input = load_any_labels(labels);
    if (!input) return fail("resample", input.error());
    auto registration = load_registration(fit);
    if (!registration) return fail("resample", registration.error());
    Result<ResampleResult> result = Error{};
    {
        ProgressBar bar(common);
        result = resample_labels({input->volume, *registration}, options, bar.progress());
    }
    if (!result) return fail("resample", result.error());
    print_warnings("resample", result->report);
    LabelFile file{
        "mannequin", std::move(result->volume), std::move(result->boundary), {}, {result->report}};
    if (!pictures.empty()) {
        const auto status = write_segmentation_pictures(
            {input->volume, &*registration, file.volume, file.boundary}, pictures);
        if (!status) return fail("resample", status.error());
    }
    if (auto status = save_any_labels(file, out); !status) return fail("resample", status.error());
    if (auto status = write_report(common, result->report); !status)
        return fail("resample", status.error());
    return kDone;
}

}  // namespace sonocase::pipeline
