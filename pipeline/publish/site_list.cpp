// SPDX-License-Identifier: Apache-2.0

#include "pipeline/publish/site_list.h"

#include <algorithm>
#include <filesystem>

#include "formats/base/digest.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/case_exercises.h"
#include "formats/text/json_reader.h"

namespace sonocase::pipeline {
namespace {

std::string plain_name(const std::string& path) {
    std::string name = std::filesystem::path(path).stem().string();
    for (char& c : name) {
        const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') ||
                           (c >= 'A' && c <= 'Z') || c == '-' || c == '_';
        if (!plain) c = '-';
    }
    return name.empty() ? "case" : name;
}

}  // namespace

Result<SiteCase> site_case(std::span<const std::uint8_t> bytes, const std::string& path) {
    auto bundle = read_bundle(bytes, path);
    if (!bundle) return bundle.error();
    SiteCase out;
    out.name = plain_name(path);
    out.title = bundle->manifest.case_name.empty() ? out.name : bundle->manifest.case_name;
    out.bytes = bytes.size();
    out.digest = digest_of(bytes);
    out.file = out.name + "-" + out.digest.substr(0, 8) + ".sonocase";
    for (std::size_t at = 0; at < bytes.size(); at += kSegmentBytes)
        out.segments.push_back(
            digest_of(bytes.subspan(at, std::min(kSegmentBytes, bytes.size() - at))));
    out.preview = std::move(bundle->preview_png);
    for (const Exercise& exercise : exercises_of(*bundle, path).exercises)
        out.exercises.push_back({exercise.name, exercise.title, exercise.description});
    return out;
}

std::string site_list_json(const std::vector<SiteCase>& cases, const std::string& xapi) {
    using detail::Json;
    Json list = Json::array();
    for (const SiteCase& one : cases) {
        Json item = Json::object();
        item["name"] = one.name;
        item["title"] = one.title;
        item["file"] = one.file;
        item["bytes"] = one.bytes;
        item["digest"] = one.digest;
        item["segment_bytes"] = kSegmentBytes;
        item["segments"] = one.segments;
        item["preview"] = one.preview.empty() ? Json(nullptr) : Json(one.name + ".png");
        Json exercises = Json::array();
        for (const SiteCase::Entry& exercise : one.exercises) {
            Json entry = Json::object();
            entry["name"] = exercise.name;
            entry["title"] = exercise.title;
            entry["description"] = exercise.description;
            exercises.push_back(std::move(entry));
        }
        item["exercises"] = std::move(exercises);
        list.push_back(std::move(item));
    }
    Json out = Json::object();
    out["format"] = "sonocase site";
    out["version"] = 1;
    out["xapi"] = xapi;
    out["cases"] = std::move(list);
    return detail::json_text(out, false) + "\n";
}

}  // namespace sonocase::pipeline
