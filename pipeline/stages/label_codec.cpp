// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/label_codec.h"

#include <utility>

#include "formats/threads/thread_jobs.h"
#include "pipeline/export/labels/label_files.h"

namespace sonocase::pipeline {
namespace {

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

StageCodec label_codec() {
    return codec_of<LabelFile>(encode, decode);
}

std::vector<StageReport> label_reports(const StageValue& value) {
    return value.as<LabelFile>().reports;
}

VerbFile label_input(const std::string& role, const std::string& meaning) {
    return {role, "labels,--labels", "FILE", meaning,
            [](const std::string& path) -> Result<StageValue> {
                auto file = load_any_labels(path);
                if (!file) return file.error();
                return StageValue::of(std::move(*file));
            }};
}

Status save_labels(const LabelFile& file,
                   std::vector<StageReport> before,
                   const std::string& path) {
    LabelFile copy = file;
    copy.reports.insert(copy.reports.begin(), before.begin(), before.end());
    return save_any_labels(copy, path);
}

}  // namespace sonocase::pipeline
