// SPDX-License-Identifier: Apache-2.0

#include "pipeline/publish/site_list.h"

#include <algorithm>
#include <filesystem>

#include "formats/base/digest.h"
#include "formats/bundle/case_bundle.h"
#include "formats/bundle/streamed_bundle.h"
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

Result<ReadCase> site_case(std::span<const std::uint8_t> given, const std::string& path) {
    auto bundle = read_bundle(given, path);
    if (!bundle) return bundle.error();
    const std::vector<Exercise> exercises = exercises_of(*bundle, path).exercises;
    const bool plain_first =
        std::any_of(exercises.begin(), exercises.end(),
                    [](const Exercise& exercise) { return exercise.model == "paper"; });
    auto arranged = arranged_for_loading(given, plain_first, path);
    if (!arranged) return arranged.error();
    ReadCase read{{}, std::move(*arranged)};
    SiteCase& out = read.site;
    const std::span<const std::uint8_t> bytes(read.bytes);
    auto first = parts_to_open(bytes, path);
    if (!first) return first.error();
    out.first = std::move(*first);
    out.name = plain_name(path);
    out.title = bundle->manifest.case_name.empty() ? out.name : bundle->manifest.case_name;
    out.bytes = bytes.size();
    out.digest = digest_of(bytes);
    out.file = out.name + "-" + out.digest.substr(0, 8) + ".sonocase";
    for (std::size_t at = 0; at < bytes.size(); at += kSegmentBytes)
        out.segments.push_back(
            hash_of(bytes.subspan(at, std::min(kSegmentBytes, bytes.size() - at))));
    out.preview = std::move(bundle->preview_png);
    for (const Exercise& exercise : exercises)
        out.exercises.push_back({exercise.name, exercise.title, exercise.description});
    return read;
}

std::vector<std::uint8_t> segment_list(const SiteCase& site) {
    std::vector<std::uint8_t> out;
    for (const std::uint64_t hash : site.segments) {
        for (int n = 0; n < 8; ++n) out.push_back(static_cast<std::uint8_t>(hash >> 8 * n));
    }
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
        item["segments"] = one.file + ".segments";
        item["segments_digest"] = digest_of(segment_list(one));
        Json first = Json::array();
        for (const ByteRange& range : one.first)
            first.push_back(Json::array({range.at, range.count}));
        item["first"] = std::move(first);
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
    out["version"] = 2;
    out["xapi"] = xapi;
    out["cases"] = std::move(list);
    return detail::json_text(out, false) + "\n";
}

}  // namespace sonocase::pipeline
