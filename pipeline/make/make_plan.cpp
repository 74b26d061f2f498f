// SPDX-License-Identifier: Apache-2.0

#include "pipeline/make/make_plan.h"

#include <algorithm>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"
#include "pipeline/anatomy/label_table.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/import/volume/source_contents.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline::inline make {

namespace fs = std::filesystem;

namespace {

constexpr const char* kMadeFile = "made.json";

std::string name_of(const std::string& path) {
    const fs::path whole(path);
    const std::string name = whole.filename().string();
    return name.empty() || name == "."
               ? fs::absolute(whole).lexically_normal().parent_path().filename().string()
               : name;
}

std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        out += c;
    }
    return out + "\"";
}

bool lies_in(const fs::path& inner, const fs::path& outer) {
    const fs::path way = inner.lexically_relative(outer);
    return !way.empty() && *way.begin() != "..";
}

fs::path folder_of_case(const std::string& out) {
    return fs::path(out).parent_path() / fs::path(out).stem();
}

// A case written among its inputs would be read as one of them the next time.
Status check_apart(const MakeOptions& options) {
    std::error_code code;
    const fs::path folder = fs::weakly_canonical(fs::absolute(folder_of_case(options.out)), code);
    std::vector<std::string> inputs = options.inputs;
    if (!options.scan.empty()) inputs.push_back(options.scan);
    for (const std::string& input : inputs) {
        fs::path path = fs::weakly_canonical(fs::absolute(input), code);
        if (!path.has_filename()) path = path.parent_path();
        const char* how = folder == path          ? "is"
                          : lies_in(folder, path) ? "lies in"
                          : lies_in(path, folder) ? "holds"
                                                  : nullptr;
        if (how != nullptr)
            return Error{std::string("the case's folder ") + how + " the input " + name_of(input),
                         folder_of_case(options.out).string(),
                         "give -o elsewhere, outside of all inputs"};
    }
    return Done{};
}

}  // namespace

Result<FoundInputs> find_inputs(const MakeOptions& options, const Decided& decided) {
    SONOCASE_TRY_DONE(check_apart(options));
    FoundInputs found;
    found.resample_shear = options.resample_shear;
    std::string kind;
    for (const std::string& input : options.inputs) {
        SONOCASE_TRY(const auto contents, contents_of(input));
        if (!contents.labels.empty() && !found.labels.empty())
            return Error{
                "two label maps, " + name_of(found.labels) + " and " + name_of(contents.labels),
                input, "give one of them"};
        if (!contents.scan.empty() && !found.scan.empty() && options.scan.empty())
            return Error{"two scans, " + name_of(found.scan) + " and " + name_of(contents.scan),
                         input, "give one of them, or --scan"};
        if (!contents.labels.empty()) {
            found.labels = contents.labels;
            kind = contents.labels_kind;
        }
        if (!contents.scan.empty()) {
            found.scan = contents.scan;
            decided(
                {"scan: " + contents.scan_kind + " in " + name_of(contents.scan), "--scan PATH"});
        }
        if (contents.shear_deg > 0 && !found.resample_shear) {
            found.resample_shear = true;
            decided({text("slices of a tilted gantry (%.3g degrees): each is moved by whole pixels",
                          contents.shear_deg),
                     "a series that was resampled to right angles"});
        }
        for (const std::string& other : contents.left_out)
            decided({"left out: " + other, "give it by its own path"});
    }
    if (found.labels.empty())
        return Error{"a scan without a segmentation", options.inputs.front(),
                     "segment it first, such as with TotalSegmentator, and give both"};
    decided({"labels: " + kind + " in " + name_of(found.labels),
             "give another by its own path as INPUT"});
    if (!options.scan.empty()) found.scan = options.scan;
    if (found.scan.empty())
        decided({"scan: none; the label map must cover the whole body", "--scan PATH"});
    found.table = options.table;
    if (found.table.empty()) {
        found.table = table_beside(found.labels);
        if (!found.table.empty() && !load_label_table(found.table)) {
            decided({"left out: " + name_of(found.table) + " names no values", "--table FILE"});
            found.table.clear();
        }
        if (!found.table.empty())
            decided({"names: " + name_of(found.table) + " beside the map", "--table FILE"});
        else if (options.names == "auto")
            decided({"names: as the labels say, else TotalSegmentator's numbers",
                     "--table FILE or --names NUMBERING"});
    }
    return found;
}

Result<CaseFolder> CaseFolder::open(const std::string& out) {
    CaseFolder folder;
    folder.path_ = folder_of_case(out).string();
    std::error_code code;
    fs::create_directories(folder.path_ + "/input", code);
    if (code) return Error{"folder cannot be made", folder.path_, code.message()};
    const std::string path = folder.file(kMadeFile);
    if (!fs::exists(path, code)) return folder;
    SONOCASE_TRY(const auto text, read_text_file(path));
    const auto json = nlohmann::json::parse(text, nullptr, false);
    const auto read = [&](const char* name, std::map<std::string, std::string>& to) {
        if (!json.is_object() || !json.contains(name) || !json[name].is_object()) return false;
        for (const auto& [key, value] : json[name].items()) {
            if (!value.is_string()) return false;
            to[key] = value.get<std::string>();
        }
        return true;
    };
    if (!read("made", folder.keys_) || !read("proposed", folder.proposed_))
        return Error{"is damaged", path,
                     "remove it: everything is made again, and files *.toml count as yours"};
    return folder;
}

std::string CaseFolder::key(const std::string& of) const {
    const auto found = keys_.find(of);
    return found == keys_.end() ? "" : found->second;
}

Result<bool> CaseFolder::propose(const std::string& name, std::string_view text) {
    std::error_code code;
    const std::string path = file(name);
    if (fs::exists(path, code)) {
        SONOCASE_TRY(const auto there, read_text_file(path));
        if (there == text) {
            proposed_[name] = digest_of(text);
            return true;
        }
        const auto before = proposed_.find(name);
        if (before == proposed_.end() || before->second != digest_of(std::string_view(there)))
            return false;
    }
    SONOCASE_TRY_DONE(write_file(path, text));
    proposed_[name] = digest_of(text);
    return true;
}

Status CaseFolder::withdraw_others(const std::vector<std::string>& names) {
    for (auto it = proposed_.begin(); it != proposed_.end();) {
        const std::string& name = it->first;
        if (name == "case.toml" || std::find(names.begin(), names.end(), name) != names.end()) {
            ++it;
            continue;
        }
        const auto there = read_text_file(file(name));
        std::error_code code;
        if (there && digest_of(std::string_view(*there)) == it->second)
            fs::remove(file(name), code);
        it = proposed_.erase(it);
    }
    return Done{};
}

std::vector<std::string> CaseFolder::exercises() const {
    std::vector<std::string> names;
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(path_, code))
        if (entry.path().extension() == ".toml" && entry.path().filename() != "case.toml" &&
            !entry.path().filename().string().starts_with('.'))
            names.push_back(entry.path().stem().string());
    std::sort(names.begin(), names.end());
    return names;
}

Result<std::string> CaseFolder::link(const std::string& path, const std::string& name) {
    std::error_code code;
    const std::string whole = fs::canonical(path, code).string();
    if (code) return Error{"no such file or folder", path, code.message()};
    const bool folder = fs::is_directory(whole, code);
    std::string ending;
    if (!folder) {
        ending = is_volume_file_name(whole) ? name_of(whole).substr(volume_stem(whole).size())
                                            : fs::path(whole).extension().string();
        if (ending == ".nhdr" || ending == ".mhd") return whole;
    }
    const std::string to = "input/" + name + ending;
    if (fs::read_symlink(file(to), code) == whole && !code) return to;
    fs::remove(file(to), code);
    folder ? fs::create_directory_symlink(whole, file(to), code)
           : fs::create_symlink(whole, file(to), code);
    if (code) return Error{"link cannot be made", file(to), code.message()};
    return to;
}

std::string CaseFolder::given(const std::string& path) const {
    const fs::path inside = fs::path(path).lexically_relative(file("input"));
    if (inside.empty() || *inside.begin() == ".." || *inside.begin() == ".") return path;
    std::error_code code;
    const fs::path target = fs::read_symlink(file("input") / *inside.begin(), code);
    if (code) return path;
    const fs::path below = inside.lexically_relative(*inside.begin());
    return below == "." ? target.string() : (target / below).string();
}

Status CaseFolder::save() const {
    const nlohmann::ordered_json json{{"made", keys_}, {"proposed", proposed_}};
    return write_file(file(kMadeFile), std::string_view(json.dump(2) + "\n"));
}

Result<std::string> recipe_text(const MakeOptions& options,
                                const FoundInputs& found,
                                CaseFolder& folder,
                                const Decided& decided) {
    const std::string name = fs::path(folder.path()).filename().string();
    std::string out =
        "# Written by `sonocase make`, which leaves it alone once you have changed it. Every "
        "option:\n"
        "# sonocase build --list-options\n"
        "name = " +
        quoted(name) +
        "\n# title = \"\"             # what trainees read in the list of cases; without it the "
        "name\n";
    out += "preset = " + quoted(options.preset.empty() ? "balanced" : options.preset) + "\n";
    out += "\n[inputs]\n";
    SONOCASE_TRY(const auto labels, folder.link(found.labels, "labels"));
    out += "labels = " + quoted(labels) + "\n";
    // Import looks for it beside the map, and whether it is that map's.
    const bool dataset = options.table.empty() && found.table.ends_with("dataset.json");
    std::error_code code;
    if (dataset)
        SONOCASE_TRY_DONE(folder.link(found.table, "dataset"));
    else
        fs::remove(folder.file("input/dataset.json"), code);
    if (!found.table.empty() && !dataset) {
        SONOCASE_TRY(const auto table, folder.link(found.table, "names"));
        out += "label_table = " + quoted(table) + "\n";
    }
    if (options.names != "auto") out += "label_names = " + quoted(options.names) + "\n";
    if (found.resample_shear) out += "resample_shear = true\n";
    if (!found.scan.empty()) {
        SONOCASE_TRY(const auto scan, folder.link(found.scan, "scan"));
        out += "scan = " + quoted(scan) + "      # fills in what the labels leave of the body\n";
    }
    if (options.surface.empty()) {
        out +=
            "own_skin = true          # a mannequin's surface in its place: surface = \"FILE\"\n";
        decided({"fitted to: the patient's own skin", "--surface FILE of a mannequin"});
    } else {
        SONOCASE_TRY(const auto surface, folder.link(options.surface, "surface"));
        out += "surface = " + quoted(surface) + "\n";
        if (!options.up.empty()) out += "up = [" + options.up + "]\n";
        decided({"fitted to: the mannequin " + name_of(options.surface),
                 options.up.empty() ? "--surface FILE, --up X,Y,Z where its head lies"
                                    : "--surface FILE, --up X,Y,Z"});
    }
    if (options.preset.empty())
        decided({"voxels: 1 mm (preset balanced)", "--preset draft or accurate"});
    return out;
}

}  // namespace sonocase::pipeline::inline make
