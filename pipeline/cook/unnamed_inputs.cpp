// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/unnamed_inputs.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <string_view>
#include <utility>
#include <vector>

namespace sonocase::pipeline::inline cook {

namespace {

namespace fs = std::filesystem;

using InputRole = std::pair<const char*, std::string RecipeInputs::*>;
constexpr std::array<InputRole, 7> kRoles{
    {{"labels", &RecipeInputs::labels},
     {"label_table", &RecipeInputs::label_table},
     {"scan", &RecipeInputs::scan},
     {"surface", &RecipeInputs::surface},
     {"examples", &RecipeInputs::examples},
     {"landmarks", &RecipeInputs::landmarks},
     {"surface_landmarks", &RecipeInputs::surface_landmarks}}};

// Endings that tell a format. That of a folder may be half of a name.
std::string usual_ending(const std::string& path) {
    std::string low;
    for (const char c : path) low += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    for (const char* ending :
         {".nii.gz", ".nii",    ".seg.nrrd", ".nrrd", ".nhdr", ".mhd",  ".mha",
          ".dcm",    ".labels", ".csv",      ".tsv",  ".txt",  ".json", ".ctbl",
          ".label",  ".glb",    ".stl",      ".ply",  ".obj",  ".vtp",  ".vtk"})
        if (low.ends_with(ending)) return ending;
    return "";
}

// Where the string of a TOML text ends that begins at `at` with a quote: behind its last quote.
std::size_t end_of_string(std::string_view toml, std::size_t at) {
    const char quote = toml[at];
    const std::string three(3, quote);
    const bool lines = toml.substr(at, 3) == three;
    for (std::size_t n = at + (lines ? 3 : 1); n < toml.size(); ++n) {
        if (quote == '"' && toml[n] == '\\') {
            ++n;
        } else if (lines && toml.substr(n, 3) == three) {
            n += 3;
            while (n < toml.size() && toml[n] == quote) ++n;  // up to two may stand inside
            return n;
        } else if (!lines && toml[n] == quote) {
            return n + 1;
        }
    }
    return toml.size();
}

// The last word of the key before a value: `labels` of `inputs.labels = `.
std::string_view key_before(std::string_view written) {
    const auto trim = [&] {
        while (!written.empty() && (written.back() == ' ' || written.back() == '\t'))
            written.remove_suffix(1);
    };
    trim();
    if (written.empty() || written.back() != '=') return {};
    written.remove_suffix(1);
    trim();
    std::size_t from = written.size();
    while (from > 0 && (std::isalnum(static_cast<unsigned char>(written[from - 1])) != 0 ||
                        written[from - 1] == '_'))
        --from;
    return written.substr(from);
}

void replace_all(std::string& text, const std::string& word, const std::string& by) {
    if (word.empty()) return;
    for (std::size_t at = 0; (at = text.find(word, at)) != text.npos; at += by.size())
        text.replace(at, word.size(), by);
}

// What may stand in a report for the inputs, longest first, and what takes its place.
std::vector<std::pair<std::string, std::string>> words_of_inputs(const Recipe& recipe) {
    std::vector<std::pair<std::string, std::string>> words;
    for (const auto& [role, member] : kRoles) {
        const std::string& given = recipe.inputs.*member;
        if (given.empty()) continue;
        const std::string by = role_of_input(recipe, given), path = recipe.resolve(given);
        std::error_code code;
        const fs::path real = fs::canonical(path, code);
        const auto add_name = [&](const fs::path& file, const std::string& as) {
            // Not a number, nor a word that a sentence may hold.
            const std::string name = file.filename().string();
            if (name.size() > 4 && name.find_first_of("._-0123456789 ") != name.npos &&
                std::any_of(name.begin(), name.end(), [](char c) {
                    return std::isalpha(static_cast<unsigned char>(c)) != 0;
                }))
                words.emplace_back(name, as);
        };
        for (const fs::path& one :
             {fs::path(given), fs::path(path), fs::absolute(path, code).lexically_normal(), real}) {
            if (one.has_parent_path()) words.emplace_back(one.string(), by);
            add_name(one, by);
        }
        if (!fs::is_directory(real, code)) {
            if (real.has_parent_path()) words.emplace_back(real.parent_path().string() + "/", "");
            continue;
        }
        if (member != &RecipeInputs::labels && member != &RecipeInputs::scan) continue;
        for (auto it = fs::recursive_directory_iterator(real, code);
             !code && it != fs::recursive_directory_iterator(); it.increment(code))
            add_name(it->path(), "a file of " + std::string(role));
    }
    std::stable_sort(words.begin(), words.end(),
                     [](const auto& a, const auto& b) { return a.first.size() > b.first.size(); });
    return words;
}

}  // namespace

std::string role_of_input(const Recipe& recipe, const std::string& given) {
    for (const auto& [role, member] : kRoles)
        if (recipe.inputs.*member == given) return role + usual_ending(given);
    return fs::path(given).filename().string();
}

std::string recipe_without_names(const Recipe& recipe) {
    const std::string& toml = recipe.text;
    std::string out;
    for (std::size_t at = 0; at < toml.size();) {
        const char c = toml[at];
        if (c == '#') {
            at = std::min(toml.find('\n', at), toml.size());
            while (!out.empty() && (out.back() == ' ' || out.back() == '\t')) out.pop_back();
            if (at < toml.size() && (out.empty() || out.back() == '\n')) ++at;  // a whole line
        } else if (c == '"' || c == '\'') {
            const std::size_t end = end_of_string(toml, at);
            const std::string text = toml.substr(at, end - at);
            const std::string_view key = key_before(out);
            at = end;
            const auto role = std::find_if(kRoles.begin(), kRoles.end(),
                                           [&](const InputRole& r) { return key == r.first; });
            const std::string given = role == kRoles.end() ? "" : recipe.inputs.*role->second;
            // An escape may write the same path in other letters.
            if (!given.empty() && (text.find(given) != text.npos || text.find('\\') != text.npos))
                out += '"' + role_of_input(recipe, given) + '"';
            else
                out += text;
        } else {
            out += c;
            ++at;
        }
    }
    return out;
}

void leave_out_names(const Recipe& recipe, CaseManifest& manifest) {
    manifest.recipe = recipe_without_names(recipe);
    for (InputHash& input : manifest.inputs) input.path = role_of_input(recipe, input.path);
    const auto words = words_of_inputs(recipe);
    const auto mend = [&](std::string& text) {
        for (const auto& [word, by] : words) replace_all(text, word, by);
    };
    for (StageReport& report : manifest.stages) {
        for (std::string& warning : report.warnings) mend(warning);
        for (Note& note : report.notes) mend(note.text);
    }
}

}  // namespace sonocase::pipeline::inline cook
