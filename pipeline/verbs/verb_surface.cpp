// SPDX-License-Identifier: Apache-2.0

// sonocase surface: the patient's skin from a label map.
#include <CLI/CLI.hpp>

#include "formats/bundle/stage_files.h"
#include "formats/files/stage_file.h"
#include "pipeline/base/parallel.h"
#include "pipeline/command_line/command_line.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/import/label_map.h"
#include "pipeline/registration/skin/skin_surface.h"

namespace sonocase::pipeline {

int verb_surface(int argc, char** argv) {
    CLI::App app(
        "Extract the patient's skin: points, outward normals and triangles in the ct frame");
    std::string labels, table, out;
    SkinSurfaceOptions options;
    CommonOptions common;
    app.add_option("--labels", labels,
                   "Label map: NIfTI, NRRD, MetaImage, DICOM or a folder of masks")
        ->type_name("FILE")
        ->required();
    app.add_option("--table", table, "CSV of value,name[,tissue_class]")->type_name("FILE.csv");
    app.add_option("-o,--output", out, "Where to write the skin")
        ->type_name("SKIN.surface")
        ->required();
    app.add_option("--working-mm", options.working_mm, "Voxels are averaged up to this")
        ->check(CLI::Range(0.5, 10.0))
        ->capture_default_str();
    app.add_option("--smoothing-mm", options.smoothing_mm, "Standard deviation of the Gaussian")
        ->check(CLI::Range(0.0, 10.0))
        ->capture_default_str();
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(common.threads);
    std::optional<SkinSurfaceResult> result;
    {
        ProgressBar bar(common);
        ImportOptions import;
        import.table = table;
        const Result<ImportedLabels> imported = import_label_map(labels, import, bar.progress());
        if (!imported) return fail("surface", imported.error());
        Result<SkinSurfaceResult> skin = extract_skin_surface(imported->labels, options);
        if (!skin) {
            Error error = skin.error();
            if (error.where.empty()) error.where = labels;
            return fail("surface", error);
        }
        result = std::move(*skin);
    }
    print_warnings("surface", result->report);
    if (auto s = save_surface_file({"ct", result->skin, {result->report}}, out); !s) {
        return fail("surface", s.error());
    }
    if (auto s = write_report(common, result->report); !s) return fail("surface", s.error());
    return kDone;
}

}  // namespace sonocase::pipeline
