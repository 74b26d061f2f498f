// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/label_codec.h"

#include <string>
#include <utility>

#include "formats/bundle/stage_files.h"
#include "formats/files/load_save.h"
#include "formats/files/thread_jobs.h"
#include "pipeline/export/nrrd_file.h"
#include "pipeline/import/volume/label_map.h"

namespace sonocase::pipeline::inline stages {

namespace {

// Reads a .labels file, or any label map that import reads.
Result<LabelFile> load_any_labels(const std::string& path) {
    if (path.ends_with(".labels")) return load_label_file(path);
    SONOCASE_TRY(auto imported, import_label_map(path));
    LabelFile file;
    file.frame = "ct";
    file.volume = std::move(imported.labels);
    file.reports = {imported.report};
    return file;
}

// The file's name decides: .labels keeps records and reports; .nrrd (.seg.nrrd) the labels alone.
Status save_any_labels(const LabelFile& file, const std::string& path) {
    if (path.ends_with(".nrrd")) return export_seg_nrrd(file.volume, path);
    if (!path.ends_with(".labels")) {
        return Error{"unknown kind of output file", path, "OUT.labels or OUT.seg.nrrd"};
    }
    LabelFile copy = file;
    copy.reports = without_seconds(copy.reports);  // same input, same bytes
    return save_label_file(copy, path);
}

Bytes encode(const LabelFile& file) {
    LabelFile copy = file;
    copy.reports = without_seconds(copy.reports);
    ThreadJobs jobs;
    return write_label_file(copy, jobs);
}

Result<LabelFile> decode(const Bytes& bytes, const std::string& where) {
    ThreadJobs jobs;
    return read_label_file(bytes, where, jobs);
}

}  // namespace

StageCodec label_codec(const Role<LabelFile>& role) {
    return codec_of(role, encode, decode);
}

VerbFile label_input(const Role<LabelFile>& role, const std::string& meaning) {
    return {role, "labels,--labels", "FILE", meaning,
            [role](const std::string& path) -> Result<StageValue> {
                SONOCASE_TRY(auto file, load_any_labels(path));
                return StageValue::of(role, std::move(file));
            }};
}

Status save_labels(const LabelFile& file,
                   std::vector<StageReport> before,
                   const std::string& path) {
    LabelFile copy = file;
    copy.reports.insert(copy.reports.begin(), before.begin(), before.end());
    return save_any_labels(copy, path);
}

}  // namespace sonocase::pipeline::inline stages
