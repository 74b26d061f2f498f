// SPDX-License-Identifier: Apache-2.0

#include "formats/text/nearest_name.h"

#include <algorithm>

namespace sonocase {

int edit_distance(std::string_view a, std::string_view b) {
    // Three rows of the table: two back for swaps, one back, and the current one.
    std::vector<int> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) last[j] = static_cast<int>(j);
    for (std::size_t i = 1; i <= a.size(); ++i) {
        row[0] = static_cast<int>(i);
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const int replace = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
            row[j] = std::min({last[j] + 1, row[j - 1] + 1, replace});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                row[j] = std::min(row[j], before[j - 2] + 1);
        }
        std::swap(before, last);
        std::swap(last, row);
    }
    return last[b.size()];
}

std::string nearest_name(std::string_view name, std::span<const std::string> candidates) {
    const std::string* best = nullptr;
    int best_distance = 0;
    for (const std::string& candidate : candidates) {
        const int distance = edit_distance(name, candidate);
        if (best == nullptr || distance < best_distance) {
            best = &candidate;
            best_distance = distance;
        }
    }
    if (best == nullptr) return {};
    const int longer = static_cast<int>(std::max(name.size(), best->size()));
    return best_distance <= std::max(1, longer / 3) ? *best : std::string();
}

std::string suggest_name(std::string_view name, std::span<const std::string> candidates) {
    const std::string nearest = nearest_name(name, candidates);
    if (!nearest.empty()) return "did you mean '" + nearest + "'?";
    std::string list = "valid here: ";
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        if (i > 0) list += ", ";
        // A title with a comma in it would read as two names.
        const bool quoted = candidates[i].find(',') != std::string::npos;
        list += quoted ? "'" + candidates[i] + "'" : candidates[i];
    }
    return list;
}

std::string unknown_option(std::span<const std::string> words, std::span<const std::string> known) {
    for (const std::string& word : words) {
        if (word == "--") return {};  // what follows are no options
        if (word.size() < 3 || !word.starts_with("--")) continue;
        const std::string name = word.substr(0, word.find('='));
        if (std::find(known.begin(), known.end(), name) != known.end()) continue;
        // Dashes are common to all and make no two names alike.
        std::vector<std::string> bare;
        for (const std::string& option : known)
            if (option.starts_with("--")) bare.push_back(option.substr(2));
        const std::string nearest = nearest_name(std::string_view(name).substr(2), bare);
        return name + " is no option" +
               (nearest.empty() ? "" : "; did you mean --" + nearest + "?");
    }
    return {};
}

}  // namespace sonocase
