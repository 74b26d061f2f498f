// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/labels/label_files.h"

#include <utility>

#include "formats/files/stage_file.h"
#include "pipeline/export/labels/export_seg_nrrd.h"
#include "pipeline/import/label_map.h"

namespace sonocase::pipeline {

Result<LabelFile> load_any_labels(const std::string& path) {
    if (path.ends_with(".labels")) return load_label_file(path);
    auto imported = import_label_map(path);
    if (!imported) return imported.error();
    LabelFile file;
    file.frame = "ct";
    file.volume = std::move(imported->labels);
    file.reports = {imported->report};
    return file;
}

Status save_any_labels(const LabelFile& file, const std::string& path) {
    if (path.ends_with(".nrrd")) return export_seg_nrrd(file.volume, path);
    if (!path.ends_with(".labels")) {
        return Error{"unknown kind of output file", path, "OUT.labels or OUT.seg.nrrd"};
    }
    LabelFile copy = file;
    for (StageReport& report : copy.reports) report.seconds = 0;  // same input, same bytes
    return save_label_file(copy, path);
}

}  // namespace sonocase::pipeline
