#include "pipeline/verbs/label_files.h"

#include <utility>

#include "pipeline/import/label_map.h"
#include "pipeline/segmentation/export_seg_nrrd.h"

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
        return Error{"unknown ending of an output", path, "OUT.labels or OUT.seg.nrrd"};
    }
    LabelFile copy = file;
    for (StageReport& report : copy.reports) report.seconds = 0;  // same input, same bytes
    return save_label_file(copy, path);
}

}  // namespace sonocase::pipeline
