// SPDX-License-Identifier: Apache-2.0

// sonocase import: a segmented CT becomes labels in the `ct` frame.
#include <CLI/CLI.hpp>

#include "formats/bundle/stage_files.h"
#include "formats/files/stage_file.h"
#include "pipeline/command_line/command_line.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/import/label_map.h"

namespace sonocase::pipeline {

int verb_import(int argc, char** argv) {
    CLI::App app("Read a label map of any kind into labels in the ct frame (RAS+, mm)");
    std::string labels, out;
    ImportOptions options;
    CommonOptions common;
    app.add_option("LABELS", labels,
                   "NIfTI, NRRD, .seg.nrrd, MetaImage, folder of masks, or folder of DICOM slices")
        ->required();
    app.add_option("-o,--output", out, "Where to write")->type_name("CT.labels")->required();
    app.add_option("--table", options.table,
                   "Names of the values: rows of value,name[,tissue_class]")
        ->type_name("FILE.csv");
    app.add_option("--scale", options.scale, "Millimetres per unit of the file")
        ->check(CLI::Range(1e-6, 1e6))
        ->capture_default_str();
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    Result<ImportedLabels> imported = Error{};
    {
        ProgressBar bar(common);
        imported = import_label_map(labels, options, bar.progress());
    }
    if (!imported) return fail("import", imported.error());
    print_warnings("import", imported->report);
    StageReport without_seconds = imported->report;
    without_seconds.seconds = 0;
    LabelFile file{"ct", std::move(imported->labels), {}, {}, {without_seconds}};
    if (auto status = save_label_file(file, out); !status) return fail("import", status.error());
    if (auto status = write_report(common, imported->report); !status)
        return fail("import", status.error());
    return kDone;
}

}  // namespace sonocase::pipeline
