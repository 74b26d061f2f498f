// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/publish.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include "formats/base/base64.h"
#include "formats/base/digest.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/case_exercises.h"
#include "formats/exercise/course.h"
#include "formats/files/atomic_file.h"
#include "formats/text/json_reader.h"
#include "formats/text/nearest_name.h"
#include "formats/text/toml_reader.h"
#include "pipeline/export/course_package.h"
#include "pipeline/export/ultrasound_picture.h"

namespace sonocase::pipeline::inline exporting {
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
    SONOCASE_TRY(auto bundle, read_bundle(given, path));
    const std::vector<Exercise> exercises = exercises_of(bundle, path).exercises;
    const bool plain_first =
        std::any_of(exercises.begin(), exercises.end(),
                    [](const Exercise& exercise) { return exercise.model == "paper"; });
    SONOCASE_TRY(auto arranged, arranged_for_loading(given, plain_first, path));
    ReadCase read{{}, std::move(arranged)};
    SiteCase& out = read.site;
    const std::span<const std::uint8_t> bytes(read.bytes);
    SONOCASE_TRY(auto first, parts_to_open(bytes, path));
    out.first = std::move(first);
    out.name = plain_name(path);
    out.case_name = bundle.manifest.case_name;
    out.title = case_title(bundle.manifest);
    if (out.title.empty()) out.title = out.name;
    out.bytes = bytes.size();
    out.digest = digest_of(bytes);
    out.file = out.name + "-" + out.digest.substr(0, 8) + ".sonocase";
    for (std::size_t at = 0; at < bytes.size(); at += kSegmentBytes)
        out.segments.push_back(
            hash_of(bytes.subspan(at, std::min(kSegmentBytes, bytes.size() - at))));
    out.preview = std::move(bundle.preview_png);
    for (const Exercise& exercise : exercises) {
        out.exercises.push_back({exercise.name,
                                 exercise.title,
                                 exercise.description,
                                 exercise.mastery,
                                 texts_of_exercise(bundle, exercise.name),
                                 {}});
        for (const Sweep& sweep : exercise.sweeps)
            out.exercises.back().sweeps.push_back(sweep.name);
    }
    return read;
}

std::vector<std::uint8_t> segment_list(const SiteCase& site) {
    std::vector<std::uint8_t> out;
    for (const std::uint64_t hash : site.segments) {
        for (int n = 0; n < 8; ++n) out.push_back(static_cast<std::uint8_t>(hash >> 8 * n));
    }
    return out;
}

std::string site_list_json(const std::vector<SiteCase>& cases, const SiteNotes& notes) {
    using detail::Json;
    Json list = Json::array();
    for (const SiteCase& one : cases) {
        Json item = Json::object();
        item["name"] = one.name;
        item["title"] = one.title;
        item["case"] = one.case_name;
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
            entry["mastery"] = exercise.mastery;
            for (const ExerciseTexts& texts : exercise.texts)
                entry["titles"][texts.language] = texts.title;
            exercises.push_back(std::move(entry));
        }
        item["exercises"] = std::move(exercises);
        list.push_back(std::move(item));
    }
    Json out = Json::object();
    out["format"] = "sonocase site";
    out["version"] = 2;
    out["xapi"] = notes.xapi;
    if (!notes.xapi_auth.empty()) out["xapi_auth"] = notes.xapi_auth;
    if (!notes.course.empty()) out["course"] = notes.course;
    if (!notes.package.empty()) out["package"] = notes.package;
    out["cases"] = std::move(list);
    return detail::json_text(out, false) + "\n";
}

namespace {

namespace fs = std::filesystem;

constexpr const char* kProgramFiles[] = {"style.css", "sonoplay.js", "sonoplay.wasm",
                                         "sonoplay-scalar.wasm", "worker.js"};
constexpr std::size_t kLargeSinglePage = 12 << 20;  // bytes of a case; base64 adds a third

// Text for data inside a page: it must not end the element that holds it.
std::string inside_page(std::string text) {
    for (std::size_t at = 0; (at = text.find('<', at)) != text.npos;)
        text.replace(at, 1, "\\u003c");
    return text;
}

Status replace_once(std::string& text, const std::string& what, const std::string& by) {
    const std::size_t at = text.find(what);
    if (at == text.npos) {
        return Error{"the page has no place '" + what + "'", "",
                     "build it anew with scripts/web of this version"};
    }
    text.replace(at, what.size(), by);
    return Done{};
}

bool is_plain(const std::string& origin) {
    return origin.find_first_not_of(
               "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-:/") == origin.npos;
}
std::string without_path(const std::string& address) {
    const std::size_t scheme = address.find("://");
    return scheme == address.npos ? "" : address.substr(0, address.find('/', scheme + 3));
}

// The origin of a store's address, such as "https://store.example.org".
Result<std::string> store_origin(const std::string& address) {
    const std::string origin = without_path(address);
    const bool local =
        origin.starts_with("http://127.0.0.1:") || origin.starts_with("http://localhost:");
    if (!is_plain(origin) || (!origin.starts_with("https://") && !local)) {
        return Error{"'" + address + "' is not the address of a learning record store", "--xapi",
                     "expected https://HOST/PATH"};
    }
    return origin;
}

// The origin of a pose server's address, such as "ws://127.0.0.1:18946".
Result<std::string> pose_origin(const std::string& address) {
    const std::string origin = without_path(address);
    if (!is_plain(origin) || (!origin.starts_with("ws://") && !origin.starts_with("wss://"))) {
        return Error{"'" + address + "' is not the address of a pose server", "--poses",
                     "expected ws://HOST:PORT"};
    }
    return origin;
}

// "Basic ..." of USER:SECRET; what names its scheme already stays.
std::string authorization(const std::string& key) {
    if (key.empty() || key.find(' ') != std::string::npos) return key;
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(key.data());
    return "Basic " + base64({bytes, key.size()});
}

// The hosts besides its own that the page may connect to.
Result<std::string> other_hosts(const PublishOptions& options) {
    std::string out;
    const std::string& key = options.xapi_key;
    const bool printable =
        std::all_of(key.begin(), key.end(), [](char c) { return c >= ' ' && c < 127; });
    const bool has_form = printable && key.find_first_of(": ") != std::string::npos;
    if (!key.empty() && (options.xapi.empty() || !has_form)) {
        return Error{"a key without a store, or of another form", "--xapi-key",
                     "give --xapi ENDPOINT as well, and USER:SECRET or 'Bearer TOKEN'"};
    }
    if (!options.xapi.empty()) {
        SONOCASE_TRY(const auto origin, store_origin(options.xapi));
        out += " " + origin;
    }
    if (!options.poses.empty()) {
        SONOCASE_TRY(const auto origin, pose_origin(options.poses));
        out += " " + origin;
    }
    return out;
}

// warnings: of covers that could not be drawn, whose cases keep their bundle's slices.
// A case that a site's list names.
struct ListedCase {
    std::string name, file;
};
// Those of the site that is in a folder. Error: the folder has a page that is no site of ours.
Result<std::vector<ListedCase>> listed_cases(const std::string& site) {
    std::error_code failed;
    const std::string path = site + "/cases.json";
    if (!fs::exists(path, failed)) {
        if (fs::exists(site + "/index.html", failed))
            return Error{"this folder has another page in it", site,
                         "give a new folder, or one that publish wrote"};
        return std::vector<ListedCase>{};
    }
    SONOCASE_TRY(const auto text, read_text_file(path));
    detail::Json root;
    detail::JsonFault fault;
    const Error other{"is no list of a site", path, "give a new folder, or one that publish wrote"};
    const auto words = [](const detail::Json& of, const char* key) {
        return of.contains(key) && of[key].is_string() ? of[key].get<std::string>() : "";
    };
    if (!detail::parse_json(text, root, fault) || !root.is_object() ||
        words(root, "format") != "sonocase site" || !root.contains("cases") ||
        !root["cases"].is_array())
        return other;
    std::vector<ListedCase> out;
    for (const detail::Json& one : root["cases"]) {
        if (!one.is_object()) return other;
        const std::string file = words(one, "file");
        if (file.empty() || file.find('/') != file.npos) return other;
        out.push_back({words(one, "name"), file});
    }
    return out;
}

// What publish does to a site's list: cases that stay are read from the site again.
struct SiteChange {
    std::vector<ListedCase> stays;
    std::string note;  // what is on the page no more; empty: nothing
};
SiteChange change_of(const std::vector<ListedCase>& listed,
                     const std::vector<ReadCase>& given,
                     bool add) {
    SiteChange change;
    std::string gone, files;
    for (const ListedCase& one : listed) {
        const auto now = std::find_if(given.begin(), given.end(),
                                      [&](const ReadCase& c) { return c.site.name == one.name; });
        if (now == given.end() && add) {
            change.stays.push_back(one);
            continue;
        }
        if (now == given.end()) gone += (gone.empty() ? "" : ", ") + one.name;
        if (now == given.end() || now->site.file != one.file)
            files += (files.empty() ? "" : ", ") + one.file;
    }
    if (!gone.empty())
        change.note = "No longer on the page: " + gone + " (--add keeps what is there). ";
    if (!files.empty())
        change.note +=
            "No list names these files any more; remove them once nobody plays them: " + files +
            ".";
    return change;
}

Result<ReadCase> read_case(const std::string& path,
                           const std::string& name,
                           std::vector<std::string>& warnings) {
    SONOCASE_TRY(auto bytes, read_large_file(path));
    SONOCASE_TRY(auto read, site_case(bytes, name));
    // As the window draws it: the start of the first exercise.
    auto cover = ultrasound_png(path, {});
    if (cover) {
        read.site.preview = std::move(*cover);
    } else {
        warnings.push_back(
            "The card of " + read.site.name +
            " shows slices of its labels instead of the ultrasound: " + cover.error().message());
    }
    return read;
}

Result<std::vector<ReadCase>> read_cases(const std::vector<std::string>& paths,
                                         std::vector<std::string>& warnings) {
    std::vector<ReadCase> out;
    std::set<std::string> names;
    for (const std::string& path : paths) {
        SONOCASE_TRY(auto read, read_case(path, path, warnings));
        if (!names.insert(read.site.name).second) {
            return Error{"two cases are named " + read.site.name, path, "rename one of the files"};
        }
        out.push_back(std::move(read));
    }
    return out;
}

Result<Published> publish_page(const std::vector<ReadCase>& cases,
                               const std::string& program,
                               const std::string& path,
                               const PublishOptions& options) {
    if (cases.size() != 1) {
        return Error{"one page holds one case, and " + std::to_string(cases.size()) + " are given",
                     "--single-file", "give one case"};
    }
    SONOCASE_TRY(auto page, read_text_file(program + "/single.html"));
    SiteCase site = cases[0].site;
    site.preview.clear();
    const std::string list = "<script type=\"application/json\" id=\"site-list\">" +
                             inside_page(site_list_json(
                                 {site}, {options.xapi, authorization(options.xapi_key), {}, {}})) +
                             "</script>";
    const std::string data = "<script type=\"text/plain\" id=\"case-" + site.name + "\">" +
                             base64(cases[0].bytes) + "</script>";
    SONOCASE_TRY(const auto hosts, other_hosts(options));
    if (!hosts.empty()) {
        SONOCASE_TRY_DONE(replace_once(page, "connect-src 'none'", "connect-src" + hosts));
    }
    SONOCASE_TRY_DONE(replace_once(page, "<!--LIST-->", list));
    SONOCASE_TRY_DONE(replace_once(page, "<!--CASES-->", data));
    SONOCASE_TRY_DONE(write_file(path, page));
    Published out{{path}, {}};
    if (cases[0].bytes.size() > kLargeSinglePage) {
        out.warnings.push_back(
            "The case is large for one page: browsers take seconds to open it. A case cooked with "
            "--preset draft is smaller.");
    }
    return out;
}

}  // namespace

Result<std::string> find_program() {
    std::error_code failed;
    const fs::path self = fs::read_symlink("/proc/self/exe", failed);
    const fs::path bin = self.parent_path();
    for (const fs::path& folder : {bin / "../share/sonocase/web", bin / "../../web/program"}) {
        if (fs::is_regular_file(folder / "sonoplay.wasm", failed))
            return fs::weakly_canonical(folder, failed).string();
    }
    return Error{"the player for browsers is not built", "",
                 "build it with scripts/web, or name its folder with --program"};
}

namespace {

struct SiteCourse {
    Course course;
    SiteFile file;  // its name changes with the content, so that no cache gives an older one
};

// What a module asks of a case that is not there, at its line of the course's file.
std::optional<Error> missing_for(const CourseModule& module,
                                 const TomlTable& table,
                                 const std::vector<ReadCase>& cases) {
    // By the case's name, as in recordings and as the window does; a title only where no case has
    // that name, as courses of before name one.
    const bool named = std::any_of(cases.begin(), cases.end(), [&](const ReadCase& one) {
        return one.site.case_name == module.case_name;
    });
    std::vector<std::string> names, exercises;
    const SiteCase::Entry* found = nullptr;
    for (const ReadCase& one : cases) {
        names.push_back(one.site.case_name);
        if ((named ? one.site.case_name : one.site.title) != module.case_name) continue;
        for (const SiteCase::Entry& entry : one.site.exercises) {
            exercises.push_back(entry.name);
            if (entry.name == module.exercise) found = &entry;
        }
    }
    if (exercises.empty())
        return Error{"the module '" + module.name + "' needs the case '" + module.case_name +
                         "', which is not among those given",
                     table.place("case"), suggest_name(module.case_name, names)};
    if (!found)
        return Error{"the case '" + module.case_name + "' has no exercise '" + module.exercise +
                         "', which the module '" + module.name + "' needs",
                     table.place("exercise"), suggest_name(module.exercise, exercises)};
    const auto& sweeps = found->sweeps;
    if (!module.expert.empty() &&
        std::find(sweeps.begin(), sweeps.end(), module.expert) == sweeps.end())
        return Error{"the exercise '" + module.exercise + "' has no sweep '" + module.expert +
                         "', which the module '" + module.name + "' shows as its expert",
                     table.place("expert"), suggest_name(module.expert, sweeps)};
    return std::nullopt;
}

Result<SiteCourse> read_course(const std::string& path, const std::vector<ReadCase>& cases) {
    SONOCASE_TRY(const auto text, read_text_file(path));
    SONOCASE_TRY(auto course, parse_course(text, path));
    SONOCASE_TRY(const auto root, TomlTable::parse(text, path));
    const std::vector<TomlTable> tables = root.tables("modules");
    std::set<std::string> names;
    for (std::size_t i = 0; i < course.modules.size(); ++i) {
        if (auto missing = missing_for(course.modules[i], tables[i], cases)) return *missing;
        if (!names.insert(plain_identifier(course.modules[i].name)).second)
            return Error{
                "two modules have the address '" + plain_identifier(course.modules[i].name) + "'",
                tables[i].place("name"), "names that differ in more than spaces and signs"};
    }
    SiteCourse out{std::move(course), {"", {text.begin(), text.end()}}};
    out.file.name = "course-" + digest_of(out.file.bytes).substr(0, 8) + ".toml";
    return out;
}

// Faults of the options that a course and its packages need.
Status check_course_options(const PublishOptions& options) {
    for (const std::string& kind : options.packages) {
        const auto& names = package_names();
        if (std::find(names.begin(), names.end(), kind) == names.end())
            return Error{"'" + kind + "' is no kind of package", "--package",
                         suggest_name(kind, names)};
    }
    if (!options.packages.empty() && options.course.empty())
        return Error{"a package holds a course, and none is given", "--package",
                     "give --course FILE as well"};
    if (options.single_file && !options.course.empty())
        return Error{"one page holds one case and no course", "--single-file",
                     "publish the course as a folder"};
    return Done{};
}

struct SiteParts {
    const std::vector<ReadCase>& cases;
    const std::optional<SiteCourse>& course;
    const std::string& program;
    const PublishOptions& options;
};

// All files of a site, its page and its list of cases last. package: the kind that the site is part
// of; empty: none.
Result<std::vector<SiteFile>> files_of(const SiteParts& site, const std::string& package) {
    const PublishOptions& options = site.options;
    std::vector<SiteFile> out;
    std::vector<SiteCase> list;
    for (const ReadCase& one : site.cases) {
        out.push_back({one.site.file, one.bytes});
        out.push_back({one.site.file + ".segments", segment_list(one.site)});
        if (!one.site.preview.empty()) out.push_back({one.site.name + ".png", one.site.preview});
        list.push_back(one.site);
    }
    std::vector<std::string> names(std::begin(kProgramFiles), std::end(kProgramFiles));
    std::error_code failed;
    for (fs::directory_iterator it(site.program, failed), end; !failed && it != end;
         it.increment(failed))
        if (const std::string name = it->path().filename().string();
            name.starts_with("words-") && name.ends_with(".json"))
            names.push_back(name);
    std::sort(names.begin(), names.end());
    // Those of trackers. A page that was built without its camera says so itself.
    for (const char* name : {"camera.js", "camera_worker.js", "camera.wasm", "usb.js", "usb.wasm"})
        if (fs::exists(site.program + "/" + name, failed)) names.push_back(name);
    if (site.course) {
        out.push_back(site.course->file);
        names.push_back("course.js");
    }
    for (const std::string& name : names) {
        SONOCASE_TRY(auto bytes, read_file(site.program + "/" + name));
        out.push_back({name, std::move(bytes)});
    }
    SONOCASE_TRY(auto index, read_text_file(site.program + "/index.html"));
    SONOCASE_TRY(auto hosts, other_hosts(options));
    // A cmi5 platform names its record store when it opens the page.
    if (package == "cmi5" && options.xapi.empty()) hosts += " https:";
    if (!hosts.empty()) {
        SONOCASE_TRY_DONE(replace_once(index, "connect-src 'self'", "connect-src 'self'" + hosts));
    }
    out.push_back({"index.html", {index.begin(), index.end()}});
    const std::string json =
        site_list_json(list, {options.xapi, authorization(options.xapi_key),
                              site.course ? site.course->file.name : "", package});
    out.push_back({"cases.json", {json.begin(), json.end()}});
    return out;
}

std::string retention_warning(const Course& course) {
    const auto asked = std::count_if(course.modules.begin(), course.modules.end(),
                                     [](const CourseModule& m) { return m.retention_days > 0; });
    if (asked == 0) return {};
    return "Learning platforms keep a module that is passed: the packages do not ask for " +
           std::to_string(asked) + " of " + std::to_string(course.modules.size()) +
           " modules again after their retention_days; the site does.";
}

}  // namespace

Result<Published> publish(const std::vector<std::string>& cases,
                          const std::string& site,
                          const PublishOptions& options) {
    SONOCASE_TRY_DONE(check_course_options(options));
    std::string program = options.program_folder;
    if (program.empty()) {
        SONOCASE_TRY(auto found, find_program());
        program = std::move(found);
    }
    Published out;
    SONOCASE_TRY(auto read, read_cases(cases, out.warnings));
    if (options.single_file) return publish_page(read, program, site, options);
    SONOCASE_TRY(const auto listed, listed_cases(site));
    const SiteChange change = change_of(listed, read, options.add);
    for (const ListedCase& one : change.stays) {
        SONOCASE_TRY(auto kept, read_case(site + "/" + one.file, one.name, out.warnings));
        read.push_back(std::move(kept));
    }
    if (!change.note.empty()) out.warnings.push_back(change.note);
    std::optional<SiteCourse> course;
    if (!options.course.empty()) {
        SONOCASE_TRY(course, read_course(options.course, read));
    }
    const SiteParts parts{read, course, program, options};
    SONOCASE_TRY(const auto files, files_of(parts, ""));
    const auto write = [&](const std::string& name, std::span<const std::uint8_t> bytes) -> Status {
        SONOCASE_TRY_DONE(write_file(site + "/" + name, bytes));
        out.files.push_back(site + "/" + name);
        return Done{};
    };
    for (const SiteFile& file : files) SONOCASE_TRY_DONE(write(file.name, file.bytes));
    for (const std::string& kind : options.packages) {
        SONOCASE_TRY(auto packed, files_of(parts, kind));
        packed.insert(packed.begin(), package_manifest(kind, course->course, packed));
        SONOCASE_TRY(const auto zip, zip_of(packed));
        SONOCASE_TRY_DONE(write(plain_identifier(course->course.name) + "-" + kind + ".zip", zip));
    }
    if (!options.packages.empty())
        if (std::string words = retention_warning(course->course); !words.empty())
            out.warnings.push_back(std::move(words));
    return out;
}

}  // namespace sonocase::pipeline::inline exporting
